//! Uniform refinement: cuts every cell into smaller ones of half its size.
//!
//! A node of a small cell is a point ξ of the reference cell of the large one, and lies where the shape functions of
//! the large cell map it; so curved cells stay curved. Two cells that share a facet give its points the same weights,
//! by which these are recognised as the same node.

use std::collections::HashMap;

use crate::cell::CellKind;
use crate::cell::interpolation::ShapeFunctions;
use crate::error::MeshError;
use crate::finer::FinerMesh;
use crate::mesh::{CellBlock, Mesh, Region};
use crate::vector::determinant;

/// Weights of shape functions at quarter points of a facet are multiples of this.
const WEIGHT_UNIT: f64 = 1.0 / 4096.0;

type Point = [f64; 3];

impl Mesh {
    /// Returns the mesh with every volume cell replaced by 8 small cells of its kind, every surface cell by 4, every
    /// edge by 2. Regions hold the small cells of their cells. The octahedron in the middle of a tetrahedron is cut
    /// along its shortest diagonal. A pyramid becomes 6 pyramids and 4 tetrahedra.
    pub fn refined(&self) -> FinerMesh {
        self.split(|_, _| Halves::ALL)
    }

    /// Returns the mesh with its cells halved along some axes of space (0, 1, 2) only. Halved along two axes, a body
    /// extruded along the third keeps its layers; halved along one axis, only the layers along it are halved.
    ///
    /// # Errors
    /// Returns [`MeshError::Invalid`] if a cell has edges that are neither along the extrusion nor normal to it, or is
    /// a tetrahedron or a pyramid.
    pub fn refined_along(&self, axes: &[usize]) -> Result<FinerMesh, MeshError> {
        let is_halved = |axis: usize| axes.contains(&axis);
        // The axis that differs from the two others.
        let special = match (0..3).filter(|&axis| is_halved(axis)).count() {
            1 => (0..3).find(|&axis| is_halved(axis)),
            2 => (0..3).find(|&axis| !is_halved(axis)),
            3 => return Ok(self.refined()),
            _ => None,
        };
        let Some(axis) = special else {
            let problem = "contains no axis: give one or two of x, y, z".to_owned();
            return Err(MeshError::Invalid { what: "refinement", problem });
        };
        let mut halves = Vec::with_capacity(self.cell_count());
        for index in 0..self.cell_count() {
            let Some((kind, nodes)) = self.cell(index) else { continue };
            let corners: Vec<Point> = nodes.iter().map(|&node| self.points[node as usize]).collect();
            let found = Halves::of(kind.linear(), &corners, axis, is_halved(axis));
            halves.push(found.map_err(|why| {
                let axis = ["x", "y", "z"][axis];
                let problem = format!(
                    "element {index} ({kind}) {why}; only bodies of hexahedra and wedges extruded along {axis} can be \
                     refined so: leave out `axes` to halve it in every direction"
                );
                MeshError::Invalid { what: "refinement", problem }
            })?);
        }
        Ok(self.split(|index, _| halves[index]))
    }

