//! Tests scenes with `mass = "consistent"`: the dispersion of linear elements in closed form, exact energy and momenta,
//! equal bits, and clear errors where the mass must be lumped.

use std::f64::consts::PI;

use crate::contact::block;
use crate::program::Program;
use variational::prelude::{Observation, Scene, Simulation, settle};
use variational::scene::MassKind;
use variational::study::modes::scene_modes;

pub(super) fn simulation(scene: &str) -> Simulation {
    let parsed = Scene::parse(scene, &[]);
    assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
    Simulation::new(parsed.scene.unwrap()).unwrap()
}

/// Asserts that both momenta changed by less than the fraction `tolerance` of their largest component.
pub(super) fn assert_momenta(before: &Observation, after: &Observation, tolerance: f64, name: &str) {
    let scale = |values: &[f64; 3]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    for k in 0..3 {
        let linear = (after.momentum[k] - before.momentum[k]).abs() / scale(&before.momentum);
        let angular =
            (after.angular_momentum[k] - before.angular_momentum[k]).abs() / scale(&before.angular_momentum);
        assert!(linear < tolerance && angular < tolerance, "{name}: {linear:e} {angular:e}");
    }
}

const CELLS: usize = 8;
const STEP: f64 = 0.05;

/// Describes a bar of unit length and wave speed c = 1 with `CELLS` linear elements, held at x = 0, with an
/// initial velocity along x.
fn bar(mass: &str, scheme: &str) -> String {
    format!(
        r#"
        [time]
        end = 2.0
        step = {STEP}
        scheme = "{scheme}"
        [solver]
        tolerance = 1e-14
        mass = "{mass}"
        [[body]]
        name = "bar"
        box = {{ size = [1.0, 0.1, 0.1], cells = [{CELLS}, 1, 1], element = "hex8" }}
        material = {{ law = "linear", young = 2.0, poisson = 0.0, density = 2.0 }}
        velocity = [0.01, 0.0, 0.0]
        [[fix]]
        body = "bar"
        region = "x-min"
        [[fix]]
        body = "bar"
        box = {{ min = [0.01, -1.0, -1.0], max = [2.0, 1.0, 1.0] }}
        axes = ["y", "z"]
        "#
    )
}

/// Returns ω of mode m of that bar, discrete and exact. Linear elements of length ℓ have K = (1/ℓ)[1 −1; −1 1] and
/// M = ℓ[2 1; 1 2]/6 or ℓ[1 0; 0 1]/2. So u_j = sin κj with κ = (2m − 1)π/2n gives
/// ω² = (6/ℓ²)(1 − cos κ)/(2 + cos κ) or (2/ℓ²)(1 − cos κ). The exact ω = κ/ℓ lies between the two.
fn dispersion(mode: usize, mass: MassKind) -> (f64, f64) {
    let (kappa, n) = ((2 * mode - 1) as f64 * PI / (2 * CELLS) as f64, CELLS as f64);
    let square = match mass {
        MassKind::Consistent => 6.0 * (1.0 - kappa.cos()) / (2.0 + kappa.cos()),
        MassKind::Lumped | MassKind::Filtered => 2.0 * (1.0 - kappa.cos()),
    };
    (n * square.sqrt(), n * kappa)
}

