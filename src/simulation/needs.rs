//! Determines the needs of the components of a scene: a scheme, the full ledger of energy, and checks of the domains of
//! their terms. Reports systems that ranks cannot share as problems of the scene.

use vi_core::{HessianKind, System};
use vi_solvers::{Method, SolverError, circulatory};

use crate::scene::{Problem, Scene};

/// Returns whether the end of a free path can lie outside the domain of a term. This is so for a fixed term if its first stencil has
/// no finite energy when all its nodes coincide.
pub(super) fn has_domain(system: &System) -> bool {
    if !system.terms().is_live_part_finite_on_free_paths() {
        return true;
    }
    let collapsed = vec![0.0; system.coordinates().dof_count()];
    system.potentials().iter().any(|term| {
        let mut energy = [0.0];
        let few = term.elsewhere().map(|elsewhere| (elsewhere.make)(&[0]));
        let term = few.as_ref().map_or(term.as_ref(), |few| few.term.as_ref());
        let is_varying = term.traits().hessian == HessianKind::Varying && term.stencils().count() > 0;
        if is_varying {
            term.energies(0..1, &collapsed, 0.0, &mut energy);
        }
        !energy[0].is_finite()
    })
}

/// Returns the scheme of a scene; `None` if it is not settled. An equilibrium needs none.
pub(super) fn method_of(scene: &Scene) -> Option<Method> {
    match &scene.statics {
        Some(_) => Some(scene.time.method().unwrap_or(Method::ImplicitMidpoint)),
        None => scene.time.method(),
    }
}

/// Returns whether the stepper of a system keeps the full energy ledger.
pub(super) fn keeps_ledger(scene: &Scene, system: &System) -> bool {
    scene.output.ledger.unwrap_or_else(|| is_worked_on(system))
}

/// Returns whether something outside adds or removes energy: moving supports, forces without a potential, or loads
/// that change in time.
pub(super) fn is_worked_on(system: &System) -> bool {
    system.coordinates().is_moving()
        || !system.forces().is_empty()
        || system.potentials().iter().any(|term| term.traits().time_dependent)
}

/// Returns the problem of a scene whose statics shall leave unstable paths of a system whose stability is not judged.
pub(super) fn problem_of_push(scene: &Scene, system: &System) -> Option<Problem> {
    scene.statics.as_ref()?.push?;
    let name = circulatory(system)?;
    let message = format!(
        "'{name}' has no potential, so that a symmetric stiffness does not determine where a path becomes unstable: leave out `push`, \
         or follow the motion by a scheme in [time]"
    );
    Some(Problem::new("static.push", message))
}

/// Returns the problem of a system that several ranks cannot share.
pub(super) fn problem_of_ranks(error: &SolverError) -> Problem {
    let key = if matches!(error, SolverError::Petsc { .. }) { "solver.linear" } else { "time.scheme" };
    Problem::new(key, error.to_string())
}
