//! A run that was interrupted, killed, or out of disk space continues to the same bits as an uninterrupted one. If a
//! run cannot be continued, the message says why.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program::command;
use serde_json::Value;
use variational::prelude::*;
use variational::run::checkpoint::newest;
use variational::run::resume;

/// Returns everything that a run writes, by name, without checkpoints and clock values.
fn written(directory: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_none_or(|ending| ending != "vck"))
        .map(|path| {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let mut bytes = std::fs::read(&path).unwrap();
            if name == "report.json" {
                let mut report: Value = serde_json::from_slice(&bytes).unwrap();
                let clocks: Vec<String> = report
                    .as_object()
                    .unwrap()
                    .keys()
                    .filter(|key| key.ends_with("seconds") || *key == "provenance")
                    .cloned()
                    .collect();
                clocks.iter().for_each(|key| report[key] = Value::Null);
                // An observer lists candidates of contact anew in a run that continues.
                if let Some(contact) = report["contact"].as_object_mut() {
                    contact.remove("systems");
                }
                bytes = report.to_string().into_bytes();
            }
            (name, bytes)
        })
        .collect();
    files.sort();
    files
}

pub(crate) fn assert_same(one: &Path, other: &Path, what: &str) {
    let (one, other) = (written(one), written(other));
    let names = |files: &[(String, Vec<u8>)]| files.iter().map(|file| file.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&one), names(&other), "{what}");
    for ((name, one), (_, other)) in one.iter().zip(&other) {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).chars().take(4000).collect::<String>();
        assert!(one == other, "{what}: {name} differs:\n{}\n{}", text(one), text(other));
    }
}

/// Ends the run after the given step, as Ctrl-C does.
struct StopAfter(u64);

impl Watch for StopAfter {
    fn step(&mut self, simulation: &Simulation) -> bool {
        simulation.steps() < self.0
    }
}

fn block(law: Law) -> Body {
    let shape = BoxMesh {
        size: [0.4, 0.2, 0.2],
        cells: [2, 1, 1],
        element: CellKind::Tet4,
        origin: [0.1, 0.0, -0.1],
    };
    Body::from_box("block", shape, law)
}

/// Describes a swinging block with a moving clamp, a probe with a pitch, frames, an energy ledger and checkpoints.
fn driven(scheme: SchemeName) -> Scene {
    let sine = r#"{ "kind": "sine", "amplitude": [0.0, 0.02, 0.01], "frequency": 8.0 }"#;
    let rubber = Law::NeoHookean(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 });
    Scene::new(Time::new(0.06, 1e-3, scheme))
        .gravity([0.0, -9.81, 0.0])
        .body(block(rubber))
        .fix(Fix::region("block", "x-min").motion(serde_json::from_str(sine).unwrap()))
        .probe(Probe { pitch: Some(Axis::Y), ..Probe::at("tip", "block", [0.5, 0.1, 0.0]) })
        .output(Output { interval: Some(7e-3), history: 3, ledger: Some(true), ..Output::default() })
        .checkpoint(Checkpoints::every(0.01))
}

/// Runs a scene to its end, then again with several stops and continuations, and compares the files. Before one stop
/// the newest checkpoint is removed, so that history and frames reach beyond the checkpoint that is resumed.
fn continues(scene: Scene, what: &str) {
    let whole = tempfile::tempdir().unwrap();
    run(scene.clone(), "test", whole.path(), &mut ()).unwrap();
    let parts = tempfile::tempdir().unwrap();
    run(scene.clone(), "test", parts.path(), &mut StopAfter(5)).unwrap();
    for stop in [26, 27, 45, u64::MAX] {
        let mut found = newest(parts.path()).unwrap();
        if stop == 45 {
            std::fs::remove_file(&found.path).unwrap();
            found = newest(parts.path()).unwrap();
        }
        resume(scene.clone(), &found.checkpoint, parts.path(), &mut StopAfter(stop)).unwrap();
    }
    assert_same(whole.path(), parts.path(), what);
}

