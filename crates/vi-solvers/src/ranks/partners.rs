//! The ranks that share the terms of a system, as the first rank sees them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use vi_core::{
    Exchange, LanczosStart, Message, RunEnergy, SharedSolve, SharedTerms, SolverFacts, State, System, Traffic,
};

use crate::error::SolverError;
use crate::options::SolverOptions;
use crate::ranks::command::Command;
use crate::ranks::layout::{Layout, RankCoordinates};
use crate::ranks::member::Member;
use crate::ranks::rows::{Rows, RowsLayout};
use crate::schemes::method::Method;

/// The ranks that share a component. The first rank has a portion of it as the others have, and sends them commands.
pub struct Partners {
    exchange: Arc<dyn Exchange>,
    /// Number of the component.
    component: usize,
    /// The portion of the first rank.
    member: Mutex<Member>,
    layout: Layout,
}

impl Partners {
    /// Divides component number `component` among the ranks of `exchange`, of which this is the first. The others must
    /// make their [`Member`] with the same arguments. `start` is any state inside the domain of the terms.
    ///
    /// # Errors
    /// Returns [`SolverError::Ranks`] if several ranks cannot share the system.
    pub fn new(
        (component, system, start): (usize, &System, &State),
        (method, options): (&Method, &SolverOptions),
        exchange: Arc<dyn Exchange>,
    ) -> Result<Self, SolverError> {
        let (member, layout) = Member::with_layout(system, start, (method, options), Arc::clone(&exchange))?;
        Ok(Self { exchange, component, member: Mutex::new(member), layout })
    }

    /// Divides the component among ranks that make their [`Member`] from parts ([`Member::of_part`]); `member` is that of the
    /// first. `nodes` are the nodes (ascending) of the runs of each rank if this process does not hold the elements. Returns `None`
    /// if this is not possible, because a run of stencils has no free coordinate or a rank has no run.
    pub fn of_parts(
        (component, system): (usize, &System),
        nodes: Option<Vec<Vec<u32>>>,
        member: Member,
        exchange: Arc<dyn Exchange>,
    ) -> Option<Self> {
        let (size, steps) = (exchange.size(), member.makes_steps());
        let layout = match nodes {
            Some(nodes) => Layout::of_far_parts(system, nodes, steps)?,
            None => Layout::of_parts(system, size, steps)?,
        };
        Some(Self { exchange, component, member: Mutex::new(member), layout })
    }

    /// Returns whether the ranks step their portions themselves.
    pub(crate) fn make_steps(&self) -> bool {
        self.layout.steps
    }

    /// Returns the coordinates of each rank.
    pub(crate) fn held(&self) -> &[RankCoordinates] {
        &self.layout.held
    }

    /// Returns the portion of the first rank.
    pub(crate) fn member(&self) -> MutexGuard<'_, Member> {
        self.member.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends a command to the other ranks.
    pub(crate) fn command(&self, command: Command) {
        self.exchange.pieces(&command.encode(self.component));
    }

    /// Exchanges messages with the other ranks, one after the other, so that only one is in memory: sends what `send` gives for
    /// a rank, receives as many numbers as `receive` says, and passes them to `take`.
    pub(crate) fn exchange_in_turn<T>(
        &self,
        of_ranks: &[T],
        send: impl Fn(&T) -> Vec<f64>,
        receive: impl Fn(&T) -> usize,
        mut take: impl FnMut(&T, &[f64]),
    ) {
        for (rank, of_rank) in of_ranks.iter().enumerate().skip(1) {
            let receive = vec![0.0; receive(of_rank)];
            let mut message = [Message { rank, send: send(of_rank), receive }];
            self.exchange.slots(&mut message, &mut || {});
            take(of_rank, &message[0].receive);
        }
    }

    /// Sends numbers to every other rank.
    pub(crate) fn send<T>(&self, of_ranks: &[T], numbers: impl Fn(&T) -> Vec<f64>) {
        self.exchange_in_turn(of_ranks, numbers, |_| 0, |_, _| {});
    }

    /// Receives numbers from every other rank, as many as `count` says.
    pub(crate) fn receive<T>(
        &self,
        of_ranks: &[T],
        count: impl Fn(&T) -> usize,
        take: impl FnMut(&T, &[f64]),
    ) {
        self.exchange_in_turn(of_ranks, |_| Vec::new(), count, take);
    }

    /// Receives a number for each free coordinate that the others report; `own` are those of the first rank.
    fn collect(&self, own: &[f64], out: &mut [f64]) {
        let mut enter = |held: &RankCoordinates, values: &[f64]| {
            held.reported_free().zip(values).for_each(|(free, &value)| out[free] = value);
        };
        enter(&self.held()[0], own);
        self.receive(self.held(), |held| held.reported_free().count(), enter);
    }

    /// Gives all ranks the positions of their coordinates; returns those of the first.
    fn send_positions(&self, x: &[f64]) -> Vec<f64> {
        let of_rank = |held: &RankCoordinates| -> Vec<f64> { held.dofs().map(|dof| x[dof]).collect() };
        self.send(self.held(), of_rank);
        of_rank(&self.held()[0])
    }
}

