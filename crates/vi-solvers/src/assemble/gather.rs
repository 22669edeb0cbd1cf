//! Sums local blocks into nodal arrays in two phases, with the same bits on any number of threads.
//!
//! The stencils of every term are cut into chunks whose size depends only on the stencil count. In phase 1, parallel
//! over chunks, a chunk sums its stencils at its own nodes, in cache. Some terms do so themselves from a copy of the
//! nodes' positions; for the others, the blocks of a few stencils are written to a buffer and added. In phase 2,
//! parallel over nodes, the sums of the chunks around a node are added in the order of the chunks, through a map that
//! is built once. The memory traffic is that of the nodes of the chunks (about .3 per tetrahedron), not of the
//! blocks.
//!
//! If several ranks share a system, each computes some of the chunks (`division.rs`) and receives the sums of others
//! at the nodes that it shares with them (`halo.rs`).

pub(crate) mod division;
mod halo;
mod order;

use std::cell::RefCell;
use std::ops::Range;

use rayon::prelude::*;
use vi_core::{HessianKind, Padded, Patch, PatchArray, Terms, Traffic, prefetch};

use crate::assemble::gather::halo::Halo;
use crate::assemble::spans::{Span, mobilities, mobility_of, parts, spans};
use crate::index::group_by;
use crate::scratch::with_scratch;

/// Number of stencils whose blocks are evaluated together: their gradients stay in the first-level cache.
const BATCH: usize = 64;

/// With fewer stencils than this, the calling thread computes the sum alone.
const PARALLEL_STENCILS: usize = 3000;

/// Number of nodes that one task of phase 2 sums.
const NODES_PER_TASK: usize = 1024;

/// Distance in slots by which sums (phase 2) or positions (phase 1) are prefetched. Of 10⁶ tetrahedra, phase 2 takes
/// 6.2 ns each without, 3.6 at 16, 2.9 at 32 and 64; prefetching positions at 32 saves .6 ns of phase 1.
const AHEAD: usize = 32;

/// With fewer slots than this (half a megabyte), phase 2 finds the sums in cache and does not prefetch them. With 3700
/// slots, prefetching would take 1.03 ns per tetrahedron instead of .88; with 30 000, 1.0 instead of 1.1. No result
/// depends on it.
const IN_CACHE: usize = 1 << 14;

thread_local! {
    /// Positions and sums of a patch.
    static PATCH: RefCell<Option<[Box<PatchArray>; 2]>> = const { RefCell::new(None) };
}

struct Chunk {
    span: Span,
    /// Index in `Gather::local` of the first entry of its stencils.
    local: usize,
    /// Number of these entries.
    local_len: usize,
    /// Range of its nodal sums in `Gather::partial`.
    slots: Range<usize>,
    /// Whether the term sums its stencils itself.
    patched: bool,
}

/// The maps from the stencils of a system to its nodes, and the buffers of the sums.
pub(crate) struct Gather {
    /// Number of coordinates per node.
    block: usize,
    chunks: Vec<Chunk>,
    /// For each stencil and local node: the index of the node among the nodal sums of the chunk.
    local: Vec<u16>,
    /// The node of each nodal sum of each chunk.
    slot_nodes: Vec<u32>,
    /// Node n is summed from the slots `node_slots[node_start[n]..node_start[n + 1]]`.
    node_start: Vec<u32>,
    node_slots: Vec<u32>,
    /// The nodal sums of the chunks; only the first `block` numbers of each are used. Empty before the first sum.
    partial: Vec<Padded>,
    stencil_count: usize,
    /// Spans whose gradient never changes: all coordinates are fixed, or V is affine and independent of t.
    constant: Vec<Span>,
    /// The sum of their gradients, once it is computed.
    base: Option<Vec<f64>>,
    /// The exchange with other ranks, if they share the system.
    halo: Option<Halo>,
}