#[test]
fn a_bar_vibrates_as_its_mass_says() {
    for (name, mass) in [("consistent", MassKind::Consistent), ("lumped", MassKind::Lumped)] {
        let mut simulation = simulation(&bar(name, "implicit-midpoint"));
        let modes = scene_modes(&mut simulation, 3, mass).unwrap().modes;
        // The modal momentum Σ sin κj p_j oscillates with phase θ per step, where tan θ/2 = ωh/2 for the midpoint rule.
        let free: Vec<u32> = simulation.components()[0].system().coordinates().free().to_vec();
        let body = &simulation.bodies()[0];
        let points = body.numbering.values(&body.mesh.points);
        let mut series = [const { Vec::new() }; 3];
        while !simulation.is_done() {
            simulation.step().unwrap();
            let p = &simulation.components()[0].state().p;
            for (m, series) in series.iter_mut().enumerate() {
                let shape = |dof: u32| ((2 * m + 1) as f64 * 0.5 * PI * points[dof as usize / 3][0]).sin();
                series.push(free.iter().zip(p).map(|(&dof, p)| shape(dof) * p).sum::<f64>());
            }
        }
        for (m, series) in series.iter().enumerate() {
            let (omega, exact) = dispersion(m + 1, mass);
            assert!(if name == "lumped" { omega < exact } else { omega > exact });
            let found = modes[m].mode.omega_squared.sqrt();
            assert!((found - omega).abs() < 1e-9 * omega, "{name} {m}: {found} {omega}");
            let theta = 2.0 * (0.5 * omega * STEP).atan();
            let largest = series.iter().fold(0.0_f64, |most, p| most.max(p.abs()));
            for three in series.windows(3) {
                let left = three[0] + three[2] - 2.0 * theta.cos() * three[1];
                assert!(left.abs() < 1e-10 * largest, "{name} {m}: {left:e} of {largest:e}");
            }
        }
    }
}

#[test]
fn linear_bars_keep_their_energy_to_round_off() {
    for scheme in ["implicit-midpoint", "gauss", "energy-momentum"] {
        let mut simulation = simulation(&bar("consistent", scheme));
        let before = simulation.observe();
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let after = simulation.observe();
        assert!(before.kinetic > 0.0 && after.elastic > 0.0);
        let change = (after.total() - before.total()).abs() / before.total();
        assert!(change < 1e-12, "{scheme}: {change:e}");
        // Solving M v = p takes few iterations, because each solve starts from the velocities that the step ends with.
        let work = simulation.work();
        assert!(work.mass_iterations > 0 && work.mass_iterations < 2 * work.steps + 40, "{work:?}");
    }
}

const FREE: &str = r#"
    [time]
    end = 0.2
    step = 0.005
    scheme = "SCHEME"
    [solver]
    tolerance = 1e-14
    mass = "consistent"
    [[body]]
    name = "block"
    box = { size = [1.0, 0.5, 0.25], cells = [2, 1, 1], element = "ELEMENT" }
    material = { law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }
    velocity = [1.0, -0.5, 2.0]
    angular_velocity = [4.0, -3.0, 2.0]
    [[body]]
    name = "cloth"
    sheet = { size = [0.6, 0.4], cells = [3, 2], origin = [0.0, 0.0, 1.0] }
    material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, density = 500.0, thickness = 1e-3 }
    angular_velocity = [1.0, 2.0, 3.0]
"#;

#[test]
fn free_bodies_of_every_kind_keep_their_momenta() {
    for (scheme, element) in [
        ("implicit-midpoint", "tet4"),
        ("implicit-midpoint", "tet10"),
        ("gauss", "hex8"),
        ("implicit-midpoint", "hex20"),
        ("energy-momentum", "hex27"),
        ("gauss", "wedge15"),
        ("implicit-midpoint", "wedge18"),
        ("energy-momentum", "wedge6"),
    ] {
        let mut simulation = simulation(&FREE.replace("SCHEME", scheme).replace("ELEMENT", element));
        let before = simulation.observe();
        // In rigid motion the kinetic energy of the block is ½ m v² + ½ ω·Iω, and that of the cloth is ½ ω·Iω.
        let (m, v, w) = (125.0_f64, [1.0, -0.5, 2.0_f64], [4.0, -3.0, 2.0_f64]);
        let square = [1.0, 0.25, 0.0625];
        let inertia = [0, 1, 2].map(|k| m / 12.0 * (square.iter().sum::<f64>() - square[k]));
        let plate = 0.12 / 12.0 * (0.16 * 1.0 + 0.36 * 4.0 + 0.52 * 9.0);
        let kinetic =
            0.5 * (0..3).map(|k| m * v[k] * v[k] + inertia[k] * w[k] * w[k]).sum::<f64>() + 0.5 * plate;
        assert!((before.kinetic - kinetic).abs() < 1e-12 * kinetic, "{element}: {}", before.kinetic);
        for k in 0..3 {
            assert!((before.momentum[k] - m * v[k]).abs() < 1e-11 * m, "{element}: {:?}", before.momentum);
        }
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let after = simulation.observe();
        assert_momenta(&before, &after, 1e-12, &format!("{scheme} {element}"));
    }
}

