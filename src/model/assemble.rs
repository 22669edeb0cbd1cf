//! Makes the model from a resolved scene, section by section: each section adds its masses, terms and initial values to
//! the components that it acts on.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;

use vi_core::{State, System};
use vi_fem::{Anchor, PointSpring, SpringEnd};
use vi_mesh::{Mesh, Numbering};

use super::body::{BodyModel, NodeSet, ProbeTarget};
use super::component::ComponentBuilder;
use super::contact::{ContactModel, Stitch, Surfaces, contact};
use super::import::Imported;
use super::matter::{self, Edges};
use super::meeting::Meeting;
use super::parting::Parted;
use super::partition::{Partition, joined};
use super::prescribe::NodalFix;
use super::read::ReadBody;
use super::regions::RegionProbe;
use super::resolve::{
    ControlTarget, End, PeriodicPairs, Resolved, ResolvedFix, ResolvedJoint, ResolvedLoad, ResolvedRigid,
    ResolvedSpring, ResolvedStrike,
};
use super::rigid::{self, Attached, RigidModel};
use super::strikes::StruckNodes;
use super::ties::TieSet;
use super::{directions, loads, sheets};
use crate::scene::{BodyId, Damping, MassKind, Problem, Scene};

/// A scene as systems.
pub(crate) struct Model {
    pub(crate) bodies: Vec<BodyModel>,
    pub(crate) rigids: Vec<RigidModel>,
    /// The node probes.
    pub(crate) probes: Vec<ProbeTarget>,
    pub(crate) region_probes: Vec<RegionProbe>,
    /// The nodes of each fix.
    pub(crate) fixes: Vec<NodeSet>,
    pub(crate) control: Option<ControlTarget>,
    pub(crate) components: Vec<(System, State)>,
    /// The contact of each component.
    pub(crate) contacts: Vec<Option<ContactModel>>,
    /// The pairs of bodies that may meet.
    pub(crate) meeting: Meeting,
    /// Translations by `contact.resolve` before the start.
    pub(crate) parted: Vec<Parted>,
    pub(crate) notes: Vec<String>,
}

/// Makes the model of a scene. If `in_portions`, this process evaluates only portions of the terms.
///
/// # Errors
/// Returns all problems of the bodies; if there are none, all problems of the other sections.
pub(super) fn assemble(
    scene: &Scene,
    resolved: Resolved<'_>,
    in_portions: bool,
) -> Result<Model, Vec<Problem>> {
    let mut meeting = Meeting::new(joined(&resolved));
    let partition = Partition::new(scene, &resolved, &meeting);
    let Resolved {
        bodies, fixes, probes, region_probes, periodics, strikes, springs, rigids, joints, ..
    } = resolved;
    let mut parts = Parts::new(scene, &partition, in_portions);
    parts.add_bodies(scene, bodies, &partition, &fixes);
    parts.check()?;
    parts.add_strikes(&strikes);
    parts.add_springs(&springs);
    parts.add_ties(resolved.ties);
    let rigids = parts.add_rigids(&rigids, scene.contact.is_some(), &joints, &partition);
    parts.add_loads(&resolved.loads, &fixes);
    if let Some(damping) = &scene.damping {
        parts.add_damping(damping);
    }
    parts.add_periodics(&periodics);
    let mut systems = Vec::with_capacity(parts.components.len());
    let mut contacts = Vec::with_capacity(parts.components.len());
    let mut parted = Vec::new();
    for (number, component) in parts.components.into_iter().enumerate() {
        let (rest, periodic) = match scene.contact {
            Some(_) => (component.rest.clone(), component.periodic.clone()),
            None => (Vec::new(), Vec::new()),
        };
        let bodies = &parts.bodies;
        let made = component.into_system(scene, &nodal_fixes(&fixes, bodies, number));
        let made = made.and_then(|(system, mut state, notes)| {
            parts.notes.extend(notes);
            let (rigids, stitches) = (&rigids, &parts.stitches);
            let surfaces = Surfaces { bodies, rigids, rest: &rest, periodic: &periodic, stitches };
            let contact =
                contact(scene, number, (&system, &mut state), &surfaces, &mut meeting, &mut parted)?;
            let live = contact.iter().flat_map(ContactModel::live).collect();
            contacts.push(contact);
            Ok((system.with_live(live), state))
        });
        match made {
            Ok(system) => systems.push(system),
            Err(problem) => parts.problems.push(problem),
        }
    }
    if !parts.problems.is_empty() {
        return Err(parts.problems);
    }
    Ok(Model {
        bodies: parts.bodies,
        rigids,
        probes,
        fixes: fixes.into_iter().map(|fix| fix.on).collect(),
        region_probes,
        control: resolved.control,
        components: systems,
        contacts,
        meeting,
        parted,
        notes: parts.notes,
    })
}

