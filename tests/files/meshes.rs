//! Tests meshes of scenes: mixed quadratic cells from Gmsh, meshes raised in order and refined, and fields on them.

use crate::program::Program;
use variational::mesh::CellKind;
use variational::prelude::Simulation;

/// A block of hexahedra and wedges under uniform tension. The elements are exact for it, so every wrong node order
/// shows.
const MIXED: &str = r#"
    [time]
    end = 1.0
    step = 1.0
    scheme = "implicit-midpoint"
    [static]
    tolerance = 1e-12
    [[body]]
    name = "block"
    mesh = "MESHES/mixed.msh"
    material = { law = "neo-hookean", young = 10.0, poisson = 0.3, density = 1.0 }
    [[fix]]
    body = "block"
    region = "x-min"
    axes = ["x"]
    [[fix]]
    body = "block"
    region = "y-min"
    axes = ["y"]
    [[fix]]
    body = "block"
    region = "z-min"
    axes = ["z"]
    [[load]]
    kind = "traction"
    body = "block"
    region = "x-max"
    traction = [6.467446602, 0.0, 0.0]
    amplitude = "t"
    [[probe]]
    name = "corner"
    body = "block"
    point = [2.0, 1.0, 0.5]
    [output]
    interval = 1.0
    precision = "f64"
    fields = ["displacement", "stress", "nodal_stress", "nodal_von_mises", "nodal_J", "von_mises",
              "reaction_force", "external_force", "acceleration"]
"#;

#[test]
fn hexahedra_and_wedges_of_second_order_share_a_uniform_stress() {
    for locking in ["none", "mean-dilation"] {
        let key = format!("mesh = \"MESHES/mixed.msh\"\n    locking = \"{locking}\"");
        let program = Program::run(&MIXED.replace("mesh = \"MESHES/mixed.msh\"", &key));
        let history = program.history();
        for (column, exact) in
            [("corner.x", 4.0), ("corner.y", 0.7980775445), ("corner.z", 0.7980775445 / 2.0)]
        {
            let found = history.last(column);
            assert!((found - exact).abs() < 1e-7, "{locking} {column}: {found}");
        }
        let frame = variational::io::read_mesh(&program.out().join("scene_000001.vtu")).unwrap();
        let axial = 6.467446602 / (0.7980775445 * 0.7980775445);
        let nodal = frame.point_array("nodal_stress").unwrap();
        assert_eq!(nodal.components, 9);
        assert!(nodal.values.chunks(9).all(|s| (s[0] - axial).abs() < 1e-5 && s[4].abs() < 1e-5));
        let von_mises = frame.point_array("nodal_von_mises").unwrap();
        assert!(von_mises.values.iter().all(|value| (value - axial).abs() < 1e-5));
        let of_cells = frame.cell_data.iter().find(|array| array.name == "stress").unwrap();
        assert!(of_cells.values.chunks(9).all(|s| (s[0] - axial).abs() < 1e-5));
        // Loads and reactions balance in total.
        let sum = |name: &str, axis: usize| -> f64 {
            frame.point_array(name).unwrap().values.iter().skip(axis).step_by(3).sum()
        };
        // The traction of 6.467… Pa acts on 1 × 0.5 m².
        assert!((sum("external_force", 0) - 6.467446602 * 0.5).abs() < 1e-9);
        assert!((sum("reaction_force", 0) + sum("external_force", 0)).abs() < 1e-6);
        let accelerations = frame.point_array("acceleration").unwrap();
        assert!(accelerations.values.iter().all(|a| a.abs() < 1e-4), "in balance");
    }
}

fn simulation(scene: &str) -> Simulation {
    let meshes = concat!(env!("CARGO_MANIFEST_DIR"), "/meshes");
    let parsed = variational::scene::Scene::parse(&scene.replace("MESHES", meshes), &[]);
    assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
    Simulation::new(parsed.scene.unwrap()).unwrap()
}

