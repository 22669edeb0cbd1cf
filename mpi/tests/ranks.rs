//! Runs the program on 1 to 4 ranks, and compares its files and messages with those of one process.

mod launch;

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use launch::files::{assert_same_files, files, timeless};
#[cfg(target_os = "linux")]
use launch::memory::{peaks, ranks_of};
use launch::{PROGRAM, launcher, program, program_of_one_process, room, run, scene, text};

/// A rubber block on a clamped end that falls and swings, with every kind of file.
const BLOCK: &str = r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 0.02
step = 2.5e-4
scheme = "stormer-verlet"
[[body]]
name = "block"
box = { size = [1.0, 0.25, 0.25], cells = [24, 6, 6], element = "tet4" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
angular_velocity = [1.0, 0.0, 2.0]
[[fix]]
body = "block"
region = "x-min"
[[probe]]
name = "tip"
body = "block"
point = [1.0, 0.125, 0.125]
[output]
interval = 0.01
history = 7
fields = ["displacement", "velocity", "stress", "reaction_force"]
"#;

/// A rubber bracket of 11 632 tetrahedra from a file.
const BRACKET: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 2e-4
step = 1e-5
scheme = "stormer-verlet"
[[body]]
name = "bracket"
mesh = "MESH"
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
angular_velocity = [1.0, 0.0, 2.0]
[[fix]]
body = "bracket"
region = "bolts"
[[probe]]
name = "pin"
body = "bracket"
region = "pin"
mean = "displacement"
[output]
interval = 1e-4
history = 7
fields = ["displacement", "velocity", "stress", "reaction_force"]
"#;

/// Cloth of two layers of terms (membrane and bending) that hangs from two corners.
const CLOTH: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 5e-3
step = 1e-4
scheme = "blanes-moan-4"
[[body]]
name = "cloth"
sheet = { size = [1.0, 1.0], cells = [30, 30] }
material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, density = 200.0, thickness = 1e-3 }
[[fix]]
body = "cloth"
box = { min = [-1e-9, -1e-9, -1.0], max = [1e-9, 1.1, 1.0] }
[output]
interval = 2e-3
history = 20
fields = ["displacement", "velocity"]
"#;

/// Two bodies of several laws and elements, joined by a spring, and a third one apart.
const SEVERAL: &str = r#"
[time]
end = 5e-3
step = 1e-4
scheme = "symplectic-euler-b"
[[body]]
name = "left"
box = { size = [1.0, 0.2, 0.2], cells = [20, 4, 4], element = "hex8" }
material = { law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, density = 1000.0 }
velocity = [0.0, 1.0, 0.0]
[[body]]
name = "right"
box = { size = [0.5, 0.2, 0.2], cells = [8, 3, 3], element = "tet10", origin = [1.5, 0.0, 0.0] }
material = { law = "corotated", young = 5e5, poisson = 0.4, density = 1100.0 }
[[body]]
name = "apart"
box = { size = [0.5, 0.2, 0.2], cells = [10, 4, 4], element = "tet4", origin = [3.0, 0.0, 0.0] }
material = { law = "linear", young = 1e6, poisson = 0.3, density = 1000.0 }
angular_velocity = [0.0, 0.0, 3.0]
[[spring]]
from = { body = "left", point = [1.0, 0.1, 0.1] }
to = { body = "right", point = [1.5, 0.1, 0.1] }
stiffness = 1e3
[output]
history = 10
"#;

