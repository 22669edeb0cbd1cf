//! Tests the response of a run to failed steps and to energy from nowhere: it reports them, recovers if it can, and
//! otherwise ends with a clear error.

use crate::program::Program;

/// A block whose left end is struck so hard that a whole step inverts elements.
const STRUCK: &str = r#"
[time]
end = 0.02
step = 2e-3
scheme = "SCHEME"
TIME
[[body]]
name = "block"
box = { size = [0.4, 0.2, 0.2], cells = [4, 2, 2], element = "tet4", origin = [0, 0, 0] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[strike]]
body = "block"
region = "x-min"
impulse = [300.0, 0.0, 0.0]
[output]
interval = 0.004
[checkpoint]
interval = 0.004
"#;

fn struck(scheme: &str, time: &str) -> Program {
    Program::try_run(&STRUCK.replace("SCHEME", scheme).replace("TIME", time), &[])
}

#[test]
fn a_step_that_fails_is_cut() {
    for scheme in ["implicit-midpoint", "gauss", "energy-momentum", "bdf2", "generalized-alpha"] {
        let whole = struck(scheme, "substeps = false");
        assert_eq!(whole.code(), Some(4), "{scheme}: the scene is too gentle");
        let run = struck(scheme, "");
        assert_eq!(run.code(), Some(0), "{scheme}: {}", run.errors());
        let (report, history) = (run.report(), run.history());
        let cut = report["substeps"]["steps_cut"].as_u64().unwrap();
        let substeps = report["substeps"]["substeps"].as_u64().unwrap();
        assert!(cut >= 1 && substeps >= 2 * cut, "{scheme}: {}", report["substeps"]);
        assert!(report["substeps"]["smallest"].as_f64().unwrap() <= 1e-3);
        // Cut steps break the time symmetry of a symmetric scheme, and the report says so.
        let is_symmetric = !["bdf2", "generalized-alpha"].contains(&scheme);
        assert_eq!(report["substeps"]["time_symmetry_lost"], is_symmetric);
        assert_eq!(
            report["notes"].to_string().contains("run backwards"),
            is_symmetric,
            "{}",
            report["notes"]
        );
        assert_eq!(history.column("substeps").iter().sum::<f64>(), substeps as f64);
        // The history has every whole step at its time.
        let times = history.column("t");
        assert_eq!(times.len(), 11);
        assert!(times.iter().enumerate().all(|(n, t)| *t == n as f64 * 2e-3), "{times:?}");
        // Linear momentum is conserved through all substeps.
        let momentum = history.column("px");
        assert!(momentum.iter().all(|p| (p / 300.0 - 1.0).abs() < 1e-6), "{scheme}: {momentum:?}");
        assert!(String::from_utf8_lossy(&run.output.stdout).contains("were cut into"));
    }
}

/// A clamp pushes one face through the other, so that no step is small enough. The run ends with exit code 4 and keeps
/// the state before the failed step.
#[test]
fn the_floor_is_a_clear_end() {
    let scene = STRUCK.replace("SCHEME", "implicit-midpoint").replace("TIME", "").replace(
        "[[strike]]\nbody = \"block\"\nregion = \"x-min\"\nimpulse = [300.0, 0.0, 0.0]",
        "[[fix]]\nbody = \"block\"\nregion = \"x-max\"\n[[fix]]\nbody = \"block\"\nregion = \"x-min\"\n\
         motion = { kind = \"translate\", velocity = [40.0, 0.0, 0.0] }",
    );
    let run = Program::try_run(&scene, &[]);
    assert_eq!(run.code(), Some(4), "{}", run.errors());
    let errors = run.errors();
    assert!(errors.contains("h = 0.000001953125"), "{errors}");
    assert!(errors.contains("failed") && errors.contains("last good state"), "{errors}");
    let (report, history) = (run.report(), run.history());
    let steps = report["steps"].as_u64().unwrap();
    assert!(report["outcome"]["failed"].as_str().unwrap().contains("failed"), "{}", report["outcome"]);
    assert_eq!(history.column("t").len() as u64, steps + 1);
    assert!(history.last("total").is_finite());
    let found = variational::run::checkpoint::newest(&run.out()).unwrap();
    assert_eq!(found.checkpoint.steps(), steps);
    let frames = vi_frames(&run);
    assert_eq!(frames.last().unwrap(), &(steps as f64 * 2e-3), "{frames:?}");
}

/// Returns the times of the frames.
fn vi_frames(run: &Program) -> Vec<f64> {
    let series = variational::io::PvdSeries::open(&run.out().join("scene.pvd")).unwrap();
    series.frames().iter().map(|frame| frame.0).collect()
}

