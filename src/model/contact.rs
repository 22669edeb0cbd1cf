//! Makes the contact term of a component from the surfaces that can meet: their nodes and triangles, thickness and
//! stiffness, and the excluded pairs of bodies.

use std::sync::Arc;

use vi_contact::{ContactTerm, Gap, PairRule, RollingTerm, SurfaceBuilder, median_edge};
use vi_core::{Live, State, System};
use vi_mesh::Bounds;

use super::cuts::Cuts;
use super::extent::extent;
use super::meeting::{Meeting, name_of};
use super::naming::part_in_words;
use super::outline::outline;
use super::parting::{Parted, Start, THINNEST};
use super::{BodyModel, RigidModel};
use crate::scene::{Contact, Problem, RigidShape, Scene, Substance};

/// The contact of one component.
#[derive(Debug, Clone)]
pub(crate) struct ContactModel {
    pub(crate) term: Arc<ContactTerm>,
    /// For each body of the term, its number among all bodies of the scene, deformable ones first.
    pub(crate) bodies: Vec<usize>,
    /// Distance about nodes in which partners are searched for messages, m.
    pub(crate) farthest_gap: f64,
    /// Numbers of two bodies in the scene, and how many pairs of their parts do not meet because springs sew them together.
    pub(crate) sewn: Vec<([usize; 2], usize)>,
}

impl ContactModel {
    /// Returns its live terms.
    pub(super) fn live(&self) -> Vec<Arc<dyn Live>> {
        let rolling = RollingTerm::new(&self.term).map(|term| Arc::new(term) as Arc<dyn Live>);
        std::iter::once(Arc::clone(&self.term) as Arc<dyn Live>).chain(rolling).collect()
    }
}

/// A surface of a body with its contact constants.
struct Part {
    /// Number among all bodies of the scene.
    number: usize,
    triangles: Vec<[u32; 3]>,
    /// Quadrilaterals of a deformable body that are cut into these triangles along either diagonal.
    quadrilaterals: Vec<[u32; 4]>,
    /// Triangles beyond which the body continues.
    cuts: Vec<[u32; 3]>,
    /// The node and outward normal of a half-space.
    plane: Option<(u32, [f64; 3])>,
    /// Two more nodes on the face of a half-space that rotates.
    corners: Option<[u32; 2]>,
    /// The point of a ball or the ends of a capsule, and the area that each represents, m².
    skeleton: (Vec<u32>, f64),
    /// Nodes c, d₁, d₂, d₃ of a rigid body.
    frame: Option<[u32; 4]>,
    radius: f64,
    distance: f64,
    /// Stiffness of a deformable body; `None` for a rigid one.
    stiffness: Option<f64>,
    /// Pressure that a rigid body is expected to exert, Pa.
    pressure: f64,
}

impl Part {
    /// Returns the box around it at positions x, m; empty for a half-space.
    fn bounds(&self, x: &[f64]) -> Bounds {
        let nodes = self.triangles.as_flattened().iter().chain(&self.skeleton.0);
        let place = |node: &u32| [0, 1, 2].map(|k| x[3 * *node as usize + k]);
        let mut bounds = Bounds::of(nodes.map(place));
        bounds.low.iter_mut().for_each(|low| *low -= self.radius);
        bounds.high.iter_mut().for_each(|high| *high += self.radius);
        bounds
    }
}

/// Defaults: d̂ as a fraction of the median edge of a surface or of the thickness of a rigid body, and κ as a fraction
/// of Young's modulus.
const DISTANCE: f64 = 0.1;
const DISTANCE_OF_RIGID: f64 = 0.01;
const STIFFNESS: f64 = 0.1;
/// Stiffness of a layer between rigid bodies, as a multiple of the expected pressure. The slope B' of the barrier is
/// then 0.1 under this pressure, which leaves three quarters of the layer open.
const STIFFNESS_OF_RIGID: f64 = 10.0;
/// Stiffness of a layer between rigid bodies without mass of their own, whose pressure cannot be estimated, Pa.
const STIFFNESS_WITHOUT_MASS: f64 = 1e5;
/// Placeholder of d̂ and κ for a part that takes these values from the other body of a pair.
const FROM_OTHERS: f64 = 1e300;
/// Distance that nodes of deformable bodies may move before pairs are searched again, as a fraction of the median edge: a quarter of the
/// default of d̂. All pairs within the reach have entries in the matrix of an implicit step. With .1, .05 and .025, a stack of
/// five cloths of 30 × 30 cells by `backward-euler` takes 9.7, 7.8 and 3.4 s and 192, 179 and 121 MB, cloth on a sphere by
/// `energy-momentum` 5.0, 5.1 and 4.8 s, and the bar of H1, in which searches are most of the work, .38, .44 and .48 s.
const REACH: f64 = 0.025;

