//! Reads a file of a parted mesh from its start to its end, a little at a time, and checks it against the index.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use flate2::Crc;

use super::index::Listed;
use crate::error::{IoError, Place};

/// Bytes that are read at once, a multiple of the length of a number.
const CHUNK: usize = 1 << 16;

/// A file of which some bytes have been read.
pub(super) struct Sections {
    file: File,
    path: PathBuf,
    index: PathBuf,
    listed: Listed,
    sum: Crc,
    /// Bytes that have been read.
    read: usize,
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

    /// Reads all bytes.
    pub(super) fn bytes(&mut self) -> Result<Vec<u8>, IoError> {
        let mut bytes = Vec::with_capacity(self.listed.bytes as usize);
        self.each_chunk(self.listed.bytes, |chunk| bytes.extend_from_slice(chunk))?;
        Ok(bytes)
    }

    /// Reads real numbers.
    pub(super) fn reals(&mut self, count: usize) -> Result<Vec<f64>, IoError> {
        let mut numbers = Vec::with_capacity(count);
        self.each_chunk(8 * count as u64, |chunk| {
            numbers.extend(chunk.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)));
        })?;
        Ok(numbers)
    }

    /// Reads whole numbers that are all below a bound.
    pub(super) fn integers(&mut self, count: usize, below: usize) -> Result<Vec<u32>, IoError> {
        let mut numbers: Vec<u32> = Vec::with_capacity(count);
        self.each_chunk(4 * count as u64, |chunk| {
            numbers.extend(chunk.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)));
        })?;
        match numbers.iter().find(|number| **number as usize >= below) {
            Some(number) => {
                let what = format!("the number {number} is out of range (there are {below})");
                Err(IoError::Inconsistent { file: self.path.clone(), place: Place::Byte(self.read), what })
            }
            None => Ok(numbers),
        }
    }

    /// Passes over some bytes.
    pub(super) fn skip(&mut self, count: u64) -> Result<(), IoError> {
        self.each_chunk(count, |_| ())
    }

    /// Checks the sum of all bytes, which must have been read; returns the file.
    pub(super) fn finish(self) -> Result<File, IoError> {
        let (sum, listed) = (self.sum.sum(), self.listed.sum);
        if sum == listed {
            return Ok(self.file);
        }
        let (found, listed) = (format!("the checksum {sum:08x}"), format!("{listed:08x}"));
        Err(IoError::OtherPiece { file: self.path, index: self.index, found, listed })
    }

    fn each_chunk(&mut self, bytes: u64, mut see: impl FnMut(&[u8])) -> Result<(), IoError> {
        let (mut left, mut chunk) = (bytes, vec![0; bytes.min(CHUNK as u64) as usize]);
        while left > 0 {
            let length = left.min(CHUNK as u64) as usize;
            let failed = |source| IoError::System { file: self.path.clone(), action: "read", source };
            self.file.read_exact(&mut chunk[..length]).map_err(failed)?;
            self.sum.update(&chunk[..length]);
            see(&chunk[..length]);
            left -= length as u64;
            self.read += length;
        }
        Ok(())
    }
}

/// Returns the CRC-32 of some bytes.
pub(super) fn sum_of(bytes: &[u8]) -> u32 {
    let mut sum = Crc::new();
    sum.update(bytes);
    sum.sum()
}
