//! The only table of cell kinds. A row gives the name, the shape, the middle nodes and the codes in file formats.
//! Sides, reference nodes and shape functions follow from the row.

pub(crate) mod interpolation;
#[cfg(test)]
mod laws;
mod shape;

use std::sync::LazyLock;

use shape::{HEXAHEDRON, LINE, POINT, PYRAMID, QUADRILATERAL, Shape, TETRAHEDRON, TRIANGLE, WEDGE};

/// The nodes of a kind besides its corners: at the midpoints of edges, then of quadrilateral faces, then of the cell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Middles {
    /// No nodes besides the corners.
    None,
    /// Midpoints of edges.
    Edges,
    /// Midpoints of edges and quadrilateral faces.
    Faces,
    /// Midpoints of edges, quadrilateral faces and the cell.
    Cell,
}

macro_rules! cells {
    ($(
        $(#[$doc:meta])*
        $kind:ident = $name:literal: $shape:ident, $middles:ident, $nodes:literal nodes, vtk $vtk:literal,
            gmsh $gmsh:literal $($order:expr)?;
    )*) => {
        /// The kind of a cell. Nodes are in VTK's order: corners, then midpoints of edges, of faces, of the cell.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
        #[non_exhaustive]
        pub enum CellKind { $( $(#[$doc])* #[cfg_attr(feature = "serde", serde(rename = $name))] $kind, )* }

        impl CellKind {
            /// All kinds.
            pub const ALL: &'static [Self] = &[$( Self::$kind ),*];

            /// The names of all kinds, for messages.
            pub const NAMES: &'static str = cells!(@join $( $name ),*);

            /// Returns the name in scene files and messages.
            pub const fn name(self) -> &'static str {
                match self { $( Self::$kind => $name, )* }
            }

            /// Returns the number of nodes per cell.
            pub const fn node_count(self) -> usize {
                match self { $( Self::$kind => $nodes, )* }
            }

            /// Returns the code of the kind in VTK files (vtkCellType.h).
            pub const fn vtk_code(self) -> u8 {
                match self { $( Self::$kind => $vtk, )* }
            }

            /// Returns the kind with this code in VTK files.
            pub fn from_vtk_code(code: u8) -> Option<Self> {
                match code { $( $vtk => Some(Self::$kind), )* _ => None }
            }

            /// Returns the code of the kind in Gmsh files (Gmsh reference manual, "MSH file format").
            pub const fn gmsh_code(self) -> i32 {
                match self { $( Self::$kind => $gmsh, )* }
            }

            /// Returns the kind with this code in Gmsh files.
            pub fn from_gmsh_code(code: i32) -> Option<Self> {
                match code { $( $gmsh => Some(Self::$kind), )* _ => None }
            }

            /// Returns Gmsh's order of the nodes: node `i` is node `gmsh_order()[i]` of Gmsh. `None` if the orders
            /// agree.
            ///
            /// Source: Gmsh reference manual, "Node ordering"; VTK, vtkQuadratic*.cxx and
            /// vtkTriQuadraticHexahedron.cxx.
            pub const fn gmsh_order(self) -> Option<&'static [usize]> {
                match self { $( Self::$kind => cells!(@order $($order)?), )* }
            }

            const fn shape(self) -> &'static Shape {
                match self { $( Self::$kind => &$shape, )* }
            }

            const fn middles(self) -> Middles {
                match self { $( Self::$kind => Middles::$middles, )* }
            }
        }
    };
    (@join $first:literal $(, $rest:literal)*) => { concat!($first $(, ", ", $rest)*) };
    (@order) => { None };
    (@order $order:expr) => { Some(&$order) };
}

cells! {
    /// A point.
    Point = "point": POINT, None, 1 nodes, vtk 1, gmsh 15;
    /// A straight edge.
    Line2 = "line2": LINE, None, 2 nodes, vtk 3, gmsh 1;
    /// A quadratic edge.
    Line3 = "line3": LINE, Edges, 3 nodes, vtk 21, gmsh 8;
    /// Linear triangle.
    Tri3 = "tri3": TRIANGLE, None, 3 nodes, vtk 5, gmsh 2;
    /// Quadratic triangle.
    Tri6 = "tri6": TRIANGLE, Edges, 6 nodes, vtk 22, gmsh 9;
    /// Bilinear quadrilateral.
    Quad4 = "quad4": QUADRILATERAL, None, 4 nodes, vtk 9, gmsh 3;
    /// Quadratic quadrilateral without a middle node.
    Quad8 = "quad8": QUADRILATERAL, Edges, 8 nodes, vtk 23, gmsh 16;
    /// Biquadratic quadrilateral.
    Quad9 = "quad9": QUADRILATERAL, Cell, 9 nodes, vtk 28, gmsh 10;
    /// Linear tetrahedron.
    Tet4 = "tet4": TETRAHEDRON, None, 4 nodes, vtk 10, gmsh 4;
    /// Quadratic tetrahedron.
    Tet10 = "tet10": TETRAHEDRON, Edges, 10 nodes, vtk 24, gmsh 11 [0, 1, 2, 3, 4, 5, 6, 7, 9, 8];
    /// Trilinear hexahedron.
    Hex8 = "hex8": HEXAHEDRON, None, 8 nodes, vtk 12, gmsh 5;
    /// Quadratic hexahedron without middle nodes.
    Hex20 = "hex20": HEXAHEDRON, Edges, 20 nodes, vtk 25, gmsh 17
        [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15];
    /// Triquadratic hexahedron.
    Hex27 = "hex27": HEXAHEDRON, Cell, 27 nodes, vtk 29, gmsh 12
        [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26];
    /// Linear wedge.
    Wedge6 = "wedge6": WEDGE, None, 6 nodes, vtk 13, gmsh 6;
    /// Quadratic wedge.
    Wedge15 = "wedge15": WEDGE, Edges, 15 nodes, vtk 26, gmsh 18 [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11];
    /// Biquadratic wedge.
    Wedge18 = "wedge18": WEDGE, Faces, 18 nodes, vtk 32, gmsh 13
        [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16];
    /// Linear pyramid.
    Pyramid5 = "pyramid5": PYRAMID, None, 5 nodes, vtk 14, gmsh 7;
    /// Quadratic pyramid without a middle node.
    Pyramid13 = "pyramid13": PYRAMID, Edges, 13 nodes, vtk 27, gmsh 19 [0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12];
    /// Quadratic pyramid with a node at the centre of its base. In VTK it is a Lagrange pyramid of order 2.
    Pyramid14 = "pyramid14": PYRAMID, Faces, 14 nodes, vtk 74, gmsh 14 [0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12, 13];
}

/// A side of a cell: a face of a volume, an edge of a surface, an end of a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Side {
    /// The kind of the side.
    pub kind: CellKind,
    /// The nodes of the side as local numbers in the cell, in the order of the side's kind.
    pub nodes: Vec<usize>,
}

