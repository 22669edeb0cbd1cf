//! Refuses pairs, probes and exclusions of bodies between which there is no contact, and pairs without a value, so that they would have
//! no effect.

use super::{Contact, Problem, Rigid, Scene};

/// A table or key that names two bodies.
struct Naming<'a> {
    key: String,
    /// The entry that the user is to remove, in words.
    what: &'static str,
    between: &'a [String; 2],
}

/// Returns a problem for each pair, probe and exclusion that names bodies without contact between them. Names that do
/// not exist are reported elsewhere.
pub(super) fn problems(scene: &Scene) -> Vec<Problem> {
    let Some(contact) = &scene.contact else { return Vec::new() };
    let pairs = contact.pairs.iter().enumerate().map(|(i, pair)| Naming {
        key: format!("contact.pair[{i}].between"),
        what: "pair",
        between: &pair.between,
    });
    let probes = scene.probes.iter().enumerate().filter_map(|(i, probe)| {
        let between = probe.between.as_ref()?;
        Some(Naming { key: format!("probe[{i}].between"), what: "probe", between })
    });
    let excluded = contact.exclude.iter().enumerate().map(|(i, between)| Naming {
        key: format!("contact.exclude[{i}]"),
        what: "pair",
        between,
    });
    let empty = contact.pairs.iter().enumerate().filter(|(_, pair)| pair.is_empty()).map(|(i, _)| {
        let message = "names two bodies and no value for them: give `friction`, `damping`, `distance` or `stiffness`, or remove it";
        Problem::new(format!("contact.pair[{i}]"), message)
    });
    let forces = pairs.chain(probes).filter_map(|naming| {
        let reason = surfaceless(scene, naming.between).or_else(|| forceless(scene, contact, &naming))?;
        Some(naming.without_effect(&reason))
    });
    let exclusions = excluded.filter_map(|naming| {
        let reason = surfaceless(scene, naming.between)?;
        Some(naming.without_effect(&reason))
    });
    empty.chain(forces).chain(exclusions).collect()
}

impl Naming<'_> {
    fn without_effect(&self, reason: &str) -> Problem {
        Problem::new(self.key.clone(), format!("{reason}, or remove this {}", self.what))
    }
}

fn rigid<'a>(scene: &'a Scene, name: &str) -> Option<&'a Rigid> {
    scene.rigids.iter().find(|rigid| rigid.name == name)
}

/// Returns why two bodies have no surfaces that could meet, and what to write; `None` if they have.
fn surfaceless(scene: &Scene, [a, b]: &[String; 2]) -> Option<String> {
    for name in [a, b] {
        if rigid(scene, name).is_some_and(|rigid| rigid.shape.is_none()) {
            return Some(format!("'{name}' has no shape, so that it meets nothing: give it a `shape`"));
        }
    }
    let is_rigid = a == b && rigid(scene, a).is_some();
    is_rigid.then(|| format!("'{a}' is rigid, so that it does not meet itself: name two bodies"))
}

/// Returns why no contact force acts between two bodies, and what to write; `None` if one may.
fn forceless(scene: &Scene, contact: &Contact, naming: &Naming<'_>) -> Option<String> {
    let ([a, b], is_probe) = (naming.between, naming.what == "probe");
    if a == b && is_probe {
        return Some(format!("the contact forces of '{a}' on itself cancel: name two bodies"));
    }
    if a == b && !contact.own {
        return Some(format!(
            "`contact.self` is false, so that '{a}' does not meet itself: write `self = true`"
        ));
    }
    if [a, b].iter().all(|name| rigid(scene, name).is_some_and(Rigid::is_prescribed)) {
        return Some(format!(
            "the motion of both '{a}' and '{b}' is prescribed, so that no contact force acts between them: name a body \
             that moves freely"
        ));
    }
    // A pair that is excluded is reported with the other problems of pairs.
    (is_probe && !contact.admits(a, b))
        .then(|| format!("`contact.exclude` says that '{a}' and '{b}' do not meet: remove the pair there"))
}
