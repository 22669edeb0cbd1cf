//! Reads the meshes of a scene and finds the nodes and regions that the scene names, so that
//! everything that is wrong is known at once. It must not build potentials.

use std::collections::HashMap;

use vi_fem::{BoxMesh, ElementKind, FemError, FinerMesh, LockingCure, Mesh, SheetMesh};

use super::regions::RegionProbe;
use super::size::Budget;
use super::ties::{self, TieSet};
use super::{ProbeTarget, directions, periodic, select};
use crate::mesh_import::{self, Imported};
use crate::scene::{
    Attach, Body, MOST_REFINED, Problem, Refine, RefineAlong, Scene, Seam, Selection, SpringEnd,
};

/// The bodies and attachments of a scene, with nodes instead of names.
pub(super) struct Loaded {
    pub(super) bodies: Vec<LoadedBody>,
    pub(super) fixes: Vec<LoadedFix>,
    pub(super) probes: Vec<ProbeTarget>,
    pub(super) region_probes: Vec<RegionProbe>,
    /// For each periodic pair of parts: number of the body and pairs of its nodes.
    pub(super) periodics: Vec<(usize, Vec<(u32, u32)>)>,
    /// For each strike: number of the body and its nodes.
    pub(super) strikes: Vec<(usize, Vec<u32>)>,
    /// For each spring: its two ends.
    pub(super) springs: Vec<[End; 2]>,
    /// For each rigid body: what is attached to it, as number of a body and nodes of its mesh.
    pub(super) held: Vec<Vec<(usize, Vec<u32>)>>,
    /// Attachments, then seams.
    pub(super) ties: Vec<TieSet>,
}

/// A fix with its nodes found.
pub(super) struct LoadedFix {
    /// Number of the body.
    pub(super) body: usize,
    pub(super) nodes: Vec<u32>,
    /// The unit directions along which each node is held; none where they are axes of space alone.
    pub(super) directions: Option<Vec<Vec<[f64; 3]>>>,
}

/// One end of a spring.
#[derive(Debug, Clone, Copy)]
pub(super) enum End {
    /// A node of a body.
    Node(ProbeTarget),
    /// A place in space, m.
    Place([f64; 3]),
}

/// A body as it was read.
pub(super) struct LoadedBody {
    pub(super) read: Imported,
    /// The elements of each material entry.
    pub(super) materials: Vec<Vec<u32>>,
}

/// Reads everything; bodies that could not be read leave problems, and whatever refers to them is passed over.
pub(super) fn load(scene: &Scene) -> (Loaded, Vec<Problem>) {
    let mut problems = Vec::new();
    let mut budget = Budget::of_machine();
    let bodies = scene.bodies.iter().enumerate();
    let bodies: Vec<Option<LoadedBody>> =
        bodies.map(|(i, body)| load_body(body, i, &mut budget, &mut problems)).collect();
    let mut finder = Finder { scene, bodies: &bodies, problems };

    let mut fixes = Vec::new();
    for (i, fix) in scene.fixes.iter().enumerate() {
        let key = format!("fix[{i}]");
        let Some((body, mesh)) = finder.mesh(&fix.body) else { continue };
        let nodes = finder.selected(mesh, &fix.on, &key);
        let dimension = scene.bodies[body].dimension();
        match directions::directions(fix, mesh, dimension, &nodes) {
            Ok(directions) => fixes.push(LoadedFix { body, nodes, directions }),
            Err((part, message)) => finder.say(format!("{key}.{part}"), message),
        }
    }
    let (mut probes, mut region_probes) = (Vec::new(), Vec::new());
    for (i, probe) in scene.probes.iter().enumerate() {
        let key = format!("probe[{i}]");
        if probe.is_node() {
            probes.extend(finder.node(&probe.body, probe.point, probe.node, &key));
        } else if let Some((body, mesh)) = finder.mesh(&probe.body) {
            let materials = finder.bodies[body].as_ref().map_or(&[][..], |loaded| &loaded.materials);
            match RegionProbe::new(probe, body, (mesh, scene.bodies[body].dimension()), materials) {
                Ok(found) => region_probes.push(found),
                Err((part, message)) => finder.say(format!("{key}.{part}"), message),
            }
        }
    }
    let mut periodics = Vec::new();
    for (i, periodic) in scene.periodics.iter().enumerate() {
        let Some((body, mesh)) = finder.mesh(&periodic.body) else { continue };
        match periodic::partners(periodic, mesh) {
            Ok(pairs) => periodics.push((body, pairs)),
            Err((part, message)) if part.is_empty() => finder.say(format!("periodic[{i}]"), message),
            Err((part, message)) => finder.say(format!("periodic[{i}].{part}"), message),
        }
    }
    let mut strikes = Vec::new();
    for (i, strike) in scene.strikes.iter().enumerate() {
        let Some((body, mesh)) = finder.mesh(&strike.body) else { continue };
        strikes.push((body, finder.selected(mesh, &strike.on, &format!("strike[{i}]"))));
    }
    let mut springs = Vec::new();
    for (i, spring) in scene.springs.iter().enumerate() {
        let from = finder.end(&spring.from, &format!("spring[{i}].from"));
        let to = finder.end(&spring.to, &format!("spring[{i}].to"));
        springs.extend(from.zip(to).map(|(from, to)| [from, to]));
    }
    let mut ties = Vec::new();
    let mut held = vec![Vec::new(); scene.rigids.len()];
    for (i, attach) in scene.attachments.iter().enumerate() {
        let to = scene.rigids.iter().position(|rigid| attach.to.as_ref() == Some(&rigid.name));
        if let Some(to) = to {
            held[to].extend(finder.held(attach, &format!("attach[{i}]")));
            continue;
        }
        ties.extend(finder.attachment(attach, format!("attach[{i}]")));
    }
    for (i, seam) in scene.seams.iter().enumerate() {
        ties.extend(finder.seam(seam, format!("seam[{i}]")));
    }
    let problems = finder.problems;
    (
        Loaded {
            bodies: bodies.into_iter().flatten().collect(),
            fixes,
            probes,
            region_probes,
            periodics,
            strikes,
            springs,
            held,
            ties,
        },
        problems,
    )
}

