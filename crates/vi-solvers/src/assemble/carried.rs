//! The velocities with which the parts of a system are carried along: uniform translations. Every scheme makes them
//! exactly in steps of any length, so they must not decide how long steps are.
//!
//! A part is what stencils, ties and joints connect. Along an axis it is carried at the velocity of its centre of mass if nothing
//! holds it, and at the velocity of its supports if these move equally. Springs to points of space, supports along axes of their own
//! and joints with the ground resist a translation; such a part is not carried.

use vi_core::constraints::QuadraticConstraint;
use vi_core::{Coordinates, DisjointSets, HessianKind, Potential, System};

use crate::assemble::invariance;

/// The kind of support of a part along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Hold {
    Nothing,
    /// Prescribed coordinates.
    Supports,
    /// Forces or joints that depend on its place.
    Place,
}

/// Number of stencils of other processes that are made at once.
const BATCH: usize = 4096;

/// The parts of a system, and what holds them.
pub(crate) struct Carried {
    /// The part of each node; empty if nodes do not have three coordinates.
    part: Vec<u32>,
    holds: Vec<[Hold; 3]>,
}

impl Carried {
    pub(crate) fn new(system: &System) -> Self {
        let coordinates = system.coordinates();
        let count = coordinates.dof_count();
        let terms = || system.potentials().iter().filter(|term| term.traits().hessian != HessianKind::Zero);
        if !count.is_multiple_of(3) || terms().any(|term| term.stencils().block != 3) {
            return Self { part: Vec::new(), holds: Vec::new() };
        }
        let mut sets = DisjointSets::new(count / 3);
        let mut join = |nodes: &[u32]| nodes.windows(2).for_each(|pair| sets.join(pair[0], pair[1]));
        terms().for_each(|term| each_stencil(term.as_ref(), &mut join));
        for (node, sum) in coordinates.combinations() {
            sum.iter().for_each(|&(other, _)| join(&[node, other]));
        }
        let joints: Vec<Vec<u32>> =
            system.constraints().iter().map(|joint| joint.nodes().collect()).collect();
        joints.iter().for_each(|nodes| join(nodes));
        // Number the parts in the order of their first node.
        let (mut part, mut number) = (vec![0; count / 3], 0);
        for node in 0..count / 3 {
            let root = sets.root(node as u32) as usize;
            part[node] = if root == node { number } else { part[root] };
            number += u32::from(root == node);
        }
        let mut holds = vec![[Hold::Nothing; 3]; number as usize];
        for &dof in coordinates.prescribed().iter().flat_map(|group| &group.dofs) {
            let (node, axis) = (dof / 3, dof as usize % 3);
            if !coordinates.is_director(node) {
                holds[part[node as usize] as usize][axis] = Hold::Supports;
            }
        }
        let mut hold = |node: u32| holds[part[node as usize] as usize] = [Hold::Place; 3];
        coordinates.node_axes().iter().for_each(|axes| hold(axes.node));
        for term in terms().filter(|term| invariance::resists_translation(term.as_ref())) {
            term.stencils().nodes.iter().for_each(|&node| hold(node));
        }
        for (joint, nodes) in system.constraints().iter().zip(&joints) {
            if is_grounded(joint, nodes, system) {
                nodes.iter().for_each(|&node| hold(node));
            }
        }
        Self { part, holds }
    }

    /// Returns the number of parts.
    pub(crate) fn count(&self) -> usize {
        self.holds.len()
    }

    /// Returns the number of nodes that belong to parts.
    pub(crate) fn node_count(&self) -> usize {
        self.part.len()
    }

    /// Returns the part of a node.
    pub(crate) fn part(&self, node: usize) -> usize {
        self.part[node] as usize
    }

    /// Returns the part and the axis of the translation that moves a coordinate, if nothing holds that part along the axis.
    pub(crate) fn free_translation(&self, coordinates: &Coordinates, dof: u32) -> Option<(usize, usize)> {
        let (node, axis) = (dof / 3, dof as usize % 3);
        // A director does not change under translations.
        if self.part.is_empty() || coordinates.is_director(node) {
            return None;
        }
        let part = self.part(node as usize);
        (self.holds[part][axis] == Hold::Nothing).then_some((part, axis))
    }

