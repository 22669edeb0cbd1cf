//! Finite elements: the contract, and the registry of solid elements.
//!
//! To add a solid element of a kind that the table of cells has ([`CellKind`]): one file in `element/` with an
//! [`Element`], one line in `elements!` below. The line gives the kernels and the law tests.

pub(crate) mod kernel;
#[cfg(test)]
mod laws;
pub(crate) mod patch;
mod rule;
mod simplex;
mod turned;

use vi_mesh::CellKind;

use crate::Real;
use crate::tensor::Mat3;

/// An isoparametric solid element with `N` nodes and `Q` quadrature points on its reference cell:
/// x(ξ) = Σ x_a N_a(ξ).
pub trait Element<const N: usize, const Q: usize>: Send + Sync + 'static {
    /// The cell whose nodes it has.
    const KIND: CellKind;
    /// Degree of the polynomials that the rule integrates exactly.
    const DEGREE: usize;
    /// Is it the linear simplex, x₁ − x₀, x₂ − x₀, x₃ − x₀ the columns of ∂x/∂ξ, with one quadrature
    /// point? Its kernels are compiled with every law, instead of one for the element and one for the
    /// law that meet in memory: where so little is computed, that is a quarter of the time.
    const IS_SIMPLEX: bool = false;

    /// Quadrature of the strain energy: points ξ and weights, whose sum is the reference volume.
    fn rule() -> [([f64; 3], f64); Q];
    /// Quadrature of the mass.
    fn mass_rule() -> Vec<([f64; 3], f64)> {
        Self::rule().to_vec()
    }
    /// Nodes of the reference cell, by the table of cells.
    fn nodes() -> [[f64; 3]; N] {
        let nodes = Self::KIND.reference_nodes();
        std::array::from_fn(|a| nodes[a])
    }
    /// Shape functions N_a(ξ).
    fn values(xi: [f64; 3]) -> [f64; N];
    /// Their gradients ∂N_a/∂ξ.
    fn gradients(xi: [f64; 3]) -> [[f64; 3]; N];

    /// ∂x/∂ξ = Σ x_a ⊗ ∂N_a/∂ξ at a quadrature point, whose gradients are given. Overridden where
    /// the gradients are constants that fold away.
    #[inline(always)]
    fn reference_gradient<R: Real>(x: &[[R; 3]; N], gradients: &[[f64; 3]; N]) -> Mat3<R> {
        let mut sum = [[x[0][0].constant(0.0); 3]; 3];
        for (x, gradient) in x.iter().zip(gradients) {
            for i in 0..3 {
                for j in 0..3 {
                    sum[i][j] = x[i].mul_add(x[i].constant(gradient[j]), sum[i][j]);
                }
            }
        }
        sum
    }

    /// f_a += P̂ ∂N_a/∂ξ: the transpose of [`Element::reference_gradient`].
    #[inline(always)]
    fn add_reference_forces<R: Real>(p: &Mat3<R>, gradients: &[[f64; 3]; N], f: &mut [[R; 3]; N]) {
        for (f, gradient) in f.iter_mut().zip(gradients) {
            for i in 0..3 {
                for j in 0..3 {
                    f[i] = p[i][j].mul_add(p[i][j].constant(gradient[j]), f[i]);
                }
            }
        }
    }
}

/// Work to do with an element whose type is known only at run time.
pub(crate) trait SolidVisitor {
    type Output;
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) -> Self::Output;
}

macro_rules! elements {
    ($($file:ident: $element:ident, $n:literal nodes, $q:literal points;)*) => {
        $(mod $file;)*

        /// The solid elements, each named as its kind of cell.
        pub(crate) mod solids {
            $(pub use super::$file::$element;)*
        }

        /// The kinds that solids can be made of.
        pub const SOLIDS: &[CellKind] = &[$(CellKind::$element),*];

        /// Runs `visitor` with the solid element of this kind; None where there is none.
        pub(crate) fn visit_solid<V: SolidVisitor>(kind: CellKind, visitor: V) -> Option<V::Output> {
            match kind {
                $(CellKind::$element => Some(visitor.visit::<solids::$element, $n, $q>()),)*
                _ => None,
            }
        }

        #[cfg(test)]
        mod registered {
            $(
                #[test]
                fn $file() {
                    super::laws::check::<super::solids::$element, $n, $q>(super::CellKind::$element);
                }
            )*
        }
    };
}

elements! {
    tet4: Tet4, 4 nodes, 1 points;
    tet10: Tet10, 10 nodes, 4 points;
    hex8: Hex8, 8 nodes, 8 points;
    hex20: Hex20, 20 nodes, 27 points;
    hex27: Hex27, 27 nodes, 27 points;
    wedge6: Wedge6, 6 nodes, 6 points;
    wedge15: Wedge15, 15 nodes, 18 points;
    wedge18: Wedge18, 18 nodes, 18 points;
}
