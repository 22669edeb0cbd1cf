//! Scene keys of the material of a body: of a solid, or of a sheet, which has a thickness.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use vi_fem::{FemError, Law, OwnLaw, SheetLaw};

/// A law with its parameters. The table of a sheet's law has the key `thickness`; that of a solid's law has not.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Substance {
    /// Material of a solid.
    Solid(Law),
    /// Material of a sheet.
    Sheet(SheetLaw),
}

impl Substance {
    /// Returns the scene name of the law.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Solid(law) => law.name(),
            Self::Sheet(law) => law.name(),
        }
    }

    /// Returns the dimension of its cells: 3 for a solid, 2 for a sheet.
    pub fn dimension(&self) -> usize {
        match self {
            Self::Solid(_) => 3,
            Self::Sheet(_) => 2,
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// Returns all problems at once.
    pub fn check(&self) -> Result<(), Vec<FemError>> {
        match self {
            Self::Solid(law) => law.check(),
            Self::Sheet(law) => law.check(),
        }
    }
}

impl From<Law> for Substance {
    fn from(law: Law) -> Self {
        Self::Solid(law)
    }
}

impl From<OwnLaw> for Substance {
    fn from(law: OwnLaw) -> Self {
        Self::Solid(law.into())
    }
}

impl From<SheetLaw> for Substance {
    fn from(law: SheetLaw) -> Self {
        Self::Sheet(law)
    }
}

type Table = serde_json::Map<String, serde_json::Value>;

/// Returns whether a table describes a sheet's material. Keys and laws that only sheets have count too, so that a
/// missing `thickness` is reported.
fn describes_sheet(table: &Table) -> bool {
    let law = table.get("law").and_then(serde_json::Value::as_str);
    ["thickness", "area_density", "bending", "tension_field"].iter().any(|key| table.contains_key(*key))
        || law.is_some_and(|law| SheetLaw::NAMES.contains(&law) && !Law::NAMES.contains(&law))
}

/// A material, and the region that it applies to; without a region, all elements that no other entry names.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialEntry {
    /// The region.
    pub region: Option<String>,
    /// The law and its parameters.
    pub law: Substance,
}

impl Serialize for MaterialEntry {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut value = serde_json::to_value(&self.law).map_err(serde::ser::Error::custom)?;
        if let (Some(region), Some(table)) = (&self.region, value.as_object_mut()) {
            table.insert("region".to_owned(), region.as_str().into());
        }
        value.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for MaterialEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        use serde::de::Error;
        let mut table = Table::deserialize(deserializer)?;
        let region = match table.remove("region") {
            None => None,
            Some(serde_json::Value::String(name)) => Some(name),
            Some(other) => return Err(D::Error::custom(format!("region: expected a string, found {other}"))),
        };
        let is_sheet = describes_sheet(&table);
        let table = serde_json::Value::Object(table);
        let law = if is_sheet {
            SheetLaw::deserialize(table).map(Substance::Sheet)
        } else {
            Law::deserialize(table).map(Substance::Solid)
        };
        Ok(Self { region, law: law.map_err(D::Error::custom)? })
    }
}

/// One material for the whole body, or one per region.
#[derive(Debug, Clone, PartialEq)]
pub struct Materials(pub Vec<MaterialEntry>);

impl Serialize for Materials {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0.as_slice() {
            [one] if one.region.is_none() => one.serialize(serializer),
            many => many.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Materials {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMany;
        impl<'de> serde::de::Visitor<'de> for OneOrMany {
            type Value = Materials;
            fn expecting(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
                formatter.write_str("a material table, or a list of them with `region`")
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Materials, A::Error> {
                let one = MaterialEntry::deserialize(serde::de::value::MapAccessDeserializer::new(map))?;
                Ok(Materials(vec![one]))
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, seq: A) -> Result<Materials, A::Error> {
                Vec::deserialize(serde::de::value::SeqAccessDeserializer::new(seq)).map(Materials)
            }
        }
        deserializer.deserialize_any(OneOrMany)
    }
}

impl JsonSchema for Materials {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Materials".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let law = generator.subschema_for::<Substance>();
        schemars::json_schema!({
            "description": "One material, or a list of materials with `region`, the volume (of a sheet: the surface) that each fills.",
            "anyOf": [law, { "type": "array", "items": { "allOf": [law], "properties": { "region": { "type": "string" } } } }]
        })
    }
}