impl Gather {
    /// Builds the maps for `block` coordinates per node, which must divide the blocks of all terms.
    pub(crate) fn new(terms: &Terms, block: usize) -> Self {
        let node_count = terms.coordinates().dof_count() / block;
        let mobility = mobilities(terms);
        let (mut chunks, mut constant, mut local) = (Vec::new(), Vec::new(), Vec::new());
        let mut slot_nodes: Vec<u32> = Vec::new();
        let mut slot_of = vec![(u32::MAX, 0_u16); node_count];
        let mut stencil_count = 0;
        for (term, potential) in terms.fixed().iter().enumerate() {
            let traits = potential.traits();
            let stencils = potential.stencils();
            let split = stencils.block / block;
            let patched = stencils.block == 3 && block == 3 && potential.adds_gradients();
            for span in spans(term, potential.as_ref()) {
                let (free, moving) = mobility_of(&span, potential.as_ref(), &mobility);
                let still = traits.hessian == HessianKind::Zero || !(free || moving);
                if still && !traits.time_dependent {
                    constant.push(span);
                    continue;
                }
                let chunk = chunks.len() as u32;
                let first = slot_nodes.len();
                let start = local.len();
                for stencil in span.stencils.clone() {
                    for part in stencils.of(stencil).iter().flat_map(|&node| parts(node, split)) {
                        let slot = &mut slot_of[part as usize];
                        if slot.0 != chunk {
                            *slot = (chunk, (slot_nodes.len() - first) as u16);
                            slot_nodes.push(part);
                        }
                        local.push(slot.1);
                    }
                }
                stencil_count += span.stencils.len();
                let local_len = local.len() - start;
                let slots = first..slot_nodes.len();
                chunks.push(Chunk { span, local: start, local_len, slots, patched });
            }
        }
        local.shrink_to_fit();
        let (node_start, node_slots) = group_by(&slot_nodes, node_count);
        slot_nodes.shrink_to_fit();
        Self {
            block,
            chunks,
            local,
            slot_nodes,
            node_start,
            node_slots,
            partial: Vec::new(),
            stencil_count,
            constant,
            base: None,
            halo: None,
        }
    }

    /// Returns the number of nodes.
    fn node_count(&self) -> usize {
        self.node_start.len() - 1
    }

    /// Returns the slots of a node, in the order of their chunks.
    fn slots_of(&self, node: u32) -> &[u32] {
        let starts = &self.node_start[node as usize..];
        &self.node_slots[starts[0] as usize..starts[1] as usize]
    }

    /// Returns whether several ranks share the system.
    pub(crate) fn is_shared(&self) -> bool {
        self.halo.is_some()
    }

    /// Returns the messages from this rank to others per gradient.
    pub(crate) fn traffic(&self) -> Traffic {
        self.halo.as_ref().map_or_else(Traffic::default, Halo::traffic)
    }

    /// Returns the sum of the gradients that never change, computed at positions `x` and time t; `None` if there are
    /// none.
    pub(crate) fn base(&self, terms: &Terms, x: &[f64], t: f64) -> Option<Vec<f64>> {
        (!self.constant.is_empty()).then(|| sum_constant(&self.constant, terms, x, t))
    }

    /// Returns the number of coordinates per node.
    pub(crate) fn block(&self) -> usize {
        self.block
    }

    /// Returns the number of stencils whose gradient is computed once.
    pub(crate) fn constant_stencils(&self) -> usize {
        self.constant.iter().map(|span| span.stencils.len()).sum()
    }

    /// Returns the size of maps and buffers in bytes.
    pub(crate) fn bytes(&self) -> usize {
        let maps = self.slot_nodes.len() + self.node_start.len() + self.node_slots.len();
        2 * self.local.len() + 4 * maps + size_of::<Padded>() * self.slot_nodes.len()
    }

    /// Returns whether the work is large enough for several threads.
    pub(crate) fn is_parallel(&self) -> bool {
        self.stencil_count >= PARALLEL_STENCILS
    }

    /// Writes ∂V/∂x of every coordinate.
    pub(crate) fn gradient(&mut self, terms: &Terms, x: &[f64], t: f64, out: &mut [f64]) {
        self.sum_chunks(terms, x, t);
        let (this, length) = (&*self, NODES_PER_TASK * self.block);
        let sum = |(task, out): (usize, &mut [f64])| this.sum_nodes(task * NODES_PER_TASK, out);
        if self.is_parallel() {
            out.par_chunks_mut(length).enumerate().for_each(sum);
        } else {
            out.chunks_mut(length).enumerate().for_each(sum);
        }
    }

