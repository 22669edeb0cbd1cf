//! Reads VTU (unstructured grids) and VTP (surfaces) files: the XML and its descriptions of arrays. `payload.rs`
//! decodes the arrays.
//!
//! Source: VTK file formats, "XML file formats".

mod payload;

use std::ops::Range;
use std::path::Path;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use crate::cursor::Cursor;
use crate::error::{IoError, Place};
use crate::mesh::{DataArray, MeshFile};
use crate::vtk::cells::CellReader;
use crate::vtk::groups;
use crate::vtk::number::Number;
use crate::vtk::pieces::join;
use payload::{Content, Form, Payloads, Spec};

/// Reads a VTU or VTP file that is in memory; `file` is used in messages only.
///
/// Supports text, inline base64, appended raw and appended base64 data, each uncompressed or with zlib, of either byte
/// order and header type. Pieces are joined. Memory stays below 64 times the file, plus the size of unpacked arrays:
/// zlib packs at most 1032 bytes into one, and a larger ratio is refused.
///
/// Integer cell arrays named `region_id`, `material_id`, `body_id`, `gmsh:physical` or `CellEntityIds` also become
/// groups ("material_id=3"; "3" for `gmsh:physical`). Arrays `group:<name>` of 0 and 1 become the group `<name>`.
///
/// # Errors
/// Returns any [`IoError`] of reading.
pub fn parse_vtu(bytes: &[u8], file: &Path) -> Result<MeshFile, IoError> {
    let document = Document::parse(bytes, file)?;
    let mut payloads = Payloads::new(bytes, file, document.form);
    let mut out = MeshFile { notes: document.notes, ..MeshFile::default() };
    if let Some(spec) = &document.time {
        out.time = payloads.reals(spec, 1)?.first().copied();
    }
    let mut cells = CellReader::default();
    for (i, piece) in document.pieces.iter().enumerate() {
        let cells_before = cells.file_cell_count();
        let points_before = out.mesh.points.len();
        read_points(piece, &mut payloads, &mut out, bytes, file)?;
        cells.set_points(points_before, piece.point_count);
        for section in &piece.sections {
            read_cells(piece, section, &mut payloads, &mut cells, &mut out, file)?;
        }
        let cell_count = cells.file_cell_count() - cells_before;
        let point_arrays = read_arrays(&piece.point_arrays, piece.point_count, &mut payloads)?;
        join(&mut out.point_data, point_arrays, i, &mut out.notes);
        let cell_arrays = read_arrays(&piece.cell_arrays, cell_count, &mut payloads)?;
        join(&mut out.cell_data, cell_arrays, i, &mut out.notes);
    }
    cells.finish(&mut out, 4 * bytes.len());
    groups::from_arrays(&mut out);
    Ok(out)
}

/// The connectivity of one kind of cells: all cells of a VTU file, or the vertices, lines, strips or polygons of a VTP
/// file.
#[derive(Default)]
struct Section {
    /// The VTK type of all cells, if the file has no array of types.
    code: Option<i64>,
    count: usize,
    connectivity: Option<Spec>,
    offsets: Option<Spec>,
    types: Option<Spec>,
}

#[derive(Default)]
struct Piece {
    at: usize,
    point_count: usize,
    points: Option<Spec>,
    sections: Vec<Section>,
    point_arrays: Vec<Spec>,
    cell_arrays: Vec<Spec>,
}

struct Document {
    form: Form,
    pieces: Vec<Piece>,
    time: Option<Spec>,
    notes: Vec<String>,
}

/// The sections of a piece that contain cells, with their VTK types, in the order of the values of cell arrays.
const SECTIONS: [(&str, &str, Option<i64>); 5] = [
    ("Cells", "NumberOfCells", None),
    ("Verts", "NumberOfVerts", Some(2)),
    ("Lines", "NumberOfLines", Some(4)),
    ("Polys", "NumberOfPolys", Some(7)),
    ("Strips", "NumberOfStrips", Some(6)),
];

