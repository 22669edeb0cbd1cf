//! Time symmetry: a symmetric scheme with equal steps returns to its start when it runs backwards. Also tests the rule
//! of adaptive steps.

use crate::prelude::*;

/// Returns a soft block that spins and vibrates, with hω = 10 at its highest frequency.
fn block(stages: usize, tolerance: f64, young: f64) -> Simulation {
    let shape =
        BoxMesh { size: [1.0, 0.2, 0.2], cells: [5, 1, 1], element: CellKind::Tet4, origin: [0.0; 3] };
    let law = Law::NeoHookean(Isotropic { young, poisson: 0.3, density: 1000.0 });
    let mut time = Time::new(0.4, 0.01, SchemeName::Gauss);
    time.stages = Some(stages);
    let scene = Scene::new(time)
        .solver(Solver { tolerance, ..Solver::default() })
        .body(Body::from_box("block", shape, law).angular_velocity([1.0, 6.0, 3.0]));
    Simulation::new(scene).unwrap()
}

/// Runs half of the steps forward, and the other half with reversed momenta; returns the largest distance from the
/// start, m.
fn reversal(mut simulation: Simulation) -> (f64, u64) {
    let start = simulation.components[0].state.q.clone();
    for _ in 0..simulation.step_count() / 2 {
        simulation.step().unwrap();
    }
    simulation.components[0].state.p.iter_mut().for_each(|p| *p = -*p);
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let end = &simulation.components[0].state.q;
    let off = start.iter().zip(end).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
    (off, simulation.substeps().steps)
}

/// No step of a smooth motion is cut, at any tolerance. With equations solved to round-off, the scheme returns to its
/// start to round-off.
#[test]
fn gauss_runs_back_to_its_start() {
    for (stages, young) in [(2, 1e5), (2, 1e6), (3, 1e5), (3, 1e6)] {
        for tolerance in [1e-6, 1e-10, 1e-14] {
            let (off, cut) = reversal(block(stages, tolerance, young));
            assert_eq!(cut, 0, "{stages} stages, E = {young:e} Pa, tolerance {tolerance:e}");
            if tolerance == 1e-14 {
                assert!(off < 1e-11, "{stages} stages, E = {young:e} Pa: off by {off:e} m");
            }
        }
    }
}

/// The steps of a block that spins and vibrates do not depend on how fast it flies, and neither does its shape after them.
#[test]
fn adaptive_steps_do_not_depend_on_the_observer() {
    let run = |velocity: [f64; 3], gravity: [f64; 3]| {
        let shape =
            BoxMesh { size: [1.0, 0.2, 0.2], cells: [3, 1, 1], element: CellKind::Hex8, origin: [0.0; 3] };
        let law = Law::StVenantKirchhoff(Isotropic { young: 1e5, poisson: 0.3, density: 1000.0 });
        let mut time = Time::adaptive(0.5, 1e-4, SchemeName::ImplicitMidpoint);
        time.largest_step = Some(0.05);
        let mut body = Body::from_box("block", shape, law).angular_velocity([1.0, 0.5, 2.0]);
        body.displacement = Some([
            FieldComponent::Formula("0.2*x*(x - 1)".to_owned()),
            FieldComponent::Number(0.0),
            FieldComponent::Number(0.0),
        ]);
        let scene = Scene::new(time)
            .solver(Solver { tolerance: 1e-13, ..Solver::default() })
            .gravity(gravity)
            .body(body.velocity(velocity));
        let mut simulation = Simulation::new(scene).unwrap();
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let q = &simulation.components[0].state.q;
        let count = (q.len() / 3) as f64;
        let mean: [f64; 3] = std::array::from_fn(|k| q.iter().skip(k).step_by(3).sum::<f64>() / count);
        let shape: Vec<f64> = q.iter().enumerate().map(|(k, q)| q - mean[k % 3]).collect();
        (simulation.adaptive_counts().unwrap().steps, shape)
    };
    let (steps, shape) = run([0.0; 3], [0.0; 3]);
    assert!(steps > 30, "{steps}");
    for (velocity, gravity) in [([0.0, 100.0, 20.0], [0.0; 3]), ([0.0; 3], [0.0, 0.0, -50.0])] {
        let (flying, other) = run(velocity, gravity);
        let off = shape.iter().zip(&other).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
        assert!(flying == steps && off < 1e-8, "{velocity:?}, {gravity:?}: {steps} {flying}, {off:e} m");
    }
}

