//! Observations of a simulation: energies, momenta, probes and nodal quantities, and the cause if they are not
//! finite.

use vi_core::{HessianKind, Potential, State, System, angular_momentum_at, linear_momentum};
use vi_fem::{ElementField, Law, element_field};
use vi_mesh::{Mesh, Window};
use vi_solvers::{Assembler, SolverError, Stepper};

use super::contact::ContactTotals;
use super::{Component, ContactFacts, Simulation};
use crate::model::{BodyModel, Pose, ProbeTarget, RigidModel};
use crate::scene::RigidShape;

/// Position and displacement of a probe, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeValue {
    /// Position of the node.
    pub position: [f64; 3],
    /// Displacement from the position at rest.
    pub displacement: [f64; 3],
}

/// Energies, momenta and probes at one time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Observation {
    /// Time, s.
    pub t: f64,
    /// Kinetic energy, J.
    pub kinetic: f64,
    /// Strain energy, J.
    pub elastic: f64,
    /// Gravitational energy, J, zero at the origin.
    pub gravity: f64,
    /// Energy of other conservative loads, J.
    pub load: f64,
    /// Energy of contact, J, including the energy stored in the bristles of friction.
    pub contact: f64,
    /// Pairs in contact and the smallest gap; `None` in a scene without contact.
    pub contact_facts: Option<ContactFacts>,
    /// Linear momentum of the free coordinates, kg m/s.
    pub momentum: [f64; 3],
    /// Angular momentum of the free coordinates about the origin, kg m²/s.
    pub angular_momentum: [f64; 3],
    /// The probes that are nodes, in the order of the scene.
    pub probes: Vec<ProbeValue>,
    /// The rigid bodies, in the order of the scene.
    pub rigids: Vec<Pose>,
    /// The load factor, if a path of equilibria is followed.
    pub load_factor: Option<f64>,
}

/// Number of shifts by which the round-off of energies is found, and the length of the first one relative to the extent of a component.
const SHIFTS: u32 = 3;
const SHIFT: f64 = 1e-12;

impl Observation {
    /// Returns whether all energies and momenta are finite.
    pub fn is_finite(&self) -> bool {
        let sum = self.total() + self.momentum.iter().chain(&self.angular_momentum).sum::<f64>();
        sum.is_finite()
    }

    /// Returns the total energy, J.
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.gravity + self.load + self.contact
    }
}

/// Vectors at the nodes of a body.
pub(crate) struct OfNodes<'a> {
    body: &'a BodyModel,
    /// Vectors at all nodes of the component of the body, 3 numbers per node.
    all: Vec<f64>,
}

impl OfNodes<'_> {
    /// Returns the vector of a node of the body's mesh.
    pub(crate) fn of(&self, node: usize) -> [f64; 3] {
        self.all.as_chunks::<3>().0[self.body.node(node)]
    }

    fn to_vec(&self) -> Vec<[f64; 3]> {
        (0..self.body.mesh.points.len()).map(|node| self.of(node)).collect()
    }
}

/// Returns the kinetic energy, J, from the velocities of the scheme if it has its own.
fn kinetic(stepper: Option<&dyn Stepper>, system: &System, state: &State) -> f64 {
    match stepper.and_then(|stepper| stepper.velocity(state)) {
        Some(v) => 0.5 * state.p.iter().zip(v).map(|(p, v)| p * v).sum::<f64>(),
        None => vi_core::kinetic_energy(system, state),
    }
}

/// Returns the round-off of the elastic energy of a component, J.
fn round_off_of(Component { system, state, .. }: &Component) -> f64 {
    let (x, coordinates, mut assembler) =
        (system.positions(state), system.coordinates(), Assembler::new(system));
    let mut elastic = |x: &[f64]| assembler.energies(x, state.t).elastic;
    let (here, [extent, _]) = (elastic(&x), coordinates.extent_and_reach(&x));
    let change = |k: u32| {
        let shift = [1.0, -0.7, 0.4].map(|along| f64::from(k) * along * SHIFT * extent);
        let moved = |(dof, x): (usize, &f64)| match coordinates.is_director(dof as u32 / 3) {
            true => *x,
            false => x + shift[dof % 3],
        };
        let shifted: Vec<f64> = x.iter().enumerate().map(moved).collect();
        (elastic(&shifted) - here).abs()
    };
    (1..=SHIFTS).map(change).fold(0.0, f64::max)
}

