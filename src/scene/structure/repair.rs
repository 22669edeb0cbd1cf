//! Changes a scene file so that it agrees with the schema and its valid parts can be read.

use serde_json::Value as Json;
use toml_edit::{DocumentMut, InlineTable, Item, Table, TableLike, Value};

use super::view::{Step, steps};
use super::{Flaw, Repair};

impl Flaw {
    /// Changes the file so that the flaw is removed, if possible.
    pub(in crate::scene) fn repair(&self, document: &mut DocumentMut) {
        let mut steps = steps(&self.repaired);
        let Some(last) = steps.pop() else { return };
        let mut spot = Spot::Item(document.as_item_mut());
        for step in steps {
            let Some(next) = spot.enter(&step) else { return };
            spot = next;
        }
        spot.change(&last, &self.repair);
    }
}

/// A place in a file that can be changed.
enum Spot<'a> {
    Item(&'a mut Item),
    Value(&'a mut Value),
    Table(&'a mut Table),
}

impl<'a> Spot<'a> {
    fn table(self) -> Option<&'a mut dyn TableLike> {
        match self {
            Self::Item(item) => item.as_table_like_mut(),
            Self::Value(value) => value.as_inline_table_mut().map(|table| table as &mut dyn TableLike),
            Self::Table(table) => Some(table),
        }
    }

    fn enter(self, step: &Step) -> Option<Self> {
        match (step, self) {
            (Step::Key(name), spot) => spot.table()?.get_mut(name).map(Spot::Item),
            (Step::Index(i), Self::Item(Item::ArrayOfTables(tables))) => tables.get_mut(*i).map(Spot::Table),
            (
                Step::Index(i),
                Self::Item(Item::Value(Value::Array(values))) | Self::Value(Value::Array(values)),
            ) => values.get_mut(*i).map(Spot::Value),
            _ => None,
        }
    }

    fn change(self, step: &Step, repair: &Repair) {
        let Step::Key(name) = step else {
            if let (Repair::Set(sample), Some(spot)) = (repair, self.enter(step)) {
                match (spot, toml_value(sample)) {
                    (Spot::Value(old), Some(new)) => *old = new,
                    (Spot::Table(old), Some(Value::InlineTable(new))) => *old = new.into_table(),
                    _ => {}
                }
            }
            return;
        };
        let Some(table) = self.table() else { return };
        match repair {
            Repair::Remove => drop(table.remove(name)),
            Repair::Rename(other) => {
                if let Some(item) = table.remove(name) {
                    table.insert(other, item);
                }
            }
            Repair::Set(sample) => {
                table.remove(name);
                if let Some(value) = toml_value(sample) {
                    table.insert(name, Item::Value(value));
                }
            }
        }
    }
}

fn toml_value(json: &Json) -> Option<Value> {
    Some(match json {
        Json::Null => return None,
        Json::Bool(value) => (*value).into(),
        Json::Number(number) => match number.as_i64() {
            Some(value) if !number.is_f64() => value.into(),
            _ => number.as_f64()?.into(),
        },
        Json::String(text) => text.into(),
        Json::Array(values) => values.iter().filter_map(toml_value).collect(),
        Json::Object(map) => {
            let entries = map.iter().filter_map(|(key, value)| Some((key, toml_value(value)?)));
            Value::InlineTable(entries.collect::<InlineTable>())
        }
    })
}
