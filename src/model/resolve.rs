//! Resolves the names in a scene: bodies, rigid bodies, regions and nodes. It reports all problems of the meshes and
//! the names. Nothing is looked up by name afterwards.

use std::collections::HashMap;
use std::sync::Arc;

use super::body::{NodeSet, ProbeTarget};
use super::read::{self, ReadBody, Reading};
use super::regions::RegionProbe;
use super::shape::{Form, form};
use super::ties::{self, TieSet};
use super::{directions, periodic, rigid_mesh, select};
use crate::scene::{
    Attach, BodyId, Control, Fix, Joint, Load, Names, Probe, Problem, Rigid, RigidId, RigidShape, Scene,
    Seam, Selection, Spring, SpringEnd, Strike,
};

/// A scene in which bodies, nodes and directions replace names. Each entry refers to its entry in the scene.
pub(super) struct Resolved<'a> {
    pub(super) bodies: Vec<ReadBody<'a>>,
    pub(super) fixes: Vec<ResolvedFix<'a>>,
    pub(super) probes: Vec<ProbeTarget>,
    pub(super) region_probes: Vec<RegionProbe>,
    pub(super) periodics: Vec<PeriodicPairs>,
    pub(super) strikes: Vec<ResolvedStrike<'a>>,
    pub(super) springs: Vec<ResolvedSpring<'a>>,
    pub(super) rigids: Vec<ResolvedRigid<'a>>,
    pub(super) joints: Vec<ResolvedJoint<'a>>,
    /// Attachments, then seams.
    pub(super) ties: Vec<TieSet>,
    pub(super) loads: Vec<ResolvedLoad<'a>>,
    pub(super) control: Option<ControlTarget>,
}

/// A fix with its nodes.
pub(super) struct ResolvedFix<'a> {
    /// Number of the fix in the scene.
    pub(super) index: usize,
    pub(super) fix: &'a Fix,
    pub(super) on: NodeSet,
    /// The unit directions along which each node is held; `None` if they are global axes alone.
    pub(super) directions: Option<Vec<Vec<[f64; 3]>>>,
}

/// The pairs of nodes that a `[[periodic]]` entry ties.
pub(super) struct PeriodicPairs {
    /// Number of the entry in the scene.
    pub(super) index: usize,
    pub(super) body: BodyId,
    pub(super) pairs: Vec<(u32, u32)>,
}

/// A spring with its ends.
pub(super) struct ResolvedSpring<'a> {
    /// Number of the spring in the scene.
    pub(super) index: usize,
    pub(super) spring: &'a Spring,
    pub(super) ends: [End; 2],
}

/// One end of a spring.
#[derive(Debug, Clone, Copy)]
pub(super) enum End {
    /// A node of a body.
    Node(ProbeTarget),
    /// A fixed point, m.
    Place([f64; 3]),
}

/// A rigid body with its attached nodes.
pub(super) struct ResolvedRigid<'a> {
    pub(super) rigid: &'a Rigid,
    pub(super) form: Option<Arc<Form>>,
    pub(super) held: Vec<NodeSet>,
}

/// A joint with its rigid bodies.
pub(super) struct ResolvedJoint<'a> {
    /// Number of the joint in the scene.
    pub(super) index: usize,
    pub(super) joint: &'a Joint,
    pub(super) body: RigidId,
    /// The other rigid body; `None` for the world.
    pub(super) to: Option<RigidId>,
}

/// A strike with its nodes.
pub(super) struct ResolvedStrike<'a> {
    /// Number of the strike in the scene.
    pub(super) index: usize,
    pub(super) strike: &'a Strike,
    pub(super) on: NodeSet,
}

/// A load with its body.
pub(super) struct ResolvedLoad<'a> {
    /// Number of the load in the scene.
    pub(super) index: usize,
    pub(super) load: &'a Load,
    pub(super) body: BodyId,
}

/// The quantity that `static.control` prescribes.
#[derive(Debug, Clone)]
pub(crate) enum ControlTarget {
    /// Displacement of a node along an axis.
    Displacement(ProbeTarget, usize),
    /// Volume on one side of a surface region of a body.
    Volume(BodyId, String),
}

