//! Violent scenes: none may end in a panic, a hang, a number that is not finite, energy gained in silence or a
//! skipped step; and a body that was crushed comes back.

use std::path::Path;
use std::time::Duration;

use variational::prelude::*;
use variational::run::run;
use variational::stress::{StressOptions, case, stress};

/// 300 scenes; `variational stress --count 10000` is the long form (docs/robustness.md).
#[test]
fn violent_scenes_end_well_or_fail_by_name() {
    let keep = std::env::temp_dir().join("variational-stress-failures");
    let limit = Duration::from_secs(10);
    let options = StressOptions { count: 300, seed: 300, jobs: 2, limit, keep: keep.clone() };
    let report = stress(&options, &|_, _| {});
    let total = report.total();
    assert!(report.forbidden.is_empty(), "{:#?}, kept in {}", report.forbidden, keep.display());
    assert_eq!(total.tried, 300);
    assert!(total.done + total.cut + total.guarded > 100, "{}", report.markdown(&options));
    assert!(total.failed > 10, "they are too gentle:\n{}", report.markdown(&options));
    assert!(total.refused < 30, "{:?}", report.refused);
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

/// The same bits on 1, 2 and 8 threads, however the scene ends.
#[test]
fn threads_do_not_change_a_bit() {
    let directory = tempfile::tempdir().unwrap();
    let pools = [1, 2, 8].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap());
    for index in 0..50 {
        let case = case(8, index, directory.path()).unwrap();
        let runs = pools.each_ref().map(|pool| {
            let out = directory.path().join(format!("{index}-{}", pool.current_num_threads()));
            // How it ends is the other test's business.
            let _ = pool.install(|| run(case.scene.clone(), "case", &out, &mut ()));
            if out.exists() { bits(&out) } else { Vec::new() }
        });
        assert!(runs[0] == runs[1] && runs[0] == runs[2], "scene {index}: {:?}", case.violence);
    }
}

/// A block crushed to a plane or a point, or turned inside out, with soft damping: it must come back to its
/// shape at rest (up to a rigid motion).
#[test]
fn crushed_bodies_come_back() {
    for law in ["stable-neo-hookean", "corotated"] {
        for crush in ["plane", "point", "inverted"] {
            let directory = tempfile::tempdir().unwrap();
            let mesh = crushed(crush, directory.path());
            let text = format!(r#"{{ "law": "{law}", "young": 1e5, "poisson": 0.3, "density": 1000.0 }}"#);
            let law: Law = serde_json::from_str(&text).unwrap();
            let mut scene = Scene::new(Time::new(2.0, 5e-3, SchemeName::BackwardEuler))
                .body(Body::from_mesh("block", mesh, law))
                .output(Output { history: 0, ..Output::default() });
            scene.time.substeps = true;
            let mut simulation = Simulation::new(scene).unwrap();
            let first = simulation.observe().elastic;
            while !simulation.is_done() {
                simulation.step().unwrap();
            }
            let left = simulation.observe();
            assert!(
                left.elastic < 1e-6 * first,
                "{text} from {crush}: {:e} of {first:e} J are left",
                left.elastic
            );
            // Without strain energy every edge has its length.
            let (x, rest) = (simulation.positions(0), &simulation.bodies()[0].mesh.points);
            for (a, b) in [(0, 1), (0, 5), (3, 9), (2, 7)] {
                let length =
                    |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt();
                let (now, then) = (length(&x[a], &x[b]), length(&rest[a], &rest[b]));
                assert!((now / then - 1.0).abs() < 1e-2, "{text} from {crush}: {now} m instead of {then} m");
            }
        }
    }
}

fn crushed(crush: &str, directory: &Path) -> std::path::PathBuf {
    use variational::io::{CellBlock, CellKind, VtuArray, VtuFrame, VtuOptions, VtuValues};
    let shape =
        BoxMesh { size: [0.4, 0.2, 0.2], cells: [3, 2, 2], element: ElementKind::Tet4, origin: [0.0; 3] };
    let mesh = shape.build().unwrap();
    let cells = mesh.cells_of_dimension(3);
    let nodes = cells.iter().flat_map(|&cell| mesh.cell(cell as usize).unwrap().1).copied().collect();
    let blocks = [CellBlock { kind: CellKind::from_vtk(10).unwrap(), nodes }];
    let displacement: Vec<f64> = mesh
        .points
        .iter()
        .flat_map(|x| match crush {
            "plane" => [0.0, 0.0, -x[2]],
            "point" => [-x[0], -x[1], -x[2]],
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