/// Returns the forces of the supports of a component, N.
fn reactions(component: &Component) -> Vec<f64> {
    vi_solvers::reactions(&component.system, &component.state, component.stepper.as_deref())
}

impl Simulation {
    /// Returns the current kinetic energy, J. It costs no evaluation of V.
    pub(crate) fn kinetic_energy(&self) -> f64 {
        let of = |component: &Component| {
            kinetic(component.stepper.as_deref(), &component.system, &component.state)
        };
        self.components.iter().map(of).sum()
    }

    /// Returns the current energies, momenta and probes. It costs one energy evaluation.
    pub fn observe(&mut self) -> Observation {
        let mut seen =
            Observation { t: self.time(), load_factor: self.load_factor(), ..Observation::default() };
        let ContactTotals { friction, damping, .. } = self.contact;
        let facts = ContactFacts { friction, damping, ..ContactFacts::default() };
        seen.contact_facts = self.scene.contact.is_some().then_some(facts);
        let mut positions = Vec::with_capacity(self.components.len());
        for component in &mut self.components {
            let Component { system, state, stepper, observer, contact, .. } = component;
            let x = system.positions(state);
            let energies = observer.get_or_insert_with(|| Assembler::new(system)).energies(&x, state.t);
            seen.elastic += energies.elastic;
            seen.gravity += energies.gravity;
            seen.load += energies.load;
            seen.contact +=
                energies.contact + stepper.as_ref().map_or(0.0, |stepper| stepper.stored_energy());
            if let (Some(facts), Some(contact)) = (&mut seen.contact_facts, contact) {
                facts.add(contact, &x);
            }
            seen.kinetic += kinetic(stepper.as_deref(), system, state);
            let (linear, angular) = (linear_momentum(system, state), angular_momentum_at(system, state, &x));
            for k in 0..3 {
                seen.momentum[k] += linear[k];
                seen.angular_momentum[k] += angular[k];
            }
            positions.push(x);
        }
        if let Some(facts) = seen.contact_facts {
            self.contact.smallest_gap = self.contact.smallest_gap.min(facts.smallest_gap);
            let assert = &self.scene.assert;
            if assert.intersections.is_some() || assert.smallest_gap.is_some() {
                let (count, pair) = self.forbidden_crossings();
                let first = pair.map(|[a, b]| (seen.t, (a as u64, b as u64)));
                self.contact.intersections = self.contact.intersections.max(count as u64);
                self.contact.first_crossing = self.contact.first_crossing.or(first);
            }
        }
        let value = |probe: &ProbeTarget| {
            let body = &self.bodies[probe.body.index()];
            let (x, node) = (&positions[body.component], body.node(probe.node));
            let position = std::array::from_fn(|k| x[3 * node + k]);
            let rest = body.mesh.points[probe.node];
            ProbeValue { position, displacement: std::array::from_fn(|k| position[k] - rest[k]) }
        };
        seen.probes = self.probes.iter().map(value).collect();
        seen.rigids = self.rigids.iter().map(|rigid| rigid.pose(&positions[rigid.component])).collect();
        seen
    }

    /// Returns why energies or momenta are not finite: the first term outside its domain, or an overflow.
    pub(crate) fn fault(&mut self) -> SolverError {
        for component in &mut self.components {
            let Component { system, state, observer, .. } = component;
            let x = system.positions(state);
            let assembler = observer.get_or_insert_with(|| Assembler::new(system));
            if let Some(term) = assembler.fault(&x, state.t) {
                return SolverError::Term { term, at_start: true };
            }
        }
        SolverError::NotFinite { what: "energy or momentum", dof: 0, at_start: true }
    }

