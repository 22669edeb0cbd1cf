//! Tests equilibria against closed forms: snap-through, buckling, jumps, forces without a potential.

use crate::forces::{Linear, Turning};
use crate::springs::{Springs, block};
use vi_core::problems::{Jet, Term};
use vi_core::{Coordinates, HessianKind, Path, Potential, Prescribed, State, Stencils, System, Traits};
use vi_solvers::{
    CriticalKind, LinearSolver, PathControl, PathFunction, SolverError, StaticOptions, equilibrium,
    equilibrium_path, path_following,
};

/// One coordinate with V(x, t) = U(x) − t P x.
struct Loaded<U>(U, f64);

impl<U: Fn(f64) -> [f64; 3] + Send + Sync> Potential for Loaded<U> {
    fn name(&self) -> &str {
        "loaded"
    }
    fn account(&self) -> vi_core::Account {
        vi_core::Account::Elastic
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 1, nodes: &[0] }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: true }
    }
    fn energies(&self, _: std::ops::Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        out[0] = (self.0)(x[0])[0] - t * self.1 * x[0];
    }
    fn gradients(&self, _: std::ops::Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        out[0] = (self.0)(x[0])[1] - t * self.1;
    }
    fn hessians(&self, _: std::ops::Range<usize>, x: &[f64], _: f64, out: &mut [f64]) {
        out[0] = (self.0)(x[0])[2];
    }
}

fn one(potential: impl Potential + 'static) -> (System, State) {
    let system = System::new(vec![1.0], vec![Box::new(potential)], Coordinates::all_free(1)).unwrap();
    (system, State { t: 0.0, q: vec![0.0], p: vec![0.0] })
}

/// A wall at x = 0 as a user would write it: V = k (d − |x|)³/|x| for |x| < d, infinite at the wall, and zero farther
/// than d from it. `largest_step` keeps the point on its side.
struct Wall {
    distance: f64,
    stiffness: f64,
}

impl Wall {
    /// Returns V, V′ and V″ at x.
    fn jet(&self, x: f64) -> [f64; 3] {
        let (k, d, size, sign) = (self.stiffness, self.distance, x.abs(), x.signum());
        let q = d - size;
        if q <= 0.0 {
            return [0.0; 3];
        }
        let slope = -3.0 * q * q / size - q.powi(3) / (size * size);
        let curvature = 6.0 * q / size + 6.0 * q * q / (size * size) + 2.0 * q.powi(3) / size.powi(3);
        [k * q.powi(3) / size, k * sign * slope, k * curvature]
    }
}

impl Potential for Wall {
    fn name(&self) -> &str {
        "wall"
    }
    fn account(&self) -> vi_core::Account {
        vi_core::Account::Contact
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 1, nodes: &[0] }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }
    fn energies(&self, _: std::ops::Range<usize>, x: &[f64], _: f64, out: &mut [f64]) {
        out[0] = self.jet(x[0])[0];
    }
    fn gradients(&self, _: std::ops::Range<usize>, x: &[f64], _: f64, out: &mut [f64]) {
        out[0] = self.jet(x[0])[1];
    }
    fn hessians(&self, _: std::ops::Range<usize>, x: &[f64], _: f64, out: &mut [f64]) {
        out[0] = self.jet(x[0])[2];
    }
    fn limits_steps(&self) -> bool {
        true
    }
    fn largest_step(&self, x: &[f64], dx: &[f64]) -> f64 {
        // Keep a tenth of the distance to the wall.
        let left = 1.0 + dx[0] / x[0];
        if left < 0.1 { 0.9 / (1.0 - left) } else { 1.0 }
    }
}

