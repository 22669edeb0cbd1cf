//! Masses, potentials and initial states of the components of a scene: bodies that springs join are
//! one component, all others stand alone. It must not read files.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

use vi_core::constraints::QuadraticConstraint;
use vi_core::{Combination, Fixed, Force, Potential, Prescribed, State, System, TiedMass};
use vi_fem::{
    Anchor, Gravity, LockingCure, Numbering, PointSpring, Sheet, SpringEnd, Tie, add_lumped_mass,
    add_row_sums, consistent_mass, mass_properties, rigid_velocities,
};

use super::initial::{add_field, constant};
use super::load::{End, Loaded, LoadedBody, LoadedFix};
use super::loads;
use super::prescribe::{NodalFix, coordinates};
use super::rigid::{self, Attached};
use super::{BodyModel, Model, ProbeTarget, RigidModel, directions, periodic, sheets, ties};
use crate::scene::{Body, MassKind, Problem, RestShape, Scene, Substance};

pub(super) fn assemble(scene: &Scene, loaded: Loaded) -> Result<Model, Vec<Problem>> {
    let component_of = components(scene, &loaded);
    let component_count = component_of.iter().max().map_or(0, |&last| last + 1);
    let Loaded {
        bodies: loaded_bodies,
        fixes,
        probes,
        region_probes,
        periodics,
        strikes,
        springs,
        held,
        ties: tie_sets,
    } = loaded;

    let mut problems = Vec::new();
    let mut notes = Vec::new();
    let is_consistent = scene.solver.mass == Some(MassKind::Consistent);
    let sums_rows = scene.statics.is_some() || is_consistent;
    let new_part = |_| Part { sums_rows, is_consistent, ..Part::default() };
    let mut parts: Vec<Part> = (0..component_count).map(new_part).collect();
    let mut bodies = Vec::with_capacity(loaded_bodies.len());
    let mut meshes = Vec::with_capacity(loaded_bodies.len());
    for (i, LoadedBody { read, materials }) in loaded_bodies.into_iter().enumerate() {
        let part = &mut parts[component_of[i]];
        let node_offset = part.mass.len();
        let numbering = Numbering::by_place(&read.mesh);
        let (read, mesh) = read.renumbered(&numbering);
        let body = LoadedBody { read, materials };
        notes.extend(body.read.notes.iter().cloned());
        let of_body = || scene.fixes.iter().zip(&fixes).filter(|(_, loaded)| loaded.body == i);
        let numbered = |loaded: &LoadedFix| loaded.nodes.iter().map(|&node| numbering.of(node)).collect();
        let edges = Edges {
            clamps: of_body().filter(|(fix, _)| fix.rotation).map(|(_, loaded)| numbered(loaded)).collect(),
            mirrors: of_body()
                .filter_map(|(fix, loaded)| Some((directions::mirror_normal(fix)?, numbered(loaded))))
                .collect(),
        };
        if let Err(message) = part.add(&scene.bodies[i], &body, node_offset, &edges) {
            problems.push(Problem::new(format!("body[{i}]"), message));
        }
        if let Some(wind) = &scene.wind
            && scene.bodies[i].dimension() == 2
        {
            match sheets::wind(wind, &body, node_offset, &scene.bodies[i].name) {
                Ok(force) => part.forces.push(force),
                Err(message) => problems.push(Problem::new("wind", message)),
            }
        }
        notes.extend(sheets::notes(scene, i));
        bodies.push(BodyModel {
            name: scene.bodies[i].name.clone(),
            mesh,
            texture: body.read.texture.clone(),
            materials: body.materials,
            component: component_of[i],
            node_offset,
            numbering,
            pattern: body.read.pattern.clone(),
        });
        meshes.push(body.read);
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    for (strike, (body, nodes)) in scene.strikes.iter().zip(&strikes) {
        let body = &bodies[*body];
        parts[body.component].strike(nodes.iter().map(|&node| body.node(node as usize)), strike.impulse);
    }
    for (i, (spring, ends)) in scene.springs.iter().zip(&springs).enumerate() {
        let node = |target: &ProbeTarget| bodies[target.body].node(target.node) as u32;
        let End::Node(target) = &ends[0] else { continue };
        let part = &mut parts[bodies[target.body].component];
        let near = part.rest[node(target) as usize];
        let (to, far) = match &ends[1] {
            End::Node(other) => (SpringEnd::Node(node(other)), part.rest[node(other) as usize]),
            End::Place(place) => (SpringEnd::Anchor(*place), *place),
        };
        let distance = (0..3).map(|k| (far[k] - near[k]).powi(2)).sum::<f64>().sqrt();
        let length = spring.length.unwrap_or(distance);
        match PointSpring::new(&format!("spring {i}"), node(target), to, spring.stiffness, length) {
            Ok(term) => part.potentials.push(Box::new(term)),
            Err(error) => problems.push(Problem::new(format!("spring[{i}]"), error.to_string())),
        }
    }
    for set in tie_sets {
        let number = |body: usize, node: u32| bodies[body].node(node as usize) as u32;
        let part = &mut parts[bodies[set.body].component];
        let mut springs = set.ties;
        for tie in &mut springs {
            tie.node = number(set.body, tie.node);
            if let (Anchor::Nodes(weights), Some(to)) = (&mut tie.anchor, set.to) {
                weights.iter_mut().for_each(|(node, _)| *node = number(to, *node));
            }
        }
        if set.is_exact {
            part.ties.extend(springs);
            continue;
        }
        match vi_fem::ties(&springs, &set.name) {
            Ok(terms) => part.potentials.extend(terms),
            Err(error) => problems.push(Problem::new(set.name, error.to_string())),
        }
    }
    let rigids = add_rigids(scene, &held, &component_of[bodies.len()..], &bodies, &mut parts);
    let rigids = rigids.map_err(|found| problems.extend(found)).unwrap_or_default();
    for (i, load) in scene.loads.iter().enumerate() {
        let Some(number) = bodies.iter().position(|body| body.name == load.body()) else { continue };
        let body = &bodies[number];
        let own: Vec<_> = scene
            .fixes
            .iter()
            .zip(&fixes)
            .filter(|(_, loaded)| loaded.body == number)
            .map(|(fix, loaded)| (fix, loaded.nodes.as_slice()))
            .collect();
        let target = loads::Target { body, of_scene: &scene.bodies[number], read: &meshes[number] };
        match loads::load(load, i, &target, &own) {
            Ok(added) => {
                let part = &mut parts[body.component];
                part.potentials.extend(added.potentials);
                part.forces.extend(added.forces);
            }
            Err(("", message)) => problems.push(Problem::new(format!("load[{i}]"), message)),
            Err((part, message)) => problems.push(Problem::new(format!("load[{i}].{part}"), message)),
        }
    }
    if let Some(damping) = &scene.damping {
        for ((body, read), of_scene) in bodies.iter().zip(&meshes).zip(&scene.bodies) {
            let mesh = &read.mesh;
            let part = &mut parts[body.component];
            let masses = &part.mass[body.node_offset..][..mesh.points.len()];
            match loads::damping(damping, of_scene, (body, mesh), masses) {
                Ok(forces) => part.forces.extend(forces),
                Err(message) => problems.push(Problem::new("damping", message)),
            }
        }
    }
    for (i, (body, pairs)) in periodics.iter().enumerate() {
        let body = &bodies[*body];
        let number = |node: u32| body.node(node as usize) as u32;
        let pairs = pairs.iter().map(|&(a, b)| (number(a), number(b)));
        parts[body.component].periodic.extend(pairs.map(|pair| (pair, i)));
    }
    let mut built = Vec::with_capacity(parts.len());
    for (c, part) in parts.into_iter().enumerate() {
        let fixes: Vec<NodalFix> = scene
            .fixes
            .iter()
            .zip(&fixes)
            .enumerate()
            .filter(|(_, (_, loaded))| bodies[loaded.body].component == c)
            .map(|(index, (fix, loaded))| {
                let number = |&node: &u32| (bodies[loaded.body].node(node as usize) as u32, node);
                let nodes = loaded.nodes.iter().map(number).collect();
                NodalFix { index, fix, nodes, directions: loaded.directions.as_deref() }
            })
            .collect();
        match part.into_system(scene, &fixes) {
            Ok(system) => built.push(system),
            Err(problem) => problems.push(problem),
        }
    }
    if problems.is_empty() {
        let fixes = fixes.into_iter().map(|fix| (fix.body, fix.nodes)).collect();
        Ok(Model { bodies, rigids, probes, fixes, region_probes, components: built, notes })
    } else {
        Err(problems)
    }
}

/// Adds the rigid bodies, with what is attached to them and their joints, to the components.
fn add_rigids(
    scene: &Scene,
    held: &[Vec<(usize, Vec<u32>)>],
    component_of: &[usize],
    bodies: &[BodyModel],
    parts: &mut [Part],
) -> Result<Vec<RigidModel>, Vec<Problem>> {
    let (mut all, mut problems) = (Vec::new(), Vec::new());
    // What nodes weigh when those that are tied to them have handed on their mass.
    let weights: Vec<Vec<f64>> = parts.iter().map(Part::handed_on_mass).collect();
    for (i, rigid) in scene.rigids.iter().enumerate() {
        let component = component_of[i];
        let part = &mut parts[component];
        let mut nodes: Vec<usize> = held[i]
            .iter()
            .flat_map(|(body, nodes)| nodes.iter().map(|&node| bodies[*body].node(node as usize)))
            .collect();
        nodes.sort_unstable();
        nodes.dedup();
        let attached: Vec<Attached> = nodes
            .into_iter()
            .map(|node| Attached {
                node: node as u32,
                x: [0, 1, 2].map(|k| part.x[3 * node + k]),
                mass: weights[component][node],
            })
            .collect();
        match rigid::build(rigid, &attached, component, part.mass.len()) {
            Ok(added) => {
                part.take(&added);
                all.push(added);
            }
            Err(message) => problems.push(Problem::new(format!("rigid[{i}]"), message)),
        }
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    let numbered = |name: &str| all.iter().find(|added| added.model.name == name);
    for (i, joint) in scene.joints.iter().enumerate() {
        let Some(body) = numbered(joint.body()) else { continue };
        let to = joint.to().and_then(numbered);
        let constraints = rigid::joint(joint, &format!("joint[{i}]"), body, to);
        parts[body.model.component].constraints.extend(constraints);
    }
    Ok(all.into_iter().map(|added| added.model).collect())
}

/// The component of each body, then of each rigid body: those joined by springs, ties, attachments or
/// joints share one, numbered by their first.
fn components(scene: &Scene, loaded: &Loaded) -> Vec<usize> {
    let body_count = loaded.bodies.len();
    let mut label: Vec<usize> = (0..body_count + scene.rigids.len()).collect();
    let rigid = |name: &str| scene.rigids.iter().position(|rigid| rigid.name == name);
    let joints = scene
        .joints
        .iter()
        .filter_map(|joint| Some((body_count + rigid(joint.body())?, body_count + rigid(joint.to()?)?)));
    let held = loaded
        .held
        .iter()
        .enumerate()
        .flat_map(|(number, bodies)| bodies.iter().map(move |(body, _)| (*body, body_count + number)));
    let springs = loaded.springs.iter().filter_map(|ends| match ends {
        [End::Node(a), End::Node(b)] => Some((a.body, b.body)),
        _ => None,
    });
    let ties = loaded.ties.iter().filter_map(|set| Some((set.body, set.to?)));
    for (a, b) in springs.chain(ties).chain(joints).chain(held) {
        let (keep, drop) = (label[a].min(label[b]), label[a].max(label[b]));
        label.iter_mut().filter(|l| **l == drop).for_each(|l| *l = keep);
    }
    let mut order = label.clone();
    order.sort_unstable();
    order.dedup();
    label.iter().map(|l| order.partition_point(|o| o < l)).collect()
}

/// Nodes of a sheet whose boundary edges do not end the sheet freely.
struct Edges {
    /// Edges between nodes of one of these keep their normal.
    clamps: Vec<HashSet<u32>>,
    /// Edges between nodes of one of these lie in a mirror plane with this normal.
    mirrors: Vec<([f64; 3], HashSet<u32>)>,
}

/// A component under construction.
#[derive(Default)]
struct Part {
    /// Weight acts on row sums of the mass, of the accuracy of the elements: nothing moves, or mass is
    /// consistent.
    sums_rows: bool,
    is_consistent: bool,
    /// Lumped mass a node, kg.
    mass: Vec<f64>,
    /// What weight acts on a node, kg.
    heavy: Vec<f64>,
    rest: Vec<[f64; 3]>,
    x: Vec<f64>,
    v: Vec<f64>,
    /// The kinetic energy of the velocities, where mass is consistent.
    kinetic: Vec<Box<dyn Potential>>,
    potentials: Vec<Box<dyn Potential>>,
    forces: Vec<Arc<dyn Force>>,
    /// What is held exactly.
    ties: Vec<Tie>,
    /// What rigid bodies add beside nodes.
    held: Vec<Combination>,
    directors: Vec<u32>,
    /// Pairs of nodes that move alike, with the number of the periodic pair in the scene.
    periodic: Vec<((u32, u32), usize)>,
    constraints: Vec<QuadraticConstraint>,
    prescribed: Vec<Prescribed>,
}

impl Part {
    fn add(
        &mut self,
        body: &Body,
        loaded: &LoadedBody,
        node_offset: usize,
        edges: &Edges,
    ) -> Result<(), String> {
        let read = &loaded.read;
        let mesh = &read.mesh;
        let mut mass = vec![0.0; mesh.points.len()];
        let mut heavy = mass.clone();
        for (entry, elements) in body.material.0.iter().zip(&loaded.materials) {
            if elements.is_empty() {
                continue;
            }
            let place =
                entry.region.as_ref().map_or_else(|| body.name.clone(), |r| format!("{}/{r}", body.name));
            let terms = match &entry.law {
                Substance::Solid(law) => {
                    if self.is_consistent {
                        let terms = consistent_mass(mesh, elements, law.density(), node_offset, &body.name);
                        self.kinetic.extend(terms.map_err(|error| error.to_string())?);
                    }
                    if self.sums_rows {
                        let sums = add_row_sums(mesh, elements, law.density(), &mut heavy);
                        sums.map_err(|error| error.to_string())?;
                    }
                    add_lumped_mass(mesh, elements, law.density(), &mut mass).and_then(|()| {
                        match body.locking {
                            LockingCure::None => vi_fem::elastic(mesh, elements, law, node_offset, &place),
                            LockingCure::MeanDilation => {
                                vi_fem::mean_dilation(mesh, elements, law, node_offset, &place)
                            }
                        }
                    })
                }
                Substance::Sheet(law) => {
                    let clamped = sheets::edges_between(mesh, elements, &edges.clamps);
                    let of_mirror = |(normal, nodes): &([f64; 3], HashSet<u32>)| {
                        let edges = sheets::edges_between(mesh, elements, std::slice::from_ref(nodes));
                        edges.into_iter().map(|edge| (edge, *normal)).collect::<Vec<_>>()
                    };
                    let mirrored: Vec<_> = edges.mirrors.iter().flat_map(of_mirror).collect();
                    let flat = body.rest == Some(RestShape::Flat);
                    let sheet = Sheet {
                        flat,
                        pattern: read.pattern.as_deref(),
                        fields: &read.fields,
                        clamped: &clamped,
                        mirrored: &mirrored,
                        ..Sheet::new(mesh, elements, law, node_offset, &place)
                    };
                    if self.is_consistent {
                        self.kinetic.push(sheet.consistent_mass().map_err(|error| error.to_string())?);
                    }
                    sheet.add_lumped_mass(&mut mass).and_then(|()| sheet.potentials())
                }
            };
            self.potentials.extend(terms.map_err(|error| error.to_string())?);
        }
        let mut x = mesh.points.as_flattened().to_vec();
        if let Some(displacement) = &read.displacement {
            x.iter_mut().zip(displacement).for_each(|(x, u)| *x += u);
        }
        if let Some(displacement) = &body.displacement {
            add_field(displacement, &mesh.points, &mut x).map_err(|why| format!("displacement: {why}"))?;
        }
        let mut v = read.velocity.clone().unwrap_or_else(|| vec![0.0; x.len()]);
        let positions = x.as_chunks::<3>().0;
        let is_heavy = self.sums_rows && body.dimension() == 3;
        let centre = mass_properties(positions, if is_heavy { &heavy } else { &mass }).centre;
        let linear = body.velocity.as_ref().map_or(Some([0.0; 3]), constant);
        if let Some(velocity) = &body.velocity
            && linear.is_none()
        {
            add_field(velocity, &mesh.points, &mut v).map_err(|why| format!("velocity: {why}"))?;
        }
        let linear = linear.unwrap_or_default();
        let angular = body.angular_velocity.unwrap_or_default();
        let rigid = rigid_velocities(positions, centre, linear, angular);
        v.iter_mut().zip(&rigid).for_each(|(v, rigid)| *v += rigid);
        self.rest.extend_from_slice(&mesh.points);
        self.heavy.extend(if is_heavy { heavy } else { mass.clone() });
        self.mass.extend(mass);
        self.x.extend(x);
        self.v.extend(v);
        Ok(())
    }

    /// Takes the nodes of a rigid body and what ties them.
    fn take(&mut self, added: &rigid::Added) {
        self.mass.extend(&added.mass);
        self.heavy.extend(&added.mass);
        self.rest.extend(added.x.as_chunks::<3>().0);
        self.x.extend(&added.x);
        self.v.extend(&added.v);
        self.held.extend(added.ties.iter().cloned());
        self.directors.extend(added.directors);
        self.constraints.extend(added.constraints.iter().cloned());
        self.prescribed.extend(added.prescribed());
    }

    /// The mass of its nodes when those tied to others have handed theirs on, kg.
    fn handed_on_mass(&self) -> Vec<f64> {
        let mut mass = self.mass.clone();
        if !self.ties.is_empty() {
            vi_core::hand_on_lumped_mass(&ties::combinations(&self.ties, |_| false), &mut mass);
        }
        mass
    }

    /// Shares an impulse (N s) among nodes by mass: all get the velocity impulse / Σm.
    fn strike(&mut self, nodes: impl Iterator<Item = usize> + Clone, impulse: [f64; 3]) {
        let mass: f64 = nodes.clone().map(|node| self.mass[node]).sum();
        for node in nodes {
            for k in 0..3 {
                self.v[3 * node + k] += impulse[k] / mass;
            }
        }
    }

    /// Ties nodes of periodic parts to their partners; returns each with the one that it follows.
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
            self.heavy.push(0.0);
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

    fn into_system(mut self, scene: &Scene, fixes: &[NodalFix]) -> Result<(System, State), Problem> {
        let followers = self.tie_periodic()?;
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
                .map_err(|error| Problem::new("attach", format!("what is held exactly: {error}")))?
        };
        if scene.gravity != [0.0; 3] {
            let amplitude = scene.gravity_amplitude.clone().unwrap_or_default();
            self.potentials.push(Box::new(Gravity::with_amplitude(&self.heavy, scene.gravity, amplitude)));
        }
        let mass = self.mass.iter().flat_map(|&m| [m; 3]).collect();
        let system = System::new(mass, self.potentials, coordinates)
            .and_then(|system| system.with_forces(self.forces))
            .and_then(|system| system.with_constraints(self.constraints))
            .map_err(|error| Problem::new("body", error.to_string()))?
            .with_consistent_mass(self.kinetic)
            .map_err(|error| Problem::new("solver.mass", error.to_string()))?;
        let mut state =
            system.state(0.0, &self.x, &self.v).map_err(|error| Problem::new("body", error.to_string()))?;
        vi_solvers::make_tangent(&system, &mut state)
            .map_err(|error| Problem::new("joint", error.to_string()))?;
        Ok((system, state))
    }
}
