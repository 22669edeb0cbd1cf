//! Results of a run: the extremes of its probes and, at the end, the largest displacement and stress and the reactions
//! of its supports. The results at the end are computed once.

use std::collections::{HashMap, HashSet};

use serde::Serialize;
use vi_fem::ElementField;
use vi_solvers::EdgeCouple;

use crate::model::NodeSet;
use crate::simulation::Simulation;

/// Results at the end of a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Results {
    /// Time at the end, s.
    pub time: f64,
    /// Largest |u| of all nodes, m, unless it is zero.
    pub largest_displacement: Option<Peak>,
    /// Largest von Mises stress of all elements of solids, Pa.
    pub largest_von_mises: Option<Peak>,
    /// Reaction (N) of each `[[fix]]`, then of each rigid body that is fixed or moved and has no joint.
    pub reactions: Vec<Reaction>,
    /// Extremes of the probe columns over all rows of history.csv; for node probes, of their displacements.
    pub probes: Vec<ColumnRange>,
}

/// The largest value of a field, and its place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Peak {
    /// The largest value, in the SI unit of the field.
    pub value: f64,
    /// Name of the body.
    pub body: String,
    /// Node of its mesh, from 0, for a field of nodes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub node: Option<usize>,
    /// Cell of its mesh, from 0, for a field of elements.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub element: Option<usize>,
    /// Rest position of the node, or of the mean of the element's nodes, m.
    pub position: [f64; 3],
}

/// Reaction (N) of a `[[fix]]`: the sum over its nodes and axes. A coordinate that several fixes prescribe counts for
/// the first of them, so that the sum over all fixes is the total reaction. Also the reaction of a rigid body that is
/// fixed or moved: its support balances the forces of attached nodes and of contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reaction {
    /// Name of the body.
    pub body: String,
    /// The region, if the fix names one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// Number of nodes of the fix; 0 for a rigid body.
    pub nodes: usize,
    /// Mean of the current positions of its nodes, or the centre of the rigid body, m.
    pub centroid: [f64; 3],
    /// Σ r, N: the force of the support on the body, where r is the reaction at a node at x.
    pub force: [f64; 3],
    /// Σ (x − centroid) × r, plus the couples at edges whose normals the fix holds, N m.
    pub moment: [f64; 3],
}

/// The extremes of one column of history.csv, and the times at which they were first reached.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ColumnRange {
    /// Name of the column, e.g. `tip.uz` or `hole.max.von_mises`.
    pub column: String,
    /// Smallest value, in the unit of the column.
    pub min: f64,
    /// Time of the smallest value, s.
    pub at_min: f64,
    /// Largest value, in the unit of the column.
    pub max: f64,
    /// Time of the largest value, s.
    pub at_max: f64,
}

impl Results {
    /// Collects the results of the current state, with the extremes of the probes so far.
    pub(super) fn of(simulation: &Simulation, probes: Vec<ColumnRange>) -> Self {
        Self {
            time: simulation.time(),
            largest_displacement: largest_displacement(simulation),
            largest_von_mises: largest_von_mises(simulation),
            reactions: reactions(simulation).into_iter().chain(rigid_reactions(simulation)).collect(),
            probes,
        }
    }
}

fn largest_displacement(simulation: &Simulation) -> Option<Peak> {
    let mut largest: Option<Peak> = None;
    for (number, body) in simulation.bodies().iter().enumerate() {
        let places = simulation.places(number);
        for (node, rest) in body.mesh.points.iter().enumerate() {
            let x = places.of(node);
            let value = (0..3).map(|k| (x[k] - rest[k]).powi(2)).sum::<f64>().sqrt();
            if value > largest.as_ref().map_or(0.0, |peak| peak.value) {
                let (body, position) = (body.name.clone(), *rest);
                largest = Some(Peak { value, body, node: Some(node), element: None, position });
            }
        }
    }
    largest
}