/// A load P t pulls a spring of stiffness 1 against the wall; the point stays on its side, in equilibrium. Without
/// the limit by the wall the first Newton step would end on the other side.
#[test]
fn a_point_that_is_pulled_against_a_wall_stays_on_its_side() {
    for (load, increment) in [(3.0, 1.0), (3.0, 0.1), (1e3, 1.0), (1e3, 0.3)] {
        let spring = Loaded(|x: f64| [0.5 * (x - 1.0).powi(2), x - 1.0, 1.0], -load);
        let wall = Wall { distance: 0.1, stiffness: 0.2 };
        let terms: Vec<Box<dyn Potential>> = vec![Box::new(spring), Box::new(wall)];
        let system = System::new(vec![1.0], terms, Coordinates::all_free(1)).unwrap();
        for arc_steps in [None, Some(200)] {
            let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
            let largest_increment = increment;
            let options = StaticOptions {
                increment,
                largest_increment,
                arc_steps,
                tolerance: 1e-12,
                ..Default::default()
            };
            let report = equilibrium_path(&system, &mut state, &options, &mut |state, _| {
                assert!(state.q[0] > 0.0, "{load} {increment}: {state:?}");
                true
            });
            let report = report.unwrap();
            let x = state.q[0];
            let force = (x - 1.0) + load + Wall { distance: 0.1, stiffness: 0.2 }.jet(x)[1];
            assert!(force.abs() < 1e-7 * load, "{load} {increment}: {force} at {x}");
            assert!(report.is_stable() && report.critical.is_empty());
        }
    }
}

/// A point on a spring whose other end, a support, moves through the wall stays on its side.
#[test]
fn a_point_that_a_support_drags_against_a_wall_stays_on_its_side() {
    struct Line;
    impl Path for Line {
        fn position(&self, t: f64, out: &mut [f64]) {
            out[0] = 1.0 - 3.0 * t;
        }
        fn velocity(&self, _: f64, out: &mut [f64]) {
            out[0] = -3.0;
        }
    }
    let spring = |_: usize, x: &[f64; 2]| {
        let stretch = x[0] - x[1];
        Jet {
            energy: 0.5 * stretch * stretch,
            gradient: [stretch, -stretch],
            hessian: [[1.0, -1.0], [-1.0, 1.0]],
        }
    };
    let spring =
        Term { name: "spring", block: 1, nodes: vec![0, 1], hessian: HessianKind::Constant, jet: spring };
    let terms: Vec<Box<dyn Potential>> =
        vec![Box::new(spring), Box::new(Wall { distance: 0.1, stiffness: 0.2 })];
    let support = Prescribed { dofs: vec![1], path: Box::new(Line) };
    let system = System::new(vec![1.0; 2], terms, Coordinates::new(2, vec![support]).unwrap()).unwrap();
    let mut state = State { t: 0.0, q: vec![1.0], p: vec![0.0] };
    equilibrium(&system, &mut state, &StaticOptions::default()).unwrap();
    let x = state.q[0];
    assert!(x > 0.0 && (x + 2.0 + Wall { distance: 0.1, stiffness: 0.2 }.jet(x)[1]).abs() < 1e-7);
}

/// Returns a shallow arch of two bars, V = ((1 − w)² − 1)²/2 of the deflection w: it snaps at P = 4/(3√3).
fn arch(load: f64) -> (System, State) {
    let energy = |w: f64| {
        let y = 1.0 - w;
        [0.5 * (y * y - 1.0).powi(2), -2.0 * y * (y * y - 1.0), 6.0 * y * y - 2.0]
    };
    one(Loaded(energy, load))
}

const SNAP: f64 = 0.769_800_358_919_501;

#[test]
fn below_the_limit_load_the_arch_carries_to_round_off() {
    let (system, mut state) = arch(0.9 * SNAP);
    let report = equilibrium(&system, &mut state, &StaticOptions::default()).unwrap();
    let y = 1.0 - state.q[0];
    assert!((2.0 * y * (1.0 - y * y) - 0.9 * SNAP).abs() < 1e-12);
    assert!(report.is_stable() && report.jumps.is_empty() && report.critical.is_empty());
    assert_eq!((state.t, report.load_factor()), (1.0, 1.0));
}

