//! The portion of a system that one rank steps.

use std::sync::Arc;

use vi_core::{Exchange, Message, Portion, Potential, State, System, coordinates_of_nodes};

use crate::assemble::gather::Gather;
use crate::assemble::gather::division::{Division, TermPortion};
use crate::assemble::spans::common_block;
use crate::error::SolverError;
use crate::index::{NONE, free_of};
use crate::memory::StepperMemory;
use crate::ranks::command::Command;
use crate::schemes::kick_drift::KickDrift;
use crate::schemes::method::Method;
use crate::work::Work;

/// The portion of a system that one of several ranks steps by an explicit scheme.
pub struct Member {
    system: System,
    state: State,
    stepper: KickDrift,
    exchange: Arc<dyn Exchange>,
}

/// The coordinates of the portion of one rank, as numbers of the whole system.
pub(crate) struct Held {
    /// Its free coordinates.
    pub(crate) free: Vec<u32>,
    /// Its nodes.
    nodes: Vec<u32>,
    /// Coordinates per node.
    block: usize,
}

impl Held {
    /// Returns all its coordinates.
    pub(crate) fn dofs(&self) -> impl Iterator<Item = usize> {
        let block = self.block;
        self.nodes.iter().flat_map(move |&node| block * node as usize..block * (node as usize + 1))
    }
}

/// Returns why several ranks cannot step a system by a method, and what to write instead; `None` if they can.
fn refusal(system: &System, method: &Method, keeps_ledger: bool) -> Option<String> {
    let name = method.name();
    let (coordinates, block) = (system.coordinates(), common_block(system.terms()));
    let live = system.terms().live().first();
    let what = if method.splitting().is_none() {
        return Some(format!(
            "the scheme \"{name}\" does not run on several ranks: use \"stormer-verlet\", \"blanes-moan-4\", \
             \"blanes-moan-6\" or a symplectic Euler scheme, or one rank"
        ));
    } else if let Some(live) = live {
        format!("{}: terms whose stencils change do", live.name())
    } else if let Some(force) = system.forces().first() {
        format!("{}: forces without a potential do", force.name())
    } else if !system.constraints().is_empty() {
        "rigid bodies and joints do".to_owned()
    } else if !coordinates.is_plain() {
        "exact ties and supports along their own axes do".to_owned()
    } else if let Some(term) = system.potentials().iter().find(|term| term.stencils().block != block) {
        format!("{}: terms with {} coordinates per node do", term.name(), term.stencils().block)
    } else if keeps_ledger {
        return Some(
            "the energy ledger of moving supports and loads that change in time is not kept on several ranks: set \
             output.ledger = false, or use one rank"
                .to_owned(),
        );
    } else {
        return None;
    };
    Some(format!("{what} not run on several ranks yet: use one rank"))
}

impl Member {
    /// Returns the portion of `whole` that this rank steps. `start` is any state inside the domain of the terms.
    ///
    /// # Errors
    /// Returns [`SolverError::Ranks`] if several ranks cannot step the system by this method.
    pub fn new(
        whole: &System,
        start: &State,
        (method, keeps_ledger): (&Method, bool),
        exchange: Arc<dyn Exchange>,
    ) -> Result<Self, SolverError> {
        Self::with_held(whole, start, (method, keeps_ledger), exchange).map(|(member, _)| member)
    }

