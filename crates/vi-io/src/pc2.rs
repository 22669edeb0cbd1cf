//! Reads and writes PC2 point caches: the points of one mesh at even times, for Blender, Maya, 3ds Max.
//!
//! Layout, little-endian: the 12 bytes `POINTCACHE2\0`, version 1 (int32), number of points (int32), first frame
//! (float32), samples per frame (float32), number of samples (int32); then x y z (float32) of every point of every
//! sample.
//!
//! Source: Blender, `source/blender/modifiers/intern/MOD_meshcache_pc2.cc`; 3ds Max SDK, "Point cache".

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::error::IoError;

/// Size of the header, bytes.
pub(crate) const HEADER: u64 = 32;
/// Offset of the number of samples.
const COUNT: u64 = 28;

/// A point cache that grows sample by sample and is a valid file after each.
#[derive(Debug)]
pub struct Pc2File {
    path: PathBuf,
    file: File,
    points: usize,
    samples: usize,
}

impl Pc2File {
    /// Creates an empty cache of `points` points, replacing an older file.
    ///
    /// # Errors
    /// Returns [`IoError::System`] if it cannot be written, [`IoError::BadOutput`] for more points than it can hold.
    pub fn create(path: &Path, points: usize) -> Result<Self, IoError> {
        let Ok(count) = i32::try_from(points) else {
            let what = format!("a point cache holds at most {} points, not {points}", i32::MAX);
            return Err(IoError::BadOutput { file: path.into(), what });
        };
        let file = File::create(path).and_then(|mut file| {
            file.write_all(&head(count))?;
            file.write_all(&0_i32.to_le_bytes())?;
            Ok(file)
        });
        Ok(Self { file: file.map_err(system(path))?, path: path.into(), points, samples: 0 })
    }

    /// Continues a cache after its first `samples`; later samples are removed.
    ///
    /// # Errors
    /// Returns [`IoError::System`] if it cannot be written; [`IoError::BadOutput`] if it has fewer samples, or is not a
    /// cache of `points` points.
    pub fn resume(path: &Path, points: usize, samples: usize) -> Result<Self, IoError> {
        let mut file = File::options().read(true).write(true).open(path).map_err(system(path))?;
        let mut found = Vec::new();
        (&mut file).take(COUNT).read_to_end(&mut found).map_err(system(path))?;
        if !i32::try_from(points).is_ok_and(|count| found == head(count)) {
            let what = format!("it is not a point cache of {points} points");
            return Err(IoError::BadOutput { file: path.into(), what });
        }
        let mut cache = Self { path: path.into(), file, points, samples };
        let length = cache.file.metadata().map_err(system(path))?.len();
        if length < cache.length() {
            let what = format!("it has {length} bytes, and {samples} samples of {points} points have more");
            return Err(IoError::BadOutput { file: path.into(), what });
        }
        cache.truncate(samples)?;
        Ok(cache)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn point_count(&self) -> usize {
        self.points
    }

    pub(crate) fn sample_count(&self) -> usize {
        self.samples
    }

    /// Returns the size of the header and the samples so far (bytes).
    fn length(&self) -> u64 {
        HEADER + 12 * self.points as u64 * self.samples as u64
    }

    /// Removes all but the first `samples` samples.
    ///
    /// # Errors
    /// Returns [`IoError::System`] if it cannot be written.
    pub fn truncate(&mut self, samples: usize) -> Result<(), IoError> {
        self.samples = samples;
        let length = self.length();
        self.file.set_len(length).and_then(|()| self.enter_count()).map_err(system(&self.path))
    }

    /// Appends the points of one sample.
    ///
    /// # Errors
    /// Returns [`IoError::BadOutput`] if their number differs from that of the cache or a coordinate exceeds 32 bits;
    /// [`IoError::System`] if it cannot be written.
    pub fn append(&mut self, points: &[[f64; 3]]) -> Result<(), IoError> {
        let wrong = |what: String| IoError::BadOutput { file: self.path.clone(), what };
        if points.len() != self.points {
            return Err(wrong(format!("{} points for a cache of {}", points.len(), self.points)));
        }
        if let Some(x) = points.as_flattened().iter().find(|x| x.is_nan() || x.abs() > f64::from(f32::MAX)) {
            return Err(wrong(format!("a coordinate is {x}, which 32 bits cannot hold")));
        }
        let at = self.length();
        let written = self.file.seek(SeekFrom::Start(at)).and_then(|_| {
            let mut out = BufWriter::with_capacity(1 << 16, &self.file);
            for &x in points.as_flattened() {
                out.write_all(&(x as f32).to_le_bytes())?;
            }
            out.flush()
        });
        written.map_err(system(&self.path))?;
        self.samples += 1;
        self.enter_count().map_err(system(&self.path))
    }

    fn enter_count(&mut self) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(COUNT))?;
        self.file.write_all(&(self.samples as i32).to_le_bytes())
    }

    /// Waits until everything is on disk.
    ///
    /// # Errors
    /// Returns [`IoError::System`] if it cannot be written.
    pub fn sync(&self) -> Result<(), IoError> {
        self.file.sync_all().map_err(system(&self.path))
    }
}