#[test]
fn order_and_refine_change_a_mesh_and_keep_its_regions() {
    let beam = |keys: &str| {
        simulation(&format!(
            "[time]\nend = 1.0\nstep = 0.1\nscheme = \"implicit-midpoint\"\n[[body]]\nname = \"beam\"\n\
             mesh = \"MESHES/beam.msh\"\n{keys}\n\
             material = {{ law = \"linear\", young = 1e6, poisson = 0.3, density = 1000.0 }}\n\
             [[fix]]\nbody = \"beam\"\nregion = \"clamp\"\n"
        ))
    };
    let (plain, lifted, refined) = (beam(""), beam("order = 2"), beam("order = 2\nrefine = 1"));
    let mesh = |simulation: &Simulation| simulation.bodies()[0].mesh.clone();
    assert_eq!(mesh(&plain).points.len(), 425);
    assert!(mesh(&lifted).blocks.iter().any(|block| block.kind == CellKind::Tet10));
    assert!(mesh(&lifted).blocks.iter().all(|block| block.kind != CellKind::Tet4));
    assert_eq!(mesh(&lifted).points.len(), 33 * 9 * 9);
    assert_eq!(mesh(&refined).points.len(), 65 * 17 * 17);
    assert_eq!(mesh(&refined).region_nodes("tip").unwrap().len(), 17 * 17);
    assert_eq!(mesh(&refined).points[..425], mesh(&plain).points[..]);
    assert_eq!(refined.bodies()[0].element_count(), 8 * plain.bodies()[0].element_count());
}

#[test]
fn keys_that_cannot_be_are_refused_with_the_way_out() {
    let said = |keys: &str| {
        let shape = r#"box = { size = [1.0, 1.0, 1.0], cells = [1, 1, 1] }"#;
        let scene = format!(
            "[time]\nend = 1.0\nstep = 0.1\nscheme = \"implicit-midpoint\"\n[[body]]\nname = \"b\"\n{shape}\n{keys}\n\
             material = {{ law = \"linear\", young = 1e6, poisson = 0.3, density = 1.0 }}\n"
        );
        let program = Program::try_run(&scene, &[]);
        assert_eq!(program.output.status.code(), Some(2));
        program.errors()
    };
    assert!(said("order = 3").contains("order"));
    assert!(said("refine = 9").contains("0 to 6"));
    let text = said("locking = \"mean-dilation\"");
    assert!(text.contains("tet4") && text.contains("hex8"), "{text}");
    assert!(said("locking = \"f-bar\"").contains("mean-dilation"));
}

/// A scene with every key that names a node by its number in the body's mesh: fixes, loads, strikes, springs, probes.
const NAMED: &str = r#"
    gravity = [0.0, -9.81, 0.0]
    [time]
    end = 0.05
    step = 5e-3
    scheme = "implicit-midpoint"
    [solver]
    tolerance = 1e-12
    [[body]]
    name = "block"
    mesh = "MESH"
    material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
    [[fix]]
    body = "block"
    nodes = [FIXED]
    [[load]]
    kind = "point"
    body = "block"
    node = PULLED
    force = [0.0, 0.0, 20.0]
    [[spring]]
    from = { body = "block", node = PULLED }
    to = { point = [1.0, 0.5, 0.5] }
    stiffness = 100.0
    length = 0.1
    [[probe]]
    name = "tip"
    body = "block"
    node = PULLED
    [output]
    interval = 0.025
    precision = "f64"
    fields = ["displacement", "velocity", "acceleration"]
"#;

