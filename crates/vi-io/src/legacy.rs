//! Reads legacy VTK files, versions 1 to 5.1, text and binary: unstructured grids and surfaces.
//!
//! Source: VTK file formats, "Simple legacy formats"; vtkDataReader for what the formats leave open (the OFFSETS and
//! CONNECTIVITY layout of 5.1, METADATA, names with %-codes).

use std::path::Path;

use crate::cursor::{Cursor, Encoding};
use crate::error::IoError;
use crate::mesh::{DataArray, MeshFile};
use crate::vtk::cells::CellReader;
use crate::vtk::groups;
use crate::vtk::number::Number;

/// Reads a legacy VTK file that is in memory; `file` is used in messages only.
///
/// Cell arrays become groups as in [`parse_vtu`](crate::parse_vtu). Memory stays below 64 times the file.
///
/// # Errors
/// Returns any [`IoError`] of reading, with the line in a text and the byte offset in binary data.
pub fn parse_vtk(bytes: &[u8], file: &Path) -> Result<MeshFile, IoError> {
    let mut cursor = Cursor::new(bytes, file);
    header(&mut cursor)?;
    let mut legacy =
        Legacy { cursor, out: MeshFile::default(), topologies: Vec::new(), types: None, site: None };
    while let Some(keyword) = legacy.cursor.next_token() {
        legacy.section(keyword)?;
    }
    legacy.finish(bytes.len())
}

/// The cells of one keyword: connectivity, with the end of each cell in it.
struct Topology {
    at: usize,
    keyword: &'static str,
    ends: Vec<usize>,
    nodes: Vec<i64>,
}

/// The keywords of cells with their VTK types, in the order that cell arrays follow.
const TOPOLOGIES: [(&str, Option<i64>); 5] = [
    ("CELLS", None),
    ("VERTICES", Some(2)),
    ("LINES", Some(4)),
    ("POLYGONS", Some(7)),
    ("TRIANGLE_STRIPS", Some(6)),
];

/// The entities that the following attributes belong to.
#[derive(Clone, Copy, PartialEq)]
enum Site {
    Points,
    Cells,
}

struct Legacy<'a> {
    cursor: Cursor<'a>,
    out: MeshFile,
    topologies: Vec<Topology>,
    types: Option<Vec<i64>>,
    /// Where the following attributes belong, and their number of tuples.
    site: Option<(Site, usize)>,
}

fn header(cursor: &mut Cursor) -> Result<(), IoError> {
    let first = cursor.line().unwrap_or_default();
    if !first.starts_with(b"# vtk DataFile Version") {
        return Err(cursor.syntax_at(0, "\"# vtk DataFile Version …\"", first));
    }
    cursor.line().ok_or_else(|| cursor.truncated("the title"))?;
    let at = cursor.start();
    match cursor.token("ASCII or BINARY")? {
        word if word.eq_ignore_ascii_case(b"ASCII") => {}
        word if word.eq_ignore_ascii_case(b"BINARY") => cursor.encoding = Encoding::Big,
        word => return Err(cursor.syntax_at(at, "ASCII or BINARY", word)),
    }
    Ok(())
}

