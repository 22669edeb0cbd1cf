//! Tests modes against references: the free cube (E2), names of rigid motions, effective masses, and the files of
//! `modes`.

use variational::core::{Coordinates, System};
use variational::fem::{Isotropic, Law, add_lumped_mass, consistent_mass, elastic};
use variational::mesh::{BoxMesh, CellKind};
use variational::prelude::*;
use variational::solvers::{ModeOptions, modes};
use variational::study::modes::scene_modes;

#[test]
fn e2_free_cube_with_the_exact_lame_mode() {
    let law = Law::Linear(Isotropic { young: 1.0, poisson: 0.3, density: 1.0 });
    let shape = BoxMesh { size: [1.0; 3], cells: [10; 3], element: CellKind::Hex27, origin: [0.0; 3] };
    let mesh = shape.build().unwrap();
    let all = mesh.cells_of_dimension(3);
    let mut mass = vec![0.0; mesh.points.len()];
    add_lumped_mass(&mesh, &all, 1.0, &mut mass).unwrap();
    let terms = elastic(&mesh, &all, &law, 0, "cube").unwrap();
    let count = 3 * mesh.points.len();
    let mass = mass.iter().flat_map(|&m| [m; 3]).collect();
    let system = System::new(mass, terms, Coordinates::all_free(count)).unwrap();
    let state = system.state(0.0, mesh.points.as_flattened(), &vec![0.0; count]).unwrap();
    let kinetic = consistent_mass(&mesh, &all, 1.0, 0, "cube").unwrap();
    let found =
        modes(&system, &state, kinetic, &ModeOptions { count: 18, ..Default::default() }).unwrap().modes;
    let omega: Vec<f64> = found.iter().map(|mode| mode.omega_squared.max(0.0).sqrt()).collect();
    assert!(found[..6].iter().all(|mode| mode.is_rigid) && !found[6].is_rigid, "{omega:?}");
    let near = |exact: f64, tolerance: f64| omega.iter().any(|omega| (omega - exact).abs() < tolerance);
    assert!(near(1.77126, 2e-4) && near(2.38518, 2e-4) && near(2.42566, 2e-4), "{omega:?}");
    // The exact frequency of a Lamé mode is √2 π √(G/ρ) with G = 1/2.6.
    let lame = 2.0_f64.sqrt() * std::f64::consts::PI * (1.0 / 2.6_f64).sqrt();
    assert!(near(lame, 2e-4 * lame), "{lame} {omega:?}");
}

const BLOCK_AND_SHEET: &str = r#"
    [time]
    end = 1.0
    step = 0.1
    scheme = "stormer-verlet"
    [[body]]
    name = "block"
    box = { size = [1.0, 0.5, 0.25], cells = [2, 1, 1], element = "hex8" }
    material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
    [[fix]]
    body = "block"
    region = "x-min"
    [[body]]
    name = "cloth"
    sheet = { size = [0.6, 0.4], cells = [2, 1], origin = [0.0, 0.0, 1.0] }
    material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, density = 500.0, thickness = 1e-2 }
"#;

