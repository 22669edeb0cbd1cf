//! Estimates the highest frequency of a body, which limits the step of every explicit scheme. It uses Lanczos'
//! method on M^{-1/2} K M^{-1/2}, with K v from differences of two gradients. It must not build a Hessian, because an
//! explicit run has none.
//!
//! The result transforms as a frequency does. Translations of the body change it only by the round-off of its
//! coordinates. A change of the units of length, mass and time by powers of two changes no bit of it.

use vi_core::{LanczosStart, State, System};

use crate::assemble::evaluator::Evaluator;
use crate::error::SolverError;
use crate::schemes::lanczos::{self, HighestFrequency, SymmetricOperator, Tridiagonal, noise, normalize};
use crate::unit_of_mass::per_unit_of_mass;
use crate::vectors;

/// Relative error of λ_max below which the estimate is accurate enough.
const ACCURACY: f64 = 0.01;
/// Largest displacement of a difference, relative to the extent of the body. Its square and the round-off that it
/// amplifies (1e-16/1e-7) are both far below [`ACCURACY`].
const DIFFERENCE: f64 = 1e-7;
/// Smallest displacement of a difference, in units of the round-off of the coordinates. Far from the origin the
/// differences then keep four digits.
const RESOLVED: f64 = 1e4;
/// Largest displacement, relative to the extent, that still counts as small.
const LARGEST: f64 = 1e-3;
/// Largest displacement, relative to the extent, of a difference to one side, whose error is of first order. Elements of a thousandth of
/// the extent are then strained by at most about 1e-3, far below the error of [`Frequencies::highest`](super::motion::Frequencies::highest).
const LARGEST_ONE_SIDED: f64 = 1e-6;

/// Returns ω_max about `state`. The start vector is the same in every run.
///
/// # Errors
/// Returns [`SolverError::Term`] or [`SolverError::NotFinite`] if the state has no finite force;
/// [`SolverError::Unresolved`] if the coordinates are so large that their round-off hides the shape of the body.
pub fn highest_frequency(system: &System, state: &State) -> Result<HighestFrequency, SolverError> {
    if let Some(found) = highest_by_ranks(system, state) {
        return Ok(found);
    }
    highest(&mut Operator::new(system), system, state, ACCURACY, Differences::Central)
}

/// Returns ω_max, found together by the ranks that share the system. Returns `None` if they cannot find it; the error of
/// [`highest`] then gives the reason.
fn highest_by_ranks(system: &System, state: &State) -> Option<HighestFrequency> {
    let shared = system.terms().shared()?;
    let (n, t) = (system.coordinates().free_count(), state.t);
    let (displacement, _) = displacement(system, &system.positions(state)).ok()?;
    let per_unit = per_unit_of_mass(system.free_mass());
    let norm = vectors::sum(n, |k| noise(k as u64) * noise(k as u64)).sqrt();
    let vector = |k: usize| noise(k as u64) / norm;
    if n == 0 || !shared.start_lanczos(&state.q, t, &LanczosStart { per_unit, displacement, vector: &vector })
    {
        return None;
    }
    let mut terms = vec![0.0; n];
    let mut matrix = Tridiagonal::new(n);
    let mut beta = 1.0;
    loop {
        shared.multiply_lanczos(beta, &mut terms);
        let alpha = vectors::sum(n, |k| terms[k]);
        shared.subtract_lanczos([alpha, matrix.beta], &mut terms);
        beta = vectors::sum(n, |k| terms[k]).sqrt();
        if !alpha.is_finite() || !beta.is_finite() {
            return None;
        }
        if let Some(found) = matrix.enter(alpha, beta, ACCURACY) {
            return Some(found);
        }
    }
}

/// Returns a bound of the highest frequency about a state, whose relative error of λ_max is at most `accuracy`.
pub(super) fn highest(
    operator: &mut Operator,
    system: &System,
    state: &State,
    accuracy: f64,
    differences: Differences,
) -> Result<HighestFrequency, SolverError> {
    let n = system.coordinates().free_count();
    if n == 0 {
        return Ok(HighestFrequency { omega: 0.0, iterations: 0 });
    }
    operator.place(system, state, differences)?;
    let mut about = About { operator, system, state };
    if system.filter().is_some() {
        return lanczos::highest(&mut Filtered::new(about), n, accuracy);
    }
    lanczos::highest(&mut about, n, accuracy)
}

/// The operator M^{-1/2} K M^{-1/2} about a state, which is symmetric in the Euclidean inner product.
struct About<'a> {
    operator: &'a mut Operator,
    system: &'a System,
    state: &'a State,
}

impl SymmetricOperator for About<'_> {
    fn apply(&mut self, v: &[f64], out: &mut [f64]) -> Result<(), SolverError> {
        self.operator.apply(self.system, self.state, v, out)
    }

    fn product(&self, a: &[f64], v: &[f64]) -> f64 {
        vectors::dot(a, v)
    }

    fn normalize(&mut self, v: &mut [f64]) -> f64 {
        normalize(v)
    }
}

