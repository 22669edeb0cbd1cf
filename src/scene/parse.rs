//! From TOML to a scene, with every problem found at once and the line that it stands on.
//! It must not know what values mean: that is `check.rs`.

use std::collections::HashSet;
use std::ops::Range;
use std::path::Path;

use toml_edit::{Document, DocumentMut, Item, Value};

use super::{Problem, Scene};

/// A scene file as it was read.
#[derive(Debug)]
pub struct Parsed {
    /// The scene, unless what is wrong leaves none.
    pub scene: Option<Scene>,
    /// Everything that is wrong with keys, types and values, in the order of lines.
    pub problems: Vec<Problem>,
    text: String,
}

impl Scene {
    /// Reads a scene file, after setting `overrides` (`time.step=0.01`) in it. Mesh paths become
    /// relative to the file's directory.
    ///
    /// # Errors
    /// Where the file cannot be read. Everything that is wrong with its content is in the result.
    pub fn read(path: &Path, overrides: &[String]) -> std::io::Result<Parsed> {
        let text = std::fs::read_to_string(path)?;
        let mut parsed = Self::parse(&text, overrides);
        let directory = path.parent().unwrap_or(Path::new(""));
        parsed.scene = parsed.scene.map(|scene| scene.relative_to(directory));
        for problem in &mut parsed.problems {
            problem.file = Some(path.to_owned());
        }
        Ok(parsed)
    }

    /// Parses a scene; mesh paths stay as they are.
    pub fn parse(text: &str, overrides: &[String]) -> Parsed {
        let (text, mut problems) = match set(text, overrides) {
            Ok(text) => (text, Vec::new()),
            Err(problem) => (text.to_owned(), vec![problem]),
        };
        let mut masked = text.clone();
        let scene = decode(&text, &mut masked, &mut problems);
        let mut parsed = Parsed { scene, problems, text };
        if let Some(scene) = &parsed.scene {
            // What a blanked table leaves behind is not worth a second message.
            let had_problems = !parsed.problems.is_empty();
            let found: Vec<_> = scene
                .problems()
                .into_iter()
                .filter(|problem| !(had_problems && problem.message.starts_with("there is no body")))
                .collect();
            let located: Vec<_> = found.into_iter().map(|problem| parsed.locate(problem)).collect();
            parsed.problems.extend(located);
        }
        parsed.problems.sort_by_key(|problem| problem.line);
        parsed
    }

    /// The scene as TOML.
    ///
    /// # Errors
    /// Where a value cannot be written as TOML (a path that is not Unicode).
    pub fn to_toml(&self) -> Result<String, toml_edit::ser::Error> {
        toml_edit::ser::to_string_pretty(self)
    }
}

impl Parsed {
    /// Gives a problem the line of its key, or of the nearest key above it.
    pub fn locate(&self, problem: Problem) -> Problem {
        let line = Document::parse(self.text.as_str())
            .ok()
            .and_then(|document| span_of(document.as_item(), &problem.key))
            .map(|span| line_of(&self.text, span.start));
        Problem { line, ..problem }
    }
}

/// Decodes the text; each key that serde refuses is noted, blanked in `masked`, and the rest tried again.
fn decode(text: &str, masked: &mut String, problems: &mut Vec<Problem>) -> Option<Scene> {
    let document = match Document::parse(text) {
        Ok(document) => document,
        Err(error) => {
            let line = error.span().map(|span| line_of(text, span.start));
            let message = format!("not TOML: {}", error.message());
            problems.push(Problem { line, ..Problem::new("", message) });
            return None;
        }
    };
    let entries = entries(document.as_item());
    let mut blanked: HashSet<usize> = HashSet::new();
    loop {
        let error = match toml_edit::de::from_str::<Scene>(masked) {
            Ok(scene) => return Some(scene),
            Err(error) => error,
        };
        let Some(span) = error.span() else {
            problems.push(Problem::new("", error.message()));
            return None;
        };
        let missing = error.message().strip_prefix("missing field ");
        // The smallest entry that holds the error, and was not blanked before.
        let at = (0..entries.len())
            .filter(|i| !blanked.contains(i))
            .filter(|&i| entries[i].whole.start <= span.start && span.end <= entries[i].whole.end)
            .min_by_key(|&i| entries[i].whole.len());
        let key = at.map_or(String::new(), |i| entries[i].key.clone());
        let child_was_blanked = |name: &str| {
            let child = if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
            blanked
                .iter()
                .any(|&i| entries[i].key == child || entries[i].key.starts_with(&format!("{child}[")))
        };
        let known = missing.is_some_and(|name| child_was_blanked(name.trim_matches('`')));
        if !known {
            let message = match missing {
                Some(name) => format!("missing key {name}; `variational schema` lists the keys"),
                None => error.message().replace("unknown field", "unknown key").replace('\n', " "),
            };
            let line = at.map(|i| {
                line_of(text, entries[i].whole.start.max(if missing.is_some() { 0 } else { span.start }))
            });
            problems.push(Problem { line, ..Problem::new(key, message) });
        }
        let i = at?;
        blanked.insert(i);
        for range in &entries[i].erase {
            let blank: String =
                masked[range.clone()].chars().map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
            // One space a byte keeps every later offset where it was.
            let padding = range.len() - blank.len();
            masked.replace_range(range.clone(), &(blank + &" ".repeat(padding)));
        }
    }
}

