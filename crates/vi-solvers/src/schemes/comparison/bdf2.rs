//! Backward differences of order 2: q₂ = (4 q₁ − q₀)/3 + (2h/3) v₂ and v₂ = (4 v₁ − v₀)/3 + (2h/3) a₂. The first
//! step, and the first one after a change of h or of the state, is a step of implicit midpoint, which keeps the
//! order.

use vi_core::{State, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::memory::StepperMemory;
use crate::schemes::comparison::carried::continues;
use crate::schemes::one_stage::rule::{Midpoint, MultiplierDirections, Rule};

#[derive(Default)]
pub(crate) struct Bdf2 {
    /// The last two states, and the step between them.
    last: Option<(State, State, f64)>,
    /// q₁ − q₀ and v₁ − v₀ of the current step; empty in a first step.
    dq: Vec<f64>,
    dv: Vec<f64>,
}

impl Bdf2 {
    fn is_first(&self) -> bool {
        self.dq.is_empty()
    }
}

impl Rule for Bdf2 {
    fn name(&self) -> &'static str {
        "bdf2"
    }
    fn coefficient(&self, h: f64) -> f64 {
        if self.is_first() { Midpoint::new().coefficient(h) } else { 4.0 / 9.0 * h * h }
    }
    fn books_in_middle(&self) -> bool {
        true
    }
    fn time(&self) -> f64 {
        if self.is_first() { Midpoint::new().time() } else { 1.0 }
    }
    fn offset(&self, k: usize, v: f64, h: f64) -> f64 {
        if self.is_first() {
            return Midpoint::new().offset(k, v, h);
        }
        self.dq[k] / 3.0 + 2.0 / 3.0 * h * (v + self.dv[k] / 3.0)
    }
    fn change(&self, k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        if self.is_first() {
            return Midpoint::new().change(k, v, w, h);
        }
        (self.offset(k, v, h) + w, self.dv[k] / 3.0 + 1.5 * w / h)
    }
    fn multiplier_directions(&self) -> Option<MultiplierDirections> {
        Some(MultiplierDirections::Stage)
    }
    fn open(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
        inertia: &Inertia,
        state: &State,
        h: f64,
    ) -> Result<(), SolverError> {
        self.dq.clear();
        self.dv.clear();
        if let Some((older, last, step)) = &self.last
            && continues(last, state, h)
            && (step / h - 1.0).abs() < 1e-9
        {
            self.dq.extend(last.q.iter().zip(&older.q).map(|(a, b)| a - b));
            self.dv.extend(last.p.iter().zip(&older.p).map(|(a, b)| a - b));
            inertia.divide(system, &mut self.dv, &mut evaluator.work);
        }
        Ok(())
    }
    fn close(&mut self, _: &System, before: &State, after: &State, _w: &[f64], h: f64) {
        self.last = Some((before.clone(), after.clone(), h));
    }
    fn save(&self, memory: &mut StepperMemory) {
        if let Some((older, last, h)) = &self.last {
            memory.arrays.push(("bdf2.times".into(), vec![older.t, last.t, *h]));
            for (name, array) in [("q0", &older.q), ("p0", &older.p), ("q1", &last.q), ("p1", &last.p)] {
                memory.arrays.push((format!("bdf2.{name}"), array.clone()));
            }
        }
    }
    fn restore(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        let names = ["bdf2.times", "bdf2.q0", "bdf2.p0", "bdf2.q1", "bdf2.p1"];
        self.last = match names.map(|name| memory.array(name)) {
            [Ok(&[t0, t1, h]), Ok(q0), Ok(p0), Ok(q1), Ok(p1)] => {
                let state = |t: f64, q: &[f64], p: &[f64]| State { t, q: q.to_vec(), p: p.to_vec() };
                Some((state(t0, q0, p0), state(t1, q1, p1), h))
            }
            _ => None,
        };
        Ok(())
    }
}