/// Returns a block of one cell that is thrown, spins and vibrates so much that its highest frequency doubles.
fn stretched(scheme: SchemeName, end: f64, interval: f64, tolerance: f64) -> Simulation {
    let shape =
        BoxMesh { size: [1.0, 0.5, 0.5], cells: [1, 1, 1], element: CellKind::Tet4, origin: [0.0; 3] };
    let law = Law::StVenantKirchhoff(Isotropic { young: 1e4, poisson: 0.3, density: 1000.0 });
    let mut time = Time::adaptive(end, tolerance, scheme);
    time.largest_step = Some(interval);
    let scene = Scene::new(time)
        .solver(Solver { tolerance: 1e-14, ..Solver::default() })
        .body(Body::from_box("block", shape, law).angular_velocity([1.0, 2.0, 6.0]));
    Simulation::new(scene).unwrap()
}

/// Runs to the end, with velocities reversed after half of the steps; returns the largest distance of a coordinate from its start, m.
fn there_and_back(simulation: &mut Simulation) -> f64 {
    let start = simulation.components[0].state.q.clone();
    let half = simulation.step_count() / 2;
    while !simulation.is_done() {
        if simulation.steps() == half {
            simulation.components[0].state.p.iter_mut().for_each(|p| *p = -*p);
        }
        simulation.step().unwrap();
    }
    let end = &simulation.components[0].state.q;
    start.iter().zip(end).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()))
}

/// A run with adaptive steps runs back to its start: a reversed motion requires the same numbers of steps.
#[test]
fn adaptive_steps_run_back_to_their_start() {
    for scheme in [SchemeName::StormerVerlet, SchemeName::ImplicitMidpoint, SchemeName::EnergyMomentum] {
        let mut simulation = stretched(scheme, 4.0, 0.1, 1e-4);
        let off = there_and_back(&mut simulation);
        let counts = simulation.adaptive_counts().unwrap();
        assert!(counts.most >= counts.fewest + 2, "{scheme:?}: {counts:?}");
        assert!(off < 1e-8, "{scheme:?}: off by {off:e} m with {counts:?}");
    }
}

/// Returns a block of tetrahedra, stretched by a tenth, that spins and vibrates at the default tolerance.
fn spinning(scheme: SchemeName, spin: [f64; 3], young: f64, [end, interval]: [f64; 2]) -> Simulation {
    let shape =
        BoxMesh { size: [0.3, 0.1, 0.2], cells: [3, 1, 2], element: CellKind::Tet4, origin: [0.0; 3] };
    let law = Law::StableNeoHookean(Isotropic { young, poisson: 0.35, density: 1000.0 });
    let mut time = Time::adaptive(end, Time::DEFAULT_TOLERANCE, scheme);
    time.largest_step = Some(interval);
    let mut body = Body::from_box("block", shape, law).angular_velocity(spin);
    body.displacement = Some([
        FieldComponent::Formula("0.1*x".to_owned()),
        FieldComponent::Number(0.0),
        FieldComponent::Number(0.0),
    ]);
    let scene = Scene::new(time).solver(Solver { tolerance: 1e-13, ..Solver::default() }).body(body);
    Simulation::new(scene).unwrap()
}

/// At the default tolerance too, where other numbers of steps lead to other states, a run comes back to its start.
#[test]
fn adaptive_steps_run_back_to_their_start_at_the_default_tolerance() {
    for scheme in [SchemeName::StormerVerlet, SchemeName::ImplicitMidpoint] {
        let mut simulation = spinning(scheme, [1.0, 7.0, 0.5], 5e4, [2.0, 0.02]);
        let off = there_and_back(&mut simulation);
        let counts = simulation.adaptive_counts().unwrap();
        assert!(off < 1e-9, "{scheme:?}: off by {off:e} m with {counts:?}");
    }
}

