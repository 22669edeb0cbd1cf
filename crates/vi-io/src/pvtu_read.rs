//! Reads a PVTU file: the pieces that it names, as one mesh.

use std::collections::HashMap;
use std::path::Path;

use quick_xml::events::Event;
use quick_xml::{Reader, XmlVersion};

use crate::cursor::Cursor;
use crate::error::IoError;
use crate::mesh::{DataArray, MeshFile};
use crate::vtk::pieces::join;
use crate::vtu::parse_vtu;

/// Returns whether a text is that of a PVTU file.
pub(crate) fn is_pvtu(bytes: &[u8]) -> bool {
    const ROOT: &[u8] = b"PUnstructuredGrid";
    bytes.trim_ascii_start().starts_with(b"<")
        && bytes[..bytes.len().min(1000)].windows(ROOT.len()).any(|part| part == ROOT)
}

/// Reads the pieces that the PVTU file `bytes` at `path` names. Points of different pieces that agree in position and in all arrays
/// are one point: the pieces of a mesh repeat the points between them.
///
/// # Errors
/// Returns an error if the XML is not well-formed, or that of a piece.
pub(crate) fn read_pvtu(bytes: &[u8], path: &Path) -> Result<MeshFile, IoError> {
    let sources = sources(bytes, path)?;
    let mut whole = MeshFile::default();
    let mut points = Merged::default();
    for (number, source) in sources.iter().enumerate() {
        let file = path.with_file_name("").join(source);
        let system = |cause| IoError::System { file: file.clone(), action: "read", source: cause };
        let piece = parse_vtu(&std::fs::read(&file).map_err(system)?, &file)?;
        add(&mut whole, piece, number, &mut points);
    }
    Ok(whole)
}

/// Returns the `Source` of each `Piece`.
fn sources(bytes: &[u8], path: &Path) -> Result<Vec<String>, IoError> {
    let cursor = Cursor::new(bytes, path);
    let text = std::str::from_utf8(bytes)
        .map_err(|error| cursor.syntax_at(error.valid_up_to(), "XML in UTF-8", b""))?;
    let mut reader = Reader::from_str(text);
    let mut sources = Vec::new();
    loop {
        let at = reader.buffer_position() as usize;
        let event = reader
            .read_event()
            .map_err(|error| cursor.syntax_at(at, "well-formed XML", error.to_string().as_bytes()))?;
        match event {
            Event::Start(tag) | Event::Empty(tag) if tag.name().as_ref() == "Piece" => {
                let source = tag.try_get_attribute("Source").ok().flatten();
                let source = source.and_then(|source| source.normalized_value(XmlVersion::Implicit1_0).ok());
                let source = source.ok_or_else(|| cursor.inconsistent_at(at, "a Piece has no Source"))?;
                sources.push(source.into_owned());
            }
            Event::Eof => break,
            _ => {}
        }
    }
    if sources.is_empty() {
        return Err(cursor.inconsistent_at(0, "there is no Piece in the grid"));
    }
    Ok(sources)
}

/// The points of the pieces so far by the bits of their values, each with its number in the whole mesh.
#[derive(Default)]
struct Merged(HashMap<Vec<u64>, u32>);

/// Adds piece `number` to the mesh of the pieces before it.
fn add(whole: &mut MeshFile, piece: MeshFile, number: usize, merged: &mut Merged) {
    let first_cell = whole.mesh.cell_count() as u32;
    let (mut numbers, mut kept) = (Vec::with_capacity(piece.mesh.points.len()), Vec::new());
    let mut own = Vec::new();
    for (k, point) in piece.mesh.points.iter().enumerate() {
        let values = piece
            .point_data
            .iter()
            .flat_map(|array| &array.values[k * array.components..][..array.components]);
        let key: Vec<u64> = point.iter().chain(values).map(|value| value.to_bits()).collect();
        // Points of one piece stay apart: those of bodies that are joined there may agree.
        match merged.0.get(&key) {
            Some(&other) => numbers.push(other),
            None => {
                let new = (whole.mesh.points.len() + kept.len()) as u32;
                numbers.push(new);
                kept.push(k);
                own.push((key, new));
            }
        }
    }
    merged.0.extend(own);
    whole.mesh.points.extend(kept.iter().map(|&k| piece.mesh.points[k]));
    for (kind, nodes) in piece.mesh.cells() {
        let nodes: Vec<u32> = nodes.iter().map(|&node| numbers[node as usize]).collect();
        whole.mesh.push_cell(kind, &nodes);
    }
    for mut region in piece.mesh.regions {
        region.cells.iter_mut().for_each(|cell| *cell += first_cell);
        let same =
            |other: &&mut vi_mesh::Region| (&other.name, other.dimension) == (&region.name, region.dimension);
        match whole.mesh.regions.iter_mut().find(same) {
            Some(other) => other.cells.extend(region.cells),
            None => whole.mesh.regions.push(region),
        }
    }
    let chosen = |array: DataArray| DataArray {
        values: kept
            .iter()
            .flat_map(|&k| array.values[k * array.components..][..array.components].to_vec())
            .collect(),
        ..array
    };
    let point_data = piece.point_data.into_iter().map(chosen).collect();
    join(&mut whole.point_data, point_data, number, &mut whole.notes);
    join(&mut whole.cell_data, piece.cell_data, number, &mut whole.notes);
    whole.time = whole.time.or(piece.time);
    whole.notes.extend(piece.notes);
}