#[test]
fn every_scheme_continues_to_the_same_bits() {
    use SchemeName::*;
    for scheme in [
        SymplecticEulerA,
        StormerVerlet,
        BlanesMoan6,
        ImplicitMidpoint,
        Gauss,
        EnergyMomentum,
        ForwardEuler,
        BackwardEuler,
        Bdf2,
        Newmark,
        GeneralizedAlpha,
    ] {
        continues(driven(scheme), &format!("{scheme:?}"));
    }
}

/// A run whose scheme and step were chosen by trials continues with their account, warnings included: two boxes that collide, of whose
/// error no trial gives a measure.
#[test]
fn a_chosen_scheme_continues_with_its_account() {
    let rigid = |name: &str, place: &str, velocity: &str, turn: &str| {
        format!(
            "[[rigid]]\nname = \"{name}\"\nshape = {{ kind = \"box\", size = [0.2, 0.15, 0.1] }}\ndensity = 1000.0\n\
             position = {place}\nvelocity = {velocity}\nangular_velocity = {turn}\n"
        )
    };
    let time = "[time]\nend = 0.2\nstep = 1e-3\nscheme = \"auto\"\n[contact]\nfriction = 0.3\n[checkpoint]\ninterval = 0.05\nkeep = 20\n";
    let boxes = [
        rigid("a", "[0.0, 0.0, 0.0]", "[1.0, 0.0, 0.0]", "[3.0, 10.0, -5.0]"),
        rigid("b", "[0.35, 0.05, 0.03]", "[-1.0, 0.1, 0.0]", "[0.0, -4.0, 8.0]"),
    ];
    let scene = Scene::parse(&format!("{time}{}", boxes.concat()), &[]).scene.unwrap();
    let whole = tempfile::tempdir().unwrap();
    let report = run(scene.clone(), "test", whole.path(), &mut ()).unwrap();
    assert!(report.notes.iter().any(|note| note.contains("did not measure the error")), "{:?}", report.notes);
    // The same run, stopped after its second checkpoint.
    let part = tempfile::tempdir().unwrap();
    let files = || std::fs::read_dir(whole.path()).unwrap().map(|entry| entry.unwrap().path());
    let mut checkpoints: Vec<_> =
        files().filter(|path| path.extension().is_some_and(|ending| ending == "vck")).collect();
    checkpoints.sort();
    assert!(checkpoints.len() > 2, "{checkpoints:?}");
    let is_later =
        |path: &std::path::PathBuf| checkpoints[2..].contains(path) || path.ends_with("report.json");
    for path in files().filter(|path| !is_later(path)) {
        std::fs::copy(&path, part.path().join(path.file_name().unwrap())).unwrap();
    }
    resume(scene, &newest(part.path()).unwrap().checkpoint, part.path(), &mut ()).unwrap();
    assert_same(whole.path(), part.path(), "auto");
}

/// A run that ends between the state that its guard would go back to and the growth that it finds goes back to that same state
/// when it continues, however often it is stopped on the way.
#[test]
fn the_guard_goes_back_as_far_after_a_stop() {
    for action in [GuardAction::Halve, GuardAction::Switch] {
        let law = Law::Linear(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 });
        let scene = Scene::new(Time::new(0.1, 4e-3, SchemeName::StormerVerlet))
            .body(block(law).velocity([0.1, 0.0, 0.0]))
            .fix(Fix::region("block", "x-min"))
            .output(Output { history: 1, ..Output::default() })
            .checkpoint(Checkpoints::every(10.0))
            .guard(Guard { action, bound: 0.5 });
        let whole = tempfile::tempdir().unwrap();
        run(scene.clone(), "test", whole.path(), &mut ()).unwrap();
        let report = std::fs::read_to_string(whole.path().join("report.json")).unwrap();
        let report: Value = serde_json::from_str(&report).unwrap();
        let found = report["guard"]["events"][0]["step"].as_u64().unwrap();
        assert!(found > 2, "{found}");
        let parts = tempfile::tempdir().unwrap();
        run(scene.clone(), "test", parts.path(), &mut StopAfter(1)).unwrap();
        for stop in [2, u64::MAX] {
            let found = newest(parts.path()).unwrap();
            resume(scene.clone(), &found.checkpoint, parts.path(), &mut StopAfter(stop)).unwrap();
        }
        assert_same(whole.path(), parts.path(), &format!("{action:?}"));
    }
}

