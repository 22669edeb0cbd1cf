//! Tests what variational schemes conserve, for every scheme and every material, on whole scenes.

use variational::prelude::*;
use variational::solvers::Method;

/// Iterates over the variational schemes that `bench` compares, and symplectic Euler.
fn schemes() -> impl Iterator<Item = (SchemeName, Option<usize>)> {
    let is_usual = |method: &Method| method.facts().is_benchmarked || method.facts().order == 1;
    let is_variational = |method: &Method| method.facts().is_variational();
    Method::variants().filter(is_usual).filter(is_variational).map(SchemeName::of)
}

/// Returns the registered law of this name, with the parameters of its example.
fn law(name: &str) -> Law {
    Law::examples().into_iter().find(|law| law.name() == name).unwrap()
}

fn time(end: f64, step: f64, (scheme, stages): (SchemeName, Option<usize>)) -> Time {
    Time { stages, ..Time::new(end, step, scheme) }
}

fn block(name: &str) -> Body {
    let shape = BoxMesh {
        size: [0.4, 0.2, 0.2],
        cells: [2, 1, 1],
        element: CellKind::Tet4,
        origin: [0.1, 0.0, -0.1],
    };
    Body::from_box("block", shape, law(name))
}

fn exact() -> Solver {
    Solver { tolerance: 1e-14, ..Solver::default() }
}

/// A free, struck, spinning body keeps linear and angular momentum over 1000 steps, to 1e-12 of the sums of absolute
/// values. (Linear elasticity is not invariant under rotations, so only its linear momentum is kept.)
#[test]
fn momenta_are_kept_to_round_off() {
    for scheme in schemes() {
        for &name in Law::NAMES {
            let body = block(name).velocity([1.0, 0.5, -0.3]).angular_velocity([0.5, 1.0, 2.0]);
            let scene = Scene::new(time(0.5, 5e-4, scheme))
                .body(body)
                .strike(Strike {
                    body: "block".into(),
                    on: Selection::region("x-max"),
                    impulse: [0.2, -1.0, 0.7],
                })
                .solver(exact());
            let mut simulation = Simulation::new(scene).unwrap();
            let first = simulation.observe();
            while !simulation.is_done() {
                simulation.step().unwrap();
            }
            assert_eq!(simulation.steps(), 1000);
            let last = simulation.observe();
            assert!(last.elastic > 1e-3, "{scheme:?} {name}: it does not deform");
            let scale = (2.0 * 16.0 * first.kinetic).sqrt();
            for k in 0..3 {
                let linear = (last.momentum[k] - first.momentum[k]).abs() / scale;
                assert!(linear < 1e-12, "{scheme:?} {name}: linear momentum off by {linear:e}");
                let angular = (last.angular_momentum[k] - first.angular_momentum[k]).abs() / scale;
                assert!(
                    name == "linear" || angular < 1e-12,
                    "{scheme:?} {name}: angular momentum off by {angular:e}"
                );
            }
        }
    }
}

/// Implicit schemes keep the linear momentum of a free body to round-off at the default tolerance, also with factors in single precision
/// that turn with the body. (The angular momentum is as accurate as the solution.)
#[test]
fn implicit_schemes_keep_linear_momentum_whatever_the_tolerance() {
    let shape =
        BoxMesh { size: [1.0, 0.05, 0.05], cells: [20, 1, 1], element: CellKind::Hex8, origin: [0.0; 3] };
    let material = Law::NeoHookean(Isotropic { young: 2.1e11, poisson: 0.3, density: 7850.0 });
    for method in Method::variants().filter(|method| !method.facts().is_explicit) {
        let scheme = SchemeName::of(method);
        let body = Body::from_box("bar", shape.clone(), material.clone())
            .velocity([1.0, 5.0, -3.0])
            .angular_velocity([0.0, 40.0, 60.0]);
        let strike =
            Strike { body: "bar".into(), on: Selection::region("x-max"), impulse: [-30.0, 50.0, 0.0] };
        let scene = Scene::new(time(2e-3, 1e-4, scheme)).body(body).strike(strike);
        let mut simulation = Simulation::new(scene).unwrap();
        let first = simulation.observe();
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let last = simulation.observe();
        assert!(last.elastic > 1.0, "{scheme:?}: it does not deform");
        let scale = (2.0 * 7850.0 * 2.5e-3 * first.kinetic).sqrt();
        for k in 0..3 {
            let change = (last.momentum[k] - first.momentum[k]).abs() / scale;
            assert!(change < 1e-13, "{scheme:?}: linear momentum off by {change:e}");
        }
    }
}

