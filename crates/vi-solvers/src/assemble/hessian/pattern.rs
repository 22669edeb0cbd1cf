//! The entries of a matrix that the Hessians of stencils touch: the row of each node, and the entries of one chunk.

use vi_core::Terms;

use crate::assemble::spans::{Span, parts};
use crate::index::NONE;

/// Returns the row of each node, and the free index of each coordinate of each row. If `with_tied`, treats tied nodes
/// and all coordinates of nodes with their own axes as free.
pub(crate) fn rows(terms: &Terms, block: usize, with_tied: bool) -> (Vec<u32>, Vec<u32>) {
    let coordinates = terms.coordinates();
    let count = coordinates.dof_count();
    let mut free_index = vec![NONE; count];
    for (k, &dof) in coordinates.free().iter().enumerate() {
        free_index[dof as usize] = k as u32;
    }
    if with_tied {
        let mut next = coordinates.free_count() as u32;
        for (node, _) in coordinates.combinations() {
            for index in &mut free_index[3 * node as usize..][..3] {
                *index = next;
                next += 1;
            }
        }
        for own in coordinates.node_axes() {
            let of_node = &mut free_index[3 * own.node as usize..][..3];
            if of_node.iter().any(|&index| index != NONE) {
                for index in of_node.iter_mut().filter(|index| **index == NONE) {
                    *index = next;
                    next += 1;
                }
            }
        }
    }
    let (mut row_of, mut free_of) = (vec![NONE; count / block], Vec::new());
    for (node, free) in free_index.chunks_exact(block).enumerate() {
        if free.iter().any(|&k| k != NONE) {
            row_of[node] = (free_of.len() / block) as u32;
            free_of.extend_from_slice(free);
        }
    }
    (row_of, free_of)
}

pub(super) const fn key(row: u32, column: u32) -> u64 {
    (row as u64) << 32 | column as u64
}

/// The entries of a chunk (sorted keys), and the code of each local pair with the entry's rank.
pub(super) struct ChunkPattern {
    pub(super) keys: Vec<u64>,
    pub(super) codes: Vec<u32>,
    pub(super) repeats: Vec<(usize, usize, usize)>,
}

impl ChunkPattern {
    pub(super) fn new(span: &Span, terms: &Terms, block: usize, row_of: &[u32]) -> Self {
        let stencils = terms.fixed()[span.term].stencils();
        let split = stencils.block / block;
        let mut touched: Vec<(u64, u32, bool)> = Vec::new();
        let mut local = Vec::new();
        let mut pair = 0_u32;
        let mut repeats = Vec::new();
        for stencil in span.stencils.clone() {
            local.clear();
            local.extend(stencils.of(stencil).iter().flat_map(|&node| parts(node, split)));
            for a in 0..local.len() {
                for b in 0..=a {
                    let (row, column) = (row_of[local[a] as usize], row_of[local[b] as usize]);
                    if row != NONE && column != NONE {
                        if a != b && row == column {
                            repeats.push((stencil, a, b));
                        }
                        touched.push((key(row.max(column), row.min(column)), pair, row < column));
                    }
                    pair += 1;
                }
            }
        }
        touched.sort_unstable();
        let mut codes = vec![NONE; pair as usize];
        let mut keys: Vec<u64> = Vec::new();
        for (key, pair, transposed) in touched {
            if keys.last() != Some(&key) {
                keys.push(key);
            }
            codes[pair as usize] = 2 * (keys.len() as u32 - 1) + u32::from(transposed);
        }
        Self { keys, codes, repeats }
    }
}