/// Reads the meshes of a scene, or what a process needs of them, and resolves all names. Selections may be empty in a part.
///
/// # Errors
/// Returns all problems at once. Entries that refer to a body that cannot be read are skipped.
pub(super) fn resolve(scene: &Scene, reading: Reading) -> Result<Resolved<'_>, Vec<Problem>> {
    let mut problems = Vec::new();
    let bodies = read::bodies(scene, reading, &mut problems);
    let mut resolver =
        Resolver { names: Names::new(scene), bodies: &bodies, probes: HashMap::new(), problems };
    let fixes = resolver.fixes(&scene.fixes);
    let (probes, region_probes) = resolver.probes(&scene.probes);
    let periodics = resolver.periodics(scene);
    let strikes = resolver.strikes(&scene.strikes);
    let springs = resolver.springs(&scene.springs);
    let (rigids, mut ties) = resolver.attachments(scene);
    ties.extend(resolver.seams(&scene.seams));
    let joints = resolver.joints(&scene.joints);
    let loads = resolver.loads(&scene.loads);
    let control = resolver.control(scene);
    let problems = resolver.problems;
    if !problems.is_empty() {
        return Err(problems);
    }
    let bodies = bodies.into_iter().flatten().collect();
    Ok(Resolved {
        bodies,
        fixes,
        probes,
        region_probes,
        periodics,
        strikes,
        springs,
        rigids,
        joints,
        ties,
        loads,
        control,
    })
}

/// Resolves the bodies and nodes that the sections of a scene name.
struct Resolver<'a, 'b> {
    names: Names<'a>,
    /// `None` for a body that could not be read.
    bodies: &'b [Option<ReadBody<'a>>],
    /// The node probes, by name.
    probes: HashMap<&'a str, ProbeTarget>,
    problems: Vec<Problem>,
}

impl<'a, 'b> Resolver<'a, 'b> {
    fn say(&mut self, key: impl Into<String>, message: impl Into<String>) {
        self.problems.push(Problem::new(key, message));
    }

    /// Returns the body of this name; `None` if it does not exist or could not be read, which has been reported before.
    fn body(&self, name: &str) -> Option<&'b ReadBody<'a>> {
        self.bodies[self.names.body(name)?.index()].as_ref()
    }

    /// Returns the nodes of a selection, or records a problem and returns `None`.
    fn selected(&mut self, body: &ReadBody<'_>, on: &Selection, key: &str) -> NodeSet {
        let nodes = select::nodes(&body.read.mesh, on).unwrap_or_else(|(part, message)| {
            self.say(format!("{key}.{part}"), message);
            Vec::new()
        });
        NodeSet { body: body.id, nodes }
    }

    fn listed(&mut self, body: &ReadBody<'_>, nodes: &[usize], key: String) -> Vec<u32> {
        select::listed_nodes(&body.read.mesh, nodes).unwrap_or_else(|message| {
            self.say(key, message);
            Vec::new()
        })
    }

    /// Returns the node with this number, or the one nearest to a point.
    fn node(
        &mut self,
        name: &str,
        point: Option<[f64; 3]>,
        node: Option<usize>,
        key: &str,
    ) -> Option<ProbeTarget> {
        let body = self.body(name)?;
        let node = match (node, point) {
            (Some(node), _) => *self.listed(body, &[node], format!("{key}.node")).first()? as usize,
            (None, Some(point)) => body.read.mesh.nearest_node(point)? as usize,
            (None, None) => return None,
        };
        Some(ProbeTarget { body: body.id, node })
    }

