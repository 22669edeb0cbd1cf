//! Energies near the state of rest without cancellation. A sum such as I₁ − 3 − 2 ln J of terms that do not vanish at rest
//! has an error of ε_m, the round-off of 1, whereas the energy is of second order in the strain. The functions of this file
//! combine the terms of first order exactly; errors are then ε_m times the strain.
//!
//! They act on the Green–Lagrange strain E = (FᵀF − I)/2, so that a rotation is not a strain.

use super::contract::Material;
use crate::lanes::real::Real;
use crate::small::rotation::nearest_rotation;
use crate::small::tensor::{Mat3, combine, contract, cross, dot, mat3, right_cauchy_green};

/// Strains with |J² − 1| below this are near rest. Farther away the plain sums lose two digits at most.
const NEAR: f64 = 0.25;

/// Invariants of E whose differences are of second order in the strain.
pub(super) struct NearRest<R> {
    /// tr E.
    pub(super) trace: R,
    /// ((tr E)² − E:E)/2.
    pub(super) second: R,
    /// x = J² − 1 = det(I + 2E) − 1 = 2 tr E + `excess`.
    pub(super) x: R,
    /// 4 `second` + 8 det E.
    pub(super) excess: R,
}

impl<R: Real> NearRest<R> {
    #[inline(always)]
    pub(super) fn of(f: &Mat3<R>) -> Self {
        let c = right_cauchy_green(f);
        let e = |i: usize, j: usize| c[i][j];
        let mut strain = c;
        for i in 0..3 {
            strain[i][i] = e(i, i) - 1.0;
        }
        // Twice E, whose invariants differ by powers of two.
        let trace = strain[0][0] + strain[1][1] + strain[2][2];
        let second = (trace * trace - contract(&strain, &strain)) * 0.5;
        let third = dot(strain[0], cross(strain[1], strain[2]));
        let excess = second + third;
        Self { trace: trace * 0.5, second: second * 0.25, x: trace + excess, excess }
    }

    /// Returns `near` near rest, and `far` elsewhere.
    #[inline(always)]
    pub(super) fn select(&self, near: R, far: R) -> R {
        (-self.x.abs() + NEAR).if_positive(near, far)
    }
}

/// Strains below √`SMALL` are near rest for [`energy_or_work_of_stress`]. There its error is below 1e-15 of the energy, and a sum that
/// cancels is off by 2e-12 at most.
const SMALL: f64 = 1e-4;

/// Points s and weights of Gauss's rule of three points on [0, 1].
const GAUSS: [[f64; 2]; 3] =
    [[0.112_701_665_379_258_31, 5.0 / 18.0], [0.5, 4.0 / 9.0], [0.887_298_334_620_741_7, 5.0 / 18.0]];

/// Returns the energy of a law whose formula is not known: `sum`, its own value, or near rest ∫ P(R + s (F − R)) : (F − R) ds,
/// where R is the rotation nearest to F.
#[inline(always)]
pub(super) fn energy_or_work_of_stress<M: Material, R: Real>(law: &M, f: &Mat3<R>, sum: R) -> R {
    let rotation = nearest_rotation(f);
    let strain = mat3!(i j => f[i][j] - rotation[i][j]);
    let far = contract(&strain, &strain) - SMALL;
    if far.is_positive() {
        return sum;
    }
    let one = sum.constant(1.0);
    let mut work = sum.constant(0.0);
    for [s, weight] in GAUSS {
        let stress = law.stress(&combine(one, &rotation, sum.constant(s), &strain));
        work = work + contract(&stress, &strain) * weight;
    }
    (-far).if_positive(work, sum)
}