/// At the default tolerance too, the energy of a block that spins and vibrates does not drift over 30 000 steps.
#[test]
fn adaptive_steps_keep_the_energy_at_the_default_tolerance() {
    let mut simulation = spinning(SchemeName::StormerVerlet, [1.0, 7.0, 0.5], 5e4, [100.0, 0.05]);
    let (mut means, mut largest) = ([0.0; 10], 0.0_f64);
    let per_mean = simulation.step_count() / 10;
    while !simulation.is_done() {
        let slot = (simulation.steps() / per_mean) as usize;
        simulation.step().unwrap();
        let energy = simulation.observe();
        largest = largest.max(energy.kinetic);
        means[slot.min(9)] += energy.total() / per_mean as f64;
    }
    let drift = means.iter().map(|mean| (mean - means[0]).abs() / largest).fold(0.0, f64::max);
    let counts = simulation.adaptive_counts().unwrap();
    assert!(counts.steps > 20_000 && drift < 0.03, "{drift:e}: {means:?}, {counts:?}");
}

/// Returns a stiff free cube of 1 m that falls with the weight a₀ cos(60 (t − t₀)) along x.
fn shaken(acceleration: f64, t0: f64, end: f64, tolerance: f64) -> Simulation {
    let shape = BoxMesh { size: [1.0; 3], cells: [1, 1, 1], element: CellKind::Hex8, origin: [0.0; 3] };
    let law = Law::NeoHookean(Isotropic { young: 1e9, poisson: 0.3, density: 1000.0 });
    let mut time = Time::adaptive(end, tolerance, SchemeName::ImplicitMidpoint);
    time.largest_step = Some(0.1);
    let amplitude = Amplitude::expression(&format!("cos(60*(t-{t0}))")).unwrap();
    let scene = Scene::new(time)
        .solver(Solver { tolerance: 1e-12, ..Solver::default() })
        .gravity([acceleration, 0.0, 0.0])
        .gravity_amplitude(amplitude)
        .body(Body::from_box("cube", shape, law));
    Simulation::new(scene).unwrap()
}

/// Weight that changes with time requires steps although the body only flies: the error of u = a₀ (1 − cos ωt)/ω² falls
/// with the tolerance, which is that per radian.
#[test]
fn adaptive_steps_follow_weight_that_changes_with_time() {
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let mut simulation = shaken(10.0, 0.0, 0.5, tolerance);
        let start = simulation.components[0].state.q[0];
        let (mut error, size) = (0.0_f64, 10.0 / 3600.0);
        while !simulation.is_done() {
            simulation.step().unwrap();
            let exact = size * (1.0 - (60.0 * simulation.time()).cos());
            error = error.max((simulation.components[0].state.q[0] - start - exact).abs());
        }
        let allowed = 30.0 * tolerance * size;
        assert!(error < allowed, "{tolerance:e}: {error:e} above {allowed:e}");
    }
}

/// Weight that is even about the middle of the run is the same on the way back, and so are the steps.
#[test]
fn adaptive_steps_with_weight_that_changes_run_back_to_their_start() {
    let mut simulation = shaken(1e4, 0.37, 0.74, 1e-3);
    let start = simulation.components[0].state.q.clone();
    let half = simulation.step_count() / 2;
    while !simulation.is_done() {
        if simulation.steps() == half {
            simulation.components[0].state.p.iter_mut().for_each(|p| *p = -*p);
        }
        simulation.step().unwrap();
    }
    let counts = simulation.adaptive_counts().unwrap();
    assert!(simulation.step_count().is_multiple_of(2) && counts.steps > 100, "{counts:?}");
    let end = &simulation.components[0].state.q;
    let off = start.iter().zip(end).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
    assert!(off < 1e-10, "off by {off:e} m with {counts:?}");
}

