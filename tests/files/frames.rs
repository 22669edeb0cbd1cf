//! Tests frames at even times, point caches and surfaces for animation programs, and the precision of frames.

use std::path::Path;

use crate::program::{History, Program};
use variational::io::read_mesh;
use variational::prelude::*;
use variational::run::run;

/// A falling, spinning cloth, with a moving block in front of it. OUTPUT and SCHEME are replaced.
const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.1
step = 0.004
scheme = "SCHEME"
[[body]]
name = "the skirt"
sheet = { size = [0.4, 0.2], cells = [4, 2], origin = [1.0, 0.0, 0.0], pattern = "cross" }
material = { law = "st-venant-kirchhoff", young = 1e3, poisson = 0.3, density = 300.0, thickness = 1e-3 }
angular_velocity = [0.0, 1.0, 2.0]
[[body]]
name = "block"
box = { size = [0.1, 0.1, 0.1], cells = [2, 1, 1], element = "hex8" }
material = { law = "neo-hookean", young = 1e4, poisson = 0.3, density = 1000.0 }
[[fix]]
body = "block"
region = "x-min"
motion = { kind = "sine", amplitude = [0.0, 0.02, 0.0], frequency = 8.0 }
[[probe]]
name = "corner"
body = "the skirt"
node = 0
[[probe]]
name = "tip"
body = "block"
point = [0.1, 0.1, 0.1]
[output]
precision = "f64"
fields = ["displacement", "velocity"]
OUTPUT
"#;

fn scene(scheme: &str, output: &str) -> String {
    SCENE.replace("SCHEME", scheme).replace("OUTPUT", output)
}

/// Returns the times of all frames and the positions of one node of the first body.
fn track(directory: &Path, node: usize) -> Vec<(f64, [f64; 3])> {
    let mut frames: Vec<_> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "vtu"))
        .collect();
    frames.sort();
    let at = |path: &std::path::PathBuf| {
        let file = read_mesh(path).unwrap();
        let u = file.point_array("displacement").unwrap().values.as_chunks::<3>().0[node];
        (file.time.unwrap(), [0, 1, 2].map(|k| file.mesh.points[node][k] + u[k]))
    };
    frames.iter().map(at).collect()
}

#[test]
fn frames_at_even_times_change_no_step() {
    // If nothing is due, blanes-moan-4 makes several steps together.
    for scheme in ["stormer-verlet", "implicit-midpoint", "gauss", "blanes-moan-4", "energy-momentum"] {
        let plain = Program::run(&scene(scheme, "history = 5"));
        let filmed = Program::run(&scene(scheme, "history = 5\nfps = 60"));
        let history = |program: &Program| std::fs::read(program.out().join("history.csv")).unwrap();
        assert_eq!(history(&plain), history(&filmed), "{scheme}");
        let times: Vec<f64> = track(&filmed.out(), 0).iter().map(|frame| frame.0).collect();
        let even: Vec<f64> = (0..7).map(|k| f64::from(k) / 60.0).collect();
        assert_eq!(times, even, "{scheme}");
        let pvd = std::fs::read_to_string(filmed.out().join("scene.pvd")).unwrap();
        assert_eq!(pvd.matches("<DataSet").count(), 7);
    }
}

#[test]
fn a_frame_at_the_end_of_a_step_is_its_state_to_the_bit() {
    for scheme in ["stormer-verlet", "gauss"] {
        // Every frame lies at the end of a step, although the times may differ in the last bit.
        let program = Program::run(&scene(scheme, "fps = 50"));
        let history = program.history();
        let frames = track(&program.out(), 0);
        assert_eq!(frames.len(), 6);
        for (k, (_, x)) in frames.iter().enumerate() {
            for (axis, name) in ["corner.ux", "corner.uy", "corner.uz"].iter().enumerate() {
                let rest = [1.0, 0.0, 0.0][axis];
                assert_eq!(x[axis], rest + history.column(name)[5 * k], "{scheme} frame {k} {name}");
            }
        }
    }
}

