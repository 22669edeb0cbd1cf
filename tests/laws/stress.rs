//! Tests violent scenes: none may end in a panic, a hang, a number that is not finite, an unreported gain of energy, or
//! a skipped step. Tests that crushed bodies recover.

use std::path::Path;
use std::time::Duration;

use variational::prelude::*;
use variational::run::run;
use variational::study::stress::{Case, Scenes, StressOptions, Violence, case, meeting, resting, stress};

/// Runs 300 scenes; `variational stress --count 10000` is the long form (docs/robustness.md).
#[test]
fn violent_scenes_end_well_or_fail_by_name() {
    let keep = std::env::temp_dir().join("variational-stress-failures");
    let limit = Duration::from_secs(10);
    let options = StressOptions {
        first: 0,
        count: 300,
        seed: 300,
        scenes: Scenes::OneBody,
        jobs: 2,
        limit,
        keep: keep.clone(),
    };
    let report = stress(&options, &());
    let total = report.total();
    assert!(report.forbidden.is_empty(), "{:#?}, kept in {}", report.forbidden, keep.display());
    assert_eq!(total.tried, 300);
    assert!(total.done + total.cut + total.guarded > 100, "{}", report.markdown(&options));
    assert!(total.failed > 10, "they are too gentle:\n{}", report.markdown(&options));
    assert!(total.refused < 30, "{:?}", report.refused);
}

/// After every step of a violent meeting of bodies, exact predicates find no crossing. A run may end with a named
/// error. This test runs the quick kinds; `variational stress --contact` runs all (docs/robustness.md).
#[test]
fn bodies_that_meet_violently_never_cross() {
    let mut done = 0;
    for index in [3, 8, 13, 18, 23, 28] {
        let case = meeting(5, index).unwrap();
        let mut simulation = Simulation::new(case.scene).unwrap();
        while !simulation.is_done() && simulation.steps() < 20 {
            if simulation.step().is_err() {
                break;
            }
            let (crossings, pairs) = simulation.crossings();
            assert_eq!(crossings, 0, "scene {index}, step {}: {pairs:?}", simulation.steps());
        }
        done += usize::from(simulation.is_done() || simulation.steps() >= 20);
    }
    assert!(done >= 3, "{done} of 6 scenes end well");
}

/// Makes all steps of a scene, none of which may fail or end with surfaces that cross.
fn ends_without_crossings(Case { index, scene, .. }: Case) {
    let mut simulation = Simulation::new(scene).unwrap();
    while !simulation.is_done() {
        simulation.step().unwrap_or_else(|error| panic!("scene {index}: {error}"));
        let (crossings, pairs) = simulation.crossings();
        assert_eq!(crossings, 0, "scene {index}, step {}: {pairs:?}", simulation.steps());
    }
}

/// Bodies that begin apart come to rest on each other with friction, and no surface crosses. Each of these scenes found no equilibrium before its
/// bodies approached in hops: a ball, a block on a slope, and a pile.
#[test]
fn bodies_that_begin_apart_come_to_rest() {
    for index in [28, 37, 48] {
        ends_without_crossings(resting(1, index).unwrap());
    }
}

/// Impacts over many times the layer in one step: a moved ball and walls that crumple a sheet, by explicit schemes, and a needle
/// and a knife by implicit ones. After a step that ended at 1e-4 of the layer, no later step would succeed. All steps succeed, and
/// no surface crosses. The last two need parts below h/1024.
#[test]
fn steps_are_divided_before_gaps_are_lost() {
    for index in [46, 155, 172, 244] {
        ends_without_crossings(meeting(1, index).unwrap());
    }
}

fn bits(directory: &Path) -> Vec<(std::ffi::OsString, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.path().extension().is_some_and(|ending| ending == "csv" || ending == "vtu"))
        .map(|entry| (entry.file_name(), std::fs::read(entry.path()).unwrap()))
        .collect();
    files.sort();
    files
}

