//! Makes ties between nodes from attachments and seams: nearest points of surfaces, points along curves.

use std::collections::HashMap;

use vi_core::{Combination, TiedMass};
use vi_fem::{Anchor, Tie};
use vi_mesh::{CellKind, Mesh, NearestPoints, Surface, resolution};

use super::read::ReadBody;
use crate::scene::{Attach, BodyId, Seam};

/// Nodes of a body that are tied to another body or to points in space.
pub(super) struct TieSet {
    /// For messages, e.g. `attach[0]`.
    pub(super) name: String,
    pub(super) body: BodyId,
    /// The other body; `None` for points in space.
    pub(super) to: Option<BodyId>,
    /// Whether the ties are exact rather than springs. Stiffness and length of exact ties are not used.
    pub(super) is_exact: bool,
    /// Ties in the node numbers of the bodies' own meshes: `node` belongs to `body`, anchors to `to`.
    pub(super) ties: Vec<Tie>,
}

/// Largest distance at the start between exactly tied points, as a fraction of the extent of a body.
const MEET: f64 = 1e-6;

/// Distances below this fraction of the extent of a body count as zero.
const NEAR: f64 = 1e-9;

/// Returns the initial positions of the nodes of a body, m.
fn start(body: &ReadBody<'_>) -> Vec<[f64; 3]> {
    let mut x = body.read.mesh.points.clone();
    if let Some(u) = &body.read.displacement {
        for (x, u) in x.iter_mut().zip(u.as_chunks::<3>().0) {
            (0..3).for_each(|k| x[k] += u[k]);
        }
    }
    x
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

fn extent(x: &[[f64; 3]]) -> f64 {
    x.iter().map(|&p| distance(p, x[0])).fold(0.0, f64::max)
}

/// Returns the distance on a body at `y` that counts as zero: the fraction `part` of its extent, or the round-off of
/// its coordinates.
fn negligible(part: f64, y: &[[f64; 3]]) -> f64 {
    (part * extent(y)).max(4.0 * resolution(y))
}

/// Returns the ties of `nodes` to the surface of another body.
pub(super) fn to_surface(
    attach: &Attach,
    nodes: &[u32],
    body: &ReadBody<'_>,
    to: &ReadBody<'_>,
) -> Result<Vec<Tie>, String> {
    let mesh = &to.read.mesh;
    let surface = match &attach.surface {
        Some(region) => Surface::of_region(mesh, region),
        None => Surface::of_body(mesh, to.scene.dimension()),
    };
    let surface = surface.map_err(|error| error.to_string())?;
    let (x, y) = (start(body), start(to));
    let search = NearestPoints::new(&surface, &y);
    let (near, meeting) = (negligible(NEAR, &y), negligible(MEET, &y));
    let tie = |&node: &u32| {
        let found = search.of(x[node as usize]).ok_or("the surface has no facets")?;
        let gap = if found.distance > near { found.distance } else { 0.0 };
        if attach.stiffness.is_none() && found.distance > meeting {
            return Err(format!(
                "node {node} is {:.3e} m from the surface; an exact tie needs nodes on the surface: move the \
                 bodies together, or give a `stiffness`",
                found.distance
            ));
        }
        Ok(Tie {
            node,
            anchor: Anchor::Nodes(found.weights),
            stiffness: attach.stiffness.unwrap_or_default(),
            length: attach.length.unwrap_or(gap),
        })
    };
    nodes.iter().map(tie).collect()
}

/// Returns the ties of `nodes` to their initial positions, which a motion may move.
pub(super) fn to_space(attach: &Attach, nodes: &[u32], body: &ReadBody<'_>) -> Vec<Tie> {
    let x = start(body);
    let tie = |&node: &u32| Tie {
        node,
        anchor: Anchor::Place(x[node as usize], attach.motion.clone()),
        stiffness: attach.stiffness.unwrap_or_default(),
        length: attach.length.unwrap_or(0.0),
    };
    nodes.iter().map(tie).collect()
}

/// Returns the stitches of a seam between two curves. Each stitch has a node of the curve with more nodes and weights
/// on the other. Also returns whether that curve is the first.
pub(super) fn along_curves(
    seam: &Seam,
    regions: [&str; 2],
    bodies: [&ReadBody<'_>; 2],
) -> Result<(bool, Vec<Tie>), String> {
    let places = bodies.map(start);
    let mut curves = Vec::new();
    for k in 0..2 {
        curves.push(curve(&bodies[k].read.mesh, regions[k])?);
    }
    let [Curve { nodes: first, is_closed }, Curve { nodes: second, is_closed: other_closed }] =
        &mut curves[..]
    else {
        return Ok((true, Vec::new()));
    };
    if is_closed != other_closed {
        return Err(format!(
            "of the curves '{}' and '{}' one is closed and the other has ends: sew two closed curves, or two with ends",
            regions[0], regions[1]
        ));
    }
    align(first, second, &places, *is_closed, seam.reverse);
    let is_first_finer = first.len() >= second.len();
    let (fine, coarse, x, y) = if is_first_finer {
        (&*first, &*second, &places[0], &places[1])
    } else {
        (&*second, &*first, &places[1], &places[0])
    };
    let ((at, _), (along, whole)) = (parts(fine, x), parts(coarse, y));
    let near = negligible(NEAR, y);
    // The last node of a closed curve repeats its first.
    let count = if *is_closed { fine.len() - 1 } else { fine.len() };
    let stitch = |k: usize| {
        let s = at[k];
        let next = along.partition_point(|&part| part < s).clamp(1, along.len() - 1);
        let (low, high) = (along[next - 1], along[next]);
        let share = ((s - low) / (high - low)).clamp(0.0, 1.0);
        let of_segment = near / ((high - low) * whole);
        let share = if share < of_segment { 0.0 } else { share };
        let share = if share > 1.0 - of_segment { 1.0 } else { share };
        let weights = [(coarse[next - 1], 1.0 - share), (coarse[next], share)];
        Tie {
            node: fine[k],
            anchor: Anchor::Nodes(weights.into_iter().filter(|(_, weight)| *weight != 0.0).collect()),
            stiffness: seam.stiffness.unwrap_or_default(),
            length: seam.length.unwrap_or(0.0),
        }
    };
    let ties: Vec<Tie> = (0..count).map(stitch).collect();
    check_meeting(seam, &ties, x, y)?;
    Ok((is_first_finer, ties))
}

/// Checks that exactly sewn points coincide at the start.
fn check_meeting(seam: &Seam, ties: &[Tie], x: &[[f64; 3]], y: &[[f64; 3]]) -> Result<(), String> {
    if seam.stiffness.is_some() {
        return Ok(());
    }
    let meeting = negligible(MEET, y);
    for tie in ties {
        let Anchor::Nodes(weights) = &tie.anchor else { continue };
        let other = [0, 1, 2].map(|i| weights.iter().map(|&(node, w)| w * y[node as usize][i]).sum());
        let gap = distance(x[tie.node as usize], other);
        if gap > meeting {
            return Err(format!(
                "node {} is {gap:.3e} m from its stitch; an exact seam needs edges that meet: move \
                 them together, or give a `stiffness`",
                tie.node
            ));
        }
    }
    Ok(())
}

/// Returns the stitches between pairs of nodes.
pub(super) fn in_pairs(
    seam: &Seam,
    nodes: &[u32],
    to_nodes: &[u32],
    bodies: [&ReadBody<'_>; 2],
) -> Result<Vec<Tie>, String> {
    let stitch = |(&node, &other): (&u32, &u32)| Tie {
        node,
        anchor: Anchor::Nodes(vec![(other, 1.0)]),
        stiffness: seam.stiffness.unwrap_or_default(),
        length: seam.length.unwrap_or(0.0),
    };
    let ties: Vec<Tie> = nodes.iter().zip(to_nodes).map(stitch).collect();
    check_meeting(seam, &ties, &start(bodies[0]), &start(bodies[1]))?;
    Ok(ties)
}

/// Returns exact ties as combinations. If one node is tied to one other, either can be eliminated. The choice avoids
/// prescribed nodes and nodes that are already tied, so that corners of several seams and held seams are valid.
pub(super) fn combinations(ties: &[Tie], is_prescribed: impl Fn(u32) -> bool) -> Vec<Combination> {
    let mut root: HashMap<u32, u32> = HashMap::new();
    let find = |root: &HashMap<u32, u32>, mut node: u32| {
        while let Some(&next) = root.get(&node) {
            node = next;
        }
        node
    };
    let mut combinations = Vec::new();
    for tie in ties {
        let Anchor::Nodes(weights) = &tie.anchor else { continue };
        if let [(other, _)] = weights[..] {
            let (mut node, mut other) = (find(&root, tie.node), find(&root, other));
            if node == other {
                continue;
            }
            if is_prescribed(node) {
                std::mem::swap(&mut node, &mut other);
            }
            root.insert(node, other);
            combinations.push(Combination { node, terms: vec![(other, 1.0)], mass: TiedMass::Exact });
        } else {
            let (node, terms) = (tie.node, weights.clone());
            combinations.push(Combination { node, terms, mass: TiedMass::Lumped });
        }
    }
    combinations
}

/// The nodes of a curve in order; a closed curve repeats its first node at the end.
struct Curve {
    nodes: Vec<u32>,
    is_closed: bool,
}

/// Returns the lines of a region as one curve.
fn curve(mesh: &Mesh, region: &str) -> Result<Curve, String> {
    mesh.region(region).map_err(|error| error.to_string())?;
    let mut neighbours: HashMap<u32, Vec<u32>> = HashMap::new();
    let cells = mesh.regions.iter().filter(|r| r.name == region && r.dimension == 1).flat_map(|r| &r.cells);
    for &cell in cells {
        if let Some((CellKind::Line2, &[a, b])) = mesh.cell(cell as usize) {
            neighbours.entry(a).or_default().push(b);
            neighbours.entry(b).or_default().push(a);
        }
    }
    let refused = |why: &str| format!("region '{region}' {why}; name a curve, or give the nodes one by one");
    if neighbours.is_empty() {
        return Err(refused("has no lines"));
    }
    if neighbours.values().any(|others| others.len() > 2) {
        return Err(refused("branches"));
    }
    let mut ends: Vec<u32> =
        neighbours.iter().filter(|(_, others)| others.len() == 1).map(|(&node, _)| node).collect();
    ends.sort_unstable();
    let is_closed = ends.is_empty();
    let start = ends.first().copied().or_else(|| neighbours.keys().min().copied()).unwrap_or_default();
    let mut nodes = vec![start];
    let mut before = u32::MAX;
    loop {
        let here = nodes[nodes.len() - 1];
        let mut others = neighbours[&here].clone();
        others.sort_unstable();
        let Some(&next) = others.iter().find(|&&next| next != before) else { break };
        nodes.push(next);
        if next == start {
            break;
        }
        before = here;
    }
    if nodes.len() != neighbours.len() + usize::from(is_closed) {
        return Err(refused("is in several pieces"));
    }
    Ok(Curve { nodes, is_closed })
}

/// Rotates the start of a closed second curve, and chooses its direction, so that it is nearest to the first; reverses
/// it if requested.
fn align(first: &[u32], second: &mut Vec<u32>, x: &[Vec<[f64; 3]>; 2], is_closed: bool, reverse: bool) {
    let far = |p: u32, q: u32| distance(x[0][p as usize], x[1][q as usize]);
    if is_closed {
        second.pop();
        let nearest = (0..second.len())
            .min_by(|&a, &b| far(first[0], second[a]).total_cmp(&far(first[0], second[b])))
            .unwrap_or(0);
        second.rotate_left(nearest);
        second.push(second[0]);
    }
    // Compares at a quarter and three quarters, which distinguishes the directions of closed curves too.
    let at = |nodes: &[u32], quarter: usize| nodes[quarter * (nodes.len() - 1) / 4];
    let cost = |second: &[u32]| far(at(first, 1), at(second, 1)) + far(at(first, 3), at(second, 3));
    let turned: Vec<u32> = second.iter().rev().copied().collect();
    if (cost(&turned) < cost(second)) != reverse {
        *second = turned;
    }
}

/// Returns the fraction of the length that precedes each node, 0 to 1, and the length, m.
fn parts(nodes: &[u32], x: &[[f64; 3]]) -> (Vec<f64>, f64) {
    let mut parts = vec![0.0];
    for pair in nodes.windows(2) {
        let last = parts[parts.len() - 1];
        parts.push(last + distance(x[pair[0] as usize], x[pair[1] as usize]));
    }
    let whole = parts[parts.len() - 1];
    parts.iter_mut().for_each(|part| *part /= whole);
    (parts, whole)
}
