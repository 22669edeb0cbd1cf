//! The rows of A = aM + cK that one of several ranks assembles and solves.
//!
//! A rank has whole domains of rows (`linear/pcg/share.rs`). It evaluates all chunks of stencils at the nodes of its rows, also
//! those at which others evaluate them too, so that no sums of Hessians have to be exchanged. The solver is our own conjugate
//! gradients, or one from outside (`outside.rs`), for which conjugate gradients stand in where it fails.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Exchange, Portion, Potential, SharedSolve, SolverFacts, System, coordinates_of_nodes};

use crate::assemble::hessian::{HessianEvaluation, HessianSum, Place, rows, varying_spans};
use crate::assemble::spans::{common_block, mobilities};
use crate::error::SolverError;
use crate::index::NONE;
use crate::linear::pcg::block::Preconditioner;
use crate::linear::pcg::share::{Share, rows_of_ranks};
use crate::linear::pcg::{Pcg, PcgReport};
use crate::options::{LinearSolver, SolverOptions};
use crate::ranks::outside::Outside;

/// The rows of a rank, with the portion of the system that has entries in them.
pub(crate) struct Rows {
    system: System,
    /// The number among all rows of each row of this rank, and of each row of other ranks that it knows.
    numbers: Vec<u32>,
    /// The place of the node of each of these rows among the nodes of the portion.
    places: Vec<u32>,
    row_count: usize,
    /// The number among all free coordinates of each free coordinate that it knows.
    free: Vec<u32>,
    /// The range of these that belongs to the rows of this rank.
    own: Range<usize>,
    block: usize,
    exchange: Arc<dyn Exchange>,
    solver: Option<Box<Solver>>,
    /// A solver from outside, if one was requested.
    outside: Option<Outside>,
}

struct Solver {
    hessian: HessianSum,
    pcg: Pcg,
    solution: Vec<f64>,
}

/// The rows of one rank, as the first rank sees them.
pub(crate) struct RowsLayout {
    /// Nodes whose positions the rank needs, including those of rows of other ranks.
    nodes: Vec<u32>,
    /// Free coordinates of the rank's own rows.
    pub(crate) free: Range<usize>,
    /// Coordinates per node.
    block: usize,
}

impl RowsLayout {
    /// Returns all coordinates whose positions the rank needs.
    pub(crate) fn dofs(&self) -> impl Iterator<Item = usize> {
        let block = self.block;
        self.nodes.iter().flat_map(move |&node| block * node as usize..block * (node as usize + 1))
    }
}

/// Returns what prevents ranks from solving the linear systems of a scheme together; `None` if nothing does.
fn obstacle(system: &System) -> Option<&'static str> {
    let obstacles = [
        (!system.terms().live().is_empty(), "contact"),
        (!system.forces().is_empty(), "wind or damping"),
        (!system.constraints().is_empty(), "rigid bodies or joints"),
        (system.kinetic().is_some(), "consistent mass"),
        (system.filter().is_some(), "filtered mass"),
        (!system.coordinates().is_plain(), "ties, or supports along other axes than those of space"),
    ];
    obstacles.into_iter().find(|(is_there, _)| *is_there).map(|(_, name)| name)
}

