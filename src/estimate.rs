//! `[time] estimate = true`: how far off is each probe? Companions of the run solve the same scene by
//! other steps, beside it; their differences tell. It must not change the run, nor write.
//!
//! Explicit schemes: Blanes–Moan 4 as the shadow of the run, whose error is taken to be nothing, and the
//! scheme itself with h/2. Implicit schemes: the scheme itself with 2h and h/2. Either gives the error e of
//! the run and the order p that it shows: with the shadow s, e = u_h − u_s and
//! 2^p = |u_h − u_s| / |u_{h/2} − u_s|; with the triple, 2^p = |u_{2h} − u_h| / |u_h − u_{h/2}| and
//! e = 2^p/(2^p − 1) · (u_h − u_{h/2}).

use serde::Serialize;

use vi_solvers::SolverError;

use crate::checkpoint::record::record;
use crate::scene::SchemeName;
use crate::simulation::{ProbeValue, Simulation, Snapshot};
use crate::trial::{Choice, highest};

/// The estimated error of a probe.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ProbeEstimate {
    /// |error| of the displacement, each axis, m.
    pub error: [f64; 3],
    /// Order observed; none where the differences do not show one.
    pub observed_order: Option<f64>,
}

record!(ProbeEstimate { error: [f64; 3], observed_order: Option<f64> });

/// The companions of a run between two steps; none where there is none or it was lost.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Companions {
    double: Option<Snapshot>,
    half: Option<Snapshot>,
    shadow: Option<Snapshot>,
    notes: Vec<String>,
}

record!(Companions {
    double: Option<Snapshot>,
    half: Option<Snapshot>,
    shadow: Option<Snapshot>,
    notes: Vec<String>,
});

/// The companions of a run.
pub struct Estimator {
    /// Twice the step; implicit schemes.
    double: Option<Simulation>,
    /// Half the step.
    half: Option<Simulation>,
    /// Blanes–Moan 4; explicit schemes.
    shadow: Option<Simulation>,
    /// Steps of the run after which all companions can be compared with it: 1 or 2.
    stride: u64,
    order: f64,
    notes: Vec<String>,
}

impl Estimator {
    /// Companions of a simulation that has not begun.
    pub fn new(simulation: &Simulation) -> Self {
        let scene = simulation.scene();
        let choice = Choice::of(scene);
        let facts = choice.method().facts();
        let mut notes = Vec::new();
        let mut companion = |choice: Choice| match Simulation::new(choice.apply(scene)) {
            Ok(companion) => Some(companion),
            Err(problems) => {
                notes.extend(problems.iter().map(|problem| format!("no error estimate: {problem}")));
                None
            }
        };
        let steps = choice.steps;
        let half = companion(Choice { steps: 2 * steps, ..choice });
        let can_double = steps.is_multiple_of(2);
        let (double, shadow, stride) = if facts.is_explicit {
            let shadow = Choice { scheme: SchemeName::BlanesMoan4, stages: None, steps };
            let limit = shadow.method().facts().recommended_limit.unwrap_or(0.0);
            // At twice the step it costs 3 forces a step of the run, where that is stable.
            let is_slow =
                highest(simulation).is_some_and(|omega| 2.0 * simulation.step_size() * omega <= limit);
            let stride = if can_double && is_slow { 2 } else { 1 };
            (None, companion(Choice { steps: steps / stride, ..shadow }), stride)
        } else if can_double {
            (companion(Choice { steps: steps / 2, ..choice }), None, 2)
        } else {
            (None, None, 1)
        };
        Self { double, half, shadow, stride, order: facts.order as f64, notes }
    }

    /// What could not be done, in words.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What the companions are now.
    pub fn snapshot(&self) -> Companions {
        let of = |companion: &Option<Simulation>| companion.as_ref().map(Simulation::snapshot);
        let notes = self.notes.clone();
        Companions { double: of(&self.double), half: of(&self.half), shadow: of(&self.shadow), notes }
    }

    /// Makes the companions what those of an equal run were.
    ///
    /// # Errors
    /// As [`Simulation::restore`].
    pub fn restore(&mut self, was: &Companions) -> Result<(), SolverError> {
        let pairs =
            [(&mut self.double, &was.double), (&mut self.half, &was.half), (&mut self.shadow, &was.shadow)];
        for (companion, was) in pairs {
            match (companion.as_mut(), was) {
                (Some(companion), Some(was)) => companion.restore(was)?,
                _ => *companion = None,
            }
        }
        self.notes.clone_from(&was.notes);
        Ok(())
    }

    /// Brings all companions to `step` steps of the run and compares; none at a step on which not all of
    /// them land. A companion that fails is left behind, and [`Self::notes`] says so.
    pub fn compare(&mut self, step: u64, probes: &[ProbeValue]) -> Option<Vec<ProbeEstimate>> {
        if !step.is_multiple_of(self.stride) {
            return None;
        }
        let notes = &mut self.notes;
        let half = advance(&mut self.half, 2 * step, notes);
        let shadow = advance(&mut self.shadow, step / self.stride, notes);
        let double = advance(&mut self.double, step / 2, notes);
        let value = |index: usize| {
            let own = probes[index].displacement;
            let of = |others: &Option<Vec<ProbeValue>>| others.as_ref().map(|o| o[index].displacement);
            estimate(own, of(&double), of(&half), of(&shadow), self.order)
        };
        Some((0..probes.len()).map(value).collect())
    }
}

fn advance(
    companion: &mut Option<Simulation>,
    step: u64,
    notes: &mut Vec<String>,
) -> Option<Vec<ProbeValue>> {
    let simulation = companion.as_mut()?;
    while simulation.steps() < step {
        if let Err(error) = simulation.advance(step - simulation.steps()) {
            notes.push(format!("the error estimate lost a companion: {error}"));
            *companion = None;
            return None;
        }
    }
    Some(simulation.observe().probes)
}

type Vector = [f64; 3];

fn estimate(
    own: Vector,
    double: Option<Vector>,
    half: Option<Vector>,
    shadow: Option<Vector>,
    order: f64,
) -> ProbeEstimate {
    let minus = |a: Vector, b: Vector| -> Vector { std::array::from_fn(|k| a[k] - b[k]) };
    let size = |a: Vector| a.iter().map(|v| v * v).sum::<f64>().sqrt();
    let ratio_order = |coarse: Vector, fine: Vector| {
        let ratio = size(coarse) / size(fine);
        (ratio.is_finite() && ratio > 1.0).then(|| ratio.log2())
    };
    if let Some(shadow) = shadow {
        let error = minus(own, shadow);
        let observed_order = half.and_then(|half| ratio_order(error, minus(half, shadow)));
        return ProbeEstimate { error: error.map(f64::abs), observed_order };
    }
    let Some(half) = half else { return ProbeEstimate { error: [f64::NAN; 3], observed_order: None } };
    let difference = minus(own, half);
    let observed_order = double.and_then(|double| ratio_order(minus(double, own), difference));
    // Where the order cannot be seen, at least its own is not assumed to hold better than 1.
    let order = observed_order.map_or(1.0, |observed| observed.min(order));
    let factor = 2.0_f64.powf(order) / (2.0_f64.powf(order) - 1.0);
    ProbeEstimate { error: difference.map(|value| factor * value.abs()), observed_order }
}