/// A block that rings, with explicit steps beyond their limit: its energy grows without bound.
const RINGING: &str = r#"
[time]
end = 0.1
step = 2.2e-3
scheme = "SCHEME"
[[body]]
name = "block"
box = { size = [0.4, 0.2, 0.2], cells = [4, 2, 2], element = "tet4", origin = [0, 0, 0] }
material = { law = "LAW", young = 1e6, poisson = 0.3, density = 1000.0 }
velocity = [0.1, 0, 0]
[[fix]]
body = "block"
region = "x-min"
GUARD
"#;

fn ringing(scheme: &str, law: &str, guard: &str) -> Program {
    let scene = RINGING.replace("SCHEME", scheme).replace("LAW", law).replace("GUARD", guard);
    Program::try_run(&scene, &[])
}

#[test]
fn energy_from_nowhere_never_passes_in_silence() {
    // Without a table `[guard]` a state that means nothing is not continued: the run halves the step and says which
    // step would have been right.
    let run = ringing("stormer-verlet", "linear", "");
    assert_eq!(run.code(), Some(0), "{}", run.errors());
    let (first, last) = (run.history().first("total"), run.history().last("total"));
    assert!(last < 2.0 * first, "{first} {last}");
    assert_eq!(run.report()["guard"]["events"].as_array().unwrap().len(), 1);
    let notes = run.report()["notes"].to_string();
    assert!(notes.contains("on with steps of 1.1") && notes.contains("energy-momentum"), "{notes}");

    // If it may only warn, the warning is on the console and in the report.
    let run = ringing("stormer-verlet", "linear", "[guard]\naction = \"warn\"");
    assert_eq!(run.code(), Some(0), "{}", run.errors());
    assert!(run.errors().contains("warning: the energy grew without a source"), "{}", run.errors());
    let guard = &run.report()["guard"];
    assert_eq!(guard["exceeded"], true);
    let (first, last) = (run.history().first("total"), run.history().last("total"));
    assert!(last > 1e3 * first, "it did not become unstable: {first} {last}");
    let growth = guard["growth"].as_f64().unwrap();
    assert!((growth / (last - first) - 1.0).abs() < 0.5, "{growth} J of {last}");

    let run = ringing("stormer-verlet", "linear", "[guard]\naction = \"stop\"");
    assert_eq!(run.code(), Some(4));
    assert!(run.errors().contains("energy guard") && run.errors().contains(" J "), "{}", run.errors());
    assert!(run.history().last("total") < 10.0 * first, "it was stopped too late");

    for action in ["halve", "switch"] {
        let run = ringing("stormer-verlet", "linear", &format!("[guard]\naction = \"{action}\""));
        assert_eq!(run.code(), Some(0), "{action}: {}", run.errors());
        let (report, history) = (run.report(), run.history());
        let events = report["guard"]["events"].as_array().unwrap();
        assert!(!events.is_empty() && events.iter().all(|event| event["joules"].as_f64().unwrap() > 0.0));
        let said = events[0]["action"].as_str().unwrap();
        assert!(said.contains(if action == "halve" { "with steps of" } else { "energy-momentum" }), "{said}");
        assert!(history.last("total") < 1.1 * first, "{action}: {}", history.last("total"));
        let times = history.column("t");
        assert!(times.iter().is_sorted_by(|a, b| a < b) && times.len() == 46, "{times:?}");
        assert!(String::from_utf8_lossy(&run.output.stdout).contains("energy guard:"));
    }
}

/// The note on a guard that acted more than once reports the last event: its growth, time and action.
#[test]
fn the_note_on_the_guard_tells_one_event() {
    let scene =
        RINGING.replace("SCHEME", "stormer-verlet").replace("LAW", "linear").replace("2.2e-3", "4.4e-3");
    let report = Program::run(&scene.replace("GUARD", "[guard]\naction = \"halve\"")).report();
    let events = report["guard"]["events"].as_array().unwrap();
    assert!(events.len() > 1, "{events:?}");
    let last = events.last().unwrap();
    let number = |key: &str| last[key].as_f64().unwrap();
    let note = report["notes"].to_string();
    let (relative, t) =
        (format!("the last time by {:.1e} of", number("relative")), format!("at t = {:e} s;", number("t")));
    assert!(note.contains(&relative) && note.contains(&t), "{last} {note}");
    assert!(note.contains(last["action"].as_str().unwrap()), "{last} {note}");
}

