//! Rigid bodies and linkages with known answers: the free body, the heavy top, the double pendulum.

use crate::error::CoreError;
use crate::theory::problems::elliptic::complete_elliptic_k;
use crate::theory::rotations::articulated::{Articulated, Joint, Link};
use crate::theory::rotations::rigid::{RigidBody, Weight, Weightless};
use crate::theory::rotations::so3::{Matrix3, Vector3};

/// Returns the inertia diag(I₁, I₂, I₃), kg m².
pub fn principal_inertia(moments: Vector3<f64>) -> Matrix3<f64> {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { moments[i] } else { 0.0 }))
}

/// Returns a body that rotates freely about its centre.
pub fn free_body(moments: Vector3<f64>) -> RigidBody<Weightless> {
    RigidBody { mass: 1.0, inertia: principal_inertia(moments), is_pivoted: true, potential: Weightless }
}

/// Returns the period (s) of Π for a free body with I₁ < I₂ < I₃ (kg m²) and spin Π (Landau & Lifshitz, Mechanics,
/// §37): 4 K(k)/λ. One period contains two flips of the intermediate axis.
pub fn flip_period(moments: Vector3<f64>, spin: Vector3<f64>) -> f64 {
    let double_energy: f64 = (0..3).map(|i| spin[i] * spin[i] / moments[i]).sum();
    let square: f64 = spin.iter().map(|x| x * x).sum();
    // The spin precesses about the axis of the largest moment, or else about that of the smallest.
    let [a, b, c] =
        if square > double_energy * moments[1] { moments } else { [moments[2], moments[1], moments[0]] };
    let rate = ((c - b) * (square - double_energy * a) / (a * b * c)).sqrt();
    let k = ((b - a) * (double_energy * c - square) / ((c - b) * (square - double_energy * a))).sqrt();
    4.0 * complete_elliptic_k(k) / rate
}

/// Returns Lagrange's top: inertia (I, I, I₃) about its pivot, weight `weight` (N) at `height` (m) on its axis.
pub fn heavy_top(transverse: f64, axial: f64, weight: f64, height: f64) -> RigidBody<Weight> {
    RigidBody {
        mass: 1.0,
        inertia: principal_inertia([transverse, transverse, axial]),
        is_pivoted: true,
        potential: Weight { force: weight, centre: [0.0, 0.0, height] },
    }
}

/// Returns two point masses on massless rods in the x–z plane. q is the angle of each rod relative to the previous
/// one; the first is measured from the downward vertical.
///
/// # Errors
/// Never returns an error; the type is that of [`Articulated::new`].
pub fn double_pendulum(masses: [f64; 2], lengths: [f64; 2], gravity: f64) -> Result<Articulated, CoreError> {
    let link = |parent: Option<usize>, anchor: Vector3<f64>, k: usize| Link {
        parent,
        anchor,
        joint: Joint::Revolute([0.0, -1.0, 0.0]),
        mass: masses[k],
        centre: [0.0, 0.0, -lengths[k]],
        inertia: [[0.0; 3]; 3],
    };
    let links = vec![link(None, [0.0; 3], 0), link(Some(0), [0.0, 0.0, -lengths[0]], 1)];
    Articulated::new(links, [0.0, 0.0, -gravity])
}
