//! Finds all problems of the values of a scene at once, each with its key and the remedy.

mod checker;
mod frames;
mod parts;
mod rigids;
mod statics;

use std::collections::HashSet;

use vi_fem::LockingCure;

use super::names::Names;
use super::problem::Problem;
use super::{
    Body, LinearChoice, MOST_REFINED, MassKind, Refine, RefineAlong, RestShape, Scene, SchemeName, Substance,
    TimeStep,
};
use super::{columns, contact, idle_contact, load, plain};
use checker::Checker;

impl Scene {
    /// Returns all problems of the values of this scene, without reading any file.
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = values(self);
        // Do not repeat a problem of a value that the check of its key has already reported.
        let is_new = |problem: &Problem, known: &[Problem]| {
            let key = problem.key.trim_end_matches(|c: char| c.is_ascii_digit() || c == '[' || c == ']');
            !known.iter().any(|known| known.key == problem.key || known.key == key)
        };
        let found = plain::problems(self).into_iter().filter(|problem| is_new(problem, &problems));
        let found = found.chain(columns::problems(self)).chain(contact::problems(self));
        let found: Vec<_> = found.chain(idle_contact::problems(self)).collect();
        problems.extend(found);
        problems
    }
}

fn values(scene: &Scene) -> Vec<Problem> {
    let mut check = Checker::default();
    check.finite("gravity", &scene.gravity);
    if let Some(message) = scene.gravity_amplitude.as_ref().and_then(load::amplitude_problem) {
        check.say("gravity_amplitude", message);
    }
    time(&mut check, scene);
    if scene.bodies.is_empty() && scene.rigids.is_empty() {
        check.say("body", "a scene needs at least one [[body]] or [[rigid]]");
    }
    let mut names = HashSet::new();
    for (i, b) in scene.bodies.iter().enumerate() {
        if !names.insert(b.name.as_str()) {
            check.say(format!("body[{i}].name"), format!("there is another body named '{}'", b.name));
        }
        body(&mut check, &format!("body[{i}]"), b);
    }
    for (i, rigid) in scene.rigids.iter().enumerate() {
        if !names.insert(rigid.name.as_str()) {
            check.say(format!("rigid[{i}].name"), format!("there is another body named '{}'", rigid.name));
        }
    }
    rigids::rigids(&mut check, scene);
    let names = Names::new(scene);
    parts::parts(&mut check, scene, &names);
    wind_and_damping(&mut check, scene);
    statics::statics(&mut check, scene, &names);
    output(&mut check, scene);
    check.problems
}

