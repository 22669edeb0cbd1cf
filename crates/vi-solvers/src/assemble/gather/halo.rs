//! Exchanges the sums of chunks at nodes that several ranks hold.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Exchange, Message, Padded, Traffic};

/// The exchange of one rank.
pub(super) struct Halo {
    pub(super) exchange: Arc<dyn Exchange>,
    /// Number of chunks with sums that other ranks need; they are the first ones.
    pub(super) border_count: usize,
    /// Number of their slots.
    pub(super) border_slots: usize,
    /// Number of slots of this rank; those of other ranks follow, in the order of the messages.
    pub(super) own_slots: usize,
    /// Number of coordinates per node.
    pub(super) block: usize,
    pub(super) messages: Vec<Message>,
    /// Number of nodes of all messages.
    pub(super) node_sums: usize,
    /// The slots that each message sends.
    pub(super) sends: Vec<Vec<u32>>,
}

impl Halo {
    /// Computes the sums of all `chunk_count` chunks with `sum` and receives those of other ranks, which fill the end of
    /// `partial`.
    pub(super) fn complete(
        &mut self,
        chunk_count: usize,
        partial: &mut [Padded],
        sum: impl Fn(Range<usize>, &mut [Padded]),
    ) {
        let block = self.block;
        let (border, inner) = (0..self.border_count, self.border_count..chunk_count);
        let (own, foreign) = partial.split_at_mut(self.own_slots);
        let (border_sums, inner_sums) = own.split_at_mut(self.border_slots);
        sum(border, border_sums);
        for (message, slots) in self.messages.iter_mut().zip(&self.sends) {
            for (out, &slot) in message.send.chunks_exact_mut(block).zip(slots) {
                out.copy_from_slice(&border_sums[slot as usize].0[..block]);
            }
        }
        self.exchange.slots(&mut self.messages, &mut || sum(inner.clone(), inner_sums));
        let received = self.messages.iter().flat_map(|message| message.receive.chunks_exact(block));
        for (sum, values) in foreign.iter_mut().zip(received) {
            sum.0[..block].copy_from_slice(values);
        }
    }

    /// Returns the messages from this rank to others per gradient.
    pub(super) fn traffic(&self) -> Traffic {
        let numbers = self.messages.iter().map(|message| message.send.len()).sum::<usize>();
        Traffic { bytes: 8 * numbers as u64, node_sum_bytes: 8 * (self.block * self.node_sums) as u64 }
    }
}
