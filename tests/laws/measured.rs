//! What the program reports about itself holds: the recommended combination reaches its error when it is run again,
//! `auto` keeps the tolerance, an estimated error covers the true one, and work that is reported as skipped is absent
//! from the work counts.

use std::time::Duration;

use variational::auto::trial::{self, Choice, Limit, Norm};
use variational::prelude::*;
use variational::run::ProbeEstimate;
use variational::run::estimate::Estimator;
use variational::run::explain::explain;
use variational::study::bench::{BenchOptions, bench, recommended_scene};

const SOFT: Isotropic = Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 };
const LONG: Limit = Limit::Clock(Duration::from_secs(3600));

/// Describes the cantilever block P1 with n = 1 or 2 cells across.
fn cantilever(n: u32, time: Time, law: Law) -> Scene {
    let mesh =
        BoxMesh { size: [1.0, 0.25, 0.25], cells: [4 * n, n, n], element: CellKind::Tet4, origin: [0.0; 3] };
    let tip = Probe::at("tip", "block", [1.0, 0.0, 0.0]);
    Scene::new(time)
        .gravity([0.0, -9.81, 0.0])
        .body(Body::from_box("block", mesh, law))
        .fix(Fix::region("block", "x-min"))
        .probe(tip)
}

fn exact(scene: &Scene) -> Vec<Vec<f64>> {
    let choice = Choice { scheme: SchemeName::BlanesMoan6, stages: None, steps: 8000 };
    trial::run(choice.apply(scene), 0.0..1.0, LONG, &mut || true).unwrap().end
}

fn error_of(scene: &Scene, exact: &[Vec<f64>]) -> f64 {
    let simulation = Simulation::new(scene.clone()).unwrap();
    let end = trial::run(simulation.scene().clone(), 0.0..1.0, LONG, &mut || true).unwrap().end;
    Norm::new(&simulation).error(&end, exact)
}

#[test]
fn the_recommended_combination_reaches_its_error_again() {
    let time = Time::new(0.5, 0.02, SchemeName::ImplicitMidpoint);
    let scene = cantilever(1, time, Law::NeoHookean(SOFT));
    let options =
        BenchOptions { budget: Duration::from_secs(6), accuracy: Some(1e-3), ..BenchOptions::default() };
    let report = bench(&scene, &options, &mut ()).unwrap();
    assert!(report.reference.difference < 1e-7, "{:?}", report.reference);
    let recommended = recommended_scene(&report, &scene).unwrap();
    let error = error_of(&recommended, &exact(&scene));
    assert!(error <= 1e-3, "{}: {error:e}", report.recommendation);
    let row = &report.rows[report.recommended.unwrap()];
    assert!((error / row.error.unwrap() - 1.0).abs() < 1e-2, "{error:e} is not the error of {row:?}");
    let cheaper = report.rows.iter().filter(|other| other.error.is_some_and(|error| error <= 1e-3));
    assert!(cheaper.into_iter().all(|other| other.cost(report.ranked_by) >= row.cost(report.ranked_by)));
    assert!(report.rows[0].is_present);
    // The ladders go far beyond a tenth of the error.
    let tenth = report.tenth.as_ref().unwrap();
    let reached =
        report.rows.iter().find(|row| row.scheme == tenth.scheme && row.steps == tenth.steps).unwrap();
    assert!(tenth.is_measured && reached.error.unwrap() <= 1e-4, "{tenth:?}");
    assert!(report.table().contains("a tenth of the error, 1e-4, would take"), "{}", report.table());
    let csv = report.csv();
    assert!(csv.lines().count() == report.rows.len() + 1);
    let mut heads: Vec<_> = csv.lines().next().unwrap().split(',').collect();
    let count = heads.len();
    heads.sort_unstable();
    heads.dedup();
    assert_eq!(heads.len(), count, "two columns have one name: {heads:?}");
    assert!(report.chart("P1").ends_with("</svg>\n"));
}

#[test]
fn a_combination_that_fails_is_a_row() {
    // This step is ten times above the stability limit.
    let time = Time::new(0.5, 0.02, SchemeName::StormerVerlet);
    let scene = cantilever(1, time, Law::NeoHookean(SOFT));
    let options = BenchOptions {
        budget: Duration::from_secs(3),
        accuracy: Some(1e-2),
        schemes: vec!["stormer-verlet".to_owned()],
        ..BenchOptions::default()
    };
    let report = bench(&scene, &options, &mut ()).unwrap();
    assert!(report.rows[0].is_present);
    assert!(report.rows[0].failure.is_some() || report.rows[0].error.unwrap() > 1.0);
    assert!(report.recommended.is_some(), "{}", report.recommendation);
}