#[test]
fn consistent_mass_continues_to_the_same_bits() {
    use SchemeName::*;
    for scheme in [ImplicitMidpoint, Gauss, Bdf2, GeneralizedAlpha] {
        let mut scene = driven(scheme);
        scene.fixes[0].motion = None;
        scene.solver.mass = Some(MassKind::Consistent);
        continues(scene, &format!("{scheme:?}, consistent mass"));
    }
}

#[test]
fn damping_wind_companions_and_statics_continue_to_the_same_bits() {
    let damping = Damping { shear_viscosity: 10.0, mass_rate: 0.5, ..Damping::default() };
    continues(driven(SchemeName::StormerVerlet).damping(damping.clone()), "explicit, damped");
    continues(driven(SchemeName::ImplicitMidpoint).damping(damping), "implicit, damped");
    let mut estimated = driven(SchemeName::ImplicitMidpoint);
    estimated.time.estimate = true;
    continues(estimated, "with an error estimate");
    for scheme in [SchemeName::StormerVerlet, SchemeName::ImplicitMidpoint, SchemeName::EnergyMomentum] {
        let mut adaptive = driven(scheme);
        adaptive.time =
            Time { largest_step: Some(1.5e-3), ..Time::adaptive(adaptive.time.end, 1e-4, scheme) };
        continues(adaptive, &format!("{scheme:?} with adaptive steps"));
    }
    let cloth: Substance = serde_json::from_str::<SheetLaw>(
        r#"{ "law": "st-venant-kirchhoff", "young": 1e5, "poisson": 0.3, "density": 500.0, "thickness": 1e-3 }"#,
    )
    .unwrap()
    .into();
    let sheet: SheetMesh = serde_json::from_str(r#"{ "size": [1.0, 0.5], "cells": [4, 2] }"#).unwrap();
    let wind: Wind = serde_json::from_str(r#"{ "velocity": [5.0, 0.0, 1.0] }"#).unwrap();
    for scheme in [SchemeName::StormerVerlet, SchemeName::ImplicitMidpoint] {
        let scene = Scene::new(Time::new(0.03, 5e-4, scheme))
            .gravity([0.0, 0.0, -9.81])
            .body(Body::from_sheet("flag", sheet.clone(), cloth.clone()))
            .fix(Fix::region("flag", "x-min"))
            .wind(wind.clone())
            .output(Output { interval: Some(5e-3), ..Output::default() })
            .checkpoint(Checkpoints::every(3e-3));
        continues(scene, &format!("{scheme:?} in the wind"));
    }
}

#[test]
fn films_and_point_caches_continue_to_the_same_bytes() {
    for cache in [Cache::Pc2, Cache::Mdd, Cache::Obj, Cache::Ply] {
        for scheme in [SchemeName::StormerVerlet, SchemeName::Gauss] {
            let mut scene = driven(scheme);
            scene.output =
                Output { interval: None, fps: Some(170.0), cache: Some(cache), history: 3, ..scene.output };
            continues(scene, &format!("{scheme:?} with {cache:?}"));
        }
    }
}

/// Two rods and a block that hang from each other by a ball joint, a hinge and an attachment.
const RIGID: &str = r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 0.06
step = 1e-3
scheme = "SCHEME"
[[rigid]]
name = "upper"
mass = 2.0
shape = { kind = "rod", length = 0.5, radius = 0.02 }
position = [0.25, 0.0, 0.0]
[[rigid]]
name = "lower"
mass = 1.0
shape = { kind = "rod", length = 0.5, radius = 0.02 }
position = [0.75, 0.0, 0.0]
angular_velocity = [0.0, 0.0, 3.0]
velocity = [0.0, 0.75, 0.0]
[[joint]]
kind = "ball"
body = "upper"
point = [0.0, 0.0, 0.0]
[[joint]]
kind = "hinge"
body = "upper"
to = "lower"
point = [0.5, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
[[body]]
name = "bob"
box = { size = [0.1, 0.1, 0.1], cells = [1, 1, 1], element = "hex8", origin = [1.0, -0.05, -0.05] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 500.0 }
velocity = [0.0, 1.65, 0.0]
angular_velocity = [0.0, 0.0, 3.0]
[[attach]]
body = "bob"
region = "x-min"
to = "lower"
[output]
interval = 7e-3
history = 3
ledger = true
[checkpoint]
interval = 0.01
"#;

#[test]
fn rigid_bodies_joints_and_attachments_continue_to_the_same_bits() {
    for scheme in ["implicit-midpoint", "energy-momentum"] {
        let parsed = Scene::parse(&RIGID.replace("SCHEME", scheme), &[]);
        assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
        continues(parsed.scene.unwrap(), &format!("rigid bodies, {scheme}"));
    }
}

/// This run takes long enough to be killed.
const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.6
step = 1e-4
scheme = "SCHEME"
[[body]]
name = "block"
box = { size = [0.4, 0.2, 0.2], cells = [3, 1, 1], element = "tet4", origin = [0, 0, 0] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "block"
region = "x-min"
[output]
history = 20
interval = 0.05
[checkpoint]
interval = 0.03
"#;

/// The factor of a linear body serves all load steps. A run that continues makes it again, and counts the same work.
#[test]
fn equilibria_of_a_linear_body_continue_to_the_same_bits() {
    let scene = SCENE.replace("scheme = \"SCHEME\"", "[static]").replace("neo-hookean", "linear");
    let scene = scene.replace("end = 0.6\nstep = 1e-4", "end = 0.06\nstep = 1e-3");
    let load = "[[load]]\nkind = \"traction\"\nbody = \"block\"\nregion = \"x-max\"\ntraction = [0.0, 0.0, 1e3]\namplitude = \"t\"\n";
    let parsed = Scene::parse(&(scene.replace("interval = 0.03", "interval = 0.01") + load), &[]);
    assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
    continues(parsed.scene.unwrap(), "equilibria of a linear body");
}

struct Kept {
    directory: tempfile::TempDir,
}

impl Kept {
    fn new(scene: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("scene.toml"), scene).unwrap();
        Self { directory }
    }

    fn path(&self) -> &Path {
        self.directory.path()
    }

    fn out(&self) -> std::path::PathBuf {
        self.path().join("out")
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = command();
        command.current_dir(self.path()).args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
        command
    }

    fn says(&self, arguments: &[&str]) -> (Option<i32>, String) {
        let output = command().current_dir(self.path()).args(arguments).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8_lossy(&text).into_owned())
    }
}

const RUN: [&str; 4] = ["run", "scene.toml", "--out", "out"];

/// SplitMix64 (Steele, Lea, Flood 2014), which draws the moments to kill at.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (z ^ (z >> 31)) as f64 / u64::MAX as f64
}

/// A run that is killed (SIGKILL) at 50 random moments after its first checkpoint continues each time to the same bits.
#[test]
fn killed_at_any_moment() {
    let mut seed = 7;
    let mut unfinished = 0;
    for (scheme, kills) in [("stormer-verlet", 40), ("implicit-midpoint", 10)] {
        let scene = SCENE.replace("SCHEME", scheme);
        let scene = if kills == 10 { scene.replace("1e-4", "2e-3") } else { scene };
        let whole = Kept::new(&scene);
        let begin = Instant::now();
        assert!(whole.command(&RUN).status().unwrap().success());
        let duration = begin.elapsed();
        for kill in 0..kills {
            let run = Kept::new(&scene);
            let mut child = run.command(&RUN).spawn().unwrap();
            let deadline = Instant::now() + Duration::from_secs(60);
            while newest(&run.out()).is_err() {
                assert!(Instant::now() < deadline, "no checkpoint");
                std::thread::yield_now();
            }
            std::thread::sleep(duration.mul_f64(random(&mut seed)));
            child.kill().unwrap();
            child.wait().unwrap();
            unfinished += u32::from(!run.out().join("report.json").exists());
            assert!(run.command(&["resume", "out"]).status().unwrap().success(), "{scheme}, kill {kill}");
            // The recorded scene names no directory, so that all reports are equal.
            assert_same(&whole.out(), &run.out(), &format!("{scheme}, kill {kill}"));
        }
    }
    assert!(unfinished > 10, "only {unfinished} of 50 kills met a run under way");
}

/// A run that is killed between its report and the end of its claim has ended, but leaves the lock file. The next command
/// that meets the directory removes it.
#[test]
fn killed_after_its_report() {
    let run = Kept::new(&SCENE.replace("SCHEME", "stormer-verlet"));
    assert!(run.command(&RUN).status().unwrap().success());
    let before = written(&run.out());
    std::fs::write(run.out().join("variational.lock"), "process 1\n").unwrap();
    assert!(run.command(&["resume", "out"]).status().unwrap().success());
    assert!(before == written(&run.out()));
}

/// If files cannot grow, as on a full disk, the run ends with exit code 5 and names the last good state, which it
/// keeps. It continues when there is space.
#[cfg(unix)]
#[test]
fn out_of_room() {
    let scene = SCENE.replace("SCHEME", "stormer-verlet").replace("history = 20", "history = 1");
    let whole = Kept::new(&scene);
    assert!(whole.command(&RUN).status().unwrap().success());
    let run = Kept::new(&scene);
    // The limit is in blocks of 512 bytes; the shell ignores the signal that would come with it.
    let script = r#"trap '' XFSZ; ulimit -f 400; exec "$0" "$@""#;
    let program = env!("CARGO_BIN_EXE_variational");
    let output =
        Command::new("sh").args(["-c", script, program]).args(RUN).current_dir(run.path()).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(5), "{errors}");
    assert!(errors.contains("history.csv") && errors.contains("last good state"), "{errors}");
    assert!(newest(&run.out()).unwrap().checkpoint.steps() > 0);
    assert!(run.command(&["resume", "out"]).status().unwrap().success());
    assert_same(&whole.out(), &run.out(), "after a full disk");
}

