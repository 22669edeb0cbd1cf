//! Reads the mesh of Abaqus and CalculiX input files (.inp): nodes, elements, sets and surfaces. Groups are made from
//! sets and surfaces in `sets.rs`; the types of elements are in `elements.rs`.
//!
//! Source: Abaqus Keywords Reference Guide; CalculiX CrunchiX User's Manual, "Input deck format".

mod elements;
mod keyword;
mod reading;
mod sets;

use std::path::Path;

use crate::cursor::{Cursor, shown};
use crate::error::IoError;
use crate::mesh::MeshFile;
use crate::tags::TagIndex;
use elements::{Meaning, READ, meaning};
use keyword::{Keyword, fields, label, next_line};
use reading::{Element, Of, Reading};
use vi_mesh::CellKind;

/// Reads an Abaqus or CalculiX input file that is in memory; `file` is used in messages only.
///
/// Nodes keep the order of the file. Elements of shells, membranes and plane problems become surface cells, trusses and
/// beams become lines. Element sets become groups of their cells, node sets groups of points, and surfaces groups of
/// faces, which become cells of their own. If a node set, an element set or a surface share a name, the groups are
/// called `<name>.nodes`, `<name>.elements` and `<name>.surface`. Materials, sections, steps and everything else
/// outside the mesh are left out, with a note that names them. Memory stays below 64 times the size of the file.
///
/// # Errors
/// Returns any [`IoError`] of reading, with the line, for example [`IoError::Unsupported`] for keywords that would
/// change the mesh and are not supported (`*INCLUDE`, several parts, moved instances, generated nodes).
pub fn parse_inp(bytes: &[u8], file: &Path) -> Result<MeshFile, IoError> {
    let mut cursor = Cursor::new(bytes, file);
    let mut reading = Reading::default();
    let mut section = Section::Start;
    while let Some((at, line)) = next_line(&mut cursor) {
        if line.starts_with(b"*") {
            reading.expect_whole_element(&cursor)?;
            let keyword = Keyword::read(&mut cursor, at, line)?;
            section = reading.open(&cursor, &keyword)?;
        } else {
            reading.data(&cursor, at, line, &section)?;
        }
    }
    reading.expect_whole_element(&cursor)?;
    reading.finish(&cursor)
}

/// Kind of the data lines that follow a keyword.
enum Section {
    /// No keyword was read yet.
    Start,
    Nodes {
        /// If true, the nodes join the set that was defined last.
        in_set: bool,
    },
    Elements {
        code: String,
        kind: CellKind,
        in_set: bool,
    },
    /// Elements without a cell.
    Shapeless,
    /// Lines of the set or surface that was defined last.
    Set {
        generate: bool,
    },
    Surface,
    /// Lines that are ignored.
    PassedOver,
    /// Data lines are refused as an unsupported feature, which this text names.
    Empty(&'static str),
}

const FLAT: &str = "write the mesh flat: one part, nodes in global coordinates, everything in one file";

impl<'a> Reading<'a> {
    /// Begins the section of a keyword.
    fn open(&mut self, cursor: &Cursor<'a>, keyword: &Keyword<'a>) -> Result<Section, IoError> {
        let refuse = |what: &str| Err(cursor.unsupported_at(keyword.at, what, FLAT));
        if keyword.value("INPUT").is_some() {
            return refuse("data in another file (INPUT=)");
        }
        match keyword.name.as_str() {
            "INCLUDE" => return refuse("*INCLUDE"),
            "NGEN" | "NFILL" | "NCOPY" | "NMAP" | "ELGEN" | "ELCOPY" | "PARAMETER" => {
                return refuse(&format!("*{}, which makes a part of the mesh,", keyword.name));
            }
            "NODE" => {
                let is_curved = |system: &&[u8]| !matches!(**system, [] | [b'R' | b'r']);
                if keyword.value("SYSTEM").as_ref().is_some_and(is_curved) {
                    return refuse("nodes in cylindrical or spherical coordinates (SYSTEM=)");
                }
                let set = keyword.value("NSET");
                if let Some(name) = set {
                    self.define(Of::Nodes, name, keyword);
                }
                return Ok(Section::Nodes { in_set: set.is_some() });
            }
            "ELEMENT" => return self.open_elements(cursor, keyword),
            "NSET" | "ELSET" => {
                let of = if keyword.name == "NSET" { Of::Nodes } else { Of::Elements };
                let Some(name) = keyword.value(&keyword.name) else {
                    return Err(cursor.syntax_at(keyword.at, format!("{}=<name>", keyword.name), b""));
                };
                self.define(of, name, keyword);
                return Ok(Section::Set { generate: keyword.has("GENERATE") });
            }
            "SURFACE" => {
                let Some(name) = keyword.value("NAME") else {
                    return Err(cursor.syntax_at(keyword.at, "NAME=<name>", b""));
                };
                let kind = keyword.value("TYPE").unwrap_or(b"ELEMENT").to_ascii_uppercase();
                return Ok(match kind.as_slice() {
                    b"ELEMENT" => {
                        self.define(Of::Faces, name, keyword);
                        Section::Surface
                    }
                    b"NODE" => {
                        self.define(Of::Nodes, name, keyword);
                        // A line may name a node and an area, which is ignored.
                        Section::Surface
                    }
                    _ => {
                        let kind = String::from_utf8_lossy(&kind).into_owned();
                        self.left_out.insert(shown(&format!("SURFACE of type {kind}")));
                        Section::PassedOver
                    }
                });
            }
            "PART" => {
                self.parts += 1;
                if self.parts > 1 {
                    return refuse("a second *PART");
                }
            }
            "INSTANCE" => {
                self.instances += 1;
                if self.instances > 1 {
                    return refuse("a second *INSTANCE");
                }
                return Ok(Section::Empty("an instance that is moved"));
            }
            "SYSTEM" => return Ok(Section::Empty("nodes in a system of their own")),
            "HEADING" | "PREPRINT" | "END PART" | "ASSEMBLY" | "END INSTANCE" | "END ASSEMBLY" => {}
            name => {
                self.left_out.insert(shown(name));
            }
        }
        Ok(Section::PassedOver)
    }

