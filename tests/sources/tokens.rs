//! Lists what a source file defines and names, from its tokens. It ignores comments, literals and items under
//! `#[cfg(test)]`.

/// An item of a source file.
#[derive(Debug, PartialEq)]
pub(super) enum Item {
    /// A function, type, trait, constant or macro.
    Definition(String),
    /// A file module that only tests have.
    TestModule(String),
    /// One leaf of a `use` line: `name` is the last name of the path, its alias, or `*`.
    Use { path: Vec<String>, name: String, is_public: bool },
    /// A path of at least two names outside `use` lines.
    Path(Vec<String>),
}

/// Returns the items of a source text, in order.
pub(super) fn items(text: &str) -> Vec<Item> {
    let tokens = tokens(text);
    let mut reader = Reader { tokens: &tokens, at: 0, inline: Vec::new(), depth: 0, items: Vec::new() };
    reader.read();
    reader.items
}

/// Splits a text into names, `::`, and other single characters.
fn tokens(text: &str) -> Vec<String> {
    let bytes: Vec<char> = text.chars().collect();
    let (mut out, mut i) = (Vec::new(), 0);
    let at = |i: usize| bytes.get(i).copied().unwrap_or('\0');
    while i < bytes.len() {
        let c = bytes[i];
        if c == '/' && at(i + 1) == '/' {
            while i < bytes.len() && bytes[i] != '\n' {
                i += 1;
            }
        } else if c == '/' && at(i + 1) == '*' {
            let mut depth = 0;
            loop {
                match (at(i), at(i + 1)) {
                    ('/', '*') => (depth, i) = (depth + 1, i + 2),
                    ('*', '/') => (depth, i) = (depth - 1, i + 2),
                    _ => i += 1,
                }
                if depth == 0 || i >= bytes.len() {
                    break;
                }
            }
        } else if let Some(end) = raw_string(&bytes, i) {
            i = end;
        } else if c == '"' {
            i += 1;
            while i < bytes.len() && bytes[i] != '"' {
                i += if bytes[i] == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if c == '\'' && (at(i + 1) == '\\' || at(i + 2) == '\'') {
            // This is a character literal; a lifetime has no second quote.
            i += if at(i + 1) == '\\' { 3 } else { 2 };
            while i < bytes.len() && bytes[i] != '\'' {
                i += 1;
            }
            i += 1;
        } else if c.is_alphanumeric() || c == '_' {
            let start = i;
            while i < bytes.len() && (bytes[i].is_alphanumeric() || bytes[i] == '_') {
                i += 1;
            }
            out.push(bytes[start..i].iter().collect());
        } else if c == ':' && at(i + 1) == ':' {
            out.push("::".to_owned());
            i += 2;
        } else {
            if !c.is_whitespace() {
                out.push(c.to_string());
            }
            i += 1;
        }
    }
    out
}

/// Returns the end of a raw string that begins at `start`: `r"…"`, `r#"…"#`, `br"…"`.
fn raw_string(text: &[char], start: usize) -> Option<usize> {
    if start > 0 && (text[start - 1].is_alphanumeric() || text[start - 1] == '_') {
        return None;
    }
    let mut i = start + usize::from(text[start] == 'b');
    if text.get(i) != Some(&'r') {
        return None;
    }
    i += 1;
    let hashes = text[i..].iter().take_while(|c| **c == '#').count();
    i += hashes;
    if text.get(i) != Some(&'"') {
        return None;
    }
    let end: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
    (i + 1..text.len()).find(|&k| text[k..].starts_with(&end)).map(|k| k + end.len())
}

struct Reader<'a> {
    tokens: &'a [String],
    at: usize,
    /// The depths of the braces of the enclosing inline modules.
    inline: Vec<usize>,
    depth: usize,
    items: Vec<Item>,
}

impl Reader<'_> {
    fn peek(&self, ahead: usize) -> &str {
        self.tokens.get(self.at + ahead).map_or("", String::as_str)
    }

    fn read(&mut self) {
        let mut is_public = false;
        while self.at < self.tokens.len() {
            let was_public = std::mem::take(&mut is_public);
            match self.peek(0) {
                "#" if self.peek(1) == "[" => self.attribute(),
                "{" => (self.depth, self.at) = (self.depth + 1, self.at + 1),
                "}" => {
                    self.depth = self.depth.saturating_sub(1);
                    self.inline.retain(|&depth| depth <= self.depth);
                    self.at += 1;
                }
                "pub" => {
                    self.at += 1;
                    if self.peek(0) == "(" && ["crate", "super", "in", "self"].contains(&self.peek(1)) {
                        self.skip_group();
                    }
                    is_public = true;
                }
                "mod" => {
                    if self.peek(2) == "{" {
                        self.inline.push(self.depth + 1);
                    }
                    self.at += 2;
                }
                "use" => {
                    self.at += 1;
                    self.use_tree(&mut Vec::new(), was_public);
                }
                "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static" | "union" => {
                    let name = self.peek(1).to_owned();
                    self.define(&name);
                    self.at += 1;
                }
                "macro_rules" => {
                    let name = self.peek(2).to_owned();
                    self.define(&name);
                    self.at += 3;
                }
                name if is_name(name) && self.peek(1) == "::" => self.path(),
                _ => self.at += 1,
            }
        }
    }

    fn define(&mut self, name: &str) {
        if is_name(name) {
            self.items.push(Item::Definition(name.to_owned()));
        }
    }

    /// Reads an attribute, and skips the item under `#[cfg(test)]`.
    fn attribute(&mut self) {
        let start = self.at;
        self.at += 1;
        self.skip_group();
        let is_test =
            self.tokens[start..self.at].windows(3).any(|w| w[0] == "cfg" && w[1] == "(" && w[2] == "test");
        if !is_test {
            return;
        }
        while self.peek(0) == "#" {
            self.at += 1;
            self.skip_group();
        }
        if self.peek(0) == "mod" && self.peek(2) == ";" {
            let name = self.peek(1).to_owned();
            self.items.push(Item::TestModule(name));
        }
        while self.at < self.tokens.len() && self.peek(0) != "{" && self.peek(0) != ";" {
            self.at += 1;
        }
        if self.peek(0) == "{" { self.skip_group() } else { self.at += 1 }
    }

    /// Skips a group in brackets of any kind that begins here.
    fn skip_group(&mut self) {
        let mut depth = 0;
        while self.at < self.tokens.len() {
            match self.peek(0) {
                "(" | "[" | "{" => depth += 1,
                ")" | "]" | "}" => depth -= 1,
                _ => {}
            }
            self.at += 1;
            if depth == 0 {
                return;
            }
        }
    }

    /// Reads the rest of a `use` line, or of a group in one, after `prefix`.
    fn use_tree(&mut self, prefix: &mut Vec<String>, is_public: bool) {
        let length = prefix.len();
        loop {
            match self.peek(0) {
                "{" => {
                    self.at += 1;
                    while self.at < self.tokens.len() && self.peek(0) != "}" {
                        self.use_tree(prefix, is_public);
                        if self.peek(0) == "," {
                            self.at += 1;
                        }
                    }
                    self.at += 1;
                    break;
                }
                "::" => self.at += 1,
                "*" => {
                    self.at += 1;
                    let path = self.relative(prefix.clone());
                    self.items.push(Item::Use { path, name: "*".to_owned(), is_public });
                    break;
                }
                name if is_name(name) => {
                    prefix.push(name.to_owned());
                    self.at += 1;
                    if self.peek(0) == "::" {
                        continue;
                    }
                    let mut path = prefix.clone();
                    if path.last().is_some_and(|last| last == "self") && path.len() > 1 {
                        path.pop();
                    }
                    let mut name = path.last().cloned().unwrap_or_default();
                    if self.peek(0) == "as" {
                        name = self.peek(1).to_owned();
                        self.at += 2;
                    }
                    let path = self.relative(path);
                    self.items.push(Item::Use { path, name, is_public });
                    break;
                }
                _ => {
                    self.at += 1;
                    break;
                }
            }
        }
        prefix.truncate(length);
    }

    fn path(&mut self) {
        let mut path = vec![self.peek(0).to_owned()];
        // `$crate::` in a macro is a path at its call site.
        let follows_name = self.at > 0 && [".", "::", "$"].contains(&self.tokens[self.at - 1].as_str());
        self.at += 1;
        while self.peek(0) == "::" && is_name(self.peek(1)) {
            path.push(self.peek(1).to_owned());
            self.at += 2;
        }
        if path.len() > 1 && !follows_name {
            let path = self.relative(path);
            self.items.push(Item::Path(path));
        }
    }

    /// Returns a path as seen from the file: `super` inside an inline module stands for the enclosing module.
    fn relative(&self, mut path: Vec<String>) -> Vec<String> {
        let supers = path.iter().take_while(|name| *name == "super").count();
        let inner = supers.min(self.inline.len());
        path.drain(..inner);
        if inner > 0 && inner == supers {
            path.insert(0, "self".to_owned());
        }
        path
    }
}

fn is_name(token: &str) -> bool {
    token.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_')
}