/// A scheme that refuses the scene is one row, whatever the step.
#[test]
fn a_scheme_that_refuses_is_one_row() {
    let damping = Damping { mass_rate: 1.0, ..Damping::default() };
    let time = Time::new(0.1, 0.01, SchemeName::ImplicitMidpoint);
    let scene = cantilever(1, time, Law::NeoHookean(SOFT)).damping(damping);
    let schemes = ["blanes-moan-4", "blanes-moan-6", "implicit-midpoint"].map(str::to_owned).to_vec();
    let options = BenchOptions { budget: Duration::from_secs(1), schemes, ..BenchOptions::default() };
    let report = bench(&scene, &options, &mut ()).unwrap();
    for scheme in ["blanes-moan-4", "blanes-moan-6"] {
        let rows: Vec<_> = report.rows.iter().filter(|row| row.scheme == scheme).collect();
        assert_eq!(rows.len(), 1, "{}", report.table());
        assert!(rows[0].failure.as_ref().unwrap().contains("depends on velocity"), "{}", report.table());
    }
    assert!(report.rows.iter().filter(|row| row.scheme == "implicit-midpoint").count() > 2);
}

#[test]
fn auto_holds_its_tolerance() {
    for law in [Law::NeoHookean(SOFT), Law::StVenantKirchhoff(SOFT)] {
        let end = exact(&cantilever(2, Time::new(1.0, 0.5, SchemeName::BlanesMoan6), law.clone()));
        for tolerance in [1e-2, 1e-4, 1e-6] {
            let scene = cantilever(2, Time::auto(1.0, tolerance), law.clone());
            let (settled, auto) = settle(scene, &mut ()).unwrap();
            let error = error_of(&settled, &end);
            let auto = auto.unwrap();
            println!("{error:.2e} {:?} {}", auto.warning, auto.reason);
            assert!(error <= tolerance, "{error:e}; {}", auto.reason);
            assert!(auto.warning.is_none(), "{:?}", auto.warning);
        }
    }
}

/// `auto` says what a tenth of the error would cost: within a factor of 2 of what `auto` then spends, and the predicted
/// steps reach that error.
#[test]
fn a_tenth_of_the_error_costs_what_auto_predicts() {
    let law = Law::NeoHookean(SOFT);
    let end = exact(&cantilever(2, Time::new(1.0, 0.5, SchemeName::BlanesMoan6), law.clone()));
    for tolerance in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        let scene = |tolerance| cantilever(2, Time::auto(1.0, tolerance), law.clone());
        let report = settle(scene(tolerance), &mut ()).unwrap().1.unwrap();
        let tenth = report.tenth.unwrap();
        let (settled, _) = settle(scene(0.1 * tolerance), &mut ()).unwrap();
        let run = |scene: Scene| trial::run(scene, 0.0..1.0, LONG, &mut || true).unwrap();
        let spent = run(settled.clone());
        let ratio = tenth.predicted_seconds / spent.counted_seconds;
        println!("{tolerance:e}: {ratio:.2} {tenth:?} {:?}", Choice::of(&settled));
        assert!((0.5..=2.0).contains(&ratio), "{tolerance:e}: {ratio} {tenth:?} {:?}", Choice::of(&settled));
        if tenth.choice.scheme == settled.time.scheme.unwrap() {
            let ratio = tenth.steps as f64 / spent.work.steps as f64;
            assert!((0.5..=2.0).contains(&ratio), "{tolerance:e}: {ratio} {tenth:?}");
        }
        let error = error_of(&tenth.choice.apply(&settled), &end);
        assert!(error <= 0.1 * tolerance, "{tolerance:e}: {error:e} {tenth:?}");
        assert!(report.reason.contains("A tenth of the error would cost about"), "{}", report.reason);
    }
}

/// Runs a scene to its end and returns it with the error estimate there.
fn estimated(scene: &Scene) -> (Simulation, ProbeEstimate) {
    let mut simulation = Simulation::new(scene.clone()).unwrap();
    let mut estimator = Estimator::new(&simulation);
    assert!(estimator.notes().is_empty(), "{:?}", estimator.notes());
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let probes = simulation.observe().probes;
    let estimate = estimator.compare(simulation.steps(), &probes).unwrap()[0];
    (simulation, estimate)
}

