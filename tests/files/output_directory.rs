//! An output directory belongs to one process at a time. A run removes its own earlier files there, keeps the files of
//! other scenes, and never touches its input.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::program::{command, report_of};

const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.01
step = 1e-4
scheme = "stormer-verlet"
[[body]]
name = "block"
box = { size = [0.4, 0.2, 0.2], cells = [3, 1, 1], element = "tet4", origin = [0, 0, 0] }
material = { law = "neo-hookean", young = 1e6, poisson = 0.3, density = 1000.0 }
[output]
directory = "out"
interval = 0.005
precision = "f64"
"#;

/// A directory with scenes, in which the program is started.
struct Place(tempfile::TempDir);

impl Place {
    fn new(scenes: &[(&str, &str)]) -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        for (name, scene) in scenes {
            std::fs::write(place.path().join(name), scene).unwrap();
        }
        place
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn command(&self, words: &str) -> Command {
        let mut command = command();
        command.current_dir(self.path()).args(words.split(' '));
        command
    }

    fn say(&self, words: &str) -> (Option<i32>, String) {
        let Output { status, stderr, .. } = self.command(words).output().unwrap();
        (status.code(), String::from_utf8_lossy(&stderr).into_owned())
    }

    fn run(&self, words: &str) {
        let (code, said) = self.say(words);
        assert_eq!(code, Some(0), "{words}: {said}");
    }

    /// Returns every file of a directory with its bytes, by name.
    fn files(&self, directory: &str) -> Vec<(String, Vec<u8>)> {
        let mut files: Vec<_> = std::fs::read_dir(self.path().join(directory))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .map(|path| {
                (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&path).unwrap())
            })
            .collect();
        files.sort();
        files
    }

    fn names(&self, directory: &str) -> Vec<String> {
        self.files(directory).into_iter().map(|file| file.0).collect()
    }
}

/// While a run writes into a directory, every other command refuses to, and names the process that holds it. When that
/// process has ended, killed or not, the directory is free.
#[test]
fn one_process_at_a_time() {
    let long = SCENE.replace("end = 0.01", "end = 100.0").replace("interval = 0.005", "history = 1000")
        + "[checkpoint]\ninterval = 0.02\n";
    let place = Place::new(&[("long.toml", &long), ("short.toml", SCENE)]);
    let mut child =
        place.command("run long.toml").stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let deadline = Instant::now() + Duration::from_secs(60);
    while variational::run::checkpoint::newest(&place.path().join("out"))
        .map_or(0, |found| found.checkpoint.steps())
        == 0
    {
        assert!(Instant::now() < deadline, "no checkpoint");
        std::thread::sleep(Duration::from_millis(2));
    }
    let holder = format!("process {}", child.id());
    for words in [
        "run short.toml",
        "run long.toml",
        "resume out",
        "modes short.toml",
        "bench short.toml --budget 1 --schemes stormer-verlet --out out",
        "convergence short.toml --time --levels 2 --out out",
    ] {
        let (code, said) = place.say(words);
        assert_eq!(code, Some(2), "{words}: {said}");
        assert!(said.contains(&holder) && said.contains("--out"), "{words}: {said}");
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(
        place.path().join("out/variational.lock").exists(),
        "the file of a process that was killed stays"
    );
    let mut child = place.command("resume out").stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.try_wait().unwrap().is_none(), "the killed run is continued");
    child.kill().unwrap();
    child.wait().unwrap();
    place.run("run long.toml --set time.end=0.01");
    assert!(!place.names("out").contains(&"variational.lock".to_owned()));
}

/// A scene whose mesh is a file that the run would remove or replace is refused, by whatever path the scene names it,
/// and no file is touched.
#[test]
fn a_run_does_not_delete_what_it_reads() {
    let place = Place::new(&[("block.toml", SCENE)]);
    place.run("run block.toml");
    let frame = |path: &str| {
        let shape =
            r#"box = { size = [0.4, 0.2, 0.2], cells = [3, 1, 1], element = "tet4", origin = [0, 0, 0] }"#;
        SCENE.replace(shape, &format!("mesh = {path:?}"))
    };
    let mut paths = vec!["out/block_000001.vtu".to_owned(), "sub/../out/./block_000000.vtu".to_owned()];
    std::fs::create_dir(place.path().join("sub")).unwrap();
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("out/block_000002.vtu", place.path().join("link.vtu")).unwrap();
        std::fs::hard_link(place.path().join("out/block_000002.vtu"), place.path().join("hard.vtu")).unwrap();
        paths.extend(["link.vtu".to_owned(), "hard.vtu".to_owned()]);
    }
    let before = place.files("out");
    for path in &paths {
        std::fs::write(place.path().join("block.toml"), frame(path)).unwrap();
        let (code, said) = place.say("run block.toml");
        assert_eq!(code, Some(2), "{path}: {said}");
        assert!(said.contains("body[0].mesh") && said.contains("--out"), "{path}: {said}");
        assert!(place.files("out") == before, "{path}: something was touched");
    }
    // A run under another scene name, or into another directory, would not replace this file: both are accepted.
    std::fs::write(place.path().join("again.toml"), frame(&paths[0])).unwrap();
    place.run("run again.toml");
    place.run("run block.toml --out other");
    // A file of mode shapes counts as output too.
    place.run("modes again.toml --count 7");
    std::fs::write(place.path().join("again.toml"), frame("out/again_mode_000.vtu")).unwrap();
    let (code, said) = place.say("modes again.toml --count 7");
    assert!(code == Some(2) && said.contains("body[0].mesh"), "{said}");
}

