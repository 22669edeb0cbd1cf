//! Finds the hinges of a surface: pairs of triangles at an edge, and edges whose normal is held.

use super::sheet::BentSheet;
use crate::error::FemError;
use crate::sheet::dihedral;
use crate::small::tensor::{cross, dot};
use vi_mesh::Triangulation;

/// The second side of a hinge.
#[derive(Debug, Clone, Copy)]
pub(super) enum Opposite {
    /// The free corner of a second triangle, and that triangle with the number of its edge.
    Node(u32, (u32, u8)),
    /// A vector from the edge that is fixed in space: the second triangle is the support, which moves with the edge and
    /// keeps its normal. The vector is normal to the edge at rest, so that the support exerts a couple along the edge
    /// alone, besides the forces at its nodes.
    Held([f64; 3]),
    /// The normal of a mirror plane, away from the triangle: the second triangle is the mirror image of the first. The
    /// energy is half the energy of both triangles at their common edge.
    Mirror([f64; 3]),
}

impl Opposite {
    /// Returns whether the second triangle is a support and not a part of the sheet.
    pub(super) fn is_support(&self) -> bool {
        matches!(self, Self::Held(_) | Self::Mirror(_))
    }
}

/// Two triangles at an edge at rest. Coordinates along the edge count from its midpoint, positive from a to b.
pub(super) struct Hinge {
    /// The edge a → b in the orientation of the first triangle, then that triangle's free corner.
    pub(super) nodes: [u32; 3],
    pub(super) opposite: Opposite,
    pub(super) first: (u32, u8),
    /// Whether this is the only pair of triangles at its edge.
    pub(super) is_single: bool,
    pub(super) rest_angle: f64,
    /// Length of the edge, m.
    pub(super) length: f64,
    /// Heights of the two triangles over the edge, m.
    pub(super) heights: [f64; 2],
    /// Coordinates of the feet of the heights along the edge, m.
    pub(super) feet: [f64; 2],
}

impl Hinge {
    /// Returns the area of both triangles, m²; of the first alone if the other is a support.
    pub(super) fn area(&self) -> f64 {
        let [one, two] = self.heights;
        0.5 * self.length * if self.opposite.is_support() { one } else { one + two }
    }
}

/// Returns all hinges: every pair of triangles at every inner edge, edge by edge, then the held edges in the given
/// order.
///
/// # Errors
/// Returns an error for triangles folded flat onto each other at rest, and for held edges that are not on the boundary.
pub(super) fn hinges(sheet: &BentSheet) -> Result<Vec<Hinge>, FemError> {
    let surface = sheet.surface;
    let mut hinges = Vec::new();
    for edge in &surface.edges {
        for (k, &one) in edge.sides.iter().enumerate() {
            for &two in &edge.sides[k + 1..] {
                let opposite = Opposite::Node(surface.around(two.0, two.1)[0], two);
                hinges.push(hinge(sheet, one, opposite, edge.sides.len() == 2)?);
            }
        }
    }
    let side_of = |[a, b]: [u32; 2], what: &'static str| {
        let nodes = [a.min(b), a.max(b)];
        let found = surface.edges.binary_search_by_key(&nodes, |edge| edge.nodes).ok();
        match found.map(|index| &surface.edges[index].sides[..]) {
            Some(&[side]) => Ok(side),
            _ => Err(FemError::Invalid {
                what,
                problem: format!(
                    "nodes {a} and {b} are not the ends of a boundary edge of the sheet: name an edge that belongs to one triangle"
                ),
            }),
        }
    };
    for &edge in sheet.clamped {
        let side = side_of(edge, "clamped edge")?;
        hinges.push(hinge(sheet, side, Opposite::Held(continued(sheet, side)), true)?);
    }
    for &(edge, normal) in sheet.mirrored {
        let side = side_of(edge, "mirrored edge")?;
        hinges.push(hinge(sheet, side, Opposite::Mirror(away(sheet, side, normal)), true)?);
    }
    Ok(hinges)
}