/// The effective masses of all modes add up to the mass that can move, and the mode shapes are orthonormal, both to
/// round-off. This holds for solids and sheets, and with the consistent mass that `modes` uses by default even if the
/// scheme is explicit.
#[test]
fn all_modes_take_part_with_all_of_the_mass() {
    let scene = Scene::parse(BLOCK_AND_SHEET, &[]).scene.unwrap();
    // The sheet is free: 0.6 m · 0.4 m · 0.01 m · 500 kg/m³. One of the block's two cells of 62.5 kg is attached to the
    // held nodes: half of its lumped mass can move, and a third of its consistent mass, ∫ ξ² dξ.
    for (mass, block) in [(MassKind::Lumped, 125.0 * 0.75), (MassKind::Consistent, 62.5 + 62.5 / 3.0)] {
        let mut simulation = Simulation::new(scene.clone()).unwrap();
        let found = scene_modes(&mut simulation, 1000, mass).unwrap();
        let expected = block + 1.2;
        for axis in 0..3 {
            let sum: f64 = found.modes.iter().map(|found| found.mode.participation[axis].powi(2)).sum();
            assert!((found.free_mass[axis] / expected - 1.0).abs() < 1e-12, "{mass:?} {:?}", found.free_mass);
            assert!((sum / expected - 1.0).abs() < 1e-9, "{mass:?} axis {axis}: {sum} of {expected}");
        }
        let free: usize = simulation.components().iter().map(|c| c.system().coordinates().free_count()).sum();
        assert_eq!(found.modes.len(), free);
        if mass == MassKind::Lumped {
            for (k, one) in found.modes.iter().enumerate() {
                for other in found.modes[..=k].iter().filter(|other| other.component == one.component) {
                    let mass = simulation.components()[one.component].system().free_mass();
                    let shapes = one.mode.shape.iter().zip(&other.mode.shape);
                    let product: f64 = mass.iter().zip(shapes).map(|(m, (a, b))| m * a * b).sum();
                    let expected = if std::ptr::eq(one, other) { 1.0 } else { 0.0 };
                    assert!((product - expected).abs() < 1e-8, "{product}");
                }
            }
        }
    }
}

#[test]
fn the_files_hold_frequencies_effective_masses_and_shapes_of_a_tenth() {
    let directory = tempfile::TempDir::new().unwrap();
    std::fs::write(directory.path().join("scene.toml"), BLOCK_AND_SHEET).unwrap();
    let run = |count: &str| {
        let output = crate::program::command()
            .current_dir(directory.path())
            .args(["modes", "scene.toml", "--out", "out", "--json", "--threads", "2", "--count", count])
            .output()
            .unwrap();
        let messages = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{messages}");
        // A body has no more modes than free coordinates.
        assert_eq!(messages.contains("modes, one for each free coordinate"), count == "1000", "{messages}");
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    assert_eq!(run("1000")["notes"].as_array().unwrap().len(), 2);
    run("12");
    let report = run("9");
    let out = directory.path().join("out");
    let modes = report["modes"].as_array().unwrap();
    assert_eq!((modes.len(), report["mass"].as_str()), (18, Some("consistent")));
    for key in ["scene", "free_coordinates", "version", "compiler", "processor", "threads", "date", "command"]
    {
        assert!(!report["provenance"][key].is_null(), "{key}");
    }
    let series = variational::io::PvdSeries::open(&out.join("scene_modes.pvd")).unwrap();
    assert_eq!(series.frames().len(), 18);
    assert!(series.frames().windows(2).all(|pair| pair[0].0 < pair[1].0), "{:?}", series.frames());
    assert!(!out.join("scene_mode_018.vtu").exists() && out.join("modes.svg").exists());
    for ((time, file), mode) in series.frames().iter().zip(modes) {
        let frequency = mode["frequency"].as_f64().unwrap();
        assert!((time - frequency).abs() <= 1e-6 * frequency.max(1.0), "{time} {frequency}");
        let text = std::fs::read(out.join(file)).unwrap();
        let text = String::from_utf8_lossy(&text);
        assert!(text.contains("Name=\"frequency\"") && text.contains("Name=\"effective_mass\""));
        let mesh = variational::io::read_mesh(&out.join(file)).unwrap();
        let shape = &mesh.point_data.iter().find(|array| array.name == "displacement").unwrap().values;
        let length = |u: &[f64]| u.iter().map(|u| u * u).sum::<f64>().sqrt();
        let largest = shape.chunks(3).map(length).fold(0.0, f64::max);
        let extent = if mode["component"] == 0 { 1.0 } else { 0.6 };
        assert!((largest / (0.1 * extent) - 1.0).abs() < 1e-6, "{largest}");
    }
    let table = std::fs::read_to_string(out.join("modes.csv")).unwrap();
    assert!(
        table.lines().next().unwrap().ends_with("cumulative_share_x,cumulative_share_y,cumulative_share_z")
    );
    assert_eq!(table.lines().count(), 19);
}
