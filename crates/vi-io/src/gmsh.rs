//! Reads Gmsh mesh files, MSH 2.x and 4.1, text and binary of either byte order: sections, names, and groups from
//! physical tags. Nodes and elements are read in `v2.rs` and `v4.rs`, views in `view.rs`.
//!
//! Source: Gmsh reference manual, "MSH file format" (4.1) and "MSH file format version 2 (legacy)".

mod merge;
mod reading;
mod v2;
mod v4;
mod view;

use std::path::Path;

use crate::cursor::{Cursor, Encoding};
use crate::error::IoError;
use crate::mesh::MeshFile;
use reading::{Reading, Version};
use view::Site;

/// Reads a Gmsh MSH 2.x or 4.1 file that is in memory; `file` is used in messages only.
///
/// Physical groups become groups (unnamed ones are called by their number). Nodes keep the order of the file. MSH 2
/// repeats an element for each of its groups; these copies are merged. `$NodeData` and `$ElementData` become point and
/// cell arrays. Memory stays below 64 times the size of the file.
///
/// # Errors
/// Returns any [`IoError`] of reading, with the line in a text and the byte offset in binary data.
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

/// Reads `$MeshFormat`: version, file type, data size, and the number 1 that shows the byte order.
fn header(cursor: &mut Cursor) -> Result<Version, IoError> {
    const RESAVE: &str = "save it from Gmsh as version 4.1 or 2.2 (Mesh.MshFileVersion = 4.1)";
    cursor.skip_whitespace();
    // Comment sections may come first.
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

/// Returns the name of the next section, and leaves the cursor after its line.
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

/// Moves to the `$End…` of a section.
fn skip_section(cursor: &mut Cursor, name: &[u8]) -> Result<(), IoError> {
    let end = [b"$End", name].concat();
    let rest = cursor.rest();
    // The end mark can only begin with `$`, which is rare in text and in data.
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
