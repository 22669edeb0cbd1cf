//! The triangles of a sheet and their edges: neighbours and orientations.

use crate::cell::CellKind;
use crate::error::MeshError;
use crate::mesh::Mesh;
use crate::vector::{cross, dot};

/// Triangles of a mesh with their edges.
pub struct Triangulation {
    /// Positions of all nodes of the mesh, m.
    pub points: Vec<[f64; 3]>,
    /// The corners of each triangle in the flat pattern from which it is cut, m, if there is one.
    pattern: Option<Vec<[[f64; 3]; 3]>>,
    /// The nodes of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The cell number of each triangle in the mesh.
    pub cells: Vec<u32>,
    /// The edges, in ascending order of their nodes.
    pub edges: Vec<Edge>,
    /// The three edges of each triangle: edge k lies opposite node k.
    pub edges_of: Vec<[u32; 3]>,
}

/// An edge, and the triangles that meet there, ascending.
pub struct Edge {
    /// The nodes of the edge, ascending.
    pub nodes: [u32; 2],
    /// Each triangle, with the number of this edge in it.
    pub sides: Vec<(u32, u8)>,
}

impl Triangulation {
    /// Returns the triangulation of the cells `elements` of a mesh.
    ///
    /// # Errors
    /// Returns an error for cells that do not exist, cells that are not linear triangles, and triangles without area.
    pub fn new(mesh: &Mesh, elements: &[u32]) -> Result<Self, MeshError> {
        let mut triangles = Vec::with_capacity(elements.len());
        for (index, &element) in elements.iter().enumerate() {
            match mesh.cell(element as usize) {
                Some((CellKind::Tri3, &[a, b, c])) => triangles.push([a, b, c]),
                Some((kind, _)) => {
                    return Err(MeshError::Unsupported {
                        kind,
                        used: "elements of a sheet (they must be tri3)",
                    });
                }
                None => {
                    return Err(MeshError::OutOfRange {
                        what: "sheet, element",
                        index,
                        target: "cell",
                        value: element as usize,
                        available: mesh.cell_count(),
                    });
                }
            }
        }
        check_areas(&mesh.points, &triangles, elements)?;
        let (edges, edges_of) = edges(&triangles);
        let (points, cells) = (mesh.points.clone(), elements.to_vec());
        Ok(Self { points, pattern: None, triangles, cells, edges, edges_of })
    }

    /// Returns the surface with the rest shape of a flat pattern, given by the corners (m) of every cell of the mesh.
    ///
    /// # Errors
    /// Returns an error for a pattern with fewer cells than the mesh, triangles without area in it, and neighbours
    /// folded onto each other in it.
    pub fn with_pattern(mut self, pattern: &[[[f64; 2]; 3]]) -> Result<Self, MeshError> {
        let invalid = |problem| MeshError::Invalid { what: "pattern of a sheet", problem };
        let Some(flat) = self.cells.iter().map(|&cell| pattern.get(cell as usize).copied()).collect() else {
            return Err(invalid(format!("it has {} cells, fewer than the mesh", pattern.len())));
        };
        let flat: Vec<[[f64; 2]; 3]> = flat;
        let twice_area =
            |[a, b, c]: &[[f64; 2]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        for (triangle, corners) in flat.iter().enumerate() {
            let squared = |k: usize, l: usize| (0..2).map(|i| (corners[k][i] - corners[l][i]).powi(2)).sum();
            let longest = [squared(0, 1), squared(1, 2), squared(2, 0)].into_iter().fold(0.0, f64::max);
            let area = 0.5 * twice_area(corners).abs();
            if area.is_nan() || area <= 0.5e-8 * longest {
                return Err(invalid(format!(
                    "element {} has no area in it ({area:.3e} m²): correct the texture coordinates",
                    self.cells[triangle]
                )));
            }
        }
        for edge in &self.edges {
            let [one, two] = edge.sides[..] else { continue };
            let corner = |side: (u32, u8), node: u32| {
                let k = (0..3).find(|&k| self.triangles[side.0 as usize][k] == node).unwrap_or(0);
                flat[side.0 as usize][k]
            };
            let is_one_chart = edge.nodes.iter().all(|&node| corner(one, node) == corner(two, node));
            let faces = |side: (u32, u8)| twice_area(&flat[side.0 as usize]) > 0.0;
            if is_one_chart && (faces(one) == faces(two)) == same_sense(&self, one, two) {
                return Err(invalid(format!(
                    "element {} is folded over onto its neighbour, element {}; unfold the texture coordinates, or \
                     give the two charts of their own",
                    self.cells[one.0 as usize], self.cells[two.0 as usize]
                )));
            }
        }
        self.pattern = Some(flat.iter().map(|corners| corners.map(|[u, v]| [u, v, 0.0])).collect());
        Ok(self)
    }

    /// Returns whether the rest shape is a flat pattern.
    pub fn has_pattern(&self) -> bool {
        self.pattern.is_some()
    }

    /// Returns the corners of a triangle at rest, m.
    pub fn corners(&self, triangle: usize) -> [[f64; 3]; 3] {
        match &self.pattern {
            Some(pattern) => pattern[triangle],
            None => self.placed(triangle),
        }
    }

    /// Returns the corners of a triangle at their positions in the mesh, m.
    pub fn placed(&self, triangle: usize) -> [[f64; 3]; 3] {
        self.triangles[triangle].map(|node| self.points[node as usize])
    }

    /// Returns the node of a triangle opposite its edge `k`, then the nodes of the edge in the orientation of the
    /// triangle.
    pub fn around(&self, triangle: u32, k: u8) -> [u32; 3] {
        let nodes = self.triangles[triangle as usize];
        let k = usize::from(k);
        [nodes[k], nodes[(k + 1) % 3], nodes[(k + 2) % 3]]
    }
}

/// Returns the edges with the triangles that meet there, and the edges of each triangle.
fn edges(triangles: &[[u32; 3]]) -> (Vec<Edge>, Vec<[u32; 3]>) {
    let mut sides = Vec::with_capacity(3 * triangles.len());
    for (triangle, nodes) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (nodes[(k + 1) % 3], nodes[(k + 2) % 3]);
            sides.push(([a.min(b), a.max(b)], triangle as u32, k as u8));
        }
    }
    sides.sort_unstable();
    let mut edges: Vec<Edge> = Vec::new();
    let mut edges_of = vec![[0; 3]; triangles.len()];
    for (nodes, triangle, k) in sides {
        if edges.last().is_none_or(|edge| edge.nodes != nodes) {
            edges.push(Edge { nodes, sides: Vec::with_capacity(2) });
        }
        let index = edges.len() - 1;
        edges[index].sides.push((triangle, k));
        edges_of[triangle as usize][usize::from(k)] = index as u32;
    }
    (edges, edges_of)
}