    /// Cuts each cell, given its number and kind, as `halves` says.
    fn split(&self, halves: impl Fn(usize, CellKind) -> Halves) -> FinerMesh {
        let mut nodes = Nodes::of(self);
        let mut blocks = Vec::with_capacity(self.blocks.len());
        // Number of the first small cell of each large one.
        let (mut first, mut next) = (Vec::with_capacity(self.cell_count() + 1), 0);
        let functions: HashMap<CellKind, ShapeFunctions> =
            CellKind::ALL.iter().map(|&kind| (kind, ShapeFunctions::of(kind))).collect();
        for block in &self.blocks {
            let kind = block.kind;
            // Collect small cells by kind, so that they are numbered in the order of the large ones.
            let mut fine: Vec<CellBlock> = Vec::new();
            for cell in block.cells() {
                let at = |xi: Point| nodes.position(cell, &functions[&kind].values(xi));
                let children = children(kind.linear(), halves(first.len(), kind), at);
                first.push(next);
                next += children.len() as u32;
                for (shape, corners) in children {
                    let child = kind.of_shape(shape);
                    if fine.last().is_none_or(|block| block.kind != child) {
                        fine.push(CellBlock { kind: child, nodes: Vec::new() });
                    }
                    for &place in child.reference_nodes() {
                        let weights = functions[&shape].values(place);
                        let xi = [0, 1, 2]
                            .map(|i| weights.iter().zip(&corners).map(|(w, c)| w * c[i]).sum::<f64>());
                        let node = nodes.number(cell, &functions[&kind].values(xi));
                        fine.last_mut().into_iter().for_each(|block| block.nodes.push(node));
                    }
                }
            }
            blocks.extend(fine);
        }
        first.push(next);
        let children_of = |&cell: &u32| first[cell as usize]..first[cell as usize + 1];
        let region = |region: &Region| Region {
            name: region.name.clone(),
            dimension: region.dimension,
            cells: region.cells.iter().flat_map(children_of).collect(),
        };
        let regions = self.regions.iter().map(region).collect();
        let count = |cell: usize| (first[cell + 1] - first[cell]) as usize;
        let cells = (0..first.len() - 1).flat_map(|cell| vec![cell as u32; count(cell)]).collect();
        FinerMesh { mesh: Mesh { points: nodes.points, blocks, regions }, parents: nodes.parents, cells }
    }
}

/// The nodes of the fine mesh while it is built.
struct Nodes {
    points: Vec<Point>,
    parents: Vec<Vec<(u32, f64)>>,
    numbers: HashMap<Vec<(u32, i32)>, u32>,
}

impl Nodes {
    fn of(mesh: &Mesh) -> Self {
        let all = 0..mesh.points.len() as u32;
        let one = (1.0 / WEIGHT_UNIT) as i32;
        Self {
            points: mesh.points.clone(),
            parents: all.clone().map(|node| vec![(node, 1.0)]).collect(),
            numbers: all.map(|node| (vec![(node, one)], node)).collect(),
        }
    }

    fn position(&self, cell: &[u32], weights: &[f64]) -> Point {
        let sum = |i: usize| cell.iter().zip(weights).map(|(&n, w)| w * self.points[n as usize][i]).sum();
        [0, 1, 2].map(sum)
    }

    fn number(&mut self, cell: &[u32], weights: &[f64]) -> u32 {
        let units = |weight: f64| (weight / WEIGHT_UNIT).round() as i32;
        let mut parents: Vec<(u32, f64)> = cell.iter().copied().zip(weights.iter().copied()).collect();
        parents.retain(|&(_, weight)| units(weight) != 0);
        parents.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let key: Vec<(u32, i32)> = parents.iter().map(|&(node, weight)| (node, units(weight))).collect();
        if let Some(&number) = self.numbers.get(&key) {
            return number;
        }
        let number = self.points.len() as u32;
        self.points.push(self.position(cell, weights));
        self.parents.push(parents);
        self.numbers.insert(key, number);
        number
    }
}

fn middle(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]))
}

/// The axes of its reference cell along which a cell is halved. For a wedge the first two axes together are its
/// triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Halves([bool; 3]);

/// Largest deviation of an edge from the direction along or normal to an axis, relative to its length.
const STRAIGHT: f64 = 1e-6;

impl Halves {
    const ALL: Self = Self([true; 3]);