    /// Subtracts the velocities of the parts from the velocities q̇ (m/s) of the free coordinates at time t (s). Returns false if no
    /// part is carried.
    pub(crate) fn subtract(&self, system: &System, t: f64, q_dot: &mut [f64]) -> bool {
        let coordinates = system.coordinates();
        let place = |dof: u32| {
            let (node, axis) = (dof / 3, dof as usize % 3);
            let is_point = !self.part.is_empty() && !coordinates.is_director(node);
            is_point.then(|| (self.part(node as usize), axis))
        };
        // Mass and momentum along each axis.
        let mut sums = vec![[[0.0; 2]; 3]; self.count()];
        for ((&dof, &mass), &v) in coordinates.free().iter().zip(system.free_mass()).zip(&*q_dot) {
            if let Some((part, axis)) = place(dof) {
                sums[part][axis][0] += mass;
                sums[part][axis][1] += mass * v;
            }
        }
        let supports = self.support_velocities(system, t, q_dot);
        let mean = |[mass, momentum]: [f64; 2]| if mass > 0.0 { momentum / mass } else { 0.0 };
        let carried: Vec<[f64; 3]> = (0..self.count())
            .map(|part| {
                std::array::from_fn(|axis| match self.holds[part][axis] {
                    Hold::Nothing => mean(sums[part][axis]),
                    Hold::Supports => supports[part][axis],
                    Hold::Place => 0.0,
                })
            })
            .collect();
        if carried.iter().flatten().all(|v| *v == 0.0) {
            return false;
        }
        for (&dof, v) in coordinates.free().iter().zip(q_dot) {
            if let Some((part, axis)) = place(dof) {
                *v -= carried[part][axis];
            }
        }
        true
    }

    /// Returns the velocities of supports that move equally, by part, m/s; zero for others.
    fn support_velocities(&self, system: &System, t: f64, q_dot: &[f64]) -> Vec<[f64; 3]> {
        let coordinates = system.coordinates();
        let mut known = vec![[None; 3]; self.count()];
        if coordinates.is_moving() && !self.part.is_empty() {
            let mut velocities = vec![0.0; coordinates.dof_count()];
            coordinates.embed_velocity(q_dot, t, &mut velocities);
            for &dof in coordinates.prescribed().iter().flat_map(|group| &group.dofs) {
                let (node, axis, v) = (dof / 3, dof as usize % 3, velocities[dof as usize]);
                if !coordinates.is_director(node) {
                    let known: &mut Option<f64> = &mut known[self.part(node as usize)][axis];
                    *known = Some(if known.is_none_or(|known| known == v) { v } else { f64::NAN });
                }
            }
        }
        let equal = |known: Option<f64>| known.filter(|v| v.is_finite()).unwrap_or(0.0);
        known.into_iter().map(|known| known.map(equal)).collect()
    }
}

/// Calls `join` with the nodes of each stencil of a term, which other processes may hold.
fn each_stencil(term: &dyn Potential, join: &mut impl FnMut(&[u32])) {
    let Some(far) = term.elsewhere() else {
        let stencils = term.stencils();
        return (0..stencils.count()).for_each(|stencil| join(stencils.of(stencil)));
    };
    for first in (0..far.count).step_by(BATCH) {
        let numbers: Vec<usize> = (first..far.count.min(first + BATCH)).collect();
        let few = (far.make)(&numbers);
        let stencils = few.term.stencils();
        for stencil in 0..stencils.count() {
            let nodes: Vec<u32> = stencils.of(stencil).iter().map(|&node| few.nodes[node as usize]).collect();
            join(&nodes);
        }
    }
}

/// Returns whether a joint between these nodes holds their place: its gradient has a net force on points.
fn is_grounded(joint: &QuadraticConstraint, nodes: &[u32], system: &System) -> bool {
    let coordinates = system.coordinates();
    let mut number: Vec<u32> = nodes.to_vec();
    number.sort_unstable();
    number.dedup();
    let own = joint.renumbered(|node| number.binary_search(&node).map_or(0, |own| own as u32));
    let mut gradient = vec![0.0; 3 * number.len()];
    own.add_gradient(&invariance::scattered(gradient.len()), 1.0, &mut gradient);
    let points =
        || number.iter().zip(gradient.chunks(3)).filter(|(node, _)| !coordinates.is_director(**node));
    let net = |axis: usize| points().map(|(_, force)| force[axis]).sum::<f64>();
    let size = gradient.iter().fold(0.0_f64, |size, g| size.max(g.abs()));
    (0..3).any(|axis| net(axis).abs() > 1e-9 * size)
}
