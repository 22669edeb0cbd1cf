//! Strikes: impulses at t = 0, each on the nodes of a region in proportion to their mass.
//!
//! The struck nodes a of mass m_a get the velocity w = J/Σm_a. A tied node transfers its share of the impulse to the
//! nodes that it is tied to, as it transfers forces: with x = S q, a free node k carries the struck mass s_k = Σ_a S_ak
//! m_a, gets the momentum s_k w, and hence the velocity (s_k/M_k) w, where M_k includes the mass that is tied to it. A
//! rigid body thus gets the resultant and the moment of the impulse. If no node is held, the momentum of all nodes is
//! J; supports take up the share of held nodes.
//!
//! With a mass matrix that is not diagonal, these velocities have another momentum, because it couples struck nodes to
//! others. The difference from J then acts on the struck nodes in proportion to s_k. It is zero if all nodes of a body
//! are struck, so that the body does not deform, and for linear elements away from supports.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use vi_core::{State, System, linear_momentum};

use crate::scene::Problem;

/// Fraction of an impulse below which a loss to supports is not reported. It is far above the round-off of the sums.
const LOST: f64 = 1e-9;

/// Parts of an impulse below this are round-off of products with a mass matrix, and not corrected.
const ROUND_OFF: f64 = 1e-12;

/// The axes of space.
const SPACE: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A strike in the node numbers of its component.
pub(super) struct StruckNodes {
    /// Number of the strike in the scene.
    pub(super) index: usize,
    /// Impulse J, N s.
    pub(super) impulse: [f64; 3],
    /// The struck nodes, each with its lumped mass, kg.
    pub(super) nodes: Vec<(u32, f64)>,
}

/// A node that carries a part of the struck mass.
struct Carrier {
    node: u32,
    /// The struck mass s_k that the node carries, kg.
    struck: f64,
    /// The directions of its coordinates.
    axes: [[f64; 3]; 3],
    /// The places of its coordinates among the free ones; `None` if held.
    places: [Option<usize>; 3],
}

impl Carrier {
    /// Returns the momentum of its free coordinates at the velocity w of the struck mass, kg m/s.
    fn momentum(&self, w: [f64; 3]) -> Vector3<f64> {
        let w = Vector3::from(w);
        let axes = self.axes.iter().zip(&self.places).filter(|(_, place)| place.is_some());
        axes.map(|(axis, _)| Vector3::from(*axis)).map(|axis| axis * (self.struck * axis.dot(&w))).sum()
    }

    /// Adds the velocity (s_k/M_k) w to those of all coordinates, m/s.
    fn move_by(&self, w: [f64; 3], system: &System, v: &mut [f64]) {
        // A node has one mass along all axes.
        let Some(&place) = self.places.iter().flatten().next() else { return };
        let part = self.struck / system.free_mass()[place];
        for (v, w) in v[3 * self.node as usize..][..3].iter_mut().zip(w) {
            *v += part * w;
        }
    }
}

/// Returns the state at t = 0 with positions x (m) and velocities v (m/s) of all coordinates, struck by impulses, and
/// notes on the impulses that supports take up.
///
/// # Errors
/// Returns the problem of a strike that moves nothing.
pub(super) fn struck_state(
    system: &System,
    strikes: &[StruckNodes],
    x: &[f64],
    mut v: Vec<f64>,
) -> Result<(State, Vec<String>), Problem> {
    let (mut rests, mut notes) = (Vec::new(), Vec::new());
    for StruckNodes { index, impulse, nodes } in strikes {
        let mass: f64 = nodes.iter().map(|(_, mass)| mass).sum();
        let w = impulse.map(|impulse| impulse / mass);
        let carriers = carriers(system, nodes);
        let points = || carriers.iter().filter(|carrier| !system.coordinates().is_director(carrier.node));
        let given: Vector3<f64> = points().map(|carrier| carrier.momentum(w)).sum();
        let impulse = Vector3::from(*impulse);
        if given.norm() <= LOST * impulse.norm() && impulse != Vector3::zeros() {
            let message = "acts on nodes that [[fix]] or a body that they are attached to holds against it, so that nothing \
                           moves: strike other nodes";
            return Err(Problem::new(format!("strike[{index}]"), message));
        }
        let lost = impulse - given;
        if lost.norm() > LOST * impulse.norm() {
            let [x, y, z] =
                lost.map(|part| if part.abs() > LOST * impulse.norm() { part } else { 0.0 }).into();
            notes.push(format!(
                "strike[{index}]: nodes that are held take up [{x:.3e}, {y:.3e}, {z:.3e}] N s of its impulse"
            ));
        }
        carriers.iter().for_each(|carrier| carrier.move_by(w, system, &mut v));
        if let Some(rest) = rest(system, &carriers, w, given) {
            rests.push((carriers, rest));
        }
    }
    let mut state = system.state(0.0, x, &v).map_err(|error| Problem::new("body", error.to_string()))?;
    for (carriers, rest) in rests {
        for carrier in carriers {
            for (axis, place) in carrier.axes.iter().zip(carrier.places) {
                if let Some(place) = place {
                    state.p[place] += carrier.struck * Vector3::from(*axis).dot(&rest);
                }
            }
        }
    }
    Ok((state, notes))
}

/// Returns the nodes that carry the mass of struck ones, ascending.
fn carriers(system: &System, nodes: &[(u32, f64)]) -> Vec<Carrier> {
    let coordinates = system.coordinates();
    let mut struck = BTreeMap::new();
    for &(node, mass) in nodes {
        match coordinates.combination(node) {
            None => *struck.entry(node).or_insert(0.0) += mass,
            Some(terms) => {
                terms.iter().for_each(|&(k, weight)| *struck.entry(k).or_insert(0.0) += weight * mass);
            }
        }
    }
    let carrier = |(node, struck): (u32, f64)| Carrier {
        node,
        struck,
        axes: coordinates.axes_of(node).copied().unwrap_or(SPACE),
        places: [0, 1, 2].map(|k| coordinates.free().binary_search(&(3 * node + k)).ok()),
    };
    struck.into_iter().map(carrier).collect()
}

/// Returns the velocity r (m/s) with Σ s_k r = `given` − P, where P is the momentum of the velocities (s_k/M_k) w;
/// `None` if P = `given`, as with diagonal mass.
fn rest(system: &System, carriers: &[Carrier], w: [f64; 3], given: Vector3<f64>) -> Option<Vector3<f64>> {
    if system.kinetic().is_none() && system.filter().is_none() {
        return None;
    }
    let coordinates = system.coordinates();
    let mut v = vec![0.0; coordinates.dof_count()];
    carriers.iter().for_each(|carrier| carrier.move_by(w, system, &mut v));
    let mut q_dot = vec![0.0; coordinates.free_count()];
    coordinates.coordinates_of(&v, &mut q_dot);
    let moved = State { t: 0.0, q: Vec::new(), p: system.momentum(&q_dot) };
    let missing = given - Vector3::from(linear_momentum(system, &moved));
    if missing.norm() <= ROUND_OFF * given.norm() {
        return None;
    }
    let column = |k: usize| carriers.iter().map(|carrier| carrier.momentum(SPACE[k])).sum::<Vector3<f64>>();
    let mass = Matrix3::from_columns(&[column(0), column(1), column(2)]);
    // The mass along held directions is zero, and nothing is missing there.
    mass.pseudo_inverse(ROUND_OFF * mass.norm()).ok().map(|inverse| inverse * missing)
}
