//! Cuts one box cell into elements and facets, on a lattice of half cells.

use crate::cell::interpolation::ShapeFunctions;
use crate::cell::{CellKind, Side};

/// A node on the lattice of a cell: 0, 1 (midpoint) or 2 along each axis.
pub(super) type LatticePoint = [usize; 3];

/// The corners of a cell by their numbers i + 2j + 4k, then its centre, on the lattice.
const PLACES: [LatticePoint; 9] =
    [[0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 2, 0], [0, 0, 2], [2, 0, 2], [0, 2, 2], [2, 2, 2], [1, 1, 1]];

/// Kuhn's six tetrahedra, all around the diagonal 0–7, so that neighbouring cells match.
const TETRAHEDRA: &[&[usize]] =
    &[&[0, 1, 3, 7], &[0, 5, 1, 7], &[0, 3, 2, 7], &[0, 2, 6, 7], &[0, 4, 5, 7], &[0, 6, 4, 7]];
/// Two wedges, one on each side of the plane x = y.
const WEDGES: &[&[usize]] = &[&[0, 1, 3, 4, 5, 7], &[0, 3, 2, 4, 7, 6]];
const HEXAHEDRA: &[&[usize]] = &[&[0, 1, 3, 2, 4, 5, 7, 6]];
/// Six pyramids around the centre.
const PYRAMIDS: &[&[usize]] = &[
    &[0, 2, 6, 4, 8],
    &[1, 5, 7, 3, 8],
    &[0, 4, 5, 1, 8],
    &[2, 3, 7, 6, 8],
    &[0, 1, 3, 2, 8],
    &[4, 6, 7, 5, 8],
];

/// Returns the elements of `kind` in a cell, each as its nodes on the lattice; `None` for a kind that a box cannot
/// consist of.
pub(super) fn elements(kind: CellKind) -> Option<Vec<Vec<LatticePoint>>> {
    let cells = match kind.linear() {
        CellKind::Tet4 => TETRAHEDRA,
        CellKind::Hex8 => HEXAHEDRA,
        CellKind::Wedge6 => WEDGES,
        CellKind::Pyramid5 => PYRAMIDS,
        _ => return None,
    };
    let functions = ShapeFunctions::of(kind.linear());
    let weights: Vec<Vec<f64>> = kind.reference_nodes().iter().map(|&xi| functions.values(xi)).collect();
    let place = |cell: &[usize], weights: &Vec<f64>| {
        let sum = |i: usize| -> f64 { weights.iter().zip(cell).map(|(w, &c)| w * PLACES[c][i] as f64).sum() };
        let place = [0, 1, 2].map(sum);
        // The midpoints of edges towards the centre are not on the lattice.
        place.iter().all(|x| x.fract() == 0.0).then(|| place.map(|x| x as usize))
    };
    cells.iter().map(|cell| weights.iter().map(|weights| place(cell, weights)).collect()).collect()
}

/// Returns the facets of the elements of `kind` on the face of a cell normal to `axis`, each as its nodes on the
/// lattice, oriented outwards.
pub(super) fn facets(
    kind: CellKind,
    elements: &[Vec<LatticePoint>],
    axis: usize,
    far: bool,
) -> (CellKind, Vec<Vec<LatticePoint>>) {
    let height = if far { 2 } else { 0 };
    let on_face = |nodes: &Vec<LatticePoint>| {
        let lies_on = |side: &&Side| side.nodes.iter().all(|&a| nodes[a][axis] == height);
        kind.sides().iter().find(lies_on).map(|side| side.kind)
    };
    let facet_kind = elements.iter().find_map(on_face).unwrap_or(CellKind::Quad4);
    // Corners in the face's own axes u, v, counter-clockwise if the far face is seen from outside.
    let corners: &[&[[usize; 2]]] = if facet_kind.corner_count() == 3 {
        &[&[[0, 0], [2, 0], [2, 2]], &[[0, 0], [2, 2], [0, 2]]]
    } else {
        &[&[[0, 0], [2, 0], [2, 2], [0, 2]]]
    };
    let facet = |corners: &&[[usize; 2]]| {
        let mut corners = corners.to_vec();
        if !far {
            corners[1..].reverse();
        }
        let mut nodes = corners.clone();
        if !facet_kind.is_linear() {
            let middle = |[a, b]: [usize; 2]| [0, 1].map(|i| (corners[a][i] + corners[b][i]) / 2);
            nodes.extend(facet_kind.edges().iter().copied().map(middle));
        }
        if facet_kind == CellKind::Quad9 {
            nodes.push([1, 1]);
        }
        let in_space = |uv: &[usize; 2]| {
            let mut point = [0; 3];
            point[axis] = height;
            (point[(axis + 1) % 3], point[(axis + 2) % 3]) = (uv[0], uv[1]);
            point
        };
        nodes.iter().map(in_space).collect()
    };
    (facet_kind, corners.iter().map(facet).collect())
}
