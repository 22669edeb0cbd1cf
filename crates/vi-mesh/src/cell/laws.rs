//! Tests the laws that every row of the table must obey. A new row adds its kind.

use std::collections::{HashMap, HashSet};

use super::interpolation::ShapeFunctions;
use super::{CellKind, Middles};
use crate::mesh::Mesh;

fn of_dimension(dimension: usize) -> impl Iterator<Item = CellKind> {
    CellKind::ALL.iter().copied().filter(move |kind| kind.dimension() == dimension)
}

#[test]
fn names_and_codes_lead_back_to_their_kind() {
    let names: HashSet<_> = CellKind::ALL.iter().map(|kind| kind.name()).collect();
    assert_eq!(names.len(), CellKind::ALL.len());
    for &kind in CellKind::ALL {
        assert_eq!(CellKind::from_vtk_code(kind.vtk_code()), Some(kind));
        assert_eq!(CellKind::from_gmsh_code(kind.gmsh_code()), Some(kind));
        assert_eq!(kind.name().to_lowercase(), format!("{kind:?}").to_lowercase());
    }
}

#[test]
fn nodes_are_corners_and_middles() {
    for &kind in CellKind::ALL {
        assert_eq!(kind.reference_nodes().len(), kind.node_count(), "{kind}");
        let linear = kind.linear();
        assert!(linear.is_linear() && linear.dimension() == kind.dimension());
        assert_eq!(linear.node_count(), kind.corner_count());
        assert_eq!(linear.reference_nodes(), &kind.reference_nodes()[..kind.corner_count()], "{kind}");
        // Each node is the mean of the corners of the face of the cell to which it belongs.
        let distinct: HashSet<_> = kind.reference_nodes().iter().map(|x| x.map(f64::to_bits)).collect();
        assert_eq!(distinct.len(), kind.node_count(), "{kind}");
        for (k, &[a, b]) in kind.edges().iter().enumerate().filter(|_| kind.middles() >= Middles::Edges) {
            let nodes = kind.reference_nodes();
            let middle = [0, 1, 2].map(|i| 0.5 * (nodes[a][i] + nodes[b][i]));
            assert_eq!(nodes[kind.corner_count() + k], middle, "{kind}");
        }
    }
}

#[test]
fn a_quadratic_relative_is_an_extension() {
    for &kind in CellKind::ALL.iter().filter(|kind| kind.dimension() > 0) {
        let quadratic = kind.quadratic().unwrap();
        assert_eq!(quadratic.linear(), kind.linear());
        assert_eq!(quadratic.node_count(), kind.corner_count() + kind.edges().len(), "{kind}");
        let common = kind.node_count().min(quadratic.node_count());
        assert_eq!(quadratic.reference_nodes()[..common], kind.reference_nodes()[..common]);
    }
    assert_eq!(CellKind::Point.quadratic(), None);
}

/// Each edge of a volume is traversed in both directions, by two faces; the faces face outwards; V − E + F = 2.
#[test]
fn faces_close_the_surface_of_a_volume() {
    for kind in of_dimension(3) {
        let mut runs: HashMap<[usize; 2], usize> = HashMap::new();
        for side in kind.sides() {
            let corners = &side.nodes[..side.kind.corner_count()];
            for k in 0..corners.len() {
                *runs.entry([corners[k], corners[(k + 1) % corners.len()]]).or_default() += 1;
            }
        }
        assert_eq!(runs.len(), 2 * kind.edges().len(), "{kind}");
        for &[a, b] in kind.edges() {
            assert_eq!((runs[&[a, b]], runs[&[b, a]]), (1, 1), "{kind} {a}–{b}");
        }
        assert_eq!(kind.corner_count() + kind.sides().len(), kind.edges().len() + 2, "{kind}");
        let nodes = kind.reference_nodes();
        let middle =
            |of: &[usize]| [0, 1, 2].map(|i| of.iter().map(|&a| nodes[a][i]).sum::<f64>() / of.len() as f64);
        let centre = middle(&Vec::from_iter(0..kind.corner_count()));
        for side in kind.sides() {
            let face = middle(&side.nodes[..side.kind.corner_count()]);
            let [a, b, c] = [0, 1, 2].map(|k| nodes[side.nodes[k]]);
            let [u, v] = [b, c].map(|x| [0, 1, 2].map(|i| x[i] - a[i]));
            let outward = [0, 1, 2].map(|i| face[i] - centre[i]);
            assert!(crate::vector::determinant([outward, u, v]) > 0.0, "{kind} {side:?}");
        }
    }
    // The cube [−1, 1]³ has the volume 8, the pyramid over the square of side 2 has 4/3.
    let volumes = [("tet4", 1.0 / 6.0), ("hex8", 8.0), ("wedge6", 0.5), ("pyramid5", 4.0 / 3.0)];
    for kind in of_dimension(3) {
        let (_, volume) = volumes.iter().find(|(name, _)| *name == kind.linear().name()).unwrap();
        assert!((reference_mesh(kind).volume(0).unwrap() - volume).abs() < 1e-14, "{kind}");
    }
}

fn reference_mesh(kind: CellKind) -> Mesh {
    let mut mesh = Mesh { points: kind.reference_nodes().to_vec(), ..Mesh::default() };
    mesh.push_cell(kind, &Vec::from_iter(0..kind.node_count() as u32));
    mesh
}

