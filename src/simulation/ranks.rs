//! Lets several ranks share the components of a simulation.

use std::sync::Arc;

use vi_core::{Exchange, State, System};
use vi_solvers::{Member, SolverOptions};

use super::{Simulation, is_worked_on};
use crate::model;
use crate::scene::{GuardAction, Problem, Scene};

/// Returns the keys of a scene that do not run on several ranks.
pub(crate) fn problems_of_ranks(scene: &Scene) -> Vec<Problem> {
    let switches = scene.guard.is_some_and(|guard| guard.action == GuardAction::Switch);
    let refused = [
        (scene.statics.is_some(), "static", "equilibria do not run on several ranks yet"),
        (scene.time.estimate, "time.estimate", "the run that estimates errors would use one rank only"),
        (
            switches,
            "guard.action",
            "a change of the scheme is not sent to other ranks: use \"halve\" or \"stop\"",
        ),
    ];
    let refused = refused.into_iter().filter(|(is_asked, ..)| *is_asked);
    refused
        .map(|(_, key, why)| Problem::new(key, format!("{why}; remove this key, or use one rank")))
        .collect()
}

impl Simulation {
    /// Returns the number of bytes that the first rank sends to others per evaluation of forces.
    pub(crate) fn bytes_sent(&self) -> u64 {
        let shared = self.components.iter().filter_map(|component| component.system.terms().shared());
        shared.map(|shared| shared.bytes_sent() as u64).sum()
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
    let components = model::build(scene, true)?.components.into_iter();
    components
        .map(|(system, state): (System, State)| {
            let ledger = scene.output.ledger.unwrap_or_else(|| is_worked_on(&system));
            let options = SolverOptions { ledger, ..scene.solver.options() };
            if system.coordinates().free_count() == 0 {
                return Ok(None);
            }
            let member = Member::new(&system, &state, (&method, &options), Arc::clone(exchange));
            member.map(Some).map_err(|error| refused(error.to_string()))
        })
        .collect()
}