/// Positions between steps are interpolated linearly in schemes of order 2, with an error of h², and by cubics in
/// higher orders, with an error of h⁴. Halving the step therefore divides the error by 4 or by 16. Frames lie at thirds
/// of the steps of both lengths.
#[test]
fn states_between_steps_are_as_accurate_as_their_scheme_has_them() {
    let film = |scheme: &str| scene(scheme, "fps = 500").replace("end = 0.1", "end = 0.096");
    let error = |scheme: &str, step: f64, exact: &[(f64, [f64; 3])]| {
        let text = film(scheme).replace("step = 0.004", &format!("step = {step}"));
        let found = track(&Program::run(&text).out(), 0);
        assert_eq!(found.len(), exact.len());
        let distance = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
        found.iter().zip(exact).map(|(a, b)| distance(a.1, b.1)).fold(0.0, f64::max)
    };
    let text = film("blanes-moan-6").replace("step = 0.004", "step = 0.0002");
    let exact = track(&Program::run(&text).out(), 0);
    for (scheme, ratio) in [("stormer-verlet", 4.0), ("blanes-moan-4", 16.0)] {
        let (coarse, fine) = (error(scheme, 0.006, &exact), error(scheme, 0.003, &exact));
        assert!(coarse / fine > 0.8 * ratio && coarse / fine < 1.25 * ratio, "{scheme}: {coarse:e} {fine:e}");
    }
}

/// Reads a PC2 file: the number of points, and the positions of each sample.
fn point_cache(path: &Path) -> (usize, Vec<Vec<[f32; 3]>>) {
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(&bytes[..12], b"POINTCACHE2\0");
    let int = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let (version, points, samples) = (int(12), int(16) as usize, int(28) as usize);
    assert_eq!((version, bytes.len()), (1, 32 + 12 * points * samples));
    let (words, _) = bytes[32..].as_chunks::<4>();
    let values: Vec<f32> = words.iter().map(|word| f32::from_le_bytes(*word)).collect();
    let positions: Vec<[f32; 3]> = values.as_chunks::<3>().0.to_vec();
    (points, positions.chunks(points).map(<[_]>::to_vec).collect())
}

#[test]
fn point_caches_hold_what_history_and_the_object_file_say() {
    let program = Program::run(&scene("stormer-verlet", "fps = 50\ncache = \"pc2\""));
    let (out, history) = (program.out(), program.history());
    // The cloth has 4 × 2 crossed cells. The surface of the block of 2 bricks has all of its 12 nodes.
    for (stem, count, faces, probe, node) in
        [("scene.the_skirt", 15 + 8, 32, "corner", 0), ("scene.block", 12, 20, "tip", 11)]
    {
        let (points, samples) = point_cache(&out.join(format!("{stem}.pc2")));
        assert_eq!((points, samples.len()), (count, 6), "{stem}");
        for (k, sample) in samples.iter().enumerate() {
            for (axis, name) in ["x", "y", "z"].iter().enumerate() {
                let of_history = history.column(&format!("{probe}.{name}"))[5 * k];
                assert_eq!(sample[node][axis], of_history as f32, "{stem} sample {k} {name}");
            }
        }
        let object = read_mesh(&out.join(format!("{stem}.obj"))).unwrap();
        assert_eq!((object.mesh.points.len(), object.mesh.cell_count()), (count, faces));
        for (x, first) in object.mesh.points.iter().zip(&samples[0]) {
            assert_eq!(x.map(|x| x as f32), *first);
        }
    }
    let cloth = read_mesh(&out.join("scene.the_skirt.obj")).unwrap();
    let uv = &cloth.point_array("uv").expect("texture coordinates of a sheet").values;
    for (x, uv) in cloth.mesh.points.iter().zip(uv.as_chunks::<2>().0) {
        assert!(
            (uv[0] - (x[0] - 1.0) / 0.4).abs() < 1e-12 && (uv[1] - x[1] / 0.2).abs() < 1e-12,
            "{uv:?} {x:?}"
        );
    }
    let block = std::fs::read_to_string(out.join("scene.block.obj")).unwrap();
    assert!(!block.contains("vt "), "a solid has no texture coordinates");
}