impl SharedTerms for Partners {
    fn energies(&self, x: &[f64], t: f64) -> Vec<RunEnergy> {
        let mut member = self.member();
        self.command(Command::Energies { t });
        let own = self.send_positions(x);
        let sums = member.energies(&own, t);
        let run = |(&(term, first), [sum, error]): (&(usize, usize), [f64; 2])| RunEnergy {
            term,
            first,
            sum,
            error,
        };
        self.layout.runs.iter().zip(sums).flat_map(|(runs, sums)| runs.iter().zip(sums).map(run)).collect()
    }

    fn gradient(&self, x: &mut [f64], t: f64) {
        let mut member = self.member();
        self.command(Command::Gradient { t });
        let own = self.send_positions(x);
        let own = member.gradient(&own, t);
        // Every coordinate is reported by one rank.
        let mut enter = |held: &RankCoordinates, values: &[f64]| {
            held.reported_dofs().zip(values).for_each(|(dof, &value)| x[dof] = value);
        };
        enter(&self.held()[0], &own);
        self.receive(self.held(), RankCoordinates::reported_count, enter);
    }

    fn first_fault(&self, x: &[f64], t: f64) -> Option<(usize, usize)> {
        let mut member = self.member();
        self.command(Command::Fault { t });
        let own = self.send_positions(x);
        let mut all = vec![member.first_fault(&own, t)];
        self.receive(self.held(), |_| 2, |_, found| all.extend(found.first_chunk()));
        let first = all.into_iter().min_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])))?;
        first[0].is_finite().then_some((first[0] as usize, first[1] as usize))
    }

    fn start_lanczos(&self, q: &[f64], t: f64, start: &LanczosStart<'_>) -> bool {
        if !self.make_steps() {
            return false;
        }
        let &LanczosStart { per_unit, displacement, vector } = start;
        let mut member = self.member();
        self.command(Command::StartLanczos { t, per_unit, displacement });
        let of_rank = |held: &RankCoordinates| -> Vec<f64> {
            held.free().map(|k| q[k]).chain(held.free().map(vector)).collect()
        };
        self.send(self.held(), of_rank);
        member.start_lanczos(t, [per_unit, displacement], &of_rank(&self.held()[0]));
        true
    }

    fn multiply_lanczos(&self, norm: f64, out: &mut [f64]) {
        let mut member = self.member();
        self.command(Command::MultiplyLanczos { norm });
        let own = member.multiply_lanczos(norm);
        self.collect(&own, out);
    }

    fn subtract_lanczos(&self, factors: [f64; 2], out: &mut [f64]) {
        let mut member = self.member();
        self.command(Command::SubtractLanczos { factors });
        let own = member.subtract_lanczos(factors);
        self.collect(&own, out);
    }

    fn solves(&self) -> bool {
        !self.layout.rows.is_empty()
    }

    fn prepare(
        &self,
        x: &[f64],
        t: f64,
        factors: [f64; 2],
        is_projected: bool,
    ) -> (SolverFacts, Option<usize>) {
        let mut member = self.member();
        let (Some(rows), [first, ..]) = (member.rows(), &self.layout.rows[..]) else {
            return (SolverFacts::default(), Some(0));
        };
        self.command(Command::Prepare { t, factors, is_projected });
        let of_rank = |rows: &RowsLayout| -> Vec<f64> { rows.dofs().map(|dof| x[dof]).collect() };
        self.send(&self.layout.rows, of_rank);
        rows.prepare(&of_rank(first), t, factors, is_projected)
    }

    fn diagonal(&self, out: &mut [f64]) {
        let mut member = self.member();
        let Some(rows) = member.rows() else { return };
        self.command(Command::Diagonal);
        let own = rows.diagonal();
        let mut enter = |rows: &RowsLayout, values: &[f64]| out[rows.free.clone()].copy_from_slice(values);
        enter(&self.layout.rows[0], &own);
        self.receive(&self.layout.rows, |rows| rows.free.len(), enter);
    }

    fn solve(&self, v: &mut [f64], tolerance: f64, max_iterations: u32) -> SharedSolve {
        let mut member = self.member();
        let (Some(rows), [first, ..]) = (member.rows(), &self.layout.rows[..]) else {
            return SharedSolve::TooMany { iterations: 0, residual: f64::NAN };
        };
        self.command(Command::Solve { tolerance, most: max_iterations });
        let of_rank = |rows: &RowsLayout| v[rows.free.clone()].to_vec();
        self.send(&self.layout.rows, of_rank);
        let mut own = of_rank(first);
        let solved = rows.solve(&mut own, tolerance, max_iterations);
        let mut enter = |rows: &RowsLayout, values: &[f64]| v[rows.free.clone()].copy_from_slice(values);
        enter(first, &own);
        self.receive(&self.layout.rows, |rows| rows.free.len(), enter);
        solved
    }

    fn take_findings(&self) -> Vec<String> {
        self.member().rows().map_or_else(Vec::new, Rows::take_findings)
    }

    fn traffic(&self) -> Traffic {
        self.member().traffic()
    }
}