impl Rows {
    /// Returns the rows of this rank, and those of all ranks; `None` if the first rank solves alone.
    pub(crate) fn new(
        whole: &System,
        options: &SolverOptions,
        exchange: &Arc<dyn Exchange>,
    ) -> Result<Option<(Self, Vec<RowsLayout>)>, SolverError> {
        let outside = match (options.linear, obstacle(whole)) {
            (LinearSolver::Pcg, None) => None,
            (LinearSolver::Petsc, None) => {
                Some(Outside::new(exchange.linear_solver().ok_or_else(SolverError::no_petsc)?))
            }
            (LinearSolver::Petsc, Some(what)) => {
                return Err(SolverError::Petsc { reason: format!("does not run with {what}") });
            }
            _ => return Ok(None),
        };
        let (terms, mass) = (whole.terms(), whole.mass());
        let (block, size) = (common_block(terms), exchange.size());
        let (row_of, free_of) = rows(terms, block, false);
        let row_count = free_of.len() / block;
        let owned = rows_of_ranks(row_count, size);
        let owner = |row: u32| owned.partition_point(|rows| rows.end <= row as usize);

        // The spans of each rank, and the nodes that these and its rows have.
        let mut spans = vec![Vec::new(); size];
        let mut nodes: Vec<Vec<u32>> = vec![Vec::new(); size];
        for (node, &row) in (0_u32..).zip(&row_of).filter(|(_, row)| **row != NONE) {
            nodes[owner(row)].push(node);
        }
        for span in varying_spans(terms, &mobilities(terms)).0 {
            let stencils = terms.fixed()[span.term].stencils();
            let of_span =
                &stencils.nodes[span.stencils.start * stencils.arity..span.stencils.end * stencils.arity];
            let rows = of_span.iter().map(|&node| row_of[node as usize]).filter(|&row| row != NONE);
            let mut ranks: Vec<usize> = rows.map(owner).collect();
            ranks.sort_unstable();
            ranks.dedup();
            for rank in ranks {
                nodes[rank].extend_from_slice(of_span);
                spans[rank].push(span.clone());
            }
        }
        for nodes in &mut nodes {
            nodes.sort_unstable();
            nodes.dedup();
        }

        let rank = exchange.rank();
        let own_nodes = &nodes[rank];
        let mut runs: Vec<(usize, Range<usize>)> = Vec::new();
        for span in &spans[rank] {
            match runs.last_mut() {
                Some((term, run)) if *term == span.term && run.end == span.stencils.start => {
                    run.end = span.stencils.end;
                }
                _ => runs.push((span.term, span.stencils.clone())),
            }
        }
        let number = |node: u32| own_nodes.binary_search(&node).map_or(NONE, |own| own as u32);
        let portion = |(term, run): (usize, Range<usize>)| {
            let portion = Portion::new(Arc::clone(&terms.fixed()[term]), run, mass.len(), number);
            Box::new(portion.detached()) as Box<dyn Potential>
        };
        let portions = runs.into_iter().map(portion).collect();
        let own_mass = own_nodes.iter().flat_map(|&node| &mass[block * node as usize..][..block]).copied();
        let system = coordinates_of_nodes(terms.shared_coordinates(), own_nodes, block)
            .and_then(|coordinates| System::new(own_mass.collect(), portions, coordinates))
            .map_err(|error| SolverError::Ranks { reason: error.to_string() })?;
        let of_nodes = (0..).zip(own_nodes.iter().map(|&node| row_of[node as usize]));
        let (places, numbers): (Vec<u32>, Vec<u32>) = of_nodes.filter(|(_, row)| *row != NONE).unzip();
        let free_in = |rows: &Range<usize>| {
            let before = |row: usize| free_of[..row * block].iter().filter(|&&free| free != NONE).count();
            before(rows.start)..before(rows.end)
        };
        let of_rows = numbers.iter().flat_map(|&row| &free_of[row as usize * block..][..block]);
        let free: Vec<u32> = of_rows.copied().filter(|&free| free != NONE).collect();
        let all = free_in(&owned[rank]);
        let place = |free_coordinate: usize| free.partition_point(|&free| (free as usize) < free_coordinate);
        let own = place(all.start)..place(all.end);
        let layout = nodes.iter().cloned().zip(&owned);
        let layout = layout.map(|(nodes, rows)| RowsLayout { nodes, free: free_in(rows), block }).collect();
        let exchange = Arc::clone(exchange);
        Ok(Some((
            Self { system, numbers, places, row_count, free, own, block, exchange, solver: None, outside },
            layout,
        )))
    }

    /// Returns the number of coordinates whose positions it needs, and that of its own free ones.
    pub(crate) fn counts(&self) -> (usize, usize) {
        (self.system.coordinates().dof_count(), self.own.len())
    }