/// A body thrown without spin falls as a point mass, x = x₀ + v t + g t²/2, and keeps its shape to round-off. (The
/// symplectic Euler schemes are of order 1 and differ by g h t/2.)
#[test]
fn free_fall_keeps_the_shape() {
    for scheme in schemes() {
        for &name in Law::NAMES {
            let (end, step) = (0.2, 1e-3);
            let scene = Scene::new(time(end, step, scheme))
                .gravity([0.0, -9.81, 0.0])
                .body(block(name).velocity([1.0, 2.0, 3.0]))
                .solver(exact());
            let mut simulation = Simulation::new(scene).unwrap();
            let rest = simulation.positions(0);
            while !simulation.is_done() {
                simulation.step().unwrap();
            }
            let first_order = match scheme.0 {
                SchemeName::SymplecticEulerA => -0.5 * 9.81 * step * end,
                SchemeName::SymplecticEulerB => 0.5 * 9.81 * step * end,
                _ => 0.0,
            };
            let fall = [end, 2.0 * end - 0.5 * 9.81 * end * end + first_order, 3.0 * end];
            for (x, rest) in simulation.positions(0).iter().zip(&rest) {
                for k in 0..3 {
                    let off = (x[k] - rest[k] - fall[k]).abs();
                    assert!(off < 1e-12, "{scheme:?} {name}: off by {off:e} m");
                }
            }
        }
    }
}

/// Bodies that do not interact are separate systems. A system without a free coordinate is not stepped.
#[test]
fn bodies_apart_are_separate_systems() {
    let mut held = block("neo-hookean").translate([5.0, 0.0, 0.0]);
    held.name = "held".into();
    let alone = Scene::new(Time::new(0.05, 1e-3, SchemeName::ImplicitMidpoint))
        .gravity([0.0, 0.0, -9.81])
        .body(block("neo-hookean"))
        .fix(Fix::region("block", "x-min"));
    let both = alone.clone().body(held).fix(Fix::region("held", "box"));
    let (mut alone, mut both) = (Simulation::new(alone).unwrap(), Simulation::new(both).unwrap());
    assert_eq!(both.components().len(), 2);
    assert!(both.components()[1].stepper().is_none());
    while !alone.is_done() {
        alone.step().unwrap();
        both.step().unwrap();
    }
    assert_eq!(alone.positions(0), both.positions(0));
    assert_eq!(alone.work(), both.work());
}

/// Explicit schemes build no Hessian and no factor, and solve nothing.
#[test]
fn explicit_steps_build_no_hessian() {
    let is_explicit = |name: SchemeName| name.method().is_some_and(|method| method.facts().is_explicit);
    for scheme in schemes().filter(|(name, _)| is_explicit(*name)) {
        let scene = Scene::new(time(0.05, 1e-3, scheme)).body(block("corotated").velocity([0.0, 0.0, 1.0]));
        let mut simulation = Simulation::new(scene).unwrap();
        while !simulation.is_done() {
            simulation.step().unwrap();
        }
        let work = simulation.work();
        assert_eq!((work.hessians, work.factorizations, work.solves), (0, 0, 0));
    }
}