/// The surfaces of all bodies, and the nodes that join them.
pub(super) struct Surfaces<'a> {
    pub(super) bodies: &'a [BodyModel],
    pub(super) rigids: &'a [RigidModel],
    /// Rest positions of the nodes of the component, m.
    pub(super) rest: &'a [[f64; 3]],
    /// Pairs of periodic nodes, each with the number of its table in the scene.
    pub(super) periodic: &'a [((u32, u32), usize)],
    /// The nodes that attachments and seams join to others.
    pub(super) stitches: &'a [Stitch],
}

/// A node that is joined to others.
pub(super) struct Stitch {
    /// Number of the component.
    pub(super) component: usize,
    pub(super) node: u32,
    /// The nodes that it is joined to.
    pub(super) others: Vec<u32>,
    /// Whether a spring joins them, so that they need not be at the same place.
    pub(super) is_spring: bool,
}

/// Returns the contact of component number `component`; `None` if nothing in it can meet. Records joined bodies that
/// cross at the start in `meeting`, and translations by `contact.resolve` in `parted`.
pub(super) fn contact(
    scene: &Scene,
    component: usize,
    (system, state): (&System, &mut State),
    surfaces: &Surfaces<'_>,
    meeting: &mut Meeting,
    parted: &mut Vec<Parted>,
) -> Result<Option<ContactModel>, Problem> {
    let Some(contact) = &scene.contact else { return Ok(None) };
    let Surfaces { bodies, rigids, .. } = *surfaces;
    let wrong = |message: String| Problem::new("contact", message);
    let rest = surfaces.rest.as_flattened();
    let mut parts = Vec::new();
    for (number, body) in bodies.iter().enumerate().filter(|(_, body)| body.component == component) {
        parts.push(of_body(scene, number, body, rest).map_err(wrong)?);
    }
    let extent = extent(component, bodies, rigids, rest);
    for (number, rigid) in rigids.iter().enumerate().filter(|(_, rigid)| rigid.component == component) {
        parts.extend(of_rigid(scene, bodies.len() + number, rigid, rest, extent));
    }
    enter_overlaps(&parts, surfaces, &system.positions(state), meeting);
    let meeting = &*meeting;
    let may_meet = |a: &Part, b: &Part| meeting.may_meet(scene, a.number, b.number);
    let any = |(i, part): (usize, &Part)| parts[i..].iter().any(|other| may_meet(part, other));
    if !parts.iter().enumerate().any(any) {
        return Ok(None);
    }
    enter_cuts(
        scene,
        &mut parts,
        &Cuts::new(system.coordinates(), surfaces.periodic),
        &system.positions(state),
        meeting,
    );
    let may_meet = |a: &Part, b: &Part| meeting.may_meet(scene, a.number, b.number);
    // The reach is a fraction of the edges of deformable bodies. With a whole edge as margin, every edge would be a
    // candidate with its neighbours.
    let edges = parts.iter().filter(|part| part.stiffness.is_some());
    let edges = edges.filter_map(|part| median_edge(&part.triangles, rest));
    let (reach, farthest_gap) = match edges.reduce(f64::min) {
        Some(edge) => (REACH * edge, DISTANCE * edge),
        None => {
            let layers = parts.iter().map(|part| contact.distance.unwrap_or(part.distance));
            let widest = layers.filter(|&distance| distance < FROM_OTHERS).fold(0.0, f64::max);
            (widest, widest)
        }
    };
    let stitches = || surfaces.stitches.iter().filter(|stitch| stitch.component == component);
    let term = |x: &[f64]| {
        let mut builder = builder(contact, &parts, rest, may_meet);
        builder.start(x);
        for Stitch { node, others, .. } in stitches() {
            others.iter().for_each(|&other| builder.stitch(*node, other));
        }
        for (i, a) in parts.iter().enumerate() {
            for (j, b) in parts.iter().enumerate().skip(i) {
                let is_joined = meeting.is_joined(a.number, b.number);
                let mut rule = match i == j {
                    true => PairRule::default(),
                    false => rule(scene, a, b, may_meet(a, b)),
                };
                rule.joined = is_joined;
                if rule != PairRule::default() {
                    builder.pair(i as u32, j as u32, rule);
                }
            }
        }
        hold(&mut builder, system, bodies, rigids, component);
        let surface = builder.build().map_err(|error| {
            // The contact crate numbers the bodies of the component; readers know their names.
            let names: Vec<&str> = parts.iter().map(|part| name_of(scene, part.number)).collect();
            wrong(format!("{error} (bodies, from 0: {})", names.join(", ")))
        })?;
        Ok::<_, Problem>(Arc::new(ContactTerm::new(Arc::new(surface), reach)))
    };
    let numbers: Vec<usize> = parts.iter().map(|part| part.number).collect();
    let mut x = system.positions(state);
    let mut found = term(&x)?;
    if contact.resolve {
        let normals = parts.iter().map(|part| (part.number, part.plane.map(|(_, normal)| normal))).collect();
        let start = Start { scene, meeting, system, bodies, rigids, term: &found, parts: normals };
        let moved = start.part(state).map_err(|message| {
            wrong(format!("{message}; move the bodies apart, or list the pair in `contact.exclude`"))
        })?;
        parted.extend(moved);
        x = system.positions(state);
    }
    let gaps = found.at(&x);
    let mut near = gaps.smallest_gaps(&x);
    // Bodies that start inside each other's layer would be pushed apart, so their layer is reduced to the initial gap.
    let layer = |[a, b]: [u32; 2]| parts[a as usize].distance.min(parts[b as usize].distance);
    let thinnest = |pair: [u32; 2]| match contact.distance {
        None if pair[0] != pair[1] => THINNEST * layer(pair),
        _ => 0.0,
    };
    let thin =
        |gap: &Gap| gap.gap <= thinnest([gap.bodies[0].min(gap.bodies[1]), gap.bodies[0].max(gap.bodies[1])]);
    if let Some(gap) = gaps.contact().gaps(&x).filter(thin).min_by(|a, b| a.gap.total_cmp(&b.gap)) {
        let parts = [0, 1].map(|side: usize| part_in_words(bodies, rigids, component, &gap.nodes[side]));
        let pair = gap.bodies.map(|body| name_of(scene, numbers[body as usize]));
        return Err(wrong(touching(pair, &parts, gap.gap, thinnest(gap.bodies))));
    }
    near.retain(|&pair, gap| pair[0] != pair[1] && contact.distance.is_none() && *gap < layer(pair));
    if !near.is_empty() {
        let thinner = found.with_distances(&near, &x).map_err(|error| wrong(error.to_string()))?;
        found = Arc::new(thinner);
    }
    let springs = stitches().filter(|stitch| stitch.is_spring);
    let sewn: Vec<[u32; 2]> =
        springs.flat_map(|stitch| stitch.others.iter().map(|&other| [stitch.node, other])).collect();
    let sewn = found.surface().stitched_pairs(&sewn).into_iter();
    let sewn = sewn.map(|(pair, count)| (pair.map(|body| numbers[body as usize]), count)).collect();
    Ok(Some(ContactModel { term: found, bodies: numbers, farthest_gap, sewn }))
}