/// The operator M^{-1/2} K M^{-1/2} S with the preconditioner S = M^{1/2} W M^{1/2} about a state. Its eigenvalues are those of
/// W K, and it is symmetric in the inner product uᵀS u.
struct Filtered<'a> {
    about: About<'a>,
    /// √(m/unit) of the free coordinates.
    roots: Vec<f64>,
    /// S u for the vector u that was normalised last.
    image: Vec<f64>,
}

impl<'a> Filtered<'a> {
    fn new(about: About<'a>) -> Self {
        let n = about.system.coordinates().free_count();
        let roots = (0..n).map(|k| about.operator.root_mass(about.system, k)).collect();
        Self { about, roots, image: Vec::new() }
    }

    /// Returns S u.
    fn filtered(&self, u: &[f64]) -> Vec<f64> {
        let About { operator, system, .. } = &self.about;
        let momentum: Vec<f64> = u.iter().zip(&self.roots).map(|(u, root)| u * root).collect();
        let velocity = system.velocity(&momentum);
        velocity.iter().zip(&self.roots).map(|(v, root)| v * root / operator.per_unit).collect()
    }
}

impl SymmetricOperator for Filtered<'_> {
    fn apply(&mut self, _u: &[f64], out: &mut [f64]) -> Result<(), SolverError> {
        self.about.apply(&self.image, out)
    }

    fn product(&self, a: &[f64], _u: &[f64]) -> f64 {
        vectors::dot(a, &self.image)
    }

    fn normalize(&mut self, u: &mut [f64]) -> f64 {
        self.image = self.filtered(u);
        let norm = vectors::dot(u, &self.image).max(0.0).sqrt();
        if norm > 0.0 {
            vectors::update(u, |_, u| *u /= norm);
            vectors::update(&mut self.image, |_, image| *image /= norm);
        }
        norm
    }
}

/// The differences of gradients that give products with K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Differences {
    /// Two gradients per product. The product with −v is minus that with v.
    Central,
    /// One gradient per product, and one at the state. Central differences are taken where displacements are too large for them.
    OneSided,
}

/// The operator v ↦ M^{-1/2} K M^{-1/2} v by differences about a state.
pub(super) struct Operator {
    evaluator: Evaluator,
    /// The gradient at the state on the free coordinates, N; empty for central differences.
    gradient: Vec<f64>,
    /// The inverse of a unit of mass, which is a power of two.
    per_unit: f64,
    /// The displacement of a difference if the whole body moves equally, m; for directors, 1.
    sizes: [f64; 2],
    /// Index into `sizes` for each free coordinate: 1 for directors.
    kind: Vec<u8>,
    q: Vec<f64>,
}

impl Operator {
    pub(super) fn new(system: &System) -> Self {
        let evaluator = Evaluator::new(system);
        // Terms that list pairs act in the drift of explicit schemes, where they do not limit the step.
        let is_in_drift = system.terms().live().iter().all(|term| term.lists_pairs());
        let evaluator = if is_in_drift { evaluator.without_live() } else { evaluator };
        let coordinates = system.coordinates();
        let kind = coordinates.free().iter().map(|&dof| u8::from(coordinates.is_director(dof / 3))).collect();
        let (per_unit, q) = (per_unit_of_mass(system.free_mass()), vec![0.0; system.free_mass().len()]);
        Self { evaluator, gradient: Vec::new(), per_unit, sizes: [DIFFERENCE; 2], kind, q }
    }

    /// Returns √(m/unit) of a free coordinate, which has the same bits in every such unit.
    pub(super) fn root_mass(&self, system: &System, k: usize) -> f64 {
        (system.free_mass()[k] * self.per_unit).sqrt()
    }

    /// Prepares for products at a state.
    pub(super) fn place(
        &mut self,
        system: &System,
        state: &State,
        differences: Differences,
    ) -> Result<(), SolverError> {
        let (displacement, extent) = displacement(system, &system.positions(state))?;
        self.sizes = [displacement, DIFFERENCE];
        self.gradient.clear();
        if differences == Differences::OneSided && displacement <= LARGEST_ONE_SIDED * extent {
            self.evaluator.evaluate(system, &state.q, state.t, true)?;
            self.gradient.resize(state.q.len(), 0.0);
            system.coordinates().restrict(self.evaluator.gradient(), &mut self.gradient);
        }
        Ok(())
    }

    /// Returns ∂V/∂x of all coordinates at a state, N.
    pub(super) fn gradient_at(&mut self, system: &System, state: &State) -> Result<&[f64], SolverError> {
        self.evaluator.evaluate(system, &state.q, state.t, true)?;
        Ok(self.evaluator.gradient())
    }

