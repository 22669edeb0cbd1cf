//! How a system is divided among ranks, as the first rank sees it.

use std::sync::Arc;

use vi_core::{Coordinates, HessianKind, System, runs_of_ranks};

use crate::assemble::spans::{common_block, mobilities, mobility_of, spans};
use crate::ranks::rows::RowsLayout;

/// The coordinates of the portion of one rank, as numbers of the whole system.
///
/// Free coordinates are counted when they are needed: lists of them would take three times the memory of the nodes.
pub(crate) struct RankCoordinates {
    /// Nodes of the rank, ascending.
    nodes: Vec<u32>,
    /// Places in `nodes` of those whose gradient the rank reports, ascending.
    reported: Vec<u32>,
    /// The coordinates of the whole system that are not free, ascending; `None` if the rank makes no steps.
    held_fast: Option<Arc<[u32]>>,
    /// Coordinates per node.
    block: usize,
}

impl RankCoordinates {
    /// Returns all coordinates of the rank.
    pub(crate) fn dofs(&self) -> impl Iterator<Item = usize> {
        let block = self.block;
        self.nodes.iter().flat_map(move |&node| block * node as usize..block * (node as usize + 1))
    }

    /// Returns the coordinates whose gradient the rank reports.
    pub(crate) fn reported_dofs(&self) -> impl Iterator<Item = usize> {
        let Self { nodes, reported, block, .. } = self;
        let node = |&place: &u32| nodes[place as usize] as usize;
        reported.iter().map(node).flat_map(move |node| block * node..block * (node + 1))
    }

    /// Returns the number of coordinates whose gradient the rank reports.
    pub(crate) fn reported_count(&self) -> usize {
        self.block * self.reported.len()
    }

    /// Returns the free coordinates of the rank; none if it makes no steps.
    pub(crate) fn free(&self) -> impl Iterator<Item = usize> {
        self.free_of(self.dofs())
    }

    /// Returns the free coordinates whose gradient the rank reports; none if it makes no steps.
    pub(crate) fn reported_free(&self) -> impl Iterator<Item = usize> {
        self.free_of(self.reported_dofs())
    }

    /// Returns the free coordinates of ascending coordinates.
    fn free_of(&self, dofs: impl Iterator<Item = usize>) -> impl Iterator<Item = usize> {
        let (held_fast, mut before) = (self.held_fast.as_deref(), 0);
        dofs.filter_map(move |dof| {
            let held_fast = held_fast?;
            before += held_fast[before..].iter().take_while(|&&other| (other as usize) < dof).count();
            (held_fast.get(before).is_none_or(|&other| other as usize != dof)).then(|| dof - before)
        })
    }
}

/// The division of a system among ranks.
pub(crate) struct Layout {
    /// The coordinates of each rank.
    pub(crate) held: Vec<RankCoordinates>,
    /// The runs of stencils that each rank sums: index of the term and first stencil.
    pub(crate) runs: Vec<Vec<(usize, usize)>>,
    /// The rows of each rank; empty if the first rank solves linear systems alone.
    pub(crate) rows: Vec<RowsLayout>,
    /// Whether the ranks make steps themselves.
    pub(crate) steps: bool,
}

impl Layout {
    /// Returns the layout of ranks that hold these nodes and report the gradient at these places of them.
    pub(crate) fn new(
        system: &System,
        (nodes, reported): (Vec<Vec<u32>>, Vec<Vec<u32>>),
        runs: Vec<Vec<(usize, usize)>>,
        rows: Vec<RowsLayout>,
        steps: bool,
    ) -> Self {
        let block = common_block(system.terms());
        let held_fast = steps.then(|| held_fast(system.coordinates()));
        let held = nodes.into_iter().zip(reported).map(|(mut nodes, mut reported)| {
            // The run keeps them.
            nodes.shrink_to_fit();
            reported.shrink_to_fit();
            RankCoordinates { nodes, reported, held_fast: held_fast.clone(), block }
        });
        Self { held: held.collect(), runs, rows, steps }
    }