/// Records the joined pairs whose surfaces cross at positions x: a bolt in a block that holds it does not meet the
/// block.
fn enter_overlaps(parts: &[Part], surfaces: &Surfaces<'_>, x: &[f64], meeting: &mut Meeting) {
    let outline = |part: &Part| outline(part.number, surfaces.bodies, surfaces.rigids, x);
    for (i, a) in parts.iter().enumerate() {
        for b in &parts[i + 1..] {
            if meeting.is_joined(a.number, b.number) && outline(a).meets(&outline(b)) {
                meeting.overlap(a.number, b.number);
            }
        }
    }
}

/// Finds the triangles of solids beyond which they continue; see [`Cuts`].
fn enter_cuts(scene: &Scene, parts: &mut [Part], cuts: &Cuts, x: &[f64], meeting: &Meeting) {
    let boxes: Vec<Bounds> = parts.iter().map(|part| part.bounds(x)).collect();
    for number in 0..parts.len() {
        let part = &parts[number];
        if part.number >= scene.bodies.len() || scene.bodies[part.number].dimension() != 3 {
            continue;
        }
        let meets =
            |other: &usize| *other != number && meeting.may_meet(scene, part.number, parts[*other].number);
        let others = (0..parts.len()).filter(meets).map(|other| boxes[other]);
        // Half-spaces have no box.
        let others: Vec<Bounds> = others.filter(|bounds| bounds.low[0] <= bounds.high[0]).collect();
        let is_cut =
            |&triangle: &[u32; 3]| cuts.is_on_seam(triangle) || cuts.is_on_mirror(triangle, x, &others);
        parts[number].cuts = part.triangles.iter().copied().filter(is_cut).collect();
    }
}

