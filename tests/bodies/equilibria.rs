//! Tests static reference cases with closed forms or digits of independent computations: uniaxial stretch (C6), thick
//! shells under following pressure (C4), the elastica (C2), Cook's membrane (C1).

use variational::core::{Coordinates, Fixed, Path, Potential, Prescribed, State, System};
use variational::fem::{
    Amplitude, DeadLoad, Isotropic, Law, Pressure, VectorField, add_lumped_mass, elastic, pressure,
};
use variational::mesh::{BoxMesh, CellKind, Mesh, Surface};
use variational::solvers::{StaticOptions, StaticReport, equilibrium, reactions};

/// Meshes a box and maps its points.
fn mapped(size: [f64; 3], cells: [u32; 3], element: CellKind, map: impl Fn([f64; 3]) -> [f64; 3]) -> Mesh {
    let mut mesh = BoxMesh { size, cells, element, origin: [0.0; 3] }.build().unwrap();
    for point in &mut mesh.points {
        *point = map(*point);
    }
    mesh
}

/// Prescribes the positions of single coordinates.
struct Held {
    is_held: Vec<[bool; 3]>,
}

impl Held {
    fn new(mesh: &Mesh) -> Self {
        Self { is_held: vec![[false; 3]; mesh.points.len()] }
    }

    fn region(mut self, mesh: &Mesh, region: &str, axes: &[usize]) -> Self {
        for node in mesh.region_nodes(region).unwrap() {
            for &axis in axes {
                self.is_held[node as usize][axis] = true;
            }
        }
        self
    }

    fn everywhere(mut self, axis: usize) -> Self {
        self.is_held.iter_mut().for_each(|held| held[axis] = true);
        self
    }

    fn coordinates(&self, mesh: &Mesh, moving: Vec<Prescribed>) -> Coordinates {
        let moved: Vec<u32> = moving.iter().flat_map(|group| group.dofs.clone()).collect();
        let count = 3 * mesh.points.len();
        let is_held = |dof: &u32| self.is_held[*dof as usize / 3][*dof as usize % 3] && !moved.contains(dof);
        let dofs: Vec<u32> = (0..count as u32).filter(is_held).collect();
        let at = dofs.iter().map(|&dof| mesh.points[dof as usize / 3][dof as usize % 3]).collect();
        let mut groups = vec![Prescribed { dofs, path: Box::new(Fixed(at)) as Box<dyn Path> }];
        groups.extend(moving);
        Coordinates::new(count, groups).unwrap()
    }
}

fn body(mesh: &Mesh, law: &Law, loads: Vec<Box<dyn Potential>>, coordinates: Coordinates) -> (System, State) {
    let all = mesh.cells_of_dimension(3);
    let mut mass = vec![0.0; mesh.points.len()];
    add_lumped_mass(mesh, &all, law.density(), &mut mass).unwrap();
    let mut terms = elastic(mesh, &all, law, 0, "body").unwrap();
    terms.extend(loads);
    let mass = mass.iter().flat_map(|&m| [m; 3]).collect();
    let system = System::new(mass, terms, coordinates).unwrap();
    let x: Vec<f64> = mesh.points.as_flattened().to_vec();
    let state = system.state(0.0, &x, &vec![0.0; x.len()]).unwrap();
    (system, state)
}

fn solve(system: &System, state: &mut State, options: StaticOptions) -> StaticReport {
    let options = StaticOptions { tolerance: 1e-10, find_critical: false, ..options };
    let report = equilibrium(system, state, &options).unwrap();
    assert!(report.is_stable() && report.jumps.is_empty(), "{report:?}");
    report
}

fn neo_hookean(young: f64, poisson: f64) -> Law {
    Law::NeoHookean(Isotropic { young, poisson, density: 1.0 })
}

/// Moves x linearly from X to X + t d.
struct Ramp(Vec<f64>, f64);

impl Path for Ramp {
    fn position(&self, t: f64, out: &mut [f64]) {
        out.iter_mut().zip(&self.0).for_each(|(out, rest)| *out = rest + t * self.1);
    }
    fn velocity(&self, _t: f64, out: &mut [f64]) {
        out.fill(self.1);
    }
}

