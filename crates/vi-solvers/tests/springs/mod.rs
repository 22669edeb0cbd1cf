//! A term for tests: stencils whose nodes are connected pairwise by springs V = Σ k/4 (|x_a − x_b|² − L²)², and a box
//! of them. Energy, gradient and Hessian are in closed form.
#![allow(dead_code)]

use std::ops::Range;

use vi_core::{
    Account, Coordinates, Fault, Fixed, HessianKind, Path, Potential, Prescribed, Stencils, System, Traits,
};

pub(crate) struct Springs {
    pub(crate) arity: usize,
    pub(crate) nodes: Vec<u32>,
    /// |x_a − x_b|² at rest, one per pair (a, b < a) of each stencil.
    pub(crate) rest: Vec<f64>,
    pub(crate) stiffness: f64,
    /// Numbers of evaluated (energies, gradients, Hessians), in stencils.
    pub(crate) calls: [std::sync::atomic::AtomicUsize; 3],
}

fn point(x: &[f64], node: u32) -> [f64; 3] {
    std::array::from_fn(|k| x[3 * node as usize + k])
}

fn difference(x: &[f64], a: u32, b: u32) -> ([f64; 3], f64) {
    let (p, q) = (point(x, a), point(x, b));
    let d: [f64; 3] = std::array::from_fn(|k| p[k] - q[k]);
    (d, d.iter().map(|d| d * d).sum())
}

impl Springs {
    pub(crate) fn new(arity: usize, nodes: Vec<u32>, stiffness: f64, x: &[f64]) -> Self {
        let mut rest = Vec::new();
        for stencil in nodes.chunks(arity) {
            for a in 0..arity {
                for b in 0..a {
                    rest.push(difference(x, stencil[a], stencil[b]).1);
                }
            }
        }
        Self { arity, nodes, rest, stiffness, calls: Default::default() }
    }

    fn pairs(&self, stencil: usize) -> impl Iterator<Item = (usize, usize, u32, u32, f64)> + '_ {
        let nodes = &self.nodes[stencil * self.arity..(stencil + 1) * self.arity];
        let rest = &self.rest[stencil * self.arity * (self.arity - 1) / 2..];
        (0..self.arity)
            .flat_map(|a| (0..a).map(move |b| (a, b)))
            .map(move |(a, b)| (a, b, nodes[a], nodes[b], rest[a * (a - 1) / 2 + b]))
    }

    fn count(&self, what: usize, range: &Range<usize>) {
        self.calls[what].fetch_add(range.len(), std::sync::atomic::Ordering::Relaxed);
    }
}

impl Potential for Springs {
    fn name(&self) -> &str {
        "springs"
    }
    fn account(&self) -> Account {
        Account::Elastic
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.arity, block: 3, nodes: &self.nodes }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }
    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.count(0, &range);
        for (stencil, out) in range.zip(out) {
            *out = self
                .pairs(stencil)
                .map(|(_, _, p, q, rest)| self.stiffness / 4.0 * (difference(x, p, q).1 - rest).powi(2))
                .sum();
        }
    }
    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.count(1, &range);
        out.fill(0.0);
        for (stencil, out) in range.zip(out.chunks_exact_mut(3 * self.arity)) {
            for (a, b, p, q, rest) in self.pairs(stencil) {
                let (d, square) = difference(x, p, q);
                for k in 0..3 {
                    let force = self.stiffness * (square - rest) * d[k];
                    out[3 * a + k] += force;
                    out[3 * b + k] -= force;
                }
            }
        }
    }
    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.count(2, &range);
        out.fill(0.0);
        let n = 3 * self.arity;
        for (stencil, out) in range.zip(out.chunks_exact_mut(n * (n + 1) / 2)) {
            for (a, b, p, q, rest) in self.pairs(stencil) {
                let (d, square) = difference(x, p, q);
                for i in 0..3 {
                    for j in 0..3 {
                        let identity = if i == j { square - rest } else { 0.0 };
                        let value = self.stiffness * (identity + 2.0 * d[i] * d[j]);
                        let mut add = |row: usize, column: usize, value: f64| {
                            if row >= column {
                                out[row * (row + 1) / 2 + column] += value;
                            }
                        };
                        add(3 * a + i, 3 * a + j, value);
                        add(3 * b + i, 3 * b + j, value);
                        add(3 * a + i, 3 * b + j, -value);
                    }
                }
            }
        }
    }
    fn mean_deformations(&self, range: Range<usize>, _x: &[f64], out: &mut [f64]) -> bool {
        for (stencil, out) in range.zip(out.chunks_exact_mut(9)) {
            for (k, out) in out.iter_mut().enumerate() {
                *out = (stencil + k) as f64;
            }
        }
        true
    }
    fn fault(&self, stencil: usize, _x: &[f64], _t: f64) -> Option<Fault> {
        Some(Fault {
            element: 7 * stencil,
            quantity: "length",
            value: f64::NAN,
            at_any_state: false,
            domain: "must be a number",
        })
    }
}