    /// Phase 1: computes the nodal sums of every chunk.
    pub(crate) fn sum_chunks(&mut self, terms: &Terms, x: &[f64], t: f64) {
        if self.base.is_none() && !self.constant.is_empty() {
            self.base = Some(sum_constant(&self.constant, terms, x, t));
        }
        if self.partial.is_empty() {
            self.partial = vec![Padded::default(); self.slot_nodes.len()];
        }
        let (parallel, block) = (self.is_parallel(), self.block);
        let Self { chunks, local, slot_nodes, partial, halo, .. } = self;
        let sum = PartialSums { local, slot_nodes, terms, x, t, parallel };
        let sum = |chunks: &[Chunk], partial: &mut [Padded]| match block {
            3 => sum.chunks::<3>(chunks, partial),
            2 => sum.chunks::<2>(chunks, partial),
            _ => sum.chunks::<1>(chunks, partial),
        };
        match halo {
            None => sum(chunks, partial),
            Some(halo) => halo.complete(chunks.len(), partial, |run, partial| sum(&chunks[run], partial)),
        }
    }

    /// Phase 2: writes ∂V/∂x of the nodes from `first` on, as many as fit in `out`.
    pub(crate) fn sum_nodes(&self, first: usize, out: &mut [f64]) {
        match self.block {
            3 => self.sum_nodes_of::<3>(first, out),
            2 => self.sum_nodes_of::<2>(first, out),
            _ => self.sum_nodes_of::<1>(first, out),
        }
    }

    fn sum_nodes_of<const B: usize>(&self, first: usize, out: &mut [f64]) {
        let (out, _) = out.as_chunks_mut::<B>();
        let starts = &self.node_start[first..=first + out.len()];
        let base = self.base.as_deref().map(|base| &base.as_chunks::<B>().0[first..]);
        let is_in_cache = self.partial.len() < IN_CACHE;
        for (k, out) in out.iter_mut().enumerate() {
            let mut total = Padded::default().0;
            if let Some(base) = base {
                total[..B].copy_from_slice(&base[k]);
            }
            let slots = starts[k] as usize..starts[k + 1] as usize;
            if !is_in_cache {
                let later = self.node_slots.iter().skip(slots.start + AHEAD).take(slots.len());
                later.for_each(|&slot| prefetch(&self.partial[slot as usize], 0));
            }
            for &slot in &self.node_slots[slots] {
                let part = &self.partial[slot as usize].0;
                for k in 0..4 {
                    total[k] += part[k];
                }
            }
            out.copy_from_slice(&total[..B]);
        }
    }
}

/// Phase 1: the sums of the chunks.
struct PartialSums<'a> {
    local: &'a [u16],
    slot_nodes: &'a [u32],
    terms: &'a Terms,
    x: &'a [f64],
    t: f64,
    parallel: bool,
}

