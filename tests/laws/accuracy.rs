//! Tests accuracy in space and time together: orders of manufactured motions, damping without effect on rigid motion,
//! modes of loaded bodies, snap-through.

use crate::program::Program;
use variational::core::Quadrature;
use variational::fem::tensor::determinant;
use variational::fem::{Element, Hex8, Hex20, Hex27, Tet4, Tet10, Wedge6, Wedge15, Wedge18};
use variational::mesh::{CellKind, Mesh};
use variational::prelude::{Scene, Simulation};
use variational::scene::MassKind;
use variational::study::modes::scene_modes;

fn simulation(scene: &str) -> Simulation {
    let parsed = Scene::parse(scene, &[]);
    assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
    Simulation::new(parsed.scene.unwrap()).unwrap()
}

/// Returns ‖u_h − u‖ over ‖u‖ in L² at the end, for u = (φ, 0, 0) t²/2 with φ = sin πx sin πy sin πz on the unit cube
/// with its surface held. The body forces ρφ e₁ and −div σ(φ e₁) t²/2 make u the exact solution. λ = μ = 1
/// (E = 2.5, ν = 0.25), ρ = 1. Gauss collocation with two stages is exact for t².
fn manufactured(element: CellKind, cells: u32, mass: &str) -> f64 {
    let faces: String = ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"]
        .iter()
        .map(|face| format!("[[fix]]\nbody = \"cube\"\nregion = \"{face}\"\n"))
        .collect();
    let scene = format!(
        r#"
        [time]
        end = 1.0
        step = 0.25
        scheme = "gauss"
        stages = 2
        [solver]
        tolerance = 1e-12
        mass = "{mass}"
        [[body]]
        name = "cube"
        box = {{ size = [1.0, 1.0, 1.0], cells = [{cells}, {cells}, {cells}], element = "{element}" }}
        material = {{ law = "linear", young = 2.5, poisson = 0.25, density = 1.0 }}
        {faces}
        [[load]]
        kind = "body-force"
        body = "cube"
        force = ["sin(pi*x)*sin(pi*y)*sin(pi*z)", 0.0, 0.0]
        [[load]]
        kind = "body-force"
        body = "cube"
        force = ["5*pi^2*sin(pi*x)*sin(pi*y)*sin(pi*z)", "-2*pi^2*cos(pi*x)*cos(pi*y)*sin(pi*z)",
                 "-2*pi^2*cos(pi*x)*sin(pi*y)*cos(pi*z)"]
        amplitude = "t^2/2"
        "#
    );
    let mut simulation = simulation(&scene);
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let (mesh, x) = (&simulation.bodies()[0].mesh, simulation.positions(0));
    match element {
        CellKind::Tet4 => distance::<Tet4, 4, 1>(mesh, &x),
        CellKind::Tet10 => distance::<Tet10, 10, 4>(mesh, &x),
        CellKind::Hex8 => distance::<Hex8, 8, 8>(mesh, &x),
        CellKind::Hex20 => distance::<Hex20, 20, 27>(mesh, &x),
        CellKind::Hex27 => distance::<Hex27, 27, 27>(mesh, &x),
        CellKind::Wedge6 => distance::<Wedge6, 6, 6>(mesh, &x),
        CellKind::Wedge15 => distance::<Wedge15, 15, 18>(mesh, &x),
        CellKind::Wedge18 => distance::<Wedge18, 18, 18>(mesh, &x),
        other => panic!("{other} is no solid"),
    }
}

/// Returns ‖u_h − u‖/‖u‖ in L² by a rule of five points per direction. It differs from the element's own rule, at whose
/// points errors may be smaller than between them.
fn distance<E: Element<N, Q>, const N: usize, const Q: usize>(mesh: &Mesh, x: &[[f64; 3]]) -> f64 {
    let line = Quadrature::gauss_legendre(5).unwrap();
    let line: Vec<(f64, f64)> = line.nodes().iter().copied().zip(line.weights().iter().copied()).collect();
    let mut rule = Vec::new();
    for &(u, a) in &line {
        for &(v, b) in &line {
            for &(w, c) in &line {
                // Maps the rule to tetrahedra, wedges and cubes, by their number of nodes.
                rule.push(match N {
                    4 | 10 => (
                        [u, v * (1.0 - u), w * (1.0 - u) * (1.0 - v)],
                        a * b * c * (1.0 - u).powi(2) * (1.0 - v),
                    ),
                    6 | 15 | 18 => ([u, v * (1.0 - u), w], a * b * c * (1.0 - u)),
                    _ => ([u, v, w].map(|s| 2.0 * s - 1.0), 8.0 * a * b * c),
                });
            }
        }
    }
    let (mut error, mut whole) = (0.0, 0.0);
    let solids = mesh.blocks.iter().filter(|block| block.kind.dimension() == 3);
    for nodes in solids.flat_map(|block| block.nodes.chunks_exact(N)) {
        let rest: [[f64; 3]; N] = std::array::from_fn(|a| mesh.points[nodes[a] as usize]);
        for &(xi, weight) in &rule {
            let (values, gradients) = (E::values(xi), E::gradients(xi));
            let dv = weight * determinant(&E::reference_gradient(&rest, &gradients));
            let at = |points: &dyn Fn(usize) -> [f64; 3]| -> [f64; 3] {
                std::array::from_fn(|k| (0..N).map(|a| values[a] * points(a)[k]).sum())
            };
            let (place, now) = (at(&|a| rest[a]), at(&|a| x[nodes[a] as usize]));
            let phi: f64 = place.iter().map(|x| (std::f64::consts::PI * x).sin()).product();
            let exact = [0.5 * phi, 0.0, 0.0];
            error += dv * (0..3).map(|k| (now[k] - place[k] - exact[k]).powi(2)).sum::<f64>();
            whole += dv * exact[0] * exact[0];
        }
    }
    assert!((whole - 1.0 / 32.0).abs() < 1e-3, "{whole}");
    (error / whole).sqrt()
}