/// A side has the kind that matches its cell, and its nodes lie at the positions of the side's reference cell.
#[test]
fn sides_have_the_nodes_of_their_kind_in_order() {
    for &kind in CellKind::ALL {
        for side in kind.sides() {
            assert_eq!(side.kind.dimension() + 1, kind.dimension());
            assert_eq!(side.kind.is_linear(), kind.is_linear() || side.kind == CellKind::Point, "{kind}");
            let at = |a: usize| kind.reference_nodes()[side.nodes[a]];
            let linear = ShapeFunctions::of(side.kind.linear());
            for (a, &xi) in side.kind.reference_nodes().iter().enumerate() {
                let weights = linear.values(xi);
                let expected =
                    [0, 1, 2].map(|i| weights.iter().enumerate().map(|(c, w)| w * at(c)[i]).sum::<f64>());
                assert_eq!(at(a), expected, "{kind} {side:?}");
            }
        }
        // All nodes except one at the centre of a cell are on sides.
        let on_sides: HashSet<_> = kind.sides().iter().flat_map(|side| &side.nodes).collect();
        let inside = match (kind.dimension(), kind.middles()) {
            (0, _) | (1, Middles::Edges) | (_, Middles::Cell) => 1,
            _ => 0,
        };
        assert_eq!(on_sides.len() + inside, kind.node_count(), "{kind}");
    }
}

/// The triangles of a surface cell cover it once, counter-clockwise, and use all of its nodes.
#[test]
fn triangles_cover_surface_cells() {
    for kind in of_dimension(2) {
        let nodes = kind.reference_nodes();
        let mut area = 0.0;
        for &[a, b, c] in kind.triangles() {
            let [a, b, c] = [a, b, c].map(|k| nodes[k]);
            let twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            assert!(twice > 0.0, "{kind}");
            area += 0.5 * twice;
        }
        assert_eq!(area, if kind.corner_count() == 3 { 0.5 } else { 4.0 }, "{kind}");
        let used: HashSet<_> = kind.triangles().iter().flatten().collect();
        assert_eq!(used.len(), kind.node_count(), "{kind}");
    }
}

/// N_a is 1 at node a and 0 at the others; the sum is 1, and linear functions are reproduced.
#[test]
fn shape_functions_interpolate() {
    for &kind in CellKind::ALL {
        let (functions, nodes) = (ShapeFunctions::of(kind), kind.reference_nodes());
        for (a, &xi) in nodes.iter().enumerate() {
            let expected: Vec<f64> = (0..nodes.len()).map(|b| if a == b { 1.0 } else { 0.0 }).collect();
            assert_eq!(functions.values(xi), expected, "{kind} at node {a}");
        }
        for fractions in [[0.21, 0.13, 0.37], [0.4, 0.35, 0.25], [0.125, 0.25, 0.5]] {
            let xi = [0, 1, 2].map(|i| if i < kind.dimension() { fractions[i] } else { 0.0 });
            let values = functions.values(xi);
            assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{kind}");
            let sum = |i: usize| values.iter().zip(nodes).map(|(value, node)| value * node[i]).sum::<f64>();
            assert!((0..3).all(|i| (sum(i) - xi[i]).abs() < 1e-14), "{kind}");
        }
    }
}

/// Returns the ends of the edges that have a middle node, as listed in the manual of Gmsh.
fn gmsh_edges(kind: CellKind) -> &'static [[usize; 2]] {
    match kind.linear() {
        CellKind::Tet4 => &[[0, 1], [1, 2], [2, 0], [0, 3], [2, 3], [1, 3]],
        CellKind::Hex8 => {
            &[[0, 1], [0, 3], [0, 4], [1, 2], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 7], [5, 6], [6, 7]]
        }
        CellKind::Wedge6 => &[[0, 1], [0, 2], [0, 3], [1, 2], [1, 4], [2, 5], [3, 4], [3, 5], [4, 5]],
        CellKind::Pyramid5 => &[[0, 1], [0, 3], [0, 4], [1, 2], [1, 4], [2, 3], [2, 4], [3, 4]],
        _ => kind.edges(),
    }
}

#[test]
fn middle_nodes_of_gmsh_land_on_the_same_edge() {
    let sorted = |[a, b]: [usize; 2]| [a.min(b), a.max(b)];
    for &kind in CellKind::ALL.iter().filter(|kind| kind.middles() >= Middles::Edges) {
        let same: Vec<usize> = (0..kind.node_count()).collect();
        let order = kind.gmsh_order().unwrap_or(&same);
        for (k, &edge) in kind.edges().iter().enumerate() {
            let corners = kind.corner_count();
            assert_eq!(sorted(gmsh_edges(kind)[order[corners + k] - corners]), sorted(edge), "{kind} {k}");
        }
    }
}

#[test]
fn reordering_from_gmsh_is_a_permutation_that_keeps_corners() {
    for &kind in CellKind::ALL {
        let all: Vec<u32> = (0..kind.node_count() as u32).collect();
        let mut nodes = all.clone();
        kind.reorder_from_gmsh(&mut nodes);
        assert_eq!(nodes[..kind.corner_count()], all[..kind.corner_count()], "{kind}");
        for (node, &from) in nodes.iter().zip(kind.gmsh_order().unwrap_or_default()) {
            assert_eq!(*node as usize, from);
        }
        nodes.sort_unstable();
        assert_eq!(nodes, all, "{kind}");
    }
}