/// How a file numbers its nodes does not change the motion, and frames keep the order of the file.
#[test]
fn nodes_are_named_and_written_as_the_file_has_them() {
    use variational::io::{VtuFrame, VtuOptions, read_mesh, write_vtu};
    use variational::mesh::{CellBlock, CellKind};
    let directory = tempfile::tempdir().unwrap();
    let shape = variational::mesh::BoxMesh {
        size: [0.4, 0.2, 0.2],
        cells: [5, 3, 2],
        element: CellKind::Tet4,
        origin: [0.0; 3],
    };
    let mesh = shape.build().unwrap();
    let count = mesh.points.len();
    // 31 is prime to the number of nodes, so that the renumbering is a permutation.
    assert_eq!(count, 72);
    let run = |number: &dyn Fn(usize) -> usize, name: &str| {
        let mut points = vec![[0.0; 3]; count];
        (0..count).for_each(|node| points[number(node)] = mesh.points[node]);
        let cells = mesh.cells_of_dimension(3);
        let nodes = cells.iter().flat_map(|&cell| mesh.cell(cell as usize).unwrap().1.to_vec());
        let nodes = nodes.map(|node| number(node as usize) as u32).collect();
        let blocks = [CellBlock { kind: CellKind::Tet4, nodes }];
        let path = directory.path().join(name);
        write_vtu(
            &path,
            &VtuFrame { points: &points, blocks: &blocks, ..VtuFrame::default() },
            VtuOptions::default(),
        )
        .unwrap();
        let at = |wanted: &dyn Fn(&[f64; 3]) -> bool| -> Vec<usize> {
            (0..count).filter(|&node| wanted(&mesh.points[node])).map(number).collect()
        };
        let fixed: Vec<String> = at(&|x| x[0] == 0.0).iter().map(ToString::to_string).collect();
        let pulled = at(&|x| *x == [0.4, 0.2, 0.2])[0];
        let scene = NAMED
            .replace("MESH", path.to_str().unwrap())
            .replace("FIXED", &fixed.join(", "))
            .replace("PULLED", &pulled.to_string());
        let program = Program::run(&scene);
        let frame = read_mesh(&program.out().join("scene_000002.vtu")).unwrap();
        let first = read_mesh(&program.out().join("scene_000000.vtu")).unwrap();
        assert_eq!(first.mesh.points, points, "frames have the points in the order of the file");
        (frame, program.history().last("tip.uz"))
    };
    let (plain, tip) = run(&|node| node, "plain.vtu");
    let (other, other_tip) = run(&|node| (31 * node + 5) % 72, "other.vtu");
    assert!(tip > 1e-3 && (tip - other_tip).abs() < 1e-10 * tip, "{tip} {other_tip}");
    for field in ["displacement", "velocity", "acceleration"] {
        let (plain, other) = (plain.point_array(field).unwrap(), other.point_array(field).unwrap());
        let largest = plain.values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        for node in 0..72 {
            for axis in 0..3 {
                let (a, b) = (plain.values[3 * node + axis], other.values[3 * ((31 * node + 5) % 72) + axis]);
                assert!((a - b).abs() < 1e-8 * largest, "{field} {node}: {a} {b}");
            }
        }
    }
}

/// A note reports a body so far from the origin that the spacing of numbers there is too coarse for its elements.
/// Nearer bodies give no note.
#[test]
fn coordinates_too_coarse_for_the_elements_are_told() {
    for (place, is_told) in [(0.0, false), (1e6, false), (1e9, true), (1e12, true)] {
        let text = format!(
            "[time]\nend = 0.01\nstep = 1e-3\nscheme = \"stormer-verlet\"\n[[body]]\nname = \"b\"\n\
             box = {{ size = [1.0, 0.2, 0.2], cells = [10, 2, 2], element = \"tet4\", origin = [{place}, 0, 0] }}\n\
             material = {{ law = \"neo-hookean\", young = 1e5, poisson = 0.3, density = 1000.0 }}\n"
        );
        let scene = variational::scene::Scene::parse(&text, &[]).scene.unwrap();
        let simulation = Simulation::new(scene).unwrap();
        let told = simulation.notes().iter().any(|note| note.contains("coordinates are"));
        assert_eq!(told, is_told, "{place}: {:?}", simulation.notes());
    }
}