/// A step that leaves the domain of a law is named as such and counted apart from growth of energy, of which alone the note tells sizes.
#[test]
fn a_failed_step_is_told_apart_from_growth() {
    let program = Program::run(
        r#"
[time]
end = 1.2
step = 0.002
scheme = "stormer-verlet"
[[body]]
name = "b"
box = { size = [0.4, 0.1, 0.1], cells = [4, 1, 1], element = "hex8" }
material = { law = "neo-hookean", young = 2.0e5, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "b"
region = "x-min"
motion = { kind = "rotate", axis = [0, 0, 1], rate = 50.0, point = [0, 0.05, 0.05], start = 0.5, end = 0.7 }
"#,
    );
    let report = program.report();
    let events = report["guard"]["events"].as_array().unwrap();
    let failed: Vec<&str> = events.iter().filter_map(|event| event["failure"].as_str()).collect();
    assert!(!failed.is_empty() && report["guard"]["failed_steps"] == failed.len(), "{events:?}");
    assert!(
        failed.iter().all(|failure| failure.contains("element") && failure.contains("det F")),
        "{failed:?}"
    );
    let grown: Vec<f64> = (events.iter().filter(|event| event["failure"].is_null()))
        .map(|event| event["relative"].as_f64().unwrap())
        .collect();
    assert!(grown.iter().all(|&relative| relative > 1.0), "{grown:?}");
    let notes = report["notes"].to_string();
    assert!(notes.contains(failed.last().unwrap()) && notes.contains("went back"), "{notes}");
    assert_eq!(notes.contains("the energy had grown"), !grown.is_empty(), "{notes}");
}

/// After the guard has acted, one note tells which step would be right: no longer than the last one, nor than the one that was advised
/// before the run, and a shorter one than the last if the energy has grown even with it.
#[test]
fn the_guard_advises_one_step() {
    let chain = r#"
gravity = [0, -9.81, 0]
[time]
end = 0.3
step = 0.03
scheme = "stormer-verlet"
[[rigid]]
name = "a"
shape = { kind = "rod", length = 0.6, radius = 0.02 }
density = 1000.0
position = [0.3, 0, 0]
[[joint]]
kind = "ball"
body = "a"
point = [0, 0, 0]
[[body]]
name = "block"
box = { size = [0.05, 0.05, 0.05], cells = [1, 1, 1], element = "hex8", origin = [0.6, -0.025, -0.025] }
material = { law = "neo-hookean", young = 1.0e5, poisson = 0.3, density = 1000.0 }
[[attach]]
body = "block"
region = "x-min"
to = "a"
"#;
    let spinning = r#"
[time]
end = 3.0
step = 0.01
scheme = "symplectic-euler-a"
[[body]]
name = "b"
box = { size = [0.3, 0.1, 0.2], cells = [3, 1, 2], element = "tet4" }
material = { law = "stable-neo-hookean", young = 5.0e4, poisson = 0.35, density = 1000.0 }
angular_velocity = [1, 7, 0.5]
displacement = ["0.1*x", "0", "0"]
[output]
history = 1
"#;
    for (scene, still_grows) in [(chain, false), (spinning, true)] {
        let report = Program::run(scene).report();
        let notes: Vec<&str> =
            report["notes"].as_array().unwrap().iter().filter_map(|note| note.as_str()).collect();
        // Returns the length that follows these words, s.
        let after = |words: &str| {
            let found: Vec<f64> = (notes.iter().flat_map(|note| note.split(words).skip(1)))
                .filter_map(|rest| rest.split_whitespace().next()?.parse().ok())
                .collect();
            assert!(found.len() <= 1, "{words}: {notes:?}");
            found.first().copied()
        };
        let last = after("on with steps of ").unwrap();
        let before = after("unstable; use a step of ").unwrap();
        let (advised, below) = (after("Use a step of "), after("Use a step below "));
        assert!(advised.is_some() != below.is_some(), "{notes:?}");
        let step = advised.or(below).unwrap();
        assert!((step - last.min(before)).abs() < 1e-3 * step, "{step} s: {notes:?}");
        assert_eq!(below.is_some(), still_grows && last <= before, "{notes:?}");
        let count = |words: &str| notes.iter().filter(|note| note.contains(words)).count();
        assert!(count("went back") == 1 && count("without a source") <= 1, "{notes:?}");
    }
}

/// A bound that the scene states is no laxer than the default: a scheme of order 1 is judged from the third step on, by 4/n after n steps
/// until that is below the bound.
#[test]
fn a_stated_bound_is_no_laxer_than_the_default() {
    for guard in ["[guard]\naction = \"stop\"", "[guard]\naction = \"stop\"\nbound = 0.01"] {
        let run = ringing("symplectic-euler-a", "linear", guard);
        assert_eq!(run.code(), Some(4), "{guard}: {}", run.errors());
        let (first, last) = (run.history().first("total"), run.history().last("total"));
        assert!(last < 10.0 * first, "{guard}: {first} {last}");
    }
}

/// The bound holds for a whole run, also where the guard has acted: a stretched block that turns fast gains energy in steps
/// of implicit midpoint that are far too long.
#[test]
fn the_bound_holds_however_often_the_guard_acts() {
    let scene = r#"
[time]
end = 0.5
step = 5e-3
scheme = "implicit-midpoint"
[[body]]
name = "block"
box = { size = [0.5, 0.1, 0.1], cells = [6, 2, 2], element = "tet4" }
material = { law = "st-venant-kirchhoff", young = 5e6, poisson = 0.3, density = 1000.0 }
angular_velocity = [1, 2, 30]
displacement = ["0.2*x", "0", "0"]
[output]
history = 5
"#;
    let run = Program::try_run(scene, &[]);
    assert_eq!(run.code(), Some(0), "{}", run.errors());
    let (guard, history) = (&run.report()["guard"], run.history());
    assert!(!guard["events"].as_array().unwrap().is_empty(), "{guard}");
    let bound = history.first("total") + guard["exchange"].as_f64().unwrap();
    for total in history.column("total") {
        assert!(total <= bound, "{total} J of {bound}");
    }
}

/// Wind that is linearised once per step gives no more energy than it does to a converged step. It blows against a
/// cloth so fast that the cloth moves by several cells per step.
#[test]
fn truncated_steps_are_stable_in_wind() {
    let run = |scheme: &str| {
        let scene = r#"
gravity = [0, 0, -9.81]
[time]
end = 0.3
step = 0.01
scheme = "SCHEME"
[[body]]
name = "cloth"
sheet = { size = [0.6, 0.6], cells = [10, 10] }
material = { law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, area_density = 0.2, thickness = 5e-4 }
[[fix]]
body = "cloth"
region = "x-min"
[[fix]]
body = "cloth"
region = "x-max"
[wind]
velocity = [0, 0, 6.0]
[guard]
action = "off"
[output]
history = 1
"#;
        Program::run(&scene.replace("SCHEME", scheme))
    };
    let (truncated, converged) = (run("truncated-euler"), run("backward-euler"));
    assert_eq!(truncated.report()["substeps"]["steps_cut"], 0);
    let [truncated, converged] = [truncated, converged].map(|run| run.history().column("total"));
    for (truncated, converged) in truncated.iter().zip(&converged) {
        assert!((truncated - converged).abs() < 0.05, "{truncated} instead of {converged} J");
    }
}

/// Constraints give a truncated step no energy: a rod on a hinge, a box on a ball joint and a cloth on the box fall from rest with steps of
/// many periods of the cloth. With more solves, the motion is that of backward Euler.
#[test]
fn truncated_steps_of_mechanisms_gain_no_energy() {
    let run = |scheme: &str, step: f64, solves: u32| {
        let solves = if solves > 0 { format!("solves = {solves}") } else { String::new() };
        let scene = format!(
            r#"
gravity = [0, 0, -9.81]
[time]
end = 0.6
step = {step}
scheme = "{scheme}"
{solves}
[[rigid]]
name = "rod"
shape = {{ kind = "rod", length = 0.5, radius = 0.02 }}
density = 1000.0
position = [0.25, 0, 0]
[[joint]]
kind = "hinge"
axis = [0, 1, 0]
body = "rod"
point = [0, 0, 0]
[[rigid]]
name = "box"
shape = {{ kind = "box", size = [0.2, 0.1, 0.05] }}
density = 1000.0
position = [0.6, 0, 0]
[[joint]]
kind = "ball"
body = "rod"
to = "box"
point = [0.5, 0, 0]
[[body]]
name = "cloth"
sheet = {{ size = [0.4, 0.1], cells = [8, 2], origin = [0.7, -0.05, 0] }}
material = {{ law = "neo-hookean", young = 2e6, poisson = 0.3, density = 900.0, thickness = 1e-3 }}
[[attach]]
body = "cloth"
region = "x-min"
to = "box"
[guard]
action = "off"
[output]
history = 1
"#
        );
        let run = Program::run(&scene);
        assert_eq!(run.report()["substeps"]["steps_cut"], 0, "{scheme} {step} {solves}");
        run.history()
    };
    for (step, solves) in [(1.0 / 60.0, 2), (1.0 / 60.0, 8), (1.0 / 30.0, 4), (0.1, 8)] {
        let history = run("truncated-euler", step, solves);
        let (total, kinetic) = (history.column("total"), history.column("kinetic"));
        let scale = kinetic.iter().copied().fold(0.0, f64::max);
        for pair in total.windows(2) {
            assert!(pair[1] <= pair[0] + 1e-12 * scale, "{step} s, {solves} solves: {total:?}");
        }
        // The hinge holds the middle of the rod at a distance of .25 m.
        for (x, z) in history.column("rod.x").iter().zip(&history.column("rod.z")) {
            assert!((x.hypot(*z) - 0.25).abs() < 1e-12, "{step} s, {solves} solves: {x} {z}");
        }
    }
    let [few, many] = [("truncated-euler", 200), ("backward-euler", 0)].map(|(scheme, solves)| {
        let history = run(scheme, 2e-3, solves);
        (history.last("total"), history.last("kinetic"))
    });
    assert!((few.0 - many.0).abs() < 1e-3 * many.1, "{few:?} {many:?}");
}

/// Without constraints too, a truncated step gives no energy: a block swings on a spring, with steps from a tenth of its period to half
/// of it. Nor does it lose more than backward Euler needs to lose: with shorter steps and enough solves, less is lost.
#[test]
fn truncated_steps_gain_no_energy_without_constraints() {
    let run = |step: f64, solves: u32, stiffness: f64, length: f64| {
        let run = Program::run(&format!(
            r#"
[time]
end = 1.5
step = {step}
scheme = "truncated-euler"
solves = {solves}
[[body]]
name = "b"
box = {{ size = [0.1, 0.1, 0.1], cells = [1, 1, 1], element = "hex8", origin = [0.95, -0.05, -0.05] }}
material = {{ law = "st-venant-kirchhoff", young = 1.0e5, poisson = 0.3, density = 1000.0 }}
velocity = [0.0, 1.5, 0.0]
[[spring]]
from = {{ body = "b", point = [0.95, -0.05, -0.05] }}
to = {{ point = [0, 0, 0] }}
stiffness = {stiffness}
length = {length}
[guard]
action = "off"
[output]
history = 1
"#
        ));
        run.history()
    };
    for (stiffness, length) in [(5.0, 0.5), (5.0, 0.0), (50.0, 0.5)] {
        for (step, solves) in [(0.5, 4), (0.3, 2), (0.1, 1), (0.1, 2), (0.1, 30)] {
            let history = run(step, solves, stiffness, length);
            let (total, kinetic) = (history.column("total"), history.column("kinetic"));
            let scale = kinetic.iter().copied().fold(0.0, f64::max);
            for pair in total.windows(2) {
                assert!(pair[1] <= pair[0] + 1e-12 * scale, "{step} s, {solves}, {stiffness} N/m: {total:?}");
            }
        }
    }
    let lost = [4e-3, 2e-3, 1e-3].map(|step| {
        let history = run(step, 30, 5.0, 0.5);
        history.first("total") - history.last("total")
    });
    assert!(lost[1] < 0.6 * lost[0] && lost[2] < 0.6 * lost[1] && lost[2] > 0.0, "{lost:?}");
}

/// A stiff cloth looks softer if its solves are too few, and the run says so; of a soft one, for which they suffice, it does not.
#[test]
fn solves_that_stop_far_from_convergence_are_told() {
    for (young, is_short) in [("1e8", true), ("1e5", false)] {
        let scene = r#"
gravity = [0, 0, -9.81]
[time]
end = 0.5
step = 0.0166666666666666667
scheme = "truncated-euler"
[[body]]
name = "flag"
sheet = { size = [0.6, 0.4], cells = [12, 8] }
material = { law = "st-venant-kirchhoff", young = YOUNG, poisson = 0.3, area_density = 0.3, thickness = 1e-3 }
[[fix]]
body = "flag"
region = "x-min"
"#;
        let run = Program::run(&scene.replace("YOUNG", young));
        let report = run.report();
        let (short, steps) = (&report["work"]["stopped_short"], report["steps"].as_u64().unwrap());
        let tells = |text: &str| text.contains("far from convergence") && text.contains("time.solves");
        let is_noted =
            report["notes"].as_array().unwrap().iter().any(|note| note.as_str().is_some_and(tells));
        let is_said = tells(&run.errors());
        assert_eq!([is_noted, is_said], [is_short; 2], "E = {young} Pa: {short} of {steps} steps");
    }
}

/// A cloth that falls onto a ball with explicit steps above their limit. Explicit steps with contact are not halved, so the run
/// ends, and before a step at the velocities of a state that means nothing, which would make candidates of all pairs.
#[test]
fn an_unstable_explicit_step_with_contact_ends_the_run_in_time() {
    let scene = r#"
gravity = [0, 0, -9.81]
[time]
end = 0.5
step = 3.2e-3
scheme = "stormer-verlet"
[contact]
[[body]]
name = "cloth"
sheet = { size = [1.0, 1.0], cells = [10, 10], origin = [-0.5, -0.5, 0.02] }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3, bending = "none" }
[[rigid]]
name = "ball"
shape = { kind = "sphere", radius = 0.3 }
position = [0.0, 0.0, -0.3]
fixed = true
[output]
history = 1
"#;
    let run = Program::try_run(scene, &[]);
    assert_eq!(run.code(), Some(4), "{}", run.errors());
    let errors = run.errors();
    for part in ["energy guard ends the run", "time.step", "energy-momentum"] {
        assert!(errors.contains(part), "{part}: {errors}");
    }
    // Its energy grows tenfold per step. The exchange is the weight times the fall.
    let [kinetic, gravity] = ["kinetic", "gravity"].map(|name| run.history().column(name));
    let exchange = gravity[0] - gravity.last().unwrap();
    assert!(*kinetic.last().unwrap() < 20.0 * exchange, "{kinetic:?} {exchange}");
}

