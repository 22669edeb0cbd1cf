//! Reads STL files, text and binary. There every facet has corners of its own; equal corners are welded here.
//!
//! Source: 3D Systems, "StereoLithography Interface Specification" (1989).

use std::collections::HashMap;
use std::path::Path;

use crate::cursor::{Cursor, Encoding};
use crate::error::IoError;
use crate::mesh::MeshFile;
use vi_mesh::CellKind;
use vi_mesh::Region;

/// Bytes of a binary facet: normal, three corners, an attribute.
const FACET: usize = 50;
/// Bytes before the first binary facet: a comment and the number of facets.
const HEAD: usize = 84;

/// Reads an STL file that is in memory; `file` is used in messages only.
///
/// Corners with exactly equal coordinates become one point, with a note. Facets with two equal corners are left out,
/// with a note. Named solids become groups. Normals are ignored.
///
/// # Errors
/// Returns any [`IoError`] of reading, with the line in a text and the byte offset in binary data.
pub fn parse_stl(bytes: &[u8], file: &Path) -> Result<MeshFile, IoError> {
    let mut cursor = Cursor::new(bytes, file);
    let mut stl = Stl::default();
    // Binary files may begin with "solid" too; their length distinguishes them.
    let announced =
        bytes.get(80..HEAD).map(|count| u32::from_le_bytes([count[0], count[1], count[2], count[3]]));
    let fits =
        announced.is_some_and(|count| bytes.len() as u64 == HEAD as u64 + FACET as u64 * u64::from(count));
    if !fits && bytes.trim_ascii_start().starts_with(b"solid") {
        stl.text(&mut cursor)?;
    } else {
        cursor.encoding = Encoding::Little;
        stl.binary(&mut cursor)?;
    }
    Ok(stl.finish())
}

#[derive(Default)]
struct Stl {
    out: MeshFile,
    /// Points by the bits of their coordinates.
    points: HashMap<[u64; 3], u32>,
    cell_count: u32,
    facet_count: usize,
}

impl Stl {
    fn facet(&mut self, cursor: &Cursor, at: usize, corners: [[f64; 3]; 3]) -> Result<(), IoError> {
        let mut nodes = [0; 3];
        for (node, x) in nodes.iter_mut().zip(corners) {
            if x.iter().any(|x| !x.is_finite()) {
                let number = 3 * self.facet_count as u64;
                let (file, place) = (cursor.file().into(), cursor.place_at(at));
                return Err(IoError::NotFinite { file, place, node: number, x });
            }
            // Replaces −0 by 0.
            let x = x.map(|x| x + 0.0);
            *node = *self.points.entry(x.map(f64::to_bits)).or_insert_with(|| {
                self.out.mesh.points.push(x);
                (self.out.mesh.points.len() - 1) as u32
            });
        }
        self.facet_count += 1;
        if nodes[0] != nodes[1] && nodes[1] != nodes[2] && nodes[2] != nodes[0] {
            self.out.mesh.push_cell(CellKind::Tri3, &nodes);
            self.cell_count += 1;
        }
        Ok(())
    }

    fn binary(&mut self, cursor: &mut Cursor) -> Result<(), IoError> {
        cursor.take(80, "the head of a binary STL file")?;
        let announced = cursor.int("the number of facets")? as u32;
        let count = cursor.count(announced.into(), FACET, "facets")?;
        for _ in 0..count {
            let at = cursor.position();
            let facet = cursor.take(FACET, "a facet")?;
            let (numbers, _) = facet.as_chunks::<4>();
            let x = |i: usize| f64::from(f32::from_le_bytes(numbers[3 + i]));
            let corners = [0, 3, 6].map(|i| [x(i), x(i + 1), x(i + 2)]);
            self.facet(cursor, at, corners)?;
        }
        if cursor.remaining() > 0 {
            self.out
                .notes
                .push(format!("{} bytes after the last facet were passed over", cursor.remaining()));
        }
        Ok(())
    }

    fn text(&mut self, cursor: &mut Cursor) -> Result<(), IoError> {
        while let Some(word) = cursor.next_token() {
            if !word.eq_ignore_ascii_case(b"solid") {
                return Err(cursor.syntax_at(cursor.position() - word.len(), "solid", word));
            }
            let name = String::from_utf8_lossy(cursor.line().unwrap_or_default().trim_ascii()).into_owned();
            let first = self.cell_count;
            loop {
                let word = cursor.token("a solid (there is no endsolid)")?;
                if word.eq_ignore_ascii_case(b"endsolid") {
                    cursor.line();
                    break;
                }
                let at = cursor.position() - word.len();
                if !word.eq_ignore_ascii_case(b"facet") {
                    return Err(cursor.syntax_at(at, "facet or endsolid", word));
                }
                expect(cursor, &["normal"])?;
                for _ in 0..3 {
                    cursor.text_number::<f64>("a normal")?;
                }
                expect(cursor, &["outer", "loop"])?;
                let mut corners = [[0.0; 3]; 3];
                for corner in &mut corners {
                    expect(cursor, &["vertex"])?;
                    for x in corner {
                        *x = cursor.text_number("a coordinate of a vertex")?;
                    }
                }
                expect(cursor, &["endloop", "endfacet"])?;
                self.facet(cursor, at, corners)?;
            }
            let cells: Vec<u32> = (first..self.cell_count).collect();
            if !name.is_empty() && !cells.is_empty() {
                match self.out.mesh.regions.iter_mut().find(|group| group.name == name) {
                    Some(group) => group.cells.extend(cells),
                    None => self.out.mesh.regions.push(Region { name, dimension: 2, cells }),
                }
            }
        }
        Ok(())
    }

    fn finish(mut self) -> MeshFile {
        let notes = &mut self.out.notes;
        if self.facet_count > 0 {
            let points = self.out.mesh.points.len();
            notes.push(format!(
                "the {} corners of the facets were welded into {points} points",
                3 * self.facet_count
            ));
        }
        let degenerate = self.facet_count - self.cell_count as usize;
        if degenerate > 0 {
            notes.push(format!("{degenerate} facets with coinciding corners were left out"));
        }
        self.out
    }
}

fn expect(cursor: &mut Cursor, words: &[&str]) -> Result<(), IoError> {
    for expected in words {
        let found = cursor.token(expected)?;
        if !found.eq_ignore_ascii_case(expected.as_bytes()) {
            return Err(cursor.syntax_at(cursor.position() - found.len(), *expected, found));
        }
    }
    Ok(())
}
