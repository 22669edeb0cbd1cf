//! The frames that measure slip: cells of a body for its points, faces of half-spaces, and pairs of edges.

use super::Anchor;
use super::slip::{self, Slip};
use crate::distance::{Closest, Shape, Vec3, at};
use crate::pairs::{Contact, Partners, StepSettings};

/// Relative difference of distances that counts as round-off.
const SAME_DISTANCE: f64 = 1e-9;

/// Relative difference of distances below which the choice between cells may not depend on the end of a step. If it does, a node that lies
/// above an edge, as in aligned meshes, changes between the cells of the edge while a solver varies the end, its slip jumps, and iterations do
/// not converge: a block of 4 × 4 cells .1 m above a slab of 8 × 8 finds no equilibrium in 100 s, with this bound one in .8 s. Between
/// equilibria, a cell is kept up to this difference, so that an equilibrium remains one in the next step.
const LIKE_DISTANCE: f64 = 0.1;

/// Weight of the other end of an edge below which a closest point is at an end, as far as round-off tells.
const AT_AN_END: f64 = 1e-9;

/// Difference of [`slip::facing`] below which two cells face a point equally, so that neighbours on a smooth surface do.
const SAME_FACING: f64 = 0.1;

impl Contact<'_> {
    /// Returns the frame that measures slip, and the slip. A point is measured on the cell of [`Contact::nearest_cell`]; the
    /// cell of its anchor is kept as long as no other cell is nearer, between equilibria by more than [`LIKE_DISTANCE`].
    pub(super) fn slip_of(
        &self,
        partners: Partners,
        x: [&[f64]; 2],
        before: Option<&Anchor>,
        settings: &StepSettings,
    ) -> Option<(u32, Slip)> {
        let surface = self.surface;
        let at_end = settings.is_equilibrium();
        match partners {
            Partners::PointBody(point, body) => {
                let node = surface.points[point as usize].node;
                let cell = self.nearest_cell(point, body, x, before.map(|anchor| anchor.cell), settings)?;
                let (shape, nodes, followed) = self.frame_of(node, cell);
                Some((cell, Slip::new(shape, nodes, followed, x, at_end)?))
            }
            Partners::PointPlane(point, plane) => {
                let face = &surface.half_spaces[plane as usize];
                let nodes = face.nodes_with(surface.points[point as usize].node);
                match face.corners {
                    // Coordinates on the face are those on the triangle of its nodes.
                    Some(_) => Some((0, Slip::new(face.shape(), nodes, [1, 2], x, at_end)?)),
                    None => Some((0, Slip::over_plane(nodes, face.normal, x))),
                }
            }
            Partners::Edges(a, b) => {
                // If an end of one edge is nearest, that end is a point with its own friction; the crossing of both
                // lines may be far away.
                let nodes = self.edge_nodes([a, b]);
                let closest = Shape::EdgeEdge.closest(&nodes.map(|node| at(x[0], node)));
                if closest.weights.iter().any(|weight| weight.abs() < AT_AN_END) {
                    return None;
                }
                Some((0, Slip::new(Shape::EdgeEdge, nodes, [0, 1], x, at_end)?))
            }
        }
    }

    /// Returns the shape and nodes of a pair of a point and a cell, and the places in it of the ends of the edge that bristles follow. The
    /// nodes of a triangle begin at its largest angle, opposite to that edge: coordinates along the sides of a small angle have the round-off
    /// of positions over its squared sine.
    fn frame_of(&self, node: u32, cell: u32) -> (Shape, [u32; 4], [usize; 2]) {
        let cell = &self.surface.cells[cell as usize];
        let (shape, followed) = (cell.shape(), cell.followed.map(usize::from));
        let first = if shape == Shape::PointTriangle { 3 - followed[0] - followed[1] } else { 0 };
        let [a, b, c] = [0, 1, 2].map(|k| cell.nodes[(first + k) % 3]);
        (shape, [node, a, b, c], followed.map(|place| 1 + (place + 3 - first) % 3))
    }

    /// Returns the cell of a body that is nearest to a point at x₀, or at x₁ if no cell is within reach at x₀. The nearest cell that is not
    /// within reach would depend on which candidates are listed. The choice at x₀ does not change while a solver varies x₁. Of cells that are
    /// about equally near at x₁, x₀ decides.
    pub(crate) fn nearest_cell(
        &self,
        point: u32,
        body: u32,
        [x0, x1]: [&[f64]; 2],
        kept: Option<u32>,
        settings: &StepSettings,
    ) -> Option<u32> {
        let difference = if settings.is_equilibrium() { LIKE_DISTANCE } else { SAME_DISTANCE };
        let reach = self.surface.point_gauge(point as usize, body)?.reach();
        match self.nearest_cell_at(point, body, [x0, x0], kept, difference)? {
            (cell, distance) if distance < reach => Some(cell),
            _ => self.nearest_cell_at(point, body, [x1, x0], kept, LIKE_DISTANCE).map(|(cell, _)| cell),
        }
    }

    /// Returns the cell of a body that is nearest to a point at x, and the smallest distance, m. Of cells that are equally near up to a relative
    /// difference, such as those of an edge, only those that face the point count: at the edge of a block, friction acts along the face on
    /// which the point lies, and not along the other one, whose tangents contain the direction of pressure. Of these it is `kept`, or the
    /// one whose centroid is nearest at x₀, or the first of those whose centroids are equally near: cells follow each other by their places
    /// at rest, so that the choice depends neither on numbers of nodes and cells nor on round-off.
    fn nearest_cell_at(
        &self,
        point: u32,
        body: u32,
        [x, x0]: [&[f64]; 2],
        kept: Option<u32>,
        difference: f64,
    ) -> Option<(u32, f64)> {
        let surface = self.surface;
        let node = surface.points[point as usize].node;
        let (_, cells) = self.bodies_of(point as usize).find(|&(other, _)| other == body)?;
        let place = |cell: u32, x: &[f64]| {
            let [a, b, c] = surface.cells[cell as usize].nodes;
            let shape = surface.cells[cell as usize].shape();
            (shape, [node, a, b, c].map(|node| at(x, node)))
        };
        let closest = |cell: u32| {
            let (shape, x) = place(cell, x);
            shape.closest(&x)
        };
        let to_centroid = |cell: u32| {
            let (shape, [point, corners @ ..]) = place(cell, x0);
            let corners = &corners[..shape.arity() - 1];
            (point - corners.iter().sum::<Vec3>() / corners.len() as f64).norm()
        };
        let all: Vec<_> = cells.iter().map(|&cell| (cell, closest(cell))).collect();
        let nearest = all.iter().map(|(_, closest)| closest.distance()).fold(f64::INFINITY, f64::min);
        let is_nearest = |closest: &Closest| closest.distance() <= nearest * (1.0 + difference);
        let with_facing = |&(cell, closest): &(u32, Closest)| {
            let (shape, x) = place(cell, x);
            (cell, slip::facing(shape, &x, closest.vector))
        };
        let mut ties: Vec<_> =
            all.iter().filter(|(_, closest)| is_nearest(closest)).map(with_facing).collect();
        let most = ties.iter().map(|&(_, facing)| facing).fold(0.0, f64::max);
        ties.retain(|&(_, facing)| facing >= most - SAME_FACING);
        if let Some(&(cell, _)) = ties.iter().find(|&&(cell, _)| Some(cell) == kept) {
            return Some((cell, nearest));
        }
        let ties: Vec<_> = ties.iter().map(|&(cell, _)| (cell, to_centroid(cell))).collect();
        let least = ties.iter().map(|&(_, distance)| distance).fold(f64::INFINITY, f64::min);
        let is_least = |distance: f64| distance <= least * (1.0 + SAME_DISTANCE);
        let cell = ties.iter().filter(|&&(_, distance)| is_least(distance)).map(|&(cell, _)| cell).min()?;
        Some((cell, nearest))
    }

    /// Returns the stretch of an anchor in the frame of `cell` at x₀: rotated into its plane, with the same length.
    pub(super) fn carry(&self, anchor: &Anchor, cell: u32, partners: Partners, x: &[f64]) -> [f64; 2] {
        let Partners::PointBody(point, _) = partners else { return anchor.stretch };
        if anchor.cell == cell {
            return anchor.stretch;
        }
        let node = self.surface.points[point as usize].node;
        let tangents = |cell: u32| {
            let (shape, nodes, followed) = self.frame_of(node, cell);
            Slip::new(shape, nodes, followed, [x, x], false).map(|slip| slip.tangents)
        };
        let (Some(from), Some(to)) = (tangents(anchor.cell), tangents(cell)) else { return [0.0; 2] };
        let vector = from[0] * anchor.stretch[0] + from[1] * anchor.stretch[1];
        let turned = to.map(|tangent| tangent.dot(&vector));
        let length = turned[0].hypot(turned[1]);
        if length == 0.0 { turned } else { turned.map(|part| part * (vector.norm() / length)) }
    }
}
