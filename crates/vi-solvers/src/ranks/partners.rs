//! The ranks that share the terms of a system, as the first rank sees them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use vi_core::{Exchange, Message, RunEnergy, SharedSolve, SharedTerms, SolverFacts, State, System, Traffic};

use crate::error::SolverError;
use crate::options::SolverOptions;
use crate::ranks::command::Command;
use crate::ranks::layout::{Held, Layout};
use crate::ranks::member::Member;
use crate::ranks::rows::{Rows, RowsLayout};
use crate::schemes::method::Method;

/// The ranks that share a component. The first rank has a portion of it as the others have, and tells them what to do.
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
        let (member, layout) =
            Member::with_layout(system, start, (method, options), Arc::clone(&exchange), None)?;
        Ok(Self { exchange, component, member: Mutex::new(member), layout })
    }

    /// Divides the component among ranks that make their [`Member`] from parts ([`Member::of_part`]); `member` is that of the
    /// first. Returns `None` if this is not possible, because a run of stencils has no free coordinate or a rank has no run.
    pub fn of_parts(
        (component, system): (usize, &System),
        member: Member,
        exchange: Arc<dyn Exchange>,
    ) -> Option<Self> {
        let layout = Layout::of_parts(system, exchange.size(), member.makes_steps())?;
        Some(Self { exchange, component, member: Mutex::new(member), layout })
    }

    /// Returns whether the ranks step their portions themselves.
    pub(crate) fn make_steps(&self) -> bool {
        self.layout.steps
    }

    /// Returns the coordinates of each rank.
    pub(crate) fn held(&self) -> &[Held] {
        &self.layout.held
    }

    /// Returns the portion of the first rank.
    pub(crate) fn member(&self) -> MutexGuard<'_, Member> {
        self.member.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells the others what to do.
    pub(crate) fn command(&self, command: Command) {
        self.exchange.pieces(&command.encode(self.component));
    }

    /// Exchanges messages with all other ranks: sends what `send` gives for a rank, and receives as many numbers as
    /// `receive` says.
    pub(crate) fn talk<T>(
        &self,
        of_ranks: &[T],
        send: impl Fn(&T) -> Vec<f64>,
        receive: impl Fn(&T) -> usize,
    ) -> Vec<Message> {
        let message = |(rank, of_rank): (usize, &T)| Message {
            rank,
            send: send(of_rank),
            receive: vec![0.0; receive(of_rank)],
        };
        let mut messages: Vec<Message> = of_ranks.iter().enumerate().skip(1).map(message).collect();
        self.exchange.slots(&mut messages, &mut || {});
        messages
    }

    /// Gives all ranks the positions of their coordinates; returns those of the first.
    fn hand_out(&self, x: &[f64]) -> Vec<f64> {
        let of_rank = |held: &Held| -> Vec<f64> { held.dofs().map(|dof| x[dof]).collect() };
        self.talk(self.held(), of_rank, |_| 0);
        of_rank(&self.held()[0])
    }
}

impl SharedTerms for Partners {
    fn energies(&self, x: &[f64], t: f64) -> Vec<RunEnergy> {
        let mut member = self.member();
        self.command(Command::Energies { t });
        let own = self.hand_out(x);
        let sums = member.energies(&own, t);
        let run = |(&(term, first), [sum, error]): (&(usize, usize), [f64; 2])| RunEnergy {
            term,
            first,
            sum,
            error,
        };
        self.layout.runs.iter().zip(sums).flat_map(|(runs, sums)| runs.iter().zip(sums).map(run)).collect()
    }

    fn gradient(&self, x: &[f64], t: f64, out: &mut [f64]) {
        let mut member = self.member();
        self.command(Command::Gradient { t });
        let own = self.hand_out(x);
        let own = member.gradient(&own, t);
        let messages = self.talk(self.held(), |_| Vec::new(), Held::reported_count);
        let received = messages.iter().map(|message| &message.receive[..]);
        for (held, values) in self.held().iter().zip(std::iter::once(&own[..]).chain(received)) {
            held.reported_dofs().zip(values).for_each(|(dof, &value)| out[dof] = value);
        }
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
        self.talk(&self.layout.rows, of_rank, |_| 0);
        rows.prepare(&of_rank(first), t, factors, is_projected)
    }

    fn diagonal(&self, out: &mut [f64]) {
        let mut member = self.member();
        let Some(rows) = member.rows() else { return };
        self.command(Command::Diagonal);
        let own = rows.diagonal();
        let messages = self.talk(&self.layout.rows, |_| Vec::new(), |rows| rows.free.len());
        let received = messages.iter().map(|message| &message.receive);
        for (rows, values) in self.layout.rows.iter().zip(std::iter::once(&own).chain(received)) {
            out[rows.free.clone()].copy_from_slice(values);
        }
    }

    fn solve(&self, v: &mut [f64], tolerance: f64, max_iterations: u32) -> SharedSolve {
        let mut member = self.member();
        let (Some(rows), [first, others @ ..]) = (member.rows(), &self.layout.rows[..]) else {
            return SharedSolve::TooMany { iterations: 0, residual: f64::NAN };
        };
        self.command(Command::Solve { tolerance, most: max_iterations });
        let of_rank = |rows: &RowsLayout| v[rows.free.clone()].to_vec();
        self.talk(&self.layout.rows, of_rank, |_| 0);
        let mut own = of_rank(first);
        let solved = rows.solve(&mut own, tolerance, max_iterations);
        let messages = self.talk(&self.layout.rows, |_| Vec::new(), |rows| rows.free.len());
        v[first.free.clone()].copy_from_slice(&own);
        for (rows, message) in others.iter().zip(&messages) {
            v[rows.free.clone()].copy_from_slice(&message.receive);
        }
        solved
    }

    fn take_findings(&self) -> Vec<String> {
        self.member().rows().map_or_else(Vec::new, Rows::take_findings)
    }

    fn traffic(&self) -> Traffic {
        self.member().traffic()
    }
}