/// A body in free fall keeps its shape, because the weight acts on the same mass matrix as the inertia.
#[test]
fn free_fall_keeps_the_shape() {
    for element in ["tet10", "hex20"] {
        let scene = FREE
            .replace("SCHEME", "implicit-midpoint")
            .replace("ELEMENT", element)
            .replace("angular_velocity = [4.0, -3.0, 2.0]", "")
            .replace("angular_velocity = [1.0, 2.0, 3.0]", "");
        let mut simulation = simulation(&format!("gravity = [0.0, 0.0, -9.81]\n{scene}"));
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let t: f64 = 0.2;
        let fallen = [1.0 * t, -0.5 * t, 2.0 * t - 0.5 * 9.81 * t * t];
        for (x, rest) in simulation.positions(0).iter().zip(&simulation.bodies()[0].mesh.points) {
            for k in 0..3 {
                assert!((x[k] - rest[k] - fallen[k]).abs() < 1e-12, "{element}: {x:?} {rest:?}");
            }
        }
    }
}

/// The reactions satisfy Σ reactions = dP/dt − weight, with P the momentum of all nodes.
#[test]
fn reactions_balance_weight_and_inertia() {
    let scene = format!(
        "gravity = [0.0, 0.0, -9.81]\n{}\n[[fix]]\nbody = \"block\"\nregion = \"x-min\"\n",
        FREE.replace("SCHEME", "implicit-midpoint")
            .replace("ELEMENT", "hex8")
            .replace("angular_velocity", "velocity")
    );
    let scene =
        scene.replacen("velocity = [4.0, -3.0, 2.0]", "", 1).replace("velocity = [1.0, 2.0, 3.0]", "");
    let mut simulation = simulation(&scene);
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let (accelerations, reactions) = (simulation.accelerations(0), simulation.reactions(0));
    // Each node's share of the total momentum is its row sum of the mass matrix, which is the lumped mass of hex8.
    let body = &simulation.bodies()[0];
    let system = simulation.components()[body.component].system();
    let mass = |node: usize| system.mass()[3 * body.node(node)];
    for k in 0..3 {
        let rate: f64 = accelerations.iter().enumerate().map(|(node, a)| mass(node) * a[k]).sum();
        let weight = [0.0, 0.0, -9.81 * 125.0][k];
        let held: f64 = reactions.iter().map(|force| force[k]).sum();
        assert!((held + weight - rate).abs() < 1e-8 * 1226.0, "{k}: {held} {weight} {rate}");
    }
}

#[test]
fn threads_do_not_change_the_bits() {
    let scene = FREE
        .replace("SCHEME", "implicit-midpoint")
        .replace("ELEMENT", "tet10")
        .replace("[2, 1, 1]", "[8, 6, 4]");
    let scene = scene.replace("1e-14", "1e-6").replace("end = 0.2", "end = 0.05");
    let scene = scene + "[output]\ninterval = 0.025\nfields = [\"displacement\", \"velocity\"]\n";
    Program::assert_same_on_threads(&scene);
}

#[test]
fn auto_chooses_among_implicit_schemes() {
    let scene = bar("consistent", "auto")
        .replace("tolerance = 1e-14", "")
        .replace("end = 2.0", "end = 2.0\ntolerance = 1e-3");
    let scene = Scene::parse(&scene, &[]).scene.unwrap();
    let refused = Simulation::new(scene.clone()).err().unwrap();
    assert!(refused[0].to_string().contains("auto::settle"), "{refused:?}");
    let (settled, auto) = settle(scene, &mut ()).unwrap();
    assert!(!settled.time.method().unwrap().facts().is_explicit);
    let reason = auto.unwrap().reason;
    assert!(reason.contains("consistent"), "{reason}");
}