    fn fixes(&mut self, fixes: &'a [Fix]) -> Vec<ResolvedFix<'a>> {
        let mut all = Vec::new();
        for (index, fix) in fixes.iter().enumerate() {
            let key = format!("fix[{index}]");
            let Some(body) = self.body(&fix.body) else { continue };
            let on = self.selected(body, &fix.on, &key);
            match directions::directions(fix, &body.read.mesh, body.scene.dimension(), &on.nodes) {
                Ok(directions) => all.push(ResolvedFix { index, fix, on, directions }),
                Err((part, message)) => self.say(format!("{key}.{part}"), message),
            }
        }
        all
    }

    /// Resolves probes at nodes and probes over parts of bodies.
    fn probes(&mut self, probes: &'a [Probe]) -> (Vec<ProbeTarget>, Vec<RegionProbe>) {
        let (mut of_nodes, mut of_regions) = (Vec::new(), Vec::new());
        for (index, probe) in probes.iter().enumerate() {
            let key = format!("probe[{index}]");
            if probe.is_node() {
                let Some(found) = self.node(&probe.body, probe.point, probe.node, &key) else { continue };
                of_nodes.push(found);
                self.probes.insert(&probe.name, found);
            } else if probe.between.is_some() {
                // The check of the scene has verified these names.
            } else if let Some(body) = self.body(&probe.body) {
                match RegionProbe::new(probe, body) {
                    Ok(found) => of_regions.push(found),
                    Err(("", message)) => self.say(key, message),
                    Err((part, message)) => self.say(format!("{key}.{part}"), message),
                }
            }
        }
        (of_nodes, of_regions)
    }

    fn periodics(&mut self, scene: &Scene) -> Vec<PeriodicPairs> {
        let mut all = Vec::new();
        for (index, periodic) in scene.periodics.iter().enumerate() {
            let Some(body) = self.body(&periodic.body) else { continue };
            match periodic::partners(periodic, &body.read.mesh) {
                Ok(pairs) => all.push(PeriodicPairs { index, body: body.id, pairs }),
                Err((part, message)) if part.is_empty() => self.say(format!("periodic[{index}]"), message),
                Err((part, message)) => self.say(format!("periodic[{index}].{part}"), message),
            }
        }
        all
    }

    fn strikes(&mut self, strikes: &'a [Strike]) -> Vec<ResolvedStrike<'a>> {
        let mut all = Vec::new();
        for (index, strike) in strikes.iter().enumerate() {
            let Some(body) = self.body(&strike.body) else { continue };
            let on = self.selected(body, &strike.on, &format!("strike[{index}]"));
            all.push(ResolvedStrike { index, strike, on });
        }
        all
    }

    fn springs(&mut self, springs: &'a [Spring]) -> Vec<ResolvedSpring<'a>> {
        let mut all = Vec::new();
        for (index, spring) in springs.iter().enumerate() {
            let from = self.end(&spring.from, &format!("spring[{index}].from"));
            let to = self.end(&spring.to, &format!("spring[{index}].to"));
            let ends = from.zip(to).map(|(from, to)| [from, to]);
            all.extend(ends.map(|ends| ResolvedSpring { index, spring, ends }));
        }
        all
    }

    fn end(&mut self, end: &SpringEnd, key: &str) -> Option<End> {
        match &end.body {
            Some(body) => self.node(body, end.point, end.node, key).map(End::Node),
            None => end.point.map(End::Place),
        }
    }

    /// Resolves rigid bodies with their attachments, and the ties of all other attachments.
    fn attachments(&mut self, scene: &'a Scene) -> (Vec<ResolvedRigid<'a>>, Vec<TieSet>) {
        let mut rigids = Vec::with_capacity(scene.rigids.len());
        for (index, rigid) in scene.rigids.iter().enumerate() {
            let form = match &rigid.shape {
                Some(RigidShape::Mesh { file, scale }) => {
                    let read = rigid_mesh::read(file, scale.unwrap_or(1.0), !rigid.is_prescribed());
                    read.map_err(|message| self.say(format!("rigid[{index}].shape.file"), message)).ok()
                }
                shape => shape.as_ref().map(form),
            };
            rigids.push(ResolvedRigid { rigid, form: form.map(Arc::new), held: Vec::new() });
        }
        let mut ties = Vec::new();
        for (index, attach) in scene.attachments.iter().enumerate() {
            let key = format!("attach[{index}]");
            let Some(body) = self.body(&attach.body) else { continue };
            match attach.to.as_deref().and_then(|to| self.names.rigid(to)) {
                Some(to) => rigids[to.index()].held.push(self.selected(body, &attach.on, &key)),
                None => ties.extend(self.tied(attach, body, key)),
            }
        }
        (rigids, ties)
    }

    /// Resolves the ties of nodes to another body, or to points in space.
    fn tied(&mut self, attach: &Attach, body: &ReadBody<'_>, name: String) -> Option<TieSet> {
        let NodeSet { nodes, .. } = self.selected(body, &attach.on, &name);
        let Some(to) = &attach.to else {
            let ties = ties::to_space(attach, &nodes, body);
            return Some(TieSet { name, body: body.id, to: None, is_exact: false, ties });
        };
        let to = self.body(to)?;
        match ties::to_surface(attach, &nodes, body, to) {
            Ok(ties) => {
                let is_exact = attach.stiffness.is_none();
                Some(TieSet { name, body: body.id, to: Some(to.id), is_exact, ties })
            }
            Err(message) => {
                let key = if attach.surface.is_some() { format!("{name}.surface") } else { name };
                self.say(key, message);
                None
            }
        }
    }

    fn seams(&mut self, seams: &[Seam]) -> Vec<TieSet> {
        let seams = seams.iter().enumerate();
        seams.filter_map(|(index, seam)| self.seam(seam, format!("seam[{index}]"))).collect()
    }

    fn seam(&mut self, seam: &Seam, name: String) -> Option<TieSet> {
        let (body, to) = (self.body(&seam.body)?, self.body(seam.to_body())?);
        let sewn = if let (Some(region), Some(to_region)) = (&seam.region, &seam.to_region) {
            ties::along_curves(seam, [region, to_region], [body, to])
        } else {
            let given = |nodes: &'_ Option<Vec<usize>>| nodes.clone().unwrap_or_default();
            let nodes = self.listed(body, &given(&seam.nodes), format!("{name}.nodes"));
            let others = self.listed(to, &given(&seam.to_nodes), format!("{name}.to_nodes"));
            ties::in_pairs(seam, &nodes, &others, [body, to]).map(|ties| (true, ties))
        };
        let is_exact = seam.stiffness.is_none();
        match sewn {
            Ok((true, ties)) => Some(TieSet { name, body: body.id, to: Some(to.id), is_exact, ties }),
            Ok((false, ties)) => Some(TieSet { name, body: to.id, to: Some(body.id), is_exact, ties }),
            Err(message) => {
                self.say(name, message);
                None
            }
        }
    }

    /// Resolves joints whose names exist; the checks of the scene refuse the others.
    fn joints(&self, joints: &'a [Joint]) -> Vec<ResolvedJoint<'a>> {
        let mut all = Vec::new();
        for (index, joint) in joints.iter().enumerate() {
            let Some(body) = self.names.rigid(joint.body()) else { continue };
            let to = joint.to().and_then(|to| self.names.rigid(to));
            all.push(ResolvedJoint { index, joint, body, to });
        }
        all
    }

    fn loads(&self, loads: &'a [Load]) -> Vec<ResolvedLoad<'a>> {
        let named = |(index, load): (usize, &'a Load)| {
            Some(ResolvedLoad { index, load, body: self.names.body(load.body())? })
        };
        loads.iter().enumerate().filter_map(named).collect()
    }

    fn control(&mut self, scene: &Scene) -> Option<ControlTarget> {
        match scene.statics.as_ref()?.control.as_ref()? {
            Control::Displacement { probe: name, axis, .. } => {
                if !self.names.probe(name)?.is_node() {
                    let message =
                        format!("'{name}' is over a part of a body: name a probe at a `point` or a `node`");
                    self.say("static.control.probe", message);
                }
                Some(ControlTarget::Displacement(*self.probes.get(name.as_str())?, *axis as usize))
            }
            Control::Volume { body, region, .. } => {
                Some(ControlTarget::Volume(self.names.body(body)?, region.clone()))
            }
        }
    }
}
