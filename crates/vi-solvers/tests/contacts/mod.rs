//! Terms for tests of live terms: points that repel each other when they are close, and a wall.
#![allow(dead_code, unreachable_pub, reason = "every test file uses its part")]

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use vi_core::{Account, DiscreteGradient, HessianKind, Live, Potential, Stencils, Traits};

/// Pairs of points with V = k/(8 d²) (d² − r²)² if their distance r is below d, and zero otherwise.
pub struct Pairs {
    pub nodes: Vec<u32>,
    pub distance: f64,
    pub stiffness: f64,
    /// Whether it acts by its discrete gradient.
    pub is_discrete: bool,
}

impl Pairs {
    fn separation(&self, stencil: usize, x: &[f64]) -> [f64; 3] {
        let (a, b) = (3 * self.nodes[2 * stencil] as usize, 3 * self.nodes[2 * stencil + 1] as usize);
        std::array::from_fn(|k| x[a + k] - x[b + k])
    }

    /// Returns d² − r² (m²) if it is positive, else zero.
    fn depth(&self, r: [f64; 3]) -> f64 {
        (self.distance.powi(2) - square(r)).max(0.0)
    }

    /// Returns k/(4 d²), so that dV/du = k/(4 d²) u with u = d² − r².
    fn slope(&self) -> f64 {
        self.stiffness / (4.0 * self.distance.powi(2))
    }
}

fn square(r: [f64; 3]) -> f64 {
    r.iter().map(|r| r * r).sum()
}

/// Writes the packed block of a pair from the 3 × 3 block of their separation.
fn pack(block: impl Fn(usize, usize) -> f64, out: &mut [f64]) {
    let mut packed = out.iter_mut();
    for i in 0..6 {
        for j in 0..=i {
            let sign = if i / 3 == j / 3 { 1.0 } else { -1.0 };
            *packed.next().unwrap() = sign * block(i % 3, j % 3);
        }
    }
}

impl Potential for Pairs {
    fn name(&self) -> &str {
        "pairs"
    }
    fn account(&self) -> Account {
        Account::Contact
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 2, block: 3, nodes: &self.nodes }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }
    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out) {
            *out = 0.5 * self.slope() * self.depth(self.separation(stencil, x)).powi(2);
        }
    }
    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(6)) {
            let r = self.separation(stencil, x);
            for k in 0..3 {
                out[k] = -2.0 * self.slope() * self.depth(r) * r[k];
                out[3 + k] = -out[k];
            }
        }
    }
    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(21)) {
            let r = self.separation(stencil, x);
            let depth = self.depth(r);
            let active = f64::from(u8::from(depth > 0.0));
            let block = |i: usize, j: usize| {
                let identity = if i == j { depth } else { 0.0 };
                2.0 * self.slope() * (2.0 * active * r[i] * r[j] - identity)
            };
            pack(block, out);
        }
    }
    fn discrete_gradient(&self) -> Option<&dyn DiscreteGradient> {
        self.is_discrete.then_some(self)
    }
}

/// The discrete gradient G = γ (r₀ + r₁) of the separations, where γ is the difference quotient of V over r².
impl Pairs {
    fn quotient(&self, start: [f64; 3], end: [f64; 3]) -> (f64, f64) {
        let (u0, u1) = (self.depth(start), self.depth(end));
        let change = square(end) - square(start);
        let size = 1e-12 * self.distance.powi(2);
        if u0 > 0.0 && u1 > 0.0 || change.abs() <= size {
            // Both are written without cancellation: γ, and dγ/d(r₁²).
            let active = f64::from(u8::from(u1 > 0.0));
            return (-0.5 * self.slope() * (u0 + u1), 0.5 * self.slope() * active);
        }
        let gamma = 0.5 * self.slope() * (u1 * u1 - u0 * u0) / change;
        (gamma, (-self.slope() * u1 - gamma) / change)
    }
}

impl DiscreteGradient for Pairs {
    fn gradients(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(6)) {
            let (r0, r1) = (self.separation(stencil, start), self.separation(stencil, end));
            let (gamma, _) = self.quotient(r0, r1);
            for k in 0..3 {
                out[k] = gamma * (r0[k] + r1[k]);
                out[3 + k] = -out[k];
            }
        }
    }
    fn tangents(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(21)) {
            let (r0, r1) = (self.separation(stencil, start), self.separation(stencil, end));
            let (gamma, rate) = self.quotient(r0, r1);
            let sum: [f64; 3] = std::array::from_fn(|k| r0[k] + r1[k]);
            let block = |i: usize, j: usize| {
                let identity = if i == j { gamma } else { 0.0 };
                identity + rate * (sum[i] * r1[j] + sum[j] * r1[i])
            };
            pack(block, out);
        }
    }
}

/// The repulsion of all points as a live term, whose stencils are the pairs that are close.
pub struct Repulsion {
    pub count: u32,
    pub distance: f64,
    pub stiffness: f64,
    pub reach: f64,
    pub is_discrete: bool,
    pub calls: AtomicUsize,
}

impl Repulsion {
    pub fn new(count: u32, is_discrete: bool) -> Self {
        Self { count, distance: 0.5, stiffness: 40.0, reach: 0.05, is_discrete, calls: AtomicUsize::new(0) }
    }