/// Two scenes share a directory. Each keeps its frames and its series, and the history and report of the earlier run
/// are kept under its name. A second run of a scene replaces all files of its first run and nothing else.
#[test]
fn scenes_share_a_directory() {
    let other = SCENE.replace("end = 0.01", "end = 0.02").replace("-9.81", "-1.0");
    let place = Place::new(&[("a.toml", SCENE), ("b.toml", &other)]);
    let alone = |scene: &str| {
        place.run(&format!("run {scene}.toml --out alone-{scene}"));
        place.files(&format!("alone-{scene}"))
    };
    let (a, b) = (alone("a"), alone("b"));
    std::fs::create_dir(place.path().join("out")).unwrap();
    std::fs::write(place.path().join("out/notes.txt"), "mine").unwrap();
    let is_report = |name: &str| name.ends_with("report.json");
    // Returns the expected files after a run of `other` and then one of `last`, from those of each scene run alone.
    let both = |last: &[(String, Vec<u8>)], other: (&str, &[(String, Vec<u8>)])| {
        let renamed = |name: &str| match name {
            "history.csv" | "report.json" => format!("{}.{name}", other.0),
            name => name.to_owned(),
        };
        let mut all = last.to_vec();
        all.extend(other.1.iter().map(|(name, bytes)| (renamed(name), bytes.clone())));
        all.push(("notes.txt".to_owned(), b"mine".to_vec()));
        all.sort();
        all
    };
    let same = |what: &str, expected: Vec<(String, Vec<u8>)>| {
        let found = place.files("out");
        let names = |files: &[(String, Vec<u8>)]| files.iter().map(|file| file.0.clone()).collect::<Vec<_>>();
        assert_eq!(names(&found), names(&expected), "{what}");
        for ((name, found), (_, expected)) in found.iter().zip(&expected) {
            assert!(is_report(name) || found == expected, "{what}: {name} differs");
        }
    };
    place.run("run a.toml");
    place.run("run b.toml");
    same("a, then b", both(&b, ("a", &a)));
    assert_eq!(report_of(&place.path().join("out"))["name"], "b");
    place.run("run b.toml");
    same("b again", both(&b, ("a", &a)));
    place.run("run a.toml");
    same("a again", both(&a, ("b", &b)));
    // A shorter run removes the later frames of a longer one.
    place.run("run b.toml --set time.end=0.005");
    assert!(!place.names("out").contains(&"b_000002.vtu".to_owned()));
    assert!(place.names("out").contains(&"a_000002.vtu".to_owned()));
}

/// A run that can still be continued is not overwritten by a run of another scene.
#[test]
fn a_run_that_has_not_ended_is_kept() {
    let kept = SCENE.to_owned() + "[checkpoint]\ninterval = 0.002\n";
    let place = Place::new(&[("kept.toml", &kept), ("other.toml", SCENE)]);
    place.run("run kept.toml");
    // Imitates a power failure shortly before the end.
    std::fs::remove_file(place.path().join("out/report.json")).unwrap();
    let before = place.files("out");
    let (code, said) = place.say("run other.toml");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("'kept'") && said.contains("variational resume out"), "{said}");
    assert!(place.files("out") == before);
    place.run("resume out");
    place.run("run other.toml");
    assert!(place.names("out").contains(&"kept.report.json".to_owned()));
}

/// Equal runs have equal reports except for `provenance` and clock times.
#[test]
fn reports_do_not_depend_on_the_machine() {
    let place = Place::new(&[("a.toml", SCENE)]);
    let report = |threads: u32| {
        place.run(&format!("run a.toml --threads {threads} --out {threads}"));
        let mut report = report_of(&place.path().join(threads.to_string()));
        assert_eq!(report["provenance"]["threads"], threads);
        let report = report.as_object_mut().unwrap();
        report.retain(|key, _| key != "provenance" && !key.ends_with("_seconds"));
        report.clone()
    };
    assert_eq!(report(1), report(2));
}

/// Two scenes whose modes are written into one directory each keep their shapes and series. The tables are those of the
/// later command; those of the earlier one are kept under its scene's name.
#[test]
fn modes_of_scenes_share_a_directory() {
    let other = SCENE.replace("young = 1e6", "young = 4e6");
    let place = Place::new(&[("a.toml", SCENE), ("b.toml", &other)]);
    place.run("modes b.toml --count 9");
    let tables = |prefix: &str| {
        let read =
            |ending: &str| std::fs::read(place.path().join(format!("out/{prefix}modes.{ending}"))).unwrap();
        ["csv", "json", "svg"].map(read)
    };
    let of_b = tables("");
    place.run("run b.toml");
    place.run("modes a.toml --count 8");
    assert_eq!(tables("b."), of_b);
    let names = place.names("out");
    let count = |start: &str, end: &str| {
        names.iter().filter(|name| name.starts_with(start) && name.ends_with(end)).count()
    };
    assert_eq!([count("a_mode_", ".vtu"), count("b_mode_", ".vtu")], [8, 9], "{names:?}");
    assert!(count("a_modes.pvd", "") == 1 && count("b_modes.pvd", "") == 1 && count("b.pvd", "") == 1);
    // A run of the scene does not remove its modes.
    place.run("run a.toml");
    assert_eq!(place.names("out").iter().filter(|name| name.contains("_mode_")).count(), 17);
}
