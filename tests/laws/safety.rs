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