/// Returns the vector normal to a mirror plane that points away from the triangle of `side` and is as long as its
/// edge.
fn away(sheet: &BentSheet, side: (u32, u8), normal: [f64; 3]) -> [f64; 3] {
    let [c, a, b] = sheet.surface.around(side.0, side.1).map(|node| sheet.surface.points[node as usize]);
    let (e, r) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
    let scale = (dot(e, e) / dot(normal, normal)).sqrt();
    normal.map(|n| if dot(r, normal) > 0.0 { -scale * n } else { scale * n })
}

/// Returns the height of a triangle continued beyond its edge: the vector from the foot of its free corner on the edge
/// away from that corner.
fn continued(sheet: &BentSheet, side: (u32, u8)) -> [f64; 3] {
    let [c, a, b] = sheet.surface.around(side.0, side.1).map(|node| sheet.surface.points[node as usize]);
    let (e, r) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
    let s = dot(r, e) / dot(e, e);
    [0, 1, 2].map(|i| s * e[i] - r[i])
}

fn hinge(
    sheet: &BentSheet,
    first: (u32, u8),
    opposite: Opposite,
    is_single: bool,
) -> Result<Hinge, FemError> {
    let surface = sheet.surface;
    let point = |node: u32| surface.points[node as usize];
    let [c, a, b] = surface.around(first.0, first.1);
    let d = match opposite {
        Opposite::Node(node, _) => point(node),
        Opposite::Held(vector) | Opposite::Mirror(vector) => [0, 1, 2].map(|i| point(a)[i] + vector[i]),
    };
    let corners = [point(a), point(b), point(c), d];
    let near = wing(surface, first, a);
    // A support is the mirror image of its triangle.
    let far = match opposite {
        Opposite::Node(_, second) => wing(surface, second, a),
        Opposite::Held(_) | Opposite::Mirror(_) => near,
    };
    let rest_angle = dihedral::angle(&corners);
    if rest_angle.abs() > std::f64::consts::PI - 1e-3 {
        let one = surface.cells[first.0 as usize];
        let two = match opposite {
            Opposite::Node(_, second) => surface.cells[second.0 as usize],
            Opposite::Held(_) | Opposite::Mirror(_) => one,
        };
        return Err(FemError::Invalid {
            what: "sheet",
            problem: format!(
                "at rest, element {} is folded flat onto its neighbour, element {}, across the edge of nodes {a} and {b}; \
                 unfold the rest shape, or give the two layers nodes of their own",
                one.min(two),
                one.max(two)
            ),
        });
    }
    Ok(Hinge {
        nodes: [a, b, c],
        opposite,
        first,
        is_single,
        rest_angle: if sheet.flat { 0.0 } else { rest_angle },
        length: 0.5 * (near.length + far.length),
        heights: [near.height, far.height],
        feet: [near.foot, far.foot],
    })
}

/// A triangle at an edge at rest; lengths in m.
#[derive(Clone, Copy)]
struct Wing {
    length: f64,
    height: f64,
    foot: f64,
}

/// Returns the triangle of `side` at rest, with coordinates along the edge counted from node a.
fn wing(surface: &Triangulation, side: (u32, u8), a: u32) -> Wing {
    let (triangle, k) = (side.0 as usize, usize::from(side.1));
    let corners = surface.corners(triangle);
    let (mut from, mut to) = ((k + 1) % 3, (k + 2) % 3);
    if surface.triangles[triangle][from] != a {
        (from, to) = (to, from);
    }
    let e = [0, 1, 2].map(|i| corners[to][i] - corners[from][i]);
    let r = [0, 1, 2].map(|i| corners[k][i] - corners[from][i]);
    let (length, n) = (dot(e, e).sqrt(), cross(e, r));
    Wing { length, height: dot(n, n).sqrt() / length, foot: dot(r, e) / length - 0.5 * length }
}
