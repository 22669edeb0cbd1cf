//! Resolves probes over a part of a body: its nodes, and the elements for cell fields.

use std::collections::HashMap;

use super::read::ReadBody;
use super::select;
use crate::scene::{BodyId, Probe, Quantity, Statistic};

/// A probe over a part of a body.
#[derive(Debug, Clone)]
pub struct RegionProbe {
    /// Number of the body.
    pub body: BodyId,
    /// Requested quantities.
    pub quantities: Vec<(Statistic, Quantity)>,
    /// Nodes of the body's mesh, each once.
    pub nodes: Vec<u32>,
    /// Elements of each material entry with their rest volumes, m³; only if a cell field is requested.
    pub elements: Vec<(Vec<u32>, Vec<f64>)>,
}

impl RegionProbe {
    /// Resolves a probe of a scene.
    ///
    /// # Errors
    /// Returns a problem with the key at fault.
    pub(super) fn new(probe: &Probe, body: &ReadBody<'_>) -> Result<Self, (&'static str, String)> {
        let mesh = &body.read.mesh;
        let mut nodes = match probe.on.is_empty() {
            true => (0..mesh.points.len() as u32).collect(),
            false => select::nodes(mesh, &probe.on)?,
        };
        nodes.sort_unstable();
        nodes.dedup();
        let quantities = probe.quantities();
        let is_of_cells =
            |(_, quantity): &(_, Quantity)| matches!(quantity.field.of_elements(), Some((_, false)));
        let mut elements = Vec::new();
        // The check of the scene refuses fields of solids on sheets.
        if body.scene.dimension() == 3 && quantities.iter().any(is_of_cells) {
            let selected = select::elements(mesh, body.scene.dimension(), &probe.on)?;
            let parts = body.materials.iter().enumerate();
            let entry_of: HashMap<u32, usize> = parts
                .flat_map(|(entry, part)| part.elements.iter().map(move |&cell| (cell, entry)))
                .collect();
            elements = vec![(Vec::new(), Vec::new()); body.materials.len()];
            for cell in selected {
                if let Some(&entry) = entry_of.get(&cell) {
                    elements[entry].0.push(cell);
                }
            }
            for (cells, volumes) in &mut elements {
                *volumes = vi_fem::volumes(mesh, cells).map_err(|error| ("", error.to_string()))?;
            }
        }
        Ok(Self { body: body.id, quantities, nodes, elements })
    }
}