#[test]
fn beyond_it_the_arch_snaps_and_the_report_says_where() {
    let (system, mut state) = arch(1.25 * SNAP);
    let options = StaticOptions { increment: 0.1, largest_increment: 0.1, ..Default::default() };
    let report = equilibrium(&system, &mut state, &options).unwrap();
    assert!(state.q[0] > 2.0 && report.is_stable());
    assert_eq!(report.jumps.len(), 1);
    assert!((report.jumps[0] - 0.8).abs() < 2e-3, "{:?}", report.jumps);
}

#[test]
fn the_arc_goes_through_both_limit_points() {
    let (system, mut state) = arch(1.25 * SNAP);
    let options =
        StaticOptions { increment: 0.05, largest_increment: 0.2, arc_steps: Some(500), ..Default::default() };
    let mut path = Vec::new();
    let report = equilibrium_path(&system, &mut state, &options, &mut |state, _| {
        path.push((state.t, state.q[0]));
        true
    })
    .unwrap();
    for (t, w) in &path {
        let y = 1.0 - w;
        assert!((2.0 * y * (1.0 - y * y) - t * 1.25 * SNAP).abs() < 1e-10, "{t} {w}");
    }
    let unstable: Vec<_> = report.steps.iter().filter(|step| !step.is_stable).collect();
    assert!(unstable.len() > 5);
    assert_eq!(report.critical.len(), 2);
    for (critical, expected) in report.critical.iter().zip([0.8, -0.8]) {
        assert_eq!(critical.kind, CriticalKind::Limit);
        assert!((critical.load_factor - expected).abs() < 1e-3, "{critical:?}");
    }
    assert!(state.t == 1.0 && state.q[0] > 2.0 && report.is_stable());
}

/// The arch is controlled by its deflection, which takes ten equally spaced values. Each load factor is the exact
/// one, through both limit points. A stepper that restores the memory of another continues to the same bits.
#[test]
fn a_path_that_is_controlled_by_a_displacement_has_its_exact_loads() {
    let (system, start) = arch(1.25 * SNAP);
    let control = || {
        let sag = |x: &[f64; 1]| Jet { energy: x[0], gradient: [1.0], hessian: [[0.0]] };
        let jet = move |_: usize, x: &[f64; 1]| sag(x);
        let term = Term { name: "sag", block: 1, nodes: vec![0], hessian: HessianKind::Zero, jet };
        let function = PathFunction::new(&system, vec![Box::new(term)], &[0.0]).unwrap();
        PathControl::Function { function: Box::new(function), to: 2.5, steps: 10 }
    };
    let stepper = || path_following(&system, StaticOptions::default(), control(), true).unwrap();
    let (mut whole, mut state) = (stepper(), start.clone());
    let mut middle = None;
    let mut limits = 0;
    for step in 1..=10 {
        whole.step(&system, &mut state, 0.1).unwrap();
        let (w, y) = (state.q[0], 1.0 - state.q[0]);
        assert!((w - 0.25 * f64::from(step)).abs() < 1e-14);
        assert!((2.0 * y * (1.0 - y * y) - state.t * 1.25 * SNAP).abs() < 1e-12, "{w}: {}", state.t);
        limits += whole.take_findings().iter().filter(|finding| finding.contains("limit point")).count();
        if step == 4 {
            middle = Some((whole.memory(), state.clone()));
        }
    }
    assert_eq!(limits, 2);
    let (memory, mut again) = middle.unwrap();
    let mut other = stepper();
    other.restore(&system, &memory).unwrap();
    for _ in 4..10 {
        other.step(&system, &mut again, 0.1).unwrap();
    }
    assert_eq!(again, state);
}

/// If all arc steps are used, the error says so, and not that Newton's method failed.
#[test]
fn arc_steps_that_are_used_up_are_named() {
    let (system, mut state) = arch(1.25 * SNAP);
    let options =
        StaticOptions { increment: 0.01, largest_increment: 0.01, arc_steps: Some(5), ..Default::default() };
    let error = equilibrium(&system, &mut state, &options).unwrap_err();
    assert!(matches!(error, SolverError::ArcSteps { steps: 5, .. }), "{error}");
    assert!(
        error.to_string().contains("5 arc steps") && !error.to_string().contains("iterations"),
        "{error}"
    );
}

