//! Small bodies and measures that the tests of the schemes share.
#![allow(dead_code, unreachable_pub, reason = "every test file uses its part")]

use std::ops::Range;

use vi_core::problems::{Jet, SpringChain, Term};
use vi_core::{
    Account, Coordinates, Fault, HessianKind, Path, Potential, Prescribed, State, Stencils, System, Traits,
    angular_momentum, linear_momentum,
};
use vi_solvers::{Method, SolverOptions, Stepper};

/// Returns options that solve implicit equations to round-off.
pub fn to_round_off() -> SolverOptions {
    SolverOptions { tolerance: 1e-14, ..Default::default() }
}

pub fn stepper_of(method: Method, system: &System) -> Box<dyn Stepper> {
    vi_solvers::stepper(&method, system, &to_round_off()).unwrap()
}

pub fn run(method: Method, system: &System, state: &mut State, h: f64, steps: usize) {
    let mut stepper = stepper_of(method, system);
    for _ in 0..steps {
        stepper.step(system, state, h).unwrap();
    }
}

/// A smooth motion of the coordinates of two nodes.
struct Wave(usize);

impl Path for Wave {
    fn position(&self, t: f64, out: &mut [f64]) {
        for (k, out) in out.iter_mut().enumerate() {
            *out = 0.1 * k as f64 + 0.3 * ((1.0 + 0.2 * k as f64) * t).sin() + self.0 as f64;
        }
    }
    fn velocity(&self, t: f64, out: &mut [f64]) {
        for (k, out) in out.iter_mut().enumerate() {
            let rate = 1.0 + 0.2 * k as f64;
            *out = 0.3 * rate * (rate * t).cos();
        }
    }
}

/// Returns a chain whose first node, and the height of its last, follow smooth paths.
pub fn moving_chain(nodes: usize) -> (System, State) {
    let chain = SpringChain::unit(nodes);
    let last = 3 * nodes as u32 - 1;
    let prescribed = vec![
        Prescribed { dofs: vec![0, 1, 2], path: Box::new(Wave(0)) },
        Prescribed { dofs: vec![last], path: Box::new(Wave(0)) },
    ];
    let system = chain.system_holding(prescribed).unwrap();
    let free = chain.disturbed_state();
    let all = chain.system().unwrap();
    let state = system.state(0.0, &all.positions(&free), &all.velocities(&free)).unwrap();
    (system, state)
}

/// Returns springs at their rest length under gravity, thrown without spin.
pub fn falling_chain(nodes: usize) -> (System, State) {
    let mass: Vec<f64> = (0..3 * nodes).map(|dof| 1.0 + (dof / 3 % 2) as f64).collect();
    let weight = mass.clone();
    let gravity = Term {
        name: "gravity",
        block: 3,
        nodes: (0..nodes as u32).collect(),
        hessian: HessianKind::Zero,
        jet: move |node, x: &[f64; 3]| {
            let force = 9.81 * weight[3 * node];
            Jet { energy: force * x[2], gradient: [0.0, 0.0, force], hessian: [[0.0; 3]; 3] }
        },
    };
    let springs = Term {
        name: "springs",
        block: 3,
        nodes: (1..nodes as u32).flat_map(|b| [b - 1, b]).collect(),
        hessian: HessianKind::Varying,
        jet: |_, x: &[f64; 6]| spring(x, 100.0, 1.0),
    };
    let system = System::new(
        mass.clone(),
        vec![Box::new(springs), Box::new(gravity)],
        Coordinates::all_free(3 * nodes),
    )
    .unwrap();
    let x: Vec<f64> = (0..3 * nodes).map(|dof| if dof % 3 == 0 { (dof / 3) as f64 } else { 0.0 }).collect();
    let v: Vec<f64> = (0..3 * nodes).map(|dof| [3.0, -2.0, 20.0][dof % 3]).collect();
    let state = system.state(0.0, &x, &v).unwrap();
    (system, state)
}

/// Checks that every node of `state` has followed the parabola from `start`, to the round-off of many steps.
pub fn assert_fall(start: &State, state: &State, name: &str) {
    let t = state.t - start.t;
    for k in 0..state.q.len() {
        let (v, g) = ([3.0, -2.0, 20.0][k % 3], [0.0, 0.0, -9.81][k % 3]);
        let exact = start.q[k] + v * t + 0.5 * g * t * t;
        assert!(
            (state.q[k] - exact).abs() < 1e-12 * (1.0 + 0.5 * 9.81 * t * t),
            "{name}: {} {exact}",
            state.q[k]
        );
        let shape = (state.q[k] - state.q[k % 3]) - (start.q[k] - start.q[k % 3]);
        assert!(shape.abs() < 1e-10, "{name}: {shape:e}");
    }
}

