//! Reads `$NodeData` and `$ElementData`: values at tagged nodes or elements.

use crate::cursor::{Cursor, Encoding};
use crate::error::IoError;
use crate::mesh::{DataArray, MeshFile};
use crate::tags::TagIndex;

/// The entities that the values of a view belong to.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Site {
    Points,
    Cells,
}

/// The values of a view as the file holds them.
pub(super) struct View {
    pub(super) site: Site,
    name: String,
    components: usize,
    tags: Vec<u64>,
    values: Vec<f64>,
}

/// Reads a view, whose header is text in binary files too.
pub(super) fn read(cursor: &mut Cursor, site: Site) -> Result<Option<View>, IoError> {
    let start = cursor.position();
    let string_count: u64 = cursor.text_number("the number of strings of a view")?;
    let string_count = cursor.count(string_count, 1, "strings of a view")?;
    cursor.line();
    let mut name = String::new();
    for i in 0..string_count {
        let line = cursor.line().ok_or_else(|| cursor.truncated("the name of a view"))?;
        if i == 0 {
            name = String::from_utf8_lossy(line.trim_ascii()).trim_matches('"').to_string();
        }
    }
    let real_count: u64 = cursor.text_number("the number of reals of a view")?;
    for _ in 0..cursor.count(real_count, 2, "reals of a view")? {
        cursor.text_number::<f64>("a real of a view")?;
    }
    let integer_count: u64 = cursor.text_number("the number of integers of a view")?;
    let mut integers = [0u64; 3];
    for i in 0..cursor.count(integer_count, 2, "integers of a view")? {
        let value = cursor.text_number::<i64>("an integer of a view")?;
        if i < 3 {
            integers[i] = u64::try_from(value).unwrap_or(u64::MAX);
        }
    }
    let [_, components, entries] = integers;
    if ![1, 3, 9].contains(&components) {
        return Err(cursor
            .inconsistent_at(start, format!("a view has {components} components (1, 3 or 9 are possible)")));
    }
    let text = cursor.encoding == Encoding::Text;
    let components = components as usize;
    let entries = cursor.count(
        entries,
        if text { 2 * (1 + components) } else { 4 + 8 * components },
        "values of a view",
    )?;
    if !text {
        cursor.skip_line_end();
    }
    let mut tags = Vec::with_capacity(entries);
    let mut values = Vec::with_capacity(entries * components);
    for _ in 0..entries {
        tags.push(cursor.int("the tag of a value")? as u64);
        for _ in 0..components {
            values.push(cursor.real("a value of a view")?);
        }
    }
    Ok(Some(View { site, name, components, tags, values }))
}

impl View {
    /// Assigns the values to points or cells, of which there are `count`, by their tags. Entities without a value get
    /// 0, with a note. A view with values for less than an eighth of them is left out, because it would need far more
    /// memory than the file.
    pub(super) fn place(self, index: &TagIndex, count: usize, out: &mut MeshFile) {
        let site = if self.site == Site::Points { "nodes" } else { "elements" };
        if self.tags.len() < count.div_ceil(8) {
            let note = format!(
                "the view \"{}\" has values at {} of {count} {site}: left out",
                self.name,
                self.tags.len()
            );
            out.notes.push(note);
            return;
        }
        let mut values = vec![0.0; count * self.components];
        let mut set = vec![false; count];
        let mut unknown = 0;
        for (tag, value) in self.tags.iter().zip(self.values.chunks_exact(self.components)) {
            match index.get(*tag) {
                Some(i) => {
                    let i = i as usize;
                    values[i * self.components..(i + 1) * self.components].copy_from_slice(value);
                    set[i] = true;
                }
                None => unknown += 1,
            }
        }
        if unknown > 0 {
            out.notes.push(format!(
                "the view \"{}\" has {unknown} values at {site} that do not exist: left out",
                self.name
            ));
        }
        let missing = set.iter().filter(|set| !**set).count();
        if missing > 0 {
            out.notes.push(format!(
                "the view \"{}\" lacks values at {missing} of {count} {site}: taken as 0",
                self.name
            ));
        }
        let data = if self.site == Site::Points { &mut out.point_data } else { &mut out.cell_data };
        let array = DataArray { name: self.name, components: self.components, values };
        match data.iter_mut().find(|other| other.name == array.name) {
            Some(other) => {
                out.notes
                    .push(format!("the view \"{}\" occurs several times: the last is taken", array.name));
                *other = array;
            }
            None => data.push(array),
        }
    }
}
