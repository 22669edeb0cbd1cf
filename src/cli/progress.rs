//! Progress of a run: a bar with the remaining time on a terminal, plain lines in a pipe.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressStyle};

use super::say::{self, message};
use super::signals::Stop;
use super::summary::counted;
use crate::auto::AutoReport;
use crate::run::Watch;
use crate::run::explain::explain;
use crate::simulation::Simulation;

/// Shows the progress of a run on the terminal, and stops it after a signal.
pub(super) struct Progress {
    quiet: bool,
    explain: bool,
    stop: Stop,
    bar: Option<ProgressBar>,
    tenths: u64,
}

impl Progress {
    pub(super) fn new(quiet: bool, explain: bool, stop: Stop) -> Self {
        Self { quiet, explain, stop, bar: None, tenths: 0 }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Watch for Progress {
    fn trial(&mut self, what: &str) {
        if !self.quiet {
            message!("{what}");
        }
    }

    fn go_on(&mut self) -> bool {
        !self.stop.is_asked()
    }

    fn settled(&mut self, auto: &AutoReport) {
        if !self.quiet {
            message!("{}", auto.reason);
        }
    }

    fn start(&mut self, simulation: &Simulation, notes: &[String]) {
        for note in notes {
            message!("note: {note}");
        }
        if self.explain {
            say::write_message(format_args!("{}", explain(simulation)));
        }
        if self.quiet {
            return;
        }
        let elements: usize = simulation.bodies().iter().map(|body| body.element_count()).sum();
        let nodes: usize = simulation.bodies().iter().map(|body| body.mesh.points.len()).sum();
        let steps = simulation.step_count();
        let steps = match &simulation.scene().statics {
            Some(_) => counted(steps, "load step", "load steps"),
            None => {
                let is_adaptive = simulation.scene().time.is_adaptive();
                let what = if is_adaptive { "intervals of adaptive steps, each of" } else { "steps of" };
                format!("{steps} {what} {:.4e} s by {}", simulation.step_size(), simulation.method().name())
            }
        };
        let bodies = counted(simulation.bodies().len() as u64, "body", "bodies");
        message!("{bodies}, {nodes} nodes, {elements} elements; {steps}");
        if std::io::stderr().is_terminal() {
            let style =
                ProgressStyle::with_template("{bar:40} {percent:>3} %  {pos}/{len}  {per_sec}  left {eta}");
            let bar = ProgressBar::new(simulation.step_count());
            self.bar = Some(match style {
                Ok(style) => bar.with_style(style),
                Err(_) => bar,
            });
        }
    }

    fn finding(&mut self, finding: &str) {
        match &self.bar {
            Some(bar) => bar.println(format!("note: {finding}")),
            None => message!("note: {finding}"),
        }
    }

    fn step(&mut self, simulation: &Simulation) -> bool {
        let (steps, count) = (simulation.steps(), simulation.step_count());
        if let Some(bar) = &self.bar {
            // The bar is not updated at every step, because a step can be shorter than the lock of the bar.
            if steps.is_multiple_of(16) || steps == count {
                bar.set_position(steps);
            }
        } else if !self.quiet && steps * 10 / count > self.tenths {
            self.tenths = steps * 10 / count;
            message!("{:3} %  t = {:.6e} s", self.tenths * 10, simulation.time());
        }
        !self.stop.is_asked()
    }
}
