//! Tests sheets cut from flat patterns, and directions that vary over a sheet.

use std::f64::consts::TAU;

use vi_fem::{
    Bending, CellField, Direction, DirectionComponent, FemError, OrthotropicParameters, Sheet, SheetLaw,
};
use vi_mesh::{CellBlock, CellKind, Mesh, SheetMesh, SheetPattern};

fn square(cells: u32) -> Mesh {
    let directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let pattern = SheetPattern::Random;
    SheetMesh { size: [1.0, 1.0], cells: [cells; 2], pattern, seed: 7, origin: [0.0; 3], directions }
        .build()
        .unwrap()
}

/// Returns the corners (x, y) of every cell, the flat shape of a mesh in z = 0.
fn flat(mesh: &Mesh) -> Vec<[[f64; 2]; 3]> {
    let corner = |node: u32| [mesh.points[node as usize][0], mesh.points[node as usize][1]];
    (0..mesh.cell_count())
        .map(|cell| {
            let (_, nodes) = mesh.cell(cell).unwrap();
            [0, 1, 2].map(|k| corner(nodes[k.min(nodes.len() - 1)]))
        })
        .collect()
}

fn rolled(mesh: &Mesh, radius: f64) -> Mesh {
    let mut mesh = mesh.clone();
    for p in &mut mesh.points {
        let angle = p[0] / radius;
        *p = [radius * angle.sin(), p[1], radius * (1.0 - angle.cos())];
    }
    mesh
}

/// Returns the energy and the largest gradient entry of all potentials at x.
fn state(sheet: &Sheet, x: &[f64]) -> Result<(f64, f64), FemError> {
    let (mut energy, mut force) = (0.0, 0.0_f64);
    for potential in sheet.potentials()? {
        let count = potential.stencils().count();
        let mut out = vec![0.0; count * potential.stencils().size()];
        potential.energies(0..count, x, 0.0, &mut out);
        energy += out[..count].iter().sum::<f64>();
        potential.gradients(0..count, x, 0.0, &mut out);
        force = out.iter().fold(force, |most, g| most.max(g.abs()));
    }
    Ok((energy, force))
}

#[test]
fn a_rolled_up_sheet_is_at_rest_in_its_pattern_alone() {
    let plane = square(6);
    let mesh = rolled(&plane, 0.5);
    let (elements, pattern) = (mesh.cells_of_dimension(2), flat(&plane));
    for law in SheetLaw::examples() {
        for &bending in Bending::ALL {
            let law = law.clone().with_bending(bending);
            let mut reference = Sheet::new(&plane, &elements, &law, 0, "sheet");
            reference.flat = true;
            let sheet = Sheet { pattern: Some(&pattern), ..Sheet::new(&mesh, &elements, &law, 0, "sheet") };
            for x in [plane.points.as_flattened(), mesh.points.as_flattened()] {
                let (found, expected) = (state(&sheet, x).unwrap(), state(&reference, x).unwrap());
                let scale = state(&reference, mesh.points.as_flattened()).unwrap();
                assert!((found.0 - expected.0).abs() <= 1e-12 * scale.0, "{law:?}: {found:?} {expected:?}");
                assert!((found.1 - expected.1).abs() <= 1e-9 * scale.1, "{law:?}: {found:?} {expected:?}");
            }
            let (mut masses, mut flat_masses) = (vec![0.0; mesh.points.len()], vec![0.0; mesh.points.len()]);
            sheet.add_lumped_mass(&mut masses).unwrap();
            reference.add_lumped_mass(&mut flat_masses).unwrap();
            assert!(masses.iter().zip(&flat_masses).all(|(a, b)| (a - b).abs() < 1e-14 * b));
        }
    }
}

#[test]
fn charts_may_lie_anywhere_and_either_way_up() {
    let plane = square(4);
    let elements = plane.cells_of_dimension(2);
    let whole = flat(&plane);
    let mut charts = whole.clone();
    for corners in &mut charts {
        if corners.iter().map(|c| c[0]).sum::<f64>() < 1.5 {
            // Give a triangle its own chart: reversed, rotated by a right angle, translated.
            *corners = corners.map(|[u, v]| [5.0 + v, 3.0 + u]);
        }
    }
    let x = rolled(&plane, 0.4).points.concat();
    for &bending in Bending::ALL {
        let law = SheetLaw::examples().remove(0).with_bending(bending);
        let sheet = Sheet::new(&plane, &elements, &law, 0, "sheet");
        let one = state(&Sheet { pattern: Some(&whole), ..sheet }, &x).unwrap();
        let two = state(&Sheet { pattern: Some(&charts), ..sheet }, &x).unwrap();
        assert!((one.0 - two.0).abs() < 1e-12 * one.0, "{bending:?}: {one:?} {two:?}");
    }
}