/// Returns a box of (a, b, c) cells of six stencils each: the positions and the stencils' nodes.
pub(crate) fn block(cells: [usize; 3]) -> (Vec<f64>, Vec<u32>) {
    let [a, b, c] = cells;
    let node = |i: usize, j: usize, k: usize| ((i * (b + 1) + j) * (c + 1) + k) as u32;
    let mut x = Vec::new();
    for i in 0..=a {
        for j in 0..=b {
            for k in 0..=c {
                x.extend([i as f64, j as f64, k as f64]);
            }
        }
    }
    let paths = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let mut nodes = Vec::new();
    for i in 0..a {
        for j in 0..b {
            for k in 0..c {
                for path in paths {
                    let mut at = [i, j, k];
                    nodes.push(node(at[0], at[1], at[2]));
                    for axis in path {
                        at[axis] += 1;
                        nodes.push(node(at[0], at[1], at[2]));
                    }
                }
            }
        }
    }
    (x, nodes)
}

/// Returns a prescription that keeps some coordinates at their values in x.
pub(crate) fn fixed(x: &[f64], dofs: Vec<u32>) -> Vec<Prescribed> {
    let values = dofs.iter().map(|&dof| x[dof as usize]).collect();
    vec![Prescribed { dofs, path: Box::new(Fixed(values)) as Box<dyn Path> }]
}

/// Returns a box of springs; if `clamped`, nodes whose first coordinate is zero are clamped.
pub(crate) fn block_system(cells: [usize; 3], clamped: bool) -> (System, Vec<f64>) {
    let (x, nodes) = block(cells);
    let count = x.len();
    let clamp = if clamped {
        (0..count as u32).filter(|&dof| x[dof as usize / 3 * 3] == 0.0).collect()
    } else {
        vec![]
    };
    let coordinates = Coordinates::new(count, fixed(&x, clamp)).unwrap();
    let springs = Springs::new(4, nodes, 1.0, &x);
    (System::new(vec![1.0; count], vec![Box::new(springs)], coordinates).unwrap(), x)
}

/// Returns positions displaced by smooth, reproducible amounts.
pub(crate) fn deformed(x: &[f64], amplitude: f64) -> Vec<f64> {
    x.iter().enumerate().map(|(k, x)| x + amplitude * (0.7 * k as f64 + x).sin()).collect()
}

/// Returns the sums of the terms' blocks in order, entry by entry: the oracle of every gather.
pub(crate) fn dense(system: &System, x: &[f64], t: f64) -> (f64, Vec<f64>, Vec<Vec<f64>>) {
    let count = x.len();
    let (mut energy, mut gradient, mut hessian) = (0.0, vec![0.0; count], vec![vec![0.0; count]; count]);
    for potential in system.potentials() {
        let stencils = potential.stencils();
        let n = stencils.size();
        for stencil in 0..stencils.count() {
            let mut v = [0.0];
            let (mut g, mut h) = (vec![0.0; n], vec![0.0; n * (n + 1) / 2]);
            potential.energies(stencil..stencil + 1, x, t, &mut v);
            potential.gradients(stencil..stencil + 1, x, t, &mut g);
            potential.hessians(stencil..stencil + 1, x, t, &mut h);
            energy += v[0];
            let dof = |local: usize| {
                stencils.of(stencil)[local / stencils.block] as usize * stencils.block
                    + local % stencils.block
            };
            let mut packed = h.iter();
            for i in 0..n {
                gradient[dof(i)] += g[i];
                for j in 0..=i {
                    let value = packed.next().unwrap();
                    hessian[dof(i)][dof(j)] += value;
                    if i != j {
                        hessian[dof(j)][dof(i)] += value;
                    }
                }
            }
        }
    }
    (energy, gradient, hessian)
}
