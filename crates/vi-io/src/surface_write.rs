//! Writes surfaces of triangles with texture coordinates as OBJ and PLY files.
//!
//! Source: Wavefront, "Object Files (.obj)"; G. Turk, "The PLY polygon file format" (1994).

use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

use crate::error::IoError;
use crate::replace::replace_file;

/// A surface to write.
#[derive(Clone, Copy, Debug)]
pub struct TriangleSurface<'a> {
    /// Name of the object.
    pub name: &'a str,
    /// Coordinates, m.
    pub points: &'a [[f64; 3]],
    /// Points of each triangle.
    pub triangles: &'a [[u32; 3]],
    /// Texture coordinates at the corners of each triangle.
    pub texture: Option<&'a [[[f64; 2]; 3]]>,
}

impl TriangleSurface<'_> {
    fn check(&self, path: &Path) -> Result<(), IoError> {
        let wrong = |what: &str| Err(IoError::BadOutput { file: path.into(), what: what.into() });
        if !self.points.as_flattened().iter().all(|x| x.is_finite()) {
            return wrong("a coordinate is not finite");
        }
        if self.triangles.as_flattened().iter().any(|&node| node as usize >= self.points.len()) {
            return wrong("a triangle uses a point that does not exist");
        }
        if self.texture.is_some_and(|texture| texture.len() != self.triangles.len()) {
            return wrong("the number of texture coordinates differs from that of triangles");
        }
        Ok(())
    }
}

/// Writes an OBJ file with the points in their order. Equal texture coordinates are written once.
///
/// # Errors
/// Returns [`IoError::BadOutput`] if a value is not finite or a point does not exist, [`IoError::System`] if it cannot
/// be written.
pub fn write_obj(path: &Path, surface: &TriangleSurface) -> Result<(), IoError> {
    surface.check(path)?;
    replace_file(path, |out| {
        // A name is a single word on one line.
        let name: String =
            surface.name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect();
        writeln!(out, "o {name}")?;
        for [x, y, z] in surface.points {
            writeln!(out, "v {x:?} {y:?} {z:?}")?;
        }
        let mut numbers: HashMap<[u64; 2], usize> = HashMap::new();
        let mut corners = Vec::new();
        for uv in surface.texture.unwrap_or_default().as_flattened() {
            let next = numbers.len() + 1;
            let number = *numbers.entry(uv.map(f64::to_bits)).or_insert(next);
            if number == next {
                writeln!(out, "vt {:?} {:?}", uv[0], uv[1])?;
            }
            corners.push(number);
        }
        let (corners, _) = corners.as_chunks::<3>();
        for (k, triangle) in surface.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|node| node + 1);
            match corners.get(k) {
                Some([s, t, u]) => writeln!(out, "f {a}/{s} {b}/{t} {c}/{u}")?,
                None => writeln!(out, "f {a} {b} {c}")?,
            }
        }
        Ok(())
    })
}

/// Writes a binary PLY file with coordinates in 64 bits. Texture coordinates are stored with the faces (`texcoord`), so
/// that the order and number of points do not change.
///
/// # Errors
/// Returns the errors of [`write_obj`].
pub fn write_ply(path: &Path, surface: &TriangleSurface) -> Result<(), IoError> {
    surface.check(path)?;
    replace_file(path, |out| {
        write!(
            out,
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
             property double z\nelement face {}\nproperty list uchar int vertex_indices\n",
            surface.points.len(),
            surface.triangles.len()
        )?;
        if surface.texture.is_some() {
            writeln!(out, "property list uchar float texcoord")?;
        }
        writeln!(out, "end_header")?;
        for x in surface.points.as_flattened() {
            out.write_all(&x.to_le_bytes())?;
        }
        for (k, triangle) in surface.triangles.iter().enumerate() {
            out.write_all(&[3])?;
            for &node in triangle {
                out.write_all(&(node as i32).to_le_bytes())?;
            }
            if let Some(texture) = surface.texture {
                out.write_all(&[6])?;
                for &value in texture[k].as_flattened() {
                    out.write_all(&(value as f32).to_le_bytes())?;
                }
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_obj_file_is_read_as_it_was_written() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.obj");
        let points = [[0.0, 0.0, 1.0 / 3.0], [1.0, 0.0, 0.0], [1.0, 1e-7, 0.0], [0.0, 1.0, 5e20]];
        let triangles = [[0, 1, 2], [0, 2, 3]];
        // The two triangles have a texture seam between them.
        let texture = [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.5, 0.0], [1.0, 1.0], [0.0, 1.0 / 3.0]]];
        let surface = TriangleSurface {
            name: "two words",
            points: &points,
            triangles: &triangles,
            texture: Some(&texture),
        };
        write_obj(&path, &surface).unwrap();
        let file = crate::read_mesh(&path).unwrap();
        assert_eq!(file.mesh.points, points);
        assert_eq!(file.mesh.blocks[0].nodes, triangles.as_flattened());
        assert_eq!(file.cell_array("uv").unwrap().values, texture.as_flattened().as_flattened());
        assert!(file.mesh.region("two_words").is_ok());
        let bad = TriangleSurface { points: &points[..3], ..surface };
        assert!(matches!(write_obj(&path, &bad), Err(IoError::BadOutput { .. })));
    }

    #[test]
    fn a_ply_file_has_the_bytes_that_its_header_announces() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.ply");
        let points = [[0.0, 0.0, 1.0 / 3.0], [1.0, 0.0, 0.0], [1.0, 1e-7, 0.0]];
        let texture = [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]];
        let surface =
            TriangleSurface { name: "a", points: &points, triangles: &[[0, 1, 2]], texture: Some(&texture) };
        write_ply(&path, &surface).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let end = b"end_header\n";
        let data = 11 + bytes.windows(11).position(|window| window == end).unwrap();
        assert_eq!(bytes.len() - data, 3 * 24 + 1 + 12 + 1 + 24);
        assert_eq!(bytes[data + 16..data + 24], (1.0_f64 / 3.0).to_le_bytes());
        assert_eq!(bytes[data + 72], 3);
        assert_eq!(bytes[data + 85], 6);
        assert_eq!(bytes[data + 106..data + 110], 1.0_f32.to_le_bytes());
    }
}