    /// Returns the energy at the level of round-off, J: 1e-16 Σ tr(K_e) r_e (r_e + D), with the stiffness and the
    /// extent r of each stencil. A sample of the stencils represents a term. Laws that subtract large numbers have
    /// this energy at rest. D is the distance by which the coordinates exceed the extent of the component: far from
    /// the origin the coordinates have a larger round-off.
    pub(crate) fn resolution(&self) -> f64 {
        // Returns the stencils of a term that are in the sample, and the number of stencils that each of them
        // represents.
        let sample = |count: usize| {
            let stride = count.div_ceil(64).max(1);
            ((0..count).step_by(stride).collect::<Vec<usize>>(), stride)
        };
        let of_term = |term: &dyn Potential, x: &[f64], (t, beyond): (f64, f64)| -> f64 {
            let few = term.elsewhere().map(|elsewhere| {
                let (stencils, stride) = sample(elsewhere.count);
                ((elsewhere.make)(&stencils), stride)
            });
            let positions = few.as_ref().map(|(few, _)| few.positions(x));
            let (term, x, (chosen, stride)) = match (&few, &positions) {
                (Some((few, stride)), Some(x)) => {
                    (few.term.as_ref(), &x[..], ((0..few.elements.len()).collect(), *stride))
                }
                _ => (term, x, sample(term.stencils().count())),
            };
            let stencils = term.stencils();
            let (size, block) = (stencils.size(), stencils.block);
            let mut packed = vec![0.0; vi_core::packed_len(size)];
            let mut sum = 0.0;
            for stencil in chosen {
                term.hessians(stencil..stencil + 1, x, t, &mut packed);
                let trace: f64 = (0..size).map(|i| packed[vi_core::packed_len(i + 1) - 1].abs()).sum();
                let nodes = stencils.of(stencil);
                let extent = |k: usize| {
                    let values = || nodes.iter().map(|&node| x[node as usize * block + k]);
                    values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
                };
                let square: f64 = (0..block).map(|k| extent(k).powi(2)).sum();
                let energy = trace * (square + square.sqrt() * beyond) * stride as f64;
                sum += if energy.is_finite() { energy } else { 0.0 };
            }
            sum
        };
        let mut total = 0.0;
        // The energy of a component that never moves is constant, with its round-off.
        let moves = |component: &&Component| {
            component.stepper.is_some() || component.system.coordinates().is_moving()
        };
        for component in self.components.iter().filter(moves) {
            let x = component.system.positions(&component.state);
            let terms = component.system.potentials().iter();
            let varying = terms.filter(|term| term.traits().hessian != HessianKind::Zero);
            let [extent, reach] = component.system.coordinates().extent_and_reach(&x);
            let beyond = (reach - extent).max(0.0);
            total += varying.map(|term| of_term(term.as_ref(), &x, (component.state.t, beyond))).sum::<f64>();
        }
        1e-16 * total
    }

    /// Returns the round-off of the elastic energy, J: its largest change while all nodes move equally by a few resolutions of positions.
    /// Laws that subtract large numbers have more of it than their energy at rest.
    pub(crate) fn energy_round_off(&self) -> f64 {
        self.components.iter().map(round_off_of).sum()
    }

    /// Returns the positions of the nodes of body number `body`, m.
    pub fn positions(&self, body: usize) -> Vec<[f64; 3]> {
        self.places(body).to_vec()
    }

