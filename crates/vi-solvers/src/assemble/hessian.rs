//! Sums packed Hessian blocks into a sparse matrix, in two phases like `gather`.
//!
//! A chunk of stencils adds its blocks in cache and then writes two lists. Entries that no other chunk touches go
//! directly to their contiguous places in the matrix. The others are partial sums, which phase 2 adds in the order of
//! the chunks. Chunks of constant terms are evaluated once and keep both lists.

mod pattern;

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use vi_core::{HessianKind, System, Terms, packed_len};

use crate::assemble::spans::{Mobility, Span, mobilities, mobility_of, spans};
use crate::assemble::tied::TiedHessian;
use crate::index::{NONE, group_by};
use crate::linear::matrix::{Pattern, SymmetricMatrix};
use crate::scratch::with_scratch;
use pattern::{ChunkPattern, key};

pub(crate) use pattern::rows;

/// Returns whether the tangent of all terms and forces is the same everywhere.
pub(crate) fn is_constant(system: &System) -> bool {
    system.forces().is_empty()
        && system.terms().live().is_empty()
        && system.potentials().iter().all(|term| term.traits().hessian != HessianKind::Varying)
}

/// The Hessian to assemble.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HessianEvaluation {
    /// ∂²V/∂x².
    Exact,
    /// The Hessian with the negative eigenvalues of every stencil set to zero: positive semidefinite.
    Projected,
}

/// Where to evaluate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place<'a> {
    /// Positions of all coordinates, m, and the time, s.
    pub(crate) x: &'a [f64],
    pub(crate) t: f64,
    /// The ends of the step with x in its middle, if terms act by [forces over a step](vi_core::Potential::corrections_over_step).
    pub(crate) ends: Option<[&'a [f64]; 2]>,
}

/// Number of stencils whose packed blocks are evaluated together.
const BATCH: usize = 16;

/// With fewer stencils than this, the calling thread computes the sum alone.
const PARALLEL_STENCILS: usize = 600;

/// Number of shared entries that one task of phase 2 sums.
const ENTRIES_PER_TASK: usize = 512;

struct Chunk {
    span: Span,
    constant: bool,
    /// Pairs a ≠ b of a stencil that are the same node, as (stencil, a, b): both halves belong to the diagonal.
    repeats: Vec<(usize, usize, usize)>,
    /// Index in `HessianSum::codes` of the first entry of its stencils.
    codes: usize,
    /// Places in the matrix of the entries that only this chunk touches.
    owned: Range<usize>,
    /// Range of its partial sums.
    shared: Range<usize>,
}

impl Chunk {
    fn entry_count(&self) -> usize {
        self.owned.len() + self.shared.len()
    }
}

/// The maps from packed blocks to a matrix, and the matrix.
pub(crate) struct HessianSum {
    chunks: Vec<Chunk>,
    /// For each stencil and local pair (a, b ≤ a): 2 · (entry of the chunk), plus 1 if it is transposed. The entry
    /// after the last collects what belongs to prescribed nodes.
    codes: Vec<u32>,
    partial: Vec<f64>,
    /// Shared entry s is summed from `shared_slots[shared_start[s]..shared_start[s + 1]]`.
    shared_start: Vec<u32>,
    shared_slots: Vec<u32>,
    /// Place in the matrix of the first shared entry.
    shared_place: usize,
    /// Blocks with rows or columns of prescribed coordinates: place, row, column.
    masked: Vec<(u32, u32, u32)>,
    stencil_count: usize,
    skipped_stencils: usize,
    /// The kind of Hessian that the constant chunks hold.
    constants: Option<HessianEvaluation>,
    matrix: SymmetricMatrix,
    /// The Hessian on the free coordinates, if nodes are tied or have their own axes; `matrix` then treats these
    /// nodes as free.
    tied: Option<TiedHessian>,
}

