//! One thing that is wrong with a scene.

use std::fmt;
use std::path::PathBuf;

/// One thing that is wrong with a scene: where, what, and the way out.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// The scene file, where there is one.
    pub file: Option<PathBuf>,
    /// Line in that file, from 1.
    pub line: Option<usize>,
    /// The key, e.g. `body[0].material.density`; empty for the whole scene.
    pub key: String,
    /// What is wrong, and the way out.
    pub message: String,
}

impl Problem {
    /// A problem at a key.
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { file: None, line: None, key: key.into(), message: message.into() }
    }
}

/// A text of which no more than its beginning and its end are shown, in messages that repeat what a file says.
struct Shortened<'a>(&'a str);

/// Characters that are shown of the beginning and of the end.
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

/// Names for a message: the first few, and how many more there are, so that many messages about many names stay short.
pub(super) fn some_of(names: &[&str]) -> String {
    const FEW: usize = 12;
    let first = names[..names.len().min(FEW)].join(", ");
    if names.len() > FEW { format!("{first} and {} more", names.len() - FEW) } else { first }
}
