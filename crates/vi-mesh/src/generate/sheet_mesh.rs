//! Rectangular sheets of triangles.

use crate::cell::CellKind;
use crate::error::MeshError;
use crate::mesh::{CellBlock, Mesh, Region};

/// A rectangle of triangles: `sheet = { size = [1.0, 1.0], cells = [40, 40], pattern = "cross" }`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct SheetMesh {
    /// Extents along the two directions, m; positive.
    pub size: [f64; 2],
    /// Cells along the two directions; at least 1 each.
    #[cfg_attr(feature = "serde", schemars(inner(range(min = 1))))]
    pub cells: [u32; 2],
    /// The pattern by which cells are cut into triangles.
    #[cfg_attr(feature = "serde", serde(default))]
    pub pattern: SheetPattern,
    /// The seed of the mesh for `pattern = "random"`; the same seed gives the same mesh.
    #[cfg_attr(feature = "serde", serde(default))]
    pub seed: u64,
    /// The corner `x-min`, `y-min`, m.
    #[cfg_attr(feature = "serde", serde(default))]
    pub origin: [f64; 3],
    /// The directions of the two extents in space: of any length, at a right angle. The normal is their cross
    /// product.
    #[cfg_attr(feature = "serde", serde(default = "default_directions"))]
    pub directions: [[f64; 3]; 2],
}

#[cfg(any(feature = "serde", test))]
fn default_directions() -> [[f64; 3]; 2] {
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
}

/// The pattern by which the cells of a sheet are cut into triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum SheetPattern {
    /// Two triangles per cell with parallel diagonals: cheap, but stiffer in one direction than in the other.
    #[default]
    Diagonal,
    /// Four triangles around the centre of each cell: symmetric in x and y.
    Cross,
    /// Nodes displaced at random by up to a quarter of a cell, and each cell cut along its Delaunay diagonal.
    Random,
}

impl SheetMesh {
    /// Builds the mesh. Nodes are in lattice order with i fastest, then follow the centres of `cross`; triangles face
    /// the normal. The regions are the surface `sheet`, the curves `x-min x-max y-min y-max`, and the points
    /// `x-min-y-min x-max-y-min x-min-y-max x-max-y-max`.
    ///
    /// # Errors
    /// Returns [`MeshError::Parameter`] for a size that is not positive, no cells, or directions that are zero or not
    /// at a right angle.
    pub fn build(&self) -> Result<Mesh, MeshError> {
        let [u, v] = self.check()?;
        let [nx, ny] = self.cells.map(|count| count as usize);
        let node = |i: usize, j: usize| (i + j * (nx + 1)) as u32;
        let mut plane = self.lattice();
        let mut triangles = Vec::with_capacity(12 * nx * ny);
        for j in 0..ny {
            for i in 0..nx {
                let corners = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
                let [a, b, c, d] = corners;
                match self.pattern {
                    SheetPattern::Diagonal => triangles.extend([a, b, c, a, c, d]),
                    SheetPattern::Cross => {
                        let centre = plane.len() as u32;
                        let mean =
                            |k: usize| corners.iter().map(|&n| plane[n as usize][k]).sum::<f64>() / 4.0;
                        plane.push([mean(0), mean(1)]);
                        triangles.extend([a, b, centre, b, c, centre, c, d, centre, d, a, centre]);
                    }
                    SheetPattern::Random => {
                        if is_delaunay(corners.map(|n| plane[n as usize])) {
                            triangles.extend([a, b, c, a, c, d]);
                        } else {
                            triangles.extend([a, b, d, b, c, d]);
                        }
                    }
                }
            }
        }
        let points = plane
            .iter()
            .map(|p| std::array::from_fn(|k| self.origin[k] + p[0] * u[k] + p[1] * v[k]))
            .collect();
        let triangle_count = (triangles.len() / 3) as u32;
        let mut regions =
            vec![Region { name: "sheet".into(), dimension: 2, cells: (0..triangle_count).collect() }];
        let sides: [(&str, Vec<u32>); 4] = [
            ("x-min", (0..=ny).map(|j| node(0, j)).collect()),
            ("x-max", (0..=ny).map(|j| node(nx, j)).collect()),
            ("y-min", (0..=nx).map(|i| node(i, 0)).collect()),
            ("y-max", (0..=nx).map(|i| node(i, ny)).collect()),
        ];
        let mut lines = Vec::new();
        for (name, nodes) in sides {
            let first = triangle_count + (lines.len() / 2) as u32;
            lines.extend(nodes.windows(2).flatten().copied());
            let last = triangle_count + (lines.len() / 2) as u32;
            regions.push(Region { name: name.into(), dimension: 1, cells: (first..last).collect() });
        }
        let corners = [
            ("x-min-y-min", node(0, 0)),
            ("x-max-y-min", node(nx, 0)),
            ("x-min-y-max", node(0, ny)),
            ("x-max-y-max", node(nx, ny)),
        ];
        let first = triangle_count + (lines.len() / 2) as u32;
        for (k, (name, _)) in corners.iter().enumerate() {
            regions.push(Region { name: (*name).into(), dimension: 0, cells: vec![first + k as u32] });
        }
        let blocks = vec![
            CellBlock { kind: CellKind::Tri3, nodes: triangles },
            CellBlock { kind: CellKind::Line2, nodes: lines },
            CellBlock { kind: CellKind::Point, nodes: corners.map(|(_, node)| node).to_vec() },
        ];
        Ok(Mesh { points, blocks, regions })
    }