    /// Returns the axes for a cell with these corners if edges along an axis of space are halved (`along`), or else
    /// those normal to it.
    fn of(linear: CellKind, corners: &[Point], axis: usize, along: bool) -> Result<Self, &'static str> {
        if matches!(linear, CellKind::Tet4 | CellKind::Pyramid5) {
            return Err("is not a prism");
        }
        let reference = linear.reference_nodes();
        let mut halves = [None; 3];
        for (a, p) in reference.iter().enumerate() {
            for (b, q) in reference.iter().enumerate().skip(a + 1) {
                let differ: Vec<usize> = (0..3).filter(|&k| p[k] != q[k]).collect();
                // The third edge of a triangle runs along both axes.
                let is_triangle = matches!(linear, CellKind::Tri3 | CellKind::Wedge6);
                let of: &[usize] = match differ[..] {
                    [2] if is_triangle => &[2],
                    [0] | [1] | [0, 1] if is_triangle => &[0, 1],
                    [k] => &[0, 1, 2][k..=k],
                    _ => continue,
                };
                let edge = [0, 1, 2].map(|i| corners[b][i] - corners[a][i]);
                let length = edge.iter().map(|e| e * e).sum::<f64>().sqrt();
                let parallel = edge[axis].abs() / length;
                let is_half = match parallel {
                    part if part < STRAIGHT => !along,
                    part if (1.0 - part * part).max(0.0).sqrt() < STRAIGHT => along,
                    _ => return Err("has an edge that is neither along that axis nor across it"),
                };
                for &k in of {
                    if *halves[k].get_or_insert(is_half) != is_half {
                        return Err(
                            "has edges along that axis and across it that run the same way in the element",
                        );
                    }
                }
            }
        }
        Ok(Self(halves.map(|half| half.unwrap_or(false))))
    }
}

/// Returns the linear kinds and corners of the small cells in the reference cell; `at` maps a reference point to
/// space.
fn children(linear: CellKind, halves: Halves, at: impl Fn(Point) -> Point) -> Vec<(CellKind, Vec<Point>)> {
    let corners = linear.reference_nodes();
    let Halves(halves) = halves;
    let triangles = |corners: &[Point]| if halves[0] { triangles(corners) } else { vec![corners.to_vec()] };
    let cells = match linear {
        CellKind::Point => vec![corners.to_vec()],
        CellKind::Tri3 => triangles(corners),
        CellKind::Tet4 => tetrahedra(corners, at),
        CellKind::Pyramid5 => return pyramids_and_tetrahedra(corners),
        CellKind::Wedge6 => {
            let (low, high) = (triangles(&corners[..3]), triangles(&corners[3..]));
            let layer = |(low, high): (&Vec<Point>, &Vec<Point>)| {
                if !halves[2] {
                    return vec![[&low[..], high].concat()];
                }
                let half: Vec<Point> = low.iter().zip(high).map(|(&a, &b)| middle(a, b)).collect();
                vec![[&low[..], &half].concat(), [&half[..], high].concat()]
            };
            low.iter().zip(&high).flat_map(layer).collect()
        }
        // For lines and products of lines: the small cell at each corner.
        _ => {
            let place = |corner: Point, other: Point| {
                let middle = middle(corner, other);
                [0, 1, 2].map(|k| if halves[k] { middle[k] } else { other[k] })
            };
            let is_first = |corner: &&Point| (0..3).all(|k| halves[k] || corner[k] == corners[0][k]);
            let firsts = corners.iter().filter(is_first);
            firsts.map(|&corner| corners.iter().map(|&other| place(corner, other)).collect()).collect()
        }
    };
    cells.into_iter().map(|cell| (linear, cell)).collect()
}

fn triangles(c: &[Point]) -> Vec<Vec<Point>> {
    let [a, b, d] = [middle(c[0], c[1]), middle(c[1], c[2]), middle(c[2], c[0])];
    vec![vec![c[0], a, d], vec![a, c[1], b], vec![d, b, c[2]], vec![a, b, d]]
}

/// Returns four tetrahedra at the corners and four around a diagonal of the octahedron between them.
fn tetrahedra(c: &[Point], at: impl Fn(Point) -> Point) -> Vec<Vec<Point>> {
    let m = |a: usize, b: usize| middle(c[a], c[b]);
    let mut cells = vec![
        vec![c[0], m(0, 1), m(0, 2), m(0, 3)],
        vec![m(0, 1), c[1], m(1, 2), m(1, 3)],
        vec![m(0, 2), m(1, 2), c[2], m(2, 3)],
        vec![m(0, 3), m(1, 3), m(2, 3), c[3]],
    ];
    // The diagonals, that of Bey (1995) first, and the edges around them.
    let choices = [
        ([m(0, 2), m(1, 3)], [m(0, 1), m(1, 2), m(2, 3), m(0, 3)]),
        ([m(0, 1), m(2, 3)], [m(0, 2), m(1, 2), m(1, 3), m(0, 3)]),
        ([m(0, 3), m(1, 2)], [m(0, 1), m(0, 2), m(2, 3), m(1, 3)]),
    ];
    let length = |[a, b]: [Point; 2]| -> f64 {
        let (a, b) = (at(a), at(b));
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum()
    };
    let mut best = choices[0];
    for choice in &choices[1..] {
        if length(choice.0) < 0.999 * length(best.0) {
            best = *choice;
        }
    }
    let ([a, b], ring) = best;
    for k in 0..4 {
        let (p, q) = (ring[k], ring[(k + 1) % 4]);
        let edges = [b, p, q].map(|x| [0, 1, 2].map(|i| x[i] - a[i]));
        let is_right = determinant(edges) > 0.0;
        cells.push(if is_right { vec![a, b, p, q] } else { vec![a, b, q, p] });
    }
    cells
}

