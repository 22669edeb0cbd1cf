//! Generalised coordinates x = x(q, τ(t)): the positions of a body of points are functions of a few coordinates q and
//! prescribed controls τ (the angle of a driven wire, a moving support). Let S = ∂x/∂q and Σ = ∂x/∂τ. Then ẋ = S q̇ + Σ
//! τ̇, and the equations of motion are Sᵀ(M ẍ − F) = 0. The constraint force lies in the null space of Sᵀ.

use nalgebra::{DMatrix, DVector};
use num_dual::{Dual, Dual2_64, Dual64};

use crate::error::CoreError;
use crate::theory::lagrange::lagrangian::{Lagrangian, Scalar};

/// The map x(q, τ(t)), with the mass and the potential of the points.
pub trait Embedding {
    /// Returns the number n of generalised coordinates.
    fn dof_count(&self) -> usize;
    /// Mass of every coordinate x_i, kg.
    fn mass(&self) -> Vec<f64>;
    /// Returns the controls τ(t); the default has none.
    fn controls<D: Scalar>(&self, _t: D) -> Vec<D> {
        Vec::new()
    }
    /// Returns x(q, τ), m.
    fn positions<D: Scalar>(&self, q: &[D], tau: &[D]) -> Vec<D>;
    /// Returns V(x, t), J.
    fn potential<D: Scalar>(&self, x: &[D], t: D) -> D;
}

/// The Lagrangian T(ẋ) − V(x) pulled back along x(q, τ(t)). It contains the mass M(q) = SᵀMS and all Coriolis and
/// centrifugal terms, without any of them written by hand.
#[derive(Debug, Clone, Copy)]
pub struct Embedded<E>(pub E);

impl<E: Embedding> Lagrangian for Embedded<E> {
    fn dof_count(&self) -> usize {
        self.0.dof_count()
    }

    fn value<D: Scalar>(&self, t: D, q: &[D], v: &[D]) -> D {
        // One more dual number, in the direction of time, gives d/dt x(q(t), τ(t)).
        let moving: Vec<Dual<D>> = q.iter().zip(v).map(|(&q, &v)| Dual::new(q, v)).collect();
        let tau = self.0.controls(Dual::new(t, D::from(1.0)));
        let x = self.0.positions(&moving, &tau);
        let kinetic: D = x.iter().zip(self.0.mass()).map(|(x, m)| x.eps * x.eps * (0.5 * m)).sum();
        let place: Vec<D> = x.iter().map(|x| x.re).collect();
        kinetic - self.0.potential(&place, t)
    }
}

/// Returns positions and velocities of all points for (t, q, q̇).
pub fn motion_of_points(
    embedding: &impl Embedding,
    t: f64,
    q: &[f64],
    v: &[f64],
) -> (DVector<f64>, DVector<f64>) {
    let moving: Vec<Dual64> = q.iter().zip(v).map(|(&q, &v)| Dual64::new(q, v)).collect();
    let x = embedding.positions(&moving, &embedding.controls(Dual64::new(t, 1.0)));
    let part = |pick: fn(&Dual64) -> f64| DVector::from_iterator(x.len(), x.iter().map(pick));
    (part(|x| x.re), part(|x| x.eps))
}

/// Returns S = ∂x/∂q: rows x, columns q.
pub fn tangent(embedding: &impl Embedding, t: f64, q: &[f64]) -> DMatrix<f64> {
    let tau = constants(&embedding.controls(t));
    columns(&constants(q), |q| embedding.positions(q, &tau))
}

/// Returns Σ = ∂x/∂τ: rows x, columns τ.
pub fn control_tangent(embedding: &impl Embedding, t: f64, q: &[f64]) -> DMatrix<f64> {
    let q = constants(q);
    columns(&constants(&embedding.controls(t)), |tau| embedding.positions(&q, tau))
}

fn constants(values: &[f64]) -> Vec<Dual64> {
    values.iter().map(|&value| Dual64::from_re(value)).collect()
}

/// Returns the Jacobian of f at a point, one column per argument.
fn columns(at: &[Dual64], f: impl Fn(&[Dual64]) -> Vec<Dual64>) -> DMatrix<f64> {
    let mut point = at.to_vec();
    let mut out = DMatrix::zeros(f(at).len(), at.len());
    for j in 0..at.len() {
        point[j].eps = 1.0;
        for (i, value) in f(&point).iter().enumerate() {
            out[(i, j)] = value.eps;
        }
        point[j].eps = 0.0;
    }
    out
}

/// Returns ẍ of all points for (t, q, q̇, q̈).
pub fn point_accelerations(
    embedding: &impl Embedding,
    t: f64,
    q: &[f64],
    v: &[f64],
    a: &[f64],
) -> DVector<f64> {
    let moving: Vec<Dual2_64> = (0..q.len()).map(|i| Dual2_64::new(q[i], v[i], a[i])).collect();
    let x = embedding.positions(&moving, &embedding.controls(Dual2_64::new(t, 1.0, 0.0)));
    DVector::from_iterator(x.len(), x.iter().map(|x| x.v2))
}

/// Returns the force −∂V/∂x on every point, N.
pub fn applied_force(embedding: &impl Embedding, t: f64, x: &DVector<f64>) -> DVector<f64> {
    let mut point = constants(x.as_slice());
    DVector::from_fn(x.len(), |i, _| {
        point[i].eps = 1.0;
        let slope = embedding.potential(&point, Dual64::from_re(t)).eps;
        point[i].eps = 0.0;
        -slope
    })
}

/// Returns q̈ from SᵀMS q̈ = Sᵀ(F − M ẍ|_{q̈ = 0}) for arbitrary forces F on the points (N), with or without a
/// potential: d'Alembert's principle in generalised coordinates.
///
/// # Errors
/// Returns [`CoreError::SingularMass`] if SᵀMS has no inverse (S does not have full rank).
pub fn generalised_accelerations(
    embedding: &impl Embedding,
    t: f64,
    q: &[f64],
    v: &[f64],
    force: &DVector<f64>,
) -> Result<DVector<f64>, CoreError> {
    let s = tangent(embedding, t, q);
    let mass = DVector::from_vec(embedding.mass());
    let drift = point_accelerations(embedding, t, q, v, &vec![0.0; q.len()]);
    let reduced = s.transpose() * DMatrix::from_diagonal(&mass) * &s;
    let driving = s.transpose() * (force - mass.component_mul(&drift));
    reduced.lu().solve(&driving).ok_or(CoreError::SingularMass { t })
}

/// Returns the constraint force R = M ẍ − F on every point (N), which keeps x on its surface. For a motion SᵀR = 0: R
/// does no virtual work, and the equations in q do not contain it.
pub fn constraint_force(
    embedding: &impl Embedding,
    t: f64,
    q: &[f64],
    v: &[f64],
    a: &[f64],
    force: &DVector<f64>,
) -> DVector<f64> {
    DVector::from_vec(embedding.mass()).component_mul(&point_accelerations(embedding, t, q, v, a)) - force
}