    fn open_elements(&mut self, cursor: &Cursor<'a>, keyword: &Keyword<'a>) -> Result<Section, IoError> {
        let Some(code) = keyword.value("TYPE") else {
            return Err(cursor.syntax_at(keyword.at, "TYPE=<element type>", b""));
        };
        let code = shown(&String::from_utf8_lossy(&code.to_ascii_uppercase()));
        let kind = match meaning(&code) {
            Meaning::Cell(kind) => kind,
            Meaning::Shapeless => {
                self.left_out.insert(format!("ELEMENT of type {code}"));
                return Ok(Section::Shapeless);
            }
            Meaning::Unknown => {
                return Err(cursor.unsupported_at(keyword.at, format!("the element type \"{code}\""), READ));
            }
        };
        let set = keyword.value("ELSET");
        if let Some(name) = set {
            self.define(Of::Elements, name, keyword);
        }
        Ok(Section::Elements { code, kind, in_set: set.is_some() })
    }

    /// Reads one line of data.
    fn data(
        &mut self,
        cursor: &Cursor<'a>,
        at: usize,
        line: &'a [u8],
        section: &Section,
    ) -> Result<(), IoError> {
        match section {
            Section::Start => Err(cursor.syntax_at(at, "a keyword such as *NODE", line)),
            Section::Nodes { in_set } => self.node(cursor, at, line, *in_set),
            Section::Elements { code, kind, in_set } => {
                self.element(cursor, at, line, (code, *kind), *in_set)
            }
            Section::Shapeless => {
                if let Some(first) = fields(line).next() {
                    self.shapeless.insert(label(cursor, at, first, "the number of an element")?);
                }
                Ok(())
            }
            Section::Set { generate } => self.items(cursor, at, line, *generate),
            Section::Surface => self.faces(cursor, at, line),
            Section::PassedOver => Ok(()),
            Section::Empty(what) => Err(cursor.unsupported_at(at, *what, FLAT)),
        }
    }

