//! Tests how other programs use a simulation: they set its state between steps, transfer it as bytes, and supply
//! their own laws. The energy ledger accounts for all of it.

use variational::core::lagrange::Scalar;
use variational::fem::{EnergyDensity, OwnLaw};
use variational::mesh::{CellBlock, Mesh};
use variational::prelude::*;
use variational::simulation::Snapshot;

fn cube(scheme: SchemeName, material: impl Into<variational::scene::Substance>) -> Simulation {
    let shape = BoxMesh { size: [0.2; 3], cells: [2; 3], element: CellKind::Tet4, origin: [0.0; 3] };
    let mut scene = Scene::new(Time::new(0.05, 1e-3, scheme)).body(Body::from_box("cube", shape, material));
    scene.output.ledger = Some(true);
    Simulation::new(scene).unwrap()
}

fn rubber() -> Law {
    Law::NeoHookean(Isotropic { young: 1e5, poisson: 0.3, density: 1000.0 })
}

/// Steps to the end and returns the sum of the booked work (J).
fn work(simulation: &mut Simulation) -> f64 {
    let mut work = 0.0;
    while !simulation.is_done() {
        work += simulation.step().unwrap().energy.total();
    }
    work
}

/// Checks that the next step books the energy that `change` adds. A snapshot taken in between and restored elsewhere
/// from bytes books it too, and both simulations end with the same bits.
fn books(change: impl Fn(&mut Simulation)) {
    for scheme in [SchemeName::StormerVerlet, SchemeName::ImplicitMidpoint, SchemeName::EnergyMomentum] {
        let mut here = cube(scheme, rubber());
        for _ in 0..10 {
            here.step().unwrap();
        }
        let before = here.observe().total();
        change(&mut here);
        let given = here.observe().total() - before;
        assert!(given > 1e-3, "{scheme:?}: {given}");
        let bytes = here.snapshot().to_bytes();
        let mut there = cube(scheme, rubber());
        there.restore(&Snapshot::from_bytes(&bytes).unwrap()).unwrap();
        for simulation in [&mut here, &mut there] {
            let told = work(simulation);
            let gained = simulation.observe().total() - before;
            assert!((told - gained).abs() < 1e-10 * given, "{scheme:?}: {told:e} J of {gained:e} J");
        }
        assert_eq!(here.components()[0].state(), there.components()[0].state(), "{scheme:?}");
    }
}

#[test]
fn motion_that_is_set_is_booked_and_kept_by_snapshots() {
    books(|simulation| {
        let (mut x, mut v) = (simulation.positions(0), simulation.velocities(0));
        x.iter_mut().for_each(|x| x[0] *= 1.05);
        v.iter_mut().for_each(|v| v[1] += 0.3);
        simulation.set_motion(0, &x, &v).unwrap();
    });
}

#[test]
fn states_that_are_set_are_booked_and_kept_by_snapshots() {
    books(|simulation| {
        let state = simulation.components()[0].state().clone();
        let q: Vec<f64> = state.q.iter().map(|q| 1.02 * q).collect();
        let p: Vec<f64> = state.p.iter().map(|p| p + 1e-2).collect();
        simulation.set_state(0, &q, &p).unwrap();
        let wrong = simulation.set_state(0, &q[1..], &p).unwrap_err();
        assert!(wrong.to_string().contains("coordinates"), "{wrong}");
    });
}

#[test]
fn bytes_that_are_no_snapshot_are_refused() {
    let mut bytes = cube(SchemeName::StormerVerlet, rubber()).snapshot().to_bytes();
    let at = bytes.len() / 2;
    bytes[at] ^= 1;
    assert!(Snapshot::from_bytes(&bytes).is_err());
    assert!(Snapshot::from_bytes(&bytes[..at]).is_err());
    assert!(Snapshot::from_bytes(&[]).is_err());
}

/// The law of `rubber`: Ψ = μ/2 (I₁ − 3 − 2 ln J) + λ/2 ln²J.
struct Rubber;

impl EnergyDensity for Rubber {
    fn density(&self) -> f64 {
        1000.0
    }
    fn energy<D: Scalar>(&self, f: &[[D; 3]; 3]) -> D {
        let (lambda, mu) = (1e5 * 0.3 / (1.3 * 0.4), 1e5 / 2.6);
        let minor = |a: usize, b: usize| f[1][a] * f[2][b] - f[1][b] * f[2][a];
        let log_j = (f[0][0] * minor(1, 2) - f[0][1] * minor(0, 2) + f[0][2] * minor(0, 1)).ln();
        let squares = f.as_flattened().iter().map(|&entry| entry * entry);
        let sum = squares.reduce(|sum, square| sum + square).unwrap();
        (sum - 3.0 - log_j * 2.0) * (0.5 * mu) + log_j * log_j * (0.5 * lambda)
    }
}

