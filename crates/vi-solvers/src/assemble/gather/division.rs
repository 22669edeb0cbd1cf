//! Divides the chunks of a sum and their nodes among ranks.
//!
//! A rank computes a run of chunks of every term. Elements lie along a space-filling curve, so these runs are compact
//! and have few nodes in common. A rank holds all nodes of its chunks. If several ranks hold a node, each of them adds
//! the sums of all chunks at that node, in the order of the chunks, so that all have the bits of one process.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Exchange, Message, Padded, Terms, runs_of_ranks};

use super::halo::Halo;
use super::{Chunk, Gather};
use crate::assemble::spans::Span;
use crate::index::NONE;

/// The ranks of the chunks and nodes of a sum.
pub(crate) struct Division {
    /// The rank of each slot, that is, of its chunk.
    slot_ranks: Vec<u32>,
    /// The rank of each chunk.
    chunk_ranks: Vec<u32>,
    /// The nodes that each rank holds, ascending. The first rank also holds the nodes without a chunk.
    pub(crate) nodes: Vec<Vec<u32>>,
    /// Places in `nodes` of those that each rank reports: of the ranks that hold a node, the first reports it.
    pub(crate) reported: Vec<Vec<u32>>,
}

/// The sum that a rank computes.
pub(crate) struct Share {
    /// The sum of the rank's chunks on the nodes of the rank.
    pub(crate) gather: Gather,
    /// The portions of the terms of the whole system from which the terms of the rank are built.
    pub(crate) terms: Vec<TermPortion>,
    /// The chunks of the rank in the order of the whole system, as spans of the rank's terms.
    pub(crate) spans: Vec<Span>,
}

/// A run of stencils of a term of the whole system.
pub(crate) struct TermPortion {
    /// Index of the term.
    pub(crate) term: usize,
    /// The stencils of the run.
    pub(crate) stencils: Range<usize>,
}

impl Division {
    /// Divides the sum of a whole system among `size` ranks.
    pub(crate) fn new(whole: &Gather, size: usize) -> Self {
        let mut chunk_ranks = Vec::with_capacity(whole.chunks.len());
        for of_term in whole.chunks.chunk_by(|a, b| a.span.term == b.span.term) {
            let of_ranks = (0..).zip(runs_of_ranks(of_term.len(), size));
            chunk_ranks.extend(of_ranks.flat_map(|(rank, runs)| runs.map(move |_| rank)));
        }
        Self::with_ranks(whole, chunk_ranks, size)
    }

    /// Divides the sum of the part of a system that one of `size` ranks needs. `runs` are the numbers of the runs of
    /// every term in the whole system, and their ranks. Only the data of that rank are complete.
    pub(crate) fn of_part(part: &Gather, terms: &Terms, runs: &[Vec<(u32, u32)>], size: usize) -> Self {
        let rank = |Chunk { span, .. }: &Chunk| {
            runs[span.term][span.stencils.start / terms.fixed()[span.term].run_length()].1
        };
        Self::with_ranks(part, part.chunks.iter().map(rank).collect(), size)
    }

    /// Divides a sum, given the rank that computes each chunk.
    fn with_ranks(whole: &Gather, chunk_ranks: Vec<u32>, size: usize) -> Self {
        let mut slot_ranks = vec![0; whole.slot_nodes.len()];
        for (chunk, &rank) in whole.chunks.iter().zip(&chunk_ranks) {
            slot_ranks[chunk.slots.clone()].fill(rank);
        }
        let (nodes, reported) = (vec![Vec::new(); size], vec![Vec::new(); size]);
        let mut division = Self { slot_ranks, chunk_ranks, nodes, reported };
        for node in 0..whole.node_count() as u32 {
            let ranks = division.ranks_of(whole, node);
            let ranks = if ranks.is_empty() { vec![0] } else { ranks };
            let first = ranks[0] as usize;
            division.reported[first].push(division.nodes[first].len() as u32);
            for rank in ranks {
                division.nodes[rank as usize].push(node);
            }
        }
        division
    }

    /// Returns the chunks of each rank in order: index of the term and first stencil.
    pub(crate) fn runs(&self, whole: &Gather) -> Vec<Vec<(usize, usize)>> {
        let mut runs = vec![Vec::new(); self.nodes.len()];
        for (Chunk { span, .. }, &rank) in whole.chunks.iter().zip(&self.chunk_ranks) {
            runs[rank as usize].push((span.term, span.stencils.start));
        }
        runs
    }

    /// Returns the ranks with a chunk at a node, ascending.
    fn ranks_of(&self, whole: &Gather, node: u32) -> Vec<u32> {
        let mut ranks: Vec<u32> =
            whole.slots_of(node).iter().map(|&slot| self.slot_ranks[slot as usize]).collect();
        ranks.sort_unstable();
        ranks.dedup();
        ranks
    }

