//! The kinds of cells: their dimension, node counts, codes and node orders in the file formats.
//! Knows no file; one line of the table below is all that a new kind needs.

macro_rules! cells {
    ($( $(#[$doc:meta])* $kind:ident: $dimension:literal, $nodes:literal, $vtk:literal, $gmsh:literal, $name:literal, $order:expr; )*) => {
        /// The kind of a cell. Nodes are in the order of VTK.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[non_exhaustive]
        pub enum CellKind { $( $(#[$doc])* $kind, )* }

        impl CellKind {
            /// Every kind there is.
            pub const ALL: &'static [Self] = &[$( Self::$kind ),*];
            /// Dimension of the cell itself: 0 point, 1 curve, 2 surface, 3 volume.
            pub const fn dimension(self) -> usize { match self { $( Self::$kind => $dimension, )* } }
            /// Number of nodes.
            pub const fn node_count(self) -> usize { match self { $( Self::$kind => $nodes, )* } }
            /// Cell type in VTK files (vtkCellType.h).
            pub const fn vtk_code(self) -> u8 { match self { $( Self::$kind => $vtk, )* } }
            /// Element type in Gmsh files (Gmsh reference manual, "MSH file format").
            pub const fn gmsh_code(self) -> i32 { match self { $( Self::$kind => $gmsh, )* } }
            /// Name in messages.
            pub const fn name(self) -> &'static str { match self { $( Self::$kind => $name, )* } }
            /// Node orders: node `i` in VTK's order is node `gmsh_order()[i]` in Gmsh's. `None` where they agree.
            ///
            /// Source: Gmsh reference manual, "Node ordering"; VTK, vtkQuadratic*.cxx and vtkTriQuadraticHexahedron.cxx.
            pub const fn gmsh_order(self) -> Option<&'static [usize]> { match self { $( Self::$kind => $order, )* } }
            /// The kind with this VTK cell type.
            pub fn from_vtk(code: u8) -> Option<Self> { match code { $( $vtk => Some(Self::$kind), )* _ => None } }
            /// The kind with this Gmsh element type.
            pub fn from_gmsh(code: i32) -> Option<Self> { match code { $( $gmsh => Some(Self::$kind), )* _ => None } }
        }
        /// The supported kinds, for messages.
        pub(crate) const SUPPORTED: &str = cells!(@join $( $name ),*);
    };
    (@join $first:literal $(, $rest:literal)*) => { concat!($first $(, ", ", $rest)*) };
}

cells! {
    /// A point.
    Vertex1: 0, 1, 1, 15, "vertex", None;
    /// Straight line.
    Line2: 1, 2, 3, 1, "line", None;
    /// Quadratic line: ends, midpoint.
    Line3: 1, 3, 21, 8, "line3", None;
    /// Linear triangle.
    Triangle3: 2, 3, 5, 2, "triangle", None;
    /// Quadratic triangle: corners, midpoints of 01 12 20.
    Triangle6: 2, 6, 22, 9, "triangle6", None;
    /// Bilinear quadrilateral.
    Quad4: 2, 4, 9, 3, "quad", None;
    /// Serendipity quadrilateral: corners, midpoints of 01 12 23 30.
    Quad8: 2, 8, 23, 16, "quad8", None;
    /// Biquadratic quadrilateral: as `Quad8`, then the centre.
    Quad9: 2, 9, 28, 10, "quad9", None;
    /// Linear tetrahedron.
    Tetra4: 3, 4, 10, 4, "tetra", None;
    /// Quadratic tetrahedron: corners, midpoints of 01 12 20 03 13 23.
    Tetra10: 3, 10, 24, 11, "tetra10", Some(&[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]);
    /// Trilinear hexahedron.
    Hexahedron8: 3, 8, 12, 5, "hexahedron", None;
    /// Serendipity hexahedron: corners, midpoints of 01 12 23 30 45 56 67 74 04 15 26 37.
    Hexahedron20: 3, 20, 25, 17, "hexahedron20",
        Some(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]);
    /// Triquadratic hexahedron: as `Hexahedron20`, then the faces −x +x −y +y −z +z, then the centre.
    Hexahedron27: 3, 27, 29, 12, "hexahedron27",
        Some(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26]);
    /// Linear wedge.
    Wedge6: 3, 6, 13, 6, "wedge", None;
    /// Quadratic wedge: corners, midpoints of 01 12 20 34 45 53 03 14 25.
    Wedge15: 3, 15, 26, 18, "wedge15", Some(&[0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]);
    /// Biquadratic wedge: as `Wedge15`, then the centres of the faces 0143 1254 2035.
    Wedge18: 3, 18, 32, 13, "wedge18", Some(&[0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16]);
    /// Linear pyramid.
    Pyramid5: 3, 5, 14, 7, "pyramid", None;
    /// Quadratic pyramid: corners, midpoints of 01 12 23 30 04 14 24 34.
    Pyramid13: 3, 13, 27, 19, "pyramid13", Some(&[0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12]);
}

impl CellKind {
    /// Reorders the nodes of one cell from Gmsh's order to VTK's, in place.
    ///
    /// # Panics
    /// If `nodes` does not hold `node_count()` nodes.
    pub fn gmsh_to_vtk(self, nodes: &mut [u32]) {
        assert_eq!(nodes.len(), self.node_count());
        if let Some(order) = self.gmsh_order() {
            let mut gmsh = [0; 27];
            gmsh[..nodes.len()].copy_from_slice(nodes);
            for (node, &i) in nodes.iter_mut().zip(order) {
                *node = gmsh[i];
            }
        }
    }

    /// Reorders the nodes of one cell from VTK's order to Gmsh's, in place.
    ///
    /// # Panics
    /// If `nodes` does not hold `node_count()` nodes.
    pub fn vtk_to_gmsh(self, nodes: &mut [u32]) {
        assert_eq!(nodes.len(), self.node_count());
        if let Some(order) = self.gmsh_order() {
            let mut vtk = [0; 27];
            vtk[..nodes.len()].copy_from_slice(nodes);
            for (&node, &i) in vtk.iter().zip(order) {
                nodes[i] = node;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of each quadratic kind's midside nodes, as the two manuals list them.
    type Edges = &'static [[usize; 2]];
    const EDGES: &[(CellKind, Edges, Edges)] = &[
        (
            CellKind::Tetra10,
            &[[0, 1], [1, 2], [2, 0], [0, 3], [2, 3], [1, 3]],
            &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
        ),
        (CellKind::Hexahedron20, HEX_GMSH, HEX_VTK),
        (CellKind::Hexahedron27, HEX_GMSH, HEX_VTK),
        (CellKind::Wedge15, WEDGE_GMSH, WEDGE_VTK),
        (CellKind::Wedge18, WEDGE_GMSH, WEDGE_VTK),
        (
            CellKind::Pyramid13,
            &[[0, 1], [0, 3], [0, 4], [1, 2], [1, 4], [2, 3], [2, 4], [3, 4]],
            &[[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]],
        ),
    ];
    const HEX_GMSH: Edges =
        &[[0, 1], [0, 3], [0, 4], [1, 2], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 7], [5, 6], [6, 7]];
    const HEX_VTK: Edges =
        &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
    const WEDGE_GMSH: Edges = &[[0, 1], [0, 2], [0, 3], [1, 2], [1, 4], [2, 5], [3, 4], [3, 5], [4, 5]];
    const WEDGE_VTK: Edges = &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]];

    #[test]
    fn gmsh_midside_nodes_land_on_the_same_edge_in_vtk_order() {
        for &(kind, gmsh, vtk) in EDGES {
            let corners = kind.node_count() - gmsh.len();
            let corners = corners.min(match kind {
                CellKind::Hexahedron27 => 8,
                CellKind::Wedge18 => 6,
                _ => corners,
            });
            let order = kind.gmsh_order().unwrap();
            for (i, edge) in vtk.iter().enumerate() {
                let mut from = gmsh[order[corners + i] - corners];
                let mut to = *edge;
                from.sort();
                to.sort();
                assert_eq!(from, to, "{} edge {i}", kind.name());
            }
        }
    }

    #[test]
    fn permutations_are_inverse_both_ways() {
        for &kind in CellKind::ALL {
            let nodes: Vec<u32> = (0..kind.node_count() as u32).map(|i| 7 * i + 3).collect();
            let mut there = nodes.clone();
            kind.gmsh_to_vtk(&mut there);
            kind.vtk_to_gmsh(&mut there);
            assert_eq!(there, nodes, "{}", kind.name());
            let mut back = nodes.clone();
            kind.vtk_to_gmsh(&mut back);
            kind.gmsh_to_vtk(&mut back);
            assert_eq!(back, nodes, "{}", kind.name());
        }
    }

    #[test]
    fn codes_lead_back_to_their_kind() {
        for &kind in CellKind::ALL {
            assert_eq!(CellKind::from_vtk(kind.vtk_code()), Some(kind));
            assert_eq!(CellKind::from_gmsh(kind.gmsh_code()), Some(kind));
        }
    }
}