    fn node(&mut self, cursor: &Cursor<'a>, at: usize, line: &[u8], in_set: bool) -> Result<(), IoError> {
        let mut words = fields(line);
        let tag = label(cursor, at, words.next().unwrap_or_default(), "the number of a node")?;
        let mut x = [0.0; 3];
        // Missing coordinates are 0.
        for (x, word) in x.iter_mut().zip(words) {
            *x = if word.is_empty() { 0.0 } else { keyword::real(cursor, at, word, "a coordinate")? };
        }
        if x.iter().any(|x| !x.is_finite()) {
            let (file, place) = (cursor.file().into(), cursor.place_at(at));
            return Err(IoError::NotFinite { file, place, node: tag, x });
        }
        self.out.mesh.points.push(x);
        self.node_tags.push(tag);
        self.list(tag, in_set);
        Ok(())
    }

    /// Reads one line of an element, whose nodes may continue over several lines. The last node ends its line.
    fn element(
        &mut self,
        cursor: &Cursor<'a>,
        at: usize,
        line: &[u8],
        (code, kind): (&str, CellKind),
        in_set: bool,
    ) -> Result<(), IoError> {
        if self.unfinished.is_empty() {
            self.unfinished_at = at;
        }
        for word in fields(line) {
            let what = if self.unfinished.is_empty() { "the number of an element" } else { "a node number" };
            self.unfinished.push(label(cursor, at, word, what)?);
        }
        let (found, needed) = (self.unfinished.len(), 1 + kind.node_count());
        if found > needed {
            let what = format!(
                "element {} of type {code} has {} nodes, {} are needed",
                self.unfinished[0],
                found - 1,
                needed - 1
            );
            return Err(cursor.inconsistent_at(self.unfinished_at, what));
        }
        if found < needed {
            return Ok(());
        }
        let is_plane = code.starts_with("CP");
        let tag = self.unfinished[0];
        self.elements.push(Element { tag, at: self.unfinished_at, kind, is_plane });
        self.corners.extend_from_slice(&self.unfinished[1..]);
        self.unfinished.clear();
        if kind.dimension() == 1 {
            *self.lines.entry(code.to_owned()).or_default() += 1;
        }
        self.list(tag, in_set);
        Ok(())
    }

    fn expect_whole_element(&self, cursor: &Cursor<'a>) -> Result<(), IoError> {
        match self.unfinished.first() {
            None => Ok(()),
            Some(tag) => {
                let what = format!("element {tag} has only {} nodes", self.unfinished.len() - 1);
                Err(cursor.inconsistent_at(self.unfinished_at, what))
            }
        }
    }

    fn finish(mut self, cursor: &Cursor<'a>) -> Result<MeshFile, IoError> {
        if self.node_tags.is_empty() || self.elements.is_empty() {
            return Err(cursor.truncated("the mesh: there is no *NODE or no *ELEMENT with a shape"));
        }
        let twice = |what: &str, tag: u64, at: usize| {
            cursor.inconsistent_at(at, format!("the {what} number {tag} occurs twice"))
        };
        let nodes = TagIndex::new(&self.node_tags)
            .map_err(|i| twice("node", self.node_tags[i], cursor.position()))?;
        let tags: Vec<u64> = self.elements.iter().map(|element| element.tag).collect();
        let cells = TagIndex::new(&tags).map_err(|i| twice("element", tags[i], self.elements[i].at))?;
        let mut corners = self.corners.iter();
        for element in &self.elements {
            let mut own = [0; 27];
            let own = &mut own[..element.kind.node_count()];
            for (own, &tag) in own.iter_mut().zip(&mut corners) {
                *own = nodes.get(tag).ok_or_else(|| IoError::UnknownNode {
                    file: cursor.file().into(),
                    place: cursor.place_at(element.at),
                    cell: element.tag,
                    node: tag as i64,
                    node_count: self.node_tags.len(),
                })?;
            }
            self.out.mesh.push_cell(element.kind, own);
        }
        for (code, count) in &self.lines {
            let note = format!(
                "{count} elements of type {code} are read as lines, which have no stiffness or mass here"
            );
            self.out.notes.push(note);
        }
        self.note_what_is_left_out();
        sets::add_groups(self, cursor, &nodes, &cells)
    }

    fn note_what_is_left_out(&mut self) {
        const MOST: usize = 12;
        if self.left_out.is_empty() {
            return;
        }
        let names: Vec<String> = self.left_out.iter().take(MOST).map(|name| format!("*{name}")).collect();
        let more = self.left_out.len().saturating_sub(MOST);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        self.out.notes.push(format!(
            "left out: {}{more}; materials, supports and loads are those of the scene",
            names.join(", ")
        ));
    }
}
