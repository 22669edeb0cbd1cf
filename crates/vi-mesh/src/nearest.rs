//! Finds the point of a surface nearest to a point in space, as weights on the nodes of the surface.

use crate::cell::CellKind;
use crate::facet::{FacetBlock, Surface, shapes};
use crate::vector::dot;

/// A point of a surface, Σ weight × node.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfacePoint {
    /// The nodes of its facet with their weights, which sum to 1; zero weights are omitted.
    pub weights: Vec<(u32, f64)>,
    /// The position, m.
    pub position: [f64; 3],
    /// The distance from the given point, m.
    pub distance: f64,
}

/// Finds nearest points on one surface.
pub struct NearestPoints<'a> {
    surface: &'a Surface,
    x: &'a [[f64; 3]],
    /// Facets (block, number), each with the centre and the radius of a ball that contains it.
    balls: Vec<(usize, usize, [f64; 3], f64)>,
}

/// Number of halvings of the pattern search, which reaches 1e-15 of a facet.
const HALVINGS: usize = 50;

impl<'a> NearestPoints<'a> {
    /// Prepares the search on a surface whose nodes are at x (m).
    pub fn new(surface: &'a Surface, x: &'a [[f64; 3]]) -> Self {
        let mut balls = Vec::new();
        for (b, block) in surface.blocks.iter().enumerate() {
            for (f, nodes) in block.facets().enumerate() {
                let at = |&node: &u32| x[node as usize];
                let count = nodes.len() as f64;
                let middle = [0, 1, 2].map(|i| nodes.iter().map(|node| at(node)[i]).sum::<f64>() / count);
                let radius = nodes.iter().map(|node| distance(at(node), middle)).fold(0.0, f64::max);
                // Curved facets bulge beyond their nodes.
                balls.push((b, f, middle, if nodes.len() > 4 { 1.5 * radius } else { radius }));
            }
        }
        Self { surface, x, balls }
    }

    /// Returns the nearest point, the first of several; `None` for a surface without facets.
    pub fn of(&self, p: [f64; 3]) -> Option<SurfacePoint> {
        let mut best: Option<SurfacePoint> = None;
        let mut reach = self
            .balls
            .iter()
            .map(|(_, _, middle, radius)| distance(*middle, p) + radius)
            .fold(f64::INFINITY, f64::min);
        for &(b, f, middle, radius) in &self.balls {
            if distance(middle, p) - radius > reach {
                continue;
            }
            let found = self.on_facet(&self.surface.blocks[b], f, p);
            reach = reach.min(found.distance);
            if best.as_ref().is_none_or(|best| found.distance < best.distance) {
                best = Some(found);
            }
        }
        best
    }

    fn on_facet(&self, block: &FacetBlock, facet: usize, p: [f64; 3]) -> SurfacePoint {
        let nodes = &block.nodes[facet * block.arity()..][..block.arity()];
        // Measure from p, so that a position far from the origin loses no digits.
        let from: Vec<[f64; 3]> =
            nodes.iter().map(|&node| [0, 1, 2].map(|i| self.x[node as usize][i] - p[i])).collect();
        let values: Vec<f64> = match from[..] {
            [a, b, c] => on_triangle([a, b, c], [0.0; 3]).to_vec(),
            _ => search(block.kind, &from),
        };
        let gap = mean(&from, &values);
        let position = [0, 1, 2].map(|i| p[i] + gap[i]);
        let weights = nodes.iter().copied().zip(values).filter(|(_, weight)| *weight != 0.0).collect();
        SurfacePoint { weights, position, distance: dot(gap, gap).sqrt() }
    }
}

/// Returns Σ w x.
fn mean(x: &[[f64; 3]], weights: &[f64]) -> [f64; 3] {
    [0, 1, 2].map(|i| x.iter().zip(weights).map(|(x, w)| w * x[i]).sum())
}

/// Returns the shape functions at the point of a facet nearest to the origin, for nodes at `x`. A pattern search over
/// the reference facet needs no derivatives and cannot fail at the facet's edges.
fn search(kind: CellKind, x: &[[f64; 3]]) -> Vec<f64> {
    let values = |xi: [f64; 2]| -> Vec<f64> { shapes(kind, xi).into_iter().map(|(n, _)| n).collect() };
    let far = |xi: [f64; 2]| {
        let gap = mean(x, &values(xi));
        dot(gap, gap).sqrt()
    };
    let is_triangle = kind.corner_count() == 3;
    let inside = |[u, v]: [f64; 2]| {
        if !is_triangle {
            return [u.clamp(-1.0, 1.0), v.clamp(-1.0, 1.0)];
        }
        let (u, v) = (u.clamp(0.0, 1.0), v.clamp(0.0, 1.0));
        let over = 0.5 * (u + v - 1.0).max(0.0);
        [(u - over).clamp(0.0, 1.0), (v - over).clamp(0.0, 1.0)]
    };
    let mut step = 0.5;
    let mut best = if is_triangle { [1.0 / 3.0; 2] } else { [0.0; 2] };
    let mut least = far(best);
    for _ in 0..HALVINGS {
        loop {
            let start = best;
            for i in -2_i32..=2 {
                for j in -2_i32..=2 {
                    let xi = inside([start[0] + f64::from(i) * step, start[1] + f64::from(j) * step]);
                    let distance = far(xi);
                    if distance < least {
                        (best, least) = (xi, distance);
                    }
                }
            }
            if best == start {
                break;
            }
        }
        step *= 0.5;
    }
    values(best)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = [0, 1, 2].map(|i| a[i] - b[i]);
    dot(d, d).sqrt()
}

/// Returns the barycentric coordinates of the point of a triangle nearest to p (Ericson, *Real-Time Collision
/// Detection*, 2005, §5.1.5).
fn on_triangle([a, b, c]: [[f64; 3]; 3], p: [f64; 3]) -> [f64; 3] {
    let from = |q: [f64; 3], r: [f64; 3]| [0, 1, 2].map(|i| r[i] - q[i]);
    let (ab, ac) = (from(a, b), from(a, c));
    let (d1, d2) = (dot(ab, from(a, p)), dot(ac, from(a, p)));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (d3, d4) = (dot(ab, from(b, p)), dot(ac, from(b, p)));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let (d5, d6) = (dot(ab, from(c, p)), dot(ac, from(c, p)));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::box_mesh::BoxMesh;

    #[test]
    fn the_nearest_point_of_a_box_is_its_clamped_coordinates() {
        for element in [CellKind::Tet4, CellKind::Tet10, CellKind::Hex8, CellKind::Hex20] {
            let mesh =
                BoxMesh { size: [1.0; 3], cells: [2, 3, 2], element, origin: [0.0; 3] }.build().unwrap();
            let surface = Surface::of_body(&mesh, 3).unwrap();
            let search = NearestPoints::new(&surface, &mesh.points);
            for n in 0..60 {
                let p = [0, 1, 2].map(|k| 0.5 + 1.3 * (f64::from(7 * n + k) * 1.3).sin());
                let q = p.map(|c| c.clamp(0.0, 1.0));
                if p == q {
                    continue;
                }
                let found = search.of(p).unwrap();
                assert!(distance(found.position, q) < 1e-7, "{element}: {p:?} {q:?} {found:?}");
                let sum: f64 = found.weights.iter().map(|(_, w)| w).sum();
                assert!((sum - 1.0).abs() < 1e-12);
            }
        }
    }
}
