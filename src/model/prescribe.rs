//! Makes prescribed coordinates from fixes.
//!
//! Nodes that are held along global axes alone keep these as their coordinates. Nodes that are held along other
//! directions get local axes. The first of these span the held directions, so that prescribed components are eliminated
//! as along global axes.

use std::collections::{BTreeMap, HashMap};

use vi_core::{Coordinates, CoreError, Fixed, NodeAxes, Path, Prescribed};
use vi_fem::{FemError, Motion};

use super::directions::{across, cross, dot, of_axis, unit};
use crate::scene::{Axis, Fix, HeldAxis, Problem};

/// A direction whose distance from the span of the others is smaller is linearly dependent on them.
const DEPENDENT: f64 = 1e-6;

/// Scalar products of unit vectors below this are taken as zero.
const ACROSS: f64 = 1e-9;

/// A fix with its nodes.
pub(super) struct NodalFix<'a> {
    /// Number of the fix in the scene, for messages.
    pub(super) index: usize,
    pub(super) fix: &'a Fix,
    /// Numbers of the nodes in the component and in the mesh of the body.
    pub(super) nodes: Vec<(u32, u32)>,
    /// Directions of each node; `None` if they are global axes only.
    pub(super) directions: Option<&'a [Vec<[f64; 3]>]>,
}

impl NodalFix<'_> {
    fn axes(&self) -> impl Iterator<Item = Axis> {
        self.fix.axes.iter().filter_map(|axis| match axis {
            HeldAxis::Space(axis) => Some(*axis),
            _ => None,
        })
    }

    /// Returns whether both fixes move a node in the same way along these directions, or both hold it still.
    fn agrees_with(&self, other: &Self, along: &[[f64; 3]]) -> bool {
        let is_still =
            |fix: &Fix, direction| fix.motion.as_ref().is_none_or(|motion| motion.is_still_along(direction));
        self.fix.motion == other.fix.motion
            || along.iter().all(|&direction| is_still(self.fix, direction) && is_still(other.fix, direction))
    }

    fn directions_of(&self, position: usize) -> Vec<[f64; 3]> {
        match self.directions {
            Some(directions) => directions[position].clone(),
            None => self.axes().map(of_axis).collect(),
        }
    }
}

/// A prescribed coordinate, and its direction in space.
struct Held {
    dof: u32,
    along: [f64; 3],
}

/// Makes the coordinates of a component whose nodes start at x (m, 3 per node), with `others` prescribed too.
/// `followers` maps a node to the node that it moves with; it is held there.
///
/// Several fixes may name a coordinate if they agree on its motion.
pub(super) fn coordinates(
    fixes: &[NodalFix],
    others: Vec<Prescribed>,
    followers: &BTreeMap<u32, u32>,
    x: &[f64],
) -> Result<Coordinates, Problem> {
    let mut of_fix: Vec<Vec<Held>> = fixes.iter().map(|_| Vec::new()).collect();
    let axes = hold_along_directions(fixes, followers, &mut of_fix)?;
    hold_along_axes(fixes, followers, &axes, &mut of_fix)?;
    let mut groups = others;
    let mut fixed = (Vec::new(), Vec::new());
    for (nodal, held) in fixes.iter().zip(of_fix) {
        match &nodal.fix.motion {
            None => {
                fixed.0.extend(held.iter().map(|held| held.dof));
                fixed.1.extend(held.iter().map(|held| along(held, x)));
            }
            Some(motion) => {
                if !held.is_empty() {
                    let path = path(motion, &held, x).map_err(|error| {
                        Problem::new(format!("fix[{}].motion", nodal.index), error.to_string())
                    })?;
                    groups.push(Prescribed { dofs: held.iter().map(|held| held.dof).collect(), path });
                }
            }
        }
    }
    if !fixed.0.is_empty() {
        groups.push(Prescribed { dofs: fixed.0, path: Box::new(Fixed(fixed.1)) });
    }
    Coordinates::new(x.len(), groups)
        .and_then(|coordinates| coordinates.with_axes(axes.into_values().collect()))
        .map_err(|error: CoreError| Problem::new("fix", error.to_string()))
}

