//! The links of a mass filter: one weight per pair of nodes, a third of the trace of its block of the Hessian of all
//! strain energies.
//!
//! With −1/3 tr ∂²V/∂x_a∂x_b as weights, L is as stiff as the body, where it is stiff: linear elements of an
//! isotropic solid give (λ + 4μ)/3 times the finite element Laplacian. Strain energies do not change in translations, so
//! the rows of their Hessians sum to zero, as those of L do.

use std::ops::Range;

use rayon::prelude::*;
use vi_core::{Account, HessianKind, Link, Potential, Terms, packed_len};

use crate::assemble::spans::spans;

/// Number of stencils whose Hessians are evaluated together.
const BATCH: usize = 16;
/// Weights below this part of the largest ones at both nodes are round-off.
const ROUND_OFF: f64 = 1e-12;

/// Returns the links of the strain energies among `terms` at positions `x` (m, all coordinates), sorted by nodes.
pub(crate) fn links(terms: &Terms, x: &[f64]) -> Vec<Link> {
    let mut pairs: Vec<(u64, f64)> = Vec::new();
    for (index, term) in terms.fixed().iter().enumerate() {
        let is_elastic = term.account() == Account::Elastic && term.traits().hessian != HessianKind::Zero;
        if is_elastic && term.stencils().block == 3 && term.stencils().arity > 1 {
            let all: Vec<_> = spans(index, term.as_ref()).collect();
            let parts = all.par_iter().map(|span| pairs_of(term.as_ref(), span.stencils.clone(), x));
            parts.collect::<Vec<_>>().into_iter().for_each(|part| pairs.extend(part));
        }
    }
    // The sort is stable, so weights of a pair are summed in the order of the stencils.
    pairs.par_sort_by_key(|pair| pair.0);
    let sums = pairs.chunk_by(|a, b| a.0 == b.0).map(|run| Link {
        nodes: [(run[0].0 >> 32) as u32, run[0].0 as u32],
        weight: run.iter().map(|pair| pair.1).sum(),
    });
    let links: Vec<Link> = sums.collect();
    let mut largest = vec![0.0_f64; x.len() / 3];
    for Link { nodes, weight } in &links {
        for &node in nodes {
            largest[node as usize] = largest[node as usize].max(weight.abs());
        }
    }
    // A weight that is not finite is kept for the caller to refuse.
    let is_round_off =
        |link: &Link| link.nodes.iter().all(|&node| link.weight.abs() <= ROUND_OFF * largest[node as usize]);
    links.into_iter().filter(|link| !is_round_off(link)).collect()
}

/// Returns the pairs of nodes of some stencils, the smaller number in the upper half of the key, with their weights.
fn pairs_of(term: &dyn Potential, range: Range<usize>, x: &[f64]) -> Vec<(u64, f64)> {
    let stencils = term.stencils();
    let length = packed_len(stencils.size());
    let (mut blocks, mut pairs) = (vec![0.0; BATCH * length], Vec::new());
    for first in range.clone().step_by(BATCH) {
        let batch = first..range.end.min(first + BATCH);
        let blocks = &mut blocks[..batch.len() * length];
        term.hessians(batch.clone(), x, 0.0, blocks);
        for (stencil, block) in batch.zip(blocks.chunks_exact(length)) {
            let nodes = stencils.of(stencil);
            for b in 1..nodes.len() {
                for a in (0..b).filter(|&a| nodes[a] != nodes[b]) {
                    let entry = |k: usize| block[packed_len(3 * b + k) + 3 * a + k];
                    let weight = -(entry(0) + entry(1) + entry(2)) / 3.0;
                    let (low, high) = (nodes[a].min(nodes[b]), nodes[a].max(nodes[b]));
                    pairs.push((u64::from(low) << 32 | u64::from(high), weight));
                }
            }
        }
    }
    pairs
}
