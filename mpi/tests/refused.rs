//! Gives ranks what they must refuse before a run: all end with one message, and nothing is written.

mod launch;

use std::path::Path;
use std::process::Output;

use launch::scenes::{BLOCK, BOX_OF_BLOCK, CLOTH, FIX_OF_BLOCK};
use launch::{PROGRAM, assert_one_error, launcher, room, run, scene, to_run};

/// Asserts that a run was refused for this reason.
fn assert_refused(output: &Output, out: &Path, reason: &str) {
    assert_one_error(output, Some(2), &[reason]);
    assert!(!out.exists());
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
    let (mut command, out) = (launcher(), room.join("out"));
    to_run(command.args(["-n", "1", PROGRAM]), &scene, &out);
    to_run(command.args([":", "-n", "1"]).arg(&other), &scene, &out);
    assert_refused(&command.output().unwrap(), &out, "rank 1: its program has the checksum");
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
    let own = "mesh = \"/proc/self/cwd/ball.msh\"\n";
    let with_mesh = BLOCK.replace(BOX_OF_BLOCK, own).replace(FIX_OF_BLOCK, "");
    let scene = scene(&room, &with_mesh);
    let (mut command, out) = (launcher(), room.join("out"));
    for (k, directory) in directories.iter().enumerate() {
        command.args(&[":"][..k]).args(["-n", "1", "-wdir"]).arg(directory).arg(PROGRAM);
        to_run(&mut command, &scene, &out);
    }
    assert_refused(&command.output().unwrap(), &out, "rank 1: /proc/self/cwd/ball.msh has the checksum");
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
        let out = room.join("out");
        assert_refused(&run(2, &scene, &out), &out, reason);
    }
}