#[test]
fn c6_uniaxial_stretch_to_ten_digits() {
    for (element, poisson, stretch, lateral, stress) in [
        (CellKind::Tet4, 0.3, 0.5, 1.2107673905, -0.9353520569),
        (CellKind::Hex8, 0.3, 2.0, 0.7980775445, 0.6467446602),
        (CellKind::Hex20, 0.45, 0.5, 1.3508697467, -1.0861028086),
        (CellKind::Tet10, 0.45, 2.0, 0.7259350056, 0.5987962703),
    ] {
        let mesh = mapped([1.0; 3], [2, 1, 1], element, |x| x);
        let held = Held::new(&mesh).region(&mesh, "x-min", &[0]).region(&mesh, "y-min", &[1]).region(
            &mesh,
            "z-min",
            &[2],
        );
        let end = mesh.region_nodes("x-max").unwrap();
        let path = Box::new(Ramp(vec![1.0; end.len()], stretch - 1.0));
        let moving = Prescribed { dofs: end.iter().map(|node| 3 * node).collect(), path };
        let young = 3.0;
        let (system, mut state) =
            body(&mesh, &neo_hookean(young, poisson), vec![], held.coordinates(&mesh, vec![moving]));
        let options = StaticOptions { increment: 0.25, largest_increment: 0.25, ..Default::default() };
        solve(&system, &mut state, options);
        let x = system.positions(&state);
        for (node, point) in mesh.points.iter().enumerate() {
            for axis in 1..3 {
                let error = x[3 * node + axis] - lateral * point[axis];
                assert!(error.abs() < 1e-10, "{element} node {node}: {error:e}");
            }
        }
        let held = reactions(&system, &state, None);
        let force: f64 = end.iter().map(|&node| held[3 * node as usize]).sum();
        assert!((force / young - stress).abs() < 1e-10, "{element}: {}", force / young);
    }
}

#[test]
fn c4_thick_cylinder_under_following_pressure() {
    // A quarter of a cylinder in plane strain, with radii from 1 to 2.
    let quarter = std::f64::consts::FRAC_PI_2;
    let mesh = mapped([1.0, quarter, 0.2], [8, 8, 1], CellKind::Hex20, |x| {
        let (sin, cos) = x[1].sin_cos();
        let clean = |v: f64| if v.abs() < 1e-14 { 0.0 } else { v };
        [clean((1.0 + x[0]) * cos), clean((1.0 + x[0]) * sin), x[2]]
    });
    let held = Held::new(&mesh).region(&mesh, "y-min", &[1]).region(&mesh, "y-max", &[0]).everywhere(2);
    let inside = Surface::of_region(&mesh, "x-min").unwrap();
    let ramp = Amplitude::expression("t").unwrap();
    let is_fixed = |node: u32| held.is_held[node as usize];
    let Pressure::Potential(loads) = pressure(&mesh, &inside, 0.097628141, &ramp, is_fixed, 0, "p") else {
        panic!("symmetry planes keep the potential")
    };
    let (system, mut state) = body(&mesh, &neo_hookean(1.0, 0.3), loads, held.coordinates(&mesh, vec![]));
    let options = StaticOptions { increment: 0.25, largest_increment: 0.25, ..Default::default() };
    solve(&system, &mut state, options);
    let x = system.positions(&state);
    let radius = |region: &str| {
        let nodes = mesh.region_nodes(region).unwrap();
        let sum: f64 = nodes.iter().map(|&n| x[3 * n as usize].hypot(x[3 * n as usize + 1])).sum();
        sum / nodes.len() as f64
    };
    let (inner, outer) = (radius("x-min"), radius("x-max"));
    assert!((inner - 1.25).abs() < 1e-5, "{inner}");
    assert!((outer - 2.166355317).abs() < 1e-5, "{outer}");
}

#[test]
fn c1_cook_membrane_linear_plane_strain() {
    // The corners are (0,0) (48,44) (48,60) (0,44). The mesh is graded towards the clamped edge and its singular
    // corners.
    let mesh = mapped([1.0, 1.0, 1.0], [24, 24, 1], CellKind::Hex20, |x| {
        let (s, t) = (x[0] * x[0], x[1] * x[1] * (3.0 - 2.0 * x[1]));
        [48.0 * s, 44.0 * s + t * (44.0 - 28.0 * s), x[2]]
    });
    let held = Held::new(&mesh).region(&mesh, "x-min", &[0, 1, 2]).everywhere(2);
    let edge = Surface::of_region(&mesh, "x-max").unwrap();
    let shear = VectorField::from([0.0, 100.0 / 16.0, 0.0]);
    let once = Amplitude::expression("t").unwrap();
    let load = DeadLoad::traction(&mesh, &edge, &shear, once, 0, "shear").unwrap();
    let law = Law::Linear(Isotropic { young: 70.0, poisson: 1.0 / 3.0, density: 1.0 });
    let (system, mut state) = body(&mesh, &law, vec![Box::new(load)], held.coordinates(&mesh, vec![]));
    solve(&system, &mut state, StaticOptions::default());
    let x = system.positions(&state);
    let middle = mesh.nearest_node([48.0, 52.0, 0.0]).unwrap() as usize;
    let v = x[3 * middle + 1] - mesh.points[middle][1];
    assert!((mesh.points[middle][1] - 52.0).abs() < 1e-12);
    assert!((v - 30.749).abs() < 0.01, "{v}");
}

