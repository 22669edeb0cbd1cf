//! Decodes a `DataArray`: text, base64 or raw, with a header of lengths, whole or in blocks of zlib.
//!
//! Every length follows from the number of points and cells. Before memory is allocated, it is compared with the length
//! that the file announces and with the length that its bytes can hold.

use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::{Decompress, FlushDecompress, Status};

use crate::cursor::{Cursor, Encoding, excerpt, shown};
use crate::error::{IoError, Place};
use crate::vtk::number::Number;

/// Upper bound of the bytes that one byte of zlib data can unpack to (1032, zlib technical details).
const GREATEST_RATIO: usize = 1040;

/// Where the data of an array are.
pub(super) enum Content {
    Text(Range<usize>),
    Base64(Range<usize>),
    Appended(usize),
}

/// A `DataArray` as the XML describes it.
pub(super) struct Spec {
    pub(super) name: String,
    pub(super) number: Number,
    pub(super) components: usize,
    pub(super) content: Content,
    /// Offset of its element.
    pub(super) at: usize,
}

/// Settings common to all arrays of a file.
#[derive(Clone, Copy, Default)]
pub(super) struct Form {
    pub(super) big: bool,
    pub(super) wide_header: bool,
    pub(super) compressed: bool,
    /// First byte of the appended data, and whether they are base64.
    pub(super) appended: Option<(usize, bool)>,
}

/// The bytes of a file, from which arrays are decoded.
pub(super) struct Payloads<'a> {
    bytes: &'a [u8],
    file: &'a Path,
    form: Form,
    /// Number of encoded bytes that arrays may still take. Arrays must not share bytes; otherwise a file could hold far
    /// more data than its size.
    budget: usize,
}

impl<'a> Payloads<'a> {
    pub(super) fn new(bytes: &'a [u8], file: &'a Path, form: Form) -> Self {
        Self { bytes, file, form, budget: 2 * bytes.len() }
    }

    /// Returns the line of an offset in the XML.
    pub(super) fn place(&self, at: usize) -> Place {
        Cursor::new(self.bytes, self.file).line_at(at)
    }

    /// Returns `count · components`, if the file can hold so many numbers.
    pub(super) fn product(&self, spec: &Spec, count: usize, components: usize) -> Result<usize, IoError> {
        count.checked_mul(components).ok_or_else(|| self.too_large(spec, u64::MAX, self.bytes.len()))
    }

    /// Reads the `count` numbers of an array as f64.
    pub(super) fn reals(&mut self, spec: &Spec, count: usize) -> Result<Vec<f64>, IoError> {
        if let Content::Text(range) = &spec.content {
            if spec.number == Number::Real(4) {
                // Nine digits identify a float exactly, but not the double nearest to them.
                let values: Vec<f32> = self.text(spec, range.clone(), count)?;
                return Ok(values.into_iter().map(f64::from).collect());
            }
            return self.text(spec, range.clone(), count);
        }
        let bytes = self.decode(spec, count)?;
        Ok(spec.number.reals(&bytes, self.form.big))
    }

    /// Reads the `count` numbers of an integer array.
    pub(super) fn integers(&mut self, spec: &Spec, count: usize) -> Result<Vec<i64>, IoError> {
        if let Content::Text(range) = &spec.content {
            return self.text(spec, range.clone(), count);
        }
        let bytes = self.decode(spec, count)?;
        spec.number
            .integers(&bytes, self.form.big)
            .ok_or_else(|| self.inconsistent(spec, "it must be of an integer type".into()))
    }

    fn text<T: std::str::FromStr>(
        &self,
        spec: &Spec,
        range: Range<usize>,
        count: usize,
    ) -> Result<Vec<T>, IoError> {
        let mut cursor = Cursor::new(&self.bytes[..range.end], self.file);
        cursor.seek(range.start);
        let what = format!("the array \"{}\"", spec.name);
        let mut values = Vec::with_capacity(cursor.count(count as u64, 2, &format!("numbers of {what}"))?);
        for _ in 0..count {
            values.push(cursor.text_number(&what)?);
        }
        let end = cursor.start();
        match cursor.next_token() {
            Some(token) => {
                Err(cursor.syntax_at(end, format!("the end of {what} after {count} numbers"), token))
            }
            None => Ok(values),
        }
    }