/// Refuses triangles whose height over the longest side is below 1e-8 of that side.
fn check_areas(points: &[[f64; 3]], triangles: &[[u32; 3]], elements: &[u32]) -> Result<(), MeshError> {
    let mut bad = Vec::new();
    for (nodes, &element) in triangles.iter().zip(elements) {
        let [a, b, c] = nodes.map(|node| points[node as usize]);
        let squared = |p: [f64; 3], q: [f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>();
        let longest = squared(a, b).max(squared(b, c)).max(squared(c, a));
        let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
        let normal = cross(u, v);
        let area = 0.5 * dot(normal, normal).sqrt();
        if area.is_nan() || area <= 0.5e-8 * longest {
            bad.push((element, area));
        }
    }
    let Some(&(element, area)) = bad.first() else { return Ok(()) };
    Err(MeshError::Invalid {
        what: "sheet",
        problem: format!(
            "{} of {} triangles have no area (first: element {element}, {area:.3e} m²); remove them or \
             merge their nodes in the mesh",
            bad.len(),
            triangles.len()
        ),
    })
}

/// The findings and changes of [`orient_triangles`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Orientation {
    /// Number of connected pieces.
    pub pieces: usize,
    /// Number of triangles that were turned over, so that neighbours face the same way.
    pub turned: usize,
    /// Number of edges at which neighbours still face opposite ways: the piece is one-sided, like a Möbius strip.
    pub one_sided: usize,
    /// Number of edges at which more than two triangles meet.
    pub branched: usize,
    /// Number of edges with one triangle.
    pub boundary: usize,
}

impl Orientation {
    /// Returns messages for the user; none if no triangle was turned over and the surface is two-sided and
    /// unbranched.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.turned > 0 {
            notes.push(format!("{} triangles were turned over to face as their neighbours do", self.turned));
        }
        if self.one_sided > 0 {
            notes.push(format!(
                "the surface is one-sided: neighbours face opposite ways across {} edges (this does not \
                 affect bending, but the side on which a pressure acts is not defined)",
                self.one_sided
            ));
        }
        if self.branched > 0 {
            notes.push(format!(
                "more than two triangles meet at {} edges; every pair of them bends as a hinge there",
                self.branched
            ));
        }
        notes
    }
}

