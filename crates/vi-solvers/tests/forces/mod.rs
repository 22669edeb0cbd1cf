//! Small forces without a potential, for tests.
#![allow(dead_code, unreachable_pub, reason = "every test file uses its part")]

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Force, ForceAccount, Path, Stencils};

/// The path x = t.
pub struct Clock;

impl Path for Clock {
    fn position(&self, t: f64, out: &mut [f64]) {
        out.fill(t);
    }
    fn velocity(&self, _t: f64, out: &mut [f64]) {
        out.fill(1.0);
    }
}

/// The force f = c (−y, x) on coordinates 0 and 1 of node 0, which has no potential.
pub struct Turning {
    pub c: f64,
    /// Coordinates per node.
    pub block: usize,
}

impl Force for Turning {
    fn name(&self) -> &str {
        "turning force"
    }
    fn account(&self) -> ForceAccount {
        ForceAccount::Force
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: self.block, nodes: &[0] }
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    fn forces(&self, _: Range<usize>, x: &[f64], _v: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
        (out[0], out[1]) = (-self.c * x[1], self.c * x[0]);
    }
    fn stiffness(&self, _: Range<usize>, _x: &[f64], _v: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
    }
    fn damping(&self, _: Range<usize>, _x: &[f64], _v: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
    }
}

/// The force f = a + b x − c v on coordinate 0.
pub struct Linear {
    a: f64,
    b: f64,
    c: f64,
}

impl Linear {
    pub fn shared(a: f64, b: f64, c: f64) -> Arc<dyn Force> {
        Arc::new(Self { a, b, c })
    }
}

impl Force for Linear {
    fn name(&self) -> &str {
        "linear force"
    }
    fn account(&self) -> ForceAccount {
        if self.c == 0.0 { ForceAccount::Force } else { ForceAccount::Damping }
    }
    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 1, nodes: &[0] }
    }
    fn depends_on_velocity(&self) -> bool {
        self.c != 0.0
    }
    fn forces(&self, _: Range<usize>, x: &[f64], v: &[f64], _t: f64, out: &mut [f64]) {
        out[0] = self.a + self.b * x[0] - self.c * v[0];
    }
    fn stiffness(&self, _: Range<usize>, _x: &[f64], _v: &[f64], _t: f64, out: &mut [f64]) {
        out[0] = -self.b;
    }
    fn damping(&self, _: Range<usize>, _x: &[f64], _v: &[f64], _t: f64, out: &mut [f64]) {
        out[0] = self.c;
    }
}