    /// Computes `out` = M^{-1/2} K M^{-1/2} v at the state at which the operator was placed.
    pub(super) fn apply(
        &mut self,
        system: &System,
        state: &State,
        v: &[f64],
        out: &mut [f64],
    ) -> Result<(), SolverError> {
        let Self { evaluator, gradient, per_unit, sizes, kind, q } = self;
        let (n, per_unit, mass) = (v.len(), *per_unit, system.free_mass());
        let free = system.coordinates().free();
        let root_mass = |k: usize| (mass[k] * per_unit).sqrt();
        let direction = |k: usize| v[k] / root_mass(k);
        let epsilon = 1.0 / vectors::max_abs(n, |k| direction(k) / sizes[usize::from(kind[k])]);
        vectors::fill(q, |k| state.q[k] + epsilon * direction(k));
        evaluator.evaluate(system, q, state.t, true)?;
        // First the gradient ahead, then the difference.
        system.coordinates().restrict(evaluator.gradient(), out);
        if !gradient.is_empty() {
            vectors::update(out, |k, out| *out = (*out - gradient[k]) / epsilon / root_mass(k) * per_unit);
            return Ok(());
        }
        vectors::fill(q, |k| state.q[k] - epsilon * direction(k));
        evaluator.evaluate(system, q, state.t, true)?;
        let behind = evaluator.gradient();
        vectors::update(out, |k, out| {
            *out = (*out - behind[free[k] as usize]) / (2.0 * epsilon) / root_mass(k) * per_unit;
        });
        Ok(())
    }
}

/// Returns the largest displacement of a difference about positions `x`, m. It is small compared with the extent of
/// the body and large compared with the round-off of its coordinates. A single point has no extent: it is displaced
/// by a small fraction of its distance from the origin, or of 1 m if it is at the origin. Also returns the length of which it is a
/// fraction, m.
fn displacement(system: &System, x: &[f64]) -> Result<(f64, f64), SolverError> {
    let [extent, reach] = system.coordinates().extent_and_reach(x);
    if extent == 0.0 {
        let length = if reach > 0.0 { reach } else { 1.0 };
        return Ok((DIFFERENCE * length, length));
    }
    let resolved = RESOLVED * f64::EPSILON * reach;
    if resolved > LARGEST * extent {
        return Err(SolverError::Unresolved { extent, reach });
    }
    Ok((resolved.max(DIFFERENCE * extent), extent))
}

#[cfg(test)]
mod tests {
    use vi_core::problems::{Oscillator, SpringChain};
    use vi_core::reference;

    use super::*;

    #[test]
    fn oscillator() {
        let oscillator = Oscillator::with_frequency(7.0);
        let system = oscillator.system().unwrap();
        let state = State { t: 0.0, q: vec![0.3], p: vec![0.0] };
        let found = highest_frequency(&system, &state).unwrap();
        assert!((found.omega - 7.0).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn units_that_are_powers_of_two_change_no_bit() {
        let of_units = |[length, mass, time]: [i32; 3]| {
            let [l, m, t] = [length, mass, time].map(|e| 2.0_f64.powi(e));
            let chain = SpringChain::unit(30);
            let state = chain.disturbed_state();
            let chain = SpringChain {
                mass: m * chain.mass,
                stiffness: m / (t * t) * chain.stiffness,
                quartic: m / (t * t * l * l) * chain.quartic,
                rest_length: l * chain.rest_length,
                ..chain
            };
            let scaled = State { q: state.q.iter().map(|q| l * q).collect(), ..state };
            let found = highest_frequency(&chain.system().unwrap(), &scaled).unwrap();
            (found.iterations, t * found.omega)
        };
        let found = of_units([0; 3]);
        for units in [[-30, 0, 0], [0, 29, 0], [0, 0, -7], [1, -1, 1], [30, -29, 30], [-29, 30, 13]] {
            assert_eq!(of_units(units), found, "{units:?}");
        }
    }

    #[test]
    fn a_body_far_from_the_origin_has_the_frequency_it_has_near() {
        let chain = SpringChain::unit(30);
        let (system, state) = (chain.system().unwrap(), chain.disturbed_state());
        let of = |by: f64| {
            let moved = State { q: state.q.iter().map(|q| q + by).collect(), ..state.clone() };
            highest_frequency(&system, &moved)
        };
        let near = of(0.0).unwrap().omega;
        for by in [1e3, -1e6, 3e7] {
            let far = of(by).unwrap().omega;
            // Only a few digits are required.
            assert!((far / near - 1.0).abs() < ACCURACY, "{by:e}: {far} {near}");
        }
        let error = of(1e14).unwrap_err();
        assert!(matches!(error, SolverError::Unresolved { .. }), "{error}");
    }

    #[test]
    fn chain_within_one_percent_from_above() {
        let chain = SpringChain::unit(30);
        let system = chain.system().unwrap();
        let state = chain.disturbed_state();
        let mut k = reference::hessian(&system, &system.positions(&state), 0.0);
        let m = system.free_mass();
        for i in 0..m.len() {
            for j in 0..m.len() {
                k[(i, j)] /= (m[i] * m[j]).sqrt();
            }
        }
        let exact = k.symmetric_eigen().eigenvalues.max().sqrt();
        let found = highest_frequency(&system, &state).unwrap();
        assert!(found.omega >= exact * (1.0 - 1e-6) && found.omega < 1.01 * exact, "{found:?} {exact}");
        assert!(found.iterations < 40, "{found:?}");
    }
}
