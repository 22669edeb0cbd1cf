//! Gmsh mesh files, MSH 2.x and 4.1, text and binary of either byte order: sections, names, and how physical tags
//! become groups. The layouts of nodes and elements are in `v2.rs` and `v4.rs`, views in `view.rs`.
//!
//! Source: Gmsh reference manual, "MSH file format" (4.1) and "MSH file format version 2 (legacy)".

mod merge;
mod v2;
mod v4;
mod view;

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use crate::cursor::{Cursor, Encoding};
use crate::error::IoError;
use crate::mesh::MeshFile;
use crate::tags::TagIndex;
use vi_mesh::CellKind;
use vi_mesh::Region;
use view::{Site, View};

/// Reads a Gmsh MSH 2.x or 4.1 file that is in memory; `file` is for the messages only.
///
/// Physical groups become groups (unnamed ones are called by their number), nodes stay in the order of the file, the
/// copies of an element that MSH 2 keeps for each of its groups are merged. `$NodeData` and `$ElementData` become
/// point and cell arrays. Memory stays below 64 times the size of the file.
///
/// # Errors
/// Everything of [`IoError`] that reading has, with the line in a text and the byte offset in binary data.
pub fn parse_msh(bytes: &[u8], file: &Path) -> Result<MeshFile, IoError> {
    let mut cursor = Cursor::new(bytes, file);
    let version = header(&mut cursor)?;
    let mut reading = Reading::default();
    while let Some(name) = section(&mut cursor)? {
        let start = cursor.position();
        match (name, version) {
            (b"PhysicalNames", _) => reading.physical_names(&mut cursor)?,
            (b"Entities", Version::Four) => v4::entities(&mut cursor, &mut reading, false)?,
            (b"PartitionedEntities", Version::Four) => v4::entities(&mut cursor, &mut reading, true)?,
            (b"Nodes" | b"Elements", _) if !reading.seen.insert(name) => {
                return Err(
                    cursor.inconsistent_at(start, format!("a second ${} section", name.escape_ascii()))
                );
            }
            (b"Nodes", Version::Two) => v2::nodes(&mut cursor, &mut reading)?,
            (b"Nodes", Version::Four) => v4::nodes(&mut cursor, &mut reading)?,
            (b"Elements", Version::Two) => v2::elements(&mut cursor, &mut reading)?,
            (b"Elements", Version::Four) => v4::elements(&mut cursor, &mut reading)?,
            (b"NodeData", _) => reading.views.extend(view::read(&mut cursor, Site::Points)?),
            (b"ElementData", _) => reading.views.extend(view::read(&mut cursor, Site::Cells)?),
            (b"ElementNodeData", _) => {
                reading
                    .out
                    .notes
                    .push("$ElementNodeData is left out: only data at nodes or elements are read".into());
                skip_section(&mut cursor, name)?;
            }
            _ => skip_section(&mut cursor, name)?,
        }
        end_of_section(&mut cursor, name)?;
    }
    if !reading.seen.contains(b"Nodes".as_slice()) || !reading.seen.contains(b"Elements".as_slice()) {
        return Err(cursor.truncated("the mesh: there is no $Nodes or no $Elements section"));
    }
    reading.finish(version)
}

#[derive(Clone, Copy, PartialEq)]
enum Version {
    Two,
    Four,
}

/// Everything read so far.
#[derive(Default)]
struct Reading<'a> {
    out: MeshFile,
    seen: std::collections::HashSet<&'a [u8]>,
    names: BTreeMap<(usize, i32), String>,
    /// Physical tags of each geometric entity (dimension, tag): MSH 4 only.
    entities: HashMap<(usize, i32), Vec<i32>>,
    node_tags: TagIndex,
    cell_tags: Vec<u64>,
    /// Geometric entity of each cell: MSH 2 only, to know copies from neighbours.
    cell_entities: Vec<i32>,
    /// Cells of each physical group (dimension, tag).
    members: BTreeMap<(usize, i32), Vec<u32>>,
    views: Vec<View>,
}

