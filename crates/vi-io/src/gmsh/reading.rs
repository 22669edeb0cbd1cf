//! The data read from a Gmsh file: points and cells by their tags, names, and groups from physical tags.

use std::collections::{BTreeMap, HashMap};

use super::view::{Site, View};
use crate::cursor::Cursor;
use crate::error::IoError;
use crate::mesh::MeshFile;
use crate::tags::TagIndex;
use vi_mesh::{CellKind, Region};

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Version {
    Two,
    Four,
}

/// The data read so far.
#[derive(Default)]
pub(super) struct Reading<'a> {
    pub(super) out: MeshFile,
    pub(super) seen: std::collections::HashSet<&'a [u8]>,
    pub(super) names: BTreeMap<(usize, i32), String>,
    /// Physical tags of each geometric entity (dimension, tag), in MSH 4 only.
    pub(super) entities: HashMap<(usize, i32), Vec<i32>>,
    pub(super) node_tags: TagIndex,
    pub(super) cell_tags: Vec<u64>,
    /// Geometric entity of each cell, in MSH 2 only: it distinguishes copies from neighbours.
    pub(super) cell_entities: Vec<i32>,
    /// Cells of each physical group (dimension, tag).
    pub(super) members: BTreeMap<(usize, i32), Vec<u32>>,
    pub(super) views: Vec<View>,
}

impl<'a> Reading<'a> {
    pub(super) fn physical_names(&mut self, cursor: &mut Cursor<'a>) -> Result<(), IoError> {
        let count: u64 = cursor.text_number("the number of physical names")?;
        for _ in 0..cursor.count(count, 7, "physical names")? {
            let dimension: usize = cursor.text_number("the dimension of a physical name")?;
            let tag: i32 = cursor.text_number("the tag of a physical name")?;
            let at = cursor.start();
            let line = cursor.line().unwrap_or_default().trim_ascii();
            let name = line.strip_prefix(b"\"").and_then(|rest| rest.strip_suffix(b"\""));
            let name = name.ok_or_else(|| cursor.syntax_at(at, "a physical name in quotes", line))?;
            self.names.insert((dimension, tag.saturating_abs()), String::from_utf8_lossy(name).into_owned());
        }
        Ok(())
    }

    /// Adds one element whose nodes are given by their tags in Gmsh's order.
    pub(super) fn push_element(
        &mut self,
        cursor: &Cursor,
        at: usize,
        kind: CellKind,
        tag: u64,
        node_tags: &[u64],
    ) -> Result<u32, IoError> {
        let mut nodes = [0; 27];
        let nodes = &mut nodes[..kind.node_count()];
        for (node, &node_tag) in nodes.iter_mut().zip(node_tags) {
            *node = self.node_tags.get(node_tag).ok_or_else(|| IoError::UnknownNode {
                file: cursor.file().into(),
                place: cursor.place_at(at),
                cell: tag,
                node: node_tag as i64,
                node_count: self.out.mesh.points.len(),
            })?;
        }
        kind.reorder_from_gmsh(nodes);
        self.out.mesh.push_cell(kind, nodes);
        self.cell_tags.push(tag);
        Ok((self.cell_tags.len() - 1) as u32)
    }

    pub(super) fn push_point(
        &mut self,
        cursor: &Cursor,
        at: usize,
        tag: u64,
        x: [f64; 3],
    ) -> Result<(), IoError> {
        if x.iter().any(|x| !x.is_finite()) {
            return Err(IoError::NotFinite {
                file: cursor.file().into(),
                place: cursor.place_at(at),
                node: tag,
                x,
            });
        }
        self.out.mesh.points.push(x);
        Ok(())
    }

    pub(super) fn finish(mut self, version: Version) -> Result<MeshFile, IoError> {
        if version == Version::Two {
            self.merge_copies();
        }
        for (dimension, tag) in self.names.keys() {
            self.members.entry((*dimension, *tag)).or_default();
        }
        for ((dimension, tag), mut cells) in self.members {
            let name = self.names.remove(&(dimension, tag)).unwrap_or_else(|| tag.to_string());
            if cells.is_empty() {
                self.out
                    .notes
                    .push(format!("the physical group \"{name}\" (dimension {dimension}) has no elements"));
            }
            // Two tags with one name form one region.
            match self
                .out
                .mesh
                .regions
                .iter_mut()
                .find(|group| group.name == name && group.dimension == dimension)
            {
                Some(group) => group.cells.append(&mut cells),
                None => self.out.mesh.regions.push(Region { name, dimension, cells }),
            }
        }
        for group in &mut self.out.mesh.regions {
            group.cells.sort_unstable();
            group.cells.dedup();
        }
        let cell_tags = TagIndex::with_first_of_copies(&self.cell_tags);
        for view in self.views {
            match view.site {
                Site::Points => view.place(&self.node_tags, self.out.mesh.points.len(), &mut self.out),
                Site::Cells => view.place(&cell_tags, self.out.mesh.cell_count(), &mut self.out),
            }
        }
        Ok(self.out)
    }
}

/// Returns the cell kind of an element type, or the error that lists the supported types.
pub(super) fn kind_of(cursor: &Cursor, at: usize, code: i32, tag: u64) -> Result<CellKind, IoError> {
    CellKind::from_gmsh_code(code).ok_or_else(|| IoError::UnsupportedCell {
        file: cursor.file().into(),
        place: cursor.place_at(at),
        cell: tag,
        format: "Gmsh",
        code: code.into(),
        name: match code {
            14 => " (pyramid with 14 nodes; set Mesh.SecondOrderIncomplete = 1)",
            20..=31 => " (of order 3 or more; set Mesh.ElementOrder ≤ 2)",
            _ => "",
        },
        supported: CellKind::NAMES,
    })
}