fn largest_von_mises(simulation: &Simulation) -> Option<Peak> {
    let mut largest: Option<Peak> = None;
    for (number, body) in simulation.bodies().iter().enumerate() {
        let mut elements = body.elements();
        simulation.each_element_value(number, ElementField::VonMises, |values| {
            for (&value, element) in values.iter().zip(elements.by_ref()) {
                if value > largest.as_ref().map_or(f64::NEG_INFINITY, |peak| peak.value) {
                    let nodes = body.nodes_of(element);
                    let position = mean(nodes.iter().map(|&node| body.mesh.points[node as usize]));
                    let (body, element) = (body.name.clone(), Some(body.cell(element) as usize));
                    largest = Some(Peak { value, body, node: None, element, position });
                }
            }
        });
    }
    largest
}

fn reactions(simulation: &Simulation) -> Vec<Reaction> {
    // Reactions and positions of the nodes with a fix. Process one body after the other, because the arrays of a large
    // body take much memory.
    let mut of_body: HashMap<usize, HashMap<u32, [[f64; 3]; 2]>> = HashMap::new();
    for (_, NodeSet { body, nodes }) in simulation.fixed_nodes() {
        let of_nodes = of_body.entry(body.index()).or_default();
        of_nodes.extend(nodes.iter().map(|&node| (node, [[0.0; 3]; 2])));
    }
    for (&body, of_nodes) in &mut of_body {
        let held = simulation.supports(body);
        of_nodes.iter_mut().for_each(|(&node, [_, of_node])| *of_node = held.of(node as usize));
        drop(held);
        let x = simulation.places(body);
        of_nodes.iter_mut().for_each(|(&node, [of_node, _])| *of_node = x.of(node as usize));
    }
    let mut couples: HashMap<usize, Vec<EdgeCouple>> = HashMap::new();
    let mut counted: HashSet<(usize, u32, usize)> = HashSet::new();
    let mut all = Vec::new();
    for (fix, NodeSet { body, nodes }) in simulation.fixed_nodes() {
        let body = body.index();
        let of_nodes = &of_body[&body];
        let centroid = mean(nodes.iter().map(|node| of_nodes[node][0]));
        let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
        for &node in nodes {
            let [x, held] = of_nodes[&node];
            let mut own = [0.0; 3];
            // A node that is held along a local direction has one reaction, along it.
            let axes = match fix.space_axes() {
                Some(axes) => axes,
                None => vec![0, 1, 2],
            };
            for axis in axes {
                if counted.insert((body, node, axis)) {
                    own[axis] = held[axis];
                }
            }
            let arm = [0, 1, 2].map(|k| x[k] - centroid[k]);
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                force[k] += own[k];
                moment[k] += arm[i] * own[j] - arm[j] * own[i];
            }
        }
        if fix.rotation || fix.symmetry {
            // Each couple counts for the first fix that holds its edge.
            let held: HashSet<u32> =
                nodes.iter().map(|&node| simulation.bodies()[body].node(node as usize) as u32).collect();
            let left = couples.entry(body).or_insert_with(|| simulation.edge_couples(body));
            left.retain(|edge| {
                let is_own = edge.nodes.iter().all(|node| held.contains(node));
                if is_own {
                    moment.iter_mut().zip(edge.couple).for_each(|(moment, couple)| *moment += couple);
                }
                !is_own
            });
        }
        all.push(Reaction {
            body: fix.body.clone(),
            region: fix.on.region.clone(),
            nodes: nodes.len(),
            centroid,
            force,
            moment,
        });
    }
    all
}

/// Returns the reactions of rigid bodies that are fixed or moved. The forces of joints are not known here, so that those of bodies with a
/// joint would not be whole.
fn rigid_reactions(simulation: &Simulation) -> Vec<Reaction> {
    let scene = simulation.scene();
    let has_joint =
        |name: &str| scene.joints.iter().any(|joint| joint.body() == name || joint.to() == Some(name));
    let held = scene.rigids.iter().enumerate();
    let held = held.filter(|(_, rigid)| rigid.is_prescribed() && !has_joint(&rigid.name));
    held.map(|(number, rigid)| {
        let [centroid, force, moment] = simulation.rigid_reaction(number);
        Reaction { body: rigid.name.clone(), region: None, nodes: 0, centroid, force, moment }
    })
    .collect()
}

fn mean(points: impl ExactSizeIterator<Item = [f64; 3]>) -> [f64; 3] {
    let count = points.len().max(1) as f64;
    let sum = points.fold([0.0; 3], |sum: [f64; 3], x| [0, 1, 2].map(|k| sum[k] + x[k]));
    sum.map(|value| value / count)
}
