//! Rigid bodies (c, R) ∈ ℝ³ × SO(3) by Lie-group variational integrators of any scheme (in the manner of Bou-Rabee &
//! Marsden 2009; Hall & Leok 2015).
//!
//! A step from R_a to R_b follows R(τ) = R_a cay(x(τ)), where x is the polynomial through x_0 = 0 and the control
//! points x_j = cay⁻¹(R_aᵀR_j). Since x does not change when the body is rotated in space, L_d has the symmetry of L,
//! and the angular momentum R Π of a free body is conserved to round-off.

use nalgebra::DVector;

use crate::contract::scheme::Scheme;
use crate::error::CoreError;
use crate::theory::differentiate::{Function, gradient, hessian};
use crate::theory::interpolation::Basis;
use crate::theory::lagrange::lagrangian::Scalar;
use crate::theory::newton;
use crate::theory::rotations::so3::{
    Matrix3, Vector3, body_momentum, body_rate, cayley, constant, dot, product, relative, rotate,
};

/// The potential V(t, c, R) of a body with its centre (or its pivot) at c and orientation R, J.
pub trait PosePotential {
    /// Returns V at time t, position c (m) and rotation R from body to space.
    fn value<D: Scalar>(&self, t: D, place: &Vector3<D>, turn: &Matrix3<D>) -> D;
}

/// No potential.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weightless;

impl PosePotential for Weightless {
    fn value<D: Scalar>(&self, _t: D, _place: &Vector3<D>, _turn: &Matrix3<D>) -> D {
        D::from(0.0)
    }
}

/// Weight m g along −z of the point `centre` of the body: V = m g e_z · (c + R centre).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weight {
    /// Size m g of the weight, N.
    pub force: f64,
    /// The centre of mass in the body, from its centre or pivot, m.
    pub centre: Vector3<f64>,
}

impl PosePotential for Weight {
    fn value<D: Scalar>(&self, _t: D, place: &Vector3<D>, turn: &Matrix3<D>) -> D {
        (place[2] + dot(&turn[2], &self.centre.map(D::from))) * self.force
    }
}

/// A rigid body with L = ½ m |ċ|² + ½ ω·I ω − V(t, c, R), where ω is the angular velocity in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidBody<V> {
    /// Mass m, kg.
    pub mass: f64,
    /// Inertia about the centre of mass, or about the pivot, in the body frame, kg m².
    pub inertia: Matrix3<f64>,
    /// Whether the body rotates about a fixed point (c = 0).
    pub is_pivoted: bool,
    /// Potential V(t, c, R), J.
    pub potential: V,
}

/// The state of a rigid body.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidState {
    /// Time, s.
    pub t: f64,
    /// Position c of the centre of mass, m; zero for a body with a pivot.
    pub place: Vector3<f64>,
    /// Rotation matrix R from the body frame to space.
    pub turn: Matrix3<f64>,
    /// Linear momentum m ċ, kg m/s.
    pub momentum: Vector3<f64>,
    /// Angular momentum Π = I ω in the body frame, kg m²/s.
    pub spin: Vector3<f64>,
}

impl RigidState {
    /// Returns the angular momentum about c in space, R Π.
    pub fn spatial_spin(&self) -> Vector3<f64> {
        rotate(&self.turn, &self.spin)
    }
}

impl<V: PosePotential> RigidBody<V> {
    /// Returns T + V, J.
    ///
    /// # Errors
    /// Returns [`CoreError::SingularMass`] if the inertia has no inverse.
    pub fn energy(&self, state: &RigidState) -> Result<f64, CoreError> {
        let inertia = nalgebra::Matrix3::from_fn(|i, j| self.inertia[i][j]);
        let spin = nalgebra::Vector3::from(state.spin);
        let omega = inertia.lu().solve(&spin).ok_or(CoreError::SingularMass { t: state.t })?;
        let along = if self.is_pivoted { 0.0 } else { dot(&state.momentum, &state.momentum) / self.mass };
        Ok(0.5 * (along + spin.dot(&omega)) + self.potential.value(state.t, &state.place, &state.turn))
    }

