//! Newton's method for an equilibrium with friction. The tangent J = A + E is not symmetric, because friction follows
//! pressure: GMRES solves (I + A⁻¹E) δ = −A⁻¹r, where A is the symmetric model that is factored. There is no energy whose
//! decrease could guide a line search. `soft_bristles` finds which pairs stick and which slide.

use crate::equilibrium::balance::Balance;
use crate::equilibrium::lagging::{self, Reached};
use crate::equilibrium::newton::{self, Solved, Stop, factorize_definite};
use crate::equilibrium::tangent_solver::Demand;
use crate::error::SolverError;
use crate::linear::perturbed::{self, Perturbed};
use crate::newton::attempt::relative_error;
use crate::newton::soft_bristles::{self, Aim, Attempt, Frictional, Iteration, Progress, Verdict};
use crate::newton::start::Start;
use crate::vectors;

/// Relative error to which J δ = −r is solved.
const FORCING: f64 = 1e-6;
/// Relative accuracy of solves with A by conjugate gradients.
const ACCURACY: f64 = Demand::WITH_FRICTION.accuracy;
/// Smallest fraction of a correction.
const SHORTEST: f64 = 1.0 / 64.0;
/// Largest growth of the residual, in the norm of the diagonal of A, that a correction may cause. Corrections into a layer
/// may let it grow for a few iterations.
const GROWTH: f64 = 1e4;
/// Longest correction of a body that nothing holds, as a multiple of the distance after which pairs are searched again.
const REACHES: f64 = 20.0;
/// Longest correction as a fraction of the extent of the bodies. A body that slides farther than its extent in one
/// increment counts as unsupported.
const FARTHEST: f64 = 0.1;

/// Number of solves in succession by passes with lagged friction that may fail in a search. They take long to fail.
const MOST_FAILED_LAGS: u32 = 3;

struct Rubbing<'a, 'b> {
    balance: &'a mut Balance<'b>,
    start: Vec<f64>,
    q: Vec<f64>,
    t: f64,
    stop: &'a mut Stop,
    done: u32,
    stayed_definite: bool,
}

/// Iterates from `q` to an equilibrium at t, with friction if the bodies have any.
pub(super) fn solve(
    balance: &mut Balance,
    q: &mut [f64],
    t: f64,
    stop: &mut Stop,
) -> Result<Solved, SolverError> {
    if balance.friction.is_none() {
        return newton::solve(balance, q, t, stop);
    }
    let (tolerance, most) = (stop.tolerance, 2 * stop.max_iterations);
    stop.scale = stop.scale.max(1e-12 * balance.energy_scale(q, t));
    let scale = stop.scale;
    let start = q.to_vec();
    let mut series = Rubbing { balance, q: start.clone(), start, t, stop, done: 0, stayed_definite: true };
    // If the plain attempt fails: passes with lagged friction, and then softer bristles.
    if let Err(failed) = soft_bristles::solve_plainly(&mut series, Start::Still, tolerance, most) {
        if failed.is_interruption() {
            return Err(failed);
        }
        // The first corrections of the series that failed may be far too long.
        let scale_of_series = std::mem::replace(&mut series.stop.scale, scale);
        match series.lag(Aim::plain(tolerance, most)) {
            Ok(Some(solved)) => {
                q.copy_from_slice(&series.q);
                return Ok(solved);
            }
            // Where no friction of a pass stops the bodies, soft bristles do not either.
            Err(error) if error.is_interruption() || error.moves_away() => return Err(error),
            _ => {}
        }
        series.stop.scale = scale_of_series;
        series.balance.work.softenings += 1;
        let attempts = Attempt::after_plain(Start::Still, false, true);
        soft_bristles::solve_in_stages(&mut series, &attempts, failed, tolerance, most)?;
    }
    q.copy_from_slice(&series.q);
    let Rubbing { done: iterations, stayed_definite, .. } = series;
    Ok(Solved { iterations, stayed_definite, made_passes: false })
}

impl Rubbing<'_, '_> {
    /// Solves the equations by passes with lagged friction. Returns `None` if other forces have no potential, or if passes have failed too
    /// often. `aim` is that of Newton's method where passes converge slowly.
    fn lag(&mut self, aim: Aim) -> Result<Option<Solved>, SolverError> {
        let only_friction_dissipates = self.balance.only_friction_dissipates();
        let Some(friction) = self.balance.friction.as_mut() else { return Ok(None) };
        if !only_friction_dissipates || friction.failed_lags >= MOST_FAILED_LAGS {
            return Ok(None);
        }
        friction.set_predicts(false);
        self.q.copy_from_slice(&self.start);
        let passes = lagging::solve(self.balance, &mut self.q, self.t, self.stop);
        if let Some(friction) = &mut self.balance.friction {
            friction.set_predicts(true);
        }
        let outcome = passes.and_then(|reached| match reached {
            Reached::Equilibrium(solved) => Ok(solved),
            Reached::Neighbourhood(solved) => self.polish(aim).map(|()| solved),
        });
        if let Some(friction) = &mut self.balance.friction {
            match &outcome {
                Ok(_) => friction.failed_lags = 0,
                Err(error) if error.moves_away() => {}
                Err(_) => friction.failed_lags += 1,
            }
        }
        outcome.map(|solved| Some(Solved { iterations: self.done + solved.iterations, ..solved }))
    }

