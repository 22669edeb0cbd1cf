//! Checks of the tables that act on parts of bodies: supports, springs, ties, strikes, loads and probes.

use vi_fem::Motion;

use super::checker::Checker;
use crate::scene::names::Names;
use crate::scene::problem::some_of;
use crate::scene::{Body, Fix, Probe, Scene, Spring};

pub(super) fn parts(check: &mut Checker, scene: &Scene, names: &Names<'_>) {
    let mut parts = Parts { check, scene, names };
    for (i, one) in scene.fixes.iter().enumerate() {
        parts.fix(&format!("fix[{i}]"), one);
    }
    for (i, one) in scene.springs.iter().enumerate() {
        parts.spring(&format!("spring[{i}]"), one);
    }
    for (i, one) in scene.attachments.iter().enumerate() {
        let key = format!("attach[{i}]");
        parts.known(&key, "body", &one.body);
        if let Some(to) = one.to.as_ref().filter(|to| names.rigid(to).is_none()) {
            parts.known(&key, "to", to);
        }
        parts.say_all(&key, one.problems());
    }
    for (i, one) in scene.seams.iter().enumerate() {
        let key = format!("seam[{i}]");
        parts.known(&key, "body", &one.body);
        if let Some(to) = &one.to {
            parts.known(&key, "to", to);
        }
        parts.say_all(&key, one.problems());
    }
    for (i, one) in scene.periodics.iter().enumerate() {
        let key = format!("periodic[{i}]");
        parts.known(&key, "body", &one.body);
        parts.say_all(&key, one.problems());
    }
    for (i, one) in scene.strikes.iter().enumerate() {
        let key = format!("strike[{i}]");
        parts.known(&key, "body", &one.body);
        parts.say_all(&key, one.on.problems());
        parts.check.finite(format!("{key}.impulse"), &one.impulse);
    }
    for (i, one) in scene.loads.iter().enumerate() {
        let key = format!("load[{i}]");
        parts.known(&key, "body", one.body());
        parts.say_all(&key, one.problems());
    }
    for (i, one) in scene.probes.iter().enumerate() {
        parts.probe(&format!("probe[{i}]"), one);
    }
}

/// Returns why there is no deformable body of this name for the table `key`, e.g. `fix[0]`.
pub(super) fn no_body(scene: &Scene, names: &Names<'_>, key: &str, name: &str) -> String {
    if names.rigid(name).is_some() {
        let instead = match key.split('[').next().unwrap_or_default() {
            "fix" => "give it `fixed = true` or a `motion` in its table [[rigid]]",
            "strike" => "give it `velocity` and `angular_velocity` in its table [[rigid]]",
            "probe" => "history.csv has columns of its position and orientation without a probe",
            _ => "join a deformable body to it by [[attach]] with `to`, and name that body",
        };
        return format!("'{name}' is a rigid body, and this table acts on deformable ones: {instead}");
    }
    let there: Vec<_> = scene.bodies.iter().map(|body| body.name.as_str()).collect();
    match there.is_empty() {
        true => format!("there is no body '{name}': the scene has no table [[body]]"),
        false => format!("there is no body '{name}'; there are: {}", some_of(&there)),
    }
}

/// The scene and its names, for the checks of parts.
struct Parts<'a, 'b> {
    check: &'a mut Checker,
    scene: &'a Scene,
    names: &'a Names<'b>,
}

impl Parts<'_, '_> {
    /// Reports a missing body that the key `part` of the table `key` names.
    fn known(&mut self, key: &str, part: &str, name: &str) {
        if self.names.body(name).is_none() {
            self.check.say(format!("{key}.{part}"), no_body(self.scene, self.names, key, name));
        }
    }

    /// Reports problems of the table `key`. Each names a key of the table, or an empty one for the whole table.
    fn say_all<P: std::fmt::Display, M: Into<String>>(
        &mut self,
        key: &str,
        problems: impl IntoIterator<Item = (P, M)>,
    ) {
        for (part, message) in problems {
            let part = part.to_string();
            let key = if part.is_empty() { key.to_owned() } else { format!("{key}.{part}") };
            self.check.say(key, message);
        }
    }

    fn body(&self, name: &str) -> Option<&Body> {
        self.names.body(name).map(|body| &self.scene.bodies[body.index()])
    }

    fn fix(&mut self, key: &str, fix: &Fix) {
        self.known(key, "body", &fix.body);
        self.say_all(key, fix.problems());
        if fix.rotation && self.body(&fix.body).is_some_and(|body| body.dimension() != 2) {
            let message = "only sheets have it; nodes of a solid that are held hold its rotation";
            self.check.say(format!("{key}.rotation"), message);
        }
        if fix.rotation && matches!(fix.motion, Some(Motion::Rotate(_))) {
            let message = "holds the normal in space; it cannot go with a turning motion";
            self.check.say(format!("{key}.rotation"), message);
        }
        if let Some(Err(error)) = fix.motion.as_ref().map(Motion::check) {
            self.check.say(format!("{key}.motion"), error.to_string());
        }
    }

    fn spring(&mut self, key: &str, spring: &Spring) {
        self.check.positive(format!("{key}.stiffness"), spring.stiffness, "N/m");
        if spring.length.is_some_and(|length| !(length >= 0.0 && length.is_finite())) {
            self.check.say(format!("{key}.length"), "must be zero or positive, in m");
        }
        if spring.from.body.is_none() {
            let message = "missing key `body`: the first end must be on a body";
            self.check.say(format!("{key}.from"), message);
        }
        for (side, end) in [("from", &spring.from), ("to", &spring.to)] {
            let key = format!("{key}.{side}");
            if let Some(body) = &end.body {
                self.known(&key, "body", body);
            } else if end.node.is_some() {
                self.check.say(format!("{key}.node"), "a node needs a `body`");
            }
            let given = [("point", end.point.is_some()), ("node", end.node.is_some())];
            self.check.at_most_one_of(&key, &given, true);
        }
    }

    fn probe(&mut self, key: &str, probe: &Probe) {
        if probe.between.is_none() && !probe.body.is_empty() {
            self.known(key, "body", &probe.body);
        }
        let is_of_sheet = self.body(&probe.body).is_some_and(|body| body.dimension() == 2);
        self.say_all(key, probe.problems(is_of_sheet));
        self.check.finite(format!("{key}.point"), &probe.point.unwrap_or_default());
    }
}