impl PartialSums<'_> {
    /// Halves the list of chunks, and with it the array of their sums, until one chunk is left.
    fn chunks<const B: usize>(&self, chunks: &[Chunk], partial: &mut [Padded]) {
        match chunks {
            [] => {}
            [chunk] if chunk.patched => self.patch(chunk, partial),
            [chunk] => self.chunk::<B>(chunk, partial),
            _ => {
                let (left, right) = chunks.split_at(chunks.len() / 2);
                let middle = right[0].slots.start - left[0].slots.start;
                let (left_sums, right_sums) = partial.split_at_mut(middle);
                if self.parallel {
                    rayon::join(|| self.chunks::<B>(left, left_sums), || self.chunks::<B>(right, right_sums));
                } else {
                    self.chunks::<B>(left, left_sums);
                    self.chunks::<B>(right, right_sums);
                }
            }
        }
    }

    /// Sums a chunk of a term that sums its stencils itself.
    fn patch(&self, chunk: &Chunk, sums: &mut [Padded]) {
        let potential = &self.terms.fixed()[chunk.span.term];
        let arity = potential.stencils().arity;
        let places = &self.local[chunk.local..chunk.local + chunk.span.stencils.len() * arity];
        let nodes = &self.slot_nodes[chunk.slots.clone()];
        // These include nodes of the next chunk.
        let later = &self.slot_nodes[(chunk.slots.start + AHEAD).min(self.slot_nodes.len())..];
        let (points, _) = self.x.as_chunks::<3>();
        PATCH.with_borrow_mut(|patch| {
            let [x, local] = patch.get_or_insert_with(|| [Patch::zeros(), Patch::zeros()]);
            for (k, (x, &node)) in x.iter_mut().zip(nodes).enumerate() {
                if let Some(&later) = later.get(k) {
                    prefetch(&points[later as usize], 0);
                }
                let [x0, x1, x2] = points[node as usize];
                *x = Padded([x0, x1, x2, 0.0]);
            }
            local[..nodes.len()].fill(Padded::default());
            let run = Patch { places, x, sums: local };
            potential.add_gradients(chunk.span.stencils.clone(), self.t, run);
            sums.copy_from_slice(&local[..nodes.len()]);
        });
    }

    /// Sums a chunk from blocks, a few at a time.
    fn chunk<const B: usize>(&self, chunk: &Chunk, sums: &mut [Padded]) {
        let potential = &self.terms.fixed()[chunk.span.term];
        let stencils = potential.stencils();
        let (size, arity) = (stencils.size(), stencils.size() / B);
        sums.fill(Padded::default());
        let mut local = &self.local[chunk.local..chunk.local + chunk.span.stencils.len() * arity];
        with_scratch(BATCH * size, |scratch| {
            let end = chunk.span.stencils.end;
            for first in chunk.span.stencils.clone().step_by(BATCH) {
                let batch = first..end.min(first + BATCH);
                let blocks = &mut scratch[..batch.len() * size];
                let (here, rest) = local.split_at(batch.len() * arity);
                local = rest;
                potential.gradients(batch, self.x, self.t, blocks);
                for (&place, block) in here.iter().zip(blocks.as_chunks::<B>().0) {
                    let sum = &mut sums[usize::from(place)].0;
                    for k in 0..B {
                        sum[k] += block[k];
                    }
                }
            }
        });
    }
}

/// Returns the sum of the gradients of spans that never change, in order.
fn sum_constant(constant: &[Span], terms: &Terms, x: &[f64], t: f64) -> Vec<f64> {
    let mut base = vec![0.0; x.len()];
    for span in constant {
        let potential = &terms.fixed()[span.term];
        let stencils = potential.stencils();
        let mut blocks = vec![0.0; span.stencils.len() * stencils.size()];
        potential.gradients(span.stencils.clone(), x, t, &mut blocks);
        let mut values = blocks.iter();
        for stencil in span.stencils.clone() {
            for &node in stencils.of(stencil) {
                for k in 0..stencils.block {
                    base[node as usize * stencils.block + k] += values.next().copied().unwrap_or(0.0);
                }
            }
        }
    }
    base
}

/// Sums over the stencils around each node what `evaluate` writes for a batch, 9 numbers per stencil. Spans for
/// which it returns false are left out; returns whether any was included.
pub(crate) fn node_tensors(terms: &Terms, block: usize, x: &[f64], out: &mut [[f64; 9]]) -> bool {
    out.fill([0.0; 9]);
    let mut found = false;
    for (term, potential) in terms.fixed().iter().enumerate() {
        let stencils = potential.stencils();
        for span in spans(term, potential.as_ref()) {
            let batches = span.stencils.clone().step_by(BATCH);
            for batch in batches.map(|first| first..span.stencils.end.min(first + BATCH)) {
                let wrote = with_scratch(9 * batch.len(), |tensors| {
                    let wrote = potential.mean_deformations(batch.clone(), x, tensors);
                    if wrote {
                        for (stencil, tensor) in batch.zip(tensors.as_chunks::<9>().0) {
                            for &node in stencils.of(stencil) {
                                let sum = &mut out[node as usize * stencils.block / block];
                                for k in 0..9 {
                                    sum[k] += tensor[k];
                                }
                            }
                        }
                    }
                    wrote
                });
                found |= wrote;
                if !wrote {
                    break;
                }
            }
        }
    }
    found
}
