//! Equilibria of V(q; μ): points at which the first variation vanishes, with their stability from the second. V may
//! be a potential, or −L(q, q̇ = 0), which includes centrifugal effects of a driven frame. μ is a parameter (a load,
//! a speed) along which equilibria are followed through folds and bifurcations.

use nalgebra::{DMatrix, DVector};
use num_dual::{Dual64, HyperDual64};

use crate::error::CoreError;
use crate::theory::lagrange::lagrangian::{Lagrangian, Scalar};
use crate::theory::newton;

/// The energy V(q; μ), J, with a parameter μ.
pub trait Energy {
    /// Returns the number of coordinates n.
    fn dof_count(&self) -> usize;
    /// Returns V at coordinates q for the parameter μ.
    fn value<D: Scalar>(&self, parameter: D, q: &[D]) -> D;
}

/// The amended potential V = −L(t = 0, q, q̇ = 0) of a Lagrangian; it has no parameter.
#[derive(Debug, Clone, Copy)]
pub struct AtRest<L>(pub L);

impl<L: Lagrangian> Energy for AtRest<L> {
    fn dof_count(&self) -> usize {
        self.0.dof_count()
    }
    fn value<D: Scalar>(&self, _parameter: D, q: &[D]) -> D {
        -self.0.value(D::from(0.0), q, &vec![D::from(0.0); q.len()])
    }
}

/// Returns the first variation ∂V/∂q, N.
pub fn first_variation(energy: &impl Energy, parameter: f64, q: &DVector<f64>) -> DVector<f64> {
    let mut point: Vec<Dual64> = q.iter().map(|&q| Dual64::from_re(q)).collect();
    DVector::from_fn(q.len(), |i, _| {
        point[i].eps = 1.0;
        let slope = energy.value(Dual64::from_re(parameter), &point).eps;
        point[i].eps = 0.0;
        slope
    })
}

/// Returns the second variation ∂²V/∂q², N/m.
pub fn second_variation(energy: &impl Energy, parameter: f64, q: &DVector<f64>) -> DMatrix<f64> {
    curvatures_and_rate(energy, parameter, q).0
}

/// Returns (∂²V/∂q², ∂²V/∂q∂μ).
fn curvatures_and_rate(
    energy: &impl Energy,
    parameter: f64,
    q: &DVector<f64>,
) -> (DMatrix<f64>, DVector<f64>) {
    let n = q.len();
    let fixed = HyperDual64::from_re(parameter);
    let mut point: Vec<HyperDual64> = q.iter().map(|&q| HyperDual64::from_re(q)).collect();
    let mut curvature = DMatrix::zeros(n, n);
    let mut rate = DVector::zeros(n);
    for i in 0..n {
        point[i].eps1 = 1.0;
        for j in 0..=i {
            point[j].eps2 = 1.0;
            let value = energy.value(fixed, &point).eps1eps2;
            point[j].eps2 = 0.0;
            curvature[(i, j)] = value;
            curvature[(j, i)] = value;
        }
        rate[i] = energy.value(fixed.derivative2(), &point).eps1eps2;
        point[i].eps1 = 0.0;
    }
    (curvature, rate)
}

/// Returns the virtual work −∂V/∂q · δq of a virtual displacement, J: zero for every δq at equilibrium.
pub fn virtual_work(energy: &impl Energy, parameter: f64, q: &DVector<f64>, delta: &DVector<f64>) -> f64 {
    -first_variation(energy, parameter, q).dot(delta)
}

/// An equilibrium and the curvatures of the energy there.
#[derive(Debug, Clone, PartialEq)]
pub struct Equilibrium {
    /// The parameter μ.
    pub parameter: f64,
    /// The coordinates.
    pub q: DVector<f64>,
    /// Eigenvalues of the second variation, ascending, N/m.
    pub curvatures: Vec<f64>,
}

impl Equilibrium {
    /// Returns the equilibrium at q; the caller ensures that q is one.
    fn at(energy: &impl Energy, parameter: f64, q: DVector<f64>) -> Self {
        let eigenvalues = second_variation(energy, parameter, &q).symmetric_eigenvalues();
        let mut curvatures: Vec<f64> = eigenvalues.iter().copied().collect();
        curvatures.sort_by(f64::total_cmp);
        Self { parameter, q, curvatures }
    }

    /// Returns whether it is a strict minimum of V, and so stable (Lagrange and Dirichlet).
    pub fn is_stable(&self) -> bool {
        self.unstable_count() == 0
    }

