//! Reads the bytes of a file with bounds: tokens, lines, binary numbers, and errors with their place. It is independent
//! of formats.
//!
//! Every read is checked against the end of the file. Every announced count is checked against the bytes that are left
//! before memory is allocated for it: a number takes at least two bytes of a text and one of binary data. So the memory
//! of a reader stays below a small multiple of the file.

use std::path::Path;
use std::str::FromStr;

use crate::error::{IoError, Place};

/// Encoding of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Text,
    Little,
    Big,
}

/// A reading position in a file.
#[derive(Clone)]
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    position: usize,
    file: &'a Path,
    pub(crate) encoding: Encoding,
    /// Width in bytes of an unsigned size in binary data (Gmsh's data size).
    pub(crate) size_width: usize,
}

impl<'a> Cursor<'a> {
    pub(crate) fn new(bytes: &'a [u8], file: &'a Path) -> Self {
        Self { bytes, position: 0, file, encoding: Encoding::Text, size_width: 8 }
    }

    pub(crate) fn file(&self) -> &'a Path {
        self.file
    }

    pub(crate) fn position(&self) -> usize {
        self.position
    }

    pub(crate) fn seek(&mut self, position: usize) {
        self.position = position.min(self.bytes.len());
    }

    pub(crate) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.position..]
    }

    pub(crate) fn remaining(&self) -> usize {
        self.bytes.len() - self.position
    }

    /// Returns the place of a byte offset: the line in a text, the offset in binary data.
    pub(crate) fn place_at(&self, position: usize) -> Place {
        if self.encoding == Encoding::Text { self.line_at(position) } else { Place::Byte(position) }
    }

    pub(crate) fn line_at(&self, position: usize) -> Place {
        let before = &self.bytes[..position.min(self.bytes.len())];
        Place::Line(1 + before.iter().filter(|&&byte| byte == b'\n').count())
    }

    pub(crate) fn place(&self) -> Place {
        self.place_at(self.position)
    }

    pub(crate) fn truncated(&self, what: impl Into<String>) -> IoError {
        IoError::Truncated {
            file: self.file.into(),
            place: self.place_at(self.bytes.len()),
            what: shown(&what.into()),
        }
    }

    pub(crate) fn syntax_at(&self, position: usize, expected: impl Into<String>, found: &[u8]) -> IoError {
        IoError::Syntax {
            file: self.file.into(),
            place: self.place_at(position),
            expected: shown(&expected.into()),
            found: excerpt(found),
        }
    }

    pub(crate) fn inconsistent_at(&self, position: usize, what: impl Into<String>) -> IoError {
        IoError::Inconsistent {
            file: self.file.into(),
            place: self.place_at(position),
            what: shown(&what.into()),
        }
    }

    pub(crate) fn unsupported_at(
        &self,
        position: usize,
        what: impl Into<String>,
        remedy: &'static str,
    ) -> IoError {
        IoError::Unsupported {
            file: self.file.into(),
            place: self.place_at(position),
            what: shown(&what.into()),
            remedy,
        }
    }

    /// Accepts a count of records of at least `bytes_each` bytes each, if the rest of the file can hold them.
    pub(crate) fn count(&self, count: u64, bytes_each: usize, what: &str) -> Result<usize, IoError> {
        // There is one separator fewer than numbers, because the last number may end the file.
        let room = self.remaining() as u64 + 1;
        match count.checked_mul(bytes_each.max(1) as u64) {
            Some(bytes) if bytes <= room => Ok(count as usize),
            _ => Err(IoError::CountTooLarge {
                file: self.file.into(),
                place: self.place(),
                what: shown(what),
                count,
                room: self.remaining() as u64,
            }),
        }
    }

    pub(crate) fn skip_whitespace(&mut self) {
        let white = self.rest().iter().take_while(|byte| byte.is_ascii_whitespace()).count();
        self.position += white;
    }

    /// Returns the offset at which the next item begins, for messages.
    pub(crate) fn start(&mut self) -> usize {
        if self.encoding == Encoding::Text {
            self.skip_whitespace();
        }
        self.position
    }

    /// Skips spaces and at most one line end, which separate a text header from binary data.
    pub(crate) fn skip_line_end(&mut self) {
        let spaces =
            self.rest().iter().take_while(|&&byte| byte == b' ' || byte == b'\t' || byte == b'\r').count();
        if self.rest().get(spaces) == Some(&b'\n') {
            self.position += spaces + 1;
        }
    }

    /// Returns the rest of the line without its end; `None` at the end of the file.
    pub(crate) fn line(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let length = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
        self.position += (length + 1).min(rest.len());
        Some(rest[..length].strip_suffix(b"\r").unwrap_or(&rest[..length]))
    }

    /// Returns the next word between white space.
    pub(crate) fn token(&mut self, what: &str) -> Result<&'a [u8], IoError> {
        self.next_token().ok_or_else(|| self.truncated(what))
    }

    /// Returns the next word between white space, or `None` at the end of the file.
    pub(crate) fn next_token(&mut self) -> Option<&'a [u8]> {
        self.skip_whitespace();
        let rest = self.rest();
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.position += length;
        (length > 0).then(|| &rest[..length])
    }

    /// Reads a number written as text.
    pub(crate) fn text_number<T: FromStr>(&mut self, what: &str) -> Result<T, IoError> {
        let token = self.token(what)?;
        std::str::from_utf8(token)
            .ok()
            .and_then(|text| text.parse().ok())
            .ok_or_else(|| self.syntax_at(self.position - token.len(), what, token))
    }

    /// Returns the next `length` bytes.
    pub(crate) fn take(&mut self, length: usize, what: &str) -> Result<&'a [u8], IoError> {
        if length > self.remaining() {
            return Err(self.truncated(what));
        }
        let bytes = &self.rest()[..length];
        self.position += length;
        Ok(bytes)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], IoError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N, what)?);
        if self.encoding == Encoding::Big {
            out.reverse();
        }
        Ok(out)
    }

    /// Reads a 32-bit integer.
    pub(crate) fn int(&mut self, what: &str) -> Result<i32, IoError> {
        match self.encoding {
            Encoding::Text => self.text_number(what),
            _ => self.array(what).map(i32::from_le_bytes),
        }
    }

    /// Reads an unsigned size.
    pub(crate) fn size(&mut self, what: &str) -> Result<u64, IoError> {
        match (self.encoding, self.size_width) {
            (Encoding::Text, _) => self.text_number(what),
            (_, 4) => self.array(what).map(|bytes| u32::from_le_bytes(bytes).into()),
            _ => self.array(what).map(u64::from_le_bytes),
        }
    }

    /// Reads a double-precision number.
    pub(crate) fn real(&mut self, what: &str) -> Result<f64, IoError> {
        match self.encoding {
            Encoding::Text => self.text_number(what),
            _ => self.array(what).map(f64::from_le_bytes),
        }
    }
}

/// Returns the beginning of the bytes that were found, quoted for a message.
pub(crate) fn excerpt(found: &[u8]) -> String {
    if found.is_empty() {
        return "nothing".into();
    }
    let shown = &found[..found.len().min(40)];
    let more = if shown.len() < found.len() { "…" } else { "" };
    format!("\"{}{more}\"", shown.escape_ascii())
}

/// Returns a text that may contain words of the file in a form fit for a message: on one line and shortened.
pub(crate) fn shown(text: &str) -> String {
    let plain = |c: char| if c.is_control() { '\u{FFFD}' } else { c };
    let mut out: String = text.chars().take(200).map(plain).collect();
    if text.chars().nth(200).is_some() {
        out.push('…');
    }
    out
}
