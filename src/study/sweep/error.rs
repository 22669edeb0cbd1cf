//! Errors that prevent a sweep.

use std::path::{Path, PathBuf};

use super::axis::MOST_POINTS;
use crate::run::RunError;
use crate::scene::Problem;

/// Error that prevents a sweep.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// No point has a valid scene; these are the problems of the first.
    #[error("no point of the sweep is a valid scene")]
    Scene(Vec<Problem>),
    /// A file cannot be read or written.
    #[error("{}: {source}", .path.display())]
    Files {
        /// The file or directory.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The output of a point cannot be written.
    #[error("point {point}: {source}")]
    Output {
        /// Number of the point.
        point: usize,
        /// The error.
        source: RunError,
    },
    /// More points than a sweep may have.
    #[error(
        "the sweep has more than {MOST_POINTS} points: use fewer values, or divide it into several sweeps"
    )]
    TooMany,
    /// A key without effect, because a later one sets the same.
    #[error("'{key}' has no effect, because '{later}' is set after it in every point: leave one of them out")]
    Overridden {
        /// The key without effect.
        key: String,
        /// The later key.
        later: String,
    },
    /// Threads cannot be started.
    #[error("cannot start threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

impl SweepError {
    pub(super) fn files(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Files { path, source }
    }
}
