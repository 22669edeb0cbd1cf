//! The dense oracle: one step of *any* scheme, solved straight from the definition of the discrete
//! Lagrangian (Marsden & West 2001, §2.6.3 and §3.6.5), for small systems and to round-off.
//!
//! ```text
//! S(Q_0 … Q_s) = h Σ_i b_i L(q(c_i h), q̇(c_i h)),   q the polynomial through Q_0 = q_0 … Q_s = q_1
//! L_d(q_0, q_1) = ext over Q_1 … Q_{s−1} of S
//! p_0 = −∂L_d/∂q_0,   p_1 = ∂L_d/∂q_1               (discrete Legendre transforms)
//! ```
//!
//! Given (q_0, p_0), the s vector equations ∂S/∂Q_0 = −p_0, ∂S/∂Q_k = 0 (0 < k < s) have the
//! unknowns Q_1 … Q_s. Fast kernels are checked against this room, so it must not know the closed
//! formula of any scheme.

use nalgebra::{DMatrix, DVector};

use crate::interpolation::Basis;
use crate::{CoreError, Potential, Scheme, State, System, packed_len};

/// Newton iterations before the step is given up.
const MAX_ITERATIONS: usize = 60;
/// An update this small against the positions, and no longer reducing the residual, is round-off.
const ROUND_OFF_UPDATE: f64 = 1e-10;

/// One step of length h (s) of the scheme from `state`, by Newton's method to round-off.
///
/// The cost is that of dense matrices of s · `free_count` rows: for tests and small systems.
///
/// # Errors
/// - [`CoreError::Degenerate`] where the quadrature cannot see every velocity of the interpolation
///   (fewer points than the degree), so that no momentum determines the step;
/// - [`CoreError::Length`] where the state has not one entry a free coordinate;
/// - [`CoreError::StepSize`] where h is zero or not finite;
/// - [`CoreError::SingularStep`] where D₁D₂L_d has no inverse at this h;
/// - [`CoreError::Convergence`] where Newton's method stalls.
pub fn step(system: &System, scheme: &Scheme, state: &State, h: f64) -> Result<State, CoreError> {
    let action = Action::new(system, scheme, state, h)?;
    let increments = action.solve()?;
    let n = state.q.len();
    let last = &increments[increments.len() - n..];
    let q = state.q.iter().zip(last).map(|(q, u)| q + u).collect();
    let momenta = action.gradient(&increments);
    Ok(State { t: state.t + h, q, p: momenta[momenta.len() - n..].to_vec() })
}

/// The discrete Lagrangian L_d (J s) of the step from `state`: the action S at its solution.
///
/// # Errors
/// As [`step`].
pub fn discrete_lagrangian(
    system: &System,
    scheme: &Scheme,
    state: &State,
    h: f64,
) -> Result<f64, CoreError> {
    let action = Action::new(system, scheme, state, h)?;
    Ok(action.value(&action.solve()?))
}

/// The action S of one step as a function of the increments U_j = Q_j − q_0, j = 1 … s.
struct Action<'a> {
    system: &'a System,
    state: &'a State,
    h: f64,
    degree: usize,
    control_points: Vec<f64>,
    samples: Vec<Sample>,
}

