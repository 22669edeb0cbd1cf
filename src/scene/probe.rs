//! Scene keys of probes: nodes, or quantities over a part of a body.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Axis, Field, Selection};

/// `[[probe]]`: columns of history.csv for a node or a part of a body.
///
/// With `point` or `node` it is a node: columns `name.x` `name.y` `name.z` (position, m) and `name.ux` `name.uy`
/// `name.uz` (displacement, m). With `sum`, `mean`, `max` or `min` it is a quantity over the nodes that `region`,
/// `box`, `plane`, `sphere`, `nodes` or `node_file` select (without them: over the body): columns such as
/// `name.sum.reaction_force.x`, `name.max.von_mises`, `name.mean.stress.xy`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Prefix of its columns.
    pub name: String,
    /// The body; not for a probe of contact force.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub body: String,
    /// The force between two bodies, with `sum = "contact_force"`: columns `name.fx` `name.fy` `name.fz`, the mean
    /// force of the second body on the first over the last step, N. Needs `[contact]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub between: Option<[String; 2]>,
    /// The node nearest to this point at rest, m …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<[f64; 3]>,
    /// … or a node, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<usize>,
    /// A part of the body, for sum, mean, max and min (default: all of it).
    #[serde(flatten)]
    pub on: Selection,
    /// The sum over the nodes of "reaction_force" or "external_force", N. It is one number with `.x`, `.y`, `.z` or
    /// `.magnitude` (of the sum), otherwise three.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sum: Option<String>,
    /// The mean of a field: over the nodes, or over the elements weighted by rest volume. Fields are those of
    /// `output.fields`. Components are `.x` `.y` `.z` `.magnitude` of vectors and `.xx` `.xy` … `.zz` of tensors;
    /// without one there is a column per component.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<String>,
    /// The largest value of a field, component by component. An element belongs to the part if its region does, or if
    /// one of its nodes does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<String>,
    /// The smallest value of a field, component by component.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<String>,
    /// Find the pitch (frequency of the strongest oscillation, Hz) of the displacement along this axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pitch: Option<Axis>,
}

/// Name of the quantity of a probe between two bodies.
const CONTACT_FORCE: &str = "contact_force";

/// A statistic of the values of a field over a part of a body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Statistic {
    /// The sum over nodes.
    Sum,
    /// The mean over nodes, or over elements by volume.
    Mean,
    /// The largest.
    Max,
    /// The smallest.
    Min,
}

impl Statistic {
    /// Returns the key of the statistic in a probe.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sum => "sum",
            Self::Mean => "mean",
            Self::Max => "max",
            Self::Min => "min",
        }
    }
}

/// A field, or one component of it, such as `reaction_force.x`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantity {
    /// The field.
    pub field: Field,
    /// The component; `None` for all.
    pub component: Option<Component>,
}

/// A component of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Component {
    /// The entry of this number among the field's values at a node or element, from 0.
    Entry(usize),
    /// The length of a vector.
    Magnitude,
}

const OF_VECTORS: [&str; 3] = ["x", "y", "z"];
const OF_TENSORS: [&str; 9] = ["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"];

impl Quantity {
    /// Parses `field` or `field.component`.
    ///
    /// # Errors
    /// Returns the problem and a list of the fields that exist.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (name, part) = text.split_once('.').map_or((text, None), |(name, part)| (name, Some(part)));
        let known = Field::ALL.iter().filter(|field| field.component_count() > 0);
        let Some(&field) = known.clone().find(|field| field.name() == name) else {
            let names: Vec<&str> = known.map(|field| field.name()).collect();
            return Err(format!("there is no field \"{name}\"; there are: {}", names.join(", ")));
        };
        let names = Self::components(field);
        let component = match part {
            None => None,
            Some("magnitude") if field.component_count() == 3 => Some(Component::Magnitude),
            Some(part) => match names.iter().position(|name| *name == part) {
                Some(entry) => Some(Component::Entry(entry)),
                None if names.is_empty() => return Err(format!("{name} is one number; write \"{name}\"")),
                None => {
                    let magnitude = if names.len() == 3 { ", magnitude" } else { "" };
                    let all = names.join(", ");
                    return Err(format!("{name} has no component \"{part}\"; it has: {all}{magnitude}"));
                }
            },
        };
        Ok(Self { field, component })
    }

    fn components(field: Field) -> &'static [&'static str] {
        match field.component_count() {
            3 => &OF_VECTORS,
            9 => &OF_TENSORS,
            _ => &[],
        }
    }

    /// Returns the suffixes of its column names, one per column, which follow the name of the statistic.
    pub fn columns(&self) -> Vec<String> {
        let (field, names) = (self.field.name(), Self::components(self.field));
        match self.component {
            Some(Component::Magnitude) => vec![format!("{field}.magnitude")],
            Some(Component::Entry(entry)) => vec![format!("{field}.{}", names[entry])],
            None if names.is_empty() => vec![field.to_owned()],
            None => names.iter().map(|name| format!("{field}.{name}")).collect(),
        }
    }
}