#[test]
fn bad_patterns_name_the_element() {
    let mesh = square(3);
    let elements = mesh.cells_of_dimension(2);
    let law = SheetLaw::examples().remove(0);
    let sheet = Sheet::new(&mesh, &elements, &law, 0, "sheet");
    let mut folded = flat(&mesh);
    // Move the free corner of one triangle across its edge, in that triangle alone.
    let [a, b, c] = folded[8];
    folded[8][2] = [a[0] + b[0] - c[0], a[1] + b[1] - c[1]];
    let mut closed = flat(&mesh);
    closed[7][1] = closed[7][0];
    for (pattern, words) in [(folded, "element 8 is folded over"), (closed, "element 7 has no area")] {
        let message = Sheet { pattern: Some(&pattern), ..sheet }.potentials().err().unwrap().to_string();
        let names =
            |text: &str| text.contains(words) || words.contains("folded") && text.contains("element 8;");
        assert!(names(&message), "{message}");
    }
    let message = Sheet { pattern: Some(&flat(&mesh)[..5]), ..sheet }.potentials().err().unwrap().to_string();
    assert!(message.contains("fewer than the mesh"), "{message}");
}

fn woven(warp: Direction) -> SheetLaw {
    SheetLaw::Orthotropic(OrthotropicParameters {
        young_warp: 1e6,
        young_weft: 2e5,
        poisson: 0.1,
        shear: 5e4,
        warp,
        density: Some(1000.0),
        area_density: None,
        thickness: 1e-2,
        bending: Bending::Shell,
        tension_field: false,
    })
}

fn formulas(source: [&str; 3]) -> Direction {
    Direction::Formula(source.map(|text| DirectionComponent::Formula(text.into())))
}

