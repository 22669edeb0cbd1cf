//! Errors that end a run early.

use std::io;
use std::path::{Path, PathBuf};

use vi_solvers::StepError;

use crate::auto::SettleError;
use crate::record::Damage;
use crate::run::checkpoint::CheckpointError;
use crate::run::claim::ClaimError;
use crate::scene::Problem;

/// Error that ends a run early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The scene or its meshes are wrong.
    #[error("{}", list(.0))]
    Scene(Vec<Problem>),
    /// A step failed; results up to it are written.
    #[error("step {step}: {source}")]
    Step {
        /// The step that failed, from 1.
        step: u64,
        /// The cause.
        source: StepError,
    },
    /// The energy guard ended the run; results up to it are written.
    #[error(
        "step {step}: the energy guard ends the run at t = {t} s: the energy grew by {joules:.3e} J without a source, \
         {relative:.2e} of the energy exchanged ({bound:e} is allowed){after}"
    )]
    Guard {
        /// The last step made.
        step: u64,
        /// Time of the row, s.
        t: f64,
        /// Growth, J.
        joules: f64,
        /// Growth relative to the energy exchange.
        relative: f64,
        /// Bound allowed.
        bound: f64,
        /// Remedies tried, for the message; may be empty.
        after: &'static str,
    },
    /// The state exceeds the range of the numbers in frames: the run has become unstable. Results up to it are written.
    #[error("step {step}: the state has grown beyond all bounds: {source}")]
    Beyond {
        /// The last step made.
        step: u64,
        /// The value that is out of range.
        source: vi_io::IoError,
    },
    /// A file could not be written.
    #[error("{}: {source}", .path.display())]
    Output {
        /// The file or directory.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Another process writes into the directory, or it cannot be written to.
    #[error(transparent)]
    Claim(#[from] ClaimError),
    /// The directory holds an unfinished run of another scene.
    #[error(
        "{}: the run of '{name}' in this directory has not ended: continue it with `variational resume {}`, or delete \
         its checkpoints, or choose another directory with --out",
        .directory.display(), .directory.display()
    )]
    Unfinished {
        /// The directory.
        directory: PathBuf,
        /// The other scene.
        name: String,
    },
    /// Elements of a parted mesh could not be read during the run.
    #[error("{0}")]
    Mesh(String),
    /// A mesh file could not be written.
    #[error(transparent)]
    Frame(#[from] vi_io::IoError),
    /// The caller asked to stop before there was anything to write: in the trials of scheme `auto`, or in a search for modes.
    #[error("stopped on request, before there was a result; nothing was written")]
    Stopped,
    /// There is no checkpoint, or it does not match.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

impl RunError {
    /// Returns whether the motion failed, rather than a file operation.
    pub fn is_failure(&self) -> bool {
        matches!(self, Self::Step { .. } | Self::Guard { .. } | Self::Beyond { .. })
    }

    /// Returns a function that converts an error in writing `path`.
    pub(super) fn output(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Output { path, source }
    }
}

impl From<Damage> for RunError {
    fn from(damage: Damage) -> Self {
        Self::Checkpoint(CheckpointError::Unfit(damage.to_string()))
    }
}

impl From<SettleError> for RunError {
    fn from(error: SettleError) -> Self {
        match error {
            SettleError::Scene(problems) => Self::Scene(problems),
            SettleError::Stopped => Self::Stopped,
        }
    }
}

fn list(problems: &[Problem]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}
