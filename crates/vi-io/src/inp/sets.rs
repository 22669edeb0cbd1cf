//! Makes groups of cells from the node sets, element sets and surfaces of an Abaqus input file.

use std::collections::{HashMap, HashSet};

use super::elements::side;
use super::keyword::{Keyword, fields, label};
use super::reading::{Definition, Element, Of, Reading};
use crate::cursor::{Cursor, shown};
use crate::error::IoError;
use crate::mesh::MeshFile;
use crate::tags::TagIndex;
use vi_mesh::CellKind;
use vi_mesh::Region;

impl<'a> Reading<'a> {
    pub(super) fn define(&mut self, of: Of, name: &'a [u8], keyword: &Keyword<'a>) {
        self.definitions.push(Definition {
            of,
            name,
            at: keyword.at,
            is_internal: keyword.has("INTERNAL"),
            numbers: Vec::new(),
            ranges: Vec::new(),
            names: Vec::new(),
        });
    }

    /// Adds a number to the latest set, if `in_set` is true.
    pub(super) fn list(&mut self, number: u64, in_set: bool) {
        if let Some(set) = self.definitions.last_mut().filter(|_| in_set) {
            set.numbers.push(number);
        }
    }

    /// Reads a line of a set: numbers and names of other sets, or a range.
    pub(super) fn items(
        &mut self,
        cursor: &Cursor<'a>,
        at: usize,
        line: &'a [u8],
        generate: bool,
    ) -> Result<(), IoError> {
        let Some(set) = self.definitions.last_mut() else { return Ok(()) };
        if generate {
            let mut range = [0, 0, 1];
            for (value, word) in range.iter_mut().zip(fields(line)) {
                *value = label(cursor, at, word, "a number of a range")?;
            }
            if range[0] > range[1] {
                return Err(cursor.syntax_at(at, "a range: first, last, increment", line));
            }
            set.ranges.push(range);
            return Ok(());
        }
        for word in fields(line).filter(|word| !word.is_empty()) {
            match word[0].is_ascii_digit() {
                true => set.numbers.push(label(cursor, at, word, "a number of a set")?),
                false => set.names.push((word, b"")),
            }
        }
        Ok(())
    }

    /// Reads a line of a surface: an element or element set with its side, or a node or node set.
    pub(super) fn faces(&mut self, cursor: &Cursor<'a>, at: usize, line: &'a [u8]) -> Result<(), IoError> {
        let mut words = fields(line);
        let (who, side) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        if who.is_empty() {
            return Err(cursor.syntax_at(at, "an element or a set, and its side", line));
        }
        if let Some(surface) = self.definitions.last_mut() {
            surface.names.push((who, side));
        }
        Ok(())
    }
}

/// The kind and the name of a set, in upper case because names are case-insensitive.
type Key = (Of, Vec<u8>);

fn key(of: Of, name: &[u8]) -> Key {
    (of, name.to_ascii_uppercase())
}