    /// Returns the pairs of points that are closer than `limit` and whose numbers differ by at least two.
    fn pairs(&self, x: &[f64], limit: f64) -> Pairs {
        let distance = |a: u32, b: u32| {
            let part = |k: usize| x[3 * a as usize + k] - x[3 * b as usize + k];
            square([part(0), part(1), part(2)]).sqrt()
        };
        let all = (0..self.count).flat_map(|a| (0..a.saturating_sub(1)).map(move |b| [a, b]));
        let nodes = all.filter(|&[a, b]| distance(a, b) < limit).flatten().collect();
        let Self { distance, stiffness, is_discrete, .. } = *self;
        Pairs { nodes, distance, stiffness, is_discrete }
    }

    /// Returns all pairs, close or not.
    pub fn fixed(&self) -> Pairs {
        self.pairs(&vec![0.0; 3 * self.count as usize], f64::INFINITY)
    }
}

impl Live for Repulsion {
    fn name(&self) -> &str {
        "repulsion"
    }
    fn reach(&self) -> f64 {
        self.reach
    }
    fn near(&self, x: &[f64], reach: f64) -> Arc<dyn Potential> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        Arc::new(self.pairs(x, self.distance + 2.0 * reach))
    }
}

/// Points above a floor at z = 0 with V = k (d − z)³/z for z below d: infinite at the floor.
pub struct Floor {
    pub nodes: Vec<u32>,
    pub distance: f64,
    pub stiffness: f64,
}

impl Floor {
    fn height(&self, stencil: usize, x: &[f64]) -> f64 {
        x[3 * self.nodes[stencil] as usize + 2]
    }

    /// Returns V, V′, V″ at height z.
    fn jet(&self, z: f64) -> [f64; 3] {
        let (k, d) = (self.stiffness, self.distance);
        if z >= d {
            return [0.0; 3];
        }
        if z <= 0.0 {
            return [f64::INFINITY, f64::NAN, f64::NAN];
        }
        let q = d - z;
        let first = -3.0 * q * q / z - q.powi(3) / (z * z);
        let second = 6.0 * q / z + 6.0 * q * q / (z * z) + 2.0 * q.powi(3) / z.powi(3);
        [k * q.powi(3) / z, k * first, k * second]
    }

    /// Returns (V(z₁) − V(z₀))/(z₁ − z₀) and its derivative by z₁.
    fn quotient(&self, z0: f64, z1: f64) -> [f64; 2] {
        let ([v0, ..], [v1, s1, _]) = (self.jet(z0), self.jet(z1));
        let change = z1 - z0;
        if change.abs() < 1e-7 * self.distance {
            let [_, slope, curvature] = self.jet(0.5 * (z0 + z1));
            return [slope, 0.5 * curvature];
        }
        let gamma = (v1 - v0) / change;
        [gamma, (s1 - gamma) / change]
    }
}

impl Potential for Floor {
    fn name(&self) -> &str {
        "floor"
    }
    fn account(&self) -> Account {
        Account::Contact
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 3, nodes: &self.nodes }
    }
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }
    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out) {
            *out = self.jet(self.height(stencil, x))[0];
        }
    }
    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(3)) {
            out.copy_from_slice(&[0.0, 0.0, self.jet(self.height(stencil, x))[1]]);
        }
    }
    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(6)) {
            out.fill(0.0);
            out[5] = self.jet(self.height(stencil, x))[2];
        }
    }
    fn discrete_gradient(&self) -> Option<&dyn DiscreteGradient> {
        Some(self)
    }
    fn limits_steps(&self) -> bool {
        true
    }
    fn largest_step(&self, x: &[f64], dx: &[f64]) -> f64 {
        let limit = |&node: &u32| {
            let (z, dz) = (x[3 * node as usize + 2], dx[3 * node as usize + 2]);
            // Keep a tenth of the distance to the floor.
            if z + dz < 0.1 * z { 0.9 * z / -dz } else { 1.0 }
        };
        self.nodes.iter().map(limit).fold(1.0, f64::min)
    }
}

impl DiscreteGradient for Floor {
    fn gradients(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(3)) {
            let [gamma, _] = self.quotient(self.height(stencil, start), self.height(stencil, end));
            out.copy_from_slice(&[0.0, 0.0, gamma]);
        }
    }
    fn tangents(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(6)) {
            let [_, rate] = self.quotient(self.height(stencil, start), self.height(stencil, end));
            out.fill(0.0);
            out[5] = rate;
        }
    }
}

/// The floor as a live term: its stencils are the points near the floor.
pub struct LiveFloor {
    pub count: u32,
    pub distance: f64,
    pub stiffness: f64,
}

impl Live for LiveFloor {
    fn name(&self) -> &str {
        "floor"
    }
    fn reach(&self) -> f64 {
        0.5 * self.distance
    }
    fn near(&self, x: &[f64], reach: f64) -> Arc<dyn Potential> {
        let is_low = |&node: &u32| x[3 * node as usize + 2] < self.distance + reach;
        let nodes = (0..self.count).filter(is_low).collect();
        Arc::new(Floor { nodes, distance: self.distance, stiffness: self.stiffness })
    }
}
