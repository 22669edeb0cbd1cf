//! How a system is divided among ranks, as the first rank sees it.

use vi_core::{HessianKind, System};

use crate::assemble::spans::{common_block, mobilities, mobility_of, spans};
use crate::index::{NONE, free_of};
use crate::ranks::rows::RowsLayout;

/// The coordinates of the portion of one rank, as numbers of the whole system.
pub(crate) struct Held {
    /// Its free coordinates, if it makes steps.
    pub(crate) free: Vec<u32>,
    /// Its nodes.
    nodes: Vec<u32>,
    /// Places in `nodes` of those whose gradient it reports.
    reported: Vec<u32>,
    /// Coordinates per node.
    block: usize,
}

impl Held {
    /// Returns all its coordinates.
    pub(crate) fn dofs(&self) -> impl Iterator<Item = usize> {
        let block = self.block;
        self.nodes.iter().flat_map(move |&node| block * node as usize..block * (node as usize + 1))
    }

    /// Returns the coordinates whose gradient it reports.
    pub(crate) fn reported_dofs(&self) -> impl Iterator<Item = usize> {
        let Self { nodes, reported, block, .. } = self;
        let node = |&place: &u32| nodes[place as usize] as usize;
        reported.iter().map(node).flat_map(move |node| block * node..block * (node + 1))
    }

    /// Returns the number of these coordinates.
    pub(crate) fn reported_count(&self) -> usize {
        self.block * self.reported.len()
    }
}

/// How a system is divided among ranks.
pub(crate) struct Layout {
    /// The coordinates of each rank.
    pub(crate) held: Vec<Held>,
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
        let free_of = free_of(system.coordinates());
        let held = nodes.into_iter().zip(reported).map(|(nodes, reported)| {
            let held = Held { free: Vec::new(), nodes, reported, block };
            let free = held.dofs().map(|dof| free_of[dof]).filter(|&free| steps && free != NONE).collect();
            Held { free, ..held }
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
            for (k, span) in of_term.iter().enumerate() {
                if !mobility_of(span, potential, &mobility).0 {
                    return None;
                }
                let rank = k * size / of_term.len();
                runs[rank].push((term, span.stencils.start));
                let range = span.stencils.start * stencils.arity..span.stencils.end * stencils.arity;
                stencils.nodes[range].iter().for_each(|&node| is_held[rank][node as usize] = true);
            }
        }
        if runs.iter().any(Vec::is_empty) {
            return None;
        }
        let (mut nodes, mut reported) = (vec![Vec::new(); size], vec![Vec::new(); size]);
        for node in 0..node_count {
            let first = (0..size).find(|&rank| is_held[rank][node])?;
            reported[first].push(nodes[first].len() as u32);
            (first..size).filter(|&rank| is_held[rank][node]).for_each(|rank| nodes[rank].push(node as u32));
        }
        Some(Self::new(system, (nodes, reported), runs, Vec::new(), steps))
    }
}