/// Returns pyramids at the corners, at the apex and upside down below it, and tetrahedra at the edges of the base.
fn pyramids_and_tetrahedra(c: &[Point]) -> Vec<(CellKind, Vec<Point>)> {
    let m = |a: usize, b: usize| middle(c[a], c[b]);
    let centre = middle(c[0], c[2]);
    let mut cells: Vec<_> = (0..4)
        .map(|k| {
            let corner = |other: usize| if other == k { c[k] } else { m(k, other) };
            let base = [0, 1, 2, 3].map(|other| if other == (k + 2) % 4 { centre } else { corner(other) });
            (CellKind::Pyramid5, [&base[..], &[m(k, 4)]].concat())
        })
        .collect();
    let [a, b, d, e] = [0, 1, 2, 3].map(|k| m(k, 4));
    cells.push((CellKind::Pyramid5, vec![a, b, d, e, c[4]]));
    cells.push((CellKind::Pyramid5, vec![a, e, d, b, centre]));
    cells.extend((0..4).map(|k| {
        let next = (k + 1) % 4;
        (CellKind::Tet4, vec![m(k, next), centre, m(k, 4), m(next, 4)])
    }));
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facet::Surface;
    use crate::generate::box_mesh::BoxMesh;

    /// Returns the elements of boxes that are refined into cells of their own kind only.
    fn elements() -> impl Iterator<Item = CellKind> {
        BoxMesh::elements().filter(|element| element.linear() != CellKind::Pyramid5)
    }

    /// Small cells fill the large one and their faces match: the faces that belong to one cell only form the
    /// boundary.
    #[test]
    fn every_solid_kind_is_filled_by_its_small_cells() {
        for &kind in CellKind::ALL.iter().filter(|kind| kind.dimension() == 3) {
            let points = kind.reference_nodes().to_vec();
            let blocks = vec![CellBlock { kind, nodes: (0..points.len() as u32).collect() }];
            let mesh = Mesh { points, blocks, regions: vec![] };
            let fine = mesh.refined();
            let whole = mesh.volume(0).unwrap();
            let parts: Vec<f64> =
                (0..fine.mesh.cell_count()).map(|cell| fine.mesh.volume(cell).unwrap()).collect();
            assert!(parts.iter().all(|&part| part > 0.0), "{kind}: {parts:?}");
            assert!((parts.iter().sum::<f64>() - whole).abs() < 1e-14, "{kind}");
            let area = |mesh: &Mesh| Surface::of_body(mesh, 3).unwrap().area(mesh);
            assert!((area(&fine.mesh) - area(&mesh)).abs() < 1e-13, "{kind}");
            let sums = fine.parents.iter().map(|parents| parents.iter().map(|(_, w)| w).sum::<f64>());
            assert!(sums.into_iter().all(|sum| (sum - 1.0).abs() < 1e-15), "{kind}");
        }
    }

    #[test]
    fn a_refined_box_is_the_finer_box() {
        for element in elements() {
            let build =
                |cells| BoxMesh { size: [1.0, 2.0, 0.5], cells, element, origin: [0.0; 3] }.build().unwrap();
            let (coarse, fine) = (build([2, 1, 1]), build([4, 2, 2]));
            let refined = coarse.refined();
            refined.mesh.check(3).unwrap();
            assert_eq!(refined.mesh.points.len(), fine.points.len(), "{element}");
            assert_eq!(refined.mesh.points[..coarse.points.len()], coarse.points[..]);
            for point in &refined.mesh.points {
                let near = fine.points[fine.nearest_node(*point).unwrap() as usize];
                assert!((0..3).all(|i| (near[i] - point[i]).abs() < 1e-14), "{element}: {point:?}");
            }
            for name in ["box", "x-max", "z-min"] {
                let count = |mesh: &Mesh| mesh.region(name).unwrap().cells.len();
                assert_eq!(count(&refined.mesh), count(&fine), "{element}");
                let nodes = |mesh: &Mesh| mesh.region_nodes(name).unwrap().len();
                assert_eq!(nodes(&refined.mesh), nodes(&fine), "{element}: {name}");
            }
            // Linear functions are interpolated exactly.
            let linear: Vec<f64> =
                coarse.points.iter().flat_map(|p| [p[0] - p[2], 3.0 * p[1], 1.0]).collect();
            let carried = refined.interpolate(&linear);
            for (p, value) in refined.mesh.points.iter().zip(carried.chunks_exact(3)) {
                let expected = [p[0] - p[2], 3.0 * p[1], 1.0];
                assert!((0..3).all(|i| (value[i] - expected[i]).abs() < 1e-14));
            }
        }
    }

    /// Halved along x and y, a body extruded along z is the finer body with the same layers; halved along z only, it
    /// is the body with twice the layers.
    #[test]
    fn layers_are_kept() {
        for element in elements() {
            let build =
                |cells| BoxMesh { size: [1.0, 2.0, 0.5], cells, element, origin: [0.0; 3] }.build().unwrap();
            let coarse = build([2, 1, 1]);
            for (axes, cells) in [(&[0, 1][..], [4, 2, 1]), (&[2], [2, 1, 2])] {
                let refined = coarse.refined_along(axes);
                if element.linear() == CellKind::Tet4 {
                    assert!(refined.unwrap_err().to_string().contains("is not a prism"));
                    continue;
                }
                let (refined, fine) = (refined.unwrap().mesh, build(cells));
                refined.check(3).unwrap();
                assert_eq!(refined.points.len(), fine.points.len(), "{element} {axes:?}");
                for point in &refined.points {
                    let near = fine.points[fine.nearest_node(*point).unwrap() as usize];
                    assert!((0..3).all(|i| (near[i] - point[i]).abs() < 1e-14), "{element}: {point:?}");
                }
                for name in ["box", "x-max", "z-min"] {
                    let count = |mesh: &Mesh| mesh.region(name).unwrap().cells.len();
                    assert_eq!(count(&refined), count(&fine), "{element} {axes:?} {name}");
                }
            }
        }
        let shape = BoxMesh { size: [1.0; 3], cells: [1; 3], element: CellKind::Hex8, origin: [0.0; 3] };
        let mut sheared = shape.build().unwrap();
        sheared.points.iter_mut().for_each(|x| x[0] += 0.2 * x[2]);
        assert!(sheared.refined_along(&[0, 1]).unwrap_err().to_string().contains("neither along"));
        sheared.points.iter_mut().for_each(|x| *x = [x[0] - 0.2 * x[2] + 0.3 * x[1], x[1], x[2]]);
        assert_eq!(sheared.refined_along(&[0, 1]).unwrap().mesh.cells_of_dimension(3).len(), 4);
    }

    #[test]
    fn curved_cells_stay_curved() {
        let shape = BoxMesh { size: [1.0; 3], cells: [1; 3], element: CellKind::Hex27, origin: [0.0; 3] };
        let mut mesh = shape.build().unwrap();
        let bend = |x: [f64; 3]| [x[0], x[1] + 0.3 * x[0] * x[0], x[2]];
        mesh.points.iter_mut().for_each(|x| *x = bend(*x));
        for x in &mesh.refined().mesh.points {
            let straight = [x[0], x[1] - 0.3 * x[0] * x[0], x[2]];
            assert!(straight.map(|v| 4.0 * v).iter().all(|v| (v - v.round()).abs() < 1e-13), "{x:?}");
        }
    }
}