/// Makes the surface builder with all parts and their constants.
fn builder(
    contact: &Contact,
    parts: &[Part],
    rest: &[f64],
    may_meet: impl Fn(&Part, &Part) -> bool,
) -> SurfaceBuilder {
    let mut builder = SurfaceBuilder::new(rest);
    builder.friction(contact.friction);
    builder.damping(contact.damping);
    for part in parts {
        let body = builder.body(vi_contact::Body {
            radius: part.radius,
            distance: contact.distance.unwrap_or(part.distance),
            stiffness: contact.stiffness.or(part.stiffness).unwrap_or(FROM_OTHERS),
            meets_itself: part.stiffness.is_some() && may_meet(part, part),
        });
        builder.triangles(body, &part.triangles);
        builder.quadrilaterals(&part.quadrilaterals);
        builder.cuts(&part.cuts);
        match (part.skeleton.0.as_slice(), part.skeleton.1) {
            (&[point], area) => builder.point(body, point, area),
            (&[a, b], area) => builder.segment(body, [a, b], area),
            _ => {}
        }
        if let Some(frame) = part.frame {
            builder.frame(body, frame);
        }
        if let Some((node, normal)) = part.plane {
            builder.half_space(body, node, normal);
            if let Some(corners) = part.corners {
                builder.corners(corners);
            }
        }
    }
    builder
}

/// Returns the surface of a deformable body.
fn of_body(scene: &Scene, number: usize, body: &BodyModel, rest: &[f64]) -> Result<Part, String> {
    let of_scene = &scene.bodies[number];
    let surface = vi_mesh::Surface::of_body(&body.mesh, of_scene.dimension())
        .map_err(|error| format!("body '{}': {error}", body.name))?;
    let number_of = |node: u32| body.node(node as usize) as u32;
    let triangles: Vec<[u32; 3]> =
        surface.triangles().into_iter().map(|triangle| triangle.map(number_of)).collect();
    let quadrilaterals = surface.cut_quadrilaterals().into_iter().map(|nodes| nodes.map(number_of)).collect();
    let edge = median_edge(&triangles, rest).unwrap_or(1.0);
    let (mut radius, mut distance, mut young) = (0.0, DISTANCE * edge, f64::INFINITY);
    for entry in &of_scene.material.0 {
        match &entry.law {
            Substance::Solid(law) => {
                let (lambda, mu) = law.parameters().lame();
                young = young.min(mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu));
            }
            Substance::Sheet(law) => {
                let ([first, second, _], common) = (law.parameters().moduli(), law.parameters().common());
                let along = |own: f64, other: f64| own - first[1] * first[1] / other;
                young = young.min(along(first[0], second[1])).min(along(second[1], first[0]));
                distance = distance.min(common.thickness);
                radius = 0.5 * common.thickness;
            }
        }
    }
    let stiffness = Some(STIFFNESS * young);
    let (plane, corners, frame, skeleton) = (None, None, None, (Vec::new(), 0.0));
    Ok(Part {
        number,
        triangles,
        quadrilaterals,
        cuts: Vec::new(),
        plane,
        corners,
        skeleton,
        frame,
        radius,
        distance,
        stiffness,
        pressure: 0.0,
    })
}

/// Returns the surface of a rigid body in a component of this extent, m; `None` if it has no shape.
fn of_rigid(scene: &Scene, number: usize, model: &RigidModel, rest: &[f64], extent: f64) -> Option<Part> {
    let rigid = &scene.rigids[number - scene.bodies.len()];
    let (shape, form) = (rigid.shape.as_ref()?, model.form.as_ref()?);
    let (plane, distance) = match shape {
        RigidShape::Plane { normal } => {
            (Some((model.node as u32, model.directions_at_start(rest, *normal))), FROM_OTHERS)
        }
        _ => (None, DISTANCE_OF_RIGID * form.thickness),
    };
    let triangles = model.triangles.clone();
    let (mut skeleton, mut spread) = ((Vec::new(), 0.0), 1.0);
    if model.radius > 0.0 {
        let nodes: Vec<u32> = model.surface_nodes().map(|node| node as u32).collect();
        let layer = scene.contact.as_ref().and_then(|contact| contact.distance).unwrap_or(distance);
        let area = area_of_round(shape, layer);
        // The contact area is far smaller than the cross section of the body.
        spread = form.volume / (form.thickness * area * nodes.len() as f64);
        skeleton = (nodes, area);
    }
    // The pressure of a body that falls through its own extent, or hits at its initial speed; see docs/contact.md.
    let square = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>();
    let gravity = square(scene.gravity).sqrt();
    let density = rigid.density.or(rigid.mass.map(|mass| mass / form.volume)).unwrap_or(0.0);
    let speed = square(rigid.velocity.unwrap_or_default()) + 2.0 * gravity * extent;
    // Without weight and velocity, something else moves bodies; it may cross the scene during the run.
    let speed = if speed > 0.0 { speed } else { (extent / scene.time.end).powi(2) };
    let pressure = if shape.is_plane() { 0.0 } else { spread * density * (gravity * form.thickness + speed) };
    let (frame, radius, stiffness) = (Some(model.frame()), model.radius, None);
    let own = model.surface_nodes();
    let corners = (plane.is_some() && own.len() == 2).then_some([own.start as u32, own.start as u32 + 1]);
    Some(Part {
        number,
        triangles,
        quadrilaterals: Vec::new(),
        cuts: Vec::new(),
        plane,
        corners,
        skeleton,
        frame,
        radius,
        distance,
        stiffness,
        pressure,
    })
}

