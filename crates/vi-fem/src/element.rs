//! Finite elements: the contract, and the registry of all cell kinds.
//!
//! To add a solid element: one file in `element/` with an [`Element`], one line in each list of
//! `elements!` below. The lines give the scene name, the file-format code, the kernels and the law
//! tests. This room must not know laws or meshes.

mod hex20;
mod hex27;
mod hex8;
pub(crate) mod kernel;
#[cfg(test)]
mod laws;
pub(crate) mod patch;
mod rule;
mod simplex;
mod tet10;
mod tet4;
mod turned;
mod wedge15;
mod wedge18;
mod wedge6;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use hex8::Hex8;
pub use hex20::Hex20;
pub use hex27::Hex27;
pub use tet4::Tet4;
pub use tet10::Tet10;
pub use wedge6::Wedge6;
pub use wedge15::Wedge15;
pub use wedge18::Wedge18;

use crate::Real;
use crate::tensor::Mat3;

/// An isoparametric solid element with `N` nodes and `Q` quadrature points on its reference cell:
/// x(ξ) = Σ x_a N_a(ξ).
pub trait Element<const N: usize, const Q: usize>: Send + Sync + 'static {
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
    /// Nodes of the reference cell, in VTK's order.
    fn nodes() -> [[f64; 3]; N];
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
    (
        cells { $($(#[$doc:meta])* $kind:ident = $name:literal, dimension $dimension:literal, nodes $nodes:literal, vtk $vtk:literal;)* }
        solids { $($solid:ident: $element:ident, $n:literal nodes, $q:literal points;)* }
    ) => {
        /// The kinds of cells that meshes are made of; nodes in VTK's order.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "lowercase")]
        #[non_exhaustive]
        pub enum ElementKind {
            $($(#[$doc])* #[serde(rename = $name)] $kind,)*
        }

        impl ElementKind {
            /// All kinds.
            pub const ALL: &'static [Self] = &[$(Self::$kind),*];

            /// The name in scene files.
            pub fn name(self) -> &'static str {
                match self { $(Self::$kind => $name,)* }
            }

            /// Dimension of the cell: 0 point, 1 curve, 2 surface, 3 volume.
            pub fn dimension(self) -> usize {
                match self { $(Self::$kind => $dimension,)* }
            }

            /// Nodes a cell.
            pub fn node_count(self) -> usize {
                match self { $(Self::$kind => $nodes,)* }
            }

            /// The code of the kind in VTK files.
            pub fn vtk_code(self) -> u8 {
                match self { $(Self::$kind => $vtk,)* }
            }

            /// The kind with this code in VTK files.
            pub fn from_vtk_code(code: u8) -> Option<Self> {
                match code { $($vtk => Some(Self::$kind),)* _ => None }
            }

            /// Runs `visitor` with the solid element of this kind; None where there is none.
            pub(crate) fn visit_solid<V: SolidVisitor>(self, visitor: V) -> Option<V::Output> {
                match self {
                    $(Self::$solid => Some(visitor.visit::<$element, $n, $q>()),)*
                    _ => None,
                }
            }

            /// The kinds that solids can be made of.
            pub const SOLIDS: &'static [Self] = &[$(Self::$solid),*];
        }

        #[cfg(test)]
        mod registered {
            $(
                #[allow(non_snake_case)]
                mod $solid {
                    #[test]
                    fn keeps_the_laws() {
                        super::super::laws::check::<super::super::$element, $n, $q>($crate::ElementKind::$solid);
                    }
                }
            )*
        }
    };
}

elements! {
    cells {
        /// A point.
        Point = "point", dimension 0, nodes 1, vtk 1;
        /// A straight edge.
        Line2 = "line2", dimension 1, nodes 2, vtk 3;
        /// A quadratic edge.
        Line3 = "line3", dimension 1, nodes 3, vtk 21;
        /// Linear triangle.
        Tri3 = "tri3", dimension 2, nodes 3, vtk 5;
        /// Quadratic triangle.
        Tri6 = "tri6", dimension 2, nodes 6, vtk 22;
        /// Bilinear quadrilateral.
        Quad4 = "quad4", dimension 2, nodes 4, vtk 9;
        /// Quadratic quadrilateral without a middle node.
        Quad8 = "quad8", dimension 2, nodes 8, vtk 23;
        /// Biquadratic quadrilateral.
        Quad9 = "quad9", dimension 2, nodes 9, vtk 28;
        /// Linear tetrahedron.
        Tet4 = "tet4", dimension 3, nodes 4, vtk 10;
        /// Quadratic tetrahedron.
        Tet10 = "tet10", dimension 3, nodes 10, vtk 24;
        /// Trilinear hexahedron.
        Hex8 = "hex8", dimension 3, nodes 8, vtk 12;
        /// Quadratic hexahedron without middle nodes.
        Hex20 = "hex20", dimension 3, nodes 20, vtk 25;
        /// Triquadratic hexahedron.
        Hex27 = "hex27", dimension 3, nodes 27, vtk 29;
        /// Linear wedge.
        Wedge6 = "wedge6", dimension 3, nodes 6, vtk 13;
        /// Quadratic wedge.
        Wedge15 = "wedge15", dimension 3, nodes 15, vtk 26;
        /// Biquadratic wedge.
        Wedge18 = "wedge18", dimension 3, nodes 18, vtk 32;
    }
    solids {
        Tet4: Tet4, 4 nodes, 1 points;
        Tet10: Tet10, 10 nodes, 4 points;
        Hex8: Hex8, 8 nodes, 8 points;
        Hex20: Hex20, 20 nodes, 27 points;
        Hex27: Hex27, 27 nodes, 27 points;
        Wedge6: Wedge6, 6 nodes, 6 points;
        Wedge15: Wedge15, 15 nodes, 18 points;
        Wedge18: Wedge18, 18 nodes, 18 points;
    }
}

impl std::fmt::Display for ElementKind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(self.name())
    }
}