/// Finds the members of all sets, and adds them to the mesh as groups.
pub(super) fn add_groups(
    reading: Reading<'_>,
    cursor: &Cursor,
    nodes: &TagIndex,
    cells: &TagIndex,
) -> Result<MeshFile, IoError> {
    let Reading { mut out, definitions, elements, shapeless, .. } = reading;
    let mut members = Members {
        cursor,
        nodes,
        cells,
        elements: &elements,
        shapeless: &shapeless,
        // Sets of sets and ranges can multiply, so the members are limited to one per byte of the file; valid files
        // stay far below.
        room: cursor.position() + cursor.remaining(),
        of: HashMap::new(),
        sides: Vec::new(),
        missing: 0,
    };
    for (number, definition) in definitions.iter().enumerate() {
        members.add(number as u32, definition)?;
    }
    if members.missing > 0 {
        let missing = members.missing;
        out.notes
            .push(format!("{missing} numbers in ranges of sets (GENERATE) belong to no node or element"));
    }
    let Members { mut of, sides, .. } = members;
    for (number, cell) in add_sides(&mut out, &elements, sides) {
        of.entry(key(Of::Faces, definitions[number as usize].name)).or_default().push(cell);
    }
    for members in of.values_mut() {
        members.sort_unstable();
        members.dedup();
    }
    drop_node_sets_of_groups(&out, &mut of);
    let names = names(&definitions, &of, &mut out.notes);
    let points = add_points(&mut out, &definitions, &of);
    let dimensions: Vec<u8> = out.mesh.cells().map(|(kind, _)| kind.dimension() as u8).collect();
    let mut groups: Vec<Region> = Vec::new();
    for (definition, name) in definitions.iter().zip(names).filter(|(definition, _)| !definition.is_internal)
    {
        let key = key(definition.of, definition.name);
        let Some(mut members) = of.remove(&key) else { continue };
        if definition.of == Of::Nodes {
            members.iter_mut().for_each(|node| *node = points[node]);
        }
        if members.is_empty() {
            out.notes.push(format!("the set \"{name}\" is empty"));
        }
        for dimension in 0..4 {
            let is_of = |cell: &u32| dimensions[*cell as usize] == dimension;
            let cells: Vec<u32> = members.iter().copied().filter(is_of).collect();
            if !cells.is_empty() {
                groups.push(Region { name: name.clone(), dimension: dimension.into(), cells });
            }
        }
    }
    out.mesh.regions = groups;
    Ok(out)
}

