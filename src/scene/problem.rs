//! A single problem of a scene.

use std::fmt;
use std::path::PathBuf;

/// A single problem of a scene: its place, what is wrong, and the remedy.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// The scene file, if there is one.
    pub file: Option<PathBuf>,
    /// Line in that file, from 1.
    pub line: Option<usize>,
    /// The key, e.g. `body[0].material.density`; empty for the whole scene.
    pub key: String,
    /// What is wrong, and the remedy.
    pub message: String,
}

impl Problem {
    /// Makes a problem of a key.
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { file: None, line: None, key: key.into(), message: message.into() }
    }
}

/// Shows only the beginning and the end of a long text, for messages that repeat the content of a file.
struct Shortened<'a>(&'a str);

/// Number of characters shown of the beginning and of the end.
const SHOWN: [usize; 2] = [1500, 500];

impl fmt::Display for Shortened<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(text) = self;
        let count = text.chars().count();
        let hidden = count.saturating_sub(SHOWN[0] + SHOWN[1]);
        if hidden == 0 {
            return f.write_str(text);
        }
        let at = |character: usize| text.char_indices().nth(character).map_or(text.len(), |(byte, _)| byte);
        let [first, last] = [&text[..at(SHOWN[0])], &text[at(SHOWN[0] + hidden)..]];
        write!(f, "{first} … ({hidden} characters) … {last}")
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}:", file.display())?;
            match self.line {
                Some(line) => write!(f, "{line}: ")?,
                None => f.write_str(" ")?,
            }
        }
        if !self.key.is_empty() {
            write!(f, "{}: ", Shortened(&self.key))?;
        }
        write!(f, "{}", Shortened(&self.message))
    }
}

/// Lists names for a message: the first few and the number of the others, to keep messages short.
pub(super) fn some_of(names: &[&str]) -> String {
    const FEW: usize = 12;
    let first = names[..names.len().min(FEW)].join(", ");
    if names.len() > FEW { format!("{first} and {} more", names.len() - FEW) } else { first }
}
