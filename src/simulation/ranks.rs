//! Lets several ranks share the components of a simulation.

use std::sync::Arc;

use serde::Serialize;
use vi_core::{Exchange, State, System, Traffic};
use vi_solvers::{Interrupt, Member, SolverOptions};

use super::Simulation;
use super::needs::{keeps_ledger, method_of, problem_of_ranks};
use crate::model::parted::runs;
use crate::model::parts::{Runs, build_parts, is_separable, of_parted_meshes};
use crate::model::{self, BodyModel, Holding, Share};
use crate::scene::{GuardAction, LinearChoice, MassKind, Problem, Scene};

/// The ranks of a run, and the messages that they exchange.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankFacts {
    /// Number of ranks.
    pub count: usize,
    /// Largest number of bytes that a rank sends to others per evaluation of forces.
    pub bytes_per_force: u64,
    /// This number of bytes if each rank sent one sum per node and rank instead. The results would then depend on the
    /// number of ranks.
    pub bytes_per_force_of_node_sums: u64,
    /// Whether the ranks generated only the parts of the bodies that they need.
    pub in_parts: bool,
}

/// Returns the keys of a scene that do not run on several ranks.
pub(crate) fn problems_of_ranks(scene: &Scene) -> Vec<Problem> {
    let switches = scene.guard.is_some_and(|guard| guard.action == GuardAction::Switch);
    let refused = [
        (scene.time.estimate, "time.estimate", "the run that estimates errors would use one rank only"),
        (
            switches,
            "guard.action",
            "a change of the scheme is not sent to other ranks: use \"halve\" or \"stop\"",
        ),
        (
            scene.solver.mass == Some(MassKind::Filtered),
            "solver.mass",
            "the filter is a matrix of the whole system, which ranks do not share",
        ),
    ];
    let refused = refused.into_iter().filter(|(is_asked, ..)| *is_asked);
    refused
        .map(|(_, key, why)| Problem::new(key, format!("{why}; remove this key, or use one rank")))
        .collect()
}

/// Returns whether the ranks of an exchange share the terms of a scene. One rank does so only for a linear solver of the ranks.
pub(crate) fn is_shared(scene: &Scene, exchange: &Arc<dyn Exchange>) -> bool {
    let is_outside = scene.solver.linear == LinearChoice::Petsc;
    exchange.size() > 1 || is_outside && exchange.linear_solver().is_some()
}

impl Simulation {
    /// Builds the simulation as [`Simulation::new`] does, with terms that all ranks of `exchange` share. This is the first
    /// rank. Nothing may be evaluated before the others have made their [`members`]. With `in_parts`, ranks need only the parts
    /// of the bodies that they compute, if the scene allows it ([`Simulation::is_of_parts`]).
    ///
    /// # Errors
    /// Returns the errors of [`Simulation::new`], and terms that do not run on several ranks.
    pub(crate) fn shared(
        scene: Scene,
        in_parts: bool,
        exchange: &Arc<dyn Exchange>,
    ) -> Result<Self, Vec<Problem>> {
        // Other ranks do not hear the request.
        let scene = scene.interruptible(Interrupt::NEVER);
        // The first rank makes its portion from a part as the others do, without the maps of the whole sum.
        let is_sound = in_parts && scene.problems().is_empty() && is_separable(&scene);
        let own = if is_sound { members(&scene, true, exchange) } else { Ok(Vec::new()) };
        let own = own.or_else(|problems| match of_parted_meshes(&scene, problems) {
            // The whole bodies show what else is wrong.
            wrong if wrong.is_empty() => Ok(Vec::new()),
            wrong => Err(wrong),
        })?;
        let own = if are_complete(&own) { own } else { Vec::new() };
        Self::build(scene, (exchange, own), Ok)
    }

    /// Returns whether all ranks make their portions from the parts of the bodies that they need, instead of whole bodies.
    pub(crate) fn is_of_parts(&self) -> bool {
        self.components.iter().all(|component| component.is_of_parts)
    }