/// Prescribes nodes whose directions are global axes.
fn hold_along_axes(
    fixes: &[NodalFix],
    followers: &BTreeMap<u32, u32>,
    axes: &BTreeMap<u32, NodeAxes>,
    of_fix: &mut [Vec<Held>],
) -> Result<(), Problem> {
    let mut owner: HashMap<u32, usize> = HashMap::new();
    let mut named = Vec::new();
    for (i, nodal) in fixes.iter().enumerate() {
        for &(number, node) in nodal.nodes.iter().filter(|(number, _)| !axes.contains_key(number)) {
            for axis in nodal.axes() {
                let dof = 3 * number + axis as u32;
                match owner.get(&dof) {
                    None => {
                        owner.insert(dof, i);
                        named.push((i, number, node, axis));
                    }
                    Some(&other) if fixes[other].agrees_with(nodal, &[of_axis(axis)]) => {}
                    Some(&other) => return Err(conflict(nodal, node, &format!("{axis:?}"), &fixes[other])),
                }
            }
        }
    }
    for (i, number, node, axis) in named {
        if let Some(leader) = followers.get(&number) {
            let its = owner.get(&(3 * leader + axis as u32));
            if its.is_some_and(|&its| fixes[its].agrees_with(&fixes[i], &[of_axis(axis)])) {
                continue;
            }
            return Err(lone_follower(&fixes[i], node));
        }
        of_fix[i].push(Held { dof: 3 * number + axis as u32, along: of_axis(axis) });
    }
    Ok(())
}

/// Prescribes nodes with other directions, and returns their local axes.
fn hold_along_directions(
    fixes: &[NodalFix],
    followers: &BTreeMap<u32, u32>,
    of_fix: &mut [Vec<Held>],
) -> Result<BTreeMap<u32, NodeAxes>, Problem> {
    // Collects for each node its directions, each with the fix and the node in the mesh.
    let mut all: BTreeMap<u32, Vec<([f64; 3], usize, u32)>> = BTreeMap::new();
    for nodal in fixes.iter().filter(|nodal| nodal.directions.is_some()) {
        for &(number, _) in &nodal.nodes {
            all.entry(number).or_default();
        }
    }
    if all.is_empty() {
        return Ok(BTreeMap::new());
    }
    for (i, nodal) in fixes.iter().enumerate() {
        for (position, &(number, node)) in nodal.nodes.iter().enumerate() {
            if let Some(held) = all.get_mut(&number) {
                held.extend(nodal.directions_of(position).into_iter().map(|direction| (direction, i, node)));
            }
        }
    }
    let spans: BTreeMap<u32, Vec<([f64; 3], usize)>> =
        all.iter().map(|(&number, held)| Ok((number, span(held, fixes)?))).collect::<Result<_, Problem>>()?;
    let mut axes = BTreeMap::new();
    for (&number, held) in &spans {
        if let Some(leader) = followers.get(&number) {
            let same = |a: &[([f64; 3], usize)], b: &[([f64; 3], usize)]| {
                let agree = |(a, i): &([f64; 3], usize), (b, j): &([f64; 3], usize)| {
                    dot(*a, *b) > 1.0 - ACROSS && fixes[*i].agrees_with(&fixes[*j], &[*a, *b])
                };
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| agree(a, b))
            };
            if spans.get(leader).is_some_and(|its| same(its, held)) {
                continue;
            }
            return Err(lone_follower(&fixes[all[&number][0].1], all[&number][0].2));
        }
        let own = completed(held);
        for (k, &(along, i)) in held.iter().enumerate() {
            of_fix[i].push(Held { dof: 3 * number + k as u32, along });
        }
        axes.insert(number, NodeAxes { node: number, axes: own });
    }
    Ok(axes)
}

