//! Parses TOML to a scene, and finds all problems at once, each with its line. `structure.rs` checks keys and types,
//! `check.rs` the values.

use std::path::Path;

use toml_edit::{Document, DocumentMut};

use super::set::set;
use super::structure::{Entry, Flaw, Structure, span_of};
use super::{Problem, Scene};

/// The result of reading a scene file.
#[derive(Debug)]
pub struct Parsed {
    /// The scene, unless the file is not TOML. Keys or types with problems are replaced by valid substitutes.
    pub scene: Option<Scene>,
    /// All problems of keys, types and values, in the order of lines.
    pub problems: Vec<Problem>,
    source: Option<Source>,
    /// Keys with substituted values.
    repaired: Vec<String>,
    /// Keys that misspelt ones were taken for.
    meant: Vec<String>,
}

/// The text of a scene file.
#[derive(Debug)]
struct Source {
    document: Document<String>,
    lines: Lines,
}

impl Source {
    /// Returns the line of a key, or of the nearest key above it.
    fn line_of(&self, key: &str) -> Option<usize> {
        Some(self.lines.at(span_of(self.document.as_item(), key)?.start))
    }
}

/// The offsets at which the lines of a text begin.
#[derive(Debug)]
struct Lines(Vec<usize>);

impl Lines {
    fn of(text: &str) -> Self {
        Self(std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect())
    }

    /// Returns the line of an offset, from 1.
    fn at(&self, offset: usize) -> usize {
        self.0.partition_point(|&start| start <= offset)
    }
}

impl Scene {
    /// Reads a scene file, after setting `overrides` (`time.step=0.01`) in it. Mesh paths become relative to the file's
    /// directory.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read. Problems of its content are part of the result.
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

    /// Parses a scene; mesh paths are not changed.
    pub fn parse(text: &str, overrides: &[String]) -> Parsed {
        let (text, mut problems) = set(text, overrides);
        let document = match Document::parse(text.clone()) {
            Ok(document) => document,
            Err(error) => {
                let line = error.span().map(|span| Lines::of(&text).at(span.start));
                let message = format!("not TOML: {}", error.message());
                problems.push(Problem { line, ..Problem::new("", message) });
                return Parsed {
                    scene: None,
                    problems,
                    source: None,
                    repaired: Vec::new(),
                    meant: Vec::new(),
                };
            }
        };
        let source = Source { lines: Lines::of(&text), document };
        let (scene, found, [repaired, meant]) = decode(&source);
        problems.extend(found);
        let mut parsed = Parsed { scene, problems, source: Some(source), repaired, meant };
        if let Some(scene) = &parsed.scene {
            let found = parsed.relevant(scene.problems());
            parsed.problems.extend(found);
        }
        parsed.problems.sort_by_key(|problem| problem.line);
        parsed
    }

    /// Writes the scene as TOML.
    ///
    /// # Errors
    /// Returns an error if a value cannot be written as TOML (a path that is not Unicode).
    pub fn to_toml(&self) -> Result<String, toml_edit::ser::Error> {
        toml_edit::ser::to_string_pretty(self)
    }
}

impl Parsed {
    /// Adds to a problem the line of its key, or of the nearest key above it.
    pub fn locate(&self, problem: Problem) -> Problem {
        let line = self.source.as_ref().and_then(|source| source.line_of(&problem.key));
        Problem { line, ..problem }
    }

    /// Returns the problems with their lines, without those caused by substitutes, which have already been reported.
    pub fn relevant(&self, problems: Vec<Problem>) -> Vec<Problem> {
        let is_name = |key: &String| key.ends_with(".name") || key == "body" || key == "rigid";
        let lacks_names = self.repaired.iter().any(is_name);
        let is_stand_in = |problem: &Problem| {
            let of = |key: &String| {
                problem
                    .key
                    .strip_prefix(key.as_str())
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
            };
            // Laws report their parameters by the key of their table.
            let is_of_substitute = |key: &String| {
                let leaf = key.strip_prefix(problem.key.as_str()).and_then(|rest| rest.strip_prefix('.'));
                leaf.is_some_and(|leaf| problem.message.starts_with(&format!("{leaf} = ")))
            };
            self.repaired.iter().any(|key| of(key) || is_of_substitute(key))
                || self.meant.contains(&problem.key)
                || lacks_names && problem.message.starts_with("there is no ")
        };
        problems
            .into_iter()
            .filter(|problem| !is_stand_in(problem))
            .map(|problem| self.locate(problem))
            .collect()
    }
}

/// Decodes the scene of a file. Each fault is recorded and repaired, so that the rest can be read. The last lists hold
/// the keys that were repaired, and those that were meant by misspelt ones.
fn decode(source: &Source) -> (Option<Scene>, Vec<Problem>, [Vec<String>; 2]) {
    let (structure, document) = (Structure::of_scenes(), &source.document);
    let (mut problems, mut repaired, mut meant) = (Vec::new(), Vec::new(), Vec::new());
    let mut text = document.raw().to_owned();
    let mut flaws = structure.inspect(document.as_item()).flaws;
    for flaw in &flaws {
        let line = Some(source.lines.at(flaw.offset));
        problems.push(Problem { line, ..Problem::new(flaw.key.clone(), flaw.message.clone()) });
    }
    loop {
        if !flaws.is_empty() {
            let Ok(mut changed) = text.parse::<DocumentMut>() else {
                return (None, problems, [repaired, meant]);
            };
            flaws.iter().for_each(|flaw| flaw.repair(&mut changed));
            repaired.extend(flaws.iter().map(|flaw| flaw.repaired.clone()));
            meant.extend(flaws.iter().filter_map(Flaw::meant));
            text = changed.to_string();
        }
        let error = match toml_edit::de::from_str::<Scene>(&text) {
            Ok(scene) => return (Some(scene), problems, [repaired, meant]),
            Err(error) => error,
        };
        match flaw_behind(&error, &text, &structure, &repaired) {
            Some(flaw) => {
                let line = source.line_of(&flaw.key);
                problems.push(Problem { line, ..Problem::new(flaw.key.clone(), flaw.message.clone()) });
                flaws = vec![flaw];
            }
            None => {
                problems.push(Problem::new("", error.message().replace('\n', " ")));
                return (None, problems, [repaired, meant]);
            }
        }
    }
}

/// Returns the smallest entry in which reading failed, for a reason that the schema does not describe (such as a
/// formula).
fn flaw_behind(
    error: &toml_edit::de::Error,
    text: &str,
    structure: &Structure,
    repaired: &[String],
) -> Option<Flaw> {
    let (span, document) = (error.span()?, Document::parse(text).ok()?);
    let found = structure.inspect(document.as_item());
    let holds = |entry: &&Entry| entry.span.start <= span.start && span.end <= entry.span.end;
    let untried = |entry: &&Entry| !repaired.contains(&entry.key);
    let entry = found.entries.iter().filter(holds).filter(untried).min_by_key(|entry| entry.span.len())?;
    Some(structure.flaw_of(entry, error.message().replace('\n', " ")))
}