fn time(check: &mut Checker, scene: &Scene) {
    let time = &scene.time;
    check.positive("time.end", time.end, "s");
    match time.step {
        Some(TimeStep::Adaptive(_)) => adaptive(check, scene),
        Some(TimeStep::Fixed(step)) => {
            check.positive("time.step", step, "s");
            if step > time.end && time.end > 0.0 {
                check.say("time.step", format!("must not exceed `end` ({} s), is {step} s", time.end));
            }
            countable(check, "time.step", time.end, step);
        }
        None if time.scheme != Some(SchemeName::Auto) => {
            check.say("time.step", "missing key `step`: a step in s (only scheme \"auto\" chooses it)");
        }
        None => {}
    }
    if time.largest_step.is_some() && !time.is_adaptive() {
        check
            .say("time.largest_step", "limits adaptive steps: write step = \"adaptive\", or remove this key");
    }
    if time.scheme.is_none() && scene.statics.is_none() {
        check.say(
            "time.scheme",
            "missing key `scheme`: name an integrator, e.g. \"implicit-midpoint\" for stiff bodies or \"stormer-verlet\" \
             for soft ones, or let \"auto\" choose (only [static] needs none)",
        );
    }
    if let Some(tolerance) = time.tolerance
        && !(1e-9..=0.5).contains(&tolerance)
    {
        check.say("time.tolerance", format!("must be 1e-9 to 0.5, is {tolerance:e}"));
    }
    match time.stages {
        Some(stages) if time.scheme != Some(SchemeName::Gauss) => check.say(
            "time.stages",
            format!("only scheme \"gauss\" has stages: remove `stages = {stages}`, or choose gauss"),
        ),
        Some(stages) if !(1..=5).contains(&stages) => {
            check.say("time.stages", format!("must be 1 to 5, is {stages}"));
        }
        _ => {}
    }
    if let Some(radius) = time.spectral_radius {
        if time.scheme != Some(SchemeName::GeneralizedAlpha) {
            check.say("time.spectral_radius", "only scheme \"generalized-alpha\" has a spectral radius");
        } else if !(0.0..=1.0).contains(&radius) {
            check.say("time.spectral_radius", format!("must be 0 to 1, is {radius}"));
        }
    }
    if let Some(solves) = time.solves {
        if time.scheme != Some(SchemeName::TruncatedEuler) {
            check.say(
                "time.solves",
                "only scheme \"truncated-euler\" has a fixed number of solves: remove this key",
            );
        } else if !(1..=1000).contains(&solves) {
            check.say("time.solves", format!("must be 1 to 1000, is {solves}"));
        }
    }
    let is_explicit = time.method().is_some_and(|method| method.facts().is_explicit);
    if scene.solver.mass == Some(MassKind::Consistent) && is_explicit && scene.statics.is_none() {
        // Implicit schemes refuse it beside constraints.
        let is_constrained =
            scene.rigids.iter().any(|rigid| !rigid.is_prescribed()) || !scene.joints.is_empty();
        let message = "\"consistent\" couples the nodes, and explicit schemes divide by the mass of each";
        let ways = match is_constrained {
            true => "remove `mass`",
            false => "make `time.scheme` implicit (implicit-midpoint, energy-momentum), or remove `mass`",
        };
        check.say("solver.mass", format!("{message}: {ways}"));
    }
    if scene.solver.mass == Some(MassKind::Filtered) {
        filtered_mass(check, scene);
    }
    if scene.solver.linear == LinearChoice::Petsc
        && time.scheme == Some(SchemeName::Auto)
        && scene.statics.is_none()
    {
        check.say(
            "solver.linear",
            "the trial runs of scheme \"auto\" have no \"petsc\": name a scheme, or use \"pcg\"",
        );
    }
    let tolerance = scene.solver.tolerance;
    if !(1e-14..=0.1).contains(&tolerance) {
        check.say("solver.tolerance", format!("must be 1e-14 (to round-off) to 0.1, is {tolerance:e}"));
    }
}

/// Adds the problems of a filtered mass.
fn filtered_mass(check: &mut Checker, scene: &Scene) {
    let without = [
        (scene.statics.is_some(), "[static] moves no mass: remove `mass`"),
        (scene.contact.is_some(), "\"filtered\" is not possible with [contact]: remove `mass`"),
        (scene.wind.is_some(), "\"filtered\" is not possible with [wind]: remove `mass`"),
        (scene.damping.is_some(), "\"filtered\" is not possible with [damping]: remove `mass`"),
        (!scene.periodics.is_empty(), "\"filtered\" is not possible with [[periodic]]: remove `mass`"),
        (!scene.rigids.is_empty(), "\"filtered\" is not possible with rigid bodies: remove `mass`"),
    ];
    let excluded = || without.iter().filter(|(is_so, _)| *is_so);
    excluded().for_each(|(_, message)| check.say("solver.mass", *message));
    // No scheme would help in a scene that excludes this mass.
    let is_implicit = scene.time.method().is_some_and(|method| !method.facts().is_explicit);
    if is_implicit && excluded().next().is_none() {
        check.say(
            "solver.mass",
            "\"filtered\" lengthens explicit steps, and implicit ones have no limit: make `time.scheme` explicit \
             (\"stormer-verlet\", \"blanes-moan-4\"), or remove `mass`",
        );
    }
}

/// Refuses a positive length (s) that divides the run into more steps than the program can count.
fn countable(check: &mut Checker, key: &str, end: f64, step: f64) {
    if step > 0.0 && end.is_finite() && end / step > 9e15 {
        check.say(key, "requires more steps than the program can count: use a larger step");
    }
}

/// Adds the problems of adaptive steps.
fn adaptive(check: &mut Checker, scene: &Scene) {
    let time = &scene.time;
    let without = [
        (time.scheme == Some(SchemeName::Auto), "scheme \"auto\" chooses the step: remove `step`"),
        (time.scheme == Some(SchemeName::Bdf2), "scheme \"bdf2\" needs equal steps: write a step in s"),
        (
            time.scheme == Some(SchemeName::ForwardEuler),
            "scheme \"forward-euler\" is stable at no step, so that none follows from the motion: write a step in s, or \
             choose another scheme, e.g. \"energy-momentum\"",
        ),
        (scene.statics.is_some(), "[static] has no motion to follow: write a step in s"),
        (
            scene.contact.is_some() && time.method().is_some_and(|method| method.facts().is_explicit),
            "explicit steps must not change with [contact]: each change near the stability limit adds energy; write a step in \
             s, or use energy-momentum",
        ),
        (time.estimate, "`estimate` compares equal steps: write a step in s, or remove `estimate`"),
    ];
    for (_, message) in without.into_iter().filter(|(is_so, _)| *is_so) {
        check.say("time.step", message);
    }
    if let Some(largest) = time.largest_step {
        check.positive("time.largest_step", largest, "s");
        if largest > time.end && time.end > 0.0 {
            check.say("time.largest_step", format!("must not exceed `end` ({} s), is {largest} s", time.end));
        }
        countable(check, "time.largest_step", time.end, largest);
    }
}