impl Document {
    fn parse(bytes: &[u8], file: &Path) -> Result<Self, IoError> {
        // Raw data may follow the XML.
        let length = std::str::from_utf8(bytes).map_or_else(|error| error.valid_up_to(), str::len);
        let text = std::str::from_utf8(&bytes[..length]).unwrap_or_default();
        let cursor = Cursor::new(bytes, file);
        let mut reader = Reader::from_str(text);
        let mut document = Self { form: Form::default(), pieces: Vec::new(), time: None, notes: Vec::new() };
        let mut section = String::new();
        let (mut seen_root, mut ended) = (false, false);
        loop {
            let at = reader.buffer_position() as usize;
            let event = next_event(&mut reader, &cursor)?;
            let (tag, has_content) = match &event {
                Event::Start(tag) => (tag, true),
                Event::Empty(tag) => (tag, false),
                Event::End(tag) => {
                    ended = tag.name().as_ref() == "VTKFile";
                    if tag.name().as_ref() == section {
                        section.clear();
                    }
                    continue;
                }
                Event::Eof => break,
                _ => continue,
            };
            match tag.name().as_ref() {
                "VTKFile" => {
                    seen_root = true;
                    document.form = form(tag, &cursor, at)?;
                }
                "Piece" => document.pieces.push(piece(tag, &cursor, at)?),
                "AppendedData" => {
                    let encoding = attribute(tag, "encoding").unwrap_or_default();
                    let start = reader.buffer_position() as usize;
                    let white = bytes[start..].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
                    if bytes.get(start + white) != Some(&b'_') {
                        let found =
                            &bytes[start + white..][..bytes.len().min(start + white + 1) - start - white];
                        return Err(cursor.syntax_at(start + white, "\"_\" before the appended data", found));
                    }
                    document.form.appended = Some((start + white + 1, encoding == "base64"));
                    ended = true;
                    break;
                }
                "DataArray" | "Array" => {
                    let range = if has_content { inline_text(&mut reader, &cursor)? } else { 0..0 };
                    document.array(tag, at, range, &section, &cursor)?;
                }
                name if has_content => section = name.to_string(),
                _ => {}
            }
        }
        if !seen_root {
            return Err(cursor.syntax_at(0, "a VTKFile element", &bytes[..bytes.len().min(40)]));
        }
        if !ended {
            return Err(cursor.truncated("the XML: an element is not closed"));
        }
        if document.pieces.is_empty() {
            return Err(cursor.inconsistent_at(0, "there is no Piece in the grid"));
        }
        Ok(document)
    }

    fn array(
        &mut self,
        tag: &BytesStart,
        at: usize,
        range: Range<usize>,
        section: &str,
        cursor: &Cursor,
    ) -> Result<(), IoError> {
        let name = attribute(tag, "Name").unwrap_or_default();
        let kind = attribute(tag, "type").unwrap_or_default();
        let is_time = section == "FieldData" && name == "TimeValue";
        if section == "FieldData" && !is_time {
            return Ok(());
        }
        let Some(number) = Number::from_xml(&kind) else {
            self.notes.push(format!("the array \"{name}\" of type {kind} is left out"));
            return Ok(());
        };
        let content = match attribute(tag, "format").as_deref() {
            Some("appended") => Content::Appended(number_attribute(tag, "offset", cursor, at)?),
            Some("binary") => Content::Base64(range),
            Some("ascii") | None => Content::Text(range),
            Some(other) => {
                return Err(cursor.syntax_at(at, "the format ascii, binary or appended", other.as_bytes()));
            }
        };
        let components = match attribute(tag, "NumberOfComponents") {
            Some(_) => number_attribute(tag, "NumberOfComponents", cursor, at)?.max(1),
            None => 1,
        };
        let spec = Spec { name, number, components, content, at };
        if is_time {
            self.time = Some(spec);
            return Ok(());
        }
        let Some(piece) = self.pieces.last_mut() else {
            return Err(cursor.inconsistent_at(at, "an array outside of a Piece"));
        };
        match section {
            "PointData" => piece.point_arrays.push(spec),
            "CellData" => piece.cell_arrays.push(spec),
            "Points" => piece.points = Some(spec),
            _ => {
                let Some(i) = SECTIONS.iter().position(|(name, ..)| *name == section) else { return Ok(()) };
                let Some(cells) = piece.sections.iter_mut().find(|cells| cells.code == SECTIONS[i].2) else {
                    return Ok(());
                };
                match spec.name.as_str() {
                    "connectivity" => cells.connectivity = Some(spec),
                    "offsets" => cells.offsets = Some(spec),
                    "types" => cells.types = Some(spec),
                    _ => {}
                }
            }
        }
        Ok(())
    }
}

