//! Writes MDD point caches: the points of one mesh at given times, for LightWave, Maya, Houdini, Cinema 4D and Blender.
//!
//! Layout, big-endian: number of frames (int32), number of points (int32), the time of every frame (float32, s); then
//! x y z (float32) of every point of every frame. The times stand before the points, so that the number of frames must
//! be known first: the file is made from a PC2 cache that is complete.
//!
//! Source: Blender, `source/blender/modifiers/intern/MOD_meshcache_mdd.cc`; LightWave SDK, "MDD file format".

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use crate::error::IoError;
use crate::pc2::{HEADER, Pc2File};

/// Writes all samples of a point cache as an MDD file, with `rate` samples per second from t = 0 on.
///
/// # Errors
/// Returns [`IoError::System`] if a file cannot be read or written.
pub fn write_mdd(path: &Path, cache: &Pc2File, rate: f64) -> Result<(), IoError> {
    copy(path, cache, rate).map_err(|source| IoError::System { file: path.into(), action: "write", source })
}

fn copy(path: &Path, cache: &Pc2File, rate: f64) -> io::Result<()> {
    let mut samples = File::open(cache.path())?;
    samples.seek(SeekFrom::Start(HEADER))?;
    let mut samples = BufReader::new(samples);
    let mut out = BufWriter::new(File::create(path)?);
    // A PC2 cache holds both numbers in 32 bits.
    for count in [cache.sample_count(), cache.point_count()] {
        out.write_all(&(count as i32).to_be_bytes())?;
    }
    for sample in 0..cache.sample_count() {
        out.write_all(&((sample as f64 / rate) as f32).to_be_bytes())?;
    }
    let mut word = [0; 4];
    for _ in 0..3 * cache.point_count() * cache.sample_count() {
        samples.read_exact(&mut word)?;
        word.reverse();
        out.write_all(&word)?;
    }
    out.into_inner()?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_what_the_format_says() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.mdd");
        let sample = |k: f64| [[k, 0.5, -1.0], [2.0, k * 0.1, 1e-3]];
        let mut cache = Pc2File::create(&directory.path().join("a.pc2"), 2).unwrap();
        for count in 0..4_usize {
            write_mdd(&path, &cache, 24.0).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            assert_eq!(bytes.len(), 8 + 4 * count + 24 * count);
            let words: Vec<[u8; 4]> = bytes.as_chunks::<4>().0.to_vec();
            let real = |at: usize| f32::from_be_bytes(words[at]);
            assert_eq!([words[0], words[1]].map(i32::from_be_bytes), [count as i32, 2]);
            for k in 0..count {
                assert_eq!(real(2 + k), (k as f64 / 24.0) as f32);
                for (i, &x) in sample(k as f64).as_flattened().iter().enumerate() {
                    assert_eq!(real(2 + count + 6 * k + i), x as f32);
                }
            }
            cache.append(&sample(count as f64)).unwrap();
        }
        assert!(write_mdd(&directory.path().join("none/a.mdd"), &cache, 24.0).is_err());
    }
}
