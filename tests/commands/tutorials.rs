//! Tests what the tutorials promise: their scenes and files exist, reactions balance loads, modes and effective masses
//! are written, and point caches match the object file beside them.

use std::path::{Path, PathBuf};

use crate::program::{History, command, report_of};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn say(directory: &Path, words: &[&str]) {
    let output = command().current_dir(directory).args(words).output().unwrap();
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn scene(name: &str) -> String {
    format!("{ROOT}/scenes/{name}.toml")
}

/// Every scene, mesh and script that a command in a tutorial names exists, and every scene is valid.
#[test]
fn the_files_of_the_tutorials_are_there() {
    let mut scenes: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(format!("{ROOT}/docs/tutorials")).unwrap() {
        let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        let commands =
            text.lines().filter(|line| line.starts_with("variational ") || line.starts_with("python "));
        for word in commands.flat_map(|line| line.split('#').next().unwrap_or_default().split(' ')) {
            if ["scenes/", "meshes/", "docs/"].iter().any(|folder| word.starts_with(folder)) {
                assert!(PathBuf::from(ROOT).join(word).is_file(), "{word}");
                scenes.extend(word.ends_with(".toml").then(|| word.to_owned()));
            }
        }
    }
    scenes.sort();
    scenes.dedup();
    assert!(scenes.len() >= 5, "{scenes:?}");
    let place = tempfile::tempdir().unwrap();
    for name in scenes {
        say(place.path(), &["check", &format!("{ROOT}/{name}")]);
    }
}

/// The support of the bracket carries the force and moment on its pin. The probe, the report and the time series agree.
/// Linear elements keep the test quick.
#[test]
fn the_bracket_carries_its_load() {
    let place = tempfile::tempdir().unwrap();
    say(place.path(), &["run", &scene("bracket"), "--out", "out", "--set", "body[0].order=1"]);
    let (load, moment) = ([300.0, 0.0, -500.0], [0.0, 0.0, 4.0]);
    // The centroid of the pin hole lies in the mid-plane of the upright plate, at half its width.
    let pin = [0.0035, 0.03, 0.038];
    let report = report_of(&place.path().join("out"));
    let results = &report["results"];
    let vector = |value: &serde_json::Value| [0, 1, 2].map(|k| value[k].as_f64().unwrap());
    let reaction = &results["reactions"][0];
    let (force, about, torque) =
        (vector(&reaction["force"]), vector(&reaction["centroid"]), vector(&reaction["moment"]));
    let arm = [0, 1, 2].map(|k| pin[k] - about[k]);
    let history = History::read(&place.path().join("out/history.csv"));
    for k in 0..3 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        assert!((force[k] + load[k]).abs() < 1e-6 * 500.0, "{force:?}");
        let needed = moment[k] + arm[i] * load[j] - arm[j] * load[i];
        // The hole is a polygon of element edges, whose centroid is off by less than 0.1 mm; the load moves by 0.03 mm.
        assert!((torque[k] + needed).abs() < 1e-4 * 500.0, "{torque:?}, needed {needed}");
        let column =
            ["bolts.sum.reaction_force.x", "bolts.sum.reaction_force.y", "bolts.sum.reaction_force.z"][k];
        assert!((history.last(column) - force[k]).abs() < 1e-9 * 500.0);
    }
    let stress = results["largest_von_mises"]["value"].as_f64().unwrap();
    assert!((1e6..1e9).contains(&stress) && stress >= history.last("bolts.max.von_mises"));
    let probes = results["probes"].as_array().unwrap();
    let range = probes.iter().find(|range| range["column"] == "bolts.max.von_mises").unwrap();
    // The JSON reader may change the last digit.
    assert!((range["max"].as_f64().unwrap() / history.last("bolts.max.von_mises") - 1.0).abs() < 1e-15);
}

#[test]
fn the_modes_of_the_bracket_have_frequencies_and_masses() {
    let place = tempfile::tempdir().unwrap();
    let words = ["--count", "4", "--out", "out", "--set", "body[0].order=1"];
    say(place.path(), &[&["modes", &scene("bracket-impact")][..], &words].concat());
    let out = place.path().join("out");
    let table: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("modes.json")).unwrap()).unwrap();
    let modes = table["modes"].as_array().unwrap();
    let series = variational::io::PvdSeries::open(&out.join("bracket-impact_modes.pvd")).unwrap();
    assert_eq!((modes.len(), series.frames().len()), (4, 4));
    for (mode, (time, file)) in modes.iter().zip(series.frames()) {
        let frequency = mode["frequency"].as_f64().unwrap();
        // Linear elements are stiffer than the quadratic ones of the tutorial, whose lowest mode is at 1125 Hz.
        assert!(frequency > 1125.0 && (time - frequency).abs() < 1e-6 * frequency);
        assert!(out.join(file).is_file());
    }
    let mass = table["free_mass"][0].as_f64().unwrap();
    assert!(mass > 0.3 && mass < 0.35, "{mass} kg");
    assert!(modes[3]["cumulative_share"][2].as_f64().unwrap() > 0.5);
}