/// Returns orthonormal directions that span the held ones, each with its fix.
fn span(held: &[([f64; 3], usize, u32)], fixes: &[NodalFix]) -> Result<Vec<([f64; 3], usize)>, Problem> {
    let mut basis: Vec<([f64; 3], usize)> = Vec::new();
    for &(direction, i, node) in held {
        let mut rest = direction;
        for (axis, other) in &basis {
            let product = dot(direction, *axis);
            if product.abs() > ACROSS && !fixes[*other].agrees_with(&fixes[i], &[direction, *axis]) {
                return Err(conflict(&fixes[i], node, &format!("{direction:?}"), &fixes[*other]));
            }
            let product = dot(rest, *axis);
            rest = [0, 1, 2].map(|k| rest[k] - product * axis[k]);
        }
        if dot(rest, rest).sqrt() > DEPENDENT {
            basis.extend(unit(rest).map(|axis| (axis, i)));
        }
    }
    Ok(basis)
}

/// Completes up to three orthonormal directions to a basis.
fn completed(held: &[([f64; 3], usize)]) -> [[f64; 3]; 3] {
    match held {
        [] => [Axis::X, Axis::Y, Axis::Z].map(of_axis),
        [(a, _)] => {
            let [b, c] = across(*a);
            [*a, b, c]
        }
        [(a, _), (b, _)] => [*a, *b, cross(*a, *b)],
        [(a, _), (b, _), (c, _), ..] => [*a, *b, *c],
    }
}

fn conflict(nodal: &NodalFix, node: u32, direction: &str, other: &NodalFix) -> Problem {
    let message = format!(
        "prescribes node {node} along {direction} with another motion than fix[{}]; let each coordinate follow one: hold different \
         `axes`, or leave the node out of one of them",
        other.index
    );
    Problem::new(format!("fix[{}]", nodal.index), message)
}

fn lone_follower(nodal: &NodalFix, node: u32) -> Problem {
    let message = format!(
        "holds node {node}, which moves as its partner of a [[periodic]] pair does, and that is not held in the same \
         way; hold the nodes of `from` in the same way"
    );
    Problem::new(format!("fix[{}]", nodal.index), message)
}

/// Returns the initial value of a held coordinate, m.
fn along(held: &Held, x: &[f64]) -> f64 {
    let node = held.dof as usize / 3;
    // Along a global axis this is bitwise a coordinate.
    match held.along.iter().position(|&value| value == 1.0) {
        Some(axis) => x[3 * node + axis],
        None => dot(held.along, std::array::from_fn(|k| x[3 * node + k])),
    }
}

fn path(motion: &Motion, held: &[Held], x: &[f64]) -> Result<Box<dyn Path>, FemError> {
    let place = |held: &Held| std::array::from_fn(|k| x[3 * (held.dof as usize / 3) + k]);
    let axis_of = |held: &Held| held.along.iter().position(|&value| value == 1.0);
    if held.iter().all(|held| axis_of(held).is_some()) {
        return motion.path(held.iter().map(|held| (place(held), axis_of(held).unwrap_or(0))).collect());
    }
    let coordinates = held.iter().flat_map(|held| [0, 1, 2].map(|axis| (place(held), axis))).collect();
    let path = motion.path(coordinates)?;
    Ok(Box::new(Turned { path, along: held.iter().map(|held| held.along).collect() }))
}

/// The components of a motion of points, each along its own direction.
struct Turned {
    /// Three coordinates per point.
    path: Box<dyn Path>,
    along: Vec<[f64; 3]>,
}

impl Turned {
    fn project(&self, out: &mut [f64], evaluate: impl Fn(&dyn Path, &mut [f64])) {
        let mut points = vec![0.0; 3 * self.along.len()];
        evaluate(self.path.as_ref(), &mut points);
        for ((out, point), along) in out.iter_mut().zip(points.as_chunks::<3>().0).zip(&self.along) {
            *out = dot(*along, *point);
        }
    }
}

impl Path for Turned {
    fn position(&self, t: f64, out: &mut [f64]) {
        self.project(out, |path, out| path.position(t, out));
    }
    fn velocity(&self, t: f64, out: &mut [f64]) {
        self.project(out, |path, out| path.velocity(t, out));
    }
    fn is_fixed(&self) -> bool {
        self.path.is_fixed()
    }
}