    /// Returns the sum that the rank of `exchange` computes, on its own nodes and terms. `base` is the sum of the gradients
    /// that never change.
    pub(crate) fn portion(&self, whole: &Gather, base: Option<&[f64]>, exchange: Arc<dyn Exchange>) -> Share {
        let rank = exchange.rank() as u32;
        let block = whole.block;
        let nodes = &self.nodes[rank as usize];
        let own = |&(_, chunk_rank): &(&Chunk, &u32)| *chunk_rank == rank;
        let own: Vec<&Chunk> =
            whole.chunks.iter().zip(&self.chunk_ranks).filter(own).map(|(chunk, _)| chunk).collect();
        let mut terms: Vec<TermPortion> = Vec::new();
        for Chunk { span, .. } in &own {
            match terms.last_mut() {
                Some(last) if last.term == span.term => last.stencils.end = span.stencils.end,
                _ => terms.push(TermPortion { term: span.term, stencils: span.stencils.clone() }),
            }
        }
        let own_span = |span: &Span| {
            let term = terms.iter().position(|portion| portion.term == span.term).unwrap_or(0);
            let offset = terms[term].stencils.start;
            Span { term, stencils: span.stencils.start - offset..span.stencils.end - offset }
        };
        let spans = own.iter().map(|chunk| own_span(&chunk.span)).collect();

        // The chunks at nodes of other ranks come first, so that their sums travel while the others are computed.
        let is_at_border = |chunk: &&Chunk| {
            let nodes = &whole.slot_nodes[chunk.slots.clone()];
            nodes.iter().any(|&node| self.ranks_of(whole, node).len() > 1)
        };
        let (border, inner): (Vec<&Chunk>, Vec<&Chunk>) = own.into_iter().partition(is_at_border);
        let border_count = border.len();
        let (mut chunks, mut local, mut slot_nodes) = (Vec::new(), Vec::new(), Vec::new());
        let mut slot_of = vec![NONE; whole.slot_nodes.len()];
        let mut border_slots = 0;
        for (k, chunk) in border.into_iter().chain(inner).enumerate() {
            if k == border_count {
                border_slots = slot_nodes.len();
            }
            let (first, start) = (slot_nodes.len(), local.len());
            for slot in chunk.slots.clone() {
                slot_of[slot] = slot_nodes.len() as u32;
                let node = whole.slot_nodes[slot];
                // A rank holds all nodes of its chunks.
                slot_nodes.push(nodes.binary_search(&node).unwrap_or(0) as u32);
            }
            local.extend_from_slice(&whole.local[chunk.local..chunk.local + chunk.local_len]);
            chunks.push(Chunk {
                span: own_span(&chunk.span),
                local: start,
                local_len: chunk.local_len,
                slots: first..slot_nodes.len(),
                patched: chunk.patched,
            });
        }
        if border_count == chunks.len() {
            border_slots = slot_nodes.len();
        }

        // What is sent and received at shared nodes, node by node and slot by slot: both ranks count in this order.
        let own_slots = slot_nodes.len();
        let mut sends: Vec<Vec<u32>> = vec![Vec::new(); self.nodes.len()];
        let mut receives: Vec<Vec<u32>> = vec![Vec::new(); self.nodes.len()];
        let mut node_sums = 0;
        for &node in nodes {
            for other in self.ranks_of(whole, node).into_iter().filter(|&other| other != rank) {
                node_sums += 1;
                for &slot in whole.slots_of(node) {
                    let slot_rank = self.slot_ranks[slot as usize];
                    if slot_rank == rank {
                        sends[other as usize].push(slot_of[slot as usize]);
                    } else if slot_rank == other {
                        receives[other as usize].push(slot);
                    }
                }
            }
        }
        let mut foreign = own_slots;
        for &slot in receives.iter().flatten() {
            slot_of[slot as usize] = foreign as u32;
            foreign += 1;
        }
        let messages = (0..self.nodes.len()).filter(|&other| !sends[other].is_empty()).map(|other| Message {
            rank: other,
            send: vec![0.0; block * sends[other].len()],
            receive: vec![0.0; block * receives[other].len()],
        });
        let messages: Vec<Message> = messages.collect();
        sends.retain(|slots| !slots.is_empty());

        let (mut node_start, mut node_slots) = (vec![0], Vec::new());
        for &node in nodes {
            node_slots.extend(whole.slots_of(node).iter().map(|&slot| slot_of[slot as usize]));
            node_start.push(node_slots.len() as u32);
        }
        let base = base.map(|base| {
            let of_node = |&node: &u32| &base[block * node as usize..][..block];
            nodes.iter().flat_map(of_node).copied().collect()
        });
        let stencil_count = chunks.iter().map(|chunk| chunk.span.stencils.len()).sum();
        let halo =
            Halo { exchange, border_count, border_slots, own_slots, block, messages, node_sums, sends };
        let gather = Gather {
            block,
            chunks,
            local,
            slot_nodes,
            node_start,
            node_slots,
            partial: vec![Padded::default(); foreign],
            stencil_count,
            constant: Vec::new(),
            base,
            halo: Some(halo),
        };
        Share { gather, terms, spans }
    }
}