fn load_body(
    body: &Body,
    index: usize,
    budget: &mut Budget,
    problems: &mut Vec<Problem>,
) -> Option<LoadedBody> {
    let key = format!("body[{index}]");
    if body.refine.as_ref().is_some_and(|refine| refine.levels() > MOST_REFINED) {
        // The checks of the scene have said so.
        return None;
    }
    let mut fits = |in_file: &[(ElementKind, usize)], problems: &mut Vec<Problem>| {
        budget.take(body, index, in_file).map_err(|problem| problems.push(problem)).ok()
    };
    let scale = body.scale.unwrap_or(1.0);
    let translate = body.translate.unwrap_or_default();
    let read = if let Some(path) = &body.mesh {
        match mesh_import::read(path, body) {
            Ok(mut read) => {
                read.notes.iter_mut().for_each(|note| *note = format!("{}: {note}", path.display()));
                let elements =
                    read.mesh.blocks.iter().filter(|block| block.kind.dimension() == body.dimension());
                let counts: Vec<_> = elements.map(|block| (block.kind, block.count())).collect();
                fits(&counts, problems)?;
                read
            }
            Err(messages) => {
                let key = format!("{key}.mesh");
                problems.extend(messages.into_iter().map(|message| Problem::new(key.clone(), message)));
                return None;
            }
        }
    } else {
        fits(&[], problems)?;
        let (built, shape) = generate(body, scale, translate)?;
        match built {
            Ok(mesh) => Imported::generated(mesh),
            Err(error) => {
                problems.push(Problem::new(format!("{key}.{shape}"), error.to_string()));
                return None;
            }
        }
    };
    let mut read = read;
    if let Some(sheet) = &body.sheet {
        read.texture = Some(placed(sheet, scale, translate).texture(&read.mesh));
    }
    if body.order == Some(2) {
        read = on(read, Mesh::lifted);
    }
    let times = body.refine.as_ref().map_or(0, Refine::levels);
    for _ in 0..times {
        if read.pattern.is_some() {
            let message =
                "a sheet cut from a flat pattern of texture coordinates cannot be refined; remove this key";
            problems.push(Problem::new(format!("{key}.refine"), message));
            return None;
        }
        match &body.refine {
            Some(Refine::Along(RefineAlong { axes, .. })) => {
                let axes: Vec<usize> = axes.iter().map(|&axis| axis as usize).collect();
                match read.mesh.refined_along(&axes) {
                    Ok(finer) => read = on(read, |_| finer),
                    Err(error) => {
                        problems.push(Problem::new(format!("{key}.refine"), error.to_string()));
                        return None;
                    }
                }
            }
            _ => read = on(read, Mesh::refined),
        }
    }
    if body.locking != LockingCure::None {
        let solids = read.mesh.blocks.iter().filter(|block| block.kind.dimension() == 3);
        let (tet4, others): (Vec<_>, Vec<_>) = solids.partition(|block| block.kind == ElementKind::Tet4);
        if others.is_empty() {
            let message = "tet4 has one quadrature point, which mean dilation leaves as it is: use `order = 2`, or hex8";
            problems.push(Problem::new(format!("{key}.locking"), message));
            return None;
        }
        if !tet4.is_empty() {
            read.notes.push(format!("{}: mean dilation leaves the body's tet4 as they are", body.name));
        }
    }
    let materials = match materials(body, &read.mesh) {
        Ok(elements) => elements,
        Err(message) => {
            problems.push(Problem::new(format!("{key}.material"), message));
            return None;
        }
    };
    Some(LoadedBody { read, materials })
}

