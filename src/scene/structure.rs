//! Compares the tables and keys of a scene file with the JSON schema of scenes: unknown keys, missing keys, values of
//! the wrong type. One walk finds all of them, and each is repaired so that the remaining values can be checked too.
//! The meaning of values is checked in `check.rs`.

mod repair;
mod view;

use std::ops::Range;

use serde_json::{Map, Value as Json};
use toml_edit::{Item, TableLike};

use super::plain::may_be_infinite;
pub(super) use view::span_of;
use view::{List, View, end_of};

/// A difference between a scene file and the schema.
pub(super) struct Flaw {
    /// The key, e.g. `body[0].material.yuong`.
    pub(super) key: String,
    /// Position in the text; for a missing key, the start of its table.
    pub(super) offset: usize,
    /// The problem and the remedy.
    pub(super) message: String,
    /// The key whose change repairs it.
    pub(super) repaired: String,
    repair: Repair,
}

impl Flaw {
    /// Returns the key that was meant, if it was misspelt.
    pub(super) fn meant(&self) -> Option<String> {
        let Repair::Rename(name) = &self.repair else { return None };
        Some(match self.repaired.rsplit_once('.') {
            Some((table, _)) => format!("{table}.{name}"),
            None => name.clone(),
        })
    }
}

/// The change that makes a file agree with the schema.
enum Repair {
    Remove,
    Rename(String),
    Set(Json),
}

/// A value of the file and the corresponding schema.
pub(super) struct Entry<'s> {
    pub(super) key: String,
    /// From the key to the end of the value, including sub-tables.
    pub(super) span: Range<usize>,
    schema: &'s Json,
}

/// Results of a walk over a file.
pub(super) struct Found<'s> {
    pub(super) flaws: Vec<Flaw>,
    pub(super) entries: Vec<Entry<'s>>,
}

/// Keys that a user may expect but that do not exist, with the alternative.
const ABSENT: &[(&[&str], &str)] = &[(
    &["contacts", "collision", "collisions", "friction"],
    "bodies meet where the scene has the table [contact], e.g. `[contact]` with `friction = 0.3` in it; remove this key",
)];

/// The schema of scenes, prepared for the comparison with files.
pub(super) struct Structure {
    schema: Json,
}

impl Structure {
    pub(super) fn of_scenes() -> Self {
        Self { schema: super::Scene::schema() }
    }