/// An MDD file holds the samples of the point cache, with their times, also if the run ends early.
#[test]
fn mdd_files_hold_the_samples_of_the_point_caches() {
    let failing =
        scene("stormer-verlet", "fps = 50\ncache = \"mdd\"\n[guard]\naction = \"stop\"\nbound = 1e-9");
    for (text, is_whole) in [(scene("stormer-verlet", "fps = 50\ncache = \"mdd\""), true), (failing, false)] {
        let program = Program::try_run(&text, &[]);
        assert_eq!(program.code() == Some(0), is_whole, "{}", program.errors());
        for stem in ["scene.the_skirt", "scene.block"] {
            let (points, samples) = point_cache(&program.out().join(format!("{stem}.pc2")));
            assert_eq!(samples.len() == 6, is_whole);
            let bytes = std::fs::read(program.out().join(format!("{stem}.mdd"))).unwrap();
            let words = bytes.as_chunks::<4>().0;
            let head = [words[0], words[1]].map(|word| i32::from_be_bytes(word) as usize);
            assert_eq!(
                (head, bytes.len()),
                ([samples.len(), points], 4 * (2 + samples.len() * (1 + 3 * points)))
            );
            let mut values = words[2..].iter().map(|&word| f32::from_be_bytes(word));
            for (k, time) in values.by_ref().take(samples.len()).enumerate() {
                assert_eq!(time, (k as f64 / 50.0) as f32);
            }
            assert!(values.eq(samples.into_iter().flatten().flatten()), "{stem}");
        }
    }
}

/// Texture coordinates of a mesh file reach the cache with their seams, on a refined mesh too.
#[test]
fn texture_coordinates_of_a_mesh_file_are_kept() {
    for refine in [0, 1] {
        let program = Program::run(&format!(
            "[time]\nend = 0.01\nstep = 0.005\nscheme = \"stormer-verlet\"\n[[body]]\nname = \"roll\"\n\
             mesh = \"MESHES/roll.obj\"\nrefine = {refine}\n\
             material = {{ law = \"st-venant-kirchhoff\", young = 1e3, poisson = 0.3, density = 300.0, \
             thickness = 1e-3 }}\n[output]\nfps = 200\ncache = \"obj\"\nhistory = 0\n"
        ));
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/roll.obj");
        let area = |file: &variational::io::MeshFile| {
            let uv = &file.point_array("uv").unwrap().values;
            let at = |node: u32| [0, 1].map(|k| uv[2 * node as usize + k]);
            let triangles = file.mesh.cells().filter(|(kind, _)| kind.dimension() == 2);
            let of = |nodes: &[u32]| {
                let [a, b, c] = [0, 1, 2].map(|k| at(nodes[k]));
                0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
            };
            triangles.map(|(_, nodes)| of(nodes)).sum::<f64>()
        };
        let (was, is) = (
            read_mesh(Path::new(file)).unwrap(),
            read_mesh(&program.out().join("scene.roll.000002.obj")).unwrap(),
        );
        assert_eq!(is.mesh.cell_count(), 1536 << (2 * refine));
        assert!((area(&was) - area(&is)).abs() < 1e-12, "{} {}", area(&was), area(&is));
    }
}

#[test]
fn keys_of_output_are_checked_and_an_earlier_run_leaves_nothing() {
    let said = |output: &str| {
        let program = Program::try_run(&scene("stormer-verlet", output), &[]);
        assert_eq!(program.code(), Some(2), "{output}");
        program.errors()
    };
    assert!(said("cache = \"pc2\"").contains("fps"));
    assert!(said("cache = \"pc2\"\ninterval = 0.1").contains("fps"));
    assert!(said("fps = 24\ninterval = 0.1").contains("only one of"));
    assert!(said("fps = 0").contains("positive"));
    assert!(said("fps = -24").contains("positive"));
    assert!(said("cache = \"abc\"\nfps = 24").contains("pc2"));

    let directory = tempfile::tempdir().unwrap();
    let once = |output: &str| {
        let parsed = Scene::parse(&scene("stormer-verlet", output), &[]);
        assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
        run(parsed.scene.unwrap(), "scene", directory.path(), &mut ()).unwrap();
        let mut files: Vec<String> = std::fs::read_dir(directory.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| [".obj", ".ply", ".pc2", ".mdd"].iter().any(|ending| name.ends_with(ending)))
            .collect();
        files.sort();
        files
    };
    std::fs::write(directory.path().join("scene.mine.obj"), "").unwrap();
    assert_eq!(once("fps = 30\ncache = \"ply\"").len(), 1 + 2 * 4);
    assert_eq!(once("fps = 30\ncache = \"obj\"").len(), 1 + 2 * 4);
    assert_eq!(once("fps = 30\ncache = \"mdd\"").len(), 1 + 2 * 3);
    let kept = [
        "scene.block.obj",
        "scene.block.pc2",
        "scene.mine.obj",
        "scene.the_skirt.obj",
        "scene.the_skirt.pc2",
    ];
    assert_eq!(once("fps = 30\ncache = \"pc2\""), kept);
    assert_eq!(once("history = 1"), ["scene.mine.obj"]);
}

