//! Accelerations, forces at the nodes and couples of clamped edges, for observers. They are evaluated only on request.

use vi_core::{Account, ForceAccount, State, Stencils, System};

use crate::assemble::assembler::Assembler;
use crate::assemble::force_sum::ForceSum;
use crate::assemble::stencil_forces;
use crate::schemes::constraint::manifold::constrain_accelerations;
use crate::schemes::stepper::Stepper;

/// Returns the accelerations of all coordinates, m/s². They are M⁻¹(f − ∂V/∂x) at free coordinates. At prescribed
/// ones they are those of the path, by differences of its velocity over a thousandth of the time step `h` (s).
pub fn accelerations(system: &System, state: &State, h: f64) -> Vec<f64> {
    let (x, v) = (system.positions(state), system.velocities(state));
    let net = net_forces(system, state);
    let coordinates = system.coordinates();
    let mut out = vec![0.0; x.len()];
    if coordinates.is_moving() {
        let step = 1e-3 * h.abs();
        // Do not evaluate paths before their beginning.
        let (from, to) = ((state.t - step).max(state.t.min(0.0)), state.t + step);
        let still = vec![0.0; coordinates.free_count()];
        let mut before = vec![0.0; x.len()];
        coordinates.embed_velocity(&still, from, &mut before);
        coordinates.embed_velocity(&still, to, &mut out);
        out.iter_mut().zip(&before).for_each(|(out, before)| *out = (*out - before) / (to - from));
    }
    coordinates.to_own_axes(&mut out);
    let force: Vec<f64> = coordinates.free().iter().map(|&dof| net[dof as usize]).collect();
    for (&dof, acceleration) in coordinates.free().iter().zip(system.velocity(&force)) {
        out[dof as usize] = acceleration;
    }
    coordinates.to_space(&mut out);
    constrain_accelerations(system, state, &v, &mut out);
    coordinates.complete(&mut out);
    out
}

/// Returns f − ∂V/∂x of all coordinates, N, pulled back from tied nodes: it accelerates free coordinates and is
/// balanced by the supports at prescribed ones. Forces of constraints are not included.
pub fn net_forces(system: &System, state: &State) -> Vec<f64> {
    let x = system.positions(state);
    let mut net = vec![0.0; x.len()];
    Assembler::new(system).gradient(&x, state.t, &mut net);
    let mut forces = ForceSum::new(system);
    if let Some(forces) = &mut forces {
        forces.evaluate(&x, &system.velocities(state), state.t);
    }
    for (dof, net) in net.iter_mut().enumerate() {
        *net = forces.as_ref().map_or(0.0, |forces| forces.total(dof)) - *net;
    }
    net
}

/// Returns the forces of weight, loads and wind on all coordinates, N, without elastic and damping forces.
pub fn external_forces(system: &System, state: &State) -> Vec<f64> {
    let (x, v) = (system.positions(state), system.velocities(state));
    let mut out = vec![0.0; x.len()];
    let mut add = |stencils: Stencils<'_>, blocks: &[f64], sign: f64| {
        for (stencil, block) in blocks.chunks_exact(stencils.size()).enumerate() {
            for (node, values) in stencils.of(stencil).iter().zip(block.chunks_exact(stencils.block)) {
                for (k, value) in values.iter().enumerate() {
                    out[*node as usize * stencils.block + k] += sign * value;
                }
            }
        }
    };
    for term in system.potentials().iter().filter(|term| term.account() != Account::Elastic) {
        let stencils = term.stencils();
        let mut blocks = vec![0.0; stencils.count() * stencils.size()];
        term.gradients(0..stencils.count(), &x, state.t, &mut blocks);
        add(stencils, &blocks, -1.0);
    }
    for force in system.forces().iter().filter(|force| force.account() == ForceAccount::Force) {
        let stencils = force.stencils();
        let mut blocks = vec![0.0; stencils.count() * stencils.size()];
        force.forces(0..stencils.count(), &x, &v, state.t, &mut blocks);
        add(stencils, &blocks, 1.0);
    }
    out
}