/// An inflated ring: a warp along the hoops responds with E₁, a radial warp with E₂.
#[test]
fn a_direction_may_turn_over_the_sheet() {
    let mut mesh = square(24);
    for p in &mut mesh.points {
        let (r, phi) = (1.0 + p[1], 0.9 * TAU * p[0]);
        *p = [r * phi.cos(), r * phi.sin(), 0.0];
    }
    let elements = mesh.cells_of_dimension(2);
    let x: Vec<f64> = mesh
        .points
        .iter()
        .flat_map(|p| {
            let r = p[0].hypot(p[1]);
            let factor = 1.0 + 0.01 / r;
            [factor * p[0], factor * p[1], 0.0]
        })
        .collect();
    let middle = |cell: u32| {
        let (_, nodes) = mesh.cell(cell as usize).unwrap();
        [0, 1, 2].map(|i| nodes.iter().map(|&node| mesh.points[node as usize][i]).sum::<f64>() / 3.0)
    };
    let hoop: Vec<[f64; 3]> = (0..mesh.cell_count() as u32)
        .map(|cell| {
            let m = middle(cell);
            [-m[1], m[0], 0.7]
        })
        .collect();
    let fields = [CellField { name: "warp".into(), values: hoop }];
    let energy = |warp: Direction| {
        let law = woven(warp);
        state(&Sheet { fields: &fields, ..Sheet::new(&mesh, &elements, &law, 0, "ring") }, &x).unwrap().0
    };
    let around = energy(formulas(["-y", "x", "0"]));
    let cells = energy(serde_json::from_str(r#"{ "cell_data": "warp" }"#).unwrap());
    let outwards = energy(formulas(["x", "y", "0"]));
    let mixed = energy(serde_json::from_str(r#"["x", "y", 0.0]"#).unwrap());
    assert!((around - cells).abs() < 1e-12 * around, "{around} {cells}");
    assert!((outwards - mixed).abs() < 1e-12 * outwards);
    // The strain is along the hoops only, on cells of 13°, so the energies are nearly in the ratio of the moduli.
    assert!((4.0..5.0).contains(&(around / outwards)), "{around} {outwards}");
    for (warp, words) in [
        (formulas(["0", "0", "1"]), "no part in the plane of element"),
        (formulas(["0", "0", "q"]), "expected"),
        (serde_json::from_str(r#"{ "cell_data": "weft" }"#).unwrap(), "it has: warp"),
        (Direction::Constant([0.0; 3]), "warp"),
    ] {
        let law = woven(warp);
        let sheet = Sheet { fields: &fields, ..Sheet::new(&mesh, &elements, &law, 0, "ring") };
        let message = sheet.potentials().err().unwrap().to_string();
        assert!(message.contains(words), "{message}");
    }
}

/// Cell data are given in the coordinates of the mesh, whatever the pattern.
#[test]
fn directions_of_cells_follow_the_sheet_into_its_pattern() {
    let plane = square(24);
    let mesh = rolled(&plane, 0.5);
    let (elements, pattern) = (mesh.cells_of_dimension(2), flat(&plane));
    // Along the roll, at 45° to its axis.
    let values = (0..mesh.cell_count())
        .map(|cell| {
            let (_, nodes) = mesh.cell(cell).unwrap();
            let along = nodes.iter().map(|&node| plane.points[node as usize][0]).sum::<f64>();
            let angle = along / nodes.len() as f64 / 0.5;
            [angle.cos(), 1.0, angle.sin()]
        })
        .collect();
    let fields = [CellField { name: "warp".into(), values }];
    let by_cells = woven(serde_json::from_str(r#"{ "cell_data": "warp" }"#).unwrap());
    let constant = woven(Direction::Constant([1.0, 1.0, 0.0]));
    let x: Vec<f64> = mesh.points.iter().flat_map(|p| [1.1 * p[0], p[1], 0.9 * p[2]]).collect();
    let energy = |law: &SheetLaw| {
        let sheet = Sheet::new(&mesh, &elements, law, 0, "sheet");
        state(&Sheet { fields: &fields, pattern: Some(&pattern), ..sheet }, &x).unwrap().0
    };
    let (one, two) = (energy(&by_cells), energy(&constant));
    assert!((one - two).abs() < 1e-3 * two, "{one} {two}");
}

/// The moment across a hinge is the same on both of its triangles: its compliance is the mean of those that it has with either
/// direction on both, weighted by the heights of the triangles. No triangle is the first.
#[test]
fn hinges_between_two_directions_bend_in_series() {
    let points = vec![[0.0, -0.5, 0.0], [0.0, 0.5, 0.0], [1.0, 0.1, 0.0], [-0.5, -0.2, 0.0]];
    let (sine, cosine) = 0.3_f64.sin_cos();
    let mut x = points.clone();
    (x[2][0], x[2][2]) = (cosine * points[2][0], sine * points[2][0]);
    let (triangles, warp) = ([[0, 2, 1], [0, 1, 3]], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    for bending in [Bending::Hinge, Bending::Quadratic] {
        let law = woven(serde_json::from_str(r#"{ "cell_data": "warp" }"#).unwrap()).with_bending(bending);
        let energy = |order: [usize; 2], warp: [[f64; 3]; 2]| {
            let nodes = order.iter().flat_map(|&k| triangles[k]).collect();
            let blocks = vec![CellBlock { kind: CellKind::Tri3, nodes }];
            let mesh = Mesh { points: points.clone(), blocks, ..Mesh::default() };
            let fields = [CellField { name: "warp".into(), values: order.map(|k| warp[k]).to_vec() }];
            let elements = mesh.cells_of_dimension(2);
            let sheet = Sheet { fields: &fields, ..Sheet::new(&mesh, &elements, &law, 0, "strip") };
            state(&sheet, x.as_flattened()).unwrap().0
        };
        let [along, across] = warp.map(|warp| energy([0, 1], [warp; 2]));
        assert!((along / across - 5.0).abs() < 1e-12, "{along} {across}");
        let mixed = energy([0, 1], warp);
        let mean = (1.0 / along + 0.5 / across) / 1.5;
        assert!((mixed * mean - 1.0).abs() < 1e-12, "{mixed} instead of {}", 1.0 / mean);
        let turned = energy([1, 0], warp);
        assert!((turned / mixed - 1.0).abs() < 1e-14, "{turned} {mixed}");
    }
}
