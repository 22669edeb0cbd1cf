//! The order in which the chunks of several terms are computed.

use super::{Chunk, Gather};

impl Gather {
    /// Puts the chunks in the order of their nodes, whatever their terms are. The halves that two threads compute then have few nodes in
    /// common, and the same nodes as the halves of the pass over the nodes. At a node, sums are added in the same order as before.
    pub(crate) fn in_order_of_nodes(mut self) -> Self {
        let mean = |chunk: &Chunk| {
            let nodes = &self.slot_nodes[chunk.slots.clone()];
            nodes.iter().map(|&node| f64::from(node)).sum::<f64>() / nodes.len().max(1) as f64
        };
        let means: Vec<f64> = self.chunks.iter().map(mean).collect();
        let mut order: Vec<usize> = (0..self.chunks.len()).collect();
        order.sort_by(|&a, &b| means[a].total_cmp(&means[b]));
        let mut new_slots = vec![0; self.slot_nodes.len()];
        let mut slot_nodes: Vec<u32> = Vec::with_capacity(self.slot_nodes.len());
        let mut chunks = Vec::with_capacity(order.len());
        for &number in &order {
            let Chunk { span, local, local_len, slots, patched } = &self.chunks[number];
            let first = slot_nodes.len();
            (first as u32..).zip(slots.clone()).for_each(|(new, old)| new_slots[old] = new);
            slot_nodes.extend(&self.slot_nodes[slots.clone()]);
            let slots = first..slot_nodes.len();
            let (span, local, local_len, patched) = (span.clone(), *local, *local_len, *patched);
            chunks.push(Chunk { span, local, local_len, slots, patched });
        }
        self.node_slots.iter_mut().for_each(|slot| *slot = new_slots[*slot as usize]);
        Self { chunks, slot_nodes, ..self }
    }
}
