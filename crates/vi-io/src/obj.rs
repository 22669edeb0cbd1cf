//! Reads Wavefront OBJ files: vertices, faces, lines, points, groups, texture coordinates.
//!
//! Source: Wavefront, "Object Files (.obj)", appendix B1 of the Advanced Visualizer manual.

use std::collections::BTreeMap;
use std::path::Path;

use crate::cursor::Cursor;
use crate::error::IoError;
use crate::mesh::{DataArray, MeshFile};
use vi_mesh::CellKind;
use vi_mesh::Region;

/// Reads an OBJ file that is in memory; `file` is used in messages only.
///
/// Faces of more than three corners are cut into triangles from their first corner, with a note. Groups (`g`), objects
/// (`o`) and materials (`usemtl`) become groups. Texture coordinates become the point array `uv` or, if a vertex has
/// several of them, the cell array `uv` of six components: u v of the three corners of each triangle. Normals and
/// free-form surfaces are ignored.
///
/// # Errors
/// Returns any [`IoError`] of reading, with the line.
pub fn parse_obj(bytes: &[u8], file: &Path) -> Result<MeshFile, IoError> {
    let mut cursor = Cursor::new(bytes, file);
    let mut obj = Obj::default();
    loop {
        let at = cursor.position();
        let Some(line) = cursor.line() else { break };
        obj.line(&cursor, at, line)?;
    }
    if obj.out.mesh.points.is_empty() {
        return Err(cursor.truncated("the mesh: there are no vertices"));
    }
    Ok(obj.finish())
}

#[derive(Default)]
struct Obj {
    out: MeshFile,
    textures: Vec<[f64; 2]>,
    /// Texture coordinates last given for each vertex, if any.
    uv: Vec<Option<u32>>,
    /// Texture coordinates of the corners of each cell; `None` for lines and points.
    corner_uv: Vec<[Option<u32>; 3]>,
    has_seams: bool,
    corners_without_uv: usize,
    cell_count: u32,
    divided: usize,
    groups: Vec<String>,
    object: Option<String>,
    material: Option<String>,
    members: BTreeMap<(String, usize), Vec<u32>>,
    memberships: usize,
    passed_over: BTreeMap<String, usize>,
}

impl Obj {
    fn line(&mut self, cursor: &Cursor, at: usize, line: &[u8]) -> Result<(), IoError> {
        let line = line.split(|&byte| byte == b'#').next().unwrap_or_default();
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let Some(keyword) = words.next() else { return Ok(()) };
        let rest = String::from_utf8_lossy(&line.trim_ascii()[keyword.len()..]).trim().to_string();
        match keyword {
            b"v" => {
                let x = numbers::<3>(cursor, at, words, "three coordinates of a vertex")?;
                if x.iter().any(|x| !x.is_finite()) {
                    let node = self.out.mesh.points.len() as u64 + 1;
                    return Err(IoError::NotFinite {
                        file: cursor.file().into(),
                        place: cursor.place_at(at),
                        node,
                        x,
                    });
                }
                self.out.mesh.points.push(x);
                self.uv.push(None);
            }
            b"vt" => {
                // The second coordinate may be missing and is then 0.
                let words: Vec<&[u8]> = words.chain([b"0".as_slice()]).collect();
                self.textures.push(numbers::<2>(cursor, at, words.into_iter(), "texture coordinates")?);
            }
            b"f" | b"l" | b"p" => {
                let mut corners = Vec::new();
                for word in words {
                    corners.push(self.corner(cursor, at, word, keyword == b"f")?);
                }
                self.cell(cursor, at, keyword, &corners)?;
            }
            b"g" => self.groups = rest.split_whitespace().map(str::to_string).collect(),
            b"o" => self.object = (!rest.is_empty()).then_some(rest),
            b"usemtl" => self.material = (!rest.is_empty()).then_some(rest),
            b"vn" | b"s" | b"mtllib" => {}
            other => {
                let word = String::from_utf8_lossy(&other[..other.len().min(20)]).into_owned();
                if !other.iter().all(|byte| byte.is_ascii_alphanumeric() || *byte == b'_') {
                    return Err(cursor.syntax_at(at, "an OBJ keyword (v, vt, f, l, g, …)", other));
                }
                *self.passed_over.entry(word).or_default() += 1;
            }
        }
        Ok(())
    }

    /// Reads a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`: its vertex and its texture coordinates.
    fn corner(
        &mut self,
        cursor: &Cursor,
        at: usize,
        word: &[u8],
        is_face: bool,
    ) -> Result<(u32, Option<u32>), IoError> {
        let mut parts = word.split(|&byte| byte == b'/');
        let vertex = index(cursor, at, parts.next().unwrap_or_default())?;
        let vertex = absolute(vertex, self.out.mesh.points.len()).ok_or_else(|| IoError::UnknownNode {
            file: cursor.file().into(),
            place: cursor.place_at(at),
            cell: u64::from(self.cell_count),
            node: vertex,
            node_count: self.out.mesh.points.len(),
        })?;
        let mut texture_of_corner = None;
        match parts.next().filter(|part| !part.is_empty()) {
            Some(part) => {
                let texture = index(cursor, at, part)?;
                let texture = absolute(texture, self.textures.len()).ok_or_else(|| {
                    let what =
                        format!("texture coordinate {texture} is not among the {}", self.textures.len());
                    cursor.inconsistent_at(at, what)
                })?;
                texture_of_corner = Some(texture);
                let before = self.uv[vertex as usize].replace(texture);
                let same = |before: u32| self.textures[before as usize] == self.textures[texture as usize];
                self.has_seams |= before.is_some_and(|before| !same(before));
            }
            None if is_face => self.corners_without_uv += 1,
            None => {}
        }
        Ok((vertex, texture_of_corner))
    }