#[test]
fn what_needs_lumped_mass_says_so() {
    let explicit = bar("consistent", "stormer-verlet");
    for program in [Program::check(&explicit), Program::try_run(&explicit, &[])] {
        assert_eq!(program.output.status.code(), Some(2));
        let said = program.errors();
        assert!(said.contains("solver.mass") && said.contains("implicit-midpoint"), "{said}");
    }
    let moving = bar("consistent", "implicit-midpoint").replace(
        "region = \"x-min\"",
        "region = \"x-min\"\nmotion = { kind = \"sine\", amplitude = [0.1, 0.0, 0.0], frequency = 1.0 }",
    );
    let rigid = format!(
        "{}\n[[rigid]]\nname = \"ball\"\nshape = {{ kind = \"sphere\", radius = 0.1 }}\nmass = 1.0\n[[attach]]\nbody = \"bar\"\n\
         region = \"x-max\"\nto = \"ball\"\n",
        bar("consistent", "implicit-midpoint").replace("max = [2.0, 1.0, 1.0]", "max = [0.9, 1.0, 1.0]")
    );
    for (scene, word) in [(moving, "moves"), (rigid, "rigid")] {
        let program = Program::try_run(&scene, &[]);
        let said = program.errors();
        assert!(program.output.status.code() == Some(2) && said.contains("solver.mass"), "{said}");
        assert!(said.contains(word) && said.contains("lumped"), "{said}");
    }
}

/// Rayleigh's drag −α M v slows a body in uniform motion as a whole: v falls by (1 − αh/2)/(1 + αh/2) in a step of the midpoint rule,
/// and the body is not strained.
#[test]
fn drag_does_not_strain_a_body_in_uniform_motion() {
    for (element, order) in [("hex8", 1), ("hex8", 2), ("tet4", 2)] {
        let mut simulation = simulation(&format!(
            r#"
            [time]
            end = 0.02
            step = 0.002
            scheme = "implicit-midpoint"
            [solver]
            tolerance = 1e-14
            mass = "consistent"
            [damping]
            mass_rate = 4.0
            [[body]]
            name = "b"
            box = {{ size = [1.0, 0.2, 0.2], cells = [2, 1, 1], element = "{element}" }}
            order = {order}
            material = {{ law = "neo-hookean", young = 1e5, poisson = 0.3, density = 1000.0 }}
            velocity = [1.0, 0.0, 0.0]
            "#
        ));
        let before = simulation.observe();
        for _ in 0..10 {
            simulation.advance(1).unwrap();
        }
        let after = simulation.observe();
        let factor = ((1.0 - 0.004) / (1.0 + 0.004_f64)).powi(10);
        let slowed = after.momentum[0] / before.momentum[0];
        assert!((slowed / factor - 1.0).abs() < 1e-12, "{element} {order}: {slowed} instead of {factor}");
        assert!(after.elastic < 1e-18 * before.kinetic, "{element} {order}: {} J", after.elastic);
    }
}

/// Complete tangents of steps with contact contain the mass matrix.
#[test]
fn a_block_with_consistent_mass_slides_on_a_floor_and_keeps_its_energy() {
    let scene = block("energy-momentum", "friction = 0.3")
        .replace("[solver]", "[solver]\nmass = \"consistent\"")
        .replace("name = \"block\"", "name = \"block\"\nvelocity = [1.0, 0.0, 0.0]");
    let history = Program::run(&scene).history();
    assert!(history.imbalance() < 1e-9, "{:e}", history.imbalance());
    assert!(history.column("friction").last().unwrap() < &-1e-3, "the block does not slide");
}
