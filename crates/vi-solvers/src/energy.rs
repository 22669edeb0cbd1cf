//! The energy of a system by account, summed so that drift tests see the scheme and not the sum.
//!
//! Every chunk is summed in eight interleaved lanes with the error of each addition kept (Knuth's
//! TwoSum), chunks in order the same way: the result is correct to the last bit or two, and the same
//! on any number of threads. This room must not know gradients.

use rayon::prelude::*;
use vi_core::{Account, System};

use crate::gather::{self, Mobility, Span};

/// The energy of the accounts, J.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Energies {
    /// Strain energy.
    pub elastic: f64,
    /// Weight.
    pub gravity: f64,
    /// Other conservative loads.
    pub load: f64,
}

impl Energies {
    /// V, J.
    pub fn total(&self) -> f64 {
        self.elastic + self.gravity + self.load
    }
}

const LANES: usize = 8;

/// Stencils whose energies are evaluated together.
const BATCH: usize = 256;

/// Below this many stencils a sum is made on the calling thread.
const PARALLEL_STENCILS: usize = 6000;

/// A sum and the rounding errors that it left.
#[derive(Clone, Copy, Default)]
struct Compensated {
    sum: f64,
    error: f64,
}

impl Compensated {
    fn add(&mut self, value: f64) {
        let sum = self.sum + value;
        let shadow = sum - self.sum;
        self.error += (self.sum - (sum - shadow)) + (value - shadow);
        self.sum = sum;
    }

    /// The sum; the errors of an infinite sum are not numbers and say nothing.
    fn value(self) -> f64 {
        if self.sum.is_finite() { self.sum + self.error } else { self.sum }
    }
}

#[derive(Clone, Copy)]
struct Lanes([Compensated; LANES]);

impl Lanes {
    fn add(&mut self, values: &[f64]) {
        let (rows, rest) = values.as_chunks::<LANES>();
        for row in rows {
            for lane in 0..LANES {
                self.0[lane].add(row[lane]);
            }
        }
        for (lane, &value) in self.0.iter_mut().zip(rest) {
            lane.add(value);
        }
    }

    fn total(self) -> Compensated {
        let mut total = Compensated::default();
        for lane in self.0 {
            total.add(lane.sum);
            total.error += lane.error;
        }
        total
    }
}

struct Part {
    span: Span,
    total: Compensated,
    /// Nothing that the energy depends on can change.
    constant: bool,
}

/// The parts of the sum, in order.
pub(crate) struct EnergySum {
    parts: Vec<Part>,
    /// Stencils to evaluate at each call.
    stencil_count: usize,
    constant_known: bool,
}

impl EnergySum {
    pub(crate) fn new(system: &System) -> Self {
        let mobility = gather::mobilities(system);
        let mut parts = Vec::new();
        let mut stencil_count = 0;
        for (term, potential) in system.potentials().iter().enumerate() {
            let time_dependent = potential.traits().time_dependent;
            for span in gather::spans(term, potential.as_ref()) {
                let constant = !time_dependent && all_fixed(&span, system, &mobility);
                stencil_count += if constant { 0 } else { span.stencils.len() };
                parts.push(Part { span, total: Compensated::default(), constant });
            }
        }
        Self { parts, stencil_count, constant_known: false }
    }

    /// V(x, t) by account.
    pub(crate) fn evaluate(&mut self, system: &System, x: &[f64], t: f64) -> Energies {
        let skip = self.constant_known;
        let update = |part: &mut Part| {
            if !(skip && part.constant) {
                part.total = sum_span(&part.span, system, x, t);
            }
        };
        if self.stencil_count >= PARALLEL_STENCILS {
            self.parts.par_iter_mut().for_each(update);
        } else {
            self.parts.iter_mut().for_each(update);
        }
        self.constant_known = true;
        let mut accounts = [Compensated::default(); 3];
        for part in &self.parts {
            let account = match system.potentials()[part.span.term].account() {
                Account::Elastic => 0,
                Account::Gravity => 1,
                Account::Load => 2,
            };
            accounts[account].add(part.total.sum);
            accounts[account].error += part.total.error;
        }
        let [elastic, gravity, load] = accounts.map(Compensated::value);
        Energies { elastic, gravity, load }
    }
}

fn all_fixed(span: &Span, system: &System, mobility: &[Mobility]) -> bool {
    gather::mobility_of(span, system.potentials()[span.term].as_ref(), mobility) == (false, false)
}

fn sum_span(span: &Span, system: &System, x: &[f64], t: f64) -> Compensated {
    let potential = &system.potentials()[span.term];
    let mut lanes = Lanes([Compensated::default(); LANES]);
    gather::with_scratch(BATCH, |scratch| {
        for first in span.stencils.clone().step_by(BATCH) {
            let batch = first..span.stencils.end.min(first + BATCH);
            let values = &mut scratch[..batch.len()];
            potential.energies(batch, x, t, values);
            lanes.add(values);
        }
    });
    lanes.total()
}