/// The data that follow from a row of the table.
struct Derived {
    reference_nodes: Vec<[f64; 3]>,
    sides: Vec<Side>,
}

static DERIVED: LazyLock<Vec<Derived>> = LazyLock::new(|| {
    let derive = |kind: &CellKind| Derived { reference_nodes: kind.make_nodes(), sides: kind.make_sides() };
    CellKind::ALL.iter().map(derive).collect()
});

impl CellKind {
    /// Returns the dimension of the cell: 0 point, 1 curve, 2 surface, 3 volume.
    pub const fn dimension(self) -> usize {
        self.shape().dimension
    }

    /// Returns the number of corners per cell; they are the first nodes.
    pub const fn corner_count(self) -> usize {
        self.shape().corners.len()
    }

    /// Returns the kind with the same corners and no other nodes; a linear kind returns itself.
    pub fn linear(self) -> Self {
        let fits = |kind: &Self| kind.shape().family == self.shape().family && kind.is_linear();
        Self::ALL.iter().copied().find(fits).unwrap_or(self)
    }

    /// Returns whether the kind has corner nodes only.
    pub const fn is_linear(self) -> bool {
        matches!(self.middles(), Middles::None)
    }

    /// Returns the kind with the same corners and a node at the midpoint of every edge, and no others. `None` for a
    /// point.
    pub fn quadratic(self) -> Option<Self> {
        let fits =
            |kind: &Self| kind.shape().family == self.shape().family && kind.middles() == Middles::Edges;
        Self::ALL.iter().copied().find(fits)
    }

    /// Returns the kind with the corners of `shape` and as many middle nodes as cells of this kind have.
    pub(crate) fn of_shape(self, shape: Self) -> Self {
        let fits =
            |kind: &&Self| kind.shape().family == shape.shape().family && kind.middles() <= self.middles();
        Self::ALL.iter().filter(fits).max_by_key(|kind| kind.middles()).copied().unwrap_or(shape)
    }

