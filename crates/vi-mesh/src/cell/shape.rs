//! The shapes of cells: corners, edges and faces, which cells of every order share.

/// The name of a shape.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Family {
    Point,
    Line,
    Triangle,
    Quadrilateral,
    Tetrahedron,
    Hexahedron,
    Wedge,
    Pyramid,
}

/// A reference shape and its topology. All numbers are local corner numbers.
pub(super) struct Shape {
    pub(super) family: Family,
    /// 0 for a point, 1 for a line, 2 for a surface, 3 for a volume.
    pub(super) dimension: usize,
    /// Positions of the corners in the reference cell.
    pub(super) corners: &'static [[f64; 3]],
    /// Ends of the edges, in the order of their middle nodes.
    pub(super) edges: &'static [[usize; 2]],
    /// Corners of the faces of a volume, counter-clockwise seen from outside, in the order of the faces' middle
    /// nodes.
    pub(super) faces: &'static [&'static [usize]],
    /// The coordinates of each simplex of which the reference cell is the product; for a cone, of which its base is
    /// the product.
    pub(super) factors: &'static [&'static [usize]],
    /// Whether the product shrinks to a point along the third coordinate, which goes from 0 to 1.
    pub(super) is_cone: bool,
}

const SQUARE_EDGES: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 3], [3, 0]];

pub(super) const POINT: Shape = Shape {
    family: Family::Point,
    dimension: 0,
    corners: &[[0.0; 3]],
    edges: &[],
    faces: &[],
    factors: &[],
    is_cone: false,
};

/// ξ from 0 to 1.
pub(super) const LINE: Shape = Shape {
    family: Family::Line,
    dimension: 1,
    corners: &[[0.0; 3], [1.0, 0.0, 0.0]],
    edges: &[[0, 1]],
    faces: &[],
    factors: &[&[0]],
    is_cone: false,
};

/// ξ, η ≥ 0, ξ + η ≤ 1.
pub(super) const TRIANGLE: Shape = Shape {
    family: Family::Triangle,
    dimension: 2,
    corners: &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    edges: &[[0, 1], [1, 2], [2, 0]],
    faces: &[],
    factors: &[&[0, 1]],
    is_cone: false,
};

/// ξ, η from −1 to 1.
pub(super) const QUADRILATERAL: Shape = Shape {
    family: Family::Quadrilateral,
    dimension: 2,
    corners: &[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]],
    edges: SQUARE_EDGES,
    faces: &[],
    factors: &[&[0], &[1]],
    is_cone: false,
};

/// ξ, η, ζ ≥ 0, ξ + η + ζ ≤ 1.
pub(super) const TETRAHEDRON: Shape = Shape {
    family: Family::Tetrahedron,
    dimension: 3,
    corners: &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    edges: &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
    faces: &[&[0, 1, 3], &[1, 2, 3], &[2, 0, 3], &[0, 2, 1]],
    factors: &[&[0, 1, 2]],
    is_cone: false,
};

/// ξ, η, ζ from −1 to 1; faces −ξ +ξ −η +η −ζ +ζ.
pub(super) const HEXAHEDRON: Shape = Shape {
    family: Family::Hexahedron,
    dimension: 3,
    corners: &[
        [-1.0, -1.0, -1.0],
        [1.0, -1.0, -1.0],
        [1.0, 1.0, -1.0],
        [-1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0],
        [1.0, -1.0, 1.0],
        [1.0, 1.0, 1.0],
        [-1.0, 1.0, 1.0],
    ],
    edges: &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]],
    faces: &[&[0, 4, 7, 3], &[1, 2, 6, 5], &[0, 1, 5, 4], &[3, 7, 6, 2], &[0, 3, 2, 1], &[4, 5, 6, 7]],
    factors: &[&[0], &[1], &[2]],
    is_cone: false,
};

/// The triangle ξ, η ≥ 0, ξ + η ≤ 1, and ζ from 0 to 1.
pub(super) const WEDGE: Shape = Shape {
    family: Family::Wedge,
    dimension: 3,
    corners: &[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [0.0, 1.0, 1.0],
    ],
    edges: &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
    faces: &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]],
    factors: &[&[0, 1], &[2]],
    is_cone: false,
};

/// |ξ|, |η| ≤ 1 − ζ, ζ from 0 to 1.
pub(super) const PYRAMID: Shape = Shape {
    family: Family::Pyramid,
    dimension: 3,
    corners: &[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    edges: &[[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]],
    faces: &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
    factors: &[&[0], &[1]],
    is_cone: true,
};