/// Returns the fixes of nodes of component number `component`, with the component's node numbers.
fn nodal_fixes<'a>(
    fixes: &'a [ResolvedFix<'a>],
    bodies: &[BodyModel],
    component: usize,
) -> Vec<NodalFix<'a>> {
    let own = fixes.iter().filter(|fix| bodies[fix.on.body.index()].component == component);
    own.map(|ResolvedFix { index, fix, on, directions }| {
        let body = &bodies[on.body.index()];
        let number = |&node: &u32| (body.node(node as usize) as u32, node);
        let nodes = on.nodes.iter().map(number).collect();
        NodalFix { index: *index, fix, nodes, directions: directions.as_deref() }
    })
    .collect()
}

/// The components of a scene under construction, with their bodies.
struct Parts {
    components: Vec<ComponentBuilder>,
    bodies: Vec<BodyModel>,
    /// The mesh and initial fields of each body, in the numbering of its component; empty if no section needs them.
    meshes: Vec<Imported>,
    /// The terms of the kinetic energy of its component that belong to each body; none if the mass is lumped.
    kinetic: Vec<Range<usize>>,
    notes: Vec<String>,
    problems: Vec<Problem>,
    /// Nodes that attachments and seams join to others: component, node, and the nodes that it is joined to.
    stitches: Vec<Stitch>,
}

impl Parts {
    fn new(scene: &Scene, partition: &Partition, in_portions: bool) -> Self {
        let is_consistent = scene.solver.mass == Some(MassKind::Consistent);
        let sums_rows = scene.statics.is_some() || is_consistent;
        let empty = |_| ComponentBuilder::new(sums_rows, is_consistent, in_portions);
        Self {
            components: (0..partition.count()).map(empty).collect(),
            bodies: Vec::new(),
            meshes: Vec::new(),
            kinetic: Vec::new(),
            notes: Vec::new(),
            problems: Vec::new(),
            stitches: Vec::new(),
        }
    }

    fn say(&mut self, key: impl Into<String>, message: impl Into<String>) {
        self.problems.push(Problem::new(key, message));
    }

    /// Returns the problems so far as an error, if there are any.
    fn check(&mut self) -> Result<(), Vec<Problem>> {
        if self.problems.is_empty() { Ok(()) } else { Err(std::mem::take(&mut self.problems)) }
    }

    /// Returns the number of a body's node in its component.
    fn node(&self, body: BodyId, node: u32) -> u32 {
        self.bodies[body.index()].node(node as usize) as u32
    }