/// A scene gives the same bits on 1, 2 and 8 threads, however it ends.
#[test]
fn threads_do_not_change_a_bit() {
    let directory = tempfile::tempdir().unwrap();
    let pools = [1, 2, 8].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap());
    for index in 0..50 {
        let case = case(8, index, directory.path()).unwrap();
        let runs = pools.each_ref().map(|pool| {
            let out = directory.path().join(format!("{index}-{}", pool.current_num_threads()));
            // Another test judges how the run ends.
            let _ = pool.install(|| run(case.scene.clone(), "case", &out, &mut ()));
            if out.exists() { bits(&out) } else { Vec::new() }
        });
        assert!(runs[0] == runs[1] && runs[0] == runs[2], "scene {index}: {:?}", case.violence);
    }
}

/// A block crushed to a plane, to a thousandth of its size, or turned inside out recovers its rest shape up to a rigid
/// motion under a dissipative scheme. A block crushed to a single point has no direction to expand in: that is an
/// unstable equilibrium, which is not tested.
#[test]
fn crushed_bodies_come_back() {
    for name in ["stable-neo-hookean", "corotated"] {
        for crush in ["plane", "point", "inverted"] {
            let directory = tempfile::tempdir().unwrap();
            let mesh = crushed(crush, directory.path());
            let text = format!(r#"{{ "law": "{name}", "young": 1e5, "poisson": 0.3, "density": 1000.0 }}"#);
            let law: Law = serde_json::from_str(&text).unwrap();
            let scene = Scene::new(Time::new(1.5, 5e-3, SchemeName::BackwardEuler))
                .body(Body::from_mesh("block", mesh, law));
            let mut simulation = Simulation::new(scene).unwrap();
            let first = simulation.observe().elastic;
            while !simulation.is_done() {
                simulation.step().unwrap();
            }
            let left = simulation.observe().elastic;
            assert!(left < 1e-6 * first, "{name} from {crush}: {left:e} of {first:e} J are left");
            // Without strain energy every edge has its rest length.
            let (x, rest) = (simulation.positions(0), &simulation.bodies()[0].mesh.points);
            for (a, b) in [(0, 1), (0, 5), (3, 9), (2, 7), (0, 35)] {
                let length =
                    |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
                let (now, then) = (length(&x[a], &x[b]), length(&rest[a], &rest[b]));
                assert!((now / then - 1.0).abs() < 1e-2, "{name} from {crush}: {now} m instead of {then} m");
            }
        }
    }
}

fn crushed(crush: &str, directory: &Path) -> std::path::PathBuf {
    use variational::io::{VtuArray, VtuFrame, VtuOptions, VtuValues};
    use variational::mesh::{CellBlock, CellKind};
    let shape =
        BoxMesh { size: [0.4, 0.2, 0.2], cells: [3, 2, 2], element: CellKind::Tet4, origin: [0.0; 3] };
    let mesh = shape.build().unwrap();
    let cells = mesh.cells_of_dimension(3);
    let nodes = cells.iter().flat_map(|&cell| mesh.cell(cell as usize).unwrap().1).copied().collect();
    let blocks = [CellBlock { kind: CellKind::Tet4, nodes }];
    let displacement: Vec<f64> = mesh
        .points
        .iter()
        .flat_map(|x| match crush {
            "plane" => [0.0, 0.0, -x[2]],
            "point" => [-0.999 * x[0], -0.999 * x[1], -0.999 * x[2]],
            _ => [-2.0 * x[0], 0.0, 0.0],
        })
        .collect();
    let array = VtuArray { name: "displacement", components: 3, values: VtuValues::Real(&displacement) };
    let frame =
        VtuFrame { points: &mesh.points, blocks: &blocks, point_data: &[array], ..VtuFrame::default() };
    let path = directory.join("block.vtu");
    variational::io::write_vtu(&path, &frame, VtuOptions::default()).unwrap();
    path
}

/// On violent configurations too, forces are the derivative of the energy along the steepest direction, and internal
/// forces have no resultant.
#[test]
fn forces_derive_from_energy_wherever_there_is_one() {
    use variational::solvers::Assembler;
    let directory = tempfile::tempdir().unwrap();
    let mut checked = 0;
    for index in 0..340 {
        let case = case(3, index, directory.path()).unwrap();
        // On flat or mirrored bodies some laws have a kink.
        if !matches!(case.violence, Violence::Scrambled | Violence::Stretched) {
            continue;
        }
        let mut scene = case.scene;
        (scene.gravity, scene.wind, scene.damping) = ([0.0; 3], None, None);
        scene.fixes.clear();
        let Ok(simulation) = Simulation::new(scene) else { continue };
        for component in simulation.components() {
            let (system, state) = (component.system(), component.state());
            let mut assembler = Assembler::new(system);
            let x = system.positions(state);
            let mut gradient = vec![0.0; x.len()];
            assembler.gradient(&x, 0.0, &mut gradient);
            let energy = assembler.energies(&x, 0.0).total();
            let largest = gradient.iter().fold(0.0_f64, |largest, g| largest.max(g.abs()));
            let is_sound = energy.is_finite() && gradient.iter().all(|g| g.is_finite());
            // Round-off in a body without strain (a sheet stretched across its plane) is not compared.
            let size = x.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
            if !is_sound || energy < 1e-6 {
                continue;
            }
            for axis in 0..3 {
                let sum: f64 = gradient.iter().skip(axis).step_by(3).sum();
                assert!(sum.abs() < 1e-8 * largest, "scene {index}: a net force of {sum:e} of {largest:e} N");
            }
            let mut quotient = |step: f64| {
                let mut at = |sign: f64| {
                    let moved: Vec<f64> =
                        x.iter().zip(&gradient).map(|(x, g)| x + sign * step * g / largest).collect();
                    assembler.energies(&moved, 0.0).total()
                };
                (at(1.0) - at(-1.0)) / (2.0 * step)
            };
            let exact: f64 = gradient.iter().map(|g| g * g / largest).sum();
            // Slivers and kinks need other difference steps than smooth configurations.
            let best = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12]
                .into_iter()
                .map(|step| (quotient(step * size) / exact - 1.0).abs())
                .filter(|error| error.is_finite())
                .fold(f64::INFINITY, f64::min);
            assert!(best < 1e-2, "scene {index}: the energy's slope is off by {best:e}");
            checked += 1;
        }
    }
    assert!(checked > 15, "{checked}");
}

