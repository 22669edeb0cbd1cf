//! The portion of a system that one rank computes.

use std::sync::Arc;

use vi_core::{Exchange, Message, State, System, Traffic};

use crate::assemble::assembler::Assembler;
use crate::assemble::gather::Gather;
use crate::assemble::spans::Span;
use crate::error::SolverError;
use crate::index::{NONE, free_of};
use crate::memory::StepperMemory;
use crate::options::SolverOptions;
use crate::ranks::command::Command;
use crate::ranks::lanczos::Lanczos;
use crate::ranks::layout::Layout;
use crate::ranks::portion_data::{Places, PortionData};
use crate::ranks::rows::Rows;
use crate::schemes::kick_drift::KickDrift;
use crate::schemes::method::Method;
use crate::work::Work;

/// The portion of a system that one of several ranks computes.
pub struct Member {
    system: System,
    state: State,
    task: Task,
    /// The runs of stencils whose energies it sums, in the order of the whole system.
    spans: Vec<Span>,
    /// The term and the first stencil of each of them in the whole system.
    places: Vec<(usize, usize)>,
    /// Whether there are runs that it should sum, and all of them have a free coordinate.
    is_complete: bool,
    /// The nodes whose gradient it reports, in its own numbers.
    reported: Vec<u32>,
    /// The free coordinates that it reports: those of the nodes whose gradient it reports.
    reported_free: Vec<u32>,
    /// A copy of the state to go back to, and the place of the evaluator there.
    kept: Option<(State, StepperMemory)>,
    /// The vectors for the highest frequency, while it is being found.
    lanczos: Option<Box<Lanczos>>,
    /// The rows of this rank in the linear systems, if the ranks solve them together.
    rows: Option<Rows>,
    block: usize,
    exchange: Arc<dyn Exchange>,
}

/// The task of a rank with its portion.
enum Task {
    /// Make explicit steps.
    Steps(Box<KickDrift>),
    /// Sum terms; the first rank makes the steps.
    Sums(Box<Assembler>),
}

/// Returns the free coordinates of some nodes.
fn places_of_free(system: &System, nodes: &[u32], block: usize) -> Vec<u32> {
    let free_of = free_of(system.coordinates());
    let of_node = |&node: &u32| free_of[block * node as usize..][..block].iter().copied();
    nodes.iter().flat_map(of_node).filter(|&free| free != NONE).collect()
}

impl Member {
    /// Returns the portion of `whole` that this rank computes. `start` is any state inside the domain of the terms.
    ///
    /// # Errors
    /// Returns [`SolverError::Ranks`] if several ranks cannot share the system.
    pub fn new(
        whole: &System,
        start: &State,
        run: (&Method, &SolverOptions),
        exchange: Arc<dyn Exchange>,
    ) -> Result<Self, SolverError> {
        Self::with_layout(whole, start, run, exchange).map(|(member, _)| member)
    }

    /// Returns the portion, and the layout of all ranks.
    ///
    /// # Errors
    /// Returns the errors of [`Member::new`].
    pub(crate) fn with_layout(
        whole: &System,
        start: &State,
        (method, options): (&Method, &SolverOptions),
        exchange: Arc<dyn Exchange>,
    ) -> Result<(Self, Layout), SolverError> {
        let data = PortionData::new(whole, start, (method, options), &exchange, None)?;
        let solved = if method.facts().is_explicit { None } else { Rows::new(whole, options, &exchange)? };
        let (rows, rows_of_all) = solved.map_or((None, Vec::new()), |(rows, of_all)| (Some(rows), of_all));
        let (member, Places { nodes, reported, runs }) = Self::of_data(data, method, rows, exchange);
        let layout = Layout::new(whole, (nodes, reported), runs, rows_of_all, member.makes_steps());
        Ok((member, layout))
    }