    /// Compares a file with the schema.
    pub(super) fn inspect(&self, root: &Item) -> Found<'_> {
        let mut found = Found { flaws: Vec::new(), entries: Vec::new() };
        let place = Place { key: String::new(), offset: 0, end: root.span().map_or(0, |span| span.end) };
        self.value(View::of_item(root), &Shape::plain(&self.schema), &place, &mut found);
        found
    }

    /// Returns an example value that the schema of an entry allows.
    fn sample(&self, schema: &Json) -> Json {
        let schema = self.resolved(schema);
        if let Some(value) = schema.get("default").or_else(|| schema.get("const")) {
            return value.clone();
        }
        if let Some(first) = schema.get("enum").and_then(|names| names.get(0)) {
            return first.clone();
        }
        for key in ["anyOf", "oneOf", "allOf"] {
            if let Some(options) = schema.get(key).and_then(Json::as_array) {
                let real = options.iter().find(|option| !is_of_type(self.resolved(option), "null"));
                return real.map_or(Json::Null, |option| self.sample(option));
            }
        }
        let is = |name: &str| is_of_type(schema, name);
        match () {
            () if is("number") => 1.0.into(),
            () if is("integer") => 1.into(),
            () if is("string") => "".into(),
            () if is("boolean") => false.into(),
            () if is("array") => {
                let count = schema.get("minItems").and_then(Json::as_u64).unwrap_or(0) as usize;
                let item = schema.get("items").map_or(Json::Null, |item| self.sample(item));
                Json::Array(vec![item; count])
            }
            () => {
                let properties = schema.get("properties");
                let of = |key: &Json| {
                    let key = key.as_str()?;
                    Some((key.to_owned(), self.sample(properties?.get(key)?)))
                };
                let required = schema.get("required").and_then(Json::as_array);
                Json::Object(required.into_iter().flatten().filter_map(of).collect())
            }
        }
    }

    /// Returns the flaw of an entry that cannot be read although it agrees with the schema.
    pub(super) fn flaw_of(&self, entry: &Entry, message: String) -> Flaw {
        let repair = Repair::Set(self.sample(entry.schema));
        let (key, repaired) = (entry.key.clone(), entry.key.clone());
        Flaw { key, offset: entry.span.start, message, repaired, repair }
    }

    fn resolved<'s>(&'s self, schema: &'s Json) -> &'s Json {
        let name = schema.get("$ref").and_then(Json::as_str).and_then(|path| path.strip_prefix("#/$defs/"));
        match name.and_then(|name| self.schema.get("$defs")?.get(name)) {
            Some(target) => self.resolved(target),
            None => schema,
        }
    }

    /// Adds the alternatives that a schema allows, except null, to `out`.
    fn options<'s>(&'s self, shape: &Shape<'s>, out: &mut Vec<Shape<'s>>) {
        let schema = self.resolved(shape.schema);
        let extra = match schema.get("allOf") {
            Some(_) => schema.get("properties").and_then(Json::as_object),
            None => shape.extra,
        };
        for key in ["anyOf", "oneOf", "allOf"] {
            if let Some(options) = schema.get(key).and_then(Json::as_array) {
                options.iter().for_each(|option| self.options(&Shape { schema: option, extra }, out));
                return;
            }
        }
        if !is_of_type(schema, "null") || is_nullable(schema) {
            out.push(Shape { schema, extra });
        }
    }

    fn value<'s>(&'s self, view: View<'_>, shape: &Shape<'s>, place: &Place, found: &mut Found<'s>) {
        if !place.key.is_empty() {
            let span = place.offset..place.end;
            found.entries.push(Entry { key: place.key.clone(), span, schema: shape.schema });
        }
        let mut options = Vec::new();
        self.options(shape, &mut options);
        let of_type = |names: &[&str]| -> Vec<&Shape<'s>> {
            options.iter().filter(|option| names.iter().any(|name| is_of_type(option.schema, name))).collect()
        };
        let fitting = match &view {
            View::Table(_) => of_type(&["object"]),
            View::Array(_) => of_type(&["array"]),
            View::Text(_) => of_type(&["string"]),
            View::Integer(_) => of_type(&["integer", "number"]),
            View::Float(_) => of_type(&["number"]),
            View::Boolean => of_type(&["boolean"]),
            View::Date => Vec::new(),
        };
        if fitting.is_empty() {
            let mut expected: Vec<String> = options.iter().map(|option| self.words(option.schema)).collect();
            expected.dedup();
            let message = format!("must be {}, is {}", expected.join(" or "), view.words());
            return found.flaws.push(self.wrong(place, shape.schema, message));
        }
        match view {
            View::Text(text) => {
                let names: Vec<&str> = fitting.iter().flat_map(|option| names(option.schema)).collect();
                let is_free = fitting.iter().any(|option| names_nothing(option.schema));
                if !is_free && !names.contains(&text) {
                    let others = options.iter().filter(|option| !is_of_type(option.schema, "string"));
                    let others: Vec<String> = others.map(|option| self.words(option.schema)).collect();
                    let message = match others.is_empty() || nearest(text, &names).is_some() {
                        true => format!("unknown value \"{text}\"{}", suggestion(text, &names, "\"", "\"")),
                        false => format!(
                            "must be {} or \"{}\", is the string \"{text}\"",
                            others.join(" or "),
                            names.join("\" or \"")
                        ),
                    };
                    found.flaws.push(self.wrong(place, shape.schema, message));
                }
            }
            View::Integer(value) => {
                let least = fitting.iter().filter_map(|option| option.schema.get("minimum")?.as_i64()).min();
                let all = fitting.iter().all(|option| option.schema.get("minimum").is_some());
                if let Some(least) = least.filter(|least| all && value < *least) {
                    let most = fitting.iter().find_map(|option| option.schema.get("maximum")?.as_i64());
                    let message = match most {
                        Some(most) => format!("must be {least} to {most}, is {value}"),
                        None => format!("must be at least {least}, is {value}"),
                    };
                    found.flaws.push(self.wrong(place, shape.schema, message));
                }
            }
            View::Array(items) => {
                let best = self.best(fitting.iter().map(|option| {
                    let mut part = Found { flaws: Vec::new(), entries: Vec::new() };
                    self.items(items, option.schema, place, &mut part);
                    part
                }));
                found.take(best);
            }
            View::Table(table) => self.table(table, &fitting, place, found),
            View::Float(value) if !value.is_finite() && !may_be_infinite(&place.key) => {
                let message = format!("must be a finite number, is {value}");
                found.flaws.push(self.wrong(place, shape.schema, message));
            }
            View::Float(_) | View::Boolean | View::Date => {}
        }
    }

    fn items<'s>(&'s self, items: List<'_>, schema: &'s Json, place: &Place, out: &mut Found<'s>) {
        let bound = |key: &str| schema.get(key).and_then(Json::as_u64).map(|count| count as usize);
        let count = items.len();
        let few = bound("minItems").is_some_and(|least| count < least);
        if few || bound("maxItems").is_some_and(|most| count > most) {
            let message = format!("must be {}, has {count} values", self.words(schema));
            return out.flaws.push(self.wrong(place, schema, message));
        }
        let Some(item) = schema.get("items") else { return };
        for (i, (view, span)) in (0..count).filter_map(|i| Some((i, items.get(i)?))) {
            let place = Place { key: format!("{}[{i}]", place.key), offset: span.start, end: span.end };
            self.value(view, &Shape::plain(item), &place, out);
        }
    }

    /// Compares a table that may have several forms. Its tag (`kind`, `law`) selects the form; of the remaining forms
    /// the one with the fewest flaws counts.
    fn table<'s>(
        &'s self,
        table: &dyn TableLike,
        options: &[&Shape<'s>],
        place: &Place,
        found: &mut Found<'s>,
    ) {
        let tag = options.iter().find_map(|option| option.tag()).filter(|_| options.len() > 1);
        let mut left: Vec<&Shape> = options.to_vec();
        if let Some((tag, _)) = tag {
            let mut tags: Vec<&str> = Vec::new();
            for (_, name) in options.iter().filter_map(|option| option.tag()) {
                // Solids and sheets have laws of the same name.
                if !tags.contains(&name) {
                    tags.push(name);
                }
            }
            let given = table.get(tag).and_then(|item| item.as_str());
            match given {
                Some(name) if tags.contains(&name) => {
                    left.retain(|option| option.tag().is_none_or(|(_, of)| of == name));
                }
                _ => {
                    let (key, message) = (
                        place.child(tag),
                        match table.get(tag) {
                            Some(item) => {
                                let text = item.as_str().unwrap_or_default();
                                format!("unknown value \"{text}\"{}", suggestion(text, &tags, "\"", "\""))
                            }
                            None => format!("missing key `{tag}`: {}", list(&tags, "\"", "\"")),
                        },
                    );
                    let offset =
                        table.key(tag).and_then(|key| key.span()).map_or(place.offset, |span| span.start);
                    // A table without a valid tag cannot be compared further.
                    let repair = Repair::Set(self.sample(options[0].schema));
                    let repaired = place.key.clone();
                    return found.flaws.push(Flaw { key, offset, message, repaired, repair });
                }
            }
        }
        let best = self.best(left.iter().map(|option| {
            let mut part = Found { flaws: Vec::new(), entries: Vec::new() };
            self.keys(table, option, place, &mut part);
            part
        }));
        found.take(best);
    }

    fn keys<'s>(&'s self, table: &dyn TableLike, shape: &Shape<'s>, place: &Place, out: &mut Found<'s>) {
        let Some(properties) = shape.schema.get("properties").and_then(Json::as_object) else { return };
        let schema_of = |key: &str| properties.get(key).or_else(|| shape.extra?.get(key));
        let known: Vec<&str> = properties
            .keys()
            .chain(shape.extra.into_iter().flat_map(Map::keys))
            .map(String::as_str)
            .collect();
        let required: Vec<&str> = shape
            .schema
            .get("required")
            .and_then(Json::as_array)
            .into_iter()
            .flatten()
            .filter_map(Json::as_str)
            .collect();
        let mut missing: Vec<&str> = required.into_iter().filter(|key| table.get(key).is_none()).collect();
        let forbids = |key: &str| shape.schema.get(key) == Some(&Json::Bool(false));
        let is_closed = forbids("additionalProperties") || forbids("unevaluatedProperties");
        for (name, item) in table.iter() {
            let span = table.key(name).and_then(|key| key.span()).unwrap_or(place.offset..place.offset);
            let end = end_of(item).unwrap_or(span.end);
            let inner = Place { key: place.child(name), offset: span.start, end };
            if let Some(schema) = schema_of(name) {
                self.value(View::of_item(item), &Shape::plain(schema), &inner, out);
            } else if is_closed {
                let absent = ABSENT.iter().find(|(names, _)| names.contains(&name));
                let free: Vec<&str> = known.iter().copied().filter(|key| table.get(key).is_none()).collect();
                let meant = nearest(name, &free);
                missing.retain(|key| Some(*key) != meant);
                let (message, repair) = match (absent, meant) {
                    (Some((_, message)), _) => ((*message).to_owned(), Repair::Remove),
                    (None, Some(meant)) => (
                        format!("unknown key `{name}`{}", suggestion(name, &known, "`", "`")),
                        Repair::Rename(meant.to_owned()),
                    ),
                    (None, None) => (
                        format!("unknown key `{name}`{}", suggestion(name, &known, "`", "`")),
                        Repair::Remove,
                    ),
                };
                let (key, repaired) = (inner.key.clone(), inner.key);
                out.flaws.push(Flaw { key, offset: span.start, message, repaired, repair });
            }
        }
        for name in missing {
            let sample = schema_of(name).map_or(Json::Null, |schema| self.sample(schema));
            let what = match schema_of(name).map(|schema| self.words(schema)) {
                Some(words) => format!("missing key `{name}`, {words}; `variational schema` lists the keys"),
                None => format!("missing key `{name}`"),
            };
            let (key, repaired, repair) = (place.child(name), place.child(name), Repair::Set(sample));
            out.flaws.push(Flaw { key, offset: place.offset, message: what, repaired, repair });
        }
    }

    fn wrong(&self, place: &Place, schema: &Json, message: String) -> Flaw {
        let (key, repaired) = (place.key.clone(), place.key.clone());
        Flaw { key, offset: place.offset, message, repaired, repair: Repair::Set(self.sample(schema)) }
    }

    /// Returns the result with the fewest flaws, or the first of equals.
    fn best<'s>(&self, found: impl Iterator<Item = Found<'s>>) -> Found<'s> {
        let none = Found { flaws: Vec::new(), entries: Vec::new() };
        found.min_by_key(|found| found.flaws.len()).unwrap_or(none)
    }

    /// Describes in words what a schema allows.
    fn words(&self, schema: &Json) -> String {
        let mut options = Vec::new();
        self.options(&Shape::plain(schema), &mut options);
        if options.len() > 1 && options.iter().all(|option| names(option.schema).next().is_some()) {
            let names: Vec<&str> = options.iter().flat_map(|option| names(option.schema)).collect();
            return list(&names, "\"", "\"");
        }
        let mut words: Vec<String> = options.iter().map(|option| self.word(option.schema)).collect();
        words.dedup();
        words.join(" or ")
    }

    fn word(&self, schema: &Json) -> String {
        let named: Vec<&str> = names(schema).collect();
        if !named.is_empty() {
            return list(&named, "\"", "\"");
        }
        let is = |name: &str| is_of_type(schema, name);
        match () {
            () if is("number") => "a number".to_owned(),
            () if is("integer") => "a whole number".to_owned(),
            () if is("string") => "a string".to_owned(),
            () if is("boolean") => "true or false".to_owned(),
            () if is("array") => {
                let bound = |key: &str| schema.get(key).and_then(Json::as_u64);
                match (bound("minItems"), bound("maxItems")) {
                    (Some(least), Some(most)) if least == most => format!("a list of {least} values"),
                    _ => "a list".to_owned(),
                }
            }
            () => "a table".to_owned(),
        }
    }
}

