//! The order in which the chunks of several terms are computed.

use super::{Chunk, Gather};

impl Gather {
    /// Puts the chunks in the order of their nodes, whatever their terms are. The halves that two threads compute then have few nodes in
    /// common, and the same nodes as the halves of the pass over the nodes. At a node, sums are added in the same order as before.
    pub(crate) fn in_order_of_nodes(mut self) -> Self {
        let nodes = std::mem::take(&mut self.slot_nodes);
        self.chunks.sort_by_cached_key(|Chunk { slots, .. }| {
            let sum: u64 = nodes[slots.clone()].iter().map(|&node| u64::from(node)).sum();
            sum / slots.len().max(1) as u64
        });
        let mut new_slots = vec![0; nodes.len()];
        for Chunk { slots, .. } in &mut self.chunks {
            let first = self.slot_nodes.len();
            (first as u32..).zip(slots.clone()).for_each(|(new, old)| new_slots[old] = new);
            self.slot_nodes.extend(&nodes[slots.clone()]);
            *slots = first..self.slot_nodes.len();
        }
        self.node_slots.iter_mut().for_each(|slot| *slot = new_slots[*slot as usize]);
        self
    }
}