/// A body with a law from another crate moves like one with the equal registered law, up to the growth of round-off,
/// and has the same stresses.
#[test]
fn a_law_from_outside_moves_as_the_registered_one() {
    for scheme in [SchemeName::StormerVerlet, SchemeName::EnergyMomentum] {
        let mut pair = [cube(scheme, OwnLaw::from_energy("rubber", Rubber)), cube(scheme, rubber())];
        for simulation in &mut pair {
            let mut x = simulation.positions(0);
            x.iter_mut().for_each(|x| x[2] *= 1.2);
            let v = simulation.velocities(0);
            simulation.set_motion(0, &x, &v).unwrap();
            work(simulation);
        }
        let [own, registered] = pair.map(|simulation| {
            let stress = simulation.element_values(0, variational::fem::ElementField::VonMises);
            (simulation.positions(0), stress)
        });
        let apart = own.0.as_flattened().iter().zip(registered.0.as_flattened());
        let apart = apart.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        assert!(apart < 1e-9, "{scheme:?}: {apart:e} m");
        let largest = registered.1.iter().fold(0.0_f64, |most, &value| most.max(value));
        let off = own.1.iter().zip(&registered.1).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        assert!(off < 1e-6 * largest, "{scheme:?}: {off:e} of {largest:e} Pa");
    }
}

/// A run writes the name of a law from another crate into its report.
#[test]
fn a_run_with_a_law_from_outside_reports_it() {
    let shape = BoxMesh { size: [0.2; 3], cells: [1; 3], element: CellKind::Hex8, origin: [0.0; 3] };
    let scene = Scene::new(Time::new(0.01, 1e-3, SchemeName::StormerVerlet))
        .body(Body::from_box("cube", shape, OwnLaw::from_energy("rubber", Rubber)))
        .checkpoint(Checkpoints::every(5e-3));
    let place = tempfile::tempdir().unwrap();
    let report = run(scene, "own", place.path(), &mut ()).unwrap();
    assert_eq!(report.steps, 10);
    let text = std::fs::read_to_string(place.path().join("report.json")).unwrap();
    assert!(text.contains(r#""law": "own""#) && text.contains(r#""name": "rubber""#), "{text}");
}

/// A tetrahedron and a sheet of two oppositely oriented triangles are made from arrays. They move freely, and are
/// scaled, moved and reoriented like meshes from files.
#[test]
fn bodies_are_made_from_arrays() {
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let cells = |kind, nodes: &[u32]| CellBlock { kind, nodes: nodes.to_vec() };
    let blocks = vec![cells(CellKind::Tet4, &[0, 1, 2, 3]), cells(CellKind::Tri3, &[0, 2, 1])];
    let solid = Mesh::from_arrays(points.clone(), blocks).unwrap().with_region("floor", &[1]).unwrap();
    let blocks = vec![cells(CellKind::Tri3, &[0, 1, 2, 1, 2, 3])];
    let sheet = Mesh::from_arrays(points.clone(), blocks).unwrap();
    let scene = |solid: Mesh| {
        let mut body = Body::from_arrays("solid", solid, rubber()).translate([2.0, 0.0, 0.0]);
        body.scale = Some(0.1);
        Scene::new(Time::new(0.01, 1e-3, SchemeName::StormerVerlet))
            .body(body)
            .body(Body::from_arrays("sheet", sheet.clone(), SheetLaw::examples().remove(0)))
            .fix(Fix::region("solid", "floor"))
            .checkpoint(Checkpoints::every(5e-3))
    };
    let simulation = Simulation::new(scene(solid.clone())).unwrap();
    assert_eq!(simulation.positions(0)[1], [2.1, 0.0, 0.0]);
    assert_eq!(simulation.fixed_nodes().next().unwrap().1.nodes, [0, 1, 2]);
    assert!(simulation.notes().iter().any(|note| note.starts_with("sheet: ")), "{:?}", simulation.notes());
    let mut both = scene(solid.clone());
    both.bodies[0].mesh = Some("other.msh".into());
    assert!(both.problems()[0].message.contains("from arrays"), "{:?}", both.problems());

    let place = tempfile::tempdir().unwrap();
    run(scene(solid.clone()), "arrays", place.path(), &mut ()).unwrap();
    let found = variational::run::checkpoint::newest(place.path()).unwrap().checkpoint;
    variational::run::resume(scene(solid.clone()), &found, place.path(), &mut ()).unwrap();
    let mut other = solid;
    other.points[3][2] = 1.5;
    let error = variational::run::resume(scene(other), &found, place.path(), &mut ()).unwrap_err();
    assert!(error.to_string().contains("arrays of body 'solid'"), "{error}");
}