/// The change of energy over a run with a moving clamp is the sum of the entries of the ledger, each computed
/// separately.
#[test]
fn the_ledger_closes() {
    for scheme in schemes() {
        let motion: Motion =
            serde_json::from_str(r#"{ "kind": "sine", "amplitude": [0.0, 0.02, 0.01], "frequency": 8.0 }"#)
                .unwrap();
        let scene = Scene::new(time(0.1, 1e-3, scheme))
            .gravity([0.0, -9.81, 0.0])
            .body(block("neo-hookean"))
            .fix(Fix::region("block", "x-min").motion(motion))
            .output(Output { ledger: Some(true), ..Output::default() });
        let mut simulation = Simulation::new(scene).unwrap();
        let first = simulation.observe();
        let mut parts = variational::core::StepEnergy::default();
        let mut kinetic: f64 = 0.0;
        while !simulation.is_done() {
            parts += simulation.step().unwrap().energy;
            kinetic = kinetic.max(simulation.observe().kinetic);
        }
        let last = simulation.observe();
        let gap = last.total() - first.total() - parts.total();
        assert!(gap.abs() < 1e-12 * kinetic.max(parts.prescribed.abs()), "{scheme:?}: {gap:e} J unexplained");
        assert!(parts.prescribed.abs() > 1e-3);
    }
}

/// If a support starts to move from rest, a step of `energy-momentum` has a unique solution that does not depend on the
/// solver's tolerance, is of order 2, and gains energy from the support alone.
#[test]
fn a_moving_support_leaves_energy_momentum_one_solution() {
    let motion =
        r#"{ "kind": "sine", "amplitude": [0.0, 0.02, 0.0], "frequency": 3.0, "phase": 1.5707963267948966 }"#;
    let motion: Motion = serde_json::from_str(motion).unwrap();
    let shape =
        BoxMesh { size: [1.0, 0.25, 0.25], cells: [4, 2, 2], element: CellKind::Hex8, origin: [0.0; 3] };
    let end = |step: f64, tolerance: f64| {
        let scene = Scene::new(Time::new(0.02, step, SchemeName::EnergyMomentum))
            .body(Body::from_box("beam", shape.clone(), law("neo-hookean")))
            .fix(Fix::region("beam", "x-min"))
            .fix(Fix::region("beam", "x-max").motion(motion.clone()))
            .solver(Solver { tolerance, ..Solver::default() })
            .output(Output { ledger: Some(true), ..Output::default() });
        let mut simulation = Simulation::new(scene).unwrap();
        let mut parts = variational::core::StepEnergy::default();
        while !simulation.is_done() {
            parts += simulation.step().unwrap().energy;
        }
        assert!(parts.scheme.abs() < 1e-13 * parts.prescribed, "{parts:?}");
        simulation.positions(0)
    };
    let apart = |one: &[[f64; 3]], other: &[[f64; 3]]| {
        let apart = one.iter().flatten().zip(other.iter().flatten());
        apart.fold(0.0_f64, |apart, (a, b)| apart.max((a - b).abs()))
    };
    let coarse = end(2.5e-3, 1e-9);
    for tolerance in [1e-5, 1e-6, 1e-7, 1e-8] {
        // The scheme solves 1e5 times more accurately than `tolerance`; the support moves by a millimetre.
        let off = apart(&end(2.5e-3, tolerance), &coarse);
        assert!(off < 1e-8 * tolerance + 1e-14, "off by {off:e} m at a tolerance of {tolerance:e}");
    }
    let (fine, finer) = (end(1.25e-3, 1e-9), end(6.25e-4, 1e-9));
    let order = (apart(&coarse, &fine) / apart(&fine, &finer)).log2();
    assert!((order - 2.0).abs() < 0.3, "order {order}");
}

/// External work is reported by default and does not count as energy drift.
#[test]
fn work_from_outside_is_not_drift() {
    let damping: variational::scene::Damping = serde_json::from_str(r#"{ "stiffness_time": 1e-3 }"#).unwrap();
    let scene = Scene::new(time(0.2, 1e-3, (SchemeName::StormerVerlet, None)))
        .gravity([0.0, -9.81, 0.0])
        .body(block("neo-hookean"))
        .fix(Fix::region("block", "x-min"))
        .damping(damping);
    let mut simulation = Simulation::new(scene).unwrap();
    let first = simulation.observe();
    let (mut damping, mut kinetic) = (0.0, 0.0_f64);
    while !simulation.is_done() {
        damping += simulation.step().unwrap().energy.damping;
        kinetic = kinetic.max(simulation.observe().kinetic);
    }
    let change = simulation.observe().total() - first.total();
    assert!(damping < -1e-3 * kinetic, "{damping:e} J of damping");
    assert!((change - damping).abs() < 1e-3 * kinetic, "{change:e} J is not {damping:e} J");
}

/// A steel beam under its own weight, with strains of 1e-6: the energy of every law is known to a fraction of ε_m E, so that
/// Newton's method of `energy-momentum` converges at once and the balance holds. (The default law was off by ε_m E: the
/// method stopped in the first step.)
#[test]
fn a_stiff_beam_keeps_its_energy_by_energy_momentum() {
    let isotropic =
        |law: &str| format!(r#"{{ law = "{law}", young = 2e11, poisson = 0.3, density = 7800.0 }}"#);
    let mut laws: Vec<String> =
        ["neo-hookean", "stable-neo-hookean", "st-venant-kirchhoff", "corotated"].map(isotropic).into();
    laws.push(
        r#"{ law = "mooney-rivlin", c10 = 3e10, c01 = 8e9, bulk = 1.6e11, density = 7800.0 }"#.to_owned(),
    );
    let energy = "mu/2*(I1 - 3 - 2*log(J)) + k/2*log(J)^2";
    laws.push(format!(
        r#"{{ law = "formula", energy = "{energy}", constants = {{ mu = 7.7e10, k = 1.15e11 }}, density = 7800.0 }}"#
    ));
    let solid = r#"box = { size = [1.0, 0.1, 0.1], cells = [10, 1, 1], element = "hex8" }"#;
    let mut bodies: Vec<String> = laws.iter().map(|law| format!("{solid}\nmaterial = {law}")).collect();
    bodies.push(format!("{solid}\nmaterial = {}\nlocking = \"mean-dilation\"", laws[0]));
    for law in ["neo-hookean", "st-venant-kirchhoff", "corotated"] {
        let more = r#"density = 7800.0, thickness = 5e-3, bending = "shell""#;
        let material = format!(r#"{{ law = "{law}", young = 2e11, poisson = 0.3, {more} }}"#);
        bodies.push(format!("sheet = {{ size = [1.0, 0.3], cells = [10, 3] }}\nmaterial = {material}"));
    }
    for body in bodies {
        let text = format!(
            "gravity = [0.0, 0.0, -9.81]\n[[body]]\nname = \"beam\"\n{body}\n[[fix]]\nbody = \"beam\"\nregion = \
             \"x-min\"\n[time]\nend = 0.05\nstep = 1e-3\nscheme = \"energy-momentum\"\n"
        );
        let mut simulation = Simulation::new(Scene::parse(&text, &[]).scene.unwrap()).unwrap();
        let (first, mut elastic) = (simulation.observe(), 0.0_f64);
        while !simulation.is_done() {
            simulation.step().unwrap();
            elastic = elastic.max(simulation.observe().elastic);
        }
        let off = (simulation.observe().total() - first.total()).abs();
        assert!(off <= 1e-8 * elastic, "{body}: {off:e} J of {elastic:e} J");
        let (iterations, steps) = (simulation.work().newton_iterations, simulation.steps());
        assert!(iterations <= 5 * steps, "{body}: {iterations} iterations in {steps} steps");
    }
}
