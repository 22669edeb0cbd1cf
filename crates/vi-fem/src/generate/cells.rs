//! How one box cell is cut into elements and facets, on a lattice of half cells. It must not know
//! where the box lies.

use crate::ElementKind;
use crate::element::{Element, SolidVisitor};

/// A node on the lattice of a cell: 0, 1 (middle) or 2 along each axis.
pub(super) type LatticePoint = [usize; 3];

/// Corners of a cell are numbered i + 2j + 4k.
fn corner(c: usize) -> [f64; 3] {
    [(c & 1) as f64, ((c >> 1) & 1) as f64, ((c >> 2) & 1) as f64]
}

/// Kuhn's six tetrahedra, all around the diagonal 0–7, so that neighbouring cells match.
const TETRAHEDRA: &[&[usize]] =
    &[&[0, 1, 3, 7], &[0, 5, 1, 7], &[0, 3, 2, 7], &[0, 2, 6, 7], &[0, 4, 5, 7], &[0, 6, 4, 7]];
/// Two wedges on either side of the plane x = y.
const WEDGES: &[&[usize]] = &[&[0, 1, 3, 4, 5, 7], &[0, 3, 2, 4, 7, 6]];
const HEXAHEDRA: &[&[usize]] = &[&[0, 1, 3, 2, 4, 5, 7, 6]];

/// The elements of `kind` in a cell, each as its nodes on the lattice; None for kinds that boxes are
/// not made of.
pub(super) fn elements(kind: ElementKind) -> Option<Vec<Vec<LatticePoint>>> {
    let (linear, cells) = match kind {
        ElementKind::Tet4 | ElementKind::Tet10 => (ElementKind::Tet4, TETRAHEDRA),
        ElementKind::Hex8 | ElementKind::Hex20 | ElementKind::Hex27 => (ElementKind::Hex8, HEXAHEDRA),
        ElementKind::Wedge6 | ElementKind::Wedge15 | ElementKind::Wedge18 => (ElementKind::Wedge6, WEDGES),
        _ => return None,
    };
    let nodes = kind.visit_solid(Nodes)?;
    let place = |cell: &&[usize]| {
        let on_lattice = |&xi: &[f64; 3]| {
            let weights = linear.visit_solid(Values(xi)).unwrap_or_default();
            let sum = |i: usize| -> f64 { weights.iter().zip(*cell).map(|(w, &c)| w * corner(c)[i]).sum() };
            [0, 1, 2].map(|i| (2.0 * sum(i)).round() as usize)
        };
        nodes.iter().map(on_lattice).collect()
    };
    Some(cells.iter().map(place).collect())
}

/// Nodes of the reference cell of a kind.
struct Nodes;
impl SolidVisitor for Nodes {
    type Output = Vec<[f64; 3]>;
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) -> Self::Output {
        E::nodes().to_vec()
    }
}

/// Shape functions of a kind at a point.
struct Values([f64; 3]);
impl SolidVisitor for Values {
    type Output = Vec<f64>;
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) -> Self::Output {
        E::values(self.0).to_vec()
    }
}

/// The facets of `kind`'s elements on the face of a cell across `axis`, each as its nodes on the
/// lattice, turned so that they look outwards.
pub(super) fn facets(kind: ElementKind, axis: usize, far: bool) -> (ElementKind, Vec<Vec<LatticePoint>>) {
    let triangles = match kind {
        ElementKind::Tet4 | ElementKind::Tet10 => true,
        ElementKind::Wedge6 | ElementKind::Wedge15 | ElementKind::Wedge18 => axis == 2,
        _ => false,
    };
    let facet_kind = match (kind, triangles) {
        (ElementKind::Tet10 | ElementKind::Wedge15 | ElementKind::Wedge18, true) => ElementKind::Tri6,
        (_, true) => ElementKind::Tri3,
        (ElementKind::Hex20 | ElementKind::Wedge15, false) => ElementKind::Quad8,
        (ElementKind::Hex27 | ElementKind::Wedge18, false) => ElementKind::Quad9,
        (_, false) => ElementKind::Quad4,
    };
    // Corners in the face's own axes u, v, counter-clockwise seen from outside a far face.
    let corners: &[&[[usize; 2]]] = if triangles {
        &[&[[0, 0], [2, 0], [2, 2]], &[[0, 0], [2, 2], [0, 2]]]
    } else {
        &[&[[0, 0], [2, 0], [2, 2], [0, 2]]]
    };
    let facet = |corners: &&[[usize; 2]]| {
        let mut corners = corners.to_vec();
        if !far {
            corners[1..].reverse();
        }
        let count = corners.len();
        let mut nodes = corners.clone();
        if facet_kind.node_count() >= 2 * count {
            let middle = |k: usize| [0, 1].map(|i| (corners[k][i] + corners[(k + 1) % count][i]) / 2);
            nodes.extend((0..count).map(middle));
        }
        if facet_kind == ElementKind::Quad9 {
            nodes.push([1, 1]);
        }
        let in_space = |uv: &[usize; 2]| {
            let mut point = [0; 3];
            point[axis] = if far { 2 } else { 0 };
            (point[(axis + 1) % 3], point[(axis + 2) % 3]) = (uv[0], uv[1]);
            point
        };
        nodes.iter().map(in_space).collect()
    };
    (facet_kind, corners.iter().map(facet).collect())
}
