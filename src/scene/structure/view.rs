//! Read access to a scene file during a walk: values with their positions in the text, and keys as paths.

use std::ops::Range;

use toml_edit::{Array, ArrayOfTables, Item, Table, TableLike, Value};

/// A value of the file.
#[derive(Clone)]
pub(super) enum View<'a> {
    Table(&'a dyn TableLike),
    Array(List<'a>),
    Text(&'a str),
    Integer(i64),
    Float(f64),
    Boolean,
    Date,
}

impl<'a> View<'a> {
    pub(super) fn of_item(item: &'a Item) -> Self {
        match item {
            Item::Value(value) => Self::of_value(value),
            Item::Table(table) => Self::Table(table),
            Item::ArrayOfTables(tables) => Self::Array(List::Tables(tables)),
            Item::None => Self::Text(""),
        }
    }

    fn of_value(value: &'a Value) -> Self {
        match value {
            Value::String(text) => Self::Text(text.value()),
            Value::Integer(value) => Self::Integer(*value.value()),
            Value::Float(value) => Self::Float(*value.value()),
            Value::Boolean(_) => Self::Boolean,
            Value::Datetime(_) => Self::Date,
            Value::Array(values) => Self::Array(List::Values(values)),
            Value::InlineTable(table) => Self::Table(table),
        }
    }

    pub(super) fn words(&self) -> &'static str {
        match self {
            Self::Table(_) => "a table",
            Self::Array(_) => "a list",
            Self::Text(_) => "a string",
            Self::Integer(_) => "a whole number",
            Self::Float(_) => "a number",
            Self::Boolean => "true or false",
            Self::Date => "a date",
        }
    }
}

/// A list of the file. Its elements are not converted in advance, because a caller may need one of thousands.
#[derive(Clone, Copy)]
pub(super) enum List<'a> {
    Tables(&'a ArrayOfTables),
    Values(&'a Array),
}

impl<'a> List<'a> {
    pub(super) fn len(self) -> usize {
        match self {
            Self::Tables(tables) => tables.len(),
            Self::Values(values) => values.len(),
        }
    }

    /// Returns an element and its position in the text.
    pub(super) fn get(self, index: usize) -> Option<(View<'a>, Range<usize>)> {
        match self {
            Self::Tables(tables) => tables.get(index).map(|table| (View::Table(table), span_of_table(table))),
            Self::Values(values) => {
                values.get(index).map(|value| (View::of_value(value), value.span().unwrap_or_default()))
            }
        }
    }
}

/// Returns the span from the header of a table to the end of its last entry.
fn span_of_table(table: &Table) -> Range<usize> {
    let header = table.span().unwrap_or_default();
    let ends = table.iter().filter_map(|(_, item)| end_of(item));
    header.start..ends.fold(header.end, usize::max)
}

pub(super) fn end_of(item: &Item) -> Option<usize> {
    match item {
        Item::Value(value) => Some(value.span()?.end),
        Item::Table(table) => Some(span_of_table(table).end),
        Item::ArrayOfTables(tables) => Some(span_of_table(tables.iter().last()?).end),
        Item::None => None,
    }
}

/// A part of a key.
pub(super) enum Step<'a> {
    Key(&'a str),
    Index(usize),
}

/// Splits `body[0].name` into its parts.
pub(super) fn steps(key: &str) -> Vec<Step<'_>> {
    let mut steps = Vec::new();
    for part in key.split('.') {
        let mut pieces = part.split('[');
        steps.extend(pieces.next().map(Step::Key));
        steps.extend(pieces.filter_map(|piece| Some(Step::Index(piece.strip_suffix(']')?.parse().ok()?))));
    }
    steps
}

/// Returns the span of a key path such as `body[0].material.density`, or of the nearest key above it.
pub(in crate::scene) fn span_of(root: &Item, key: &str) -> Option<Range<usize>> {
    let mut view = View::of_item(root);
    let mut span = None;
    for step in steps(key) {
        let next = match (&step, &view) {
            (Step::Key(name), View::Table(table)) => {
                let own = table.key(name).and_then(|key| key.span());
                let item = table.get(name);
                // The position of a table is its header.
                let header = item.and_then(Item::as_table).and_then(Table::span);
                span = header.or(own).or(span);
                item.map(View::of_item)
            }
            (Step::Index(i), View::Array(items)) => {
                let found = items.get(*i);
                span = found.as_ref().map(|(_, span)| span.clone()).or(span);
                found.map(|(view, _)| view)
            }
            _ => None,
        };
        match next {
            Some(next) => view = next,
            None => break,
        }
    }
    span
}