/// The guard does not act on stable runs, driven or free, of schemes within their stability limits.
#[test]
fn the_guard_leaves_sound_runs_alone() {
    for scheme in ["stormer-verlet", "blanes-moan-4", "implicit-midpoint", "energy-momentum", "bdf2"] {
        let scene = RINGING
            .replace("SCHEME", scheme)
            .replace("LAW", "stable-neo-hookean")
            .replace("2.2e-3", "2e-4")
            .replace("velocity = [0.1, 0, 0]", "")
            .replace("[time]", "gravity = [0.0, -9.81, 0.0]\n[time]")
            .replace("GUARD", "motion = { kind = \"sine\", amplitude = [0, 0.01, 0], frequency = 20.0 }\n[guard]\naction = \"halve\"");
        let run = Program::try_run(&scene, &[]);
        assert_eq!(run.code(), Some(0), "{scheme}: {}", run.errors());
        assert_eq!(
            run.report()["guard"]["events"].as_array().unwrap().len(),
            0,
            "{scheme}: {}",
            run.report()["guard"]
        );
        assert!(!run.errors().contains("warning"), "{}", run.errors());
    }
}

/// The energy of a body of which every node is prescribed is round-off as long as the body is not deformed. The guard compares it
/// with the round-off of its stiffness, not with that of its start.
#[test]
fn the_guard_ignores_the_round_off_of_bodies_that_are_wholly_prescribed() {
    let scene = RINGING
        .replace("SCHEME", "implicit-midpoint")
        .replace("LAW", "st-venant-kirchhoff")
        .replace("2.2e-3", "1e-3")
        .replace("velocity = [0.1, 0, 0]", "")
        .replace("region = \"x-min\"", "box = {}")
        .replace(
            "GUARD",
            "motion = { kind = \"sine\", amplitude = [0.1, 0, 0], frequency = 5.0, phase = 1.5707963 }",
        );
    let run = Program::try_run(&scene, &[]);
    assert_eq!(run.code(), Some(0), "{}", run.errors());
    let guard = run.report()["guard"].clone();
    assert!(guard["resolution"].as_f64().unwrap() > 0.0, "{guard}");
    assert_eq!(guard["growth"], 0.0, "{guard}");
}