    /// Returns the same portion, made from the part of the whole system that contains all stencils at its nodes, in whole runs, and from
    /// any state of it inside the domain of the terms. Both are dropped as soon as possible. `runs` are the numbers of the runs of
    /// every term in the whole system, and their ranks; affine terms need none. The scheme must be explicit. The portion must not be
    /// used unless those of all ranks are complete ([`Member::is_complete`]).
    ///
    /// # Errors
    /// Returns the errors of [`Member::new`].
    pub fn of_part(
        (part, start): (System, State),
        runs: &[Vec<(u32, u32)>],
        (method, options): (&Method, &SolverOptions),
        exchange: Arc<dyn Exchange>,
    ) -> Result<Self, SolverError> {
        let data = PortionData::new(&part, &start, (method, options), &exchange, Some(runs))?;
        drop((part, start));
        Ok(Self::of_data(data, method, None, exchange).0)
    }

    /// Makes the portion from the data that [`PortionData`] holds.
    fn of_data(
        data: PortionData,
        method: &Method,
        rows: Option<Rows>,
        exchange: Arc<dyn Exchange>,
    ) -> (Self, Places) {
        let PortionData { system, gather, splitting, depends, spans, places, is_complete, block, t, of_all } =
            data;
        let reported = of_all.reported[exchange.rank()].clone();
        let (mut zeros, mut reported_free) = (Vec::new(), Vec::new());
        let task = match splitting {
            Some(splitting) => {
                zeros = vec![0.0; system.coordinates().free_count()];
                reported_free = places_of_free(&system, &reported, block);
                let stepper = KickDrift::of_portion(method.name(), splitting, (&system, depends), gather);
                Task::Steps(Box::new(stepper))
            }
            None => Task::Sums(Box::new(Assembler::of_portion(system.terms().clone(), gather))),
        };
        let state = State { t, q: zeros.clone(), p: zeros };
        let member = Self {
            system,
            state,
            task,
            spans,
            places,
            is_complete,
            reported,
            reported_free,
            kept: None,
            lanczos: None,
            rows,
            block,
            exchange,
        };
        (member, of_all)
    }