/// Returns the forces that hold the prescribed coordinates, N, one entry per coordinate: ∂V/∂x − f for coordinates
/// that do not accelerate, plus the inertia that consistent mass transfers to them, M_pf q̈; zero at free
/// coordinates.
///
/// The forces of live terms, such as contact, are those that `stepper` reports for its last step
/// ([`Stepper::see_live_forces`]), including forces without a potential. Without such a report, they are the gradient
/// of the terms.
pub fn reactions(system: &System, state: &State, stepper: Option<&dyn Stepper>) -> Vec<f64> {
    let mut out = system.positions(state);
    match live_gradient(system, stepper) {
        Some(live) => {
            let fixed = system.terms().clone().with_live(Vec::new());
            Assembler::new(&fixed).replace_by_gradient(&mut out, state.t);
            out.iter_mut().zip(&live).for_each(|(out, live)| *out += live);
        }
        None => Assembler::new(system).replace_by_gradient(&mut out, state.t),
    }
    if let Some(mut forces) = ForceSum::new(system) {
        forces.evaluate(&system.positions(state), &system.velocities(state), state.t);
        for (dof, out) in out.iter_mut().enumerate() {
            *out -= forces.total(dof);
        }
    }
    if let Some(kinetic) = system.kinetic() {
        let free = system.coordinates().free();
        let force: Vec<f64> = free.iter().map(|&dof| -out[dof as usize]).collect();
        let (mut acceleration, mut inertial) = (vec![0.0; out.len()], vec![0.0; out.len()]);
        kinetic.coordinates().embed(&system.velocity(&force), state.t, &mut acceleration);
        Assembler::new(kinetic).gradient(&acceleration, 0.0, &mut inertial);
        out.iter_mut().zip(&inertial).for_each(|(out, inertial)| *out += inertial);
    }
    for &dof in system.coordinates().free() {
        out[dof as usize] = 0.0;
    }
    system.coordinates().to_space(&mut out);
    out
}

/// Returns the forces of live terms over the last step with the sign of a gradient, N, pulled back from tied nodes; `None` if there are
/// no such terms or the stepper does not know their forces.
fn live_gradient(system: &System, stepper: Option<&dyn Stepper>) -> Option<Vec<f64>> {
    let (stepper, coordinates) = (stepper?, system.coordinates());
    if system.terms().live().is_empty() {
        return None;
    }
    let mut sum = vec![0.0; coordinates.dof_count()];
    let is_known = stepper.see_live_forces(&mut |_, nodes, forces| {
        for (&node, force) in nodes.iter().zip(forces.as_chunks::<3>().0) {
            (0..3).for_each(|k| sum[3 * node as usize + k] += force[k]);
        }
    });
    coordinates.pull_back(&mut sum);
    is_known.then_some(sum)
}

/// Returns the couple (N m) that the support of `node` exerts besides the force at this node, because the node stands for a
/// face of constant direction: −Σ x × ∂V_s/∂x over the stencils s of live terms with this node. It is the moment about the node
/// that the forces of the stencils lack.
pub fn couple_at(system: &System, state: &State, stepper: Option<&dyn Stepper>, node: u32) -> [f64; 3] {
    let coordinates = system.coordinates();
    let mut couple = [0.0; 3];
    let mut see = |x: &[f64], nodes: &[u32], forces: &[f64]| {
        if !nodes.contains(&node) {
            return;
        }
        for (&other, force) in nodes.iter().zip(forces.as_chunks::<3>().0) {
            // Directors are vectors and not places.
            let from = (!coordinates.is_director(other)).then_some(3 * node as usize);
            let arm = [0, 1, 2].map(|k| x[3 * other as usize + k] - from.map_or(0.0, |from| x[from + k]));
            for (k, couple) in couple.iter_mut().enumerate() {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                *couple -= arm[i] * force[j] - arm[j] * force[i];
            }
        }
    };
    if !stepper.is_some_and(|stepper| stepper.see_live_forces(&mut see)) {
        let x = system.positions(state);
        for term in system.terms().live() {
            stencil_forces::at(term.near(&x, term.reach()).as_ref(), &x, state.t, &mut see);
        }
    }
    couple
}

/// The couple that a support exerts at an edge of a sheet whose normal it holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeCouple {
    /// The nodes at the ends of the edge.
    pub nodes: [u32; 2],
    /// The couple on the sheet, N m.
    pub couple: [f64; 3],
}

/// Returns the couples −Σ x × ∂V_s/∂x of supports that hold normals of edges, one for each stencil s with such an
/// edge. With [`reactions`] they balance the moment of the loads.
pub fn edge_couples(system: &System, state: &State) -> Vec<EdgeCouple> {
    let x = system.positions(state);
    let mut couples = Vec::new();
    for term in system.potentials() {
        let stencils = term.stencils();
        let mut gradient = vec![0.0; stencils.size()];
        for stencil in 0..stencils.count() {
            let Some(nodes) = term.held_edge(stencil) else { continue };
            term.gradients(stencil..stencil + 1, &x, state.t, &mut gradient);
            let mut couple = [0.0; 3];
            // The gradients of a stencil sum to zero: arms may begin anywhere, and those from a node nearby have the
            // least round-off.
            let place = |node: u32, k: usize| x[3 * node as usize + k];
            for (&node, force) in stencils.of(stencil).iter().zip(gradient.as_chunks::<3>().0) {
                let arm = [0, 1, 2].map(|k| place(node, k) - place(nodes[0], k));
                for (k, couple) in couple.iter_mut().enumerate() {
                    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                    *couple -= arm[i] * force[j] - arm[j] * force[i];
                }
            }
            couples.push(EdgeCouple { nodes, couple });
        }
    }
    couples
}