    /// Goes on from the place that passes with lagged friction have reached, with the friction of each iterate.
    fn polish(&mut self, aim: Aim) -> Result<(), SolverError> {
        if let Some(friction) = &mut self.balance.friction {
            friction.restart();
        }
        self.iterate(aim)
    }

    /// Returns δ = −J⁻¹r and the energies −δᵀr of it and of −A⁻¹r, J.
    fn correct(&mut self, r: &[f64]) -> Result<(Vec<f64>, f64, f64), SolverError> {
        let balance = &mut *self.balance;
        let mut delta: Vec<f64> = r.iter().map(|r| -r).collect();
        balance.solve(&mut delta, ACCURACY)?;
        balance.work.newton_iterations += 1;
        let energy = |delta: &[f64]| -vectors::dot(delta, r);
        let first = energy(&delta);
        let mut correction = Correction { balance, delta };
        perturbed::solve(&mut correction, vectors::norm(r), FORCING)?;
        let own = energy(&correction.delta);
        Ok((correction.delta, own, first))
    }
}

/// The equations of a correction δ.
struct Correction<'a, 'b> {
    balance: &'a mut Balance<'b>,
    delta: Vec<f64>,
}

impl Perturbed for Correction<'_, '_> {
    type Error = SolverError;

    fn defect(&mut self, v: &[f64]) -> Option<Vec<f64>> {
        let mut image = vec![0.0; v.len()];
        self.balance.friction.as_mut()?.add_defect(v, &mut image);
        Some(image)
    }

    fn invert(&mut self, v: &mut [f64]) -> Result<(), SolverError> {
        self.balance.solve(v, ACCURACY)
    }

    fn add(&mut self, r: &[f64]) -> Result<(), SolverError> {
        let mut change = r.to_vec();
        self.balance.solve(&mut change, ACCURACY)?;
        vectors::update(&mut self.delta, |k, value| *value += change[k]);
        Ok(())
    }

    fn solution(&mut self) -> &[f64] {
        &self.delta
    }
}

impl Frictional for Rubbing<'_, '_> {
    fn begin(&mut self, _start: Start) {
        self.q.copy_from_slice(&self.start);
        if let Some(friction) = &mut self.balance.friction {
            friction.restart();
        }
    }

    fn unknowns(&self) -> Vec<f64> {
        self.q.clone()
    }

    fn go_to(&mut self, unknowns: &[f64]) {
        self.q.copy_from_slice(unknowns);
    }

    fn iterate(&mut self, aim: Aim) -> Result<(), SolverError> {
        if let Some(friction) = &mut self.balance.friction {
            friction.set_stiffness(aim.stiffness);
        }
        let mut progress = Progress::towards(aim);
        let t = self.t;
        let mut r = vec![0.0; self.q.len()];
        let mut eta = f64::INFINITY;
        self.balance.residual(&self.q, t, &mut r)?;
        for _ in 0..aim.most {
            let is_definite = factorize_definite(self.balance, &self.q, t)?;
            let is_at_resolution = self.balance.is_round_off(&r);
            let (mut delta, energy, size) = self.correct(&r)?;
            self.done += 1;
            self.stayed_definite &= is_definite;
            let extent = self.balance.extent();
            // A body that nothing holds yet would go far.
            let allowed = if is_definite { f64::INFINITY } else { REACHES * self.balance.reach() };
            let allowed = allowed.min(FARTHEST * extent);
            let farthest = vectors::max_abs(delta.len(), |k| delta[k]);
            let is_cut = farthest > allowed;
            if is_cut {
                delta.iter_mut().for_each(|delta| *delta *= allowed / farthest);
            }
            let longest = self.balance.largest_step(&self.q, t, &delta);
            if self.done == 1 {
                self.stop.scale = self.stop.scale.max(longest * energy.abs());
            }
            eta = relative_error(energy, self.stop.scale);
            let unlawful = self.balance.friction.as_ref().and_then(|friction| friction.unlawful());
            if let Some(friction) = &mut self.balance.friction {
                friction.predict(longest, &delta);
            }
            let before = self.balance.scaled_norm(&r);
            let place = self.q.clone();
            let mut fraction = longest;
            let outcome = loop {
                vectors::fill(&mut self.q, |k| place[k] + fraction * delta[k]);
                let outcome = self.balance.residual(&self.q, t, &mut r);
                let grows = outcome.is_ok() && self.balance.scaled_norm(&r) > GROWTH * before;
                if (outcome.is_ok() && !grows) || fraction <= SHORTEST * longest {
                    break outcome;
                }
                self.balance.work.line_searches += 1;
                fraction *= 0.5;
            };
            outcome?;
            let iteration = Iteration {
                eta,
                size: size.abs(),
                is_whole: fraction == 1.0 && !is_cut,
                unlawful,
                forces: 0.0,
                round_off: 0.0,
                is_at_resolution,
            };
            if vectors::max_abs(self.q.len(), |k| self.q[k] - self.start[k]) > extent {
                break;
            }
            match progress.judge(&iteration) {
                Verdict::Solved => return Ok(()),
                Verdict::Hopeless => break,
                Verdict::Continue => {}
            }
        }
        Err(SolverError::NoConvergence { iterations: self.done, residual: eta, tolerance: aim.tolerance })
    }
}