/// A force whose square overflows is no balance: a body under it is not at rest, whatever the scheme.
#[test]
fn forces_that_overflow_are_not_taken_for_rest() {
    for scheme in ["stormer-verlet", "implicit-midpoint", "gauss", "energy-momentum", "bdf2"] {
        let scene = RINGING
            .replace("SCHEME", scheme)
            .replace("LAW", "st-venant-kirchhoff")
            .replace("velocity = [0.1, 0, 0]", "")
            .replace("[time]", "gravity = [0.0, -1e200, 0.0]\n[time]")
            .replace("GUARD", "");
        let run = Program::try_run(&scene, &[]);
        assert_eq!(run.code(), Some(4), "{scheme}: {}", run.errors());
        assert!(
            run.errors().contains("failed") && run.errors().contains("finite"),
            "{scheme}: {}",
            run.errors()
        );
    }
}

/// A flag that stiffens as it crumples: a step that is stable while the flag is flat becomes unstable.
const FLAG: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 2.0
scheme = "auto"
tolerance = 1e-2
[guard]
action = "off"
[[body]]
name = "cloth"
sheet = { size = [1.0, 1.0], cells = [8, 8] }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3 }
[[fix]]
body = "cloth"
region = "x-min"
"#;

#[test]
fn auto_sees_that_a_step_becomes_too_long() {
    // These steps are up to 0.98 of the stability limit of the flat flag.
    let fails = |step: &&str| {
        let step = format!("time.step={step}");
        let run = Program::try_run(FLAG, &["--set", "time.scheme=stormer-verlet", "--set", &step]);
        run.code() == Some(4)
    };
    assert!(["3.4e-3", "3.5e-3", "3.55e-3", "3.6e-3"].iter().any(fails), "the flag is too tame");
    let run = Program::try_run(FLAG, &[]);
    assert_eq!(run.code(), Some(0), "{}", run.errors());
    let report = run.report();
    assert!(report["energy"]["relative_drift"].as_f64().unwrap() <= 1e-2, "{}", report["energy"]);
    assert!(report["auto"]["trial_seconds"].as_f64() <= report["auto"]["budget_seconds"].as_f64());
    assert_eq!(run.history().column("t").last(), Some(&2.0));
}