/// Returns V = ½ k (r − l)² between two points, with its derivatives.
pub fn spring(x: &[f64; 6], k: f64, l: f64) -> Jet<6> {
    let d = [x[3] - x[0], x[4] - x[1], x[5] - x[2]];
    let r = d.iter().map(|d| d * d).sum::<f64>().sqrt();
    let n = d.map(|d| d / r);
    let slope = k * (r - l);
    let sign = |i: usize| if i < 3 { -1.0 } else { 1.0 };
    let mut jet = Jet { energy: 0.5 * k * (r - l) * (r - l), gradient: [0.0; 6], hessian: [[0.0; 6]; 6] };
    for i in 0..6 {
        jet.gradient[i] = sign(i) * slope * n[i % 3];
        for j in 0..6 {
            let unit = if i % 3 == j % 3 { 1.0 } else { 0.0 };
            let p = n[i % 3] * n[j % 3];
            jet.hessian[i][j] = sign(i) * sign(j) * (k * p + slope / r * (unit - p));
        }
    }
    jet
}

/// V = −ln(1 − e²) with e = x_b − x_a − 1 on a line; not finite for |e| ≥ 1.
struct Brittle([u32; 2]);

impl Brittle {
    fn strain(x: &[f64]) -> f64 {
        x[1] - x[0] - 1.0
    }
}

impl Potential for Brittle {
    fn name(&self) -> &str {
        "brittle"
    }
    fn account(&self) -> Account {
        Account::Elastic
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 2, block: 1, nodes: &self.0 }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }
    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        let e = Self::strain(x);
        out[..range.len()].fill(if e.abs() < 1.0 { -(1.0 - e * e).ln() } else { f64::INFINITY });
    }
    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        let e = Self::strain(x);
        let slope = if e.abs() < 1.0 { 2.0 * e / (1.0 - e * e) } else { f64::NAN };
        if !range.is_empty() {
            (out[0], out[1]) = (-slope, slope);
        }
    }
    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        let e = Self::strain(x);
        let d = 1.0 - e * e;
        let curvature = 2.0 * (1.0 + e * e) / (d * d);
        if !range.is_empty() {
            (out[0], out[1], out[2]) = (curvature, -curvature, curvature);
        }
    }
    fn fault(&self, stencil: usize, x: &[f64], _t: f64) -> Option<Fault> {
        let e = Self::strain(x);
        let broken = e.abs() >= 1.0;
        broken.then_some(Fault {
            element: stencil,
            quantity: "strain",
            value: e,
            at_any_state: false,
            domain: "must be below 1",
        })
    }
}

/// Returns two points on a line that move apart: a large step tears them.
pub fn brittle_pair() -> (System, State) {
    let system =
        System::new(vec![1.0, 1.0], vec![Box::new(Brittle([0, 1]))], Coordinates::all_free(2)).unwrap();
    let state = State { t: 0.0, q: vec![0.0, 1.2], p: vec![-0.5, 0.5] };
    (system, state)
}

pub fn distance(a: &State, b: &State) -> f64 {
    let pairs = a.q.iter().zip(&b.q).chain(a.p.iter().zip(&b.p));
    pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

pub fn assert_close(a: &State, b: &State, tolerance: f64, name: &str) {
    let scale = b.q.iter().chain(&b.p).fold(0.0_f64, |max, v| max.max(v.abs()));
    assert!((a.t - b.t).abs() < 1e-12, "{name}: t");
    assert!(distance(a, b) <= tolerance * scale, "{name}: {:e} of {scale}", distance(a, b));
}

pub fn assert_momenta(system: &System, start: &State, end: &State, tolerance: f64, name: &str) {
    type Momentum = fn(&System, &State) -> [f64; 3];
    for (what, momentum) in [("P", linear_momentum as Momentum), ("L", angular_momentum as Momentum)] {
        let (a, b) = (momentum(system, start), momentum(system, end));
        let scale = a.iter().fold(0.0_f64, |max, v| max.max(v.abs()));
        for k in 0..3 {
            let change = (a[k] - b[k]).abs() / scale;
            assert!(change < tolerance, "{name}: {what}{k} changed by {change:e}");
        }
    }
}