/// Turns triangles over so that neighbours across every edge of two triangles face the same way, as far as the
/// surface has two sides. In each piece the majority decides; a tie goes to the first triangle.
///
/// # Errors
/// Returns the errors of [`Triangulation::new`]: cells that are not triangles, or have no area.
pub fn orient_triangles(mesh: &mut Mesh, elements: &[u32]) -> Result<Orientation, MeshError> {
    let surface = Triangulation::new(mesh, elements)?;
    let count = surface.triangles.len();
    let mut report = Orientation::default();
    let mut flipped: Vec<Option<bool>> = vec![None; count];
    for start in 0..count {
        if flipped[start].is_some() {
            continue;
        }
        report.pieces += 1;
        flipped[start] = Some(false);
        let mut piece = vec![start];
        let mut next = 0;
        while next < piece.len() {
            let triangle = piece[next];
            next += 1;
            for edge in surface.edges_of[triangle] {
                let edge = &surface.edges[edge as usize];
                let [one, two] = edge.sides[..] else { continue };
                let other = if one.0 as usize == triangle { two.0 } else { one.0 } as usize;
                if flipped[other].is_none() {
                    let must_turn = same_sense(&surface, one, two);
                    flipped[other] = flipped[triangle].map(|turned| turned != must_turn);
                    piece.push(other);
                }
            }
        }
        let turned = piece.iter().filter(|&&triangle| flipped[triangle] == Some(true)).count();
        if 2 * turned > piece.len() {
            for &triangle in &piece {
                flipped[triangle] = flipped[triangle].map(|turned| !turned);
            }
        }
    }
    for edge in &surface.edges {
        match edge.sides[..] {
            [_] => report.boundary += 1,
            [one, two] => {
                let turned = flipped[one.0 as usize] != flipped[two.0 as usize];
                report.one_sided += usize::from(same_sense(&surface, one, two) != turned);
            }
            _ => report.branched += 1,
        }
    }
    for (triangle, &element) in elements.iter().enumerate() {
        if flipped[triangle] == Some(true) {
            turn_over(mesh, element as usize);
            report.turned += 1;
        }
    }
    Ok(report)
}

/// Returns whether two triangles traverse their common edge in the same direction, so that they face opposite ways.
fn same_sense(surface: &Triangulation, one: (u32, u8), two: (u32, u8)) -> bool {
    surface.around(one.0, one.1)[1] == surface.around(two.0, two.1)[1]
}

fn turn_over(mesh: &mut Mesh, mut cell: usize) {
    for block in &mut mesh.blocks {
        if cell < block.cell_count() {
            block.nodes.swap(3 * cell + 1, 3 * cell + 2);
            return;
        }
        cell -= block.cell_count();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::sheet_mesh::{SheetMesh, SheetPattern};
    use crate::mesh::CellBlock;

    fn sheet() -> Mesh {
        let shape = SheetMesh {
            size: [1.0; 2],
            cells: [3; 2],
            pattern: SheetPattern::Diagonal,
            seed: 0,
            origin: [0.0; 3],
            directions: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        };
        shape.build().unwrap()
    }

    #[test]
    fn triangles_that_face_the_wrong_way_are_turned_over_and_said_so() {
        let good = sheet();
        let elements = good.cells_of_dimension(2);
        let mut mesh = good.clone();
        for cell in [1, 7, 8] {
            turn_over(&mut mesh, cell);
        }
        let report = orient_triangles(&mut mesh, &elements).unwrap();
        assert_eq!((report.turned, report.pieces, report.one_sided, report.boundary), (3, 1, 0, 12));
        assert_eq!(report.notes().len(), 1);
        assert_eq!(mesh, good);
    }

    #[test]
    fn a_moebius_strip_has_one_side() {
        let count = 8;
        let node = |i: usize, k: usize| (if i < count { 2 * i + k } else { 1 - k }) as u32;
        let mut nodes = Vec::new();
        for i in 0..count {
            nodes.extend([node(i, 0), node(i + 1, 0), node(i, 1)]);
            nodes.extend([node(i + 1, 0), node(i + 1, 1), node(i, 1)]);
        }
        let points = (0..count)
            .flat_map(|i| {
                let phi = i as f64 / count as f64 * std::f64::consts::TAU;
                [-0.3, 0.3].map(|s: f64| {
                    let r = 1.0 + s * (0.5 * phi).cos();
                    [r * phi.cos(), r * phi.sin(), s * (0.5 * phi).sin()]
                })
            })
            .collect();
        let mut mesh =
            Mesh { points, blocks: vec![CellBlock { kind: CellKind::Tri3, nodes }], regions: vec![] };
        let elements = mesh.cells_of_dimension(2);
        let report = orient_triangles(&mut mesh, &elements).unwrap();
        assert_eq!(report.one_sided, 1, "{report:?}");
    }

    #[test]
    fn a_triangle_without_area_is_an_error_that_names_it() {
        let mut mesh = sheet();
        mesh.points[5] = mesh.points[4];
        let elements = mesh.cells_of_dimension(2);
        let message = Triangulation::new(&mesh, &elements).err().unwrap().to_string();
        assert!(message.contains("no area") && message.contains("element"), "{message}");
    }
}