/// For every scheme the estimated error is 0.3 to 3 times the true one, and the order shown by the estimate is that of
/// the scheme.
#[test]
fn every_scheme_estimates_its_own_error() {
    let size = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let scene = |choice: Choice, tolerance: f64| {
        let mut scene = cantilever(1, Time::new(0.25, 0.01, SchemeName::BlanesMoan6), Law::NeoHookean(SOFT));
        scene.solver.tolerance = tolerance;
        choice.apply(&scene)
    };
    let gauss = |stages| (SchemeName::Gauss, Some(stages));
    let plain = |scheme| (scheme, None);
    let reference = Choice { scheme: SchemeName::BlanesMoan6, stages: None, steps: 4000 };
    let truth = {
        let mut fine = Simulation::new(scene(reference, 1e-12)).unwrap();
        while !fine.is_done() {
            fine.advance(u64::MAX).unwrap();
        }
        fine.observe().probes[0].displacement
    };
    for ((scheme, stages), steps) in [
        (plain(SchemeName::SymplecticEulerA), 800),
        (plain(SchemeName::SymplecticEulerB), 800),
        (plain(SchemeName::StormerVerlet), 400),
        (plain(SchemeName::BlanesMoan4), 150),
        (plain(SchemeName::BlanesMoan6), 120),
        (plain(SchemeName::ImplicitMidpoint), 200),
        (gauss(1), 200),
        (gauss(2), 100),
        (gauss(3), 64),
        (gauss(4), 64),
        (gauss(5), 50),
        (plain(SchemeName::EnergyMomentum), 200),
        (plain(SchemeName::ForwardEuler), 20_000),
        (plain(SchemeName::BackwardEuler), 1600),
        (plain(SchemeName::Bdf2), 400),
        (plain(SchemeName::Newmark), 200),
        (plain(SchemeName::GeneralizedAlpha), 200),
    ] {
        let choice = Choice { scheme, stages, steps };
        // At its usual tolerance the error of the solver is part of the error of high-order schemes.
        for tolerance in [1e-12, 1e-6] {
            let (mut simulation, estimate) = estimated(&scene(choice, tolerance));
            let found = simulation.observe().probes[0].displacement;
            let error = std::array::from_fn(|k| found[k] - truth[k]);
            let ratio = size(estimate.error) / size(error);
            assert!((0.3..3.0).contains(&ratio), "{}: {error:?}, {estimate:?}", choice.label());
            if tolerance == 1e-12 {
                let (seen, formal) = (estimate.observed_order.unwrap(), choice.method().facts().order as f64);
                assert!((seen - formal).abs() < 0.25 * formal, "{}: order {seen:.2}", choice.label());
            }
        }
    }
}

/// A scene that the higher explicit schemes refuse, here because of its drag, is compared with finer steps of its own
/// scheme.
#[test]
fn an_estimate_does_without_the_schemes_that_refuse_the_scene() {
    let scene = |steps: u32| {
        let mut scene = cantilever(
            1,
            Time::new(0.25, 0.25 / f64::from(steps), SchemeName::StormerVerlet),
            Law::NeoHookean(SOFT),
        );
        scene.damping = Some(Damping { mass_rate: 1.0, ..Damping::default() });
        scene
    };
    let (mut run, estimate) = estimated(&scene(400));
    let (mut fine, _) = estimated(&scene(12_800));
    let (found, truth) = (run.observe().probes[0].displacement, fine.observe().probes[0].displacement);
    let ratio = estimate.error[1] / (found[1] - truth[1]).abs();
    assert!((0.9..1.1).contains(&ratio), "{estimate:?}");
    assert!((estimate.observed_order.unwrap() - 2.0).abs() < 0.1, "{estimate:?}");
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

/// Factors of a body that hardly deforms are exact, so steps that are long compared to its periods need no others. The corrections of
/// `gauss` stand for its coupled stages only approximately, and must not be mistaken for those of an old factor.
#[test]
fn a_body_that_hardly_deforms_keeps_its_factor_by_gauss() {
    for stages in 2..=5 {
        let mut time = Time::new(0.1, 5e-3, SchemeName::Gauss);
        time.stages = Some(stages);
        let steel = Law::StVenantKirchhoff(Isotropic { young: 2e11, ..SOFT });
        let mut simulation = Simulation::new(cantilever(2, time, steel)).unwrap();
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let factorizations = simulation.work().factorizations;
        assert!(factorizations <= 2, "{stages} stages: {factorizations} factorisations in 20 steps");
    }
}
