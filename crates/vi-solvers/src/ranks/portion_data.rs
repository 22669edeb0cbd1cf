//! Takes from a system the data of the portion of one rank. Afterwards the system is not needed: if it is a part that
//! was made for this purpose alone, the rank can free its memory before it makes the vectors of the portion.

use std::sync::Arc;

use vi_core::{Coordinates, Exchange, Portion, Potential, State, System, coordinates_of_nodes};

use crate::assemble::evaluator::TimeDependence;
use crate::assemble::gather::Gather;
use crate::assemble::gather::division::{Division, Share, TermPortion};
use crate::assemble::spans::{Span, common_block};
use crate::error::SolverError;
use crate::index::NONE;
use crate::options::SolverOptions;
use crate::schemes::kick_drift::splitting::Splitting;
use crate::schemes::method::Method;

/// The portion of a system for one rank, with the data to sum its terms or to make steps.
pub(crate) struct PortionData {
    /// The portion as a system.
    pub(crate) system: System,
    /// The sum of its terms.
    pub(crate) gather: Gather,
    /// The coefficients of its steps, if it makes steps itself.
    pub(crate) splitting: Option<Splitting>,
    /// How the whole system depends on the time.
    pub(crate) depends: TimeDependence,
    /// The runs of stencils whose energies it sums, in the order of the whole system.
    pub(crate) spans: Vec<Span>,
    /// The term and the first stencil of each of them in the whole system.
    pub(crate) places: Vec<(usize, usize)>,
    /// Whether there are runs that it should sum, and all of them have a free coordinate.
    pub(crate) is_complete: bool,
    /// Coordinates per node.
    pub(crate) block: usize,
    /// The time of the state that was given, s.
    pub(crate) t: f64,
    /// The portions of all ranks, unless the system is a part.
    pub(crate) of_all: Places,
}

/// The places of the portions of all ranks in the whole system.
pub(crate) struct Places {
    /// The nodes of each rank.
    pub(crate) nodes: Vec<Vec<u32>>,
    /// Places in `nodes` of those whose gradient each rank reports.
    pub(crate) reported: Vec<Vec<u32>>,
    /// The runs of stencils of each rank: index of the term and first stencil.
    pub(crate) runs: Vec<Vec<(usize, usize)>>,
}

/// Returns whether ranks can step their portions of a system themselves: q and p of a node must follow from the terms at
/// the node alone.
fn steps_apart(system: &System, method: &Method, keeps_ledger: bool) -> bool {
    method.splitting().is_some()
        && !keeps_ledger
        && system.terms().live().is_empty()
        && system.forces().is_empty()
        && system.constraints().is_empty()
        && system.coordinates().is_plain()
}

impl PortionData {
    /// Takes the portion of the rank of `exchange` from a system, with `start`, any state inside the domain of its terms. If it is a part,
    /// `part_runs` are the numbers of the runs of every term in the whole system, and their ranks.
    ///
    /// # Errors
    /// Returns [`SolverError::Ranks`] if several ranks cannot share the system.
    pub(crate) fn new(
        whole: &System,
        start: &State,
        (method, options): (&Method, &SolverOptions),
        exchange: &Arc<dyn Exchange>,
        part_runs: Option<&[Vec<(u32, u32)>]>,
    ) -> Result<Self, SolverError> {
        let refused = |reason: String| SolverError::Ranks { reason };
        let (terms, mass) = (whole.terms(), whole.mass());
        let block = common_block(terms);
        if let Some(term) = terms.fixed().iter().find(|term| term.stencils().block != block) {
            return Err(refused(format!(
                "{}: terms with {} coordinates per node do not run on several ranks: use one rank",
                term.name(),
                term.stencils().block
            )));
        }
        let gather = Gather::new(terms, block);
        let division = match part_runs {
            Some(part_runs) => Division::of_part(&gather, terms, part_runs, exchange.size()),
            None => Division::new(&gather, exchange.size()),
        };
        let Share { gather: own, terms: portions, spans } = {
            let base = gather.base(terms, &whole.positions(start), start.t);
            division.portion(&gather, base.as_deref(), Arc::clone(exchange))
        };
        let runs = division.runs(&gather);
        drop(gather);
        let rank = exchange.rank();
        let mut places = runs[rank].clone();
        let mut is_complete = true;
        if let Some(part_runs) = part_runs {
            let own = part_runs.iter().flatten().filter(|(_, of)| *of as usize == rank);
            is_complete = !places.is_empty() && own.count() == places.len();
            for (term, first) in &mut places {
                let length = terms.fixed()[*term].run_length();
                *first = part_runs[*term][*first / length].0 as usize * length;
            }
        }
        let nodes = &division.nodes[rank];
        let portion = |TermPortion { term, stencils }: TermPortion| {
            let number = |node: u32| nodes.binary_search(&node).map_or(NONE, |own| own as u32);
            let portion = Portion::new(Arc::clone(&terms.fixed()[term]), stencils, mass.len(), number);
            Box::new(portion.detached()) as Box<dyn Potential>
        };
        let portions: Vec<_> = portions.into_iter().map(portion).collect();
        let splitting = method.splitting().filter(|_| steps_apart(whole, method, options.ledger));
        let own_mass = nodes.iter().flat_map(|&node| &mass[block * node as usize..][..block]).copied();
        // Sums need no masses and know no supports.
        let (own_mass, coordinates) = match splitting {
            Some(_) => (own_mass.collect(), coordinates_of_nodes(terms.shared_coordinates(), nodes, block)),
            None => (vec![1.0; block * nodes.len()], Coordinates::new(block * nodes.len(), Vec::new())),
        };
        let system = coordinates
            .and_then(|coordinates| System::new(own_mass, portions, coordinates))
            .map_err(|error| refused(error.to_string()))?;
        let Division { nodes, reported, .. } = division;
        let of_all = Places { nodes, reported, runs };
        let (depends, t) = (TimeDependence::of(whole), start.t);
        Ok(Self { system, gather: own, splitting, depends, spans, places, is_complete, block, t, of_all })
    }
}