/// Returns the header of a cache of `points` points, without the number of samples.
fn head(points: i32) -> Vec<u8> {
    let mut head = b"POINTCACHE2\0".to_vec();
    [1, points].iter().for_each(|value| head.extend(value.to_le_bytes()));
    [0.0_f32, 1.0].iter().for_each(|value| head.extend(value.to_le_bytes()));
    head
}

fn system(path: &Path) -> impl FnOnce(io::Error) -> IoError {
    let file = path.to_owned();
    move |source| IoError::System { file, action: "write", source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cache_is_what_the_format_says_after_every_sample() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.pc2");
        let sample = |k: f64| [[k, 0.5, -1.0], [2.0, k * 0.1, 1e-3]];
        let mut cache = Pc2File::create(&path, 2).unwrap();
        for count in 0..4_u32 {
            let bytes = std::fs::read(&path).unwrap();
            assert_eq!(bytes.len(), 32 + count as usize * 24);
            assert_eq!(bytes[..12], *b"POINTCACHE2\0");
            let int = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            let real = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            assert_eq!((int(12), int(16), int(28)), (1, 2, count as i32));
            assert_eq!((real(20), real(24)), (0.0, 1.0));
            for k in 0..count as usize {
                for (i, &x) in sample(k as f64).as_flattened().iter().enumerate() {
                    assert_eq!(real(32 + 24 * k + 4 * i), x as f32);
                }
            }
            cache.append(&sample(f64::from(count))).unwrap();
        }
        let whole = std::fs::read(&path).unwrap();
        drop(cache);
        let mut cache = Pc2File::resume(&path, 2, 2).unwrap();
        assert_eq!(std::fs::read(&path).unwrap().len(), 32 + 48);
        cache.append(&sample(2.0)).unwrap();
        cache.append(&sample(3.0)).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), whole);
        assert!(Pc2File::resume(&path, 2, 5).is_err());
        let other = directory.path().join("other.pc2");
        std::fs::write(&other, [&b"x"[..], &whole[1..]].concat()).unwrap();
        for (file, points) in [(&other, 2), (&path, 1), (&directory.path().join("none.pc2"), 2)] {
            assert!(Pc2File::resume(file, points, 1).is_err(), "{}", file.display());
        }
        for bad in [f64::NAN, f64::INFINITY, 1e39] {
            assert!(matches!(cache.append(&[[bad; 3]; 2]), Err(IoError::BadOutput { .. })));
        }
        assert!(cache.append(&[[0.0; 3]; 3]).is_err());
        assert_eq!(std::fs::read(&path).unwrap(), whole, "what is refused leaves no trace");
    }
}
