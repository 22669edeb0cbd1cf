//! Sums the energy of a system by account so accurately that drift tests measure the scheme and not the sum.
//!
//! Each chunk is summed in eight interleaved lanes with the error of each addition kept (Knuth's TwoSum); the chunks
//! are then summed in order in the same way. The result is correct to the last one or two bits, and the same on any
//! number of threads.

use rayon::prelude::*;
use vi_core::{Account, RunEnergy, Terms};

use crate::assemble::spans::{Mobility, Span, mobilities, mobility_of, spans};
use crate::scratch::with_scratch;

/// The energy by account, J.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Energies {
    /// Strain energy.
    pub elastic: f64,
    /// Energy of weight.
    pub gravity: f64,
    /// Energy of other conservative loads.
    pub load: f64,
    /// Energy of contact.
    pub contact: f64,
}

impl std::ops::AddAssign for Energies {
    fn add_assign(&mut self, other: Self) {
        self.elastic += other.elastic;
        self.gravity += other.gravity;
        self.load += other.load;
        self.contact += other.contact;
    }
}

impl Energies {
    /// Returns the energies with `value` (J) added to an account.
    pub(crate) fn with(mut self, (account, value): (Account, f64)) -> Self {
        match account {
            Account::Elastic => self.elastic += value,
            Account::Gravity => self.gravity += value,
            Account::Load => self.load += value,
            Account::Contact => self.contact += value,
        }
        self
    }

    /// Returns V, J.
    pub fn total(&self) -> f64 {
        self.elastic + self.gravity + self.load + self.contact
    }
}

const LANES: usize = 8;

/// Number of stencils whose energies are evaluated together.
const BATCH: usize = 256;

/// With fewer stencils than this, the calling thread computes the sum alone.
const PARALLEL_STENCILS: usize = 6000;

/// A sum, and the sum of its rounding errors.
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

    /// Returns the corrected sum. The errors of an infinite sum are NaN and are ignored.
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
    /// Whether the energy of this part can never change.
    constant: bool,
    /// Whether another process has computed it.
    known: bool,
}

/// The parts of the sum, in order.
pub(crate) struct EnergySum {
    parts: Vec<Part>,
    /// Number of stencils to evaluate at each call.
    stencil_count: usize,
    constant_known: bool,
}

impl EnergySum {
    pub(crate) fn new(terms: &Terms) -> Self {
        let mobility = mobilities(terms);
        let mut parts = Vec::new();
        let mut stencil_count = 0;
        for (term, potential) in terms.fixed().iter().enumerate() {
            let time_dependent = potential.traits().time_dependent;
            for span in spans(term, potential.as_ref()) {
                let constant = !time_dependent && all_fixed(&span, terms, &mobility);
                stencil_count += if constant { 0 } else { span.stencils.len() };
                parts.push(Part { span, total: Compensated::default(), constant, known: false });
            }
        }
        Self { parts, stencil_count, constant_known: false }
    }

    /// Returns V(x, t) by account. `known` holds the energies of the parts that other processes have computed.
    pub(crate) fn evaluate(&mut self, terms: &Terms, x: &[f64], t: f64, known: &[RunEnergy]) -> Energies {
        let skip = self.constant_known;
        for &RunEnergy { term, first, sum, error } in known {
            let place = |part: &Part| (part.span.term, part.span.stencils.start);
            let part = self.parts.binary_search_by_key(&(term, first), place).unwrap_or_else(|part| {
                // This process does not have the stencils of the run.
                let span = Span { term, stencils: first..first };
                let total = Compensated::default();
                self.parts.insert(part, Part { span, total, constant: false, known: true });
                part
            });
            (self.parts[part].total, self.parts[part].known) = (Compensated { sum, error }, true);
        }
        let update = |part: &mut Part| {
            let is_known = std::mem::take(&mut part.known) || (skip && part.constant);
            if !is_known {
                part.total = sum_span(&part.span, terms, x, t);
            }
        };
        if self.stencil_count >= PARALLEL_STENCILS {
            self.parts.par_iter_mut().for_each(update);
        } else {
            self.parts.iter_mut().for_each(update);
        }
        self.constant_known = true;
        let mut accounts = [Compensated::default(); 4];
        for part in &self.parts {
            let account = match terms.fixed()[part.span.term].account() {
                Account::Elastic => 0,
                Account::Gravity => 1,
                Account::Load => 2,
                Account::Contact => 3,
            };
            accounts[account].add(part.total.sum);
            accounts[account].error += part.total.error;
        }
        let [elastic, gravity, load, contact] = accounts.map(Compensated::value);
        Energies { elastic, gravity, load, contact }
    }
}

/// Returns the energy of each span, as the sum and its error.
pub(crate) fn energies_of_spans(spans: &[Span], terms: &Terms, x: &[f64], t: f64) -> Vec<[f64; 2]> {
    let energy = |span: &Span| {
        let Compensated { sum, error } = sum_span(span, terms, x, t);
        [sum, error]
    };
    spans.par_iter().map(energy).collect()
}

fn all_fixed(span: &Span, terms: &Terms, mobility: &[Mobility]) -> bool {
    mobility_of(span, terms.fixed()[span.term].as_ref(), mobility) == (false, false)
}

fn sum_span(span: &Span, terms: &Terms, x: &[f64], t: f64) -> Compensated {
    let potential = &terms.fixed()[span.term];
    let mut lanes = Lanes([Compensated::default(); LANES]);
    with_scratch(BATCH, |scratch| {
        for first in span.stencils.clone().step_by(BATCH) {
            let batch = first..span.stencils.end.min(first + BATCH);
            let values = &mut scratch[..batch.len()];
            potential.energies(batch, x, t, values);
            lanes.add(values);
        }
    });
    lanes.total()
}