#[test]
fn the_transient_of_the_bracket_tells_its_extremes() {
    let place = tempfile::tempdir().unwrap();
    let words = ["--out", "out", "--set", "body[0].order=1", "--set", "time.end=2e-4"];
    say(place.path(), &[&["run", &scene("bracket-impact")][..], &words].concat());
    let out = place.path().join("out");
    let history = History::read(&out.join("history.csv"));
    let largest = history.column("bolts.max.von_mises").into_iter().fold(0.0, f64::max);
    let report = report_of(&out);
    let probes = report["results"]["probes"].as_array().unwrap().clone();
    let range = probes.iter().find(|range| range["column"] == "bolts.max.von_mises").unwrap();
    assert!((range["max"].as_f64().unwrap() / largest - 1.0).abs() < 1e-15);
    assert!(out.join("energy.svg").is_file() && report["energy"]["relative_drift"].as_f64().unwrap() < 1e-2);
}

/// The cache has the header that Blender reads, one sample per frame, finite numbers, the object's points as its first
/// sample, and the waist at its prescribed position. The object has the texture coordinates of the mesh file.
#[test]
fn the_cache_of_the_skirt_is_that_of_its_object() {
    let place = tempfile::tempdir().unwrap();
    say(place.path(), &["run", &scene("skirt"), "--out", "out", "--set", "time.end=0.25"]);
    let bytes = std::fs::read(place.path().join("out/skirt.cloth.pc2")).unwrap();
    let int = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let real = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let (points, samples) = (int(16) as usize, int(28) as usize);
    assert_eq!((&bytes[..12], int(12), points, samples), (&b"POINTCACHE2\0"[..], 1, 816, 7));
    assert_eq!((real(20), real(24), bytes.len()), (0.0, 1.0, 32 + 12 * points * samples));
    let point = |sample: usize, number: usize| {
        [0, 1, 2].map(|k| f64::from(real(32 + 12 * (sample * points + number) + 4 * k)))
    };
    assert!((0..samples).all(|sample| (0..points).all(|n| point(sample, n).iter().all(|x| x.is_finite()))));
    let numbers =
        |line: &str| -> Vec<f64> { line.split(' ').skip(1).map(|word| word.parse().unwrap()).collect() };
    let read = |path: &Path| {
        let text = std::fs::read_to_string(path).unwrap();
        let all = |key: &str| -> Vec<Vec<f64>> {
            text.lines().filter(|line| line.starts_with(key)).map(numbers).collect()
        };
        // Collects the texture coordinates of every face corner, by point.
        let texture = all("vt ");
        let mut corners: Vec<(usize, [f64; 2])> = Vec::new();
        for word in
            text.lines().filter(|line| line.starts_with("f ")).flat_map(|line| line.split(' ').skip(1))
        {
            let (point, uv) = word.split_once('/').unwrap();
            let uv = &texture[uv.parse::<usize>().unwrap() - 1];
            corners.push((point.parse::<usize>().unwrap() - 1, [uv[0], uv[1]]));
        }
        corners.sort_by(|a, b| a.partial_cmp(b).unwrap());
        corners.dedup();
        (all("v "), corners)
    };
    let (object, corners) = read(&place.path().join("out/skirt.cloth.obj"));
    let (source, its_corners) = read(&PathBuf::from(format!("{ROOT}/meshes/skirt.obj")));
    assert_eq!(object, source);
    assert_eq!(corners, its_corners);
    let apart = |x: [f64; 3], y: &[f64]| (0..3).map(|k| (x[k] - y[k]).abs()).fold(0.0, f64::max);
    assert!(object.iter().enumerate().all(|(n, x)| apart(point(0, n), x) < 1e-7));
    // The waist rotates at 4 rad/s.
    for (n, x) in object.iter().enumerate().filter(|(_, x)| x[2] == 1.0) {
        let (sin, cos) = (4.0 * 6.0 / 24.0_f64).sin_cos();
        let turned = [cos * x[0] - sin * x[1], sin * x[0] + cos * x[1], 1.0];
        assert!(apart(point(6, n), &turned) < 1e-6, "{n}");
    }
}