    fn cell(
        &mut self,
        cursor: &Cursor,
        at: usize,
        keyword: &[u8],
        corners: &[(u32, Option<u32>)],
    ) -> Result<(), IoError> {
        let least = match keyword {
            b"f" => 3,
            b"l" => 2,
            _ => 1,
        };
        if corners.len() < least {
            let what = format!("an element has {} corners, at least {least} are needed", corners.len());
            return Err(cursor.inconsistent_at(at, what));
        }
        let first = self.cell_count;
        let dimension = least - 1;
        match keyword {
            b"f" => {
                for pair in corners[1..].windows(2) {
                    let triangle = [corners[0], pair[0], pair[1]];
                    self.out.mesh.push_cell(CellKind::Tri3, &triangle.map(|(vertex, _)| vertex));
                    self.corner_uv.push(triangle.map(|(_, texture)| texture));
                    self.cell_count += 1;
                }
                self.divided += usize::from(corners.len() > 3);
            }
            b"l" => {
                for pair in corners.windows(2) {
                    self.out.mesh.push_cell(CellKind::Line2, &[pair[0].0, pair[1].0]);
                    self.corner_uv.push([None; 3]);
                    self.cell_count += 1;
                }
            }
            _ => {
                for &(vertex, _) in corners {
                    self.out.mesh.push_cell(CellKind::Point, &[vertex]);
                    self.corner_uv.push([None; 3]);
                    self.cell_count += 1;
                }
            }
        }
        for name in self.groups.iter().chain(&self.object).chain(&self.material) {
            let made = (self.cell_count - first) as usize;
            self.memberships += made;
            // Memberships are the product of names and faces, so they are limited to one per byte of the file; valid
            // files stay far below.
            if self.memberships > cursor.position() + cursor.remaining() {
                return Err(cursor.unsupported_at(
                    at,
                    "so many groups on each face",
                    "put faces into fewer groups",
                ));
            }
            match self.members.get_mut(&(name.clone(), dimension)) {
                Some(cells) => cells.extend(first..self.cell_count),
                None => {
                    self.members.insert((name.clone(), dimension), (first..self.cell_count).collect());
                }
            }
        }
        Ok(())
    }

    fn finish(mut self) -> MeshFile {
        let notes = &mut self.out.notes;
        if self.divided > 0 {
            notes.push(format!("{} faces of more than three corners were cut into triangles", self.divided));
        }
        for (keyword, count) in &self.passed_over {
            notes.push(format!("{count} lines \"{keyword}\" were passed over"));
        }
        let with_uv = self.uv.iter().any(Option::is_some);
        if with_uv && self.corners_without_uv > 0 {
            notes.push("the texture coordinates are left out: a corner has none".into());
        } else if with_uv && self.has_seams {
            let value = |texture: &Option<u32>| texture.map_or([0.0; 2], |k| self.textures[k as usize]);
            let values = self.corner_uv.iter().flatten().flat_map(value).collect();
            self.out.cell_data.push(DataArray { name: "uv".into(), components: 6, values });
        } else if with_uv {
            let values = self
                .uv
                .iter()
                .flat_map(|uv| uv.map_or([0.0; 2], |texture| self.textures[texture as usize]))
                .collect();
            self.out.point_data.push(DataArray { name: "uv".into(), components: 2, values });
        }
        self.out.mesh.regions = self
            .members
            .into_iter()
            .map(|((name, dimension), mut cells)| {
                // A face may belong to one group twice, for instance as group and as object.
                cells.sort_unstable();
                cells.dedup();
                Region { name, dimension, cells }
            })
            .collect();
        self.out
    }
}

fn numbers<'a, const N: usize>(
    cursor: &Cursor,
    at: usize,
    mut words: impl Iterator<Item = &'a [u8]>,
    what: &str,
) -> Result<[f64; N], IoError> {
    let mut out = [0.0; N];
    for out in &mut out {
        let word = words.next().unwrap_or_default();
        let number = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        *out = number.ok_or_else(|| cursor.syntax_at(at, what, word))?;
    }
    Ok(out)
}

fn index(cursor: &Cursor, at: usize, word: &[u8]) -> Result<i64, IoError> {
    let number = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
    number.ok_or_else(|| cursor.syntax_at(at, "the number of a vertex", word))
}

/// Returns an index from 0 for a number that counts from 1 or, if negative, backwards from the last.
fn absolute(number: i64, count: usize) -> Option<u32> {
    let index = if number < 0 { i64::try_from(count).ok()?.checked_add(number)? } else { number - 1 };
    u32::try_from(index).ok().filter(|&index| (index as usize) < count)
}
