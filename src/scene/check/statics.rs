//! Checks equilibria: load steps, paths and their control.

use super::checker::Checker;
use super::parts::no_body;
use crate::scene::names::Names;
use crate::scene::{Control, LinearChoice, Scene, Static};

pub(super) fn statics(check: &mut Checker, scene: &Scene, names: &Names<'_>) {
    let Some(statics) = &scene.statics else { return };
    if let Some(smallest) = statics.smallest_increment {
        check.positive("static.smallest_increment", smallest, "");
    }
    if !(1e-14..=0.1).contains(&statics.tolerance) {
        let message = format!("must be 1e-14 (to round-off) to 0.1, is {:e}", statics.tolerance);
        check.say("static.tolerance", message);
    }
    if statics.push.is_some_and(|push| !push.is_finite()) {
        check.say("static.push", "must be finite");
    }
    path_of_equilibria(check, scene, statics, names);
    without_motion(check, scene);
}

/// Refuses keys that say something of motion, which equilibria do not have.
fn without_motion(check: &mut Checker, scene: &Scene) {
    let (time, assert) = (&scene.time, &scene.assert);
    let keys = [
        ("damping", scene.damping.is_some()),
        ("time.estimate", time.estimate),
        ("time.substeps", !time.substeps),
        ("time.stages", time.stages.is_some()),
        ("assert.energy_drift", assert.energy_drift.is_some()),
        ("assert.momentum_drift", assert.momentum_drift.is_some()),
        ("assert.angular_momentum_drift", assert.angular_momentum_drift.is_some()),
    ];
    let mut given: Vec<String> =
        keys.into_iter().filter(|(_, is_given)| *is_given).map(|(key, _)| key.to_owned()).collect();
    given.extend((0..scene.strikes.len()).map(|i| format!("strike[{i}]")));
    let bodies = scene.bodies.iter().map(|body| (body.velocity.is_some(), body.angular_velocity.is_some()));
    let rigids =
        scene.rigids.iter().map(|rigid| (rigid.velocity.is_some(), rigid.angular_velocity.is_some()));
    let bodies = bodies.enumerate().map(|(i, has)| (format!("body[{i}]"), has));
    for (key, (moves, turns)) in bodies.chain(rigids.enumerate().map(|(i, has)| (format!("rigid[{i}]"), has)))
    {
        given.extend(moves.then(|| format!("{key}.velocity")));
        given.extend(turns.then(|| format!("{key}.angular_velocity")));
    }
    for key in given {
        check.say(key, "belongs to motion, and a scene with [static] has none: remove it");
    }
}

fn path_of_equilibria(check: &mut Checker, scene: &Scene, statics: &Static, names: &Names<'_>) {
    let given = [("arc_steps", statics.arc_steps.is_some()), ("control", statics.control.is_some())];
    check.at_most_one_of("static", &given, false);
    if statics.arc_steps == Some(0) {
        check.say("static.arc_steps", "must be at least 1");
    }
    if statics.follows_path() && statics.push.is_some() {
        check.say("static.push", "leaves the path that `arc_steps` and `control` follow: remove this key");
    }
    if statics.follows_path() && scene.solver.linear == LinearChoice::Pcg {
        let message = "conjugate gradients cannot follow a path through limit points, where the tangent is indefinite; \
                       write \"cholesky\" or remove this key";
        check.say("solver.linear", message);
    }
    let Some(control) = &statics.control else { return };
    check.finite("static.control.to", &[control.to()]);
    if control.to() == 0.0 {
        check.say("static.control.to", "must not be zero");
    }
    if let Control::Displacement { probe, .. } = control
        && names.probe(probe).is_none()
    {
        let message = format!("there is no probe named '{probe}': add a [[probe]] of this name");
        check.say("static.control.probe", message);
    }
    if let Control::Volume { body, .. } = control
        && names.body(body).is_none()
    {
        check.say("static.control.body", no_body(scene, names, "static", body));
    }
}