/// Far from the origin frames use 64 bits, which the run notes, and keep the shape. In 32 bits, positions at 10⁶ m
/// would be rounded to 6 cm.
#[test]
fn frames_far_from_the_origin_keep_their_shape() {
    let shape = |translate: f64| {
        let text = scene("stormer-verlet", "interval = 0.1").replace("precision = \"f64\"", "").replace(
            "name = \"the skirt\"",
            &format!("name = \"the skirt\"\ntranslate = [{translate}, 0.0, 0.0]"),
        );
        let program = Program::run(&text);
        let frame = read_mesh(&program.out().join("scene_000001.vtu")).unwrap();
        let u = frame.point_array("displacement").unwrap();
        let x = |node: usize, k: usize| frame.mesh.points[node][k] + u.values[3 * node + k];
        let way: Vec<f64> = (0..23).flat_map(|node| [0, 1, 2].map(|k| x(node, k) - x(0, k))).collect();
        let says = program.errors().contains("64 bits");
        let notes = program.report()["notes"].to_string().contains("64 bits");
        assert_eq!(says, notes);
        (way, says)
    };
    let (near, far) = (shape(0.0), shape(1e6));
    assert!(!near.1 && far.1);
    for (near, far) in near.0.iter().zip(&far.0) {
        assert!((near - far).abs() < 1e-6, "{near} {far}");
    }
}

/// Under displacement control the load factor is an unknown, not a time. Frames still lie between rows.
#[test]
fn the_film_of_a_path_of_equilibria_follows_its_steps() {
    let program = Program::run(
        r#"
        [time]
        end = 1.0
        step = 0.5
        [static]
        control = { kind = "displacement", probe = "p", axis = "z", to = -0.05 }
        [[body]]
        name = "b"
        box = { size = [1.0, 0.2, 0.2], cells = [4, 1, 1], element = "hex8" }
        material = { law = "linear", young = 1e6, poisson = 0.3, density = 1000.0 }
        [[fix]]
        body = "b"
        region = "x-min"
        [[load]]
        kind = "traction"
        body = "b"
        region = "x-max"
        traction = [0.0, 0.0, -1000.0]
        amplitude = "t"
        [[probe]]
        name = "p"
        body = "b"
        node = 4
        [output]
        fps = 4
        precision = "f64"
        "#,
    );
    let frames = track(&program.out(), 4);
    assert_eq!(frames.len(), 5);
    for (k, (_, x)) in frames.iter().enumerate() {
        assert!((x[2] + 0.0125 * k as f64).abs() < 1e-9, "{k}: {x:?}");
    }
}

/// A static scene writes a row of history for every frame, unless the scene asks for other rows.
#[test]
fn the_film_of_a_static_scene_follows_its_load() {
    let program = Program::run(
        r#"
        gravity = [0.0, 0.0, -9.81]
        [time]
        end = 1.0
        step = 0.5
        scheme = "implicit-midpoint"
        [static]
        [[body]]
        name = "b"
        box = { size = [1.0, 0.2, 0.2], cells = [4, 1, 1], element = "hex8" }
        material = { law = "linear", young = 1e6, poisson = 0.3, density = 1000.0 }
        [[fix]]
        body = "b"
        region = "x-min"
        [[probe]]
        name = "p"
        body = "b"
        node = 4
        [output]
        fps = 4
        precision = "f64"
        "#,
    );
    let frames = track(&program.out(), 4);
    assert_eq!(frames.iter().map(|frame| frame.0).collect::<Vec<_>>(), [0.0, 0.25, 0.5, 0.75, 1.0]);
    let history = History::read(&program.out().join("history.csv"));
    let z = history.column("p.z");
    assert!((frames[1].1[2] - 0.5 * (z[0] + z[1])).abs() < 1e-15);
}
