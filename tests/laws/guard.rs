//! Tests the guard: it answers energy from nowhere, tells what it did and why, and leaves sound runs alone.

use crate::program::Program;

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

/// A step far beyond the stable one overflows in the same element again after it was halved; that does not end the run.
#[test]
fn failures_that_repeat_end_with_a_stable_step() {
    let scene = RINGING
        .replace("SCHEME", "stormer-verlet")
        .replace("LAW", "st-venant-kirchhoff")
        .replace("2.2e-3", "0.02")
        .replace("GUARD", "[guard]\naction = \"halve\"");
    let run = Program::try_run(&scene, &[]);
    assert_eq!(run.code(), Some(0), "{}", run.errors());
    let report = run.report();
    let events = report["guard"]["events"].as_array().unwrap();
    let facts = |event: &serde_json::Value| (event["step"].clone(), event["failure"].clone());
    let repeats =
        events.windows(2).any(|pair| !pair[0]["failure"].is_null() && facts(&pair[0]) == facts(&pair[1]));
    assert!(repeats, "{events:?}");
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