    /// Returns the layout of a system whose ranks make their portions from parts
    /// ([`Member::of_part`](crate::Member::of_part)), without building its sum; `None` if a run has no free coordinate, or a
    /// rank no run.
    pub(crate) fn of_parts(system: &System, size: usize, steps: bool) -> Option<Self> {
        let terms = system.terms();
        let mobility = mobilities(terms);
        let mut runs = vec![Vec::new(); size];
        let node_count = terms.coordinates().dof_count() / common_block(terms);
        let mut is_held = vec![vec![false; node_count]; size];
        let varying = |term: &usize| terms.fixed()[*term].traits().hessian != HessianKind::Zero;
        for term in (0..terms.fixed().len()).filter(varying) {
            let potential = terms.fixed()[term].as_ref();
            let of_term: Vec<_> = spans(term, potential).collect();
            let stencils = potential.stencils();
            let of_ranks = runs_of_ranks(of_term.len(), size).into_iter().enumerate();
            for (rank, k) in of_ranks.flat_map(|(rank, runs)| runs.map(move |k| (rank, k))) {
                let span = &of_term[k];
                if !mobility_of(span, potential, &mobility).0 {
                    return None;
                }
                runs[rank].push((term, span.stencils.start));
                let range = span.stencils.start * stencils.arity..span.stencils.end * stencils.arity;
                stencils.nodes[range].iter().for_each(|&node| is_held[rank][node as usize] = true);
            }
        }
        if runs.iter().any(Vec::is_empty) {
            return None;
        }
        let of_rank = |held: &Vec<bool>| (0..node_count as u32).filter(|&node| held[node as usize]).collect();
        let nodes: Vec<Vec<u32>> = is_held.iter().map(of_rank).collect();
        let reported = reported(&nodes, node_count)?;
        Some(Self::new(system, (nodes, reported), runs, Vec::new(), steps))
    }

    /// Returns the layout of a system in which other processes hold one term
    /// ([`Potential::elsewhere`](vi_core::Potential::elsewhere)) and all other terms are affine. `nodes` holds the
    /// nodes of the runs of each rank, ascending.
    pub(crate) fn of_far_parts(system: &System, nodes: Vec<Vec<u32>>, steps: bool) -> Option<Self> {
        let (terms, size) = (system.terms(), nodes.len());
        let mut runs = vec![Vec::new(); size];
        let far = terms
            .fixed()
            .iter()
            .enumerate()
            .filter_map(|(term, potential)| Some((term, potential.elsewhere()?)));
        for (term, elsewhere) in far {
            let of_ranks = runs_of_ranks(elsewhere.count.div_ceil(elsewhere.run_length), size);
            for (of_rank, own) in runs.iter_mut().zip(of_ranks) {
                of_rank.extend(own.map(|run| (term, run * elsewhere.run_length)));
            }
        }
        let reported = reported(&nodes, terms.coordinates().dof_count() / common_block(terms))?;
        Some(Self::new(system, (nodes, reported), runs, Vec::new(), steps))
    }
}

/// Returns the coordinates that are not free, ascending.
fn held_fast(coordinates: &Coordinates) -> Arc<[u32]> {
    let mut free = coordinates.free().iter().peekable();
    (0..coordinates.dof_count() as u32).filter(|dof| free.next_if_eq(&dof).is_none()).collect()
}

/// Returns the places of the nodes that each rank reports: of the ranks that hold a node, the first reports it. Returns `None` if
/// a node is held by no rank.
fn reported(nodes: &[Vec<u32>], node_count: usize) -> Option<Vec<Vec<u32>>> {
    let mut is_reported = vec![false; node_count];
    let mut reported = vec![Vec::new(); nodes.len()];
    for (nodes, reported) in nodes.iter().zip(&mut reported) {
        for (place, &node) in (0..).zip(nodes) {
            if !std::mem::replace(&mut is_reported[node as usize], true) {
                reported.push(place);
            }
        }
    }
    is_reported.iter().all(|&is| is).then_some(reported)
}