    /// Returns the number of directions in which V does not grow.
    pub fn unstable_count(&self) -> usize {
        self.curvatures.iter().filter(|&&curvature| curvature <= 0.0).count()
    }
}

/// Returns the equilibria found by Newton's method from each start. Those closer than `distance` (in the largest
/// coordinate) count as one. Starts without convergence are omitted.
pub fn equilibria(
    energy: &impl Energy,
    parameter: f64,
    starts: &[Vec<f64>],
    distance: f64,
) -> Vec<Equilibrium> {
    let mut found: Vec<Equilibrium> = Vec::new();
    for start in starts {
        if let Ok(q) = solve(energy, parameter, DVector::from_column_slice(start))
            && found.iter().all(|other| (&other.q - &q).amax() > distance)
        {
            found.push(Equilibrium::at(energy, parameter, q));
        }
    }
    found
}

fn solve(energy: &impl Energy, parameter: f64, start: DVector<f64>) -> Result<DVector<f64>, CoreError> {
    newton::solve(
        start,
        1.0,
        CoreError::SingularStiffness { parameter },
        |q| first_variation(energy, parameter, q),
        |q| second_variation(energy, parameter, q),
    )
}

/// Follows the branch of equilibria through `start` for `step_count` steps of arc length |step| in (q, μ), by
/// pseudo-arclength continuation (Keller 1977). It passes folds, at which μ has an extremum along the branch. It
/// starts with increasing μ for step > 0, decreasing μ for step < 0. A change of [`Equilibrium::unstable_count`]
/// between neighbours indicates a fold or a bifurcation.
///
/// # Errors
/// Returns [`CoreError::Convergence`] if the branch is lost (use shorter steps), [`CoreError::SingularStiffness`] if it
/// cannot be distinguished from another.
pub fn follow(
    energy: &impl Energy,
    start: &Equilibrium,
    step: f64,
    step_count: usize,
) -> Result<Vec<Equilibrium>, CoreError> {
    let n = start.q.len();
    let coordinates = |z: &DVector<f64>| z.rows(0, n).into_owned();
    let mut branch = vec![start.clone()];
    let mut point = start.q.push(start.parameter);
    let mut direction = DVector::zeros(n).push(step.signum());
    for _ in 0..step_count {
        let singular = CoreError::SingularStiffness { parameter: point[n] };
        let right = DVector::zeros(n).push(1.0);
        let tangent = bordered(energy, &point, &direction).lu().solve(&right);
        direction = tangent.ok_or_else(|| singular.clone())?.normalize();
        let ahead = &point + &direction * step.abs();
        point = newton::solve(
            ahead.clone(),
            1.0,
            singular,
            |z| first_variation(energy, z[n], &coordinates(z)).push((z - &ahead).dot(&direction)),
            |z| bordered(energy, z, &direction),
        )?;
        branch.push(Equilibrium::at(energy, point[n], coordinates(&point)));
    }
    Ok(branch)
}

/// Returns [∂²V/∂q², ∂²V/∂q∂μ; directionᵀ] at z = (q, μ).
fn bordered(energy: &impl Energy, z: &DVector<f64>, direction: &DVector<f64>) -> DMatrix<f64> {
    let n = z.len() - 1;
    let (curvature, rate) = curvatures_and_rate(energy, z[n], &z.rows(0, n).into_owned());
    let mut out = DMatrix::zeros(n + 1, n + 1);
    out.view_mut((0, 0), (n, n)).copy_from(&curvature);
    out.view_mut((0, n), (n, 1)).copy_from(&rate);
    out.view_mut((n, 0), (1, n + 1)).copy_from(&direction.transpose());
    out
}

/// Returns the equilibrium at which stability changes between two neighbours of a branch, by bisection in μ to
/// `tolerance`.
///
/// # Errors
/// Returns the errors of [`follow`].
pub fn bifurcation_between(
    energy: &impl Energy,
    first: &Equilibrium,
    second: &Equilibrium,
    tolerance: f64,
) -> Result<Equilibrium, CoreError> {
    let (mut low, mut high) = (first.clone(), second.clone());
    while (high.parameter - low.parameter).abs() > tolerance {
        let parameter = 0.5 * (low.parameter + high.parameter);
        let q = solve(energy, parameter, 0.5 * (&low.q + &high.q))?;
        let middle = Equilibrium::at(energy, parameter, q);
        if middle.unstable_count() == low.unstable_count() {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(high)
}