    /// Returns texture coordinates at the corners of every cell of the mesh: 0 to 1 along the two directions; zero
    /// for cells that are not triangles.
    pub fn texture(&self, mesh: &Mesh) -> Vec<[[f64; 2]; 3]> {
        let along = |x: [f64; 3], k: usize| {
            let direction = self.directions[k];
            let length: f64 = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
            let dot: f64 = (0..3).map(|i| (x[i] - self.origin[i]) * direction[i]).sum();
            dot / (length * self.size[k])
        };
        let of_cell = |cell: usize| match mesh.cell(cell) {
            Some((CellKind::Tri3, &[a, b, c])) => {
                [a, b, c].map(|node| [0, 1].map(|k| along(mesh.points[node as usize], k)))
            }
            _ => [[0.0; 2]; 3],
        };
        (0..mesh.cell_count()).map(of_cell).collect()
    }

    /// Checks the numbers; returns the unit directions.
    fn check(&self) -> Result<[[f64; 3]; 2], MeshError> {
        for size in self.size {
            if !(size > 0.0 && size.is_finite()) {
                let requirement = "the extents of a sheet must be positive (m)";
                return Err(MeshError::Parameter { key: "size", value: size, requirement });
            }
        }
        if let Some(&count) = self.cells.iter().find(|&&count| count == 0) {
            let requirement = "a sheet needs at least one cell along each direction";
            return Err(MeshError::Parameter { key: "cells", value: f64::from(count), requirement });
        }
        let lengths = self.directions.map(|d| d.iter().map(|c| c * c).sum::<f64>().sqrt());
        for length in lengths {
            if !(length > 0.0 && length.is_finite()) {
                let requirement = "the directions of a sheet must not be zero";
                return Err(MeshError::Parameter { key: "directions", value: length, requirement });
            }
        }
        let unit = [0, 1].map(|d: usize| self.directions[d].map(|c| c / lengths[d]));
        let cosine: f64 = (0..3).map(|k| unit[0][k] * unit[1][k]).sum();
        if cosine.abs() > 1e-12 {
            let requirement = "the directions of a sheet must be at a right angle (this is their cosine)";
            return Err(MeshError::Parameter { key: "directions", value: cosine, requirement });
        }
        Ok(unit)
    }

    /// Returns the lattice in the plane of the sheet, m.
    fn lattice(&self) -> Vec<[f64; 2]> {
        let [nx, ny] = self.cells.map(|count| count as usize);
        let mut random = SplitMix(self.seed);
        let mut points = Vec::with_capacity((nx + 1) * (ny + 1));
        for j in 0..=ny {
            for i in 0..=nx {
                let mut shift = [0.0; 2];
                if self.pattern == SheetPattern::Random {
                    shift = [0, 1].map(|_| 0.5 * random.next() - 0.25);
                    // Nodes of a side stay on it, and corners stay where they are.
                    shift[0] *= f64::from(i > 0 && i < nx);
                    shift[1] *= f64::from(j > 0 && j < ny);
                }
                let at = |k: usize, index: usize, count: usize| {
                    self.size[k] * ((index as f64 + shift[k]) / count as f64)
                };
                points.push([at(0, i, nx), at(1, j, ny)]);
            }
        }
        points
    }
}

