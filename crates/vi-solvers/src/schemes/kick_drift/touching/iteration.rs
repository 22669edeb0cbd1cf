//! Newton's iteration for a drift: forces of the pairs, the small system, and corrections on free paths.

use vi_core::{State, System};

use super::Touching;
use crate::assemble::free_path::make_uniform;
use crate::error::SolverError;
use crate::newton::attempt::relative_error;
use crate::newton::soft_bristles::{self, Aim, Attempt, Frictional, Iteration, Progress, Verdict};
use crate::newton::start::Start;
use crate::vectors;

/// Largest number of Newton iterations of one series. Drifts that converge need three to ten.
const MOST_ITERATIONS: u32 = 40;
/// Largest length of a correction, as a multiple of the longest motion of a node in the free drift, or of the reach of the terms if
/// that is longer: nodes at rest in a layer have no free motion, and leave it. A much longer correction would make candidates of all
/// pairs.
const FARTHEST: f64 = 2.0;
/// Relative error below which Newton's method uses the tangents of directions too. Farther from the solution they are the tangents of
/// forces that are much too large. A cloth of 40 × 40 cells on a sphere takes 8955, 8660, 8409 and 7951 iterations and 3.2, 3.2, 3.3
/// and 3.7 s with 3e-3, 3e-2, .1 and .3.
const NEAR: f64 = 3e-2;
/// Relative error to which the linear systems are solved far from the solution. With 1e-4, a cloth on a sphere takes 2 % fewer
/// iterations, with 1e-3 1 % fewer, on which 6 % more pairs act.
const COARSE: f64 = 1e-5;
/// Near the solution, they are solved to this fraction of the relative error of the last iteration, to which Newton's method
/// reduces it, and at best to `FINE`. With `COARSE` for all iterations, the linear solves determine the last ones: errors decrease to
/// a few hundredths instead of thousandths, more than the iteration before predicts, so Newton's method ends too early, and nodes with
/// other numbers move differently by 1e-9 of the energy. With `FINE` for all, a folded cloth (`benches/layers.py folded --cells 50`)
/// takes 2.3 instead of 1.8 s for 60 steps, in equally many iterations.
const FORCING: f64 = 0.1;
const FINE: f64 = 1e-9;
/// Relative resolution of positions: forces of a stiff layer have several times the round-off of positions.
const RESOLUTION: f64 = 8.0 * f64::EPSILON;

/// A drift over h (s) that is being solved.
struct Drift<'a> {
    touching: &'a mut Touching,
    system: &'a System,
    state: &'a State,
    h: f64,
    /// Largest length of a correction, m.
    longest: f64,
    iterations: u32,
    /// Whether the start is the free drift, on a free path.
    is_free: bool,
    /// Whether it was found that no term acts along the free drift.
    acts: bool,
}

impl Touching {
    /// Solves for y. Returns false if no term acts along the free drift.
    pub(super) fn solve(
        &mut self,
        system: &System,
        state: &State,
        h: f64,
        may_divide: bool,
    ) -> Result<bool, SolverError> {
        // The end of the step is still that of the free drift.
        let longest = FARTHEST * self.lists.farthest().max(self.lists.shortest_reach());
        let tolerance = self.tolerance;
        let mut drift =
            Drift { touching: self, system, state, h, longest, iterations: 0, is_free: false, acts: true };
        let (start, most) = (Start::Inertial, MOST_ITERATIONS);
        if let Err(failed) = soft_bristles::solve_plainly(&mut drift, start, tolerance, most) {
            let attempts = Attempt::after_plain(start, may_divide, drift.touching.acting.has_friction());
            drift.touching.work.softenings += u64::from(!attempts.is_empty());
            soft_bristles::solve_in_stages(&mut drift, &attempts, failed, tolerance, most)?;
        }
        if !drift.acts {
            // If the terms have a memory, only that must be closed.
            return Ok(self.passage.remembers());
        }
        system.coordinates().embed(&self.y, state.t + h, &mut self.x_end);
        self.lists.widen(&self.x_end);
        self.check_path().map(|()| true)
    }
}