impl HessianSum {
    pub(crate) fn new(terms: &Terms, block: usize) -> Self {
        let mobility = mobilities(terms);
        let (row_of, free_of) = rows(terms, block, true);
        let row_count = free_of.len() / block;
        let (included, skipped_stencils) = varying_spans(terms, &mobility);
        let mut patterns: Vec<ChunkPattern> =
            included.par_iter().map(|span| ChunkPattern::new(span, terms, block, &row_of)).collect();

        // Collect all (entry, chunk) pairs in row order; add the diagonal even if no chunk touches it.
        let mut touched: Vec<(u64, u32)> = Vec::new();
        for (chunk, pattern) in patterns.iter().enumerate() {
            touched.extend(pattern.keys.iter().map(|&key| (key, chunk as u32)));
        }
        touched.extend((0..row_count as u32).map(|row| (key(row, row), NONE)));
        touched.par_sort_unstable();

        // Entries of a single chunk are its own, in the order of the chunks; shared entries follow.
        let mut entries: Vec<(u32, u32)> = Vec::new();
        let mut owner: Vec<u32> = Vec::new();
        for group in touched.chunk_by(|a, b| a.0 == b.0) {
            let key = group[0].0;
            entries.push(((key >> 32) as u32, key as u32));
            let chunks = group.iter().filter(|touch| touch.1 != NONE);
            owner.push(if chunks.count() == 1 { group[0].1 } else { NONE });
        }
        let mut owned_count = vec![0_usize; patterns.len()];
        for &chunk in owner.iter().filter(|&&chunk| chunk != NONE) {
            owned_count[chunk as usize] += 1;
        }
        let mut next_owned: Vec<usize> = Vec::with_capacity(patterns.len());
        let mut shared_place = 0;
        for &count in &owned_count {
            next_owned.push(shared_place);
            shared_place += count;
        }
        let owned_start = next_owned.clone();
        let mut next_shared = shared_place;
        let mut places = vec![0_u32; entries.len()];
        for (entry, &chunk) in owner.iter().enumerate() {
            let next = if chunk == NONE { &mut next_shared } else { &mut next_owned[chunk as usize] };
            places[entry] = *next as u32;
            *next += 1;
        }

        // Within a chunk, its own entries come first; both kinds are in row order.
        let mut chunks = Vec::with_capacity(patterns.len());
        let mut codes = Vec::with_capacity(patterns.iter().map(|pattern| pattern.codes.len()).sum());
        let mut slot_keys: Vec<u32> = Vec::new();
        for (k, (span, pattern)) in included.into_iter().zip(&mut patterns).enumerate() {
            let first_slot = slot_keys.len();
            let mut own = 0_u32;
            let mut rank: Vec<u32> = Vec::with_capacity(pattern.keys.len());
            let mut cursor = 0;
            for &key in &pattern.keys {
                let target = ((key >> 32) as u32, key as u32);
                cursor += entries[cursor..].partition_point(|&entry| entry < target);
                if owner[cursor] == k as u32 {
                    rank.push(own);
                    own += 1;
                } else {
                    rank.push(owned_count[k] as u32 + (slot_keys.len() - first_slot) as u32);
                    slot_keys.push(places[cursor] - shared_place as u32);
                }
            }
            let trash = 2 * pattern.keys.len() as u32;
            let start = codes.len();
            codes.extend(
                pattern
                    .codes
                    .iter()
                    .map(|&code| if code == NONE { trash } else { 2 * rank[code as usize / 2] + code % 2 }),
            );
            pattern.codes = Vec::new();
            let constant = terms.fixed()[span.term].traits();
            chunks.push(Chunk {
                constant: constant.hessian == HessianKind::Constant && !constant.time_dependent,
                span,
                repeats: std::mem::take(&mut pattern.repeats),
                codes: start,
                owned: owned_start[k]..owned_start[k] + owned_count[k],
                shared: first_slot..slot_keys.len(),
            });
        }
        let (shared_start, shared_slots) = group_by(&slot_keys, entries.len() - shared_place);
        let partially_free =
            |row: u32| free_of[row as usize * block..(row as usize + 1) * block].contains(&NONE);
        let masked = entries
            .iter()
            .zip(&places)
            .filter(|(entry, _)| partially_free(entry.0) || partially_free(entry.1))
            .map(|(&(row, column), &place)| (place, row, column))
            .collect();
        let matrix = SymmetricMatrix::zeros(Arc::new(Pattern::new(block, &entries, places, free_of)));
        let (untied_row_of, untied_free_of) = rows(terms, block, false);
        Self {
            tied: TiedHessian::new(terms, &matrix, &row_of, &untied_row_of, untied_free_of),
            stencil_count: chunks.iter().map(|chunk| chunk.span.stencils.len()).sum(),
            chunks,
            codes,
            partial: vec![0.0; slot_keys.len() * block * block],
            shared_start,
            shared_slots,
            shared_place,
            masked,
            skipped_stencils,
            constants: None,
            matrix,
        }
    }

    /// Returns the number of stencils without a Hessian: V is affine, or all their coordinates are prescribed.
    pub(crate) fn skipped_stencils(&self) -> usize {
        self.skipped_stencils
    }

