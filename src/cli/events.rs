//! Progress as lines of JSON on standard output (`--progress json`), for programs that start the command.
//! docs/files.md describes the lines.

use std::path::Path;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::say::out;
use super::signals::Stop;
use crate::auto::AutoReport;
use crate::run::Watch;
use crate::simulation::{Observation, Simulation};

/// Shortest time between two lines of the same kind, except for frames and at the end.
const PAUSE: Duration = Duration::from_millis(100);

/// A line. Lengths are in m, times in s, energies in J.
#[derive(Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event<'a> {
    Trial {
        text: &'a str,
    },
    Note {
        text: &'a str,
    },
    Start {
        directory: &'a Path,
        bodies: usize,
        nodes: usize,
        elements: usize,
        steps: u64,
        end: f64,
    },
    Step {
        step: u64,
        t: f64,
    },
    Energy {
        step: u64,
        t: f64,
        kinetic: f64,
        elastic: f64,
        gravity: f64,
        load: f64,
        contact: f64,
        total: f64,
    },
    Frame {
        t: f64,
        file: &'a Path,
    },
    End {
        exit_code: u8,
    },
}

fn write(event: &Event<'_>) {
    // Text and numbers can always be written as JSON.
    if let Ok(line) = serde_json::to_string(event) {
        out!("{line}");
    }
}

/// Writes the last line of a command.
pub(super) fn end(exit_code: u8) {
    write(&Event::End { exit_code });
}

/// Writes the progress of a run, and stops it after a signal.
pub(super) struct Events<'a> {
    directory: &'a Path,
    stop: Stop,
    /// Number of steps of the whole run.
    steps: u64,
    last_step: Option<Instant>,
    last_row: Option<Instant>,
}

impl<'a> Events<'a> {
    pub(super) fn new(directory: &'a Path, stop: Stop) -> Self {
        Self { directory, stop, steps: 0, last_step: None, last_row: None }
    }
}

/// Returns whether a line is due, and remembers the time of one that is.
fn is_due(last: &mut Option<Instant>) -> bool {
    let is_due = last.is_none_or(|last| last.elapsed() >= PAUSE);
    if is_due {
        *last = Some(Instant::now());
    }
    is_due
}

impl Watch for Events<'_> {
    fn trial(&mut self, what: &str) {
        write(&Event::Trial { text: what });
    }

    fn go_on(&mut self) -> bool {
        !self.stop.is_asked()
    }

    fn settled(&mut self, auto: &AutoReport) {
        write(&Event::Note { text: &auto.reason });
    }

    fn start(&mut self, simulation: &Simulation, notes: &[String]) {
        self.steps = simulation.step_count();
        for text in notes {
            write(&Event::Note { text });
        }
        let bodies = simulation.bodies();
        write(&Event::Start {
            directory: self.directory,
            bodies: bodies.len(),
            nodes: bodies.iter().map(|body| body.mesh.points.len()).sum(),
            elements: bodies.iter().map(|body| body.element_count()).sum(),
            steps: self.steps,
            end: simulation.scene().time.end,
        });
    }

    fn finding(&mut self, finding: &str) {
        write(&Event::Note { text: finding });
    }

    fn row(&mut self, step: u64, seen: &Observation) {
        if is_due(&mut self.last_row) || step == self.steps {
            let Observation { t, kinetic, elastic, gravity, load, contact, .. } = *seen;
            let total = seen.total();
            write(&Event::Energy { step, t, kinetic, elastic, gravity, load, contact, total });
        }
    }

    fn frame(&mut self, t: f64, file: &Path) {
        write(&Event::Frame { t, file });
    }

    fn step(&mut self, simulation: &Simulation) -> bool {
        if is_due(&mut self.last_step) || simulation.is_done() {
            write(&Event::Step { step: simulation.steps(), t: simulation.time() });
        }
        !self.stop.is_asked()
    }
}