#[test]
fn a_column_buckles_at_its_critical_load_and_a_push_bends_it() {
    // A rigid link on a rotational spring, V = θ²/2 − t P (1 − cos θ), critical at t P = 1.
    let column = |load: f64| {
        let jet = move |_: usize, x: &[f64; 2]| {
            // The second coordinate only carries the load factor: it is prescribed to be t.
            let (angle, t) = (x[0], x[1]);
            let p = load * t;
            Jet {
                energy: 0.5 * angle * angle - p * (1.0 - angle.cos()),
                gradient: [angle - p * angle.sin(), -load * (1.0 - angle.cos())],
                hessian: [[1.0 - p * angle.cos(), -load * angle.sin()], [-load * angle.sin(), 0.0]],
            }
        };
        let term = Term { name: "column", block: 2, nodes: vec![0], hessian: HessianKind::Varying, jet };
        let path = Box::new(crate::forces::Clock);
        let coordinates = Coordinates::new(2, vec![vi_core::Prescribed { dofs: vec![1], path }]).unwrap();
        let system = System::new(vec![1.0; 2], vec![Box::new(term)], coordinates).unwrap();
        (system, State { t: 0.0, q: vec![0.0], p: vec![0.0] })
    };
    let (system, mut state) = column(2.0);
    let options = StaticOptions { increment: 0.3, largest_increment: 0.3, ..Default::default() };
    let report = equilibrium(&system, &mut state, &options).unwrap();
    assert_eq!(state.q, [0.0]);
    assert!(!report.is_stable());
    let critical = report.critical[0];
    assert_eq!((critical.kind, report.critical.len()), (CriticalKind::Bifurcation, 1));
    assert!((critical.load_factor - 0.5).abs() < 1e-8, "{critical:?}");

    let (system, mut state) = column(2.0);
    let options = StaticOptions { push: Some(0.1), ..options };
    let report = equilibrium(&system, &mut state, &options).unwrap();
    assert!(report.is_stable());
    let angle = state.q[0].abs();
    assert!(angle > 1.0 && (angle - 2.0 * angle.sin()).abs() < 1e-9, "{angle}");
}

/// A column that shortens by u and turns by θ under the load p = 2 t: V = u²/2 + (1 − u²) θ²/2 − p (u + 1 − cos θ). On its straight
/// path u = p, and ∂²V/∂θ² = 1 − p² − p, which is zero at p = (√5 − 1)/2. It is no linear function of the load.
fn shortening_column() -> (System, State) {
    let jet = |_: usize, x: &[f64; 3]| {
        let [u, angle, t] = *x;
        Jet {
            energy: 0.5 * u * u + 0.5 * (1.0 - u * u) * angle * angle - 2.0 * t * (u + 1.0 - angle.cos()),
            gradient: [
                u - u * angle * angle - 2.0 * t,
                (1.0 - u * u) * angle - 2.0 * t * angle.sin(),
                -2.0 * (u + 1.0 - angle.cos()),
            ],
            hessian: [
                [1.0 - angle * angle, -2.0 * u * angle, -2.0],
                [-2.0 * u * angle, 1.0 - u * u - 2.0 * t * angle.cos(), -2.0 * angle.sin()],
                [-2.0, -2.0 * angle.sin(), 0.0],
            ],
        }
    };
    let term = Term { name: "column", block: 3, nodes: vec![0], hessian: HessianKind::Varying, jet };
    let path = Box::new(crate::forces::Clock);
    let coordinates = Coordinates::new(3, vec![Prescribed { dofs: vec![2], path }]).unwrap();
    let system = System::new(vec![1.0; 3], vec![Box::new(term)], coordinates).unwrap();
    (system, State { t: 0.0, q: vec![0.0; 2], p: vec![0.0; 2] })
}