    /// Returns the portion, and the coordinates of those of all ranks.
    pub(crate) fn with_held(
        whole: &System,
        start: &State,
        (method, keeps_ledger): (&Method, bool),
        exchange: Arc<dyn Exchange>,
    ) -> Result<(Self, Vec<Held>), SolverError> {
        let refused = |reason: String| SolverError::Ranks { reason };
        if let Some(reason) = refusal(whole, method, keeps_ledger) {
            return Err(refused(reason));
        }
        let Some(splitting) = method.splitting() else { return Err(refused(method.name().to_owned())) };
        let (terms, mass) = (whole.terms(), whole.mass());
        let block = common_block(terms);
        let gather = Gather::new(terms, block);
        let division = Division::new(&gather, exchange.size());
        let base = gather.base(terms, &whole.positions(start), start.t);
        let (own, portions) = division.portion(&gather, base.as_deref(), Arc::clone(&exchange));
        drop(gather);
        let nodes = &division.nodes[exchange.rank()];
        let portion = |TermPortion { term, stencils }: TermPortion| {
            let whole = Arc::clone(&terms.fixed()[term]);
            let number = |node: u32| nodes.binary_search(&node).map_or(NONE, |own| own as u32);
            let portion = Portion::new(whole, stencils, mass.len(), number);
            // The first rank keeps the whole system.
            Box::new(if exchange.rank() == 0 { portion } else { portion.detached() }) as Box<dyn Potential>
        };
        let portions = portions.into_iter().map(portion).collect();
        let own_mass =
            nodes.iter().flat_map(|&node| &mass[block * node as usize..][..block]).copied().collect();
        let system = coordinates_of_nodes(terms.shared_coordinates(), nodes, block)
            .and_then(|coordinates| System::new(own_mass, portions, coordinates))
            .map_err(|error| refused(error.to_string()))?;
        let zeros = vec![0.0; system.coordinates().free_count()];
        let state = State { t: start.t, q: zeros.clone(), p: zeros };
        let stepper = KickDrift::of_portion(method.name(), splitting, (&system, whole), own);
        let free_of = free_of(whole.coordinates());
        let held = division.nodes.into_iter().map(|nodes| {
            let held = Held { free: Vec::new(), nodes, block };
            let free = held.dofs().map(|dof| free_of[dof]).filter(|&free| free != NONE).collect();
            Held { free, ..held }
        });
        let held = held.collect();
        Ok((Self { system, state, stepper, exchange }, held))
    }

    /// Obeys a command of the conductor; returns false if these bytes are none. `members` are those of this rank, by
    /// component.
    pub fn obey(members: &mut [Option<Self>], bytes: &[u8]) -> bool {
        let Some((component, command)) = Command::decode(bytes) else { return false };
        let Some(Some(member)) = members.get_mut(component) else { return false };
        let exchange = Arc::clone(&member.exchange);
        let first = |send: Vec<f64>, receive: usize| {
            let mut message = [Message { rank: 0, send, receive: vec![0.0; receive] }];
            exchange.slots(&mut message, &mut || {});
            let [message] = message;
            message.receive
        };
        match command {
            Command::Place { evaluated } => {
                let (n, count) = (member.state.q.len(), member.system.coordinates().dof_count());
                let received = first(Vec::new(), 2 * n + if evaluated.is_some() { count } else { 0 });
                member.place(&received, evaluated);
            }
            Command::Steps { t, h, count } => {
                if member.steps(t, h, count) {
                    first([&member.state.q[..], &member.state.p].concat(), 0);
                }
            }
        }
        true
    }

    /// Takes q and p, and if the evaluator was somewhere, the positions of all coordinates there.
    pub(crate) fn place(&mut self, numbers: &[f64], evaluated: Option<(f64, bool)>) {
        let n = self.state.q.len();
        let (q, rest) = numbers.split_at(n);
        let (p, x) = rest.split_at(n);
        self.state.q.copy_from_slice(q);
        self.state.p.copy_from_slice(p);
        let mut memory = StepperMemory::default();
        if let Some((t, knows)) = evaluated {
            memory.arrays = vec![("forces.x".into(), x.to_vec()), ("forces.t".into(), vec![t])];
            memory.counts = vec![("forces.gradient".into(), u64::from(knows))];
        }
        // All entries are there, with the lengths of this portion.
        let restored = self.stepper.restore_place(&memory);
        debug_assert!(restored.is_ok(), "{restored:?}");
    }

    /// Makes steps together with the other ranks; returns whether all succeeded. If not, the state is unchanged.
    pub(crate) fn steps(&mut self, t: f64, h: f64, count: u32) -> bool {
        self.state.t = t;
        self.stepper.steps_of_portion(&self.system, &mut self.state, (h, count), self.exchange.as_ref())
    }

    /// Returns the state of the portion.
    pub(crate) fn state(&self) -> &State {
        &self.state
    }

    /// Returns the time of the last evaluation and whether its gradient is known, if there was one.
    pub(crate) fn evaluated(&self) -> Option<(f64, bool)> {
        self.stepper.evaluated()
    }

    /// Returns the counts of its work.
    pub(crate) fn work(&self) -> Work {
        self.stepper.counted()
    }

    /// Returns the number of bytes that this rank sends to others per evaluation of forces.
    pub fn bytes_sent(&mut self) -> usize {
        self.stepper.bytes_sent()
    }
}
