//! Scene keys of contact.

use std::collections::HashSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_solvers::Method;

use super::{GuardAction, MassKind, Problem, Scene};

/// `[contact]`: contact of all bodies with each other and with themselves. Without this table there is no contact, and
/// bodies pass through each other. Formulae, defaults and limits: docs/contact.md.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Coulomb's coefficient of friction (≥ 0, default 0).
    #[serde(default)]
    #[schemars(extend("minimum" = 0.0))]
    pub friction: f64,
    /// Time constant of contact damping, s (≥ 0, default 0); without it a bouncing body never comes to rest.
    #[serde(default)]
    #[schemars(extend("minimum" = 0.0))]
    pub damping: f64,
    /// Gap d̂ below which surfaces press on each other, m (> 0; default: a tenth of the median edge of the finer
    /// surface; for a sheet at most its thickness).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub distance: Option<f64>,
    /// Modulus κ of the layer between surfaces, Pa (> 0; default: a tenth of Young's modulus of the softer side).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub stiffness: Option<f64>,
    /// Pairs of bodies without contact; a pair of one body excludes its contact with itself.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exclude: Vec<[String; 2]>,
    /// Whether bodies have contact with themselves (default true).
    #[serde(rename = "self", default = "Contact::default_own", skip_serializing_if = "Clone::clone")]
    pub own: bool,
    /// Separate bodies that touch or cross at the start (default false): they are translated as a whole, by the
    /// shortest way found, and report.json gives the distance. Without it such a start is refused.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub resolve: bool,
    /// Values for pairs of bodies.
    #[serde(rename = "pair", default, skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<ContactPair>,
}

/// `[[contact.pair]]`: values for two bodies that replace those of `[contact]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactPair {
    /// Names of both bodies.
    pub between: [String; 2],
    /// Coulomb's coefficient of friction (≥ 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0))]
    pub friction: Option<f64>,
    /// Time constant of contact damping, s (≥ 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0))]
    pub damping: Option<f64>,
    /// Gap d̂ below which the surfaces press on each other, m (> 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub distance: Option<f64>,
    /// Modulus κ of the layer between the surfaces, Pa (> 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub stiffness: Option<f64>,
}

impl ContactPair {
    /// Returns whether it replaces no value.
    pub(super) fn is_empty(&self) -> bool {
        let Self { between: _, friction, damping, distance, stiffness } = self;
        [friction, damping, distance, stiffness].iter().all(|value| value.is_none())
    }
}

/// Returns whether these are the names of a pair, in either order.
fn is_pair([c, d]: &[String; 2], a: &str, b: &str) -> bool {
    (c == a && d == b) || (c == b && d == a)
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            friction: 0.0,
            damping: 0.0,
            distance: None,
            stiffness: None,
            exclude: Vec::new(),
            own: Self::default_own(),
            resolve: false,
            pairs: Vec::new(),
        }
    }
}

impl Contact {
    fn default_own() -> bool {
        true
    }

    /// Returns contact with this coefficient of friction, and default values for the other keys.
    pub fn with_friction(friction: f64) -> Self {
        Self { friction, ..Self::default() }
    }

    /// Returns whether there is friction between any bodies.
    pub fn has_friction(&self) -> bool {
        self.friction > 0.0 || self.pairs.iter().any(|pair| pair.friction.is_some_and(|value| value > 0.0))
    }

    /// Returns whether the contact of any bodies is damped.
    pub fn is_damped(&self) -> bool {
        self.damping > 0.0 || self.pairs.iter().any(|pair| pair.damping.is_some_and(|value| value > 0.0))
    }

    /// Returns whether bodies of these names may meet.
    pub fn admits(&self, a: &str, b: &str) -> bool {
        (a != b || self.own) && !self.exclude.iter().any(|pair| is_pair(pair, a, b))
    }

    /// Returns the parameters of the bodies of these names, in either order, if the scene gives any.
    pub(crate) fn pair(&self, a: &str, b: &str) -> Option<&ContactPair> {
        self.pairs.iter().find(|pair| is_pair(&pair.between, a, b))
    }

    fn own_problems(&self, known: &HashSet<&str>) -> Vec<(String, String)> {
        let mut problems = Vec::new();
        let mut number = |key: String, value: Option<f64>, is_positive: bool, unit: &str| {
            let Some(value) = value else { return };
            let is_sound = value.is_finite() && if is_positive { value > 0.0 } else { value >= 0.0 };
            if !is_sound {
                let domain = if is_positive { "positive and finite" } else { "zero or positive, and finite" };
                problems.push((key, format!("must be {domain}, is {value}{unit}")));
            }
        };
        number("friction".into(), Some(self.friction), false, "");
        number("damping".into(), Some(self.damping), false, " s");
        number("distance".into(), self.distance, true, " m");
        number("stiffness".into(), self.stiffness, true, " Pa");
        for (i, pair) in self.pairs.iter().enumerate() {
            number(format!("pair[{i}].friction"), pair.friction, false, "");
            number(format!("pair[{i}].damping"), pair.damping, false, " s");
            number(format!("pair[{i}].distance"), pair.distance, true, " m");
            number(format!("pair[{i}].stiffness"), pair.stiffness, true, " Pa");
        }
        let excluded = self.exclude.iter().enumerate().map(|(i, names)| (format!("exclude[{i}]"), names));
        let pairs =
            self.pairs.iter().enumerate().map(|(i, pair)| (format!("pair[{i}].between"), &pair.between));
        for (key, names) in excluded.chain(pairs) {
            for name in names.iter().filter(|name| !known.contains(name.as_str())) {
                problems.push((key.clone(), no_body(name, known)));
            }
        }
        let mut seen = HashSet::new();
        for (i, pair) in self.pairs.iter().enumerate() {
            let [a, b] = &pair.between;
            if !seen.insert(if a < b { [a, b] } else { [b, a] }) {
                let message = format!("there is another pair of '{a}' and '{b}'; write one for both");
                problems.push((format!("pair[{i}].between"), message));
            }
            if self.exclude.iter().any(|names| is_pair(names, a, b)) {
                let message = format!(
                    "`exclude` says that '{a}' and '{b}' do not meet: remove this pair there, or here"
                );
                problems.push((format!("pair[{i}].between"), message));
            }
        }
        problems
    }
}