    fn add_bodies(
        &mut self,
        scene: &Scene,
        bodies: Vec<ReadBody<'_>>,
        partition: &Partition,
        fixes: &[ResolvedFix<'_>],
    ) {
        for mut body in bodies {
            let (id, name, dimension) = (body.id, body.scene.name.clone(), body.scene.dimension());
            let component = partition.of_body(id);
            let part = &mut self.components[component];
            let (node_offset, first_kinetic) = (part.node_count(), part.kinetic.len());
            let of_part = body.part.as_mut().map(|part| std::mem::take(&mut part.numbering));
            let numbering = Arc::new(of_part.unwrap_or_else(|| Numbering::by_place(&body.read.mesh)));
            let (read, mesh) = body.read.renumbered(&numbering);
            let body = ReadBody { read, ..body };
            self.notes.extend(body.read.notes.iter().cloned());
            if let Err(message) = matter::add_body(part, &body, &edges(id, &numbering, fixes), &numbering) {
                self.problems.push(Problem::new(format!("body[{}]", id.index()), message));
            }
            self.kinetic.push(first_kinetic..part.kinetic.len());
            if let Some(wind) = &scene.wind
                && dimension == 2
            {
                match sheets::wind(wind, &body, node_offset) {
                    Ok(force) => part.forces.push(force),
                    Err(message) => self.problems.push(Problem::new("wind", message)),
                }
            }
            self.notes.extend(sheets::notes(body.scene, scene.damping.as_ref()));
            self.bodies.push(BodyModel {
                id,
                name,
                mesh,
                dimension,
                locking: body.scene.locking,
                texture: body.read.texture.clone(),
                materials: body.materials,
                component,
                node_offset,
                numbering,
                far: body.far,
                pattern: body.read.pattern.clone(),
            });
            // A large mesh is not kept longer than needed.
            let is_needed = !scene.loads.is_empty() || scene.damping.is_some();
            self.meshes.push(if is_needed { body.read } else { Imported::generated(Mesh::default()) });
        }
    }

    fn add_strikes(&mut self, strikes: &[ResolvedStrike<'_>]) {
        for ResolvedStrike { index, strike, on } in strikes {
            let body = &self.bodies[on.body.index()];
            let component = &mut self.components[body.component];
            let number = |&node: &u32| body.node(node as usize);
            let nodes = on.nodes.iter().map(number).map(|node| (node as u32, component.mass[node])).collect();
            component.strikes.push(StruckNodes { index: *index, impulse: strike.impulse, nodes });
        }
    }

    fn add_springs(&mut self, springs: &[ResolvedSpring<'_>]) {
        for ResolvedSpring { index, spring, ends } in springs {
            let End::Node(from) = &ends[0] else { continue };
            let number = |target: &ProbeTarget| self.node(target.body, target.node as u32);
            let node = number(from);
            let component = &self.components[self.bodies[from.body.index()].component];
            let near = component.rest[node as usize];
            let (to, far) = match &ends[1] {
                End::Node(other) => {
                    let other = number(other);
                    (SpringEnd::Node(other), component.rest[other as usize])
                }
                End::Place(place) => (SpringEnd::Anchor(*place), *place),
            };
            let distance = (0..3).map(|k| (far[k] - near[k]).powi(2)).sum::<f64>().sqrt();
            let length = spring.length.unwrap_or(distance);
            let component = self.bodies[from.body.index()].component;
            match PointSpring::new(&format!("spring {index}"), node, to, spring.stiffness, length) {
                Ok(term) => self.components[component].potentials.push(Box::new(term)),
                Err(error) => self.say(format!("spring[{index}]"), error.to_string()),
            }
        }
    }

    fn add_ties(&mut self, sets: Vec<TieSet>) {
        for set in sets {
            let mut ties = set.ties;
            for tie in &mut ties {
                tie.node = self.node(set.body, tie.node);
                if let (Anchor::Nodes(weights), Some(to)) = (&mut tie.anchor, set.to) {
                    weights.iter_mut().for_each(|(node, _)| *node = self.node(to, *node));
                    let others = weights.iter().map(|&(node, _)| node).collect();
                    let component = self.bodies[set.body.index()].component;
                    self.stitches.push(Stitch {
                        component,
                        node: tie.node,
                        others,
                        is_spring: !set.is_exact,
                    });
                }
            }
            let component = &mut self.components[self.bodies[set.body.index()].component];
            if set.is_exact {
                component.ties.extend(ties);
                continue;
            }
            match vi_fem::ties(&ties, &set.name) {
                Ok(terms) => component.potentials.extend(terms),
                Err(error) => self.say(set.name, error.to_string()),
            }
        }
    }

    /// Adds the rigid bodies with their attached nodes, then their joints. Returns `None` if one of them has a problem.
    fn add_rigids(
        &mut self,
        rigids: &[ResolvedRigid<'_>],
        can_meet: bool,
        joints: &[ResolvedJoint<'_>],
        partition: &Partition,
    ) -> Vec<RigidModel> {
        let before = self.problems.len();
        let mut all = Vec::with_capacity(rigids.len());
        // Nodal masses include the mass of the nodes tied to them.
        let masses: Vec<Vec<f64>> = self.components.iter().map(ComponentBuilder::distributed_mass).collect();
        for (index, ResolvedRigid { rigid, form, held }) in rigids.iter().enumerate() {
            let number = partition.of_rigid(index);
            let mut nodes: Vec<u32> = held
                .iter()
                .flat_map(|NodeSet { body, nodes }| nodes.iter().map(|&node| self.node(*body, node)))
                .collect();
            nodes.sort_unstable();
            nodes.dedup();
            let component = &mut self.components[number];
            let attached: Vec<Attached> = nodes
                .into_iter()
                .map(|node| Attached {
                    node,
                    x: [0, 1, 2].map(|k| component.x[3 * node as usize + k]),
                    mass: masses[number][node as usize],
                })
                .collect();
            match rigid::build((rigid, form.as_ref()), &attached, number, component.node_count(), can_meet) {
                Ok(added) => {
                    component.add_rigid(&added);
                    all.push(added);
                }
                Err(message) => self.say(format!("rigid[{index}]"), message),
            }
        }
        if self.problems.len() > before {
            return Vec::new();
        }
        for ResolvedJoint { index, joint, body, to } in joints {
            let (body, to) = (&all[body.index()], to.map(|to| &all[to.index()]));
            let constraints = rigid::joint(joint, &format!("joint[{index}]"), body, to);
            self.components[body.model.component].constraints.extend(constraints);
        }
        all.into_iter().map(|added| added.model).collect()
    }

    fn add_loads(&mut self, loads: &[ResolvedLoad<'_>], fixes: &[ResolvedFix<'_>]) {
        for ResolvedLoad { index, load, body } in loads {
            let (body, read) = (&self.bodies[body.index()], &self.meshes[body.index()]);
            match loads::load(load, *index, &loads::Target { body, read, fixes }) {
                Ok(added) => {
                    let component = &mut self.components[body.component];
                    component.potentials.extend(added.potentials);
                    component.forces.extend(added.forces);
                }
                Err(("", message)) => self.say(format!("load[{index}]"), message),
                Err((part, message)) => self.say(format!("load[{index}].{part}"), message),
            }
        }
    }

    fn add_damping(&mut self, damping: &Damping) {
        for ((body, read), kinetic) in self.bodies.iter().zip(&self.meshes).zip(&self.kinetic) {
            let component = &mut self.components[body.component];
            let masses = &component.mass[body.node_offset..][..read.mesh.points.len()];
            match loads::damping(damping, (body, &read.mesh), masses, &component.kinetic[kinetic.clone()]) {
                Ok(forces) => component.forces.extend(forces),
                Err(message) => self.problems.push(Problem::new("damping", message)),
            }
        }
    }

    fn add_periodics(&mut self, periodics: &[PeriodicPairs]) {
        for PeriodicPairs { index, body, pairs } in periodics {
            let body = &self.bodies[body.index()];
            let number = |node: u32| body.node(node as usize) as u32;
            let pairs = pairs.iter().map(|&(a, b)| ((number(a), number(b)), *index));
            self.components[body.component].periodic.extend(pairs);
        }
    }
}

/// Returns the nodes of a sheet at edges that fixes clamp or hold in a mirror plane.
fn edges(body: BodyId, numbering: &Numbering, fixes: &[ResolvedFix<'_>]) -> Edges {
    let own = || fixes.iter().filter(|fix| fix.on.body == body);
    let numbered = |fix: &ResolvedFix<'_>| -> HashSet<u32> {
        fix.on.nodes.iter().map(|&node| numbering.of(node)).collect()
    };
    Edges {
        clamps: own().filter(|held| held.fix.rotation).map(numbered).collect(),
        mirrors: own()
            .filter_map(|held| Some((directions::mirror_normal(held.fix)?, numbered(held))))
            .collect(),
    }
}