/// An alternative of a schema; `extra` holds keys in addition to those of the schema.
#[derive(Clone, Copy)]
struct Shape<'s> {
    schema: &'s Json,
    extra: Option<&'s Map<String, Json>>,
}

impl<'s> Shape<'s> {
    fn plain(schema: &'s Json) -> Self {
        Self { schema, extra: None }
    }

    /// Returns the key that distinguishes it from other alternatives, and its value.
    fn tag(&self) -> Option<(&'s str, &'s str)> {
        let properties = self.schema.get("properties")?.as_object()?;
        properties.iter().find_map(|(key, schema)| Some((key.as_str(), schema.get("const")?.as_str()?)))
    }
}

impl Found<'_> {
    fn take(&mut self, other: Self) {
        self.flaws.extend(other.flaws);
        self.entries.extend(other.entries);
    }
}

struct Place {
    key: String,
    offset: usize,
    end: usize,
}

impl Place {
    fn child(&self, name: &str) -> String {
        if self.key.is_empty() { name.to_owned() } else { format!("{}.{name}", self.key) }
    }
}

fn is_of_type(schema: &Json, name: &str) -> bool {
    match schema.get("type") {
        Some(Json::String(only)) => only == name,
        Some(Json::Array(several)) => several.iter().any(|one| one == name),
        _ => false,
    }
}