/// A cube that drag stops comes as far as v₀ (1 − exp(−αt))/α, to a few times the tolerance, at any accuracy of the
/// solver. Afterwards round-off requires no steps.
#[test]
fn adaptive_steps_follow_drag() {
    for accuracy in [Solver::default().tolerance, 1e-10] {
        let shape = BoxMesh { size: [1.0; 3], cells: [1, 1, 1], element: CellKind::Hex8, origin: [0.0; 3] };
        let law = Law::NeoHookean(Isotropic { young: 1e9, poisson: 0.3, density: 1000.0 });
        let mut time = Time::adaptive(2.0, 1e-3, SchemeName::ImplicitMidpoint);
        time.largest_step = Some(0.2);
        let scene = Scene::new(time)
            .solver(Solver { tolerance: accuracy, ..Solver::default() })
            .damping(Damping { mass_rate: 40.0, ..Damping::default() })
            .body(Body::from_box("cube", shape, law).velocity([1.0, 0.0, 0.0]));
        let mut simulation = Simulation::new(scene).unwrap();
        let start = simulation.components[0].state.q[0];
        while !simulation.is_done() {
            simulation.step().unwrap();
            let exact = (1.0 - (-40.0 * simulation.time()).exp()) / 40.0;
            let error = (simulation.components[0].state.q[0] - start) / exact - 1.0;
            assert!(error.abs() < 4e-3, "{accuracy:e}: {error:e} at {}", simulation.time());
        }
        // α T/θ = 730 steps.
        let counts = simulation.adaptive_counts().unwrap();
        assert!((700..1500).contains(&counts.steps), "{accuracy:e}: {counts:?}");
    }
}

/// Over 10⁵ steps the energy of a symmetric scheme does not drift with steps that follow the motion by the symmetric
/// rule, as it does not with constant steps. It drifts if the start of an interval alone decides.
#[test]
fn adaptive_steps_do_not_let_the_energy_drift() {
    let drift = |is_symmetric: bool| {
        let mut simulation = stretched(SchemeName::StormerVerlet, 500.0, 0.05, 1e-4);
        simulation.adaptive.as_mut().unwrap().is_symmetric = is_symmetric;
        let energy = |simulation: &mut Simulation| simulation.observe().total();
        let mut means = [0.0; 10];
        let per_mean = simulation.step_count() / 10;
        while !simulation.is_done() {
            let slot = (simulation.steps() / per_mean) as usize;
            simulation.step().unwrap();
            means[slot.min(9)] += energy(&mut simulation) / per_mean as f64;
        }
        (simulation.adaptive_counts().unwrap(), (means[9] - means[0]) / means[0])
    };
    let (counts, symmetric) = drift(true);
    let (_, plain) = drift(false);
    assert!(counts.steps > 100_000 && counts.most > counts.fewest, "{counts:?}");
    // The means of a chaotic motion differ by some 1e-4.
    assert!(symmetric.abs() < 1e-3, "symmetric: {symmetric:e}, plain: {plain:e}, {counts:?}");
    assert!(plain.abs() > 30.0 * symmetric.abs(), "symmetric: {symmetric:e}, plain: {plain:e}");
}

/// Halving shortens the longest part that was made, which may be shorter than the whole step, down to h/1024.
#[test]
fn halving_shortens_the_longest_part() {
    let mut simulation = block(2, 1e-6, 1e5);
    simulation.step().unwrap();
    assert!(simulation.halve());
    assert_eq!(simulation.part(), simulation.step_size() / 2.0);
    simulation.longest_since_kept = super::pace::FLOOR / 8;
    assert!(simulation.halve());
    assert_eq!(simulation.part(), simulation.step_size() / 16.0);
    simulation.longest_since_kept = 1;
    assert!(simulation.halve() && !simulation.halve());
    assert_eq!(simulation.part(), simulation.step_size() / 1024.0);
}