/// Drops a node set that has the name of an element set or surface and exactly its nodes: it is the same region.
fn drop_node_sets_of_groups(out: &MeshFile, of: &mut HashMap<Key, Vec<u32>>) {
    let cells: Vec<&[u32]> = out.mesh.cells().map(|(_, nodes)| nodes).collect();
    let nodes_of = |members: &Vec<u32>| {
        let mut nodes: Vec<u32> =
            members.iter().flat_map(|&cell| cells[cell as usize].iter().copied()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    };
    let others = |name: &Vec<u8>| [Of::Elements, Of::Faces].map(|kind| (kind, name.clone()));
    let is_double = |((kind, name), nodes): &(&Key, &Vec<u32>)| {
        let others: Vec<_> = others(name).iter().filter_map(|other| of.get(other)).collect();
        *kind == Of::Nodes && !others.is_empty() && others.iter().all(|members| nodes_of(members) == **nodes)
    };
    let doubles: Vec<Key> = of.iter().filter(is_double).map(|(key, _)| key.clone()).collect();
    for double in doubles {
        of.remove(&double);
    }
}

/// Returns the name of the group of each definition: that of the set, with a suffix if several kinds of sets share it.
fn names(
    definitions: &[Definition<'_>],
    of: &HashMap<Key, Vec<u32>>,
    notes: &mut Vec<String>,
) -> Vec<String> {
    let mut kinds: HashMap<Vec<u8>, Vec<Of>> = HashMap::new();
    let mut spelled: HashMap<Vec<u8>, String> = HashMap::new();
    let is_group = |set: &&Definition<'_>| !set.is_internal && of.contains_key(&key(set.of, set.name));
    for definition in definitions.iter().filter(is_group) {
        let upper = definition.name.to_ascii_uppercase();
        spelled.entry(upper.clone()).or_insert_with(|| String::from_utf8_lossy(definition.name).into_owned());
        let kinds = kinds.entry(upper).or_default();
        if !kinds.contains(&definition.of) {
            kinds.push(definition.of);
        }
    }
    let mut shared: Vec<&String> =
        kinds.iter().filter(|(_, kinds)| kinds.len() > 1).map(|(upper, _)| &spelled[upper]).collect();
    shared.sort();
    for name in shared {
        let name = shown(name);
        notes.push(format!(
            "\"{name}\" names several sets; they are the regions \"{name}.nodes\", \"{name}.elements\" and \
             \"{name}.surface\", where these exist"
        ));
    }
    let name = |definition: &Definition<'_>| {
        let upper = definition.name.to_ascii_uppercase();
        let spelled = spelled.get(&upper).cloned().unwrap_or_default();
        let is_shared = kinds.get(&upper).is_some_and(|kinds| kinds.len() > 1);
        if is_shared { format!("{spelled}.{}", definition.of.ending()) } else { spelled }
    };
    definitions.iter().map(name).collect()
}

/// Side number that stands for the cell itself.
const WHOLE: u8 = u8::MAX;

/// Adds the sides as cells, each once. Returns the cell of each side, with its definition.
fn add_sides(out: &mut MeshFile, elements: &[Element], mut sides: Vec<(u32, u8, u32)>) -> Vec<(u32, u32)> {
    let mut first = vec![0; elements.len()];
    let mut next = 0;
    for (first, element) in first.iter_mut().zip(elements) {
        *first = next;
        next += element.kind.node_count();
    }
    let corners: Vec<u32> = out.mesh.blocks.iter().flat_map(|block| block.nodes.iter().copied()).collect();
    sides.sort_unstable();
    sides.dedup();
    let mut found = Vec::with_capacity(sides.len());
    let (mut count, mut last) = (elements.len() as u32, None);
    for (cell, number, definition) in sides {
        if number == WHOLE {
            found.push((definition, cell));
            continue;
        }
        if last != Some((cell, number)) {
            let kind = elements[cell as usize].kind;
            let Some((kind, local)) = side(kind, number.into()) else { continue };
            let own = &corners[first[cell as usize]..];
            let nodes: Vec<u32> = local.iter().map(|&k| own[k]).collect();
            out.mesh.push_cell(kind, &nodes);
            count += 1;
            last = Some((cell, number));
        }
        found.push((definition, count - 1));
    }
    found
}

/// Adds a point cell for each node that is in a set. Returns the cell of each node.
fn add_points(
    out: &mut MeshFile,
    definitions: &[Definition<'_>],
    of: &HashMap<Key, Vec<u32>>,
) -> HashMap<u32, u32> {
    let seen = definitions.iter().filter(|set| set.of == Of::Nodes && !set.is_internal);
    let mut nodes: Vec<u32> =
        seen.filter_map(|set| of.get(&key(Of::Nodes, set.name))).flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let first = out.mesh.cell_count() as u32;
    for &node in &nodes {
        out.mesh.push_cell(CellKind::Point, &[node]);
    }
    nodes.into_iter().zip(first..).collect()
}

/// The members of the sets resolved so far.
struct Members<'a> {
    cursor: &'a Cursor<'a>,
    nodes: &'a TagIndex,
    cells: &'a TagIndex,
    elements: &'a [Element],
    shapeless: &'a HashSet<u64>,
    /// Number of members that may still be added.
    room: usize,
    /// Indices of nodes or elements, by set.
    of: HashMap<Key, Vec<u32>>,
    /// Sides of surfaces: cell, side, number of the definition.
    sides: Vec<(u32, u8, u32)>,
    /// Number of members of ranges that do not exist.
    missing: usize,
}

impl Members<'_> {
    fn add(&mut self, number: u32, definition: &Definition<'_>) -> Result<(), IoError> {
        if definition.of == Of::Faces {
            for &(who, side) in &definition.names {
                self.add_sides(number, definition, who, side)?;
            }
            return Ok(());
        }
        let mut members = Vec::new();
        self.take(definition.at, definition.numbers.len())?;
        for &tag in &definition.numbers {
            members.extend(self.place(definition, tag)?);
        }
        for &[first, last, increment] in &definition.ranges {
            let count = usize::try_from((last - first) / increment).unwrap_or(usize::MAX);
            self.take(definition.at, count.saturating_add(1))?;
            for tag in (first..=last).step_by(increment as usize) {
                match self.index(definition.of).get(tag) {
                    Some(place) => members.push(place),
                    None => self.missing += 1,
                }
            }
        }
        for &(name, _) in &definition.names {
            let number = std::str::from_utf8(name).ok().and_then(|text| text.parse().ok());
            match number {
                Some(tag) => members.extend(self.place(definition, tag)?),
                None => {
                    let count = self.set(definition, definition.of, name)?.len();
                    self.take(definition.at, count)?;
                    members.extend(self.set(definition, definition.of, name)?);
                }
            }
        }
        self.of.entry(key(definition.of, definition.name)).or_default().extend(members);
        Ok(())
    }

    /// Counts `count` members against the limit.
    fn take(&mut self, at: usize, count: usize) -> Result<(), IoError> {
        self.room = self.room.checked_sub(count).ok_or_else(|| {
            let remedy = "give every node and element to fewer sets";
            self.cursor.unsupported_at(at, "sets of so many members", remedy)
        })?;
        Ok(())
    }

    fn index(&self, of: Of) -> &TagIndex {
        if of == Of::Nodes { self.nodes } else { self.cells }
    }

    /// Returns the index of a node or element; `None` for an element without a cell.
    fn place(&self, definition: &Definition<'_>, tag: u64) -> Result<Option<u32>, IoError> {
        let what = if definition.of == Of::Nodes { "node" } else { "element" };
        match self.index(definition.of).get(tag) {
            Some(place) => Ok(Some(place)),
            None if definition.of != Of::Nodes && self.shapeless.contains(&tag) => Ok(None),
            None => Err(self.wrong(definition, &format!("names {what} {tag}, which is not in the file"))),
        }
    }

    /// Returns the members of a set defined before. Its name may be prefixed by an instance.
    fn set(&self, definition: &Definition<'_>, of: Of, name: &[u8]) -> Result<&Vec<u32>, IoError> {
        let short = name.iter().rposition(|&byte| byte == b'.').map_or(name, |dot| &name[dot + 1..]);
        let found = [name, short].into_iter().find_map(|name| self.of.get(&key(of, name)));
        found.ok_or_else(|| {
            let name = String::from_utf8_lossy(name).into_owned();
            self.wrong(definition, &format!("names the set \"{name}\", which is not defined before it"))
        })
    }

    fn wrong(&self, definition: &Definition<'_>, what: &str) -> IoError {
        let name = String::from_utf8_lossy(definition.name).into_owned();
        self.cursor.inconsistent_at(definition.at, format!("the set \"{name}\" {what}"))
    }

    fn add_sides(
        &mut self,
        number: u32,
        definition: &Definition<'_>,
        who: &[u8],
        word: &[u8],
    ) -> Result<(), IoError> {
        let cells: Vec<u32> = match std::str::from_utf8(who).ok().and_then(|text| text.parse().ok()) {
            Some(tag) => self.place(definition, tag)?.into_iter().collect(),
            None => self.set(definition, Of::Elements, who)?.clone(),
        };
        self.take(definition.at, cells.len())?;
        for cell in cells {
            let element = &self.elements[cell as usize];
            let Some(side) = side_of(element, word) else {
                let word = String::from_utf8_lossy(word).to_ascii_uppercase();
                let what = match word.as_str() {
                    "" => format!("does not say which side of element {} (S1, S2 …)", element.tag),
                    word => format!("names the side {word} of element {}, which has none", element.tag),
                };
                return Err(self.wrong(definition, &what));
            };
            self.sides.push((cell, side, number));
        }
        Ok(())
    }
}

/// Returns the side of an element that a surface names: S1 … is a face of a solid or an edge of a plane element, SPOS
/// and SNEG (or S1 and S2) a shell itself, E1 … or S3 … its edges. `None` if there is no such side.
fn side_of(element: &Element, word: &[u8]) -> Option<u8> {
    let word = word.to_ascii_uppercase();
    let numbered = |letter: u8| {
        let digits = word.strip_prefix(&[letter])?;
        let number: u8 = std::str::from_utf8(digits).ok()?.parse().ok()?;
        number.checked_sub(1)
    };
    let number = match (element.kind.dimension(), word.as_slice()) {
        (2, b"" | b"SPOS" | b"SNEG") => return Some(WHOLE),
        (2, _) if element.is_plane => numbered(b'S').or_else(|| numbered(b'E'))?,
        (2, _) => match numbered(b'S') {
            Some(0 | 1) => return Some(WHOLE),
            Some(number) => number - 2,
            None => numbered(b'E')?,
        },
        (3, _) => numbered(b'S')?,
        _ => return None,
    };
    side(element.kind, number.into()).map(|_| number)
}
