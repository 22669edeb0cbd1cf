//! Tests reference cases A1 and A2 through the command line: exact to round-off, for any mesh.

use crate::program::{History, Program};

const A1: &str = r#"
    title = "A1"
    [time]
    end = 0.1
    step = 0.005
    scheme = "SCHEME"
    [[body]]
    name = "tet"
    mesh = "DATA/a1.vtk"
    material = { law = "LAW", young = 1000.0, poisson = 0.3, density = 6.0 }
    [[probe]]
    name = "n0"
    body = "tet"
    node = 0
    [solver]
    tolerance = 1e-14
"#;

fn a1(scheme: &str, law: &str) -> History {
    Program::run(&A1.replace("SCHEME", scheme).replace("LAW", law)).history()
}

fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found:.13} instead of {expected:.13}");
}

/// The table of A1 is met to 1e-10: the position of node 0 after 20 steps, and the energy then.
#[test]
fn a1_single_tetrahedron() {
    for (scheme, x, energy) in [
        ("implicit-midpoint", [0.247589742057, -0.119956694019, -0.003475610562], 10.675428969596),
        ("stormer-verlet", [0.246080873166, -0.120488410416, -0.003828158883], 10.676146532492),
        ("gauss", [0.246750593831, -0.120237873928, -0.003695700613], 10.679485850236),
    ] {
        let history = a1(scheme, "st-venant-kirchhoff");
        close(history.first("total"), 10.679487179487, 1e-11, "SVK energy at t = 0");
        for (k, axis) in ["x", "y", "z"].iter().enumerate() {
            close(history.last(&format!("n0.{axis}")), x[k], 1e-10, &format!("{scheme} {axis}"));
        }
        close(history.last("total"), energy, 1e-10, &format!("{scheme} energy"));
        for (column, exact) in
            [("px", 0.5), ("py", 0.25), ("pz", 0.25), ("lx", 0.5), ("ly", 1.1), ("lz", 1.65)]
        {
            for value in history.column(column) {
                close(value, exact, 1e-13, &format!("{scheme} {column}"));
            }
        }
    }
    close(a1("stormer-verlet", "neo-hookean").first("total"), 9.263417035889, 1e-11, "NH energy at t = 0");
}

/// Schemes of high order meet the exact solution of the ODE to ±1e-9.
#[test]
fn a1_exact_solution() {
    let exact = [0.246749587, -0.120237950, -0.003696031];
    let scene = A1.replace("LAW", "st-venant-kirchhoff").replace("step = 0.005", "step = 0.0005");
    for scheme in ["blanes-moan-6", "gauss\"\n    stages = 3 #"] {
        let history = Program::run(&scene.replace("SCHEME", scheme)).history();
        for (k, axis) in ["x", "y", "z"].iter().enumerate() {
            close(history.last(&format!("n0.{axis}")), exact[k], 1.5e-9, &format!("{scheme} {axis}"));
        }
        close(history.last("total"), 10.679487179, 1e-9, "energy");
    }
}

/// The Kuhn cube meets the exact solution of the ODE at t = 0.05 and t = 0.2.
#[test]
fn a2_kuhn_cube() {
    let scene = r#"
        gravity = [0.0, 0.0, -9.81]
        [time]
        end = 0.2
        step = 0.0005
        scheme = "blanes-moan-6"
        [[body]]
        name = "cube"
        mesh = "DATA/a2.vtk"
        material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
        [[fix]]
        body = "cube"
        nodes = [0, 1, 2, 3]
        [[probe]]
        name = "x7"
        body = "cube"
        node = 7
        [[probe]]
        name = "x5"
        body = "cube"
        point = [1.0, 0.0, 1.0]
    "#;
    let from_box = scene.replace(
        "mesh = \"DATA/a2.vtk\"",
        "box = { size = [1.0, 1.0, 1.0], cells = [1, 1, 1], element = \"tet4\", origin = [0, 0, 0] }",
    );
    for scene in [scene, &from_box] {
        let history = Program::run(scene).history();
        for (t, x7, x5) in [
            (0.05, [1.0001778588, 1.0001778588, 0.9881966398], [1.0002584876, -0.000525672, 0.9884037083]),
            (0.2, [1.010884223, 1.010884223, 0.9081972138], [1.0070731794, -0.0201738164, 0.918672015]),
        ] {
            for (k, axis) in ["x", "y", "z"].iter().enumerate() {
                close(history.at(&format!("x7.{axis}"), t), x7[k], 1e-9, &format!("x7.{axis}"));
                close(history.at(&format!("x5.{axis}"), t), x5[k], 1e-9, &format!("x5.{axis}"));
            }
        }
    }
}
