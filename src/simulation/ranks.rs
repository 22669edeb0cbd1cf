//! Lets several ranks step the components of a simulation.

use std::sync::Arc;

use vi_core::Exchange;
use vi_solvers::{Conductor, Member};

use super::{Simulation, is_worked_on};
use crate::model;
use crate::scene::{GuardAction, Problem, Scene};

impl Simulation {
    /// Returns the keys of the scene that do not run on several ranks.
    pub(crate) fn problems_of_ranks(&self) -> Vec<Problem> {
        let scene = &self.scene;
        let switches = scene.guard.is_some_and(|guard| guard.action == GuardAction::Switch);
        let refused = [
            (scene.statics.is_some(), "static", "equilibria do not run on several ranks yet"),
            (scene.contact.is_some(), "contact", "contact does not run on several ranks yet"),
            (
                scene.time.is_adaptive(),
                "time.step",
                "adaptive steps ask one rank for the frequencies of the whole body; write a step in s",
            ),
            (scene.time.estimate, "time.estimate", "the run that estimates errors would use one rank only"),
            (
                switches,
                "guard.action",
                "\"energy-momentum\" does not run on several ranks: use \"halve\" or \"stop\"",
            ),
        ];
        let refused = refused.into_iter().filter(|(is_asked, ..)| *is_asked);
        refused
            .map(|(_, key, why)| Problem::new(key, format!("{why}; remove this key, or use one rank")))
            .collect()
    }

    /// Makes all ranks of `exchange` step the components; this is the first rank. Returns the number of bytes that it
    /// sends to others per evaluation of forces. Exchanges nothing itself.
    ///
    /// # Errors
    /// Returns the terms that do not run on several ranks; the simulation must not be used afterwards.
    pub(crate) fn conduct(&mut self, exchange: &Arc<dyn Exchange>) -> Result<u64, Vec<Problem>> {
        let method = self.method;
        let (mut problems, mut bytes) = (Vec::new(), 0);
        for (number, component) in self.components.iter_mut().enumerate() {
            let Some(alone) = component.stepper.take() else { continue };
            let place = (number, &component.system, &component.state);
            match Conductor::new(alone, place, (&method, component.keeps_ledger), Arc::clone(exchange)) {
                Ok(mut conductor) => {
                    bytes += conductor.bytes_sent() as u64;
                    component.stepper = Some(Box::new(conductor));
                }
                Err(error) => problems.push(Problem::new("time.scheme", error.to_string())),
            }
        }
        if problems.is_empty() { Ok(bytes) } else { Err(problems) }
    }
}

/// Returns the portions of the components of a scene that this rank steps; `None` for a component without a free
/// coordinate.
///
/// # Errors
/// Returns all problems of the scene and its meshes.
pub(crate) fn members(
    scene: &Scene,
    exchange: &Arc<dyn Exchange>,
) -> Result<Vec<Option<Member>>, Vec<Problem>> {
    let refused = |why: String| vec![Problem::new("time.scheme", why)];
    let method = scene.time.method().ok_or_else(|| refused("the scheme is not settled".to_owned()))?;
    let components = model::build_in_portions(scene)?.into_iter();
    components
        .map(|(system, state)| {
            let keeps_ledger = scene.output.ledger.unwrap_or_else(|| is_worked_on(&system));
            if system.coordinates().free_count() == 0 {
                return Ok(None);
            }
            let member = Member::new(&system, &state, (&method, keeps_ledger), Arc::clone(exchange));
            member.map(Some).map_err(|error| refused(error.to_string()))
        })
        .collect()
}
