//! A run is continued from any place, whatever has happened to files that it does not need. If a checkpoint cannot be
//! used, the message names it, and it is not deleted.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Output;

use crate::program::{command, report_of};

const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.02
step = 1e-4
scheme = "stormer-verlet"
[[body]]
name = "beam"
mesh = "beam.msh"
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[output]
interval = 0.002
[checkpoint]
interval = 0.005
keep = 3
"#;

/// A finished run of the scene without its report, as if it had been killed before its end.
struct Unfinished {
    place: tempfile::TempDir,
    directory: PathBuf,
    whole: Vec<(PathBuf, Vec<u8>)>,
}

impl Unfinished {
    fn new(name: &OsStr) -> Self {
        let place = tempfile::tempdir().unwrap();
        let directory = place.path().join(name);
        std::fs::create_dir(&directory).unwrap();
        std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/beam.msh"), directory.join("beam.msh"))
            .unwrap();
        std::fs::write(directory.join("scene.toml"), SCENE).unwrap();
        let ran = command()
            .args(["run", "--out"])
            .arg(directory.join("out"))
            .arg(directory.join("scene.toml"))
            .output();
        assert!(ran.as_ref().unwrap().status.success(), "{ran:?}");
        let whole = files(&directory.join("out"));
        let unfinished = Self { place, directory, whole };
        unfinished.interrupt();
        unfinished
    }

    fn out(&self) -> PathBuf {
        self.directory.join("out")
    }

    /// Turns the run into one that was killed after its last checkpoint.
    fn interrupt(&self) {
        std::fs::remove_file(self.out().join("report.json")).unwrap();
        for (path, _) in files(&self.out()).iter().filter(|(path, _)| path.ends_with("scene_000010.vtu")) {
            std::fs::remove_file(path).unwrap();
        }
    }

    fn newest_checkpoint(&self) -> PathBuf {
        variational::run::checkpoint::newest(&self.out()).unwrap().path
    }

    fn resume(&self, arguments: &[&str]) -> Output {
        command()
            .arg("resume")
            .arg(self.out())
            .args(arguments)
            .current_dir(self.place.path())
            .output()
            .unwrap()
    }