/// Displacements in motion converge with order p + 1, where p is the degree of the element, with consistent mass, and
/// with lumped mass if the nodes are the points of a sufficiently exact rule. (Lumped hex20 and wedge15 fall to order 1
/// to 2.)
#[test]
fn a_manufactured_motion_shows_the_order_of_each_element() {
    use CellKind::*;
    for (element, cells, mass, order) in [
        (Tet4, [8, 16], "consistent", 1.9),
        (Hex8, [4, 8], "consistent", 1.9),
        (Wedge6, [6, 12], "consistent", 1.9),
        (Tet10, [3, 6], "consistent", 2.9),
        (Hex20, [3, 6], "consistent", 2.9),
        (Hex27, [3, 6], "consistent", 2.9),
        (Wedge15, [3, 6], "consistent", 2.9),
        (Wedge18, [3, 6], "consistent", 2.9),
        (Hex8, [4, 8], "lumped", 1.9),
        (Hex27, [3, 6], "lumped", 2.9),
        (Wedge18, [3, 6], "lumped", 2.9),
    ] {
        let errors = cells.map(|cells| manufactured(element, cells, mass));
        let found = (errors[0] / errors[1]).log2();
        assert!(found > order, "{element}, {mass}: {errors:?}, order {found:.2}");
    }
}

const FREE: &str = r#"
    gravity = [0.0, 0.0, GRAVITY]
    [time]
    end = 0.5
    step = 0.005
    scheme = "SCHEME"
    [solver]
    tolerance = 1e-13
    [damping]
    shear_viscosity = VISCOSITY
    bulk_viscosity = VISCOSITY
    stiffness_time = TIME
    [[body]]
    name = "block"
    box = { size = [1.0, 0.5, 0.25], cells = [2, 1, 1], element = "tet10" }
    material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, density = 1000.0 }
    velocity = [1.0, 0.0, 2.0]
    angular_velocity = SPIN
"#;

fn free(gravity: &str, spin: &str, damped: bool) -> Simulation {
    let (viscosity, time) = if damped { ("50.0", "0.001") } else { ("0.0", "0.0") };
    let scene = FREE
        .replace("GRAVITY", gravity)
        .replace("SCHEME", "implicit-midpoint")
        .replace("VISCOSITY", viscosity)
        .replace("TIME", time)
        .replace("SPIN", spin);
    let mut simulation = simulation(&scene);
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    simulation
}

#[test]
fn free_fall_is_untouched_by_viscosity() {
    let fallen = free("-9.81", "[0.0, 0.0, 0.0]", true);
    // The midpoint rule is exact for a parabola.
    let t = 0.5_f64;
    let motion = [t, 0.0, 2.0 * t - 0.5 * 9.81 * t * t];
    for (x, rest) in fallen.positions(0).iter().zip(&fallen.bodies()[0].mesh.points) {
        assert!((0..3).all(|k| (x[k] - rest[k] - motion[k]).abs() < 1e-10), "{x:?} {rest:?}");
    }
}

/// Viscous damping does not change the momenta of a slow spin. The centrifugal strain is 1e-8, and damping dissipates
/// less than that fraction of the energy.
#[test]
fn rigid_spin_is_untouched_by_viscosity() {
    let spin = "[0.0, 0.0, 0.01]";
    let (mut damped, mut free) = (free("0.0", spin, true), free("0.0", spin, false));
    let (damped, free) = (damped.observe(), free.observe());
    for k in 0..3 {
        assert!((damped.angular_momentum[k] - free.angular_momentum[k]).abs() < 1e-9);
        assert!((damped.momentum[k] - free.momentum[k]).abs() < 1e-9);
    }
    // This is the energy of spin alone, without the ½ m v² = 312.5 J of flight of 125 kg.
    let spinning = free.kinetic - 0.5 * 125.0 * 5.0;
    assert!(
        spinning > 1e-4 && (free.total() - damped.total()).abs() < 1e-6 * spinning,
        "{free:?} {damped:?}"
    );
}