    /// Returns the positions of [`Simulation::positions`], stored in the numbering of the component; this saves a copy.
    pub(crate) fn places(&self, body: usize) -> OfNodes<'_> {
        self.of_nodes(body, |component| component.system.positions(&component.state))
    }

    /// Returns the velocities of the nodes of body number `body`, m/s.
    pub fn velocities(&self, body: usize) -> Vec<[f64; 3]> {
        self.nodal(body, Component::velocities)
    }

    /// Returns the current positions (m) of points given in the axes of rigid body number `rigid`, relative to its
    /// centre.
    pub fn carried(&self, rigid: usize, points: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let (rigid, component) = self.rigid(rigid);
        rigid.carry(&component.system.positions(&component.state), points)
    }

    /// Returns the current velocities (m/s) of points given in the axes of rigid body number `rigid`, relative to its
    /// centre.
    pub fn carried_velocities(&self, rigid: usize, points: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let (rigid, component) = self.rigid(rigid);
        rigid.carry(&component.system.velocities(&component.state), points)
    }

    fn rigid(&self, rigid: usize) -> (&RigidModel, &Component) {
        let rigid = &self.rigids[rigid];
        (rigid, &self.components[rigid.component])
    }

    /// Returns the reaction forces at the prescribed coordinates of body number `body`, N; zero elsewhere. Contact counts with its forces
    /// over the last step, with friction and damping ([`vi_solvers::reactions`]).
    pub fn reactions(&self, body: usize) -> Vec<[f64; 3]> {
        self.supports(body).to_vec()
    }

    /// Returns the reactions of [`Simulation::reactions`], stored in the numbering of the component; this saves a copy.
    pub(crate) fn supports(&self, body: usize) -> OfNodes<'_> {
        self.of_nodes(body, reactions)
    }

    /// Returns the centre (m) of rigid body number `rigid`, which is fixed or moved, and the force (N) and the moment
    /// about its centre (N m) with which its support balances the bodies that are attached to it or touch it. Forces of
    /// joints are not included.
    pub fn rigid_reaction(&self, rigid: usize) -> [[f64; 3]; 3] {
        let (rigid, component) = self.rigid(rigid);
        let Component { system, state, stepper, .. } = component;
        let [centre, force, mut moment] = rigid.wrench(&system.positions(state), &reactions(component));
        if rigid.shape.as_ref().is_some_and(RigidShape::is_plane) {
            let couple = vi_solvers::couple_at(system, state, stepper.as_deref(), rigid.node as u32);
            moment.iter_mut().zip(couple).for_each(|(moment, couple)| *moment += couple);
        }
        [centre, force, moment]
    }

    /// Returns the couples that act at edges of body number `body` whose normals are held. Nodes are numbered in the
    /// component.
    pub(crate) fn edge_couples(&self, body: usize) -> Vec<vi_solvers::EdgeCouple> {
        let Component { system, state, .. } = &self.components[self.bodies[body].component];
        vi_solvers::edge_couples(system, state)
    }

    /// Returns the accelerations of the nodes of body number `body`, m/s²: M⁻¹(f − ∂V/∂x) at free coordinates, and
    /// those of the path at prescribed ones.
    pub fn accelerations(&self, body: usize) -> Vec<[f64; 3]> {
        self.nodal(body, |component| vi_solvers::accelerations(&component.system, &component.state, self.h))
    }

    /// Returns the forces of weight, loads and wind on the nodes of body number `body`, N.
    pub fn external_forces(&self, body: usize) -> Vec<[f64; 3]> {
        self.nodal(body, |component| vi_solvers::external_forces(&component.system, &component.state))
    }

    /// Returns a field on the solid elements of body number `body`, in the order of its material entries.
    pub fn element_values(&self, body: usize, field: ElementField) -> Vec<f64> {
        let mut values = Vec::with_capacity(self.bodies[body].element_count() * field.component_count());
        self.each_element_value(body, field, |part| values.extend_from_slice(part));
        values
    }

    /// Calls `see` with the values of [`Simulation::element_values`] for some elements at a time.
    pub(crate) fn each_element_value(&self, body: usize, field: ElementField, mut see: impl FnMut(&[f64])) {
        let (x, body) = (self.places(body), &self.bodies[body]);
        let whole = if body.far.is_none() { x.to_vec() } else { Vec::new() };
        // These cells were accepted as solid elements of this mesh when the body was built.
        let mut enter = |mesh: &Mesh, elements: &[u32], law: &Law, x: &[[f64; 3]]| {
            if let Ok(part) = element_field(mesh, elements, law, body.locking, x.as_flattened(), field) {
                see(&part);
            }
        };
        for (elements, law) in body.solids() {
            let Some(far) = &body.far else {
                enter(&body.mesh, elements, law, &whole);
                continue;
            };
            for range in far.ranges() {
                let all: Vec<u32> = (0..range.len() as u32).collect();
                let Window { mesh, nodes } = far.window(range, |node| body.mesh.points[node as usize]);
                let of_window: Vec<[f64; 3]> = nodes.iter().map(|&node| x.of(node as usize)).collect();
                enter(&mesh, &all, law, &of_window);
            }
        }
    }

    fn nodal(&self, body: usize, values: impl Fn(&Component) -> Vec<f64>) -> Vec<[f64; 3]> {
        self.of_nodes(body, values).to_vec()
    }

    fn of_nodes(&self, body: usize, values: impl Fn(&Component) -> Vec<f64>) -> OfNodes<'_> {
        let body = &self.bodies[body];
        OfNodes { body, all: values(&self.components[body.component]) }
    }
}