#[test]
fn c2_elastica_under_a_dead_tip_load() {
    // The strip is slender and ν = 0, so that E I = E b h³/12.
    let (length, height) = (1.0, 0.01);
    let mesh = mapped([length, height, height], [40, 1, 1], CellKind::Hex20, |x| x);
    let young = 1e9;
    let bending = young * height.powi(4) / 12.0;
    let alpha = 4.0;
    let held = Held::new(&mesh).region(&mesh, "x-min", &[0, 1, 2]).everywhere(2);
    let tip = Surface::of_region(&mesh, "x-max").unwrap();
    let traction = VectorField::from([0.0, -alpha * bending / (length * length * height * height), 0.0]);
    let ramp = Amplitude::expression("t").unwrap();
    let load = DeadLoad::traction(&mesh, &tip, &traction, ramp, 0, "tip").unwrap();
    let law = Law::StVenantKirchhoff(Isotropic { young, poisson: 0.0, density: 1.0 });
    let (system, mut state) = body(&mesh, &law, vec![Box::new(load)], held.coordinates(&mesh, vec![]));
    let options = StaticOptions { increment: 0.05, largest_increment: 0.1, ..Default::default() };
    solve(&system, &mut state, options);
    let x = system.positions(&state);
    let nodes = mesh.region_nodes("x-max").unwrap();
    let mean = |axis: usize| {
        let change = |&n: &u32| x[3 * n as usize + axis] - mesh.points[n as usize][axis];
        nodes.iter().map(change).sum::<f64>() / nodes.len() as f64
    };
    assert!((-mean(0) - 0.32894124).abs() < 1e-3, "{}", mean(0));
    assert!((-mean(1) - 0.66996418).abs() < 1e-3, "{}", mean(1));
}

/// A strip bends under its own weight, which no amplitude scales (C3): Γ = 12 ρ g L³/(E h²).
#[test]
fn c3_self_weight_from_a_scene() {
    for (gamma, drop, reach) in [(1.0, 0.12347140, 0.99124640), (10.0, 0.70019972, 0.65635376)] {
        let young = 12.0 * 9810.0 / (gamma * 0.02 * 0.02);
        let scene = format!(
            r#"
            gravity = [0.0, -9.81, 0.0]
            [time]
            end = 1.0
            step = 1.0
            scheme = "implicit-midpoint"
            [static]
            [[body]]
            name = "strip"
            box = {{ size = [1.0, 0.02, 0.02], cells = [32, 1, 1], element = "hex20" }}
            material = {{ law = "st-venant-kirchhoff", young = {young}, poisson = 0.0, density = 1000.0 }}
            [[fix]]
            body = "strip"
            region = "x-min"
            [[probe]]
            name = "tip"
            body = "strip"
            point = [1.0, 0.0, 0.01]
            [[probe]]
            name = "top"
            body = "strip"
            point = [1.0, 0.02, 0.01]
            "#
        );
        let scene = variational::scene::Scene::parse(&scene, &[]).scene.unwrap();
        let mut simulation = variational::simulation::Simulation::new(scene).unwrap();
        simulation.step().unwrap();
        let probes = simulation.observe().probes;
        let middle = |k: usize| 0.5 * (probes[0].position[k] + probes[1].position[k]);
        let found = (0.01 - middle(1), middle(0));
        assert!((found.0 - drop).abs() < 1e-3 && (found.1 - reach).abs() < 1e-3, "{gamma}: {found:?}");
    }
}

/// The work that pulls a bar is booked as work of prescribed motion, that of a load that grows as work of forces, and the ledger closes.
/// With u = .01 t along the bar and a dead load F = 2 t along the motion of the pulled end, the load does ∫ F̂ u dt = −½ · 2 · .01 J by
/// its growth alone (its potential −F·u is a part of the energy), whatever the bar does.
#[test]
fn work_of_supports_and_of_loads_is_told_apart() {
    let scene = |load: &str| {
        format!(
            r#"
[time]
end = 1.0
step = 0.25
[static]
tolerance = 1e-13
[[body]]
name = "s"
box = {{ size = [0.1, 0.1, 0.05], cells = [2, 2, 2], element = "hex8" }}
material = {{ law = "linear", young = 2e5, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "s"
region = "x-min"
[[fix]]
body = "s"
region = "x-max"
motion = {{ kind = "translate", velocity = [0.01, 0.0, 0.0] }}
{load}
"#
        )
    };
    let load = |region: &str| {
        format!(
            "[[load]]\nkind = \"force\"\nbody = \"s\"\nregion = \"{region}\"\nforce = [2.0, 0.0, 0.0]\namplitude = \"t\"\n"
        )
    };
    for (load, force) in [(String::new(), Some(0.0)), (load("x-max"), Some(-0.01)), (load("y-max"), None)] {
        let program = crate::program::Program::run(&scene(&load));
        let energy = &program.report()["energy"];
        let of = |name: &str| energy[name].as_f64().unwrap_or_else(|| panic!("{name}: {energy}"));
        let scale = of("prescribed_work");
        assert!(scale > 0.1, "{energy}");
        if let Some(force) = force {
            assert!((of("force_work") - force).abs() < 1e-9 * scale, "{energy}");
        }
        // Forces are linear in the load factor, so that the quadrature of their work is exact.
        assert!(of("scheme_error").abs() < 1e-9 * scale, "{energy}");
        assert!(of("unexplained").abs() < 1e-12 * scale, "{energy}");
        let change = of("final") - of("initial");
        assert!((change - of("prescribed_work") - of("force_work")).abs() < 1e-9 * scale, "{energy}");
    }
}
