//! The registry of solid elements.
//!
//! To add one of a kind that the table of cells has ([`CellKind`]): one file in `element/` with an [`Element`](contract::Element),
//! one line in `elements!` below. The line gives the kernels and the law tests.

pub(crate) mod contract;
pub(crate) mod kernel;
#[cfg(test)]
mod laws;
pub(crate) mod patch;
mod places;
mod rest_shape;
mod rule;
mod simplex;

use vi_mesh::CellKind;

use contract::SolidVisitor;

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