/// Reads the settings of all arrays from the root element.
fn form(tag: &BytesStart, cursor: &Cursor, at: usize) -> Result<Form, IoError> {
    const RESAVE: &str = "save it from ParaView as .vtu, or convert it with meshio";
    let kind = attribute(tag, "type").unwrap_or_default();
    if kind != "UnstructuredGrid" && kind != "PolyData" {
        return Err(cursor.unsupported_at(at, format!("a VTK file of type \"{kind}\""), RESAVE));
    }
    let compressed = match attribute(tag, "compressor").as_deref() {
        None | Some("") => false,
        Some("vtkZLibDataCompressor") => true,
        Some(other) => {
            let remedy = "save it with zlib or no compression";
            return Err(cursor.unsupported_at(at, format!("data compressed by {other}"), remedy));
        }
    };
    Ok(Form {
        big: attribute(tag, "byte_order").as_deref() == Some("BigEndian"),
        wide_header: attribute(tag, "header_type").as_deref() == Some("UInt64"),
        compressed,
        appended: None,
    })
}

fn piece(tag: &BytesStart, cursor: &Cursor, at: usize) -> Result<Piece, IoError> {
    let mut piece =
        Piece { at, point_count: number_attribute(tag, "NumberOfPoints", cursor, at)?, ..Piece::default() };
    for (_, count, code) in SECTIONS {
        if attribute(tag, count).is_some() {
            let count = number_attribute(tag, count, cursor, at)?;
            piece.sections.push(Section { code, count, ..Section::default() });
        }
    }
    Ok(piece)
}

fn attribute(tag: &BytesStart, name: &str) -> Option<String> {
    let attribute = tag.try_get_attribute(name).ok()??;
    Some(attribute.normalized_value(XmlVersion::Implicit1_0).ok()?.into_owned())
}

fn number_attribute(tag: &BytesStart, name: &str, cursor: &Cursor, at: usize) -> Result<usize, IoError> {
    let value = attribute(tag, name).unwrap_or_default();
    let expected = || format!("the attribute {name} with a whole number");
    value.trim().parse().map_err(|_| cursor.syntax_at(at, expected(), value.as_bytes()))
}

/// Returns the next event.
///
/// # Errors
/// Returns an error with its line if the text is not well-formed XML.
fn next_event<'a>(reader: &mut Reader<&'a [u8]>, cursor: &Cursor) -> Result<Event<'a>, IoError> {
    reader.read_event().map_err(|error| {
        cursor.syntax_at(reader.error_position() as usize, "well-formed XML", error.to_string().as_bytes())
    })
}

/// Returns the text of a `DataArray` up to its end. Elements inside it (ParaView's `InformationKey`) are ignored.
fn inline_text(reader: &mut Reader<&[u8]>, cursor: &Cursor) -> Result<Range<usize>, IoError> {
    let start = reader.buffer_position() as usize;
    let mut text: Option<Range<usize>> = None;
    let mut depth = 0;
    loop {
        let at = reader.buffer_position() as usize;
        let event = next_event(reader, cursor)?;
        match event {
            Event::Start(_) => depth += 1,
            Event::End(_) if depth > 0 => depth -= 1,
            Event::End(_) => return Ok(text.unwrap_or(start..start)),
            Event::Text(content) if depth == 0 && text.is_none() && !content.trim().is_empty() => {
                text = Some(at..reader.buffer_position() as usize);
            }
            Event::Eof => return Err(cursor.truncated("a DataArray")),
            _ => {}
        }
    }
}