    /// Assembles A = aM + cK with the factors [a, c] at positions `x` of its coordinates and prepares the solver, together with the other ranks.
    /// Returns its costs, and a free coordinate of the whole system at which A is not positive definite, if there is one.
    pub(crate) fn prepare(
        &mut self,
        x: &[f64],
        t: f64,
        [a, c]: [f64; 2],
        is_projected: bool,
    ) -> (SolverFacts, Option<usize>) {
        let terms = self.system.terms();
        let kind = if is_projected { HessianEvaluation::Projected } else { HessianEvaluation::Exact };
        let mut positions = vec![0.0; self.system.coordinates().free_count()];
        self.system.coordinates().coordinates_of(x, &mut positions);
        let solver = match &mut self.solver {
            Some(solver) => {
                solver.hessian.evaluate(terms, Place { x, t, ends: None }, kind);
                solver
            }
            unmade => {
                let mut hessian = HessianSum::new(terms, self.block);
                hessian.evaluate(terms, Place { x, t, ends: None }, kind);
                let pattern = &hessian.matrix().pattern;
                let (exchange, free) = (Arc::clone(&self.exchange), self.free.clone());
                let share = Share::new(pattern, exchange, &self.numbers, self.row_count, free);
                let pcg = Pcg::shared(hessian.matrix(), Preconditioner::BlockIncompleteCholesky, share);
                let solution = vec![0.0; self.free.len()];
                unmade.insert(Box::new(Solver { hessian, pcg, solution }))
            }
        };
        let mass = self.system.free_mass();
        let scaled: Vec<f64> =
            if a == 0.0 || a == 1.0 { Vec::new() } else { mass.iter().map(|m| a * m).collect() };
        // An empty mass means zero.
        let mass = if a == 1.0 { mass } else { &scaled };
        let made = solver.pcg.prepare(mass, c, solver.hessian.matrix(), &positions);
        let mut facts = solver.pcg.facts();
        if let Some(outside) = &mut self.outside {
            facts = outside.facts(facts);
            if made.is_ok() {
                let places = &self.places[solver.pcg.own_rows()];
                let of_node = |&place: &u32| x[self.block * place as usize..][..self.block].iter().copied();
                outside.prepare(&solver.pcg, &self.numbers, places.iter().flat_map(of_node).collect());
            } else {
                outside.leave();
            }
        }
        (facts, made.err().map(|error| error.free))
    }

    /// Returns the diagonal of the last K at its own coordinates, N/m.
    pub(crate) fn diagonal(&self) -> Vec<f64> {
        let Some(solver) = &self.solver else { return vec![0.0; self.own.len()] };
        let mut all = vec![0.0; self.free.len()];
        solver.hessian.matrix().diagonal(&mut all);
        all[self.own.clone()].to_vec()
    }

    /// Returns messages for the user about the solves since the last call.
    pub(crate) fn take_findings(&mut self) -> Vec<String> {
        self.outside.as_mut().map_or_else(Vec::new, Outside::take_findings)
    }

    /// Solves A v = b together with the other ranks; `v` are the own coordinates of b, then of the solution.
    pub(crate) fn solve(&mut self, v: &mut [f64], tolerance: f64, max_iterations: u32) -> SharedSolve {
        let Some(solver) = &mut self.solver else {
            return SharedSolve::TooMany { iterations: 0, residual: f64::NAN };
        };
        if let Some(outside) = &mut self.outside
            && let Some(iterations) = outside.solve(&solver.pcg, v, tolerance, max_iterations)
        {
            return SharedSolve::Converged { iterations };
        }
        let mut load = vec![0.0; self.free.len()];
        load[self.own.clone()].copy_from_slice(v);
        let solved = solver.pcg.solve(&load, &mut solver.solution, tolerance, max_iterations);
        v.copy_from_slice(&solver.solution[self.own.clone()]);
        match solved {
            Ok(PcgReport { iterations, .. }) => SharedSolve::Converged { iterations },
            Err(SolverError::ConjugateGradients { iterations, residual, .. }) => {
                SharedSolve::TooMany { iterations, residual }
            }
            Err(SolverError::NegativeCurvature { iterations, curvature }) => {
                SharedSolve::Negative { iterations, curvature }
            }
            // Conjugate gradients have no other errors.
            Err(_) => SharedSolve::TooMany { iterations: 0, residual: f64::NAN },
        }
    }
}