    /// Returns the size of maps, partial sums and matrix in bytes.
    pub(crate) fn bytes(&self) -> usize {
        4 * (self.codes.len() + self.shared_start.len() + self.shared_slots.len())
            + 8 * self.partial.len()
            + self.matrix.bytes()
            + self.tied.as_ref().map_or(0, TiedHessian::bytes)
    }

    pub(crate) fn matrix(&self) -> &SymmetricMatrix {
        self.tied.as_ref().map_or(&self.matrix, TiedHessian::matrix)
    }

    /// Evaluates what has changed; returns whether anything had to be evaluated.
    pub(crate) fn evaluate(&mut self, terms: &Terms, at: Place<'_>, kind: HessianEvaluation) -> bool {
        let skip_constants = self.constants == Some(kind);
        if skip_constants && self.chunks.iter().all(|chunk| chunk.constant) {
            return false;
        }
        match self.matrix.pattern.block {
            3 => self.evaluate_blocks::<3>(terms, at, kind, skip_constants),
            2 => self.evaluate_blocks::<2>(terms, at, kind, skip_constants),
            _ => self.evaluate_blocks::<1>(terms, at, kind, skip_constants),
        }
        self.constants = Some(kind);
        if let Some(tied) = &mut self.tied {
            tied.pull_back(&self.matrix);
        }
        true
    }

    fn evaluate_blocks<const B: usize>(
        &mut self,
        terms: &Terms,
        at: Place<'_>,
        kind: HessianEvaluation,
        skip_constants: bool,
    ) {
        let parallel = self.stencil_count >= PARALLEL_STENCILS;
        let (owned, shared) = self.matrix.values.split_at_mut(self.shared_place * B * B);
        let sums = ChunkSums { codes: &self.codes, terms, at, kind, skip_constants };
        sums.chunks::<B>(&self.chunks, owned, &mut self.partial, parallel);

        let (start, slots) = (&self.shared_start, &self.shared_slots);
        let partial = &self.partial;
        let sum = |(task, out): (usize, &mut [f64])| {
            for (entry, out) in (task * ENTRIES_PER_TASK..).zip(out.chunks_exact_mut(B * B)) {
                out.fill(0.0);
                for &slot in &slots[start[entry] as usize..start[entry + 1] as usize] {
                    let part = &partial[slot as usize * B * B..(slot as usize + 1) * B * B];
                    for (out, part) in out.iter_mut().zip(part) {
                        *out += part;
                    }
                }
            }
        };
        if parallel {
            shared.par_chunks_mut(ENTRIES_PER_TASK * B * B).enumerate().for_each(sum);
        } else {
            shared.chunks_mut(ENTRIES_PER_TASK * B * B).enumerate().for_each(sum);
        }
        let free_of = &self.matrix.pattern.free_of;
        for &(place, row, column) in &self.masked {
            let values = &mut self.matrix.values[place as usize * B * B..(place as usize + 1) * B * B];
            for i in 0..B {
                for j in 0..B {
                    let prescribed = |node: u32, k: usize| free_of[node as usize * B + k] == NONE;
                    if prescribed(row, i) || prescribed(column, j) {
                        values[i * B + j] = 0.0;
                    }
                }
            }
        }
    }
}

/// Returns the spans with a Hessian on free coordinates, and the number of stencils without one.
pub(crate) fn varying_spans(terms: &Terms, mobility: &[Mobility]) -> (Vec<Span>, usize) {
    let (mut included, mut skipped) = (Vec::new(), 0);
    for (term, potential) in terms.fixed().iter().enumerate() {
        let zero = potential.traits().hessian == HessianKind::Zero;
        for span in spans(term, potential.as_ref()) {
            if zero || !mobility_of(&span, potential.as_ref(), mobility).0 {
                skipped += span.stencils.len();
            } else {
                included.push(span);
            }
        }
    }
    (included, skipped)
}

/// Phase 1: the sums of the chunks.
struct ChunkSums<'a> {
    codes: &'a [u32],
    terms: &'a Terms,
    at: Place<'a>,
    kind: HessianEvaluation,
    skip_constants: bool,
}

