//! The registry of solid elements.
//!
//! To add an element for a cell kind that exists ([`CellKind`]), write one file in `element/` with an
//! [`Element`](contract::Element) and add one line to `elements!` below. The line gives the kernels and the tests
//! that every element must pass.

pub(crate) mod contract;
pub(crate) mod kernel;
#[cfg(test)]
mod laws;
pub(crate) mod patch;
pub(crate) mod rest_shape;
mod rule;
pub(crate) mod simplex;

use vi_mesh::CellKind;

use contract::SolidVisitor;

macro_rules! elements {
    ($($file:ident: $element:ident, $n:literal nodes, $q:literal points;)*) => {
        $(mod $file;)*

        /// The solid elements, each named like its cell kind.
        pub(crate) mod solids {
            $(pub use super::$file::$element;)*
        }

        /// The cell kinds that have a solid element.
        pub const SOLIDS: &[CellKind] = &[$(CellKind::$element),*];

        /// Runs `visitor` with the solid element of this kind; `None` if the kind has none.
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