/// For a clamped column under a dead axial load P, ω² vanishes at Euler's load P_E = π²EI/(4L²) and stays near ω₀²
/// (1 − P/P_E) below it.
#[test]
fn modes_are_those_of_the_loaded_body() {
    let (height, young) = (0.05_f64, 1e9);
    let euler = std::f64::consts::PI.powi(2) * young * height.powi(4) / 12.0 / 4.0;
    let lowest = |share: f64| {
        let traction = -share * euler / height.powi(2);
        let mut simulation = simulation(&format!(
            r#"
            [time]
            end = 1.0
            step = 1.0
            scheme = "implicit-midpoint"
            [static]
            tolerance = 1e-10
            [[body]]
            name = "column"
            box = {{ size = [1.0, {height}, {height}], cells = [10, 1, 1], element = "hex20" }}
            material = {{ law = "st-venant-kirchhoff", young = {young:e}, poisson = 0.0, density = 1000.0 }}
            [[fix]]
            body = "column"
            region = "x-min"
            [[load]]
            kind = "traction"
            body = "column"
            region = "x-max"
            traction = [{traction:.6}, 0.0, 0.0]
            amplitude = "t"
            "#
        ));
        scene_modes(&mut simulation, 2, MassKind::Consistent).unwrap().modes[0].mode.omega_squared
    };
    let [free, half, most] = [0.0, 0.5, 0.95].map(lowest);
    assert!((half / free - 0.5).abs() < 0.02, "{}", half / free);
    assert!((most / free - 0.05).abs() < 0.02, "{}", most / free);
}

/// A shallow arch of two straight legs is pushed down at its crown, reaches a greatest load, and snaps through. The
/// program follows the path by arc length and reports the limit points.
#[test]
fn snap_through_is_followed_by_arc_length_from_a_scene() {
    use variational::io::{VtuFrame, VtuOptions, write_vtu};
    use variational::mesh::{BoxMesh, CellBlock, CellKind};
    let shape = BoxMesh {
        size: [2.0, 0.05, 0.05],
        cells: [16, 1, 1],
        element: CellKind::Hex20,
        origin: [-1.0, 0.0, 0.0],
    };
    let mut mesh = shape.build().unwrap();
    mesh.points.iter_mut().for_each(|x| x[1] += 0.15 * (1.0 - x[0].abs()));
    let blocks = [CellBlock { kind: CellKind::Hex20, nodes: mesh.blocks[0].nodes.clone() }];
    let directory = tempfile::TempDir::new().unwrap();
    let file = directory.path().join("arch.vtu");
    let frame = VtuFrame {
        points: &mesh.points,
        blocks: &blocks,
        far: &[],
        regions: &[],
        point_data: &[],
        cell_data: &[],
        time: None,
        field_data: &[],
    };
    let options = VtuOptions { precision: variational::io::Precision::Double, ..VtuOptions::default() };
    write_vtu(&file, &frame, options).unwrap();
    let scene = format!(
        r#"
        [time]
        end = 1.0
        step = 0.5
        scheme = "implicit-midpoint"
        [static]
        arc_steps = 400
        [[body]]
        name = "arch"
        mesh = "{}"
        material = {{ law = "st-venant-kirchhoff", young = 1e6, poisson = 0.0, density = 1.0 }}
        [[fix]]
        body = "arch"
        box = {{ min = [-1.000001, -1.0, -1.0], max = [-0.999999, 1.0, 1.0] }}
        [[fix]]
        body = "arch"
        box = {{ min = [0.999999, -1.0, -1.0], max = [1.000001, 1.0, 1.0] }}
        [[fix]]
        body = "arch"
        box = {{ min = [-2.0, -1.0, -1.0], max = [2.0, 1.0, 1.0] }}
        axes = ["z"]
        [[load]]
        kind = "point"
        body = "arch"
        point = [0.0, 0.2, 0.025]
        force = [0.0, -60.0, 0.0]
        amplitude = "t"
        [[probe]]
        name = "crown"
        body = "arch"
        point = [0.0, 0.2, 0.025]
        "#,
        file.display()
    );
    let program = Program::run(&scene);
    let crown = program.history().column("crown.uy");
    assert!(*crown.last().unwrap() < -0.3, "through to the other side: {crown:?}");
    // There is one row per arc step. The load falls between the limit points while the crown sinks throughout.
    let factors = program.history().column("load_factor");
    assert!(factors.windows(2).filter(|pair| pair[1] < pair[0]).count() > 3, "{factors:?}");
    assert!(crown.windows(2).all(|pair| pair[1] < pair[0]) && *factors.last().unwrap() == 1.0, "{crown:?}");
    let text = program.errors();
    // The arch loses stability sideways before the load has its maximum. Limit points are reported nevertheless.
    assert_eq!(text.matches("a limit point").count(), 2, "{text}");
    let notes = program.report()["notes"].to_string();
    assert!(notes.contains("limit point"), "{notes}");
}