    /// Returns why elements that no process holds as a whole could not be read since the start.
    pub(crate) fn mesh_fault(&self) -> Option<String> {
        self.bodies.iter().find_map(BodyModel::far_fault)
    }

    /// Returns what the first rank sends to others per evaluation of forces.
    pub(crate) fn traffic(&self) -> Traffic {
        let shared = self.components.iter().filter_map(|component| component.system.terms().shared());
        let mut total = Traffic::default();
        shared.for_each(|shared| total += shared.traffic());
        total
    }

    /// Records the facts on the ranks, for the report.
    pub(crate) fn with_ranks(self, facts: RankFacts) -> Self {
        Self { ranks: Some(facts), ..self }
    }
}

/// Returns whether these portions can be those of parts: every component has one, which is complete.
pub(crate) fn are_complete(members: &[Option<Member>]) -> bool {
    members.iter().all(|member| member.as_ref().is_some_and(Member::is_complete))
}

/// Returns the nodes of a component that each of several ranks holds, if this rank does not hold its elements.
pub(crate) fn far_nodes(bodies: &[BodyModel], component: usize, size: usize) -> Option<Vec<Vec<u32>>> {
    // Such a body is a component.
    let body = bodies.iter().find(|body| body.component == component)?;
    let far = body.far.as_ref()?;
    let mut nodes = far.nodes_of_processes(&runs(far.kind(), far.count(), size));
    for nodes in &mut nodes {
        nodes.iter_mut().for_each(|node| *node = body.numbering.of(*node));
        nodes.sort_unstable();
    }
    Some(nodes)
}