impl Legacy<'_> {
    fn section(&mut self, keyword: &[u8]) -> Result<(), IoError> {
        let at = self.cursor.position() - keyword.len();
        match keyword.to_ascii_uppercase().as_slice() {
            b"DATASET" => self.dataset(),
            b"POINTS" => self.points(at),
            b"CELL_TYPES" => {
                let count = self.count("cell types")?;
                let types = self.integers(Number::Signed(4), count, "the cell types")?;
                self.types = Some(types);
                Ok(())
            }
            b"POINT_DATA" => {
                let count = self.count("tuples of point data")?;
                self.site = Some((Site::Points, count));
                Ok(())
            }
            b"CELL_DATA" => {
                let count = self.count("tuples of cell data")?;
                self.site = Some((Site::Cells, count));
                Ok(())
            }
            b"FIELD" => self.field(),
            b"METADATA" => {
                self.cursor.line();
                while self.cursor.line().is_some_and(|line| !line.trim_ascii().is_empty()) {}
                Ok(())
            }
            b"LOOKUP_TABLE" => {
                self.cursor.token("the name of a lookup table")?;
                let count = self.count("colours")?;
                let number = if self.cursor.encoding == Encoding::Text {
                    Number::Real(4)
                } else {
                    Number::Unsigned(1)
                };
                let length = self.product(count, 4)?;
                self.reals(number, length, "a lookup table").map(|_| ())
            }
            name => match TOPOLOGIES.iter().find(|(keyword, _)| keyword.as_bytes() == name) {
                Some(&(keyword, _)) => self.topology(at, keyword),
                None => self.attribute(at, name),
            },
        }
    }

    fn dataset(&mut self) -> Result<(), IoError> {
        let at = self.cursor.start();
        let kind = self.cursor.token("the kind of data set")?;
        match kind.to_ascii_uppercase().as_slice() {
            b"UNSTRUCTURED_GRID" | b"POLYDATA" => Ok(()),
            b"STRUCTURED_GRID" | b"STRUCTURED_POINTS" | b"RECTILINEAR_GRID" | b"FIELD" => {
                let what = format!("a data set of the kind {}", kind.escape_ascii());
                Err(self.cursor.unsupported_at(at, what, "save it as an unstructured grid (.vtu)"))
            }
            _ => Err(self.cursor.syntax_at(at, "UNSTRUCTURED_GRID or POLYDATA", kind)),
        }
    }

    fn points(&mut self, at: usize) -> Result<(), IoError> {
        let count = self.count("points")?;
        let number = self.number_type()?;
        let length = self.product(count, 3)?;
        let values = self.reals(number, length, "the points")?;
        let (points, _) = values.as_chunks::<3>();
        if let Some(i) = points.iter().position(|x| x.iter().any(|x| !x.is_finite())) {
            let (file, place) = (self.cursor.file().into(), self.cursor.place_at(at));
            return Err(IoError::NotFinite { file, place, node: i as u64, x: points[i] });
        }
        if points.len() > u32::MAX as usize {
            return Err(self.cursor.unsupported_at(at, "more than 4294967295 points", "divide the mesh"));
        }
        self.out.mesh.points = points.to_vec();
        Ok(())
    }

    fn topology(&mut self, at: usize, keyword: &'static str) -> Result<(), IoError> {
        let first = self.count("cells")?;
        let second = self.count("entries of cells")?;
        let before = self.cursor.clone();
        let (mut ends, nodes);
        if self.cursor.next_token().is_some_and(|word| word.eq_ignore_ascii_case(b"OFFSETS")) {
            // In version 5.1 the offsets, one more than cells, precede the nodes.
            let number = self.number_type()?;
            let offsets = self.integers(number, first, "the offsets of cells")?;
            let here = self.cursor.start();
            let word = self.cursor.token("CONNECTIVITY")?;
            if !word.eq_ignore_ascii_case(b"CONNECTIVITY") {
                return Err(self.cursor.syntax_at(here, "CONNECTIVITY", word));
            }
            let number = self.number_type()?;
            nodes = self.integers(number, second, "the nodes of cells")?;
            let increasing = offsets.first().is_none_or(|&first| first == 0) && offsets.is_sorted();
            if !increasing || offsets.last().is_some_and(|&last| last != second as i64) {
                return Err(self.cursor.inconsistent_at(at, "the offsets of cells do not fit their nodes"));
            }
            ends = offsets.into_iter().skip(1).map(|end| end as usize).collect();
        } else {
            // In older versions each cell begins with its number of nodes.
            self.cursor = before;
            let mut entries = self.integers(Number::Signed(4), second, "the cells")?;
            ends = Vec::with_capacity(first.min(second));
            let (mut from, mut to) = (0, 0);
            while from < entries.len() {
                let size = usize::try_from(entries[from]).ok().filter(|&size| size < entries.len() - from);
                let size = size.ok_or_else(|| {
                    self.cursor.inconsistent_at(
                        at,
                        format!("cell {} has more nodes than there are entries", ends.len()),
                    )
                })?;
                entries.copy_within(from + 1..from + 1 + size, to);
                (from, to) = (from + 1 + size, to + size);
                ends.push(to);
            }
            if ends.len() != first {
                let what = format!("{first} cells are announced, {} are there", ends.len());
                return Err(self.cursor.inconsistent_at(at, what));
            }
            entries.truncate(to);
            nodes = entries;
        }
        if self.topologies.iter().any(|topology| topology.keyword == keyword) {
            return Err(self.cursor.inconsistent_at(at, format!("a second {keyword} section")));
        }
        self.topologies.push(Topology { at, keyword, ends, nodes });
        Ok(())
    }

    /// Reads an attribute: SCALARS, VECTORS, …
    fn attribute(&mut self, at: usize, keyword: &[u8]) -> Result<(), IoError> {
        let components = match keyword {
            b"SCALARS" | b"GLOBAL_IDS" | b"PEDIGREE_IDS" | b"EDGE_FLAGS" => 1,
            b"VECTORS" | b"NORMALS" => 3,
            b"TENSORS" => 9,
            b"TENSORS6" => 6,
            b"TEXTURE_COORDINATES" | b"COLOR_SCALARS" => 0,
            _ => return Err(self.cursor.syntax_at(at, "a keyword of the VTK format", keyword)),
        };
        let Some((_, count)) = self.site else {
            return Err(self.cursor.syntax_at(at, "POINT_DATA or CELL_DATA before any array", keyword));
        };
        let name = name(self.cursor.token("the name of an array")?);
        let components = if components == 0 { self.count("components")? } else { components };
        let number = match (keyword, self.cursor.encoding) {
            (b"COLOR_SCALARS", Encoding::Text) => Number::Real(4),
            (b"COLOR_SCALARS", _) => Number::Unsigned(1),
            _ => self.number_type()?,
        };
        let mut components = components;
        if keyword == b"SCALARS" {
            // An optional number of components stands on the same line, an optional table after it.
            let here = self.cursor.position();
            let rest = self.cursor.line().unwrap_or_default().trim_ascii();
            if !rest.is_empty() {
                let number = std::str::from_utf8(rest).ok().and_then(|text| text.parse().ok());
                components =
                    number.ok_or_else(|| self.cursor.syntax_at(here, "a number of components", rest))?;
            }
            let before = self.cursor.clone();
            if self.cursor.next_token() == Some(b"LOOKUP_TABLE") {
                self.cursor.token("the name of a lookup table")?;
            } else {
                self.cursor = before;
                // The cursor is already after the line end.
                return self.array(name, components, count, number, false);
            }
        }
        self.array(name, components, count, number, true)
    }

    fn array(
        &mut self,
        name: String,
        components: usize,
        count: usize,
        number: Number,
        line_end: bool,
    ) -> Result<(), IoError> {
        let length = self.product(count, components)?;
        if line_end && self.cursor.encoding != Encoding::Text {
            self.cursor.skip_line_end();
        }
        let values = self.reals_here(number, length, &format!("the array \"{name}\""))?;
        if components == 0 {
            return Ok(());
        }
        let array = DataArray { name, components, values };
        match self.site {
            Some((Site::Points, _)) => self.out.point_data.push(array),
            Some((Site::Cells, _)) => self.out.cell_data.push(array),
            None if ["TimeValue", "TIME"].contains(&array.name.as_str()) => {
                self.out.time = array.values.first().copied().filter(|time| time.is_finite());
            }
            None => {}
        }
        Ok(())
    }

    fn field(&mut self) -> Result<(), IoError> {
        self.cursor.token("the name of a field")?;
        let array_count = self.count("arrays of a field")?;
        for _ in 0..array_count {
            let mut word = self.cursor.token("the name of an array")?;
            if word == b"METADATA" {
                self.section(word)?;
                word = self.cursor.token("the name of an array")?;
            }
            let at = self.cursor.start();
            let name = name(word);
            let components = self.count("components")?;
            let tuples = self.count("tuples")?;
            let number = self.number_type()?;
            if self.site.is_some_and(|(_, count)| count != tuples) {
                let what =
                    format!("the array \"{name}\" has {tuples} tuples, another number than its section");
                return Err(self.cursor.inconsistent_at(at, what));
            }
            self.array(name, components, tuples, number, true)?;
        }
        Ok(())
    }

    fn finish(mut self, file_length: usize) -> Result<MeshFile, IoError> {
        let mut cells = CellReader::default();
        cells.set_points(0, self.out.mesh.points.len());
        for (keyword, code) in TOPOLOGIES {
            let Some(topology) = self.topologies.iter().find(|topology| topology.keyword == keyword) else {
                continue;
            };
            let place = || self.cursor.place_at(topology.at);
            if code.is_none() && self.types.as_ref().map(Vec::len) != Some(topology.ends.len()) {
                let what =
                    format!("there are {} cells, but another number of CELL_TYPES", topology.ends.len());
                return Err(self.cursor.inconsistent_at(topology.at, what));
            }
            let mut start = 0;
            for (i, &end) in topology.ends.iter().enumerate() {
                let code = code.unwrap_or_else(|| self.types.as_ref().map_or(0, |types| types[i]));
                cells.push(&mut self.out, self.cursor.file(), place, code, &topology.nodes[start..end])?;
                start = end;
            }
        }
        if self.out.mesh.points.is_empty() && self.out.mesh.blocks.is_empty() {
            return Err(self.cursor.truncated("the mesh: there are no POINTS"));
        }
        let sites = [
            (&self.out.point_data, self.out.mesh.points.len()),
            (&self.out.cell_data, cells.file_cell_count()),
        ];
        for (arrays, count) in sites {
            if let Some(array) = arrays.iter().find(|array| array.values.len() != count * array.components) {
                let found = array.values.len() / array.components;
                let what =
                    format!("the array \"{}\" has {found} tuples for {count} points or cells", array.name);
                return Err(self.cursor.inconsistent_at(self.cursor.position(), what));
            }
        }
        cells.finish(&mut self.out, 4 * file_length);
        groups::from_arrays(&mut self.out);
        Ok(self.out)
    }

    fn count(&mut self, what: &str) -> Result<usize, IoError> {
        let at = self.cursor.start();
        let count: u64 = self.cursor.text_number(&format!("the number of {what}"))?;
        usize::try_from(count).map_err(|_| self.cursor.inconsistent_at(at, format!("{count} {what}")))
    }

    fn product(&self, count: usize, components: usize) -> Result<usize, IoError> {
        count.checked_mul(components).ok_or_else(|| {
            self.cursor
                .inconsistent_at(self.cursor.position(), format!("{count} tuples of {components} components"))
        })
    }

    fn number_type(&mut self) -> Result<Number, IoError> {
        let at = self.cursor.start();
        let word = self.cursor.token("a type of numbers")?;
        Number::from_legacy(word).ok_or_else(|| {
            let what = format!("an array of the type {}", word.escape_ascii());
            self.cursor.unsupported_at(at, what, "leave it out, or save it as numbers")
        })
    }

    fn reals(&mut self, number: Number, count: usize, what: &str) -> Result<Vec<f64>, IoError> {
        if self.cursor.encoding != Encoding::Text {
            self.cursor.skip_line_end();
        }
        self.reals_here(number, count, what)
    }

    /// Reads `count` real numbers from the cursor on.
    fn reals_here(&mut self, number: Number, count: usize, what: &str) -> Result<Vec<f64>, IoError> {
        if number == Number::Real(4) && self.cursor.encoding == Encoding::Text {
            // Nine digits identify a float exactly, but not the double nearest to them.
            let values: Vec<f32> = self.numbers(number, count, what, |_, _| None)?;
            return Ok(values.into_iter().map(f64::from).collect());
        }
        self.numbers(number, count, what, |number, bytes| Some(number.reals(bytes, true)))
    }

    fn integers(&mut self, number: Number, count: usize, what: &str) -> Result<Vec<i64>, IoError> {
        if self.cursor.encoding != Encoding::Text {
            self.cursor.skip_line_end();
        }
        self.numbers(number, count, what, |number, bytes| number.integers(bytes, true))
    }

    /// Reads `count` numbers from the cursor on.
    fn numbers<T: std::str::FromStr>(
        &mut self,
        number: Number,
        count: usize,
        what: &str,
        decode: impl Fn(Number, &[u8]) -> Option<Vec<T>>,
    ) -> Result<Vec<T>, IoError> {
        if self.cursor.encoding == Encoding::Text {
            let mut values =
                Vec::with_capacity(self.cursor.count(count as u64, 2, &format!("numbers of {what}"))?);
            for _ in 0..count {
                values.push(self.cursor.text_number(what)?);
            }
            return Ok(values);
        }
        let at = self.cursor.start();
        let count = self.cursor.count(count as u64, number.width(), &format!("numbers of {what}"))?;
        let bytes = self.cursor.take(count * number.width(), what)?;
        decode(number, bytes)
            .ok_or_else(|| self.cursor.inconsistent_at(at, format!("{what} must be of an integer type")))
    }
}

/// Replaces the %-codes of a name.
fn name(word: &[u8]) -> String {
    let mut out = Vec::with_capacity(word.len());
    let mut rest = word;
    while let [first, tail @ ..] = rest {
        let code = match tail {
            [a, b, ..] if *first == b'%' => (*a as char).to_digit(16).zip((*b as char).to_digit(16)),
            _ => None,
        };
        match code {
            Some((high, low)) => {
                out.push((16 * high + low) as u8);
                rest = &tail[2..];
            }
            None => {
                out.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}
