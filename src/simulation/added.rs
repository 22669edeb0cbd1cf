//! Terms that a program adds to a scene before the simulation: its own energies, forces and live terms.

use std::sync::Arc;

use vi_core::{CoreError, Force, Live, Potential, State, System};

#[cfg(doc)]
use super::Component;
use super::{Simulation, alone};
use crate::model::{BodyModel, Model};
use crate::scene::{Problem, Scene, SchemeName};

/// A term that acts on the component of a body. Its stencils use the node numbers of the component:
/// [`BodyModel::node`] of a node of the body's mesh.
pub struct AddedTerm {
    component: usize,
    kind: Kind,
}

enum Kind {
    Potential(Box<dyn Potential>),
    Force(Arc<dyn Force>),
    Live(Arc<dyn Live>),
}

impl AddedTerm {
    /// Adds an energy.
    pub fn potential(body: &BodyModel, term: impl Potential + 'static) -> Self {
        Self { component: body.component, kind: Kind::Potential(Box::new(term)) }
    }

    /// Adds a force without a potential.
    pub fn force(body: &BodyModel, force: impl Force + 'static) -> Self {
        Self { component: body.component, kind: Kind::Force(Arc::new(force)) }
    }

    /// Adds an energy whose stencils change while the body moves.
    pub fn live(body: &BodyModel, term: impl Live + 'static) -> Self {
        Self { component: body.component, kind: Kind::Live(Arc::new(term)) }
    }
}

impl Simulation {
    /// Returns the simulation of a scene with additional terms; `add` receives the bodies, in the order of the scene.
    ///
    /// # Errors
    /// Returns the errors of [`Simulation::new`], and an error if a term refers to a missing node. Scheme
    /// `auto` is refused, because its trials would run the scene without these terms.
    pub fn with_terms(
        scene: Scene,
        add: impl FnOnce(&[BodyModel]) -> Vec<AddedTerm>,
    ) -> Result<Self, Vec<Problem>> {
        if scene.time.scheme == Some(SchemeName::Auto) {
            let message = "\"auto\" would try the scene without the added terms; name a scheme and a step";
            return Err(vec![Problem::new("time.scheme", message)]);
        }
        Self::build(scene, (&alone(), Vec::new()), |model| extend(model, add))
    }

    /// Sets the positions (m) and velocities (m/s) of the nodes of body number `body`, in the order of its mesh.
    /// Prescribed coordinates stay on their path. The next step books the change of energy as work of forces.
    ///
    /// # Errors
    /// Returns [`CoreError::Length`] if there is not one entry per node; nothing has then changed.
    pub fn set_motion(
        &mut self,
        body: usize,
        positions: &[[f64; 3]],
        velocities: &[[f64; 3]],
    ) -> Result<(), CoreError> {
        let before = self.observe().total();
        let body = &self.bodies[body];
        let expected = body.mesh.points.len();
        for (what, found) in [("positions", positions.len()), ("velocities", velocities.len())] {
            if found != expected {
                return Err(CoreError::Length { what, expected, found });
            }
        }
        let component = &mut self.components[body.component];
        let (mut x, mut v) = (component.system.positions(&component.state), component.velocities());
        for (node, (position, velocity)) in positions.iter().zip(velocities).enumerate() {
            let dof = 3 * body.node(node);
            x[dof..dof + 3].copy_from_slice(position);
            v[dof..dof + 3].copy_from_slice(velocity);
        }
        component.state = component.system.state(component.state.t, &x, &v)?;
        self.given += self.observe().total() - before;
        Ok(())
    }

    /// Sets the free coordinates q (m) and their momenta p (kg m/s) of component number `component`;
    /// [`Component::state`] returns the current ones. They must satisfy the constraints of rigid bodies. The next
    /// step books the change of energy as work of forces.
    ///
    /// # Errors
    /// Returns [`CoreError::Length`] if there is not one entry per free coordinate; nothing has then changed.
    pub fn set_state(&mut self, component: usize, q: &[f64], p: &[f64]) -> Result<(), CoreError> {
        let before = self.observe().total();
        let state = &mut self.components[component].state;
        let expected = state.q.len();
        for (what, found) in [("coordinates", q.len()), ("momenta", p.len())] {
            if found != expected {
                return Err(CoreError::Length { what, expected, found });
            }
        }
        state.q.copy_from_slice(q);
        state.p.copy_from_slice(p);
        self.given += self.observe().total() - before;
        Ok(())
    }
}

/// Adds the terms returned by `add` to the model.
fn extend(model: Model, add: impl FnOnce(&[BodyModel]) -> Vec<AddedTerm>) -> Result<Model, Vec<Problem>> {
    let mut model = model;
    let mut potentials: Vec<Vec<Box<dyn Potential>>> = model.components.iter().map(|_| Vec::new()).collect();
    let mut forces: Vec<Vec<Arc<dyn Force>>> = model.components.iter().map(|_| Vec::new()).collect();
    let mut live: Vec<Vec<Arc<dyn Live>>> = model.components.iter().map(|_| Vec::new()).collect();
    for AddedTerm { component, kind } in add(&model.bodies) {
        match kind {
            Kind::Potential(term) => potentials[component].push(term),
            Kind::Force(force) => forces[component].push(force),
            Kind::Live(term) => live[component].push(term),
        }
    }
    let extended = model.components.into_iter().zip(potentials).zip(forces).zip(live).map(
        |((((system, state), potentials), forces), live)| -> Result<(System, State), Vec<Problem>> {
            let extended = system.add_potentials(potentials).and_then(|system| system.add_forces(forces));
            let system = extended.map_err(|error| vec![Problem::new("added term", error.to_string())])?;
            Ok((if live.is_empty() { system } else { system.with_live(live) }, state))
        },
    );
    model.components = extended.collect::<Result<_, _>>()?;
    Ok(model)
}
