//! Reads a file of a parted mesh from its start to its end, a little at a time, and checks it against the index.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use flate2::Crc;

use super::index::Listed;
use crate::error::{IoError, Place};

/// Bytes that are read at once, a multiple of the length of a point and of a number.
const CHUNK: usize = 24 << 11;

/// A file of which some bytes have been read.
pub(super) struct Sections {
    file: File,
    path: PathBuf,
    index: PathBuf,
    listed: Listed,
    sum: Crc,
    /// Bytes that have been read.
    read: u64,
}

impl Sections {
    /// Opens a file of a parted mesh. Its length is checked, so that it holds what the index announces.
    pub(super) fn open(path: &Path, index: &Path, listed: &Listed) -> Result<Self, IoError> {
        let failed = |source| IoError::System { file: path.into(), action: "read", source };
        let file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        let (path, index, listed) = (path.to_owned(), index.to_owned(), listed.clone());
        if length != listed.bytes {
            let (found, listed) = (format!("{length} bytes"), format!("{}", listed.bytes));
            return Err(IoError::OtherPiece { file: path, index, found, listed });
        }
        Ok(Self { file, path, index, listed, sum: Crc::new(), read: 0 })
    }

    /// Reads numbers of 64 bits.
    pub(super) fn longs(&mut self, count: usize, what: &str) -> Result<Vec<u64>, IoError> {
        self.records(count, what, |bytes| u64::from_le_bytes(*bytes))
    }

    /// Reads real numbers.
    pub(super) fn reals(&mut self, count: usize, what: &str) -> Result<Vec<f64>, IoError> {
        self.records(count, what, |bytes| f64::from_le_bytes(*bytes))
    }

    /// Reads points.
    pub(super) fn points(&mut self, count: usize) -> Result<Vec<[f64; 3]>, IoError> {
        self.records(count, "points", point)
    }

    /// Reads numbers of 32 bits that are all below a bound.
    pub(super) fn integers(&mut self, of: (usize, usize), what: &str) -> Result<Vec<u32>, IoError> {
        let mut numbers = Vec::with_capacity(of.0.min(self.room(4)));
        self.each_integer(of, what, |number| numbers.push(number))?;
        Ok(numbers)
    }

    /// Passes over numbers of 32 bits that are all below a bound.
    pub(super) fn pass_integers(&mut self, of: (usize, usize), what: &str) -> Result<(), IoError> {
        self.each_integer(of, what, |_| ())
    }

    /// Reads what is left, and checks the sum of all bytes; returns the file with what was made of it. A wrong sum is reported before
    /// any fault that the lists have because of it.
    pub(super) fn finish<T>(mut self, made: Result<T, IoError>) -> Result<(T, File), IoError> {
        let end = self.read;
        self.each_chunk(self.listed.bytes - end, "the rest", |_| ())?;
        let (sum, listed) = (self.sum.sum(), self.listed.sum);
        if sum != listed {
            let (found, listed) = (format!("the checksum {sum:08x}"), format!("{listed:08x}"));
            return Err(IoError::OtherPiece { file: self.path, index: self.index, found, listed });
        }
        let made = made?;
        if end < self.listed.bytes {
            let what = "there are bytes behind the last list".to_owned();
            return Err(IoError::Inconsistent { file: self.path, place: Place::Byte(end as usize), what });
        }
        Ok((made, self.file))
    }

    /// Returns how many records of so many bytes the rest can hold: a damaged count is no reason to take memory.
    fn room(&self, bytes_each: usize) -> usize {
        (self.listed.bytes - self.read) as usize / bytes_each
    }

    fn each_integer(
        &mut self,
        (count, below): (usize, usize),
        what: &str,
        mut see: impl FnMut(u32),
    ) -> Result<(), IoError> {
        let (place, mut wrong) = (Place::Byte(self.read as usize), None);
        self.each_chunk(4 * count as u64, what, |chunk| {
            for bytes in chunk.as_chunks().0 {
                let number = u32::from_le_bytes(*bytes);
                if number as usize >= below {
                    wrong = wrong.or(Some(number));
                }
                see(number);
            }
        })?;
        wrong.map_or(Ok(()), |number| {
            let what = format!("{what}: {number} is out of range (there are {below})");
            Err(IoError::Inconsistent { file: self.path.clone(), place, what })
        })
    }

    /// Reads records of N bytes, of which `CHUNK` is a multiple.
    fn records<const N: usize, T>(
        &mut self,
        count: usize,
        what: &str,
        decode: impl Fn(&[u8; N]) -> T,
    ) -> Result<Vec<T>, IoError> {
        let mut records = Vec::with_capacity(count.min(self.room(N)));
        self.each_chunk((N * count) as u64, what, |chunk| {
            records.extend(chunk.as_chunks().0.iter().map(&decode));
        })?;
        Ok(records)
    }

    fn each_chunk(&mut self, bytes: u64, what: &str, mut see: impl FnMut(&[u8])) -> Result<(), IoError> {
        if bytes > self.listed.bytes - self.read {
            let place = Place::Byte(self.listed.bytes as usize);
            return Err(IoError::Truncated { file: self.path.clone(), place, what: what.to_owned() });
        }
        let (mut left, mut chunk) = (bytes, vec![0; bytes.min(CHUNK as u64) as usize]);
        while left > 0 {
            let length = left.min(CHUNK as u64) as usize;
            let failed = |source| IoError::System { file: self.path.clone(), action: "read", source };
            self.file.read_exact(&mut chunk[..length]).map_err(failed)?;
            self.sum.update(&chunk[..length]);
            see(&chunk[..length]);
            left -= length as u64;
            self.read += length as u64;
        }
        Ok(())
    }
}

/// Returns the point of these bytes.
pub(super) fn point(bytes: &[u8; 24]) -> [f64; 3] {
    let mut point = [0.0; 3];
    for (x, bytes) in point.iter_mut().zip(bytes.as_chunks().0) {
        *x = f64::from_le_bytes(*bytes);
    }
    point
}