impl<'a> Reading<'a> {
    fn physical_names(&mut self, cursor: &mut Cursor<'a>) -> Result<(), IoError> {
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

    /// Takes one element over, its nodes given by their tags in Gmsh's order.
    fn push_element(
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

    fn push_point(&mut self, cursor: &Cursor, at: usize, tag: u64, x: [f64; 3]) -> Result<(), IoError> {
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

    fn finish(mut self, version: Version) -> Result<MeshFile, IoError> {
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
            // One name for two tags is one region.
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

/// `$MeshFormat` with version, file type and data size, and the number 1 that shows the byte order.
fn header(cursor: &mut Cursor) -> Result<Version, IoError> {
    const RESAVE: &str = "save it from Gmsh as version 4.1 or 2.2 (Mesh.MshFileVersion = 4.1)";
    cursor.skip_whitespace();
    // A comment section may come first.
    while cursor.rest().starts_with(b"$Comments") {
        skip_section(cursor, b"Comments")?;
        end_of_section(cursor, b"Comments")?;
        cursor.skip_whitespace();
    }
    let at = cursor.start();
    let first = cursor.token("$MeshFormat")?;
    if first == b"$NOD" {
        return Err(cursor.unsupported_at(at, "the MSH format 1", RESAVE));
    }
    if first != b"$MeshFormat" {
        return Err(cursor.syntax_at(at, "$MeshFormat", first));
    }
    let at = cursor.start();
    let number = cursor.token("the format version")?;
    let version = match number {
        b"2" | b"2.0" | b"2.1" | b"2.2" => Version::Two,
        b"4.1" => Version::Four,
        _ => {
            return Err(cursor.unsupported_at(
                at,
                format!("the MSH format {}", number.escape_ascii()),
                RESAVE,
            ));
        }
    };
    let binary: u32 = cursor.text_number("the file type (0 or 1)")?;
    let width: usize = cursor.text_number("the data size")?;
    if width != 8 && !(width == 4 && version == Version::Four) {
        return Err(cursor.unsupported_at(at, format!("a data size of {width} bytes"), RESAVE));
    }
    cursor.size_width = width;
    match binary {
        0 => {}
        1 => {
            cursor.skip_line_end();
            let at = cursor.start();
            cursor.encoding = match cursor.take(4, "the number that shows the byte order")? {
                [1, 0, 0, 0] => Encoding::Little,
                [0, 0, 0, 1] => Encoding::Big,
                other => return Err(cursor.syntax_at(at, "the binary number 1", other)),
            };
        }
        _ => {
            return Err(cursor.syntax_at(
                at,
                "file type 0 (text) or 1 (binary)",
                binary.to_string().as_bytes(),
            ));
        }
    }
    end_of_section(cursor, b"MeshFormat")?;
    Ok(version)
}

/// The name of the next section, the cursor behind its line.
fn section<'a>(cursor: &mut Cursor<'a>) -> Result<Option<&'a [u8]>, IoError> {
    cursor.skip_whitespace();
    let at = cursor.start();
    let Some(line) = cursor.line() else {
        return Ok(None);
    };
    match line.trim_ascii().strip_prefix(b"$") {
        Some(name) if !name.is_empty() && !name.starts_with(b"End") => Ok(Some(name)),
        _ => Err(cursor.syntax_at(at, "the beginning of a section ($…)", line)),
    }
}

fn end_of_section(cursor: &mut Cursor, name: &[u8]) -> Result<(), IoError> {
    cursor.skip_whitespace();
    let at = cursor.start();
    let expected = || format!("$End{}", name.escape_ascii());
    let found = cursor.token(&format!("the section before {}", expected()))?;
    if found.strip_prefix(b"$End") == Some(name) {
        return Ok(());
    }
    Err(cursor.syntax_at(at, expected(), found))
}

/// Goes to the `$End…` of a section.
fn skip_section(cursor: &mut Cursor, name: &[u8]) -> Result<(), IoError> {
    let end = [b"$End", name].concat();
    let rest = cursor.rest();
    // Only `$` can begin it, and it is rare in text and in data.
    let mut from = 0;
    while let Some(found) = rest[from..].iter().position(|&byte| byte == b'$') {
        if rest[from + found..].starts_with(&end) {
            cursor.seek(cursor.position() + from + found);
            return Ok(());
        }
        from += found + 1;
    }
    Err(cursor.truncated(format!("the section ${}", name.escape_ascii())))
}

/// The kind of an element type, or the error that lists the supported ones.
fn kind_of(cursor: &Cursor, at: usize, code: i32, tag: u64) -> Result<CellKind, IoError> {
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
