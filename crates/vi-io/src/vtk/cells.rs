//! Makes cells from VTK's types, offsets and connectivity. Composite cells (poly-lines, strips, polygons) are divided,
//! and the arrays over cells follow them.

use std::path::Path;

use crate::error::{IoError, Place};
use crate::mesh::{DataArray, MeshFile};
use vi_mesh::CellKind;

/// Collects the cells of one file.
#[derive(Default)]
pub(crate) struct CellReader {
    base: usize,
    point_count: usize,
    /// For each cell of the mesh, the cell of the file that it comes from.
    source: Vec<u32>,
    /// Number of cells of the file.
    file_cells: u32,
    /// Number of cells that were divided.
    divided: usize,
    /// Number of wedges whose orientation was reversed.
    reversed: usize,
}

impl CellReader {
    /// Offsets the following node numbers by `base` and limits them by `point_count`: each piece of a file numbers its
    /// own points.
    pub(crate) fn set_points(&mut self, base: usize, point_count: usize) {
        (self.base, self.point_count) = (base, point_count);
    }

    /// Adds one cell of the file.
    pub(crate) fn push(
        &mut self,
        out: &mut MeshFile,
        file: &Path,
        place: impl Fn() -> Place,
        code: i64,
        nodes: &[i64],
    ) -> Result<(), IoError> {
        let (base, point_count) = (self.base, self.point_count);
        let cell = u64::from(self.file_cells);
        let unknown = |node| IoError::UnknownNode {
            file: file.into(),
            place: place(),
            cell,
            node,
            node_count: point_count,
        };
        let mut corners = Vec::with_capacity(nodes.len());
        for &node in nodes {
            match usize::try_from(node) {
                Ok(i) if i < point_count => corners.push((base + i) as u32),
                _ => return Err(unknown(node)),
            }
        }
        let n = &corners;
        match (code, n.len()) {
            (2, 1..) => n.iter().for_each(|&node| out.mesh.push_cell(CellKind::Point, &[node])),
            (4, 2..) => n.windows(2).for_each(|pair| out.mesh.push_cell(CellKind::Line2, pair)),
            (6, 3..) => {
                for (i, t) in n.windows(3).enumerate() {
                    // Every second triangle of a strip is reversed.
                    let t = if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
                    out.mesh.push_cell(CellKind::Tri3, &t);
                }
            }
            (7, 3) => out.mesh.push_cell(CellKind::Tri3, n),
            (7, 4) => out.mesh.push_cell(CellKind::Quad4, n),
            (7, 5..) => n[1..]
                .windows(2)
                .for_each(|pair| out.mesh.push_cell(CellKind::Tri3, &[n[0], pair[0], pair[1]])),
            (13, 6) if is_inward(&out.mesh.points, n) => {
                out.mesh.push_cell(CellKind::Wedge6, &[n[0], n[2], n[1], n[3], n[5], n[4]]);
                self.reversed += 1;
            }
            (8, 4) => out.mesh.push_cell(CellKind::Quad4, &[n[0], n[1], n[3], n[2]]),
            (11, 8) => out.mesh.push_cell(CellKind::Hex8, &[n[0], n[1], n[3], n[2], n[4], n[5], n[7], n[6]]),
            _ => {
                let kind = u8::try_from(code).ok().and_then(CellKind::from_vtk_code);
                // Lagrange pyramids exist in any order; only one of them is a supported kind.
                let kind = kind.filter(|kind| *kind != CellKind::Pyramid14 || n.len() == kind.node_count());
                let kind = kind.ok_or_else(|| IoError::UnsupportedCell {
                    file: file.into(),
                    place: place(),
                    cell,
                    format: "VTK",
                    code,
                    name: name(code),
                    supported: CellKind::NAMES,
                })?;
                if n.len() != kind.node_count() {
                    let what = format!(
                        "cell {cell} is a {} with {} nodes instead of {}",
                        kind.name(),
                        n.len(),
                        kind.node_count()
                    );
                    return Err(IoError::Inconsistent { file: file.into(), place: place(), what });
                }
                out.mesh.push_cell(kind, n);
            }
        }
        let made = match code {
            2 => n.len(),
            4 => n.len() - 1,
            6 => n.len() - 2,
            7 if n.len() > 4 => n.len() - 2,
            _ => 1,
        };
        if made > 1 {
            self.divided += 1;
        }
        self.source.resize(self.source.len() + made, self.file_cells);
        self.file_cells += 1;
        Ok(())
    }

    /// Returns the number of cells of the file added so far.
    pub(crate) fn file_cell_count(&self) -> usize {
        self.file_cells as usize
    }

    /// Repeats the values of arrays for cells that were divided, with a note. Arrays that would together take more than
    /// `room` values are left out, with a note: many arrays over one long poly-line would need far more memory than the
    /// file.
    pub(crate) fn finish(self, out: &mut MeshFile, mut room: usize) {
        if self.reversed > 0 {
            let note = "wedges had their base facing outwards, as in old VTK manuals: their orientation was reversed";
            out.notes.push(format!("{} {note}", self.reversed));
        }
        if self.divided == 0 {
            return;
        }
        let note =
            "cells of several parts (poly-lines, strips, polygons) were divided into lines and triangles";
        out.notes.push(format!("{} {note}", self.divided));
        let notes = &mut out.notes;
        out.cell_data.retain_mut(|DataArray { name, components, values }| {
            let left = self.source.len().checked_mul(*components).and_then(|needed| room.checked_sub(needed));
            let Some(left) = left else {
                notes.push(format!("the cell array \"{name}\" is left out: too large for the divided cells"));
                return false;
            };
            room = left;
            let tuples = self.source.iter().map(|&i| &values[i as usize * *components..][..*components]);
            *values = tuples.flatten().copied().collect();
            true
        });
    }
}

/// Returns whether a wedge is numbered as drawn in VTK's older manuals, which some programs follow (such as Gmsh's VTK
/// export): the normal of its first triangle points away from the second one.
fn is_inward(points: &[[f64; 3]], n: &[u32]) -> bool {
    let [o, a, b, c] = [n[0], n[1], n[2], n[3]].map(|i| points[i as usize]);
    let edge = |to: [f64; 3]| [to[0] - o[0], to[1] - o[1], to[2] - o[2]];
    let [a, b, c] = [edge(a), edge(b), edge(c)];
    let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    normal[0] * c[0] + normal[1] * c[1] + normal[2] * c[2] < 0.0
}

fn name(code: i64) -> &'static str {
    match code {
        0 => " (empty cell)",
        30 | 33 | 34 | 35 | 36 | 37 => " (a quadratic kind)",
        41 => " (convex point set)",
        42 => " (polyhedron)",
        60..=67 => " (of higher order)",
        68..=74 => " (Lagrange cell)",
        75..=81 => " (Bézier cell)",
        _ => "",
    }
}