    /// Obeys a command of the first rank; returns false if the bytes encode no command. `members` are those of this
    /// rank, by component.
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
        let (n, count) = (member.state.q.len(), member.system.coordinates().dof_count());
        match command {
            Command::Place { evaluated } => {
                let received = first(Vec::new(), 2 * n + if evaluated.is_some() { count } else { 0 });
                member.place(&received, evaluated);
            }
            Command::Steps { t, h, count } => {
                if member.steps(t, h, count) {
                    first(member.numbers(), 0);
                }
            }
            Command::State => {
                first(member.numbers(), 0);
            }
            Command::Keep => member.keep(),
            Command::GoBack => {
                member.go_back();
                first(member.numbers(), 0);
            }
            Command::Energies { t } => {
                let x = first(Vec::new(), count);
                member.energies(&x, t);
            }
            Command::Gradient { t } => {
                let x = first(Vec::new(), count);
                let gradient = member.gradient(&x, t);
                first(gradient, 0);
            }
            Command::Fault { t } => {
                let x = first(Vec::new(), count);
                let [term, stencil] = member.first_fault(&x, t);
                first(vec![term, stencil], 0);
            }
            Command::StartLanczos { t, per_unit, displacement } => {
                let received = first(Vec::new(), 2 * n);
                member.start_lanczos(t, [per_unit, displacement], &received);
            }
            Command::MultiplyLanczos { norm } => {
                let terms = member.multiply_lanczos(norm);
                first(terms, 0);
            }
            Command::SubtractLanczos { factors } => {
                let squares = member.subtract_lanczos(factors);
                first(squares, 0);
            }
            Command::Prepare { t, factors, is_projected } => {
                let Some(rows) = &mut member.rows else { return false };
                let x = first(Vec::new(), rows.counts().0);
                // Ignore the result: the first rank computes the same one.
                rows.prepare(&x, t, factors, is_projected);
            }
            Command::Diagonal => {
                let Some(rows) = &mut member.rows else { return false };
                let diagonal = rows.diagonal();
                first(diagonal, 0);
            }
            Command::Solve { tolerance, most } => {
                let Some(rows) = &mut member.rows else { return false };
                let mut v = first(Vec::new(), rows.counts().1);
                rows.solve(&mut v, tolerance, most);
                first(v, 0);
            }
        }
        true
    }

    /// Takes q and p of the free coordinates and, if the evaluator has evaluated, the positions of all coordinates at
    /// its last evaluation. `evaluated` is the time of that evaluation (s), and whether its gradient is known.
    pub(crate) fn place(&mut self, numbers: &[f64], evaluated: Option<(f64, bool)>) {
        let n = self.state.q.len();
        let (q, rest) = numbers.split_at(n);
        let (p, x) = rest.split_at(n);
        self.state.q.copy_from_slice(q);
        self.state.p.copy_from_slice(p);
        self.lanczos = None;
        let mut memory = StepperMemory::default();
        if let Some((t, knows)) = evaluated {
            memory.arrays = vec![("forces.x".into(), x.to_vec()), ("forces.t".into(), vec![t])];
            memory.counts = vec![("forces.gradient".into(), u64::from(knows))];
        }
        self.put_evaluator(&memory);
    }

    /// Restores the place of the last evaluation.
    fn put_evaluator(&mut self, memory: &StepperMemory) {
        if let Task::Steps(stepper) = &mut self.task {
            // All entries are there, with the lengths of this portion.
            let restored = stepper.restore_place(memory);
            debug_assert!(restored.is_ok(), "{restored:?}");
        }
    }

    /// Keeps a copy of the state, with the place of the evaluator.
    pub(crate) fn keep(&mut self) {
        // Two copies would take much memory.
        self.kept = None;
        if let Task::Steps(stepper) = &self.task {
            self.kept = Some((self.state.clone(), stepper.place()));
        }
    }

    /// Goes back to the state that was kept last.
    pub(crate) fn go_back(&mut self) {
        if let Some((state, memory)) = self.kept.take() {
            self.state.clone_from(&state);
            self.put_evaluator(&memory);
            self.kept = Some((state, memory));
        }
    }

    /// Makes steps together with the other ranks; returns whether all succeeded. If not, the state is unchanged.
    pub(crate) fn steps(&mut self, t: f64, h: f64, count: u32) -> bool {
        let Task::Steps(stepper) = &mut self.task else { return false };
        self.state.t = t;
        stepper.steps_of_portion(&self.system, &mut self.state, (h, count), self.exchange.as_ref())
    }

    /// Sums the energies of its runs at the positions of its coordinates, and returns those of all ranks: each run as the
    /// sum and its error.
    pub(crate) fn energies(&mut self, x: &[f64], t: f64) -> Vec<Vec<[f64; 2]>> {
        let assembler = match &mut self.task {
            Task::Steps(stepper) => stepper.assembler(),
            Task::Sums(assembler) => assembler,
        };
        let own = assembler.energies_of_spans(&self.spans, x, t);
        let bytes: Vec<u8> = own.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        let pieces = self.exchange.pieces(&bytes);
        let numbers = |piece: &Vec<u8>| -> Vec<[f64; 2]> {
            let numbers: Vec<f64> =
                piece.as_chunks::<8>().0.iter().map(|&bytes| f64::from_le_bytes(bytes)).collect();
            numbers.as_chunks::<2>().0.to_vec()
        };
        pieces.iter().map(numbers).collect()
    }

    /// Returns ∂V/∂x at the nodes that it reports, together with the other ranks.
    pub(crate) fn gradient(&mut self, x: &[f64], t: f64) -> Vec<f64> {
        let assembler = match &mut self.task {
            Task::Steps(stepper) => stepper.assembler(),
            Task::Sums(assembler) => assembler,
        };
        let mut gradient = vec![0.0; x.len()];
        assembler.gradient(x, t, &mut gradient);
        let of_node = |&place: &u32| &gradient[self.block * place as usize..][..self.block];
        self.reported.iter().flat_map(of_node).copied().collect()
    }

    /// Returns the first stencil without a finite energy or gradient among those that it sums, as the term and the stencil of the
    /// whole system; infinities if there is none.
    pub(crate) fn first_fault(&mut self, x: &[f64], t: f64) -> [f64; 2] {
        let assembler = match &mut self.task {
            Task::Steps(stepper) => stepper.assembler(),
            Task::Sums(assembler) => assembler,
        };
        let found = assembler.fault_in_spans(&self.spans, x, t);
        found.map_or([f64::INFINITY; 2], |(span, stencil)| {
            let (term, first) = self.places[span];
            [term as f64, (first + stencil) as f64]
        })
    }

    /// Returns whether there are runs that it should sum, and all of them have a free coordinate.
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Starts Lanczos' method with its free coordinates and the vector after them.
    pub(crate) fn start_lanczos(&mut self, t: f64, scales: [f64; 2], numbers: &[f64]) {
        let (q, vector) = numbers.split_at(self.state.q.len());
        self.lanczos = Some(Box::new(Lanczos::new(t, scales, q.to_vec(), vector.to_vec())));
    }

    /// Multiplies a vector of Lanczos' method; returns the terms of the product of both at the coordinates that it reports.
    pub(crate) fn multiply_lanczos(&mut self, norm: f64) -> Vec<f64> {
        let (Some(lanczos), Task::Steps(stepper)) = (&mut self.lanczos, &mut self.task) else {
            return Vec::new();
        };
        let terms = lanczos.multiply(norm, &self.system, stepper.assembler(), self.exchange.as_ref());
        self.reported_free.iter().map(|&free| terms[free as usize]).collect()
    }

    /// Subtracts vectors of Lanczos' method; returns the squares of the rest at the coordinates that it reports.
    pub(crate) fn subtract_lanczos(&mut self, factors: [f64; 2]) -> Vec<f64> {
        let squares = self.lanczos.as_mut().map_or_else(Vec::new, |lanczos| lanczos.subtract(factors));
        self.reported_free.iter().filter_map(|&free| squares.get(free as usize)).copied().collect()
    }

    /// Returns its rows of the linear systems, if the ranks solve them together.
    pub(crate) fn rows(&mut self) -> Option<&mut Rows> {
        self.rows.as_mut()
    }

    /// Returns whether it makes steps.
    pub(crate) fn makes_steps(&self) -> bool {
        matches!(self.task, Task::Steps(_))
    }

    /// Returns q and p of the portion.
    fn numbers(&self) -> Vec<f64> {
        [&self.state.q[..], &self.state.p].concat()
    }

    /// Returns the state of the portion.
    pub(crate) fn state(&self) -> &State {
        &self.state
    }

    /// Returns the time of the last evaluation of its steps and whether its gradient is known, if there was one.
    pub(crate) fn evaluated(&self) -> Option<(f64, bool)> {
        match &self.task {
            Task::Steps(stepper) => stepper.evaluated(),
            Task::Sums(_) => None,
        }
    }

    /// Returns the counts of the work of its steps.
    pub(crate) fn work(&self) -> Work {
        match &self.task {
            Task::Steps(stepper) => stepper.counted(),
            Task::Sums(_) => Work::default(),
        }
    }

    /// Returns the messages from this rank to others per gradient.
    pub fn traffic(&mut self) -> Traffic {
        match &mut self.task {
            Task::Steps(stepper) => stepper.traffic(),
            Task::Sums(assembler) => assembler.gather().map_or_else(Traffic::default, Gather::traffic),
        }
    }
}