fn body(check: &mut Checker, key: &str, body: &Body) {
    if body.name.is_empty() {
        check.say(format!("{key}.name"), "must not be empty");
    }
    let shapes =
        [("mesh", body.mesh.is_some()), ("box", body.box_shape.is_some()), ("sheet", body.sheet.is_some())];
    check.at_most_one_of(key, &shapes, body.arrays.is_none());
    if body.arrays.is_some() && shapes.iter().any(|(_, is_given)| *is_given) {
        check.say(key, "has a mesh from arrays: remove `mesh`, `box` and `sheet`");
    }
    if let Some(scale) = body.scale {
        check.positive(format!("{key}.scale"), scale, "");
    }
    for (name, value) in [("translate", body.translate), ("angular_velocity", body.angular_velocity)] {
        check.finite(format!("{key}.{name}"), &value.unwrap_or_default());
    }
    for (name, components) in [("displacement", &body.displacement), ("velocity", &body.velocity)] {
        let Some(components) = components else { continue };
        if let Err(error) = super::field(components) {
            check.say(format!("{key}.{name}"), error.to_string());
        }
        for component in components {
            if let super::FieldComponent::Number(value) = component {
                check.finite(format!("{key}.{name}"), &[*value]);
            }
        }
    }
    if body.order.is_some_and(|order| !(1..=2).contains(&order)) {
        check.say(format!("{key}.order"), "must be 1 (as the mesh is) or 2 (quadratic elements)");
    }
    if body.order == Some(2) && body.dimension() == 2 {
        check.say(format!("{key}.order"), "sheets consist of linear triangles: remove this key");
    }
    if body.refine.as_ref().is_some_and(|refine| refine.levels() > MOST_REFINED) {
        check.say(
            format!("{key}.refine"),
            "must be 0 to 6: each time there are up to 8 times as many elements",
        );
    }
    if let Some(Refine::Along(RefineAlong { axes, .. })) = &body.refine {
        if !(1..=2).contains(&axes.len()) || axes.len() == 2 && axes[0] == axes[1] {
            let message =
                "`axes` must name one or two of \"x\", \"y\", \"z\"; for all three write `refine = 2`";
            check.say(format!("{key}.refine"), message);
        }
        if body.dimension() == 2 {
            check.say(
                format!("{key}.refine"),
                "a sheet has no layers: write the number of times, e.g. `refine = 2`",
            );
        }
    }
    if body.locking != LockingCure::None && body.dimension() == 2 {
        check.say(format!("{key}.locking"), "applies to solids only: remove this key from a sheet");
    }
    let entries = &body.material.0;
    if entries.is_empty() {
        check.say(format!("{key}.material"), "missing: the list holds no material");
    }
    if body.rest.is_some() && body.dimension() != 2 {
        check.say(
            format!("{key}.rest"),
            "applies to sheets only (their material has `thickness`): remove this key",
        );
    }
    for (name, is_given) in [("part", body.part.is_some()), ("weld", body.weld.is_some())] {
        if is_given && !body.has_mesh() {
            check.say(format!("{key}.{name}"), "applies to a body with a `mesh` file only: remove this key");
        }
    }
    if body.weld.is_some() && body.dimension() != 2 {
        check.say(format!("{key}.weld"), "applies to sheets only: remove this key");
    }
    if body.weld.is_some_and(|weld| !(weld >= 0.0 && weld.is_finite())) {
        check.say(format!("{key}.weld"), "must be zero or positive, in m");
    }
    if let Some(uv_scale) = body.uv_scale {
        check.positive(format!("{key}.uv_scale"), uv_scale, "m");
        if !body.has_mesh() || body.rest != Some(RestShape::Flat) {
            check.say(
                format!("{key}.uv_scale"),
                "applies only with a `mesh` file and rest = \"flat\": add them, or remove this key",
            );
        }
    }
    let mut regions = HashSet::new();
    for (i, entry) in entries.iter().enumerate() {
        let key = if entries.len() == 1 { format!("{key}.material") } else { format!("{key}.material[{i}]") };
        for problem in entry.law.check().err().unwrap_or_default() {
            check.say(key.clone(), problem.to_string());
        }
        match &entry.law {
            Substance::Solid(_) if body.sheet.is_some() => {
                check.say(key.clone(), "missing key `thickness`: the material of a sheet needs it (m)");
            }
            Substance::Sheet(_) if body.box_shape.is_some() => check.say(
                key.clone(),
                "a box is a solid, which has no `thickness`: remove it, or make the body with `sheet`",
            ),
            law if law.dimension() != body.dimension() => check.say(
                key.clone(),
                "a body is either a solid or a sheet: give `thickness` to all of its materials, or to none",
            ),
            _ => {}
        }
        if !regions.insert(entry.region.as_deref()) {
            check.say(key, "two materials for the same region");
        }
    }
}