    /// Returns the ends of the edges as local node numbers. In kinds with middle nodes, node `corner_count() + k` is
    /// the midpoint of edge k.
    pub const fn edges(self) -> &'static [[usize; 2]] {
        self.shape().edges
    }

    /// Returns the cells of one dimension less that bound the cell. The faces of a volume are counter-clockwise seen
    /// from outside; the edges of a surface follow the orientation of its nodes.
    pub fn sides(self) -> &'static [Side] {
        &DERIVED[self as usize].sides
    }

    /// Returns the positions of the nodes in the reference cell. Lines, triangles, tetrahedra and the heights of
    /// wedges and pyramids are on [0, 1]; quadrilaterals, hexahedra and the bases of pyramids on [−1, 1].
    pub fn reference_nodes(self) -> &'static [[f64; 3]] {
        &DERIVED[self as usize].reference_nodes
    }

    /// Returns triangles, as local node numbers, that cover a surface cell and use all of its nodes. Empty for other
    /// dimensions.
    pub const fn triangles(self) -> &'static [[usize; 3]] {
        match self {
            Self::Tri3 => &[[0, 1, 2]],
            Self::Tri6 => &[[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
            Self::Quad4 => &[[0, 1, 2], [0, 2, 3]],
            Self::Quad8 => &[[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 6], [4, 6, 7]],
            // Eight triangles around the central node.
            Self::Quad9 => {
                &[[8, 0, 4], [8, 4, 1], [8, 1, 5], [8, 5, 2], [8, 2, 6], [8, 6, 3], [8, 3, 7], [8, 7, 0]]
            }
            _ => &[],
        }
    }

    /// Returns quadrilaterals, as local node numbers, that [`CellKind::triangles`] cuts along the diagonal from their first to their third
    /// node although the other one would do as well.
    pub const fn cut_quadrilaterals(self) -> &'static [[usize; 4]] {
        match self {
            Self::Quad4 => &[[0, 1, 2, 3]],
            Self::Quad8 => &[[4, 5, 6, 7]],
            _ => &[],
        }
    }

    /// Reorders the nodes of one cell from Gmsh's order to that of this crate, in place.
    ///
    /// # Panics
    /// If `nodes` does not hold `node_count()` nodes.
    pub fn reorder_from_gmsh(self, nodes: &mut [u32]) {
        assert_eq!(nodes.len(), self.node_count());
        if let Some(order) = self.gmsh_order() {
            let gmsh = nodes.to_vec();
            for (node, &i) in nodes.iter_mut().zip(order) {
                *node = gmsh[i];
            }
        }
    }

    /// Returns the local number of the midpoint of the edge between two corners. `None` if the kind has no such node.
    fn middle_of_edge(self, a: usize, b: usize) -> Option<usize> {
        let edge = self.edges().iter().position(|&edge| edge == [a, b] || edge == [b, a])?;
        (self.middles() >= Middles::Edges).then_some(self.corner_count() + edge)
    }

    fn make_nodes(self) -> Vec<[f64; 3]> {
        let Shape { corners, edges, faces, .. } = self.shape();
        let mean = |of: &[usize]| {
            [0, 1, 2].map(|i| of.iter().map(|&corner| corners[corner][i]).sum::<f64>() / of.len() as f64)
        };
        let mut nodes = corners.to_vec();
        if self.middles() >= Middles::Edges {
            nodes.extend(edges.iter().map(|edge| mean(edge)));
        }
        if self.middles() >= Middles::Faces {
            nodes.extend(faces.iter().filter(|face| face.len() == 4).map(|face| mean(face)));
        }
        if self.middles() == Middles::Cell {
            nodes.push(mean(&Vec::from_iter(0..corners.len())));
        }
        nodes
    }

    fn make_sides(self) -> Vec<Side> {
        let shape = self.shape();
        let corners: Vec<Vec<usize>> = match shape.dimension {
            3 => shape.faces.iter().map(|face| face.to_vec()).collect(),
            2 => shape.edges.iter().map(|edge| edge.to_vec()).collect(),
            1 => vec![vec![0], vec![1]],
            _ => vec![],
        };
        let mut next_face = shape.corners.len() + shape.edges.len();
        let mut side = |corners: Vec<usize>| {
            let count = corners.len();
            let mut nodes = corners.clone();
            // A line has one edge, not one after each corner.
            for k in 0..if count == 2 { 1 } else { count } {
                nodes.extend(self.middle_of_edge(corners[k], corners[(k + 1) % count]));
            }
            if count == 4 && self.middles() >= Middles::Faces {
                nodes.push(next_face);
                next_face += 1;
            }
            let size = (shape.dimension - 1, count, nodes.len());
            let is_side = |kind: &&Self| (kind.dimension(), kind.corner_count(), kind.node_count()) == size;
            let kind = *Self::ALL.iter().find(is_side).expect("the table has the sides of its cells");
            Side { kind, nodes }
        };
        corners.into_iter().map(&mut side).collect()
    }
}

impl std::fmt::Display for CellKind {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.pad(self.name())
    }
}