impl Probe {
    fn new(name: impl Into<String>, body: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            body: body.into(),
            between: None,
            point: None,
            node: None,
            on: Selection::default(),
            sum: None,
            mean: None,
            max: None,
            min: None,
            pitch: None,
        }
    }

    /// Makes a probe of the node nearest to a point at rest, m.
    pub fn at(name: impl Into<String>, body: impl Into<String>, point: [f64; 3]) -> Self {
        Self { point: Some(point), ..Self::new(name, body) }
    }

    /// Makes a probe of a node, from 0.
    pub fn node(name: impl Into<String>, body: impl Into<String>, node: usize) -> Self {
        Self { node: Some(node), ..Self::new(name, body) }
    }

    /// Makes a probe of a statistic of a quantity (`"reaction_force"`, `"stress.xx"`) over a part of a body, or over
    /// all of it if the selection is empty.
    pub fn over(
        name: impl Into<String>,
        body: impl Into<String>,
        on: Selection,
        statistic: Statistic,
        quantity: impl Into<String>,
    ) -> Self {
        let mut probe = Self { on, ..Self::new(name, body) };
        let slot = match statistic {
            Statistic::Sum => &mut probe.sum,
            Statistic::Mean => &mut probe.mean,
            Statistic::Max => &mut probe.max,
            Statistic::Min => &mut probe.min,
        };
        *slot = Some(quantity.into());
        probe
    }

    /// Makes a probe of the contact force of the second body on the first.
    pub fn contact_force(
        name: impl Into<String>,
        first: impl Into<String>,
        second: impl Into<String>,
    ) -> Self {
        let between = Some([first.into(), second.into()]);
        Self { between, sum: Some(CONTACT_FORCE.to_owned()), ..Self::new(name, "") }
    }

    /// Returns the problems of a probe of contact force.
    fn problems_between(&self) -> Vec<(&'static str, String)> {
        let mut problems = Vec::new();
        if self.sum.as_deref() != Some(CONTACT_FORCE) {
            problems.push((
                "sum",
                format!("`between` two bodies there is one sum: write `sum = \"{CONTACT_FORCE}\"`"),
            ));
        }
        let foreign = [
            ("body", !self.body.is_empty()),
            ("point", self.point.is_some()),
            ("node", self.node.is_some()),
            ("mean", self.mean.is_some()),
            ("max", self.max.is_some()),
            ("min", self.min.is_some()),
            ("pitch", self.pitch.is_some()),
            (self.on.key(), !self.on.is_empty()),
        ];
        let foreign = foreign.into_iter().filter(|(_, is_given)| *is_given);
        problems
            .extend(foreign.map(|(key, _)| (key, "does not go with `between`; remove this key".to_owned())));
        problems
    }

    /// Returns whether it is a node, not a quantity over a part of a body.
    pub fn is_node(&self) -> bool {
        self.statistics().next().is_none()
    }

    fn statistics(&self) -> impl Iterator<Item = (Statistic, &str)> {
        let all = [
            (Statistic::Sum, &self.sum),
            (Statistic::Mean, &self.mean),
            (Statistic::Max, &self.max),
            (Statistic::Min, &self.min),
        ];
        all.into_iter().filter_map(|(statistic, text)| Some((statistic, text.as_deref()?)))
    }

    /// Returns the statistics over a part of a body; empty for a node. Fields that do not parse are left out.
    pub fn quantities(&self) -> Vec<(Statistic, Quantity)> {
        self.statistics()
            .filter_map(|(statistic, text)| Some((statistic, Quantity::parse(text).ok()?)))
            .collect()
    }

    /// Returns the names of its columns over a part of a body, or of a force between bodies.
    pub fn columns(&self) -> Vec<String> {
        if self.between.is_some() {
            return ["fx", "fy", "fz"].map(|part| format!("{}.{part}", self.name)).to_vec();
        }
        let of = |(statistic, quantity): (Statistic, Quantity)| {
            let heads = quantity.columns().into_iter();
            heads.map(|column| format!("{}.{}.{column}", self.name, statistic.name())).collect::<Vec<_>>()
        };
        self.quantities().into_iter().flat_map(of).collect()
    }

    /// Returns all problems of its values, each with the key within it. `is_sheet` tells whether the body is a sheet.
    pub(super) fn problems(&self, is_sheet: bool) -> Vec<(&'static str, String)> {
        let mut problems = Vec::new();
        if self.between.is_some() {
            return self.problems_between();
        }
        if self.body.is_empty() {
            problems.push(("", "missing key `body`: the name of the body that it looks at".to_owned()));
        }
        let places = usize::from(self.point.is_some()) + usize::from(self.node.is_some());
        if self.is_node() {
            match places {
                0 => problems.push((
                    "",
                    "missing key: give `point` or `node`, or a quantity over a part of the body by `sum`, `mean`, `max` \
                     or `min`"
                        .to_owned(),
                )),
                1 => {}
                _ => problems.push(("", "give only one of `point`, `node`".to_owned())),
            }
            if !self.on.is_empty() {
                let message =
                    format!("`{}` needs `sum`, `mean`, `max` or `min`, of a field over it", self.on.key());
                problems.push((self.on.key(), message));
            }
        } else {
            if places > 0 {
                let key = if self.point.is_some() { "point" } else { "node" };
                problems
                    .push((key, "is one node; remove this key, or `sum`, `mean`, `max`, `min`".to_owned()));
            }
            if !self.on.is_empty() {
                problems.extend(self.on.problems());
            }
            if self.pitch.is_some() {
                problems.push(("pitch", "applies to a node: give `point` or `node`".to_owned()));
            }
        }
        for (statistic, text) in self.statistics() {
            match Quantity::parse(text) {
                Err(message) => problems.push((statistic.name(), message)),
                Ok(Quantity { field, .. }) => {
                    if statistic == Statistic::Sum && !field.is_force() {
                        let message = format!(
                            "applies to forces (reaction_force, external_force); for {} use `mean`, `max` or `min`",
                            field.name()
                        );
                        problems.push(("sum", message));
                    }
                    if is_sheet && field.of_elements().is_some() {
                        let message =
                            format!("{} exists for solids only, and this body is a sheet", field.name());
                        problems.push((statistic.name(), message));
                    }
                }
            }
        }
        problems
    }
}
