//! Reads the lines of an Abaqus input file: comments, keywords with parameters, fields of data.

use crate::cursor::Cursor;
use crate::error::IoError;

/// Returns the next line that is neither empty nor a comment (`**`), trimmed, and its offset.
pub(super) fn next_line<'a>(cursor: &mut Cursor<'a>) -> Option<(usize, &'a [u8])> {
    loop {
        let at = cursor.position();
        let line = cursor.line()?.trim_ascii();
        if !line.is_empty() && !line.starts_with(b"**") {
            return Some((at, line));
        }
    }
}

/// A keyword line: `*NAME, KEY=value, FLAG`.
pub(super) struct Keyword<'a> {
    /// Name of the keyword in upper case, with single spaces between the words.
    pub(super) name: String,
    pub(super) at: usize,
    parameters: Vec<(&'a [u8], Option<&'a [u8]>)>,
}

impl<'a> Keyword<'a> {
    /// Reads a keyword from its line and the lines that continue it: a line that ends with a comma is continued.
    pub(super) fn read(cursor: &mut Cursor<'a>, at: usize, line: &'a [u8]) -> Result<Self, IoError> {
        let mut words = fields(&line[1..]);
        let name = words.next().unwrap_or_default();
        let is_letter = |byte: &u8| byte.is_ascii_alphanumeric() || b" _-/".contains(byte);
        if name.is_empty() || !name.iter().all(is_letter) {
            return Err(cursor.syntax_at(at, "a keyword such as *NODE", line));
        }
        let words_of_name = name.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let words_of_name: Vec<String> =
            words_of_name.map(|word| String::from_utf8_lossy(word).to_ascii_uppercase()).collect();
        let mut keyword = Self { name: words_of_name.join(" "), at, parameters: Vec::new() };
        keyword.take(words);
        let mut last = line;
        while last.ends_with(b",") {
            let Some((_, next)) = next_line(cursor) else { break };
            keyword.take(fields(next));
            last = next;
        }
        Ok(keyword)
    }

    fn take(&mut self, words: impl Iterator<Item = &'a [u8]>) {
        for word in words.filter(|word| !word.is_empty()) {
            let mut parts = word.splitn(2, |&byte| byte == b'=');
            let key = parts.next().unwrap_or_default().trim_ascii();
            let value = parts.next().map(unquoted).filter(|value| !value.is_empty());
            self.parameters.push((key, value));
        }
    }

    /// Returns the value of a parameter, whose name is given in upper case.
    pub(super) fn value(&self, key: &str) -> Option<&'a [u8]> {
        let found = self.parameters.iter().find(|(name, _)| name.eq_ignore_ascii_case(key.as_bytes()));
        found.and_then(|(_, value)| *value)
    }

    /// Returns whether there is a parameter of this name.
    pub(super) fn has(&self, key: &str) -> bool {
        self.parameters.iter().any(|(name, _)| name.eq_ignore_ascii_case(key.as_bytes()))
    }
}

/// Returns the fields of a line, trimmed and without enclosing quotes. A comma at the end adds no field, and commas in
/// quotes do not separate fields.
pub(super) fn fields(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    let line = line.trim_ascii();
    let mut is_quoted = false;
    let separates = move |byte: &u8| {
        is_quoted ^= *byte == b'"';
        *byte == b',' && !is_quoted
    };
    line.strip_suffix(b",").unwrap_or(line).split(separates).map(unquoted)
}

/// Trims a word and removes the quotes around it.
fn unquoted(word: &[u8]) -> &[u8] {
    let word = word.trim_ascii();
    word.strip_prefix(b"\"").and_then(|rest| rest.strip_suffix(b"\"")).unwrap_or(word)
}

/// Reads the number of a node or element, which is positive.
pub(super) fn label(cursor: &Cursor, at: usize, word: &[u8], what: &str) -> Result<u64, IoError> {
    let number = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok());
    number
        .filter(|&number| number > 0)
        .ok_or_else(|| cursor.syntax_at(at, format!("{what} (1 or more)"), word))
}

/// Reads a real number, with an exponent E or, as in Fortran, D.
pub(super) fn real(cursor: &Cursor, at: usize, word: &[u8], what: &str) -> Result<f64, IoError> {
    let number = std::str::from_utf8(word).ok().and_then(|text| match text.parse() {
        Ok(number) => Some(number),
        Err(_) => text.replace(['D', 'd'], "e").parse().ok(),
    });
    number.ok_or_else(|| cursor.syntax_at(at, what, word))
}
