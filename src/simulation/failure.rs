//! Explains a step that failed: in numbers of the bodies' own meshes, and with the pair of surfaces that are in each
//! other's way.

use vi_contact::Gap;
use vi_core::State;
use vi_solvers::{PairInContact, SolverError, StepError};

use super::Simulation;
use crate::model::{BodyModel, name_of, part_in_words};

/// A gap below this fraction of its layer d̂ means that the layer is too soft for the force on it.
const PRESSED: f64 = 1e-2;

impl Simulation {
    /// Returns the error of component `number` with the facts that a user needs. `from` is the state from which the step
    /// or the substep that failed began.
    pub(super) fn explain(&self, number: usize, error: StepError, from: &State) -> StepError {
        let error = in_numbers_of_meshes(&self.bodies, number, error);
        let pair = self.pair_in_contact(number, &error, from);
        let rubs = self.components[number].system.terms().live().iter().any(|term| term.dissipates());
        // Friction may support a body that has no other support.
        if self.scene.statics.is_some() && !error.is_interruption() && !(rubs && pair.is_some()) {
            let last = match &error.cause {
                SolverError::Equilibrium { last, .. } => last,
                _ => from,
            };
            let load_factor = if self.load_factor().is_some() { last.t + error.h } else { error.t + error.h };
            if let Some(cause) = self.unheld(number, last, load_factor) {
                return StepError { cause, ..error };
            }
        }
        match pair {
            Some(pair) => {
                let cause = SolverError::InContact { cause: Box::new(error.cause), pair: Box::new(pair) };
                StepError { cause, ..error }
            }
            None => error,
        }
    }

    /// Returns the pair of surfaces at which a step failed: the one that obstructs its path, or the first that would meet if
    /// all nodes kept their velocities, or the one whose gap is the smallest fraction of its layer.
    fn pair_in_contact(&self, number: usize, error: &StepError, from: &State) -> Option<PairInContact> {
        let cause = &error.cause;
        let is_possible = matches!(
            cause,
            SolverError::NoConvergence { .. }
                | SolverError::Crossing { .. }
                | SolverError::UnresolvedContact { .. }
                | SolverError::Equilibrium { .. }
                | SolverError::ArcStep { .. }
                | SolverError::ControlStep { .. }
                | SolverError::NotPositiveDefinite(_)
                | SolverError::NegativeCurvature { .. }
                | SolverError::ConjugateGradients { .. }
                | SolverError::Residual { .. }
                | SolverError::Term { .. }
                | SolverError::NotFinite { .. }
        );
        let component = &self.components[number];
        let contact = component.contact.as_ref().filter(|_| is_possible)?;
        let from = match cause {
            SolverError::Equilibrium { last, .. } => last,
            _ => from,
        };
        let x = component.system.positions(from);
        let end = || -> Vec<f64> {
            let velocities = component.system.velocities(from);
            x.iter().zip(&velocities).map(|(x, v)| x + error.h * v).collect()
        };
        let moves = self.scene.statics.is_none();
        let met = cause.obstacle().or_else(|| moves.then(|| contact.first_to_meet(&x, &end())).flatten());
        let Gap { gap, distance, bodies, nodes } = contact.tightest(&x, met)?;
        // An element may leave the domain of its law, or a number its range, for other reasons than contact.
        let is_of_contact = match cause {
            SolverError::Term { term, .. } => *term.term == *"contact" || gap < distance,
            SolverError::NotFinite { .. } => met.is_some() || gap < distance,
            _ => true,
        };
        if !is_of_contact {
            return None;
        }
        let place = 3 * nodes[0][0] as usize;
        let parts = nodes.map(|nodes| part_in_words(&self.bodies, &self.rigids, number, &nodes));
        let is_on_rims = self.scene.statics.is_some() && contact.rims_coincide(bodies, &x);
        let bodies = bodies.map(|body| contact.number_of(body));
        let names_step = matches!(cause, SolverError::UnresolvedContact { .. });
        let mut way_out = self.way_out(bodies, gap / distance, names_step);
        if is_on_rims {
            let [first, second] = bodies.map(|body| name_of(&self.scene, body));
            way_out = format!(
                "make '{first}' wider or narrower than '{second}' by this layer or more on each side, because rims of both lie on \
                 each other and nodes slide off them, or {way_out}"
            );
        }
        let bodies = bodies.map(|body| name_of(&self.scene, body).to_owned());
        Some(PairInContact {
            bodies,
            parts,
            place: [x[place], x[place + 1], x[place + 2]],
            gap,
            layer: distance,
            way_out,
        })
    }

    /// Returns what to write in a scene whose step fails at two bodies. `gap` is relative to the layer; if `names_step`, the error itself
    /// names another step and other schemes.
    fn way_out(&self, bodies: [usize; 2], gap: f64, names_step: bool) -> String {
        let [first, second] = bodies.map(|body| name_of(&self.scene, body));
        let mut ways = Vec::new();
        for body in bodies {
            let rigid = body.checked_sub(self.bodies.len()).map(|rigid| &self.scene.rigids[rigid]);
            if rigid.is_some_and(|rigid| rigid.motion.is_some()) {
                let name = name_of(&self.scene, body);
                ways.push(format!("give the motion of '{name}' more room or more time"));
            }
        }
        let mut contacts = self.components.iter().filter_map(|component| component.contact.as_ref());
        let law = contacts.find_map(|contact| contact.law(bodies[0], bodies[1]));
        if gap < PRESSED
            && let Some(law) = law
        {
            ways.push(format!("make the layer stiffer (`contact.stiffness`, here {:.3e} Pa)", law.stiffness));
        }
        if self.scene.statics.is_some()
            && let Some(law) = law.filter(|law| law.friction > 0.0)
        {
            ways.push(format!(
                "if friction is to hold them, raise it (`contact.friction`, here {})",
                law.friction
            ));
            ways.push("if they are to slide, step time instead (without [static])".to_owned());
        }
        if self.scene.statics.is_some() {
            ways.push("load in smaller increments (`time.step`)".to_owned());
        } else if !names_step {
            ways.push(format!("shorten `time.step` ({:e} s)", self.h));
        }
        let takes_any_step = self.method.facts().accepts.dissipative_terms;
        if !takes_any_step && !names_step && self.scene.statics.is_none() {
            ways.push("use energy-momentum, which need not resolve contact".to_owned());
        }
        let dissipates = self.scene.contact.as_ref().is_some_and(|contact| contact.damping > 0.0);
        if !dissipates && self.scene.statics.is_none() {
            ways.push("damp the impact (`contact.damping`, s)".to_owned());
        }
        ways.push(match first == second {
            true => "switch self-contact off (`contact.self = false`)".to_owned(),
            false => format!("let them pass (`contact.exclude = [[\"{first}\", \"{second}\"]]`)"),
        });
        ways.join(", or ")
    }
}

/// Converts the coordinate in a component's error to the numbering of the bodies' own meshes.
fn in_numbers_of_meshes(bodies: &[BodyModel], component: usize, mut error: StepError) -> StepError {
    if let SolverError::NotFinite { dof, .. } = &mut error.cause {
        let body = bodies.iter().filter(|body| body.component == component).find_map(|body| {
            let number = (*dof / 3).checked_sub(body.node_offset)? as u32;
            Some(body.node_offset + body.numbering.node(number)? as usize)
        });
        *dof = body.map_or(*dof, |node| 3 * node + *dof % 3);
    }
    error
}