fn wind_and_damping(check: &mut Checker, scene: &Scene) {
    if let Some(wind) = &scene.wind {
        check.finite("wind.velocity", &wind.velocity);
        for (name, value) in
            [("density", wind.density), ("normal", wind.normal), ("tangential", wind.tangential)]
        {
            if !(value >= 0.0 && value.is_finite()) {
                check.say(format!("wind.{name}"), format!("must be zero or positive, is {value}"));
            }
        }
        if !scene.bodies.iter().any(|body| body.dimension() == 2) {
            check.say("wind", "acts on sheets, and the scene has none: remove this table");
        }
    }
    if let Some(damping) = &scene.damping {
        for (name, value) in [
            ("shear_viscosity", damping.shear_viscosity),
            ("stiffness_time", damping.stiffness_time),
            ("mass_rate", damping.mass_rate),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                check.say(format!("damping.{name}"), format!("must be zero or positive, is {value}"));
            }
        }
        check.finite("damping.bulk_viscosity", &[damping.bulk_viscosity]);
        if scene.bodies.is_empty() {
            check.say("damping", "acts on deformable bodies, and the scene has none: remove this table");
        }
    }
}

fn output(check: &mut Checker, scene: &Scene) {
    let output = &scene.output;
    for (key, value, unit) in [("output.interval", output.interval, "s"), ("output.fps", output.fps, "1/s")] {
        if let Some(value) = value {
            check.positive(key, value, unit);
        }
    }
    frames::count(check, scene);
    check.at_most_one_of(
        "output",
        &[("interval", output.interval.is_some()), ("fps", output.fps.is_some())],
        false,
    );
    if output.cache.is_some() && output.fps.is_none() {
        check.say(
            "output.cache",
            "needs frames at regular times: give `fps`, e.g. fps = 24, instead of `interval`",
        );
    }
    if output.piece_points == 0 {
        check.say("output.piece_points", "must be at least 1");
    }
    let mut fields = HashSet::new();
    for field in &scene.output.fields {
        if !fields.insert(*field as u8) {
            check.say("output.fields", "names a field twice");
        }
        let is_of_solids = field.of_elements().is_some();
        if let Some(sheet) = scene.bodies.iter().find(|body| is_of_solids && body.dimension() == 2) {
            let name = &sheet.name;
            check.say("output.fields", format!("{field:?} exists for solids only, and '{name}' is a sheet"));
        }
    }
    if let Some(checkpoint) = &scene.checkpoint {
        check.positive("checkpoint.interval", checkpoint.interval, "s");
        if checkpoint.keep == 0 {
            check.say("checkpoint.keep", "must be at least 1; remove [checkpoint] to write none");
        }
    }
    if let Some(guard) = &scene.guard {
        check.positive("guard.bound", guard.bound, "");
        if guard.acts() && scene.output.ledger == Some(false) {
            check.say("guard.action", "needs the energy ledger: remove `output.ledger = false`");
        }
        if scene.statics.is_some() {
            check.say("guard", "monitors motion, and a static scene has none: remove this table");
        }
    }
    let assert = &scene.assert;
    for (name, bound) in [
        ("energy_drift", assert.energy_drift),
        ("momentum_drift", assert.momentum_drift),
        ("angular_momentum_drift", assert.angular_momentum_drift),
        ("smallest_gap", assert.smallest_gap),
    ] {
        if bound.is_some_and(|bound| bound.is_nan() || bound < 0.0) {
            check.say(format!("assert.{name}"), "must be zero or positive");
        }
    }
}