fn read_points(
    piece: &Piece,
    payloads: &mut Payloads,
    out: &mut MeshFile,
    bytes: &[u8],
    file: &Path,
) -> Result<(), IoError> {
    let cursor = Cursor::new(bytes, file);
    if piece.point_count == 0 {
        return Ok(());
    }
    let Some(spec) = &piece.points else {
        return Err(cursor.inconsistent_at(piece.at, "a Piece has no Points"));
    };
    if spec.components != 3 && spec.components != 1 {
        let what = format!("points have {} coordinates instead of 3", spec.components);
        return Err(cursor.inconsistent_at(spec.at, what));
    }
    let values = payloads.reals(spec, payloads.product(spec, piece.point_count, 3)?)?;
    let (points, _) = values.as_chunks::<3>();
    if let Some(i) = points.iter().position(|x| x.iter().any(|x| !x.is_finite())) {
        let place = cursor.line_at(spec.at);
        return Err(IoError::NotFinite { file: file.into(), place, node: i as u64, x: points[i] });
    }
    if out.mesh.points.len() + points.len() > u32::MAX as usize {
        return Err(cursor.unsupported_at(spec.at, "more than 4294967295 points", "divide the mesh"));
    }
    out.mesh.points.extend_from_slice(points);
    Ok(())
}

fn read_cells(
    piece: &Piece,
    section: &Section,
    payloads: &mut Payloads,
    cells: &mut CellReader,
    out: &mut MeshFile,
    file: &Path,
) -> Result<(), IoError> {
    if section.count == 0 {
        return Ok(());
    }
    let place = payloads.place(piece.at);
    let missing = |name: &str| IoError::Inconsistent {
        file: file.into(),
        place,
        what: format!("a Piece announces {} cells but has no array \"{name}\" for them", section.count),
    };
    let offsets = section.offsets.as_ref().ok_or_else(|| missing("offsets"))?;
    let connectivity = section.connectivity.as_ref().ok_or_else(|| missing("connectivity"))?;
    let place: Place = payloads.place(connectivity.at);
    let ends = payloads.integers(offsets, section.count)?;
    let broken = |i: usize| IoError::Inconsistent {
        file: file.into(),
        place,
        what: format!("the offset of cell {i} is below that of the cell before"),
    };
    let node_count =
        usize::try_from(ends.last().copied().unwrap_or(0)).map_err(|_| broken(section.count - 1))?;
    let nodes = payloads.integers(connectivity, node_count)?;
    let types = match &section.types {
        Some(types) if section.code.is_none() => payloads.integers(types, section.count)?,
        None if section.code.is_none() => return Err(missing("types")),
        _ => Vec::new(),
    };
    let mut start = 0;
    for (i, &end) in ends.iter().enumerate() {
        let end = usize::try_from(end)
            .ok()
            .filter(|&end| end >= start && end <= nodes.len())
            .ok_or_else(|| broken(i))?;
        let code = section.code.unwrap_or_else(|| types[i]);
        cells.push(out, file, || place, code, &nodes[start..end])?;
        start = end;
    }
    Ok(())
}

fn read_arrays(specs: &[Spec], count: usize, payloads: &mut Payloads) -> Result<Vec<DataArray>, IoError> {
    let mut arrays: Vec<DataArray> = Vec::new();
    for spec in specs {
        let values = payloads.reals(spec, payloads.product(spec, count, spec.components)?)?;
        arrays.push(DataArray { name: spec.name.clone(), components: spec.components, values });
    }
    Ok(arrays)
}
