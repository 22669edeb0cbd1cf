//! Determines whether 32 bits suffice for the coordinates of a frame.

use vi_mesh::{CellBlock, FarBlock};

/// Relative rounding error of a 32-bit number: half a unit of its 24th binary digit.
pub(super) const ROUNDING: f64 = 1.0 / 16_777_216.0;

/// Returns the largest absolute coordinate, m.
pub(super) fn largest(points: &[[f64; 3]]) -> f64 {
    points.as_flattened().iter().fold(0.0, |largest: f64, x| largest.max(x.abs()))
}

/// Returns the smallest distance between two nodes of a cell, m; infinite if no two nodes of a cell are apart.
pub(super) fn smallest_edge(points: &[[f64; 3]], blocks: &[CellBlock], far: &[FarBlock]) -> f64 {
    let mut smallest = f64::INFINITY;
    let mut see = |nodes: &[u32]| {
        for (i, &a) in nodes.iter().enumerate() {
            for &b in &nodes[..i] {
                let (a, b) = (points[a as usize], points[b as usize]);
                let square: f64 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
                if square > 0.0 {
                    smallest = smallest.min(square);
                }
            }
        }
    };
    blocks.iter().flat_map(CellBlock::cells).for_each(&mut see);
    for block in far {
        let (mut nodes, mut cell) = (block.nodes(), Vec::new());
        for _ in 0..block.elements.count() {
            cell.clear();
            cell.extend(nodes.by_ref().take(block.elements.kind().node_count()));
            see(&cell);
        }
    }
    smallest.sqrt()
}