/// A moving support and a load that grows.
const DRIVEN: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.01
step = 2e-4
scheme = "stormer-verlet"
[[body]]
name = "beam"
box = { size = [1.0, 0.2, 0.2], cells = [20, 4, 4], element = "tet4" }
material = { law = "stable-neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "beam"
region = "x-min"
motion = { kind = "sine", amplitude = [0.0, 0.0, 0.01], frequency = 20.0 }
[output]
history = 9
ledger = false
interval = 5e-3
"#;

/// A block that is thrown at its clamp so hard that its elements invert.
const BREAKS: &str = r#"
[time]
end = 0.05
step = 5e-4
scheme = "stormer-verlet"
substeps = false
[[body]]
name = "block"
box = { size = [1.0, 0.2, 0.2], cells = [20, 4, 4], element = "tet4" }
material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
velocity = [-60.0, 0.0, 0.0]
[[fix]]
body = "block"
region = "x-min"
[output]
history = 1
"#;

/// A soft bob on a rigid rod that hangs from a ball joint.
const RIGID: &str = r#"
gravity = [0.0, -9.81, 0.0]
[time]
end = 0.02
step = 2e-3
scheme = "implicit-midpoint"
[[rigid]]
name = "rod"
shape = { kind = "rod", length = 1.0, radius = 0.01 }
density = 7800.0
position = [0.5, 0.0, 0.0]
[[joint]]
kind = "ball"
body = "rod"
point = [0.0, 0.0, 0.0]
[[body]]
name = "bob"
box = { size = [0.3, 0.3, 0.3], cells = [6, 6, 6], element = "hex8", origin = [1.0, -0.15, -0.15] }
material = { law = "neo-hookean", young = 2e5, poisson = 0.3, density = 400.0 }
[[attach]]
body = "bob"
box = { min = [0.99, -0.06, -0.06], max = [1.01, 0.06, 0.06] }
to = "rod"
[output]
interval = 0.01
"#;

/// A block that falls on another one.
const CONTACT: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.02
step = 5e-4
scheme = "stormer-verlet"
[contact]
[[body]]
name = "lower"
box = { size = [0.4, 0.4, 0.1], cells = [8, 8, 2], element = "tet4" }
material = { law = "stable-neo-hookean", young = 2e5, poisson = 0.3, density = 1000.0 }
[[body]]
name = "upper"
box = { size = [0.2, 0.2, 0.2], cells = [6, 6, 6], element = "tet4", origin = [0.1, 0.1, 0.105] }
material = { law = "stable-neo-hookean", young = 2e5, poisson = 0.3, density = 1000.0 }
velocity = [0.0, 0.0, -1.0]
[[fix]]
body = "lower"
region = "z-min"
[output]
history = 5
interval = 0.01
"#;

/// A beam that bends under its weight in two load steps.
const STATICS: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 1.0
step = 0.5
[static]
[[body]]
name = "beam"
box = { size = [1.0, 0.2, 0.2], cells = [20, 4, 4], element = "hex8" }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "beam"
region = "x-min"
[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.2, 0.2]
[output]
interval = 1.0
fields = ["displacement", "reaction_force"]
[solver]
linear = "pcg"
"#;

fn same_files(name: &str, text_of_scene: &str) {
    let room = room(name);
    let scene = scene(&room, text_of_scene);
    let expected = room.join("one");
    let output = run(0, &scene, &expected);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(expected.join("history.csv").exists());
    for ranks in 1..=4 {
        let out = room.join(ranks.to_string());
        let output = run(ranks, &scene, &out);
        assert!(output.status.success(), "{ranks} ranks: {}", text(&output.stderr));
        assert_same_files(&out, &expected, &format!("{name} on {ranks} ranks"));
    }
}

#[test]
fn a_block_has_the_files_of_one_process() {
    same_files("block", BLOCK);
}

/// A body from a mesh file, of which every rank builds only the part that it needs.
#[test]
fn a_mesh_file_has_the_files_of_one_process() {
    same_files(
        "file",
        &BRACKET.replace("MESH", concat!(env!("CARGO_MANIFEST_DIR"), "/../meshes/bracket.msh")),
    );
    let report =
        std::fs::read_to_string(Path::new(env!("CARGO_TARGET_TMPDIR")).join("file").join("4/report.json"))
            .unwrap();
    assert!(report.contains("\"in_parts\": true"), "{report}");
}

#[test]
fn cloth_has_the_files_of_one_process() {
    same_files("cloth", CLOTH);
}

#[test]
fn several_bodies_have_the_files_of_one_process() {
    same_files("several", SEVERAL);
}

#[test]
fn a_moving_support_has_the_files_of_one_process() {
    same_files("driven", DRIVEN);
}

#[test]
fn a_step_that_fails_on_one_rank_ends_all_with_one_message() {
    let room = room("breaks");
    let scene = scene(&room, BREAKS);
    let expected = run(0, &scene, &room.join("one"));
    assert_eq!(expected.status.code(), Some(4), "{}", text(&expected.stderr));
    let about = |output: &Output| -> Vec<String> {
        text(&output.stderr).lines().filter(|line| line.starts_with("error")).map(str::to_owned).collect()
    };
    assert!(about(&expected)[0].contains("element"), "{:?}", about(&expected));
    for ranks in [2, 4] {
        let out = room.join(ranks.to_string());
        let output = run(ranks, &scene, &out);
        assert_eq!(output.status.code(), Some(4), "{}", text(&output.stderr));
        assert_eq!(about(&output), about(&expected));
        assert_same_files(&out, &room.join("one"), &format!("{ranks} ranks"));
    }
}

/// A run that takes a while and saves checkpoints.
fn long() -> String {
    BLOCK.replace("end = 0.02", "end = 0.2").replace("interval = 0.01", "interval = 0.1")
        + "[checkpoint]\ninterval = 0.02\n"
}

/// Waits until a run has written a checkpoint after its start.
fn wait_for_checkpoint(directory: &Path, child: &mut Child) {
    let begin = Instant::now();
    loop {
        let entries = std::fs::read_dir(directory).into_iter().flatten().flatten();
        let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
        if names.filter(|name| name.ends_with(".vck") && !name.ends_with("_000000000000.vck")).count() > 0 {
            return;
        }
        assert!(begin.elapsed() < Duration::from_secs(120), "no checkpoint");
        assert!(child.try_wait().unwrap().is_none(), "the run has ended");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn resume(ranks: usize, directory: &Path) -> Output {
    let mut command = program(ranks);
    command.arg("resume").arg(directory).args(["--threads", "1", "--quiet"]).output().unwrap()
}

#[test]
#[cfg(target_os = "linux")]
fn a_killed_rank_ends_all_and_any_number_of_ranks_resumes() {
    let room = room("killed");
    let scene = scene(&room, &long());
    let expected = room.join("whole");
    assert!(run(0, &scene, &expected).status.success());
    // The number of ranks that are killed and that resume; 0 for one process without MPI.
    for (killed, resumed) in [(4, 2), (2, 0)] {
        let out = room.join(format!("{killed}-{resumed}"));
        let mut command = program(killed);
        command.arg("run").arg(&scene).arg("--out").arg(&out).args(["--threads", "1", "--quiet"]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        wait_for_checkpoint(&out, &mut child);
        let ranks = ranks_of(&scene);
        assert_eq!(ranks.len(), killed);
        assert!(
            Command::new("kill").args(["-9", &ranks[killed - 1].to_string()]).status().unwrap().success()
        );
        let begin = Instant::now();
        let status = child.wait().unwrap();
        assert!(!status.success());
        while !ranks_of(&scene).is_empty() {
            assert!(begin.elapsed() < Duration::from_secs(5), "ranks are left: {:?}", ranks_of(&scene));
            std::thread::sleep(Duration::from_millis(20));
        }
        let output = resume(resumed, &out);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let left = out.join("variational.lock");
        assert!(!left.exists());
        assert_same_files(&out, &expected, &format!("killed on {killed}, resumed on {resumed}"));
    }
}

#[test]
fn ranks_of_different_programs_are_refused() {
    let room = room("programs");
    let scene = scene(&room, BLOCK);
    let other = room.join("variational-mpi");
    let mut bytes = std::fs::read(PROGRAM).unwrap();
    bytes.push(0);
    std::fs::copy(PROGRAM, &other).unwrap();
    std::fs::write(&other, bytes).unwrap();
    let mut command = launcher();
    let arguments = |command: &mut Command| {
        command.arg("run").arg(&scene).arg("--out").arg(room.join("out")).arg("--quiet");
    };
    command.args(["-n", "1", PROGRAM]);
    arguments(&mut command);
    command.args([":", "-n", "1"]).arg(&other);
    arguments(&mut command);
    let output = command.output().unwrap();
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert_eq!(message.matches("error").count(), 1, "{message}");
    assert!(message.contains("rank 1: its program has the checksum"), "{message}");
    assert!(!room.join("out").exists());
}

/// Runs a scene until its first checkpoint; from then on no file can grow. Returns its output, and the time that it took to
/// end.
#[cfg(target_os = "linux")]
fn run_until_the_disk_is_full(ranks: usize, scene: &Path, out: &Path) -> (Output, Duration) {
    let (mut command, program) = match ranks {
        0 => (Command::new("sh"), program_of_one_process()),
        _ => (launcher(), PROGRAM.to_owned()),
    };
    if ranks > 0 {
        command.args(["-n", &ranks.to_string(), "sh"]);
    }
    // Without the signal, the operating system refuses to write, as it does if a disk is full. Launchers may reset it.
    command.args(["-c", "trap '' XFSZ; exec \"$@\"", "sh"]).arg(program);
    command.arg("run").arg(scene).arg("--out").arg(out);
    command.args(["--threads", "1", "--quiet"]).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    wait_for_checkpoint(out, &mut child);
    // As soon as the first rank is limited it may fail and end the others, which then have no limits to set.
    let limit = |rank: &u32| {
        let limit = ["--pid", &rank.to_string(), "--fsize=1024"];
        Command::new("prlimit").args(limit).stderr(Stdio::null()).status().unwrap().success()
    };
    assert!(ranks_of(scene).iter().filter(|rank| limit(rank)).count() > 0);
    let begin = Instant::now();
    (child.wait_with_output().unwrap(), begin.elapsed())
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_ends_all_with_one_message_and_the_run_can_be_resumed() {
    let room = room("full");
    let scene = scene(&room, &long());
    let expected = room.join("whole");
    assert!(run(0, &scene, &expected).status.success());
    let (one, _) = run_until_the_disk_is_full(0, &scene, &room.join("one"));
    let out = room.join("three");
    let (output, time) = run_until_the_disk_is_full(3, &scene, &out);
    let message = text(&output.stderr);
    assert!(time < Duration::from_secs(5), "{time:?}");
    assert!(!one.status.success());
    assert_eq!(output.status.code(), one.status.code(), "{message}");
    assert_eq!(message.lines().filter(|line| line.starts_with("error")).count(), 1, "{message}");
    assert_eq!(ranks_of(&scene), Vec::<u32>::new());
    let output = resume(2, &out);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_same_files(&out, &expected, "resumed after a full disk");
}

#[test]
#[cfg(target_os = "linux")]
fn ranks_with_different_meshes_are_refused() {
    let room = room("meshes");
    let mesh = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../meshes/ball.msh")).unwrap();
    let directories = ["here", "there"].map(|name| room.join(name));
    for (directory, end) in directories.iter().zip(["", "\n"]) {
        std::fs::create_dir_all(directory).unwrap();
        std::fs::write(directory.join("ball.msh"), [&mesh[..], end.as_bytes()].concat()).unwrap();
    }
    // Each rank finds its own file under this name.
    let own = "mesh = \"/proc/self/cwd/ball.msh\"";
    let a_box = "box = { size = [1.0, 0.25, 0.25], cells = [24, 6, 6], element = \"tet4\" }";
    let with_mesh =
        BLOCK.replace(a_box, own).replace("region = \"x-min\"", "box = { max = [0.0, 9.0, 9.0] }");
    assert!(with_mesh.contains(own));
    let scene = scene(&room, &with_mesh);
    let mut command = launcher();
    for (k, directory) in directories.iter().enumerate() {
        command.args(&[":"][..k]).args(["-n", "1", "-wdir"]).arg(directory).arg(PROGRAM);
        command.arg("run").arg(&scene).arg("--out").arg(room.join("out")).arg("--quiet");
    }
    let output = command.output().unwrap();
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert_eq!(message.matches("error").count(), 1, "{message}");
    assert!(message.contains("rank 1: /proc/self/cwd/ball.msh has the checksum"), "{message}");
    assert!(!room.join("out").exists());
}

/// Numbers of ranks, and the memory that the first and another may need for a mesh, as parts of that of one process. Measured:
/// .78 and .44 on two ranks, .60 and .26 on four; .76 and .45, .58 and .24 with 1 029 000 tetrahedra. Open MPI
/// 4.1 has larger buffers: .80 and .57 on two ranks, .62 and .34 on four.
#[cfg(target_os = "linux")]
const LIMITS: [(usize, f64, f64); 2] = [(2, 0.9, 0.65), (4, 0.7, 0.42)];

#[test]
#[cfg(target_os = "linux")]
fn memory_per_rank_falls_with_the_number_of_ranks() {
    let room = room("memory");
    let of_cells = |cells: &str, end: &str| {
        let text_of_scene = BLOCK.replace("cells = [24, 6, 6]", cells).replace("end = 0.02", end);
        text_of_scene.replace("interval = 0.01\n", "").replace("step = 2.5e-4", "step = 2e-5")
    };
    let (small, large) = (room.join("small.toml"), room.join("large.toml"));
    // It runs long enough to be seen at its peak.
    std::fs::write(&small, of_cells("cells = [2, 2, 2]", "end = 0.1")).unwrap();
    // 331 776 tetrahedra.
    std::fs::write(&large, of_cells("cells = [72, 32, 24]", "end = 2e-3")).unwrap();
    let mesh_needs = |ranks: usize| {
        let (base, peaks) = (peaks(ranks, &small, &room.join("s")), peaks(ranks, &large, &room.join("l")));
        (peaks[0] - base[0], peaks[ranks - 1] - base[ranks - 1])
    };
    let (one, _) = mesh_needs(1);
    for (ranks, largest, smallest) in LIMITS {
        let (first, other) = mesh_needs(ranks);
        assert!(first <= largest * one, "{ranks} ranks: {first:.0} MiB on the first, {one:.0} MiB on one");
        assert!(other <= smallest * one, "{ranks} ranks: {other:.0} MiB on another, {one:.0} MiB on one");
    }
}

#[test]
fn equilibria_have_the_files_of_one_process() {
    same_files("static-pcg", STATICS);
    // The first rank factors alone.
    same_files("static-cholesky", &STATICS.replace("\"pcg\"", "\"cholesky\""));
}

/// A frame of more points than a file may hold is in pieces, the same on any number of ranks.
#[test]
fn pieces_of_frames_have_the_files_of_one_process() {
    same_files("pieces", &BLOCK.replace("[output]", "[output]\npiece_points = 300"));
    let names = files(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("pieces").join("4"));
    assert!(names.contains_key("scene_000001.pvtu") && names.contains_key("scene_000001_p003.vtu"));
    assert!(!names.contains_key("scene_000001.vtu"));
}

/// The bytes that a rank sends per force are at most 1.6 times those of one sum per shared node.
#[test]
fn the_report_states_the_bytes_between_ranks() {
    let room = room("traffic");
    let scene =
        scene(&room, &BLOCK.replace("cells = [24, 6, 6]", "cells = [64, 16, 16]").replace("0.02", "5e-4"));
    for ranks in [2, 4] {
        let out = room.join(ranks.to_string());
        assert!(run(ranks, &scene, &out).status.success());
        let report = std::fs::read_to_string(out.join("report.json")).unwrap();
        let number = |key: &str| -> f64 {
            let rest = report.split(&format!("\"{key}\": ")).nth(1).expect(key);
            rest.split([',', '\n']).next().unwrap().trim().parse().unwrap()
        };
        assert_eq!(number("count"), ranks as f64);
        let ratio = number("bytes_per_force") / number("bytes_per_force_of_node_sums");
        assert!((1.0..=1.6).contains(&ratio), "{ratio}");
    }
}

/// A run that a signal ends is continued by another number of ranks, to the files of an uninterrupted run.
#[test]
#[cfg(target_os = "linux")]
fn a_signal_ends_all_ranks_and_any_number_of_ranks_resumes() {
    let room = room("signal");
    let scene = scene(&room, &long());
    let expected = room.join("whole");
    assert!(run(0, &scene, &expected).status.success());
    for (stopped, resumed) in [(4, 2), (3, 0)] {
        let out = room.join(format!("{stopped}-{resumed}"));
        let mut command = program(stopped);
        command.arg("run").arg(&scene).arg("--out").arg(&out).args(["--threads", "1", "--quiet"]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        wait_for_checkpoint(&out, &mut child);
        // By one command: a rank may end before a second one reaches it, because the first rank ends the others.
        let ranks = ranks_of(&scene).into_iter().map(|rank| rank.to_string());
        Command::new("kill").arg("-TERM").args(ranks).status().unwrap();
        assert!(!child.wait().unwrap().success());
        assert_eq!(ranks_of(&scene), Vec::<u32>::new());
        assert!(timeless(&text(&std::fs::read(out.join("report.json")).unwrap())).contains("interrupted"));
        let output = resume(resumed, &out);
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert_same_files(&out, &expected, &format!("stopped on {stopped}, resumed on {resumed}"));
    }
}

/// Scenes in which the first rank makes the steps, and all ranks sum energies and forces.
#[test]
fn schemes_and_forces_of_the_first_rank_have_the_files_of_one_process() {
    let implicit = BLOCK.replace("stormer-verlet", "implicit-midpoint").replace("step = 1e-4", "step = 1e-3");
    let pcg = implicit.clone() + "[solver]\nlinear = \"pcg\"\n";
    let wind = CLOTH.replace("blanes-moan-4", "stormer-verlet") + "[wind]\nvelocity = [1.0, 0.0, 0.0]\n";
    let adaptive = BLOCK.replace("step = 2.5e-4", "step = \"adaptive\"");
    let ledger = DRIVEN.replace("ledger = false", "ledger = true");
    for (name, text_of_scene) in [
        ("euler", &implicit.replace("implicit-midpoint", "backward-euler")),
        ("cholesky", &implicit),
        ("pcg", &pcg),
        ("implicit-cloth", &CLOTH.replace("blanes-moan-4", "implicit-midpoint")),
        ("adaptive", &adaptive),
        ("wind", &wind),
        ("ledger", &ledger),
        ("rigid", &RIGID.to_owned()),
        ("contact", &CONTACT.to_owned()),
    ] {
        same_files(name, text_of_scene);
    }
}

/// Why `linear = "petsc"` is refused for this scene.
const PETSC: &str = match cfg!(feature = "petsc") {
    true => "\"petsc\" does not run with wind or damping; use \"pcg\"",
    false => "\"petsc\" needs the program variational-mpi, built with its feature `petsc`; use \"pcg\"",
};

#[test]
fn what_does_not_run_on_ranks_is_refused_before_the_run() {
    let room = room("refused");
    let estimate = BLOCK.replace("step = 2.5e-4", "step = 2.5e-4\nestimate = true");
    let petsc = CLOTH.replace("blanes-moan-4", "implicit-midpoint")
        + "[solver]\nlinear = \"petsc\"\n[wind]\nvelocity = [1.0, 0.0, 0.0]\n";
    let switch = BLOCK.to_owned() + "[guard]\naction = \"switch\"\n";
    for (text_of_scene, reason) in [
        (estimate, "the run that estimates errors would use one rank only"),
        (petsc, PETSC),
        (switch, "use \"halve\" or \"stop\""),
    ] {
        let scene = scene(&room, &text_of_scene);
        let output = run(2, &scene, &room.join("out"));
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(reason), "{message}");
        assert!(!room.join("out").exists());
    }
}