/// Scenes mutated at random are read or refused, without a panic.
#[test]
fn mutated_scenes_are_read_or_refused() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut scenes: Vec<_> = std::fs::read_dir(root)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "toml"))
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect();
    scenes.sort();
    let mut state = 5_u64;
    let mut below = |count: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % count.max(1)
    };
    let words =
        ["nan", "inf", "-1", "1e400", "0", "\"\"", "[", "]]", "{", "=", "\u{0}", "é", "99999999999999999999"];
    for _ in 0..1000 {
        let mut text: Vec<char> = scenes[below(scenes.len())].chars().collect();
        for _ in 0..1 + below(3) {
            let at = below(text.len());
            let end = (at + 1 + below(12)).min(text.len());
            match below(4) {
                0 => drop(text.drain(at..end)),
                1 => drop(text.splice(at..end, words[below(words.len())].chars())),
                2 => text.truncate(at),
                _ => {
                    let copy: Vec<char> = text[at..end].to_vec();
                    let to = below(text.len());
                    text.splice(to..to, copy);
                }
            }
        }
        let text: String = text.into_iter().collect();
        let parsed = Scene::parse(&text, &[]);
        assert!(parsed.scene.is_some() || !parsed.problems.is_empty(), "neither read nor refused: {text}");
    }
}
