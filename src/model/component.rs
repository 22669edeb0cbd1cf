//! Builds a component: collects the masses, terms and initial state of bodies that act on each other, and makes a
//! system of them.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

use vi_core::constraints::QuadraticConstraint;
use vi_core::{Combination, Fixed, Force, Potential, Prescribed, State, System, TiedMass};
use vi_fem::{Gravity, Tie};

use super::prescribe::{NodalFix, coordinates};
use super::strikes::{StruckNodes, struck_state};
use super::{periodic, rigid, ties};
use crate::scene::{MassKind, Problem, Scene};

/// A component under construction.
#[derive(Default)]
pub(super) struct ComponentBuilder {
    /// If true, weight acts on the row sums of the consistent mass, which have the accuracy of the elements. This is so
    /// if nothing moves or the mass is consistent.
    pub(super) sums_rows: bool,
    pub(super) is_consistent: bool,
    /// Whether this process evaluates only portions of the terms.
    pub(super) in_portions: bool,
    /// Lumped mass per node, kg.
    pub(super) mass: Vec<f64>,
    /// Mass per node that weight acts on, kg.
    pub(super) gravity_mass: Vec<f64>,
    pub(super) rest: Vec<[f64; 3]>,
    pub(super) x: Vec<f64>,
    pub(super) v: Vec<f64>,
    /// The kinetic energy as a function of the velocities, if the mass is consistent.
    pub(super) kinetic: Vec<Arc<dyn Potential>>,
    pub(super) potentials: Vec<Box<dyn Potential>>,
    pub(super) forces: Vec<Arc<dyn Force>>,
    /// Exact ties.
    pub(super) ties: Vec<Tie>,
    /// Ties of nodes to rigid bodies.
    held: Vec<Combination>,
    directors: Vec<u32>,
    /// Pairs of nodes with equal displacements, each with the number of its periodic pair in the scene.
    pub(super) periodic: Vec<((u32, u32), usize)>,
    pub(super) constraints: Vec<QuadraticConstraint>,
    pub(super) strikes: Vec<StruckNodes>,
    prescribed: Vec<Prescribed>,
}

impl ComponentBuilder {
    pub(super) fn new(sums_rows: bool, is_consistent: bool, in_portions: bool) -> Self {
        Self { sums_rows, is_consistent, in_portions, ..Self::default() }
    }

    /// Returns the number of nodes so far.
    pub(super) fn node_count(&self) -> usize {
        self.mass.len()
    }

    /// Adds the nodes and ties of a rigid body.
    pub(super) fn add_rigid(&mut self, added: &rigid::Added) {
        self.mass.extend(&added.mass);
        self.gravity_mass.extend(&added.mass);
        self.rest.extend(added.x.as_chunks::<3>().0);
        self.x.extend(&added.x);
        self.v.extend(&added.v);
        self.held.extend(added.ties.iter().cloned());
        self.directors.extend(added.directors);
        self.constraints.extend(added.constraints.iter().cloned());
        self.prescribed.extend(added.prescribed());
    }

    /// Returns the lumped mass per node, kg, with the mass of tied nodes distributed to the nodes that they follow.
    pub(super) fn distributed_mass(&self) -> Vec<f64> {
        let mut mass = self.mass.clone();
        if !self.ties.is_empty() {
            vi_core::redistribute_lumped_mass(&ties::combinations(&self.ties, |_| false), &mut mass);
        }
        mass
    }