#[test]
fn damaged_missing_changed_finished() {
    let scene = SCENE.replace("SCHEME", "stormer-verlet").replace("end = 0.6", "end = 0.1");
    let whole = Kept::new(&scene);
    assert_eq!(whole.says(&["resume", "."]).0, Some(2));
    assert!(whole.says(&["resume", "."]).1.contains("no checkpoint"));
    assert!(whole.command(&RUN).status().unwrap().success());
    let (code, says) = whole.says(&["resume", "out"]);
    assert!(code == Some(0) && says.contains("finished"), "{says}");

    // Imitates a power failure shortly before the end.
    let unfinish = || std::fs::remove_file(whole.out().join("report.json")).unwrap();
    let reference = Kept::new(&scene);
    assert!(reference.command(&RUN).status().unwrap().success());
    let newest_path = || newest(&whole.out()).unwrap().path;

    unfinish();
    let newest_file = newest_path();
    let bytes = std::fs::read(&newest_file).unwrap();
    std::fs::write(&newest_file, &bytes[..bytes.len() / 2]).unwrap();
    let (code, says) = whole.says(&["resume", "out"]);
    assert!(code == Some(0) && says.contains("damaged") && says.contains("falling back"), "{says}");
    assert_same(&reference.out(), &whole.out(), "after a truncated checkpoint");

    unfinish();
    let mut bytes = std::fs::read(newest_path()).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    std::fs::write(newest_path(), bytes).unwrap();
    let (code, says) = whole.says(&["resume", "out"]);
    assert!(code == Some(0) && says.contains("checksum"), "{says}");
    assert_same(&reference.out(), &whole.out(), "after a corrupted checkpoint");

    unfinish();
    let file = whole.path().join("scene.toml");
    std::fs::write(&file, scene.replace("young = 1e6", "young = 2e6")).unwrap();
    let (code, says) = whole.says(&["resume", "out"]);
    assert!(code == Some(2) && says.contains("has changed") && says.contains("young"), "{says}");
    std::fs::remove_file(&file).unwrap();
    let (code, says) = whole.says(&["resume", "out"]);
    assert!(code == Some(0) && says.contains("taken from the checkpoint"), "{says}");
    assert_same(&reference.out(), &whole.out(), "without the scene file");

    unfinish();
    for entry in std::fs::read_dir(whole.out()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "vck") {
            std::fs::write(path, b"VI-CHECK").unwrap();
        }
    }
    let (code, says) = whole.says(&["resume", "out"]);
    assert!(code == Some(5) && says.contains("every checkpoint is damaged"), "{says}");
}