/// Returns whether the diagonal a–c of a quadrilateral is the Delaunay one: the opposite angles at b and d sum to at
/// most π.
fn is_delaunay([a, b, c, d]: [[f64; 2]; 4]) -> bool {
    let angle = |p: [f64; 2], at: [f64; 2], q: [f64; 2]| {
        let (u, v) = ([p[0] - at[0], p[1] - at[1]], [q[0] - at[0], q[1] - at[1]]);
        (u[0] * v[1] - u[1] * v[0]).abs().atan2(u[0] * v[0] + u[1] * v[1])
    };
    angle(a, b, c) + angle(c, d, a) <= std::f64::consts::PI
}

/// The generator SplitMix64 (Steele, Lea & Flood 2014), which gives the same numbers on every machine.
struct SplitMix(u64);

impl SplitMix {
    /// Returns a uniform number in [0, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn sheet(pattern: SheetPattern) -> SheetMesh {
        SheetMesh {
            size: [2.0, 1.0],
            cells: [8, 5],
            pattern,
            seed: 3,
            origin: [0.0; 3],
            directions: default_directions(),
        }
    }

    #[test]
    fn every_pattern_covers_the_rectangle_with_triangles_that_face_the_normal() {
        for pattern in [SheetPattern::Diagonal, SheetPattern::Cross, SheetPattern::Random] {
            let mesh = sheet(pattern).build().unwrap();
            mesh.check(2).unwrap();
            let mut area = 0.0;
            for nodes in mesh.blocks[0].nodes.chunks_exact(3) {
                let [a, b, c] = [0, 1, 2].map(|k| mesh.points[nodes[k] as usize]);
                let twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
                assert!(twice > 0.0);
                area += 0.5 * twice;
            }
            assert!((area - 2.0).abs() < 1e-14, "{pattern:?}: {area}");
            // Texture coordinates are the position on the sheet divided by its size, on a refined mesh too.
            let finer = mesh.refined();
            let texture = sheet(pattern).texture(&mesh);
            for (mesh, texture) in [(&mesh, texture.clone()), (&finer.mesh, finer.texture(&mesh, &texture))] {
                for (nodes, corners) in mesh.blocks[0].nodes.chunks_exact(3).zip(&texture) {
                    for (&node, uv) in nodes.iter().zip(corners) {
                        let x = mesh.points[node as usize];
                        assert!(
                            (uv[0] - x[0] / 2.0).abs() < 1e-15 && (uv[1] - x[1]).abs() < 1e-15,
                            "{pattern:?}"
                        );
                    }
                }
            }
            for (side, count) in [("x-min", 6), ("x-max", 6), ("y-min", 9), ("y-max", 9)] {
                assert_eq!(mesh.region_nodes(side).unwrap().len(), count);
            }
            assert_eq!(mesh.points[mesh.region_nodes("x-max-y-max").unwrap()[0] as usize], [2.0, 1.0, 0.0]);
        }
    }

    #[test]
    fn a_seed_is_a_mesh() {
        let one = sheet(SheetPattern::Random);
        assert_eq!(one.build(), one.build());
        assert_ne!(one.build(), SheetMesh { seed: 4, ..one }.build());
    }

    #[test]
    fn bad_numbers_name_their_key() {
        let good = sheet(SheetPattern::Diagonal);
        let flat = SheetMesh { size: [1.0, 0.0], ..good.clone() };
        let empty = SheetMesh { cells: [0, 1], ..good.clone() };
        let skew = SheetMesh { directions: [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], ..good };
        for (bad, key) in [(flat, "size"), (empty, "cells"), (skew, "directions")] {
            assert!(bad.build().unwrap_err().to_string().contains(key));
        }
    }
}
