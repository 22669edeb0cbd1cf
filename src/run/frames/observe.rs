//! Frames as an observer of a run: when they are written, and what a checkpoint keeps of them.

use super::FrameWriter;
use crate::record::{Bytes, record};
use crate::run::error::RunError;
use crate::run::observer::{Observer, Purpose, Sight};
use crate::run::report::Report;
use crate::simulation::Simulation;

/// The state of the writer: the frames that have been written.
struct Written {
    count: u64,
    /// Time and file of each. `None` in a snapshot to go back to, which keeps the first `count` frames of the writer.
    frames: Option<Vec<(f64, String)>>,
}

record!(Written { count: u64, frames: Option<Vec<(f64, String)>> });

impl Observer for FrameWriter {
    fn name(&self) -> &'static str {
        "frames"
    }

    fn see(&mut self, sight: &Sight<'_>) -> Result<(), RunError> {
        if let Sight::Frame(simulation) = sight {
            self.write(simulation)?;
        }
        Ok(())
    }

    fn snapshot(&self, purpose: Purpose) -> Bytes {
        let frames = (purpose == Purpose::Resume).then(|| self.frames().to_vec());
        Bytes::of(&Written { count: self.count() as u64, frames })
    }

    fn restore(&mut self, snapshot: &Bytes) -> Result<(), RunError> {
        let Written { count, frames } = snapshot.value()?;
        match frames {
            Some(frames) => self.resume(&frames)?,
            None => self.truncate(count as usize)?,
        }
        Ok(())
    }

    fn report(&self, _: &Simulation, report: &mut Report) {
        report.frames = self.count();
    }
}