/// The bifurcation on a path by arc length or control is where an eigenvalue vanishes, however long the step over it is.
#[test]
fn a_bifurcation_on_a_path_does_not_depend_on_the_steps() {
    let exact = 0.25 * (5.0_f64.sqrt() - 1.0);
    for increment in [0.02, 0.1, 0.7] {
        let (system, mut state) = shortening_column();
        let (largest_increment, arc_steps) = (increment, Some(100));
        let options = StaticOptions { increment, largest_increment, arc_steps, ..Default::default() };
        let report = equilibrium(&system, &mut state, &options).unwrap();
        let critical = report.critical[0];
        assert_eq!((critical.kind, report.critical.len()), (CriticalKind::Bifurcation, 1));
        assert!((critical.load_factor - exact).abs() < 1e-7, "{increment}: {critical:?}");
        assert!(critical.error < 1e-7, "{increment}: {critical:?}");
    }
    for steps in [1, 3, 40] {
        let (system, mut state) = shortening_column();
        let jet = |_: usize, x: &[f64; 1]| Jet { energy: x[0], gradient: [1.0], hessian: [[0.0]] };
        let term = Term { name: "u", block: 1, nodes: vec![0], hessian: HessianKind::Zero, jet };
        let function = PathFunction::new(&system, vec![Box::new(term)], &[0.0; 3]).unwrap();
        let control = PathControl::Function { function: Box::new(function), to: 2.0, steps };
        let mut stepper = path_following(&system, StaticOptions::default(), control, false).unwrap();
        for _ in 0..steps {
            stepper.step(&system, &mut state, 1.0).unwrap();
        }
        let findings = stepper.take_findings();
        let sought = format!("at load factor {exact:.6} a bifurcation");
        assert!(findings.len() == 1 && findings[0].starts_with(&sought), "{steps}: {findings:?}");
    }
}

/// Under a force f = c (−y, x) the tangent of V = (1 − 2t)(x² + y²)/2 has the determinant (1 − 2t)² + c² and never becomes singular,
/// though its symmetric part does: nothing buckles.
#[test]
fn a_force_without_a_potential_leaves_stability_undecided() {
    let jet = |_: usize, x: &[f64; 3]| {
        let [x, y, t] = *x;
        let k = 1.0 - 2.0 * t;
        Jet {
            energy: 0.5 * k * (x * x + y * y),
            gradient: [k * x, k * y, -(x * x + y * y)],
            hessian: [[k, 0.0, -2.0 * x], [0.0, k, -2.0 * y], [-2.0 * x, -2.0 * y, 0.0]],
        }
    };
    for arc_steps in [None, Some(50)] {
        let term = Term { name: "spring", block: 3, nodes: vec![0], hessian: HessianKind::Varying, jet };
        let path = Box::new(crate::forces::Clock);
        let coordinates = Coordinates::new(3, vec![Prescribed { dofs: vec![2], path }]).unwrap();
        let system = System::new(vec![1.0; 3], vec![Box::new(term)], coordinates).unwrap();
        let system = system.with_forces(vec![std::sync::Arc::new(Turning { c: 0.5, block: 3 })]).unwrap();
        let mut state = State { t: 0.0, q: vec![0.0; 2], p: vec![0.0; 2] };
        let options = StaticOptions {
            increment: 0.1,
            largest_increment: 0.1,
            arc_steps,
            push: arc_steps.is_none().then_some(0.1),
            ..Default::default()
        };
        let report = equilibrium(&system, &mut state, &options).unwrap();
        assert_eq!(state.q, [0.0; 2]);
        assert!(report.critical.is_empty() && report.jumps.is_empty(), "{report:?}");
    }
}

