//! The linear field G of divergence 1 whose flux through a surface is the volume behind it.

use std::collections::HashMap;

use vi_mesh::{Mesh, Surface, resolution};

/// G_k(x) = w_k (x_k − c_k) with Σ w_k = 1. The flux of G out of a closed surface is the enclosed volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VolumeField {
    /// The weights w, which sum to 1.
    pub(super) weights: [f64; 3],
    /// The point c, m.
    centre: [f64; 3],
}

impl VolumeField {
    /// Returns a field whose flux gets no contribution from the edge of the surface, or `None` if there is no such
    /// field.
    ///
    /// The edge contributes ∮ (G × δx)·dx. This vanishes where δx = 0, and where the edge slides in a plane x_k =
    /// const that contains G, w_k (x_k − c_k) = 0.
    pub(super) fn of_surface(
        mesh: &Mesh,
        surface: &Surface,
        is_fixed: impl Fn(u32) -> [bool; 3],
    ) -> Option<Self> {
        // Collect the planes x_k = const in which edges slide.
        let mut planes: [Vec<f64>; 3] = Default::default();
        let near = (1e-9 * extent(mesh)).max(resolution(&mesh.points));
        for edge in edges(surface) {
            if edge.iter().all(|&node| is_fixed(node) == [true; 3]) {
                continue;
            }
            let is_plane = |k: usize| {
                let level = mesh.points[edge[0] as usize][k];
                edge.iter()
                    .all(|&node| is_fixed(node)[k] && (mesh.points[node as usize][k] - level).abs() <= near)
            };
            let k = (0..3).find(|&k| is_plane(k))?;
            let level = mesh.points[edge[0] as usize][k];
            if !planes[k].iter().any(|other| (other - level).abs() <= near) {
                planes[k].push(level);
            }
        }
        let usable = planes.each_ref().map(|levels| levels.len() < 2);
        let count = usable.iter().filter(|&&usable| usable).count();
        if count == 0 {
            return None;
        }
        let weights = usable.map(|usable| if usable { 1.0 / count as f64 } else { 0.0 });
        let centre = planes.map(|levels| levels.first().copied().unwrap_or(0.0));
        Some(Self { weights, centre })
    }

    /// Returns G(x), m.
    pub(super) fn at(&self, x: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| self.weights[k] * (x[k] - self.centre[k]))
    }
}

/// Returns the largest extent of a mesh along an axis, m.
fn extent(mesh: &Mesh) -> f64 {
    let side = |k: usize| {
        let range = mesh
            .points
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x[k]), high.max(x[k])));
        range.1 - range.0
    };
    (0..3).map(side).fold(0.0, f64::max)
}

/// Returns the edges that belong to one facet only, with their middle nodes.
fn edges(surface: &Surface) -> Vec<Vec<u32>> {
    let mut seen: HashMap<(u32, u32), (usize, Vec<u32>)> = HashMap::new();
    for block in surface.blocks() {
        let corners = if matches!(block.arity(), 3 | 6) { 3 } else { 4 };
        for nodes in block.facets() {
            for k in 0..corners {
                let (a, b) = (nodes[k], nodes[(k + 1) % corners]);
                let middle = nodes.get(corners + k).filter(|_| block.arity() > corners);
                let entry = seen.entry((a.min(b), a.max(b))).or_default();
                entry.0 += 1;
                entry.1 = [a, b].into_iter().chain(middle.copied()).collect();
            }
        }
    }
    let mut open: Vec<_> =
        seen.into_values().filter(|(count, _)| *count == 1).map(|(_, edge)| edge).collect();
    open.sort_unstable();
    open
}