/// Returns whether a value may be null, i.e. whether the schema lists several types.
fn is_nullable(schema: &Json) -> bool {
    schema.get("type").is_some_and(Json::is_array)
}

/// Iterates over the strings that a schema allows.
fn names(schema: &Json) -> impl Iterator<Item = &str> {
    let several = schema.get("enum").and_then(Json::as_array).into_iter().flatten();
    several.chain(schema.get("const")).filter_map(Json::as_str)
}

fn names_nothing(schema: &Json) -> bool {
    names(schema).next().is_none()
}

/// Returns the known name that is nearest to a name, if at most a third of its letters differ.
fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let near = |other: &&str| strsim::damerau_levenshtein(&name.to_lowercase(), &other.to_lowercase());
    let allowed = (name.chars().count() / 3).max(1);
    known.iter().copied().min_by_key(near).filter(|other| near(other) <= allowed)
}

/// Formats `; did you mean "x"? Expected one of "x", "y"`.
fn suggestion(name: &str, known: &[&str], open: &str, close: &str) -> String {
    let all = list(known, open, close);
    match nearest(name, known) {
        Some(meant) => format!("; did you mean {open}{meant}{close}? Expected one of {all}"),
        None => format!("; expected one of {all}"),
    }
}

fn list(names: &[&str], open: &str, close: &str) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("{open}{name}{close}")).collect();
    quoted.join(", ")
}