#[test]
fn a_load_that_nothing_carries_is_an_error_and_leaves_the_state() {
    // U = 1 − exp(−x): its force never exceeds 1 for x ≥ 0.
    let (system, mut state) = one(Loaded(|x: f64| [1.0 - (-x).exp(), (-x).exp(), -(-x).exp()], 2.0));
    let before = state.clone();
    match equilibrium(&system, &mut state, &StaticOptions::default()) {
        Err(error @ SolverError::Equilibrium { .. }) => {
            assert!(error.to_string().contains("no equilibrium beyond load factor"), "{error}");
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(state, before);
}

#[test]
fn forces_without_a_potential_take_part() {
    // x = f(x) = 1 + x/2 in equilibrium, hence x = 2.
    let jet = |_: usize, x: &[f64; 1]| Jet { energy: 0.5 * x[0] * x[0], gradient: *x, hessian: [[1.0]] };
    let spring = Term { name: "spring", block: 1, nodes: vec![0], hessian: HessianKind::Constant, jet };
    let (system, mut state) = one(spring);
    let system = system.with_forces(vec![Linear::shared(1.0, 0.5, 0.0)]).unwrap();
    equilibrium(&system, &mut state, &StaticOptions::default()).unwrap();
    assert!((state.q[0] - 2.0).abs() < 1e-12, "{:?}", state.q);
}

/// The positions x + t d.
struct Shift(Vec<f64>, Vec<f64>);

impl Path for Shift {
    fn position(&self, t: f64, out: &mut [f64]) {
        out.iter_mut().enumerate().for_each(|(k, out)| *out = self.0[k] + t * self.1[k]);
    }
    fn velocity(&self, _: f64, out: &mut [f64]) {
        out.copy_from_slice(&self.1);
    }
}

/// Returns a bar of springs of 30 × 2 × 2 cells, clamped at one end; the other end moves by t `shift`.
fn pulled_bar(shift: [f64; 3]) -> (System, State) {
    let (x, nodes) = block([30, 2, 2]);
    let held: Vec<u32> =
        (0..x.len() as u32).filter(|&dof| [0.0, 30.0].contains(&x[dof as usize / 3 * 3])).collect();
    let start = held.iter().map(|&dof| x[dof as usize]).collect();
    let moves = |&dof: &u32| if x[dof as usize / 3 * 3] == 30.0 { shift[dof as usize % 3] } else { 0.0 };
    let path = Shift(start, held.iter().map(moves).collect());
    let coordinates =
        Coordinates::new(x.len(), vec![Prescribed { dofs: held, path: Box::new(path) }]).unwrap();
    let springs = Springs::new(4, nodes, 1.0, &x);
    let system = System::new(vec![1.0; x.len()], vec![Box::new(springs)], coordinates).unwrap();
    let mut q = vec![0.0; system.coordinates().free_count()];
    system.coordinates().restrict(&x, &mut q);
    let p = vec![0.0; q.len()];
    (system, State { t: 0.0, q, p })
}

#[test]
fn conjugate_gradients_find_the_equilibrium_and_the_stability_that_a_factor_finds() {
    // Bending, and compression beyond the buckling load.
    for (shift, is_stable) in [([0.0, 4.0, 0.0], true), ([-0.6, 0.0, 0.0], false)] {
        let [direct, gradients] = [LinearSolver::Cholesky, LinearSolver::Pcg].map(|linear| {
            let (system, mut state) = pulled_bar(shift);
            let options = StaticOptions {
                linear,
                increment: 0.25,
                largest_increment: 0.25,
                tolerance: 1e-9,
                find_critical: false,
                ..StaticOptions::default()
            };
            let report = equilibrium(&system, &mut state, &options).unwrap();
            assert_eq!(report.work.pcg_iterations > 0, linear == LinearSolver::Pcg);
            assert_eq!(report.linear.as_ref().map(|(linear, _)| *linear), Some(linear));
            assert_eq!(report.is_stable(), is_stable, "{shift:?} {linear:?}");
            (state.q, report)
        });
        // The buckling mode has so little stiffness that it magnifies the error of the last correction.
        let error = if is_stable { 1e-7 } else { 1e-4 };
        for (a, b) in direct.0.iter().zip(&gradients.0) {
            assert!((a - b).abs() < error, "{shift:?}: {a} {b}");
        }
        let [corrections, most] = [&gradients.1, &direct.1].map(|report| report.work.newton_iterations);
        assert!(2 * corrections <= 3 * most, "{corrections} corrections instead of {most}");
    }
}