impl ChunkSums<'_> {
    /// Halves the list of chunks, and with it both outputs, until one chunk is left.
    fn chunks<const B: usize>(
        &self,
        chunks: &[Chunk],
        owned: &mut [f64],
        shared: &mut [f64],
        parallel: bool,
    ) {
        match chunks {
            [] => {}
            [chunk] => self.chunk::<B>(chunk, owned, shared),
            _ => {
                let (left, right) = chunks.split_at(chunks.len() / 2);
                let (own_left, own_right) =
                    owned.split_at_mut((right[0].owned.start - left[0].owned.start) * B * B);
                let (shared_left, shared_right) =
                    shared.split_at_mut((right[0].shared.start - left[0].shared.start) * B * B);
                let mut on_left = || self.chunks::<B>(left, own_left, shared_left, parallel);
                let mut on_right = || self.chunks::<B>(right, own_right, shared_right, parallel);
                if parallel {
                    rayon::join(on_left, on_right);
                } else {
                    on_left();
                    on_right();
                }
            }
        }
    }

    fn chunk<const B: usize>(&self, chunk: &Chunk, owned: &mut [f64], shared: &mut [f64]) {
        if chunk.constant && self.skip_constants {
            return;
        }
        let potential = &self.terms.fixed()[chunk.span.term];
        let stencils = potential.stencils();
        let packed = packed_len(stencils.size());
        let arity = stencils.size() / B;
        let pairs = packed_len(arity);
        let sum_length = (chunk.entry_count() + 1) * B * B;
        let mut codes = &self.codes[chunk.codes..chunk.codes + chunk.span.stencils.len() * pairs];
        with_scratch(sum_length + BATCH * packed, |scratch| {
            let (sums, blocks) = scratch.split_at_mut(sum_length);
            sums.fill(0.0);
            let (rows, _) = sums.as_chunks_mut::<B>();
            let end = chunk.span.stencils.end;
            for first in chunk.span.stencils.clone().step_by(BATCH) {
                let batch = first..end.min(first + BATCH);
                let (here, rest) = codes.split_at(batch.len() * pairs);
                codes = rest;
                let blocks = &mut blocks[..batch.len() * packed];
                let Place { x, t, ends } = self.at;
                let is_projected = self.kind == HessianEvaluation::Projected;
                let is_of_step = ends.is_some_and(|ends| {
                    potential.hessians_over_step(batch.clone(), ends, is_projected, blocks)
                });
                match self.kind {
                    _ if is_of_step => {}
                    HessianEvaluation::Exact => potential.hessians(batch, x, t, blocks),
                    HessianEvaluation::Projected => potential.projected_hessians(batch, x, t, blocks),
                }
                for (codes, block) in here.chunks_exact(pairs).zip(blocks.chunks_exact(packed)) {
                    add_stencil::<B>(rows, arity, codes, block);
                }
                for &(stencil, a, b) in &chunk.repeats {
                    if (first..end.min(first + BATCH)).contains(&stencil) {
                        let code = here[(stencil - first) * pairs + packed_len(a) + b];
                        let packed = &blocks[(stencil - first) * packed..];
                        add_block(rows, code ^ 1, &packed_block::<B>(packed, a, b));
                    }
                }
            }
            let (own, rest) = sums.split_at(owned.len());
            owned.copy_from_slice(own);
            shared.copy_from_slice(&rest[..shared.len()]);
        });
    }
}

/// Returns the B × B block (a, b), b < a, of a packed lower triangle.
#[inline]
fn packed_block<const B: usize>(packed: &[f64], a: usize, b: usize) -> [[f64; B]; B] {
    std::array::from_fn(|i| {
        let start = packed_len(a * B + i) + b * B;
        std::array::from_fn(|j| packed[start + j])
    })
}

/// Adds the packed block of one stencil to the sums of its chunk; each entry has B rows of B numbers.
#[inline]
fn add_stencil<const B: usize>(sums: &mut [[f64; B]], arity: usize, codes: &[u32], packed: &[f64]) {
    let mut codes = codes.iter();
    for a in 0..arity {
        for b in 0..a {
            let Some(&code) = codes.next() else { return };
            let value = packed_block::<B>(packed, a, b);
            add_block(sums, code, &value);
        }
        let Some(&code) = codes.next() else { return };
        let entry = (code / 2) as usize * B;
        let target = &mut sums[entry..entry + B];
        for i in 0..B {
            for j in 0..B {
                target[i][j] += packed[packed_len(a * B + i.max(j)) + a * B + i.min(j)];
            }
        }
    }
}

/// Adds a block to the entry of the code, transposed if the code says so.
#[inline]
fn add_block<const B: usize>(sums: &mut [[f64; B]], code: u32, value: &[[f64; B]; B]) {
    let entry = (code / 2) as usize * B;
    let target = &mut sums[entry..entry + B];
    let transposed = code % 2 == 1;
    for i in 0..B {
        for j in 0..B {
            target[i][j] += if transposed { value[j][i] } else { value[i][j] };
        }
    }
}