/// Returns the portions of the components of a scene that this rank steps; `None` for a component without a free
/// coordinate. If `in_parts`, this rank generates only the parts of the bodies that it needs
/// ([`Simulation::is_of_parts`]).
///
/// # Errors
/// Returns all problems of the scene and its meshes.
pub(crate) fn members(
    scene: &Scene,
    in_parts: bool,
    exchange: &Arc<dyn Exchange>,
) -> Result<Vec<Option<Member>>, Vec<Problem>> {
    let refused = |why: String| vec![Problem::new("time.scheme", why)];
    let method = method_of(scene).ok_or_else(|| refused("the scheme is not settled".to_owned()))?;
    let components: Vec<_> = match in_parts {
        true => {
            let share = Share { process: exchange.rank(), count: exchange.size() };
            let parts = build_parts(scene, share)?.into_iter();
            parts.map(|(system, state, runs)| (system, state, Some(runs))).collect()
        }
        false => {
            let whole = model::build(scene, Holding::Portions)?.components.into_iter();
            whole.map(|(system, state)| (system, state, None)).collect()
        }
    };
    components
        .into_iter()
        .map(|(system, state, runs): (System, State, Option<Runs>)| {
            let ledger = keeps_ledger(scene, &system);
            let options = SolverOptions { ledger, ..scene.solver.options() };
            if system.coordinates().free_count() == 0 {
                return Ok(None);
            }
            let (run, exchange) = ((&method, &options), Arc::clone(exchange));
            let member = match &runs {
                Some(runs) => Member::of_part((system, state), runs, run, exchange),
                None => Member::new(&system, &state, run, exchange),
            };
            member.map(Some).map_err(|error| vec![problem_of_ranks(&error)])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;
    use vi_core::ThreadRank;

    /// A byte string that no first rank sends.
    const END: &[u8] = b"end";

    fn scene(element: CellKind, held: bool) -> Scene {
        let shape = BoxMesh { size: [1.0, 0.3, 0.4], cells: [14, 6, 5], element, origin: [0.0; 3] };
        let law = Law::NeoHookean(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 });
        let body = Body::from_box("block", shape, law).angular_velocity([1.0, 6.0, 3.0]);
        let scene = Scene::new(Time::new(1e-3, 2e-4, SchemeName::StormerVerlet)).gravity([0.0, 0.0, -9.81]);
        let scene = scene.body(body);
        if held { scene.fix(Fix::region("block", "x-min")) } else { scene }
    }

    /// Returns a scene with a mesh file of 11 632 tetrahedra.
    fn of_file() -> Scene {
        let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/bracket.msh");
        let law = Law::NeoHookean(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 });
        let body = Body::from_mesh("bracket", mesh, law).angular_velocity([1.0, 6.0, 3.0]);
        let scene = Scene::new(Time::new(2.5e-6, 5e-7, SchemeName::StormerVerlet)).gravity([0.0, 0.0, -9.81]);
        scene.body(body).fix(Fix::region("bracket", "bolts"))
    }

    /// Ranks that generate only the parts that they need step to the bits of one process.
    #[test]
    fn parts_step_to_the_bits_of_the_whole() {
        let kinds = [(CellKind::Tet4, true), (CellKind::Hex8, true), (CellKind::Wedge6, false)];
        let whole = kinds.map(|(kind, held)| scene(kind, held)).into_iter().chain([of_file(), of_file()]);
        let place = tempfile::tempdir().unwrap();
        let index = place.path().join("bracket.parted");
        let mut of_parts = of_file();
        crate::model::pieces::part(&of_parts.bodies[0].mesh.clone().unwrap(), 5, 1.0, &index).unwrap();
        of_parts.bodies[0].mesh = Some(index);
        // The last scene has the mesh of the one before it, parted.
        let scenes = whole.clone().take(4).chain([of_parts]);
        for ((scene, whole), size) in scenes.zip(whole).zip([2, 3, 4, 3, 3]) {
            let scene = &scene;
            let mut alone = Simulation::new(whole).unwrap();
            for _ in 0..5 {
                alone.step().unwrap();
            }
            let crew = ThreadRank::crew(size).into_iter().map(|rank| Arc::new(rank) as Arc<dyn Exchange>);
            let mut crew = crew.collect::<Vec<_>>().into_iter();
            let first = crew.next().unwrap();
            std::thread::scope(|scope| {
                for rank in crew {
                    scope.spawn(move || {
                        let mut members = members(scene, true, &rank).unwrap();
                        loop {
                            let bytes = &rank.pieces(&[])[0];
                            if bytes == END {
                                return;
                            }
                            assert!(Member::obey(&mut members, bytes));
                        }
                    });
                }
                let mut shared = Simulation::shared(scene.clone(), true, &first).unwrap();
                assert!(shared.is_of_parts());
                let holds_elements =
                    scene.bodies[0].mesh.as_ref().is_some_and(|path| path.ends_with("bracket.msh"));
                assert_eq!(shared.bodies[0].far.is_none(), holds_elements);
                for _ in 0..5 {
                    shared.step().unwrap();
                }
                assert_eq!(shared.observe(), alone.observe());
                assert_eq!(shared.components[0].state, alone.components[0].state);
                first.pieces(END);
            });
        }
    }

    /// Bodies whose parts do not suffice are built whole by all ranks.
    #[test]
    fn only_plain_bodies_are_built_in_parts() {
        let plain = scene(CellKind::Tet4, true);
        assert!(crate::model::parts::is_separable(&plain));
        let mut refined = plain.clone();
        refined.bodies[0].refine = Some(Refine::Levels(1));
        let mut implicit = plain.clone();
        implicit.time.scheme = Some(SchemeName::ImplicitMidpoint);
        let mut finer = plain.clone();
        finer.bodies[0].order = Some(2);
        let mut touching = plain.clone();
        touching.contact = Some(crate::scene::Contact::default());
        for scene in [implicit, refined, finer, touching, scene(CellKind::Pyramid5, true)] {
            assert!(!crate::model::parts::is_separable(&scene));
        }
    }
}
