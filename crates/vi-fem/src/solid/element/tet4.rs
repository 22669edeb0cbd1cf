//! The linear tetrahedron: constant F, one quadrature point.

use vi_mesh::CellKind;

use super::contract::Element;
use crate::lanes::real::Real;
use crate::small::tensor::{Mat3, mat3};

/// The nodes are 0, e₁, e₂, e₃; the shape functions are 1 − ξ − η − ζ, ξ, η, ζ.
#[derive(Debug, Clone, Copy)]
pub struct Tet4;

impl Element<4, 1> for Tet4 {
    const KIND: CellKind = CellKind::Tet4;
    const DEGREE: usize = 1;
    const IS_SIMPLEX: bool = true;

    fn rule() -> [([f64; 3], f64); 1] {
        [([0.25; 3], 1.0 / 6.0)]
    }

    fn values([x, y, z]: [f64; 3]) -> [f64; 4] {
        [1.0 - x - y - z, x, y, z]
    }

    fn gradients(_: [f64; 3]) -> [[f64; 3]; 4] {
        [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    }

    /// Returns the columns x₁ − x₀, x₂ − x₀, x₃ − x₀.
    #[inline(always)]
    fn reference_gradient<R: Real>(x: &[[R; 3]; 4], _: &[[f64; 3]; 4]) -> Mat3<R> {
        mat3!(i j => x[j + 1][i] - x[0][i])
    }

    #[inline(always)]
    fn add_reference_forces<R: Real>(p: &Mat3<R>, _: &[[f64; 3]; 4], f: &mut [[R; 3]; 4]) {
        for i in 0..3 {
            f[0][i] = f[0][i] - (p[i][0] + p[i][1] + p[i][2]);
            for j in 0..3 {
                f[j + 1][i] = f[j + 1][i] + p[i][j];
            }
        }
    }
}