/// StVK stiffens under stretch λ by the factor √(3λ² − 1)/√2 along it, which raises the highest frequency. A step below
/// the limit at the start is then above it. The error of the unstable run states this cause.
#[test]
fn a_limit_that_fell_is_named() {
    let scene = |step: f64| {
        format!(
            r#"
[time]
end = 0.2
step = {step:e}
scheme = "stormer-verlet"
[[body]]
name = "bar"
box = {{ size = [0.4, 0.2, 0.2], cells = [8, 4, 4] }}
material = {{ law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "bar"
region = "x-min"
[[fix]]
body = "bar"
region = "x-max"
motion = {{ kind = "translate", velocity = [2.0, 0.0, 0.0] }}
[guard]
action = "warn"
[output]
history = 0
"#
        )
    };
    let limit = Program::run(&scene(1e-4)).report()["stability"]["step_limit"].as_f64().unwrap();
    let run = Program::try_run(&scene(0.95 * limit), &[]);
    assert_eq!(run.code(), Some(4), "{}", run.errors());
    let said = run.errors();
    assert!(said.contains("of the stability limit that stormer-verlet had at the start"), "{said}");
    assert!(run.report()["notes"].to_string().contains("the limit falls as bodies deform"));
}

/// Hard steps of implicit midpoint that gain energy are divided, so that the energy of a crumpling flag stays in a band of
/// .05 of the largest kinetic energy. The ledger closes over the steps that were given up.
#[test]
fn midpoint_steps_that_gain_energy_are_divided() {
    let flag = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.7
step = 0.01
scheme = "implicit-midpoint"
[[body]]
name = "flag"
sheet = { size = [1.0, 1.0], cells = [20, 20] }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, thickness = 1e-3 }
[[fix]]
body = "flag"
region = "x-min"
[output]
history = 1
ledger = true
"#;
    let report = Program::try_run(flag, &[]).report();
    let energy = &report["energy"];
    assert!(report["substeps"]["steps_cut"].as_u64().unwrap() > 0, "{}", report["substeps"]);
    assert!(energy["unexplained"].as_f64().unwrap().abs() < 1e-12, "{energy}");
    assert!(energy["relative_drift"].as_f64().unwrap() < 0.05, "{energy}");
}

/// A soft bar that an impact and its weight bend: at first nearly all its energy is in waves that the step barely resolves.
const BENT: &str = r#"
gravity = [1.0, -9.0, 3.0]
[time]
end = 0.5
scheme = "auto"
[[body]]
name = "bar"
box = { size = [0.5, 0.1, 0.12], cells = [4, 1, 1], element = "hex8" }
material = { law = "neo-hookean", young = 1.3e5, poisson = 0.31, density = 900.0 }
[[fix]]
body = "bar"
region = "x-min"
[[strike]]
body = "bar"
region = "x-max"
impulse = [0.1, 0.2, 0.1]
"#;

/// The error of the energy in the first steps is not compared with the little that was exchanged until then: steps that `auto` chose by
/// trials of the whole run are the steps of the run.
#[test]
fn steps_of_auto_are_not_halved_for_the_first_error_of_the_energy() {
    let report = Program::try_run(BENT, &[]).report();
    assert_eq!(report["scheme"], "stormer-verlet", "{}", report["auto"]);
    assert_eq!(report["guard"]["events"].as_array().unwrap().len(), 0, "{}", report["guard"]);
    assert!(report["guard"]["relative_growth"].as_f64().unwrap() < 1e-2, "{}", report["guard"]);
    assert_eq!(report["substeps"]["steps_cut"], 0);
}

/// Steps that the guard halves are not said to be hard to solve: an explicit scheme solves nothing. If it halves all of them, the run
/// has equal steps, and is as symmetric as with these from the start.
#[test]
fn halved_steps_are_told_from_hard_ones() {
    let run = ringing("stormer-verlet", "linear", "[guard]\naction = \"halve\"");
    let report = run.report();
    let substeps = &report["substeps"];
    assert!(substeps["steps_halved_by_guard"].as_u64().unwrap() > 0, "{substeps}");
    assert_eq!(substeps["steps_halved_by_guard"], substeps["steps_cut"], "{substeps}");
    assert!(!report["notes"].to_string().contains("hard to solve"), "{}", report["notes"]);
    let is_from_start = report["guard"]["events"][0]["action"].as_str().unwrap().contains("from t = 0e0 s");
    assert_eq!(substeps["time_symmetry_lost"], !is_from_start, "{substeps}");
    assert_eq!(report["notes"].to_string().contains("run backwards"), !is_from_start);
}

/// Adaptive explicit steps follow the stability limit, so that nothing warns of intervals above it.
#[test]
fn adaptive_steps_are_not_judged_by_their_intervals() {
    let scene = RINGING.replace("SCHEME", "stormer-verlet").replace("LAW", "linear").replace("GUARD", "");
    let scene = scene.replace("step = 2.2e-3", "step = \"adaptive\"\nlargest_step = 0.05");
    let report = Program::try_run(&scene, &[]).report();
    assert_eq!(report["stability"]["exceeded"], false);
    assert!(!report["notes"].to_string().contains("become unstable"), "{}", report["notes"]);
    let longest = report["adaptive"]["largest_step"].as_f64().unwrap();
    assert!(longest < report["stability"]["step_limit"].as_f64().unwrap(), "{}", report["adaptive"]);
}

/// A soft block that hangs from its top, with viscosities that limit an explicit step more than its stiffness does.
fn viscous(scheme: &str, step: f64, viscosity: f64) -> Program {
    let scene = format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.3
step = {step:e}
scheme = "{scheme}"
[[body]]
name = "block"
box = {{ size = [0.1, 0.1, 0.05], cells = [3, 2, 2], element = "tet4" }}
material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "block"
region = "z-min"
[damping]
shear_viscosity = {viscosity}
bulk_viscosity = {viscosity}
[guard]
action = "warn"
[output]
history = 1
ledger = true
"#
    );
    Program::run(&scene)
}

