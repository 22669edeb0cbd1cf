//! What the program says of itself must hold: the recommended combination reaches its error when it is run
//! again, `auto` holds the tolerance, an estimated error covers the true one, and what is said to be
//! skipped is not in the work counts.

use std::time::Duration;

use variational::auto;
use variational::bench::{BenchOptions, bench, recommended_scene};
use variational::estimate::Estimator;
use variational::explain::explain;
use variational::prelude::*;
use variational::trial::{self, Choice, Limit, Norm};

const SOFT: Isotropic = Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 };
const LONG: Limit = Limit::Clock(Duration::from_secs(3600));

/// The cantilever block P1 with n = 1 or 2 cells across.
fn cantilever(n: u32, time: Time, law: Law) -> Scene {
    let mesh = BoxMesh {
        size: [1.0, 0.25, 0.25],
        cells: [4 * n, n, n],
        element: ElementKind::Tet4,
        origin: [0.0; 3],
    };
    let tip = Probe::at("tip", "block", [1.0, 0.0, 0.0]);
    Scene::new(time)
        .gravity([0.0, -9.81, 0.0])
        .body(Body::from_box("block", mesh, law))
        .fix(Fix::region("block", "x-min"))
        .probe(tip)
}

fn exact(scene: &Scene) -> Vec<Vec<f64>> {
    let choice = Choice { scheme: SchemeName::BlanesMoan6, stages: None, steps: 8000 };
    trial::run(choice.apply(scene), 1.0, LONG, &mut || true).unwrap().end
}

fn error_of(scene: &Scene, exact: &[Vec<f64>]) -> f64 {
    let simulation = Simulation::new(scene.clone()).unwrap();
    let end = trial::run(simulation.scene().clone(), 1.0, LONG, &mut || true).unwrap().end;
    Norm::new(&simulation).error(&end, exact)
}

#[test]
fn the_recommended_combination_reaches_its_error_again() {
    let time = Time::new(0.5, 0.02, SchemeName::ImplicitMidpoint);
    let scene = cantilever(1, time, Law::NeoHookean(SOFT));
    let options = BenchOptions { budget: Duration::from_secs(6), accuracy: Some(1e-3), schemes: Vec::new() };
    let report = bench(&scene, &options, &mut ()).unwrap();
    assert!(report.reference.difference < 1e-7, "{:?}", report.reference);
    let recommended = recommended_scene(&report, &scene).unwrap();
    let error = error_of(&recommended, &exact(&scene));
    assert!(error <= 1e-3, "{}: {error:e}", report.recommendation);
    let row = &report.rows[report.recommended.unwrap()];
    assert!((error / row.error.unwrap() - 1.0).abs() < 1e-2, "{error:e} is not the error of {row:?}");
    let cheaper = report.rows.iter().filter(|other| other.error.is_some_and(|error| error <= 1e-3));
    assert!(cheaper.into_iter().all(|other| other.seconds >= row.seconds));
    assert!(report.rows[0].is_present);
    assert!(report.csv().lines().count() == report.rows.len() + 1);
    assert!(report.chart("P1").ends_with("</svg>\n"));
}

#[test]
fn a_combination_that_fails_is_a_row() {
    // Ten times above the stability limit.
    let time = Time::new(0.5, 0.02, SchemeName::StormerVerlet);
    let scene = cantilever(1, time, Law::NeoHookean(SOFT));
    let options = BenchOptions {
        budget: Duration::from_secs(3),
        accuracy: Some(1e-2),
        schemes: vec!["stormer-verlet".to_owned()],
    };
    let report = bench(&scene, &options, &mut ()).unwrap();
    assert!(report.rows[0].is_present);
    assert!(report.rows[0].failure.is_some() || report.rows[0].error.unwrap() > 1.0);
    assert!(report.recommended.is_some(), "{}", report.recommendation);
}

#[test]
fn auto_holds_its_tolerance() {
    for law in [Law::NeoHookean(SOFT), Law::StVenantKirchhoff(SOFT)] {
        let end = exact(&cantilever(2, Time::new(1.0, 0.5, SchemeName::BlanesMoan6), law.clone()));
        for tolerance in [1e-2, 1e-4, 1e-6] {
            let scene = cantilever(2, Time::auto(1.0, tolerance), law.clone());
            let (settled, choice, report) = auto::choose(&scene).unwrap();
            let error = error_of(&settled, &end);
            assert!(error <= 3.0 * tolerance, "{choice:?}: {error:e}; {}", report.reason);
        }
    }
}

#[test]
fn an_estimate_covers_the_error_and_shows_the_order() {
    for (scheme, steps) in [(SchemeName::StormerVerlet, 800), (SchemeName::ImplicitMidpoint, 200)] {
        let mut scene = cantilever(1, Time::new(0.5, 0.5 / f64::from(steps), scheme), Law::NeoHookean(SOFT));
        scene.solver.tolerance = 1e-10;
        let mut fine = Simulation::new(
            Choice { scheme: SchemeName::BlanesMoan6, stages: None, steps: 4000 }.apply(&scene),
        )
        .unwrap();
        let mut simulation = Simulation::new(scene).unwrap();
        let mut estimator = Estimator::new(&simulation);
        for simulation in [&mut fine, &mut simulation] {
            while !simulation.is_done() {
                simulation.step().unwrap();
            }
        }
        let probes = simulation.observe().probes;
        let estimate = estimator.compare(simulation.steps(), &probes).unwrap()[0];
        let truth = fine.observe().probes[0].displacement;
        for k in 0..3 {
            let error = (probes[0].displacement[k] - truth[k]).abs();
            assert!(
                (0.5 * error..3.0 * error + 1e-9).contains(&estimate.error[k]),
                "{scheme:?} {k}: {error:e} {estimate:?}"
            );
        }
        assert!((1.6..2.4).contains(&estimate.observed_order.unwrap()), "{scheme:?}: {estimate:?}");
    }
}

#[test]
fn what_is_explained_as_skipped_is_not_in_the_counts() {
    let explicit = cantilever(1, Time::new(0.1, 1e-3, SchemeName::StormerVerlet), Law::NeoHookean(SOFT));
    let mut simulation = Simulation::new(explicit).unwrap();
    let text = explain(&simulation);
    assert!(text.contains("skipped: Hessian, sparsity pattern, ordering and factor"), "{text}");
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let work = simulation.work();
    assert_eq!((work.hessians, work.factorizations, work.solves), (0, 0, 0));

    let linear = cantilever(1, Time::new(0.1, 1e-3, SchemeName::ImplicitMidpoint), Law::Linear(SOFT));
    let mut simulation = Simulation::new(linear).unwrap();
    let text = explain(&simulation);
    assert!(text.contains("Hessian made once (quadratic)"), "{text}");
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let work = simulation.work();
    assert_eq!((work.hessians, work.factorizations), (1, 1));
}