    /// Makes one step of length h (s) of the scheme.
    ///
    /// # Errors
    /// Returns [`CoreError::StepSize`], [`CoreError::SingularStep`], [`CoreError::Convergence`] (for example if a
    /// rotation of nearly π in one step leaves the chart), [`CoreError::Points`].
    pub fn step(&self, scheme: &Scheme, state: &RigidState, h: f64) -> Result<RigidState, CoreError> {
        if h == 0.0 || !h.is_finite() {
            return Err(CoreError::StepSize { h });
        }
        let basis = Basis::new(scheme.interpolation.degree())?;
        let action = StepAction { body: self, scheme, basis: &basis, state, h };
        let (n, s) = (action.node_size(), scheme.interpolation.degree());
        let mut p_0 = state.spin.to_vec();
        let mut rate: Vec<f64> = self.rate(state)?.to_vec();
        if !self.is_pivoted {
            p_0.extend(state.momentum);
            rate.extend(state.momentum.map(|p| p / self.mass));
        }
        let p_0 = DVector::from_vec(p_0);
        // The unknowns are the node coordinates (x, c − c_0) of the control points 1 … s; those of node 0 are
        // zero.
        let nodes = |u: &DVector<f64>| [vec![0.0; n], u.as_slice().to_vec()].concat();
        let residual = |u: &DVector<f64>| {
            let mut out = gradient(&action, &nodes(u)).rows(0, s * n).into_owned();
            let mut first = out.rows_mut(0, n);
            first += &p_0;
            out
        };
        let jacobian =
            |u: &DVector<f64>| hessian(&action, &nodes(u)).view((0, n), (s * n, s * n)).into_owned();
        let guess = DVector::from_fn(s * n, |i, _| h * basis.points()[i / n + 1] * rate[i % n]);
        let u = newton::solve(guess, 1.0, CoreError::SingularStep { h }, residual, jacobian)?;
        let p_1 = gradient(&action, &nodes(&u));
        let (end, p_1) = (&u.as_slice()[(s - 1) * n..], &p_1.as_slice()[s * n..]);
        let x = [end[0], end[1], end[2]];
        let mut next = RigidState {
            t: state.t + h,
            turn: product(&state.turn, &cayley(&x)),
            spin: body_momentum(&x, &[p_1[0], p_1[1], p_1[2]]),
            ..state.clone()
        };
        if !self.is_pivoted {
            next.place = std::array::from_fn(|i| state.place[i] + end[3 + i]);
            next.momentum = [p_1[3], p_1[4], p_1[5]];
        }
        Ok(next)
    }

    /// Returns ω = I⁻¹ Π.
    fn rate(&self, state: &RigidState) -> Result<Vector3<f64>, CoreError> {
        let inertia = nalgebra::Matrix3::from_fn(|i, j| self.inertia[i][j]);
        let omega = inertia.lu().solve(&nalgebra::Vector3::from(state.spin));
        omega.map(Into::into).ok_or(CoreError::SingularMass { t: state.t })
    }
}

/// The action of one step as a function of the node coordinates (x, c − c_0) relative to the current pose, for s + 1
/// nodes.
struct StepAction<'a, V> {
    body: &'a RigidBody<V>,
    scheme: &'a Scheme,
    basis: &'a Basis,
    state: &'a RigidState,
    h: f64,
}

impl<V> StepAction<'_, V> {
    fn node_size(&self) -> usize {
        if self.body.is_pivoted { 3 } else { 6 }
    }
}

impl<V: PosePotential> Function for StepAction<'_, V> {
    fn value<D: Scalar>(&self, z: &[D]) -> D {
        let n = self.node_size();
        let first = [z[0], z[1], z[2]];
        let start = product(&constant(&self.state.turn), &cayley(&first));
        let inertia: Matrix3<D> = constant(&self.body.inertia);
        let charts: Vec<Vector3<D>> =
            z.chunks_exact(n).map(|node| relative(&first, &[node[0], node[1], node[2]])).collect();
        let rule = &self.scheme.quadrature;
        let mut sum = D::from(0.0);
        for (&c, &b) in rule.nodes().iter().zip(rule.weights()) {
            let (values, slopes) = (self.basis.values(c), self.basis.slopes(c));
            let combine = |weights: &[f64], scale: f64| -> Vector3<D> {
                std::array::from_fn(|i| charts.iter().zip(weights).map(|(x, w)| x[i] * (w * scale)).sum())
            };
            let (x, x_dot) = (combine(&values, 1.0), combine(&slopes, 1.0 / self.h));
            let omega = body_rate(&x, &x_dot);
            let mut kinetic = dot(&omega, &rotate(&inertia, &omega)) * 0.5;
            let mut place = self.state.place.map(D::from);
            if !self.body.is_pivoted {
                for i in 0..3 {
                    let along = |weights: &[f64]| -> D {
                        z.chunks_exact(n).zip(weights).map(|(node, w)| node[3 + i] * *w).sum()
                    };
                    place[i] += along(&values);
                    let speed = along(&slopes) / self.h;
                    kinetic += speed * speed * (0.5 * self.body.mass);
                }
            }
            let t = D::from(self.state.t + c * self.h);
            let turn = product(&start, &cayley(&x));
            sum += (kinetic - self.body.potential.value(t, &place, &turn)) * (self.h * b);
        }
        sum
    }
}