impl Frictional for Drift<'_> {
    /// Begins with the free drift, as far as its path is free.
    ///
    /// The impulses of earlier drifts are no better start, because contact forces do not repeat: a cloth of 40 × 40 cells on a sphere takes
    /// 8939 iterations, 8576 in the same time with those of the last drift, 9203 with those of the one before, 8871 with their mean.
    fn begin(&mut self, _start: Start) {
        let Self { touching, system, state, h, is_free, .. } = self;
        touching.small.begin();
        touching.acting.restart();
        touching.acting.compliance = touching.compliance.over_step(system, 0.5 * *h * *h);
        let Touching { y, small, bodies, inertial, .. } = &mut **touching;
        y.clone_from(if bodies.is_some() { inertial } else { &small.drifted });
        let mut delta: Vec<f64> = y.iter().zip(&state.q).map(|(y, q)| y - q).collect();
        *is_free = touching.shorten(system, &state.q, &mut delta, state.t + *h, true);
        if !*is_free {
            vectors::update(&mut touching.y, |k, y| *y = state.q[k] + delta[k]);
            // An error shows again in the first iteration.
            touching.project().ok();
        }
    }

    fn unknowns(&self) -> Vec<f64> {
        self.touching.y.clone()
    }

    fn go_to(&mut self, unknowns: &[f64]) {
        self.touching.y.copy_from_slice(unknowns);
    }

    fn iterate(&mut self, aim: Aim) -> Result<(), SolverError> {
        let Self { touching, system, state, h, longest, iterations, is_free, acts } = self;
        let (coordinates, mass) = (system.coordinates(), system.free_mass());
        let (c, t) = (0.5 * *h * *h, state.t + *h);
        // The lists are valid at all iterates, because they were made valid for the checks of the paths to them.
        let mut version = touching.lists.version();
        let mut terms = touching.over_step();
        let mut progress = Progress::towards(aim);
        let mut delta = vec![0.0; state.q.len()];
        let mut eta = f64::INFINITY;
        touching.acting.stiffness = aim.stiffness;
        loop {
            touching.interrupt.check()?;
            coordinates.embed(&touching.y, t, &mut touching.x_end);
            if touching.lists.version() != version {
                version = touching.lists.version();
                terms = touching.over_step();
            }
            let is_near = eta < NEAR;
            touching.acting.turns = is_near;
            touching.acting.penalty = progress.penalty();
            touching.evaluate(&terms);
            if std::mem::take(is_free) && touching.acting.count() == 0 {
                *acts = false;
                return Ok(());
            }
            let (small, acting) = (&mut touching.small, &touching.acting);
            small.load(system, &touching.free_of, acting, c, &touching.y);
            if let Some(bodies) = &mut touching.bodies {
                small.reduce(bodies, &state.q, &touching.y)?;
            }
            let size = small.size(mass);
            touching.work.newton_iterations += 1;
            *iterations += 1;
            let is_accurate = is_near && aim.stiffness == 1.0;
            let forcing = if is_accurate { (FORCING * eta).clamp(FINE, COARSE) } else { COARSE };
            let decrement = small.correct(mass, forcing)?;
            let scale = small.scale(mass, &state.q, &touching.y);
            // Pairs that do not push yet give no correction, and may touch no free coordinate.
            eta = relative_error(decrement, scale);
            if !eta.is_finite() {
                break;
            }
            delta.fill(0.0);
            let bodies = touching.bodies.as_ref();
            let is_short = small.spread(&mut delta, *longest, mass, bodies);
            let mut whole = vec![0.0; if aim.is_uniform { delta.len() } else { 0 }];
            if aim.is_uniform {
                small.spread(&mut whole, f64::INFINITY, mass, bodies);
            }
            let is_at_resolution = small.is_at_resolution(mass, &state.q, RESOLUTION);
            let unlawful = acting.unlawful();
            let from = std::mem::take(&mut touching.y);
            let is_whole = touching.shorten(system, &from, &mut delta, t, false) && is_short;
            touching.y = from;
            if aim.is_uniform {
                make_uniform(&whole, &mut delta);
            }
            vectors::update(&mut touching.y, |k, y| *y += delta[k]);
            touching.project()?;
            let small = &touching.small;
            touching.acting.predict(|tangent| small.along(tangent, &delta));
            match progress.judge(&Iteration {
                eta,
                size,
                is_whole,
                unlawful,
                forces: 0.0,
                round_off: 0.0,
                is_at_resolution,
            }) {
                Verdict::Solved => {
                    touching.small.follow(mass, &delta, &touching.y);
                    return Ok(());
                }
                Verdict::Hopeless => break,
                Verdict::Continue => {}
            }
            if progress.part() < 1.0 {
                let back = progress.part() - 1.0;
                vectors::update(&mut touching.y, |k, y| *y += back * delta[k]);
                touching.project()?;
            }
        }
        Err(SolverError::NoConvergence { iterations: *iterations, residual: eta, tolerance: aim.tolerance })
    }
}
