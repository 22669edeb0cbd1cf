//! The ranks that share the terms of a system, as the first rank sees them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use vi_core::{Exchange, Message, RunEnergy, SharedTerms, State, System};

use crate::error::SolverError;
use crate::ranks::command::Command;
use crate::ranks::member::{Held, Layout, Member};
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
        (method, keeps_ledger): (&Method, bool),
        exchange: Arc<dyn Exchange>,
    ) -> Result<Self, SolverError> {
        let (member, layout) =
            Member::with_layout(system, start, (method, keeps_ledger), Arc::clone(&exchange))?;
        Ok(Self { exchange, component, member: Mutex::new(member), layout })
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
    pub(crate) fn talk(
        &self,
        send: impl Fn(&Held) -> Vec<f64>,
        receive: impl Fn(&Held) -> usize,
    ) -> Vec<Message> {
        let message = |(rank, held): (usize, &Held)| Message {
            rank,
            send: send(held),
            receive: vec![0.0; receive(held)],
        };
        let mut messages: Vec<Message> = self.held().iter().enumerate().skip(1).map(message).collect();
        self.exchange.slots(&mut messages, &mut || {});
        messages
    }

    /// Gives all ranks the positions of their coordinates; returns those of the first.
    fn hand_out(&self, x: &[f64]) -> Vec<f64> {
        let of_rank = |held: &Held| -> Vec<f64> { held.dofs().map(|dof| x[dof]).collect() };
        self.talk(of_rank, |_| 0);
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
        let messages = self.talk(|_| Vec::new(), Held::reported_count);
        let received = messages.iter().map(|message| &message.receive[..]);
        for (held, values) in self.held().iter().zip(std::iter::once(&own[..]).chain(received)) {
            held.reported_dofs().zip(values).for_each(|(dof, &value)| out[dof] = value);
        }
    }

    fn bytes_sent(&self) -> usize {
        self.member().bytes_sent()
    }
}