/// A body on a finer mesh.
fn on(read: Imported, make: impl FnOnce(&Mesh) -> FinerMesh) -> Imported {
    let finer = make(&read.mesh);
    let carry = |values: Option<Vec<f64>>| values.map(|values| finer.interpolate(&values));
    let mut fields = read.fields;
    for field in &mut fields {
        field.values = finer.cells.iter().map(|&cell| field.values[cell as usize]).collect();
    }
    let (displacement, velocity) = (carry(read.displacement), carry(read.velocity));
    let texture = read.texture.map(|corners| finer.texture(&read.mesh, &corners));
    Imported { displacement, velocity, fields, texture, mesh: finer.mesh, ..read }
}

/// The mesh of a generated shape, and the shape's key.
fn generate(body: &Body, scale: f64, translate: [f64; 3]) -> Option<(Result<Mesh, FemError>, &'static str)> {
    let place = |origin: [f64; 3]| std::array::from_fn(|k| scale * origin[k] + translate[k]);
    if let Some(shape) = &body.box_shape {
        let size = shape.size.map(|size| scale * size);
        let placed = BoxMesh { origin: place(shape.origin), size, ..shape.clone() };
        return Some((placed.build(), "box"));
    }
    Some((placed(body.sheet.as_ref()?, scale, translate).build(), "sheet"))
}

/// A generated sheet where its body has it.
fn placed(sheet: &SheetMesh, scale: f64, translate: [f64; 3]) -> SheetMesh {
    let size = sheet.size.map(|size| scale * size);
    let origin = std::array::from_fn(|k| scale * sheet.origin[k] + translate[k]);
    SheetMesh { origin, size, ..sheet.clone() }
}

/// The elements of each material entry.
fn materials(body: &Body, mesh: &Mesh) -> Result<Vec<Vec<u32>>, String> {
    const NONE: usize = usize::MAX;
    let entries = &body.material.0;
    let dimension = body.dimension();
    let mut owner: HashMap<u32, usize> = HashMap::new();
    for (i, entry) in entries.iter().enumerate() {
        let Some(name) = &entry.region else { continue };
        let region = mesh.region(name).map_err(|error| error.to_string())?;
        if region.dimension != dimension {
            let fills = if dimension == 3 { "fills volumes" } else { "of a sheet covers surfaces" };
            return Err(format!("region '{name}' has dimension {}; a material {fills}", region.dimension));
        }
        for &element in &region.elements {
            if let Some(other) = owner.insert(element, i) {
                let other = entries[other].region.as_deref().unwrap_or_default();
                return Err(format!(
                    "element {element} is in the regions '{other}' and '{name}', which both have a material"
                ));
            }
        }
    }
    let rest = entries.iter().position(|entry| entry.region.is_none()).unwrap_or(NONE);
    let mut elements = vec![Vec::new(); entries.len()];
    for element in mesh.cells_of_dimension(dimension) {
        let entry = owner.get(&element).copied().unwrap_or(rest);
        if entry == NONE {
            return Err(format!(
                "element {element} is in no region that has a material; add a material without `region` for the rest"
            ));
        }
        elements[entry].push(element);
    }
    Ok(elements)
}

/// Finds nodes by what a scene says of them.
struct Finder<'a> {
    scene: &'a Scene,
    bodies: &'a [Option<LoadedBody>],
    problems: Vec<Problem>,
}