/// A key with its value as it stands in the text.
struct Entry {
    /// Its path, e.g. `body[0].material`.
    key: String,
    /// From the start of the key to the end of the value, including sub-tables.
    whole: Range<usize>,
    /// What to erase so that the entry is gone and the rest still is TOML.
    erase: Vec<Range<usize>>,
}

/// All entries that can be erased: keys of tables, tables, elements of arrays of tables.
fn entries(root: &Item) -> Vec<Entry> {
    let mut out = Vec::new();
    collect(root, "", &mut out);
    out
}

fn collect(item: &Item, path: &str, out: &mut Vec<Entry>) {
    let Some(table) = item.as_table_like() else { return };
    for (name, child) in table.iter() {
        let key = if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
        let key_span = table.key(name).and_then(|key| key.span());
        match child {
            Item::ArrayOfTables(array) => {
                for (i, element) in array.iter().enumerate() {
                    let element = Item::Table(element.clone());
                    table_entry(&element, format!("{key}[{i}]"), out);
                }
            }
            Item::Table(_) => table_entry(child, key, out),
            Item::Value(value) => {
                if let (Some(start), Some(end)) = (key_span, value.span()) {
                    let whole = start.start..end.end;
                    if let Value::InlineTable(_) = value {
                        collect(child, &key, out);
                    }
                    // Inside an inline table a lone comma would be left: only the outermost key is erased.
                    if !path.is_empty() && table_is_inline(item) {
                        continue;
                    }
                    out.push(Entry { key, erase: vec![whole.clone()], whole });
                }
            }
            Item::None => {}
        }
    }
}

fn table_is_inline(item: &Item) -> bool {
    matches!(item, Item::Value(Value::InlineTable(_)))
}

/// A `[table]` or one element of `[[tables]]`: erased with its header and all its entries.
fn table_entry(item: &Item, key: String, out: &mut Vec<Entry>) {
    let first = out.len();
    collect(item, &key, out);
    let header = item.as_table().and_then(|table| table.span());
    let inner: Vec<Range<usize>> = out[first..].iter().flat_map(|entry| entry.erase.clone()).collect();
    let Some(header) = header else { return };
    let end = inner.iter().map(|range| range.end).max().unwrap_or(header.end).max(header.end);
    let mut erase = inner;
    erase.push(header.clone());
    out.push(Entry { key, whole: header.start..end, erase });
}

/// The span of a key path such as `body[0].material.density`, or of the nearest key above it.
fn span_of(root: &Item, key: &str) -> Option<Range<usize>> {
    let mut item = root.clone();
    let mut span = None;
    for part in key.split('.') {
        let (name, index) = match part.split_once('[') {
            Some((name, rest)) => (name, rest.trim_end_matches(']').parse::<usize>().ok()),
            None => (part, None),
        };
        let child = item.as_table_like().and_then(|table| {
            span = table.key(name).and_then(|key| key.span()).or(span.clone());
            table.get(name).cloned()
        });
        let Some(child) = child else { break };
        item = match (&child, index) {
            (Item::ArrayOfTables(array), Some(i)) => match array.get(i) {
                Some(table) => Item::Table(table.clone()),
                None => break,
            },
            (Item::Value(Value::Array(array)), Some(i)) => match array.get(i) {
                Some(value) => Item::Value(value.clone()),
                None => break,
            },
            _ => child,
        };
        span = match &item {
            Item::Table(table) => table.span().or(span),
            _ => span,
        };
    }
    span
}

fn line_of(text: &str, offset: usize) -> usize {
    text.as_bytes()[..offset.min(text.len())].iter().filter(|&&byte| byte == b'\n').count() + 1
}

/// Sets `key.path=value` overrides in the text.
fn set(text: &str, overrides: &[String]) -> Result<String, Problem> {
    if overrides.is_empty() {
        return Ok(text.to_owned());
    }
    // A text that is no TOML is reported where it is decoded.
    let Ok(mut document) = text.parse::<DocumentMut>() else { return Ok(text.to_owned()) };
    for assignment in overrides {
        let wrong = |why: &str| Problem::new("", format!("--set {assignment}: {why}"));
        let (path, value) = assignment.split_once('=').ok_or_else(|| wrong("write it as key.path=value"))?;
        let value: Value = value
            .trim()
            .parse()
            .or_else(|_| format!("{:?}", value.trim()).parse())
            .map_err(|_| wrong("no TOML value"))?;
        let mut item = document.as_item_mut();
        let parts: Vec<_> = path.trim().split('.').collect();
        for (depth, part) in parts.iter().enumerate() {
            let is_last = depth + 1 == parts.len();
            item = match part.parse::<usize>() {
                Ok(index) => item.get_mut(index).ok_or_else(|| wrong("there is no such element"))?,
                Err(_) => {
                    if !is_last && item.get(part).is_none() {
                        item[part] = toml_edit::table();
                    }
                    if item.as_table_like().is_none() {
                        return Err(wrong("leads through a value that has no keys"));
                    }
                    &mut item[part]
                }
            };
        }
        *item = Item::Value(value);
    }
    Ok(document.to_string())
}