fn no_body(name: &str, known: &HashSet<&str>) -> String {
    let mut there: Vec<&str> = known.iter().copied().collect();
    there.sort_unstable();
    format!("there is no body '{name}'; there are: {}", super::problem::some_of(&there))
}

/// Returns all problems of the contact of a scene.
pub(super) fn problems(scene: &Scene) -> Vec<Problem> {
    let Some(contact) = &scene.contact else { return without(scene) };
    let names = scene.bodies.iter().map(|body| body.name.as_str());
    let known: HashSet<&str> = names.chain(scene.rigids.iter().map(|rigid| rigid.name.as_str())).collect();
    let found = contact.own_problems(&known).into_iter();
    let mut problems: Vec<Problem> =
        found.map(|(key, message)| Problem::new(format!("contact.{key}"), message)).collect();
    for (i, probe) in scene.probes.iter().enumerate() {
        for name in probe.between.iter().flatten().filter(|name| !known.contains(name.as_str())) {
            problems.push(Problem::new(format!("probe[{i}].between"), no_body(name, &known)));
        }
    }
    if let Some(method) = scene.time.method()
        && scene.statics.is_none()
        && let Some(message) = refused(&method, scene)
    {
        problems.push(Problem::new("time.scheme", message));
    }
    let halves =
        scene.guard.is_some_and(|guard| matches!(guard.action, GuardAction::Halve | GuardAction::Switch));
    if halves && scene.time.method().is_some_and(|method| method.facts().is_explicit) {
        let message = "explicit steps must not change with [contact]: each change near the stability limit adds \
                       energy; write action = \"stop\" or \"warn\", or use energy-momentum";
        problems.push(Problem::new("guard.action", message));
    }
    if let Some(statics) = &scene.statics {
        if contact.is_damped() {
            let message =
                "nothing is damped between equilibria: remove the damping of contact, or remove [static]";
            problems.push(Problem::new("contact", message));
        }
        if contact.has_friction() && statics.follows_path() {
            let message = "an equilibrium with friction depends on the order of loads, so its path cannot be followed \
                           by `static.arc_steps` or `static.control`: remove that key, or set friction to 0";
            problems.push(Problem::new("contact", message));
        }
    }
    problems
}

/// Returns problems for keys that need the table `[contact]`.
fn without(scene: &Scene) -> Vec<Problem> {
    let planes = scene
        .rigids
        .iter()
        .enumerate()
        .filter(|(_, rigid)| rigid.shape.as_ref().is_some_and(super::RigidShape::is_plane));
    let message = "is a half-space, which only acts by contact; add the table [contact]";
    let planes = planes.map(|(i, _)| Problem::new(format!("rigid[{i}].shape"), message));
    let message = "needs contact; add the table [contact]";
    let probes = scene.probes.iter().enumerate().filter(|(_, probe)| probe.between.is_some());
    let probes = probes.map(|(i, _)| Problem::new(format!("probe[{i}].between"), message));
    let assert = &scene.assert;
    let asserts =
        [("smallest_gap", assert.smallest_gap.is_some()), ("intersections", assert.intersections.is_some())];
    let asserts = asserts.into_iter().filter(|(_, is_given)| *is_given);
    let asserts = asserts.map(|(name, _)| Problem::new(format!("assert.{name}"), message));
    let fields = scene.output.fields.iter().filter(|field| field.is_of_contact());
    let fields = fields.map(|field| Problem::new("output.fields", format!("{} {message}", field.name())));
    planes.chain(probes).chain(asserts).chain(fields).collect()
}

/// Returns why a scheme cannot step a scene with contact; `None` if it can.
fn refused(method: &Method, scene: &Scene) -> Option<String> {
    if method.facts().accepts.contact {
        return None;
    }
    let name = method.label();
    let is_adaptive = scene.time.is_adaptive();
    let advice = match is_adaptive || scene.solver.mass == Some(MassKind::Consistent) {
        true => "use implicit-midpoint or energy-momentum",
        false => "use stormer-verlet, implicit-midpoint or energy-momentum",
    };
    let is_constrained = scene.rigids.iter().any(|rigid| !rigid.is_prescribed()) || !scene.joints.is_empty();
    // Adaptive steps are not equal, as bdf2 needs them.
    let comparison = match (is_constrained, is_adaptive) {
        (true, true) => "backward-euler",
        (true, false) => "backward-euler or bdf2",
        (false, true) => "backward-euler or newmark",
        (false, false) => "backward-euler, bdf2 or newmark",
    };
    Some(match method {
        Method::TruncatedEuler { .. } => {
            format!("{name} may end a step before surfaces that meet are apart; with [contact] {advice}")
        }
        _ => format!(
            "{name} does not evaluate the end of a step, where surfaces may have crossed; with [contact] {advice}, or to \
             compare {comparison}"
        ),
    })
}
