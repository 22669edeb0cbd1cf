//! The same scene gives the same bits in history and frames on 1, 2 and 8 threads, and whether its steps are made one
//! by one or together.

use crate::program::Program;
use variational::prelude::*;

const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = END
step = STEP
scheme = "SCHEME"
[[body]]
name = "bracket"
mesh = "MESHES/bracket.msh"
material = { law = "stable-neo-hookean", young = 1e6, poisson = 0.4, density = 1000.0 }
[[fix]]
body = "bracket"
region = "bolts"
[[probe]]
name = "edge"
body = "bracket"
point = [0.0, 0.0, 0.06]
[output]
interval = INTERVAL
fields = ["displacement", "velocity"]
"#;

fn same_bits(scheme: &str, end: f64, step: &str) {
    let scene = SCENE
        .replace("SCHEME", scheme)
        .replace("END", &end.to_string())
        .replace("STEP", step)
        .replace("INTERVAL", &(end / 2.0).to_string());
    let runs = ["1", "2", "8"].map(|threads| Program::run_with(&scene, &["--threads", threads]));
    let mut files: Vec<_> =
        std::fs::read_dir(runs[0].out()).unwrap().map(|e| e.unwrap().file_name()).collect();
    files.retain(|file| file != "report.json");
    assert_eq!(files.len(), 5, "{files:?}");
    for file in files {
        let bytes = runs.each_ref().map(|run| std::fs::read(run.out().join(&file)).unwrap());
        assert!(bytes[0] == bytes[1] && bytes[0] == bytes[2], "{scheme}: {file:?} differs");
    }
}

#[test]
fn explicit_runs() {
    same_bits("stormer-verlet", 2e-3, "1e-5");
}

#[test]
fn implicit_runs() {
    same_bits("implicit-midpoint", 0.02, "4e-3");
    same_bits("gauss", 0.01, "5e-3");
}

#[test]
fn adaptive_runs() {
    for (scheme, end) in [("stormer-verlet", 2e-3), ("energy-momentum", 0.02)] {
        same_bits(scheme, end, "\"adaptive\"");
    }
}

#[test]
fn runs_with_conjugate_gradients() {
    let pcg = SCENE.replace("[output]", "[solver]\nlinear = \"pcg\"\n[output]");
    let scene = pcg.replace("SCHEME", "implicit-midpoint").replace("END", "0.01").replace("STEP", "5e-3");
    let scene = scene.replace("INTERVAL", "0.005");
    let [one, two] = ["1", "2"].map(|threads| {
        let run = Program::run_with(&scene, &["--threads", threads]);
        std::fs::read(run.out().join("history.csv")).unwrap()
    });
    assert!(one == two, "the history differs");
}

/// Makes a simulation of a held block and a spinning one, with 100 steps by `scheme`.
fn two_blocks(scheme: SchemeName, young: f64) -> Simulation {
    let shape = |x| BoxMesh {
        size: [0.4, 0.2, 0.2],
        cells: [4, 2, 2],
        element: CellKind::Tet4,
        origin: [x, 0.0, 0.0],
    };
    let rubber = Law::NeoHookean(Isotropic { young, poisson: 0.3, density: 1000.0 });
    let spinning = Body::from_box("spinning", shape(1.0), rubber.clone()).angular_velocity([0.0, 20.0, 5.0]);
    let scene = Scene::new(Time::new(0.01, 1e-4, scheme))
        .gravity([0.0, -9.81, 0.0])
        .body(Body::from_box("held", shape(0.0), rubber))
        .body(spinning)
        .fix(Fix::region("held", "x-min"));
    Simulation::new(scene).unwrap()
}

fn bits(simulation: &Simulation) -> Vec<u64> {
    let of = |state: &variational::core::State| {
        let values = [state.t].into_iter().chain(state.q.iter().copied()).chain(state.p.iter().copied());
        values.map(f64::to_bits).collect::<Vec<_>>()
    };
    simulation.components().iter().flat_map(|component| of(component.state())).collect()
}

#[test]
fn steps_together_are_steps_one_by_one() {
    for scheme in [
        SchemeName::StormerVerlet,
        SchemeName::SymplecticEulerA,
        SchemeName::SymplecticEulerB,
        SchemeName::BlanesMoan4,
        SchemeName::BlanesMoan6,
    ] {
        let (mut single, mut together) = (two_blocks(scheme, 1e6), two_blocks(scheme, 1e6));
        let mut calls = 0;
        while !single.is_done() {
            single.step().unwrap();
        }
        while !together.is_done() {
            together.advance(u64::MAX).unwrap();
            calls += 1;
        }
        // The law has a domain, so positions must be checked after each step. `symplectic-euler-a` does not evaluate
        // the end of a step and therefore makes its steps one by one.
        assert_eq!(calls == 100, scheme == SchemeName::SymplecticEulerA, "{scheme:?}: {calls} calls");
        assert_eq!(single.work(), together.work(), "{scheme:?}");
        assert!(bits(&single) == bits(&together), "{scheme:?}");
    }
}

#[test]
fn a_step_that_fails_together_is_named_as_alone() {
    // The step is far above the stability limit.
    let [mut single, mut together] = [1e9, 1e9].map(|young| two_blocks(SchemeName::StormerVerlet, young));
    let alone = std::iter::repeat_with(|| single.step()).find_map(Result::err).unwrap();
    let found = std::iter::repeat_with(|| together.advance(u64::MAX)).find_map(Result::err).unwrap();
    assert_eq!(alone, found);
    assert_eq!(single.steps(), together.steps());
    assert!(bits(&single) == bits(&together));
}