/// One quadrature point: time, weight b_i, basis values and slopes there.
struct Sample {
    t: f64,
    weight: f64,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl<'a> Action<'a> {
    fn new(system: &'a System, scheme: &Scheme, state: &'a State, h: f64) -> Result<Self, CoreError> {
        let expected = system.coordinates().free_count();
        for (what, array) in [("q of the state", &state.q), ("p of the state", &state.p)] {
            if array.len() != expected {
                return Err(CoreError::Length { what, expected, found: array.len() });
            }
        }
        if h == 0.0 || !h.is_finite() {
            return Err(CoreError::StepSize { h });
        }
        let degree = scheme.interpolation.degree();
        let basis = Basis::new(degree)?;
        let rule = &scheme.quadrature;
        let samples = rule.nodes().iter().zip(rule.weights()).map(|(&c, &weight)| Sample {
            t: state.t + c * h,
            weight,
            values: basis.values(c),
            slopes: basis.slopes(c),
        });
        let control_points = basis.points().to_vec();
        let action = Self { system, state, h, degree, control_points, samples: samples.collect() };
        if action.kinetic_form_is_singular() {
            return Err(CoreError::Degenerate { degree, points: rule.nodes().len() });
        }
        Ok(action)
    }

    /// Is Σ_i b_i ℓ'_k(c_i) ℓ'_j(c_i), k = 0 … s−1, j = 1 … s, without an inverse?
    fn kinetic_form_is_singular(&self) -> bool {
        let s = self.degree;
        let entry = |k: usize, j: usize| -> f64 {
            self.samples.iter().map(|point| point.weight * point.slopes[k] * point.slopes[j + 1]).sum()
        };
        let singular = DMatrix::from_fn(s, s, entry).singular_values();
        singular.min() <= 1e-10 * singular.max()
    }

    /// Σ_j w_j U_j: a combination of the increments.
    fn combine(&self, weights: &[f64], increments: &[f64]) -> Vec<f64> {
        let n = self.state.q.len();
        let mut sum = vec![0.0; n];
        for (block, weight) in increments.chunks_exact(n).zip(&weights[1..]) {
            for (total, u) in sum.iter_mut().zip(block) {
                *total += weight * u;
            }
        }
        sum
    }

    /// Positions x of all coordinates at a quadrature point.
    fn positions(&self, sample: &Sample, increments: &[f64]) -> Vec<f64> {
        let mut q = self.combine(&sample.values, increments);
        for (q, q_0) in q.iter_mut().zip(&self.state.q) {
            *q += q_0;
        }
        let mut x = vec![0.0; self.system.coordinates().dof_count()];
        self.system.coordinates().embed(&q, sample.t, &mut x);
        x
    }

    /// Velocities q̇ at a quadrature point; the basis slopes sum to zero, so q_0 drops out.
    fn velocities(&self, sample: &Sample, increments: &[f64]) -> Vec<f64> {
        let mut v = self.combine(&sample.slopes, increments);
        v.iter_mut().for_each(|v| *v /= self.h);
        v
    }

    /// S(U), J s.
    fn value(&self, increments: &[f64]) -> f64 {
        let mass = self.system.free_mass();
        let mut sum = 0.0;
        for sample in &self.samples {
            let v = self.velocities(sample, increments);
            let kinetic: f64 = v.iter().zip(mass).map(|(v, m)| 0.5 * m * v * v).sum();
            let x = self.positions(sample, increments);
            sum += self.h * sample.weight * (kinetic - energy(self.system, &x, sample.t));
        }
        sum
    }

    /// ∂S/∂Q_k for k = 0 … s, one block after the other:
    /// h Σ_i b_i (ℓ'_k(c_i)/h · M q̇_i − ℓ_k(c_i) ∇V_i).
    fn gradient(&self, increments: &[f64]) -> Vec<f64> {
        let n = self.state.q.len();
        let mass = self.system.free_mass();
        let mut out = vec![0.0; (self.degree + 1) * n];
        let mut force = vec![0.0; n];
        for sample in &self.samples {
            let v = self.velocities(sample, increments);
            let x = self.positions(sample, increments);
            self.system.coordinates().restrict(&gradient(self.system, &x, sample.t), &mut force);
            for (k, block) in out.chunks_exact_mut(n).enumerate() {
                let (inertia, potential) =
                    (sample.weight * sample.slopes[k], self.h * sample.weight * sample.values[k]);
                for i in 0..n {
                    block[i] += inertia * mass[i] * v[i];
                    // A basis function that vanishes here must not see a force, finite or not.
                    if potential != 0.0 {
                        block[i] -= potential * force[i];
                    }
                }
            }
        }
        out
    }

    /// The equations to solve: ∂S/∂Q_k for k = 0 … s−1, with p_0 added to the first.
    fn residual(&self, increments: &[f64]) -> DVector<f64> {
        let mut residual = self.gradient(increments);
        residual.truncate(increments.len());
        for (r, p) in residual.iter_mut().zip(&self.state.p) {
            *r += p;
        }
        DVector::from_vec(residual)
    }

    /// ∂²S/∂Q_k∂Q_j for k = 0 … s−1, j = 1 … s: Σ_i b_i (ℓ'_k ℓ'_j M/h − h ℓ_k ℓ_j ∇∇V_i).
    fn jacobian(&self, increments: &[f64]) -> DMatrix<f64> {
        let n = self.state.q.len();
        let mass = self.system.free_mass();
        let free = self.system.coordinates().free();
        let mut out = DMatrix::zeros(self.degree * n, self.degree * n);
        for sample in &self.samples {
            let full = hessian(self.system, &self.positions(sample, increments), sample.t);
            for k in 0..self.degree {
                for j in 0..self.degree {
                    let inertia = sample.weight * sample.slopes[k] * sample.slopes[j + 1] / self.h;
                    let potential = self.h * sample.weight * sample.values[k] * sample.values[j + 1];
                    for a in 0..n {
                        out[(k * n + a, j * n + a)] += inertia * mass[a];
                        if potential == 0.0 {
                            continue;
                        }
                        for b in 0..n {
                            out[(k * n + a, j * n + b)] -=
                                potential * full[(free[a] as usize, free[b] as usize)];
                        }
                    }
                }
            }
        }
        out
    }

    /// Newton's method with backtracking on the residual, from uniform motion.
    fn solve(&self) -> Result<Vec<f64>, CoreError> {
        let mass = self.system.free_mass();
        let uniform = |d: &f64| -> Vec<f64> {
            self.state.p.iter().zip(mass).map(|(p, m)| d * self.h * p / m).collect()
        };
        let mut u = DVector::from_vec(self.control_points[1..].iter().flat_map(uniform).collect());
        let mut residual = self.residual(u.as_slice());
        if residual.iter().any(|r| !r.is_finite()) {
            u.fill(0.0);
            residual = self.residual(u.as_slice());
        }
        let extent = self.state.q.iter().fold(0.0, |max: f64, q| max.max(q.abs()));
        for _ in 0..MAX_ITERATIONS {
            let norm = residual.norm();
            if norm == 0.0 {
                return Ok(u.data.into());
            }
            let Some(update) = self.jacobian(u.as_slice()).lu().solve(&residual) else {
                return Err(CoreError::SingularStep { h: self.h });
            };
            let is_tiny = update.amax() <= ROUND_OFF_UPDATE * (extent + u.amax());
            let mut scale = 1.0;
            loop {
                let trial = &u - scale * &update;
                let trial_residual = self.residual(trial.as_slice());
                let trial_norm = trial_residual.norm();
                if is_tiny && (trial_norm.is_nan() || trial_norm > 0.25 * norm) {
                    // Round-off: the residual cannot fall further. Keep the better of the two.
                    return Ok(if trial_norm < norm { trial } else { u }.data.into());
                }
                if trial_norm <= (1.0 - 1e-4 * scale) * norm {
                    (u, residual) = (trial, trial_residual);
                    break;
                }
                scale *= 0.5;
                if scale < 1e-9 {
                    return Err(CoreError::Convergence { iterations: MAX_ITERATIONS, residual: norm });
                }
            }
        }
        Err(CoreError::Convergence { iterations: MAX_ITERATIONS, residual: residual.norm() })
    }
}

/// V(x, t), J.
pub fn energy(system: &System, x: &[f64], t: f64) -> f64 {
    let mut total = 0.0;
    for potential in system.potentials() {
        let count = potential.stencils().count();
        let mut local = vec![0.0; count];
        potential.energies(0..count, x, t, &mut local);
        total += local.iter().sum::<f64>();
    }
    total
}

/// ∂V/∂x (N), one entry a coordinate x_i.
pub fn gradient(system: &System, x: &[f64], t: f64) -> Vec<f64> {
    let mut total = vec![0.0; x.len()];
    for potential in system.potentials() {
        let count = potential.stencils().count();
        let size = potential.stencils().size();
        let mut local = vec![0.0; count * size];
        potential.gradients(0..count, x, t, &mut local);
        for (stencil, block) in local.chunks_exact(size).enumerate() {
            for (dof, value) in local_dofs(potential.as_ref(), stencil).zip(block) {
                total[dof] += value;
            }
        }
    }
    total
}

/// ∂²V/∂x² (N/m), a full symmetric matrix over all coordinates x_i.
pub fn hessian(system: &System, x: &[f64], t: f64) -> DMatrix<f64> {
    let mut total = DMatrix::zeros(x.len(), x.len());
    for potential in system.potentials() {
        let count = potential.stencils().count();
        let size = potential.stencils().size();
        let mut local = vec![0.0; count * packed_len(size)];
        potential.hessians(0..count, x, t, &mut local);
        for (stencil, block) in local.chunks_exact(packed_len(size)).enumerate() {
            let dofs: Vec<usize> = local_dofs(potential.as_ref(), stencil).collect();
            for i in 0..size {
                for j in 0..=i {
                    let value = block[packed_len(i) + j];
                    total[(dofs[i], dofs[j])] += value;
                    if i != j {
                        total[(dofs[j], dofs[i])] += value;
                    }
                }
            }
        }
    }
    total
}

/// The coordinates of one stencil, in the order of its local block.
fn local_dofs(potential: &dyn Potential, stencil: usize) -> impl Iterator<Item = usize> {
    let stencils = potential.stencils();
    let block = stencils.block;
    stencils.of(stencil).iter().flat_map(move |&node| (0..block).map(move |k| node as usize * block + k))
}