/// Below the limit that is reported damping takes energy. Above it damping brings energy; the limit is named before the run, and what
/// damping brings counts as growth after it.
#[test]
fn damping_lowers_the_limit_of_explicit_steps() {
    for scheme in ["symplectic-euler-a", "symplectic-euler-b", "stormer-verlet"] {
        let limit_of = |viscosity: f64| {
            let report = viscous(scheme, 1e-4, viscosity).report();
            report["stability"]["step_limit"].as_f64().unwrap()
        };
        let (free, limit) = (limit_of(0.0), limit_of(200.0));
        assert!(limit < 0.5 * free, "{scheme}: {limit:e} {free:e}");
        let sound = viscous(scheme, 0.9 * limit, 200.0);
        let report = sound.report();
        let work = report["energy"]["damping_work"].as_f64().unwrap();
        // Less than the weight can do.
        assert!((-1e-2..0.0).contains(&work), "{scheme}: {work:e}");
        // The energy of the schemes of order 1 oscillates by some per cent.
        assert!(report["guard"]["relative_growth"].as_f64().unwrap() < 0.1, "{}", report["guard"]);
        assert!(!report["notes"].to_string().contains("stability limit"), "{}", report["notes"]);
        let beyond = viscous(scheme, 1.2 * limit, 200.0).report();
        assert!(beyond["notes"].to_string().contains("is above the stability limit"), "{}", beyond["notes"]);
        assert!(beyond["notes"].to_string().contains("grew without a source"), "{}", beyond["guard"]);
    }
}