impl<'a> Finder<'a> {
    fn say(&mut self, key: impl Into<String>, message: impl Into<String>) {
        self.problems.push(Problem::new(key, message));
    }

    /// The body of this name and its mesh; nothing where it is unknown or could not be read, which
    /// has been said before.
    fn mesh(&self, name: &str) -> Option<(usize, &'a Mesh)> {
        let body = self.scene.bodies.iter().position(|body| body.name == name)?;
        self.bodies[body].as_ref().map(|loaded| (body, &loaded.read.mesh))
    }

    /// The nodes of a selection; none where that is wrong, which is then said.
    fn selected(&mut self, mesh: &Mesh, on: &Selection, key: &str) -> Vec<u32> {
        select::nodes(mesh, on).unwrap_or_else(|(part, message)| {
            self.say(format!("{key}.{part}"), message);
            Vec::new()
        })
    }

    /// Number of the body whose nodes a rigid body holds, and the nodes.
    fn held(&mut self, attach: &Attach, name: &str) -> Option<(usize, Vec<u32>)> {
        let (body, mesh) = self.mesh(&attach.body)?;
        Some((body, self.selected(mesh, &attach.on, name)))
    }

    fn attachment(&mut self, attach: &Attach, name: String) -> Option<TieSet> {
        let (body, mesh) = self.mesh(&attach.body)?;
        let nodes = self.selected(mesh, &attach.on, &name);
        let bodies = self.bodies;
        let own = bodies[body].as_ref()?;
        let Some(to) = &attach.to else {
            let ties = ties::to_space(attach, &nodes, own);
            return Some(TieSet { name, body, to: None, is_exact: false, ties });
        };
        let (to, _) = self.mesh(to)?;
        let dimension = self.scene.bodies[to].dimension();
        match ties::to_surface(attach, &nodes, own, bodies[to].as_ref()?, dimension) {
            Ok(ties) => {
                let is_exact = attach.stiffness.is_none();
                Some(TieSet { name, body, to: Some(to), is_exact, ties })
            }
            Err(message) => {
                let key = if attach.surface.is_some() { format!("{name}.surface") } else { name };
                self.say(key, message);
                None
            }
        }
    }

    fn seam(&mut self, seam: &Seam, name: String) -> Option<TieSet> {
        let ((body, mesh), (to, to_mesh)) = (self.mesh(&seam.body)?, self.mesh(seam.to_body())?);
        let bodies = [self.bodies[body].as_ref()?, self.bodies[to].as_ref()?];
        let sewn = if let (Some(region), Some(to_region)) = (&seam.region, &seam.to_region) {
            ties::along_curves(seam, [region, to_region], bodies)
        } else {
            let listed = |nodes: &'_ Option<Vec<usize>>| nodes.clone().unwrap_or_default();
            let nodes = self.listed(mesh, &listed(&seam.nodes), format!("{name}.nodes"));
            let others = self.listed(to_mesh, &listed(&seam.to_nodes), format!("{name}.to_nodes"));
            ties::in_pairs(seam, &nodes, &others, bodies).map(|ties| (true, ties))
        };
        let is_exact = seam.stiffness.is_none();
        match sewn {
            Ok((true, ties)) => Some(TieSet { name, body, to: Some(to), is_exact, ties }),
            Ok((false, ties)) => Some(TieSet { name, body: to, to: Some(body), is_exact, ties }),
            Err(message) => {
                self.say(name, message);
                None
            }
        }
    }

    fn listed(&mut self, mesh: &Mesh, nodes: &[usize], key: String) -> Vec<u32> {
        select::listed_nodes(mesh, nodes).unwrap_or_else(|message| {
            self.say(key, message);
            Vec::new()
        })
    }

    fn node(
        &mut self,
        name: &str,
        point: Option<[f64; 3]>,
        node: Option<usize>,
        key: &str,
    ) -> Option<ProbeTarget> {
        let (body, mesh) = self.mesh(name)?;
        let node = match (node, point) {
            (Some(node), _) => *self.listed(mesh, &[node], format!("{key}.node")).first()? as usize,
            (None, Some(point)) => mesh.nearest_node(point)? as usize,
            (None, None) => return None,
        };
        Some(ProbeTarget { body, node })
    }

    fn end(&mut self, end: &SpringEnd, key: &str) -> Option<End> {
        match &end.body {
            Some(body) => self.node(body, end.point, end.node, key).map(End::Node),
            None => end.point.map(End::Place),
        }
    }
}