    fn resumes(&self, what: &str) -> String {
        let output = self.resume(&[]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{what}: {said}");
        said
    }
}

/// Returns the files of a directory except reports, which hold clock times, and checkpoints.
fn files(directory: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let paths = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let is_meant = |path: &PathBuf| {
        path.is_file() && path.extension().is_some_and(|ending| ending != "vck" && ending != "json")
    };
    let mut files: Vec<_> =
        paths.filter(is_meant).map(|path| (path.clone(), std::fs::read(&path).unwrap())).collect();
    files.sort();
    files
}

#[test]
fn after_an_early_frame_was_moved_away() {
    let run = Unfinished::new("run".as_ref());
    std::fs::rename(run.out().join("scene_000001.vtu"), run.place.path().join("moved.vtu")).unwrap();
    run.resumes("a frame was moved");
    std::fs::rename(run.place.path().join("moved.vtu"), run.out().join("scene_000001.vtu")).unwrap();
    assert!(files(&run.out()) == run.whole);
}

#[test]
fn past_directories_with_names_of_checkpoints() {
    let run = Unfinished::new("run".as_ref());
    let newest = run.newest_checkpoint();
    std::fs::remove_file(&newest).unwrap();
    std::fs::create_dir_all(newest.join("inside")).unwrap();
    std::fs::create_dir(run.out().join("checkpoint_999999999999.vck")).unwrap();
    let said = run.resumes("directories");
    assert!(said.contains("checkpoint_999999999999.vck") && said.contains("falling back"), "{said}");
    assert!(files(&run.out()) == run.whole);
    // The continued run needed the name for a checkpoint, so it moved the directory that had it.
    assert!(newest.is_file() && newest.with_extension("vck.moved").join("inside").is_dir());
    assert!(run.out().join("checkpoint_999999999999.vck").is_dir());
}

/// A checkpoint of a newer format is named in the message, and no file is deleted. The format number follows the magic
/// bytes, and the checksum is that of all formats.
#[test]
fn a_newer_format_is_named_and_nothing_is_deleted() {
    let run = Unfinished::new("run".as_ref());
    let newest = run.newest_checkpoint();
    let mut bytes = std::fs::read(&newest).unwrap();
    bytes[8..16].copy_from_slice(&1000_u64.to_le_bytes());
    let end = bytes.len() - 4;
    let sum = crc32fast::hash(&bytes[..end]);
    bytes[end..].copy_from_slice(&sum.to_le_bytes());
    std::fs::write(&newest, &bytes).unwrap();
    let everything = || {
        let paths = std::fs::read_dir(run.out()).unwrap().map(|entry| entry.unwrap().path());
        let mut all: Vec<_> = paths.map(|path| (path.clone(), std::fs::read(&path).unwrap())).collect();
        all.sort();
        all
    };
    let before = everything();
    let output = run.resume(&[]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("newer version") && said.contains("1000"), "{said}");
    assert!(everything() == before, "something was touched");
}

/// `--json` prints one JSON document and nothing else, and `--quiet` prints nothing, whether the run can be resumed or
/// is complete.
#[test]
fn json_and_quiet_hold() {
    let run = Unfinished::new("run".as_ref());
    for _ in 0..2 {
        let output = run.resume(&["--json"]);
        assert!(output.status.success());
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report, report_of(&run.out()));
        assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    run.interrupt();
    for _ in 0..2 {
        let output = run.resume(&["--quiet"]);
        assert!(output.status.success());
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        assert!(said.is_empty(), "{said}");
    }
}

/// On Unix the directory of the scene file and the names of its meshes need not be UTF-8.
#[cfg(unix)]
#[test]
fn from_a_path_that_is_not_utf_8() {
    use std::os::unix::ffi::OsStrExt;
    let run = Unfinished::new(OsStr::from_bytes(b"caf\xe9"));
    run.resumes("the scene is found again");
    assert!(files(&run.out()) == run.whole);
    run.interrupt();
    std::fs::remove_file(run.directory.join("scene.toml")).unwrap();
    let said = run.resumes("the scene is taken from the checkpoint");
    assert!(said.contains("taken from the checkpoint"), "{said}");
    assert!(files(&run.out()) == run.whole);
}

/// A run is resumed from any directory, even if its scene was given as `../scene.toml`, with meshes in the folder above
/// it and lists of nodes beside it. If a list has changed, the message names it.
#[test]
fn from_another_directory_with_a_list_of_nodes() {
    let place = tempfile::tempdir().unwrap();
    let scene =
        SCENE.replace("beam.msh", "../beam.msh") + "[[fix]]\nbody = \"beam\"\nnode_file = \"clamp.txt\"\n";
    let scenes = place.path().join("scenes");
    std::fs::create_dir_all(scenes.join("inside")).unwrap();
    std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/beam.msh"), place.path().join("beam.msh"))
        .unwrap();
    std::fs::write(scenes.join("scene.toml"), scene).unwrap();
    std::fs::write(scenes.join("clamp.txt"), "0 1 2 3").unwrap();
    for (from, path) in [(scenes.join("inside"), "../scene.toml"), (place.path().into(), "scenes/scene.toml")]
    {
        let out = from.join("out");
        let ran = command().current_dir(&from).args(["run", path, "--out", "out"]).output().unwrap();
        assert!(ran.status.success(), "{path}: {}", String::from_utf8_lossy(&ran.stderr));
        let whole = files(&out);
        std::fs::remove_file(out.join("report.json")).unwrap();
        let resume = || {
            let output =
                command().arg("resume").arg(&out).current_dir(std::env::temp_dir()).output().unwrap();
            (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
        };
        let (code, said) = resume();
        assert_eq!(code, Some(0), "{path}: {said}");
        assert!(files(&out) == whole, "{path}");
        std::fs::remove_file(out.join("report.json")).unwrap();
        std::fs::write(scenes.join("clamp.txt"), "0 1 2").unwrap();
        let (code, said) = resume();
        assert!(code == Some(2) && said.contains("clamp.txt has changed"), "{path}: {said}");
        std::fs::write(scenes.join("clamp.txt"), "0 1 2 3").unwrap();
    }
}

/// A checkpoint cannot restore the frames of a point cache. If the cache is missing or is another file, the run is not
/// continued, and the message says what to do.
#[test]
fn without_its_point_cache() {
    let place = tempfile::tempdir().unwrap();
    std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/beam.msh"), place.path().join("beam.msh"))
        .unwrap();
    let film = SCENE.replace("interval = 0.002\n", "fps = 500\ncache = \"pc2\"\n");
    std::fs::write(place.path().join("scene.toml"), film).unwrap();
    let say = |words: [&str; 2]| {
        let output = command().current_dir(place.path()).args(words).args(["--quiet"]).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    assert_eq!(say(["run", "scene.toml"]).0, Some(0));
    let out = place.path().join("out/scene");
    std::fs::remove_file(out.join("report.json")).unwrap();
    for name in ["scene.beam.pc2", "scene.beam.obj"] {
        let bytes = std::fs::read(out.join(name)).unwrap();
        let before = files(&out).len();
        std::fs::remove_file(out.join(name)).unwrap();
        let (code, said) = say(["resume", "out/scene"]);
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(name) && said.contains("it is gone") && said.contains("run it anew"), "{said}");
        std::fs::write(out.join(name), bytes).unwrap();
        assert_eq!(files(&out).len(), before);
    }
    let bytes = std::fs::read(out.join("scene.beam.pc2")).unwrap();
    std::fs::write(out.join("scene.beam.pc2"), [&b"mine"[..], &bytes[4..]].concat()).unwrap();
    let (code, said) = say(["resume", "out/scene"]);
    assert!(code == Some(2) && said.contains("not a point cache of 290 points"), "{said}");
    std::fs::write(out.join("scene.beam.pc2"), bytes).unwrap();
    let (code, said) = say(["resume", "out/scene"]);
    assert_eq!(code, Some(0), "{said}");
}