/// Returns the area (m²) that each point of a round skeleton represents: the part of its surface within d̂ of a tangent
/// plane. For a ball this is a cap, 2πR d̂, and for a cylinder a strip of half-width √(2R d̂).
fn area_of_round(shape: &RigidShape, layer: f64) -> f64 {
    let (length, radius) = match *shape {
        RigidShape::Capsule { length, radius } => (length, radius),
        _ => (0.0, 0.5 * shape.thickness()),
    };
    std::f64::consts::TAU * radius * layer + length * (2.0 * radius * layer).sqrt()
}

/// Returns the scene's settings for a pair, and the stiffness between two rigid bodies.
fn rule(scene: &Scene, a: &Part, b: &Part, may_meet: bool) -> PairRule {
    if !may_meet {
        return PairRule { excluded: true, ..PairRule::default() };
    }
    let Some(contact) = &scene.contact else { return PairRule::default() };
    let said = contact.pair(name_of(scene, a.number), name_of(scene, b.number));
    let are_rigid = contact.stiffness.is_none() && a.stiffness.is_none() && b.stiffness.is_none();
    let expected = STIFFNESS_OF_RIGID * a.pressure.max(b.pressure);
    let expected = if expected > 0.0 { expected } else { STIFFNESS_WITHOUT_MASS };
    PairRule {
        excluded: false,
        joined: false,
        distance: said.and_then(|pair| pair.distance),
        stiffness: said.and_then(|pair| pair.stiffness).or(are_rigid.then_some(expected)),
        friction: said.and_then(|pair| pair.friction),
        damping: said.and_then(|pair| pair.damping),
    }
}

/// Marks the nodes that move as one: those of each rigid body, and all prescribed ones.
fn hold(
    builder: &mut SurfaceBuilder,
    system: &System,
    bodies: &[BodyModel],
    rigids: &[RigidModel],
    component: usize,
) {
    const PRESCRIBED: u32 = 1;
    let mut count = vec![0_u8; system.coordinates().dof_count() / 3];
    for &dof in system.coordinates().prescribed().iter().flat_map(|group| &group.dofs) {
        count[dof as usize / 3] += 1;
    }
    let is_prescribed = |node: usize| count[node] == 3;
    for body in bodies.iter().filter(|body| body.component == component) {
        let nodes = (0..body.mesh.points.len()).map(|node| body.node(node));
        builder.hold(nodes.filter(|&node| is_prescribed(node)).map(|node| node as u32), PRESCRIBED);
    }
    let of_component = rigids.iter().filter(|rigid| rigid.component == component);
    for (rigid, group) in of_component.zip(PRESCRIBED + 1..) {
        let group = if is_prescribed(rigid.node) { PRESCRIBED } else { group };
        builder.hold(rigid.nodes(), group);
    }
}

/// Returns the message for two parts that touch at the start, or whose gap is not above `least` (m).
fn touching([a, b]: [&str; 2], [first, second]: &[String; 2], gap: f64, least: f64) -> String {
    let who = match a == b {
        true => format!("'{a}' meets itself"),
        false if gap > 0.0 => format!("'{a}' and '{b}' are closer than {least:.3e} m"),
        false => format!("'{a}' and '{b}' meet"),
    };
    let ways = match a == b {
        true => "move its parts apart, or write `contact.self = false`".to_owned(),
        false => format!(
            "move them apart, let `contact.resolve = true` do it, or write `contact.exclude = [[\"{a}\", \"{b}\"]]`"
        ),
    };
    format!(
        "{who} at the start: the gap of {first} and {second} is {gap:.3e} m, after the thickness of sheets; {ways}"
    )
}
