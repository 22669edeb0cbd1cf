//! The reference solution of a bench: two runs of one high-order scheme, with their difference as its error estimate.
//! It does not depend on the rows.

use std::time::{Duration, Instant};

use super::{BenchError, BenchWatch, ReferenceFacts};
use crate::auto::search::accepts;
use crate::auto::trial::{Choice, Limit, Norm, Trial, TrialError, run};
use crate::scene::{MassKind, Scene, SchemeName};
use crate::simulation::Simulation;

/// hω of the finer Blanes–Moan run: far inside the stability limit, with an error of 1e-9 or less if low modes
/// dominate the motion.
const FREQUENCY_STEP: f64 = 1.5;
/// Difference between reference solutions that is accurate enough for all rows.
const ENOUGH: f64 = 3e-11;
const GAUSS_TOLERANCE: f64 = 1e-10;

pub(super) struct Reference {
    pub(super) end: Vec<Vec<f64>>,
    pub(super) facts: ReferenceFacts,
}

/// Computes a reference within `share` of wall time, refined until the next halving would not fit. The method is that
/// of Blanes and Moan of order 6 if its steps fit, otherwise Gauss's with 3 stages. With contact, and in scenes that both
/// refuse, it is Störmer–Verlet, or implicit midpoint for consistent mass.
pub(super) fn find(
    simulation: &Simulation,
    scene: &Scene,
    norm: &Norm,
    omega: f64,
    share: Duration,
    watch: &mut dyn BenchWatch,
) -> Result<Reference, BenchError> {
    let begin = Instant::now();
    let explicit = Choice {
        scheme: SchemeName::BlanesMoan6,
        stages: None,
        steps: ((scene.time.end * omega / FREQUENCY_STEP).ceil() as u64).max(16),
    };
    let gauss = Choice { scheme: SchemeName::Gauss, stages: Some(3), steps: 64 };
    if scene.contact.is_some() || ![explicit, gauss].iter().any(|choice| accepts(simulation, scene, choice)) {
        let choice = of_order_2(scene, omega);
        return ladder(scene, norm, choice, share, begin, watch).map_err(|why| match why {
            TrialError::Stopped => BenchError::Stopped,
            why => BenchError::Reference { why: format!("{}: {why}", choice.label()) },
        });
    }
    let mut tried = Vec::new();
    let probe_fraction = (4.0 / explicit.steps as f64).min(1.0);
    let probe = run(explicit.apply(scene), 0.0..probe_fraction, Limit::Clock(share), &mut || watch.go_on());
    match probe.map(|probe| probe.seconds / 4.0 * explicit.steps as f64) {
        // Both runs together cost one and a half times the finer one.
        Ok(seconds) if 1.5 * seconds <= share.as_secs_f64() => {
            let pair = ladder(scene, norm, explicit, share, begin, watch);
            match pair {
                Ok(found) => return Ok(found),
                Err(why) => tried.push(format!("{}: {why}", explicit.label())),
            }
        }
        Ok(seconds) => tried.push(format!("{} would take {seconds:.0} s", explicit.label())),
        Err(why) => tried.push(format!("{}: {why}", explicit.label())),
    }
    if !watch.go_on() {
        return Err(BenchError::Stopped);
    }
    let mut tight = scene.clone();
    tight.solver.tolerance = tight.solver.tolerance.min(GAUSS_TOLERANCE);
    ladder(&tight, norm, gauss, share, begin, watch).map_err(|why| match why {
        TrialError::Stopped => BenchError::Stopped,
        why => {
            tried.push(format!("{}: {why}", gauss.label()));
            BenchError::Reference { why: tried.join("; ") }
        }
    })
}

/// Returns the scheme of the reference in scenes that schemes of higher order do not accept.
fn of_order_2(scene: &Scene, omega: f64) -> Choice {
    let steps = ((scene.time.end * omega).ceil() as u64).max(16);
    let is_lumped = scene.solver.mass != Some(MassKind::Consistent);
    let scheme = if is_lumped { SchemeName::StormerVerlet } else { SchemeName::ImplicitMidpoint };
    Choice { scheme, stages: None, steps }
}

/// Halves the step from 2/`choice.steps` until two solutions agree or the time is used up.
fn ladder(
    scene: &Scene,
    norm: &Norm,
    choice: Choice,
    share: Duration,
    begin: Instant,
    watch: &mut dyn BenchWatch,
) -> Result<Reference, TrialError> {
    let mut coarser: Option<(u64, Trial)> = None;
    let mut best: Option<Reference> = None;
    let mut steps = choice.steps.div_ceil(2);
    loop {
        let left = share.saturating_sub(begin.elapsed());
        let fits = coarser.as_ref().is_none_or(|(_, trial)| 2.0 * trial.seconds < left.as_secs_f64());
        if best.is_some() && !fits {
            break;
        }
        let refined = Choice { steps, ..choice };
        watch.next(&format!("reference: {} in {steps} steps", choice.label()), 0.0, left);
        let done = run(refined.apply(scene), 0.0..1.0, Limit::Clock(left), &mut || watch.go_on());
        match (done, &coarser) {
            (Ok(trial), Some((coarser_steps, previous))) => {
                let difference = norm.error(&previous.end, &trial.end);
                if difference.is_finite() {
                    let facts = ReferenceFacts {
                        scheme: choice.label(),
                        steps,
                        difference,
                        coarser_steps: *coarser_steps,
                    };
                    best = Some(Reference { end: trial.end.clone(), facts });
                    if difference < ENOUGH {
                        break;
                    }
                }
                coarser = Some((steps, trial));
            }
            (Ok(trial), None) => coarser = Some((steps, trial)),
            // A finer run may succeed after a coarse run failed.
            (Err(TrialError::Failed(_)), None) if steps < 64 * choice.steps => {}
            (Err(why), _) if best.is_none() => return Err(why),
            (Err(_), _) => break,
        }
        steps *= 2;
    }
    best.ok_or(TrialError::Failed("no two solutions could be compared".to_owned()))
}
