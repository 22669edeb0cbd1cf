//! Runs long work on threads of its own, while the calling thread receives signals and messages.
//!
//! Python runs its signal handlers on the main thread only, so that the caller must return to Python regularly.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use variational::auto::AutoReport;
use variational::auto::trial::TrialWatch;
use variational::run::Watch;
use variational::simulation::Simulation;
use variational::solvers::Interrupt;
use variational::study::bench::BenchWatch;
use variational::study::sweep::SweepWatch;

use crate::callables::{Raised, lock};
use crate::errors;
use crate::threads::Threads;

/// Longest time between two looks at signals: Longest time after which Ctrl-C takes effect.
pub(crate) const QUANTUM: Duration = Duration::from_millis(50);

/// A message from the work to the caller.
pub(crate) enum Message {
    /// A note, with its kind: `note`, `finding` or `trial`.
    Text(&'static str, String),
    /// Time, end (s), and steps per second.
    Progress(f64, f64, f64),
}

/// The connection of the work to the caller.
pub(crate) struct Link<'a> {
    messages: Sender<Message>,
    stop: Arc<AtomicBool>,
    raised: &'a Raised,
    begin: Instant,
    last: Option<Instant>,
}

impl Link<'_> {
    /// Returns the request that abandons the step in progress.
    pub(crate) fn interrupt(&self) -> Interrupt {
        Interrupt::from(Arc::clone(&self.stop))
    }

    fn go_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed) && !self.raised.is_set()
    }

    /// Sends a message. The caller listens as long as the work lasts.
    fn say(&self, message: Message) {
        let _ = self.messages.send(message);
    }

    fn text(&self, kind: &'static str, text: &str) {
        self.say(Message::Text(kind, text.to_owned()));
    }

    fn progress(&mut self, simulation: &Simulation) {
        if self.last.is_none_or(|last| last.elapsed() >= QUANTUM) {
            self.last = Some(Instant::now());
            let rate = simulation.steps() as f64 / self.begin.elapsed().as_secs_f64().max(1e-9);
            self.say(Message::Progress(simulation.time(), simulation.scene().time.end, rate));
        }
    }
}

impl Watch for Link<'_> {
    fn trial(&mut self, what: &str) {
        self.text("trial", what);
    }
    fn go_on(&mut self) -> bool {
        Link::go_on(self)
    }
    fn settled(&mut self, auto: &AutoReport) {
        self.text("note", &auto.reason);
    }
    fn start(&mut self, _simulation: &Simulation, notes: &[String]) {
        self.begin = Instant::now();
        notes.iter().for_each(|note| self.text("note", note));
    }
    fn finding(&mut self, finding: &str) {
        self.text("finding", finding);
    }
    fn step(&mut self, simulation: &Simulation) -> bool {
        self.progress(simulation);
        Link::go_on(self)
    }
}

impl TrialWatch for Link<'_> {
    fn next(&mut self, what: &str) {
        self.text("trial", what);
    }
    fn go_on(&mut self) -> bool {
        Link::go_on(self)
    }
}

impl BenchWatch for Link<'_> {
    fn next(&mut self, what: &str, spent: f64, _left: Duration) {
        self.text("trial", what);
        self.say(Message::Progress(spent.min(1.0), 1.0, 0.0));
    }
    fn go_on(&mut self) -> bool {
        Link::go_on(self)
    }
}

/// Follows a sweep, whose points run on several threads.
pub(crate) struct SweepLink<'a>(Mutex<Link<'a>>);

impl<'a> SweepLink<'a> {
    pub(crate) fn new(link: Link<'a>) -> Self {
        Self(Mutex::new(link))
    }
}

impl SweepWatch for SweepLink<'_> {
    fn done(&self, point: usize, exit: u8, reason: &str, left: usize) {
        let why = if reason.is_empty() { String::new() } else { format!(": {reason}") };
        let text = format!("point {point}: exit code {exit}{why}; {left} left to begin");
        lock(&self.0).text("note", &text);
    }
    fn go_on(&self) -> bool {
        lock(&self.0).go_on()
    }
    fn interrupt(&self) -> Interrupt {
        lock(&self.0).interrupt()
    }
}

/// Runs `job` on the threads. Meanwhile the caller runs signal handlers and passes messages to `hear(kind, …)`. An
/// exception of either, or of a callable of the scene, asks the job to stop and is raised after it has.
pub(crate) fn supervise<T: Send>(
    py: Python<'_>,
    threads: &Threads,
    raised: &Raised,
    hear: Option<&Bound<'_, PyAny>>,
    job: impl FnOnce(Link<'_>) -> T + Send,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let (messages, inbox) = channel();
    // The mutex lets this thread release Python's lock while it waits.
    let inbox = Mutex::new(inbox);
    let link = Link { messages, stop: Arc::clone(&stop), raised, begin: Instant::now(), last: None };
    let mut failure = None;
    let result = std::thread::scope(|scope| {
        let worker = scope.spawn(|| threads.install(|| job(link)));
        loop {
            let inbox = &inbox;
            let heard = match py.detach(|| lock(inbox).recv_timeout(QUANTUM)) {
                Ok(message) => hear.map_or(Ok(()), |hear| pass_on(hear, message)),
                Err(RecvTimeoutError::Timeout) => Ok(()),
                Err(RecvTimeoutError::Disconnected) => break,
            };
            if let Err(error) = heard.and_then(|()| py.check_signals()) {
                stop.store(true, Ordering::Relaxed);
                failure.get_or_insert(error);
            }
        }
        py.detach(|| worker.join())
    });
    if let Some(error) = raised.take().or(failure) {
        return Err(error);
    }
    result.map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        errors::plain(py, "Error", &format!("a defect of the program: {}", text.unwrap_or_default()))
    })
}

fn pass_on(hear: &Bound<'_, PyAny>, message: Message) -> PyResult<()> {
    match message {
        Message::Text(kind, text) => hear.call1((kind, text)),
        Message::Progress(t, end, rate) => hear.call1(("progress", (t, end, rate))),
    }
    .map(|_| ())
}