    /// Ties nodes of periodic parts to their partners. Returns each tied node with the one that it follows.
    fn tie_periodic(&mut self) -> Result<BTreeMap<u32, u32>, Problem> {
        let leaders = periodic::leaders(self.periodic.iter().map(|(pair, _)| *pair));
        let place =
            |of: &[f64], node: u32| -> [f64; 3] { std::array::from_fn(|k| of[3 * node as usize + k]) };
        let size = self.rest.iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
        for (&node, &leader) in &leaders {
            let (a, b) = (self.rest[leader as usize], self.rest[node as usize]);
            let offset = [0, 1, 2].map(|k| b[k] - a[k]);
            let (x, y) = (place(&self.x, leader), place(&self.x, node));
            let apart = (0..3).map(|k| (y[k] - x[k] - offset[k]).abs()).fold(0.0, f64::max);
            if apart > 1e-6 * size {
                let index = self.periodic.first().map_or(0, |(_, index)| *index);
                let message = format!(
                    "partners start {apart:.3e} m apart beside their translation; the initial displacement must be the \
                     same on both sides"
                );
                return Err(Problem::new(format!("periodic[{index}]"), message));
            }
            let director = self.mass.len() as u32;
            self.mass.push(0.0);
            self.gravity_mass.push(0.0);
            self.rest.push(offset);
            self.x.extend(offset);
            self.v.extend([0.0; 3]);
            self.directors.push(director);
            let dofs = (3 * director..3 * director + 3).collect();
            self.prescribed.push(Prescribed { dofs, path: Box::new(Fixed(offset.to_vec())) });
            let terms = vec![(leader, 1.0), (director, 1.0)];
            self.held.push(Combination { node, terms, mass: TiedMass::Lumped });
        }
        Ok(leaders)
    }

    /// Returns the system, its initial state, and notes on the latter.
    pub(super) fn into_system(
        mut self,
        scene: &Scene,
        fixes: &[NodalFix],
    ) -> Result<(System, State, Vec<String>), Problem> {
        let followers = self.tie_periodic()?;
        // Large arrays are dropped one by one: this is where a component needs most memory. Only a filter still needs nodes
        // at rest.
        let is_filtered = scene.solver.mass == Some(MassKind::Filtered);
        let rest = if is_filtered { std::mem::take(&mut self.rest) } else { Vec::new() };
        self.rest = Vec::new();
        let coordinates = coordinates(fixes, self.prescribed, &followers, &self.x)?;
        let coordinates = if self.ties.is_empty() && self.directors.is_empty() {
            coordinates
        } else {
            let prescribed: HashSet<u32> =
                coordinates.prescribed().iter().flat_map(|group| &group.dofs).map(|dof| dof / 3).collect();
            let mut combinations = ties::combinations(&self.ties, |node| prescribed.contains(&node));
            combinations.extend(self.held);
            coordinates
                .with_combinations(&combinations, &self.directors)
                .map_err(|error| Problem::new("attach", format!("exact ties: {error}")))?
        };
        if scene.gravity != [0.0; 3] {
            let amplitude = scene.gravity_amplitude.clone().unwrap_or_default();
            self.potentials.push(Box::new(Gravity::with_amplitude(
                &self.gravity_mass,
                scene.gravity,
                amplitude,
            )));
        }
        drop(self.gravity_mass);
        let mass = self.mass.iter().flat_map(|&m| [m; 3]).collect();
        drop(self.mass);
        let system = System::new(mass, self.potentials, coordinates)
            .and_then(|system| system.with_forces(self.forces))
            .and_then(|system| system.with_constraints(self.constraints))
            .map_err(|error| Problem::new("body", error.to_string()))?
            .with_consistent_mass(self.kinetic)
            .map_err(|error| Problem::new("solver.mass", error.to_string()))?;
        let moves = system.coordinates().free_count() > 0;
        let system = if is_filtered && moves { filtered(system, rest.as_flattened())? } else { system };
        let (mut state, notes) = struck_state(&system, &self.strikes, &self.x, self.v)?;
        vi_solvers::make_tangent(&system, &mut state)
            .map_err(|error| Problem::new("joint", error.to_string()))?;
        Ok((system, state, notes))
    }
}

/// Returns the system with the filter of its mass, for nodes at rest at `x`.
fn filtered(system: System, x: &[f64]) -> Result<System, Problem> {
    let filter = vi_solvers::mass_filter(&system, x)
        .map_err(|error| Problem::new("solver.mass", error.to_string()))?;
    system.with_filter(filter).map_err(|error| Problem::new("solver.mass", error.to_string()))
}
