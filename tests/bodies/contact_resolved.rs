//! Tests the schemes of high order, whose steps must resolve contact: they keep the energy of an impact far better than a
//! scheme of order two, and a step that is too long for them fails by name.

use crate::contact::{assert_same_bits, block};
use crate::program::Program;

/// The schemes as they are written in a scene, with a step that resolves the impact of the block.
const SCHEMES: [(&str, f64); 4] = [
    ("blanes-moan-4", 4e-4),
    ("blanes-moan-6", 4e-4),
    ("gauss\"\nstages = 2\n#\"", 2e-4),
    ("gauss\"\nstages = 3\n#\"", 2e-4),
];

/// Describes the block with its first impact and rebound.
fn impact(scheme: &str, step: f64, contact: &str) -> String {
    block(scheme, contact)
        .replace("step = 1e-3", &format!("step = {step:e}"))
        .replace("end = 0.3", "end = 0.2")
}

/// Returns the largest error of the energy, relative to the largest kinetic energy.
fn energy_error(program: &Program) -> f64 {
    let history = program.history();
    let (total, kinetic) = (history.column("total"), history.column("kinetic"));
    let exchanged = kinetic.iter().copied().fold(0.0, f64::max);
    total.iter().map(|e| (e - total[0]).abs()).fold(0.0, f64::max) / exchanged
}

#[test]
fn a_resolved_blow_keeps_its_energy_and_its_account_closes() {
    let second_order = energy_error(&Program::run(&impact("stormer-verlet", 4e-4, "")));
    for (scheme, step) in SCHEMES {
        let program = Program::run(&impact(scheme, step, ""));
        let history = program.history();
        assert!(history.column("pairs").iter().any(|&pairs| pairs > 0.0), "{scheme}");
        assert!(history.column("smallest_gap").iter().all(|&gap| gap > 0.0), "{scheme}");
        let error = energy_error(&program);
        assert!(error < 1e-2 * second_order, "{scheme}: {error:e}, order 2: {second_order:e}");
        let unexplained = program.report()["energy"]["unexplained"].as_f64().unwrap();
        assert!(unexplained.abs() < 1e-9, "{scheme}: {unexplained:e}");
        // The layer has no third derivative at its edge, so that the error decreases at least with order two.
        let finer = energy_error(&Program::run(&impact(scheme, 0.25 * step, "")));
        assert!(finer < error / 16.0 || finer < 1e-10, "{scheme}: {error:e} {finer:e}");
    }
}

/// The mean force of a probe over each step, times the step, is the change of momentum of a body on which nothing else acts. This also
/// holds for steps that were divided.
#[test]
fn the_probe_of_contact_force_gives_the_change_of_momentum() {
    let probe = "[[probe]]\nname = \"f\"\nbetween = [\"block\", \"floor\"]\nsum = \"contact_force\"\n";
    let thrown = |scheme: &str, step: f64, contact: &str| {
        impact(scheme, step, contact)
            .replace("-9.81", "0.0")
            .replace("end = 0.2", "end = 0.08")
            .replace("tolerance = 1e-8", "tolerance = 1e-12")
            .replace("[[rigid]]", &format!("velocity = [0.5, 0.3, -3.0]\n{probe}[[rigid]]"))
            .replace("ledger = true", "ledger = true\nhistory = 1")
    };
    let [.., gauss] = SCHEMES;
    let whole = SCHEMES.map(|(scheme, step)| (scheme, 0.5 * step, ""));
    let cut = (gauss.0, 2e-3, "stiffness = 1e8\n");
    for (scheme, step, contact) in whole.into_iter().chain([cut]) {
        let program = Program::run(&thrown(scheme, step, contact));
        let history = program.history();
        let t = history.column("t");
        for axis in ["x", "y", "z"] {
            let (p, f) = (history.column(&format!("p{axis}")), history.column(&format!("f.f{axis}")));
            for row in 1..t.len() {
                let off = f[row] * (t[row] - t[row - 1]) - (p[row] - p[row - 1]);
                // The momentum is 24 N s. The history states times with a limited number of digits.
                assert!(off.abs() < 1e-9, "{scheme}, h = {step:e} s, t = {} s: off by {off:e} N s", t[row]);
            }
        }
        let pressed = history.column("f.fz").iter().filter(|&&force| force > 0.0).count();
        assert!(pressed > 3, "{scheme}: {pressed} steps");
        let divided = program.report()["substeps"]["steps_cut"].as_u64().unwrap_or(0);
        assert_eq!(divided > 0, !contact.is_empty(), "{scheme}: {divided} steps cut");
    }
}

#[test]
fn a_resolved_run_is_the_same_on_any_threads_and_after_a_resume() {
    for (scheme, step) in [SCHEMES[1], SCHEMES[2]] {
        assert_same_bits(scheme, &impact(scheme, step, ""), 0.04, 3);
    }
}

#[test]
fn a_step_that_is_too_long_for_contact_fails_with_one_that_is_not() {
    let hard = |step: f64| impact("blanes-moan-4", step, "stiffness = 1e9\n");
    let program = Program::check(&hard(2e-3));
    let output = crate::program::command()
        .current_dir(program.directory())
        .args(["run", "scene.toml", "--out", "out"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{said}");
    for word in ["blanes-moan-4 does not resolve contact", "use a step of at most", "energy-momentum"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    // Implicit steps are cut until their parts resolve contact.
    let cut = Program::run(&impact(SCHEMES[2].0, 2e-3, "stiffness = 1e8\n"));
    assert!(
        cut.report()["substeps"]["steps_cut"].as_u64().is_some_and(|steps| steps > 0),
        "{}",
        cut.report()["substeps"]
    );
}

/// Refusals propose nothing that the scene refuses too: with adaptive steps no explicit scheme and not `bdf2`, and no scheme for a mass that
/// contact excludes.
#[test]
fn refusals_propose_what_the_scene_accepts() {
    let scene = |scheme: &str, step: &str, solver: &str| {
        format!(
            r#"
[time]
end = 0.01
step = {step}
scheme = "{scheme}"
{solver}
[contact]
[[body]]
name = "block"
box = {{ size = [0.1, 0.1, 0.1], cells = [1, 1, 1], element = "hex8", origin = [0, 0, 0.01] }}
material = {{ law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
fixed = true
"#
        )
    };
    let cases = [
        ("truncated-euler", "\"adaptive\"", "", "energy-momentum", "stormer-verlet"),
        ("generalized-alpha", "\"adaptive\"", "", "backward-euler or newmark", "bdf2"),
        ("generalized-alpha", "1e-3", "", "stormer-verlet", "no such word"),
        ("implicit-midpoint", "1e-3", "[solver]\nmass = \"filtered\"", "remove `mass`", "time.scheme"),
    ];
    for (scheme, step, solver, proposed, refused) in cases {
        let program = Program::check(&scene(scheme, step, solver));
        let said = program.errors() + &String::from_utf8_lossy(&program.output.stdout);
        assert_eq!(program.code(), Some(2), "{said}");
        assert!(said.contains(proposed) && !said.contains(refused), "{scheme}: {said}");
    }
}

#[test]
fn friction_is_refused_by_schemes_without_it() {
    for (scheme, step) in SCHEMES {
        let program = Program::check(&impact(scheme, step, "friction = 0.3\n"));
        let said = program.errors() + &String::from_utf8_lossy(&program.output.stdout);
        assert_eq!(program.code(), Some(2), "{said}");
        for word in ["friction", "energy-momentum", "backward-euler", "bdf2", "newmark"] {
            assert!(said.contains(word), "no {word}: {said}");
        }
    }
}
