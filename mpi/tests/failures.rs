//! Ends ranks in the middle of a run by signals and a full disk: all end with one message, and the run can be resumed.
#![cfg(target_os = "linux")]

mod launch;

use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use launch::files::{assert_same_files, timeless};
use launch::memory::ranks_of;
use launch::scenes::BLOCK;
use launch::{
    PROGRAM, assert_one_error, assert_success, launcher, program, program_of_one_process, room, run_well,
    scene, start, text, to_run,
};

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

/// Resumes a run, which must come to its end with the files of an uninterrupted one.
fn resume(ranks: usize, directory: &Path, expected: &Path, what: &str) {
    let mut command = program(ranks);
    let output = command.arg("resume").arg(directory).args(["--threads", "1", "--quiet"]).output().unwrap();
    assert_success(&output, what);
    assert!(!directory.join("variational.lock").exists());
    assert_same_files(directory, expected, what);
}

#[test]
fn a_killed_rank_ends_all_and_any_number_of_ranks_resumes() {
    let room = room("killed");
    let scene = scene(&room, &long());
    let expected = room.join("whole");
    run_well(0, &scene, &expected);
    // The number of ranks that are killed and that resume; 0 for one process without MPI.
    for (killed, resumed) in [(4, 2), (2, 0)] {
        let out = room.join(format!("{killed}-{resumed}"));
        let mut child = start(killed, &scene, &out);
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
        resume(resumed, &out, &expected, &format!("killed on {killed}, resumed on {resumed}"));
    }
}

/// A run that a signal ends is continued by another number of ranks, to the files of an uninterrupted run.
#[test]
fn a_signal_ends_all_ranks_and_any_number_of_ranks_resumes() {
    let room = room("signal");
    let scene = scene(&room, &long());
    let expected = room.join("whole");
    run_well(0, &scene, &expected);
    for (stopped, resumed) in [(4, 2), (3, 0)] {
        let out = room.join(format!("{stopped}-{resumed}"));
        let mut child = start(stopped, &scene, &out);
        wait_for_checkpoint(&out, &mut child);
        // By one command: a rank may end before a second one reaches it, because the first rank ends the others.
        let ranks = ranks_of(&scene).into_iter().map(|rank| rank.to_string());
        Command::new("kill").arg("-TERM").args(ranks).status().unwrap();
        assert!(!child.wait().unwrap().success());
        assert_eq!(ranks_of(&scene), Vec::<u32>::new());
        assert!(timeless(&text(&std::fs::read(out.join("report.json")).unwrap())).contains("interrupted"));
        resume(resumed, &out, &expected, &format!("stopped on {stopped}, resumed on {resumed}"));
    }
}

/// Runs a scene until its first checkpoint; from then on no file can grow. Returns its output, and the time that it took to
/// end.
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
    let mut child =
        to_run(&mut command, scene, out).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
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
fn a_full_disk_ends_all_with_one_message_and_the_run_can_be_resumed() {
    let room = room("full");
    let scene = scene(&room, &long());
    let expected = room.join("whole");
    run_well(0, &scene, &expected);
    let (one, _) = run_until_the_disk_is_full(0, &scene, &room.join("one"));
    let out = room.join("three");
    let (output, time) = run_until_the_disk_is_full(3, &scene, &out);
    assert!(time < Duration::from_secs(5), "{time:?}");
    assert!(!one.status.success());
    assert_one_error(&output, one.status.code(), &[]);
    assert_eq!(ranks_of(&scene), Vec::<u32>::new());
    resume(2, &out, &expected, "resumed after a full disk");
}
