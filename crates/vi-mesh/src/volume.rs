//! Computes the volume of a cell from its sides.

use std::collections::HashMap;

use crate::cell::CellKind;
use crate::facet::FacetPoint;
use crate::facet::rule;
use crate::mesh::Mesh;
use crate::vector::{cross, dot};

/// Measures cells of one mesh; the quadrature rules of sides are built once.
#[derive(Default)]
pub(crate) struct Volumes {
    rules: HashMap<CellKind, Vec<FacetPoint>>,
}

impl Volumes {
    /// Returns ⅓ ∮ x·n dA over the sides of a volume cell with nodes at `x`, m³. Negative for a mirrored cell.
    pub(crate) fn of(&mut self, kind: CellKind, x: &[[f64; 3]]) -> f64 {
        let mut volume = 0.0;
        for side in kind.sides() {
            let rule = self.rules.entry(side.kind).or_insert_with(|| rule(side.kind).unwrap_or_default());
            for point in rule {
                // Measure from the first node, so that a position far from the origin loses no digits.
                let nodes = side.nodes.iter().map(|&a| [0, 1, 2].map(|i| x[a][i] - x[0][i]));
                let [position, a, b] = point.frame(nodes);
                volume += point.weight * dot(position, cross(a, b)) / 3.0;
            }
        }
        volume
    }
}

impl Mesh {
    /// Returns the volume of a cell, m³; negative for a mirrored cell. `None` for a cell that does not exist or is
    /// not a volume.
    pub fn volume(&self, cell: usize) -> Option<f64> {
        let (kind, nodes) = self.cell(cell).filter(|(kind, _)| kind.dimension() == 3)?;
        let x: Vec<[f64; 3]> = nodes.iter().map(|&node| self.points[node as usize]).collect();
        Some(Volumes::default().of(kind, &x))
    }
}