    /// Returns the decoded bytes of `count` numbers.
    fn decode(&mut self, spec: &Spec, count: usize) -> Result<Cow<'a, [u8]>, IoError> {
        let length = count
            .checked_mul(spec.number.width())
            .filter(|&length| length / GREATEST_RATIO <= self.bytes.len())
            .ok_or_else(|| self.too_large(spec, count as u64, self.bytes.len()))?;
        if length == 0 {
            return Ok(Cow::Borrowed(&[]));
        }
        let stream = self.stream(spec)?;
        let width = if self.form.wide_header { 8 } else { 4 };
        if !self.form.compressed {
            let head = self.prefix(spec, &stream, width)?;
            self.expect_length(spec, self.header_value(&head, 0), length)?;
            let mut data = self.prefix(spec, &stream, width + length)?;
            self.charge(spec, width + length)?;
            return Ok(match &mut data {
                Cow::Borrowed(bytes) => Cow::Borrowed(&bytes[width..]),
                Cow::Owned(bytes) => Cow::Owned(bytes.split_off(width)),
            });
        }
        let head = self.prefix(spec, &stream, 3 * width)?;
        let [block_count, block, last] = [0, 1, 2].map(|i| self.header_value(&head, i));
        // The last block may be a partial one.
        let whole = if last > 0 { block_count.saturating_sub(1) } else { block_count };
        let announced =
            whole.checked_mul(block).and_then(|bytes| bytes.checked_add(last)).unwrap_or(u64::MAX);
        self.expect_length(spec, announced, length)?;
        // Neither overflows: whole · block ≤ length, and a header that announces more blocks than the file has bytes
        // is rejected as truncated.
        let head_length =
            usize::try_from(block_count).ok().and_then(|n| n.checked_add(3)?.checked_mul(width));
        let head_length = head_length
            .filter(|&length| length <= self.bytes.len())
            .ok_or_else(|| self.too_large(spec, block_count, self.bytes.len()))?;
        let head = self.prefix(spec, &stream, head_length)?;
        let sizes: Vec<u64> = (3..3 + block_count as usize).map(|i| self.header_value(&head, i)).collect();
        let packed_length =
            sizes.iter().try_fold(0u64, |sum, &size| sum.checked_add(size)).unwrap_or(u64::MAX);
        let total = usize::try_from(packed_length).ok().and_then(|packed| packed.checked_add(head_length));
        let total = total
            .filter(|&total| total <= self.bytes.len())
            .ok_or_else(|| self.too_large(spec, packed_length, self.bytes.len()))?;
        self.charge(spec, total)?;
        let packed = self.prefix(spec, &stream, total)?;
        if length / GREATEST_RATIO > packed.len() {
            return Err(self.too_large(spec, count as u64, packed.len()));
        }
        let mut out = vec![0; length];
        let (mut from, mut to) = (head_length, 0);
        for (i, &size) in sizes.iter().enumerate() {
            let end = if (i as u64) < whole { to + block as usize } else { length };
            inflate(&packed[from..from + size as usize], &mut out[to..end]).map_err(|what| {
                self.inconsistent(spec, format!("block {i} of its compressed data {what}"))
            })?;
            from += size as usize;
            to = end;
        }
        Ok(Cow::Owned(out))
    }

    /// Returns the header and the data of an array in their encoding.
    fn stream(&self, spec: &Spec) -> Result<Stream<'a>, IoError> {
        match &spec.content {
            Content::Appended(offset) => {
                let Some((start, base64)) = self.form.appended else {
                    return Err(self.inconsistent(
                        spec,
                        "its data should be appended, but the file has no appended data".into(),
                    ));
                };
                let at = start.checked_add(*offset).filter(|&at| at < self.bytes.len());
                let at = at.ok_or_else(|| self.truncated(spec))?;
                Ok(if base64 {
                    Stream::Base64(Cow::Borrowed(&self.bytes[at..]))
                } else {
                    Stream::Raw(&self.bytes[at..])
                })
            }
            Content::Base64(range) | Content::Text(range) => {
                let text = self.bytes[range.clone()].trim_ascii();
                Ok(Stream::Base64(if text.iter().any(u8::is_ascii_whitespace) {
                    Cow::Owned(text.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).collect())
                } else {
                    Cow::Borrowed(text)
                }))
            }
        }
    }

    /// Returns the first `length` decoded bytes of a stream.
    fn prefix(&self, spec: &Spec, stream: &Stream<'a>, length: usize) -> Result<Cow<'a, [u8]>, IoError> {
        match stream {
            Stream::Raw(bytes) => bytes.get(..length).map(Cow::Borrowed).ok_or_else(|| self.truncated(spec)),
            Stream::Base64(text) => {
                if length > text.len() {
                    return Err(self.truncated(spec));
                }
                let mut out = Vec::with_capacity(length + 2);
                let mut text: &[u8] = text;
                while out.len() < length {
                    // The header may be encoded separately: padding inside the text ends a part.
                    let needed = (length - out.len()).div_ceil(3) * 4;
                    let part = &text[..needed.min(text.len())];
                    let part = match part.iter().position(|&byte| byte == b'=') {
                        Some(i) => &part[..(i / 4 * 4 + 4).min(part.len())],
                        None => part,
                    };
                    if part.is_empty() {
                        return Err(self.truncated(spec));
                    }
                    STANDARD.decode_vec(part, &mut out).map_err(|error| IoError::Syntax {
                        file: self.file.into(),
                        place: self.place(spec.at),
                        expected: shown(&format!("base64 in the array \"{}\" ({error})", spec.name)),
                        found: excerpt(part),
                    })?;
                    text = &text[part.len()..];
                }
                out.truncate(length);
                Ok(Cow::Owned(out))
            }
        }
    }

    fn header_value(&self, head: &[u8], i: usize) -> u64 {
        let width = if self.form.wide_header { 8 } else { 4 };
        let mut bytes = [0; 8];
        bytes[..width].copy_from_slice(&head[i * width..(i + 1) * width]);
        if self.form.big {
            bytes[..width].reverse();
        }
        u64::from_le_bytes(bytes)
    }

    fn expect_length(&self, spec: &Spec, found: u64, expected: usize) -> Result<(), IoError> {
        if found == expected as u64 {
            return Ok(());
        }
        Err(self.inconsistent(spec, format!("it has {found} bytes of data where {expected} belong")))
    }

    fn charge(&mut self, spec: &Spec, length: usize) -> Result<(), IoError> {
        match self.budget.checked_sub(length) {
            Some(left) => {
                self.budget = left;
                Ok(())
            }
            None => Err(self.inconsistent(spec, "arrays overlap in the file".into())),
        }
    }

    fn too_large(&self, spec: &Spec, count: u64, room: usize) -> IoError {
        IoError::CountTooLarge {
            file: self.file.into(),
            place: self.place(spec.at),
            what: shown(&format!("numbers (or blocks) of the array \"{}\"", spec.name)),
            count,
            room: room as u64,
        }
    }

    fn inconsistent(&self, spec: &Spec, what: String) -> IoError {
        let what = shown(&format!("the array \"{}\": {what}", spec.name));
        IoError::Inconsistent { file: self.file.into(), place: self.place(spec.at), what }
    }

    fn truncated(&self, spec: &Spec) -> IoError {
        let mut cursor = Cursor::new(self.bytes, self.file);
        cursor.encoding = Encoding::Little;
        cursor.truncated(format!("the array \"{}\"", spec.name))
    }
}

enum Stream<'a> {
    Raw(&'a [u8]),
    Base64(Cow<'a, [u8]>),
}

/// Unpacks one zlib stream, which must fill `out` exactly.
fn inflate(packed: &[u8], out: &mut [u8]) -> Result<(), String> {
    let mut decompress = Decompress::new(true);
    match decompress.decompress(packed, out, FlushDecompress::Finish) {
        Ok(Status::StreamEnd) if decompress.total_out() as usize == out.len() => Ok(()),
        Ok(Status::StreamEnd) => {
            Err(format!("unpacks to {} bytes instead of {}", decompress.total_out(), out.len()))
        }
        Ok(_) => Err("is cut off or too long".into()),
        Err(error) => Err(format!("is not zlib ({error})")),
    }
}
