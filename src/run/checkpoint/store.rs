//! Manages the checkpoint files of a directory: each is complete or absent, the newest few are kept, and the newest
//! undamaged one is found.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::{Checkpoint, CheckpointError, FORMAT, MAGIC};
use crate::record::format_of;
use crate::scene::Checkpoints;

const PREFIX: &str = "checkpoint_";
const ENDING: &str = ".vck";

/// The directory and the interval of checkpoints.
pub(crate) struct Store {
    directory: PathBuf,
    interval: f64,
    keep: usize,
}

impl Store {
    pub(crate) fn new(directory: &Path, rule: &Checkpoints) -> Self {
        let keep = usize::try_from(rule.keep).unwrap_or(usize::MAX);
        Self { directory: directory.to_owned(), interval: rule.interval, keep }
    }

    /// Returns whether the end of step `steps`, of h (s) each, is the nearest to a multiple of the interval.
    pub(crate) fn is_due(&self, steps: u64, h: f64) -> bool {
        let count = |steps: f64| (steps * h / self.interval).floor();
        count(steps as f64 + 0.5) > count(steps as f64 - 0.5)
    }

    /// Writes a checkpoint through a temporary file. On return it is on disk under its name, and all but the newest few
    /// are removed.
    pub(crate) fn write(&self, checkpoint: &Checkpoint) -> io::Result<()> {
        let path = self.directory.join(format!("{PREFIX}{:012}{ENDING}", checkpoint.steps()));
        let temporary = path.with_extension("vck.tmp");
        let written = (|| {
            let mut file = File::create(&temporary)?;
            file.write_all(&checkpoint.encode())?;
            file.sync_all()?;
            drop(file);
            if path.is_dir() {
                // A directory that has the name of the checkpoint is moved aside with its contents.
                fs::rename(&path, path.with_extension("vck.moved"))?;
            }
            fs::rename(&temporary, &path)?;
            sync_directory(&self.directory)
        })();
        if let Err(error) = written {
            // The first error is the one to report; the temporary file may not even exist.
            let _ = fs::remove_file(&temporary);
            return Err(error);
        }
        let mut all = files(&self.directory)?;
        all.retain(|path| !path.is_dir());
        for old in &all[..all.len().saturating_sub(self.keep)] {
            fs::remove_file(old)?;
        }
        Ok(())
    }
}

/// Syncs a directory, so that its entries are on disk. Only Unix can do that.
fn sync_directory(directory: &Path) -> io::Result<()> {
    if cfg!(unix) { File::open(directory)?.sync_all() } else { Ok(()) }
}

/// Lists the entries of a directory that are named like checkpoints, the oldest first.
fn files(directory: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        if entry.file_name().to_str().is_some_and(is_file_name) {
            found.push(entry.path());
        }
    }
    found.sort();
    Ok(found)
}

/// Returns whether a file name is that of a checkpoint.
pub(crate) fn is_file_name(file: &str) -> bool {
    let digits = file.strip_prefix(PREFIX).and_then(|rest| rest.strip_suffix(ENDING));
    digits.is_some_and(|digits| digits.len() >= 12 && digits.bytes().all(|byte| byte.is_ascii_digit()))
}

/// The newest undamaged checkpoint of a directory.
#[derive(Debug)]
pub struct Found {
    /// The checkpoint.
    pub checkpoint: Checkpoint,
    /// File of the checkpoint.
    pub path: PathBuf,
    /// Newer checkpoints that cannot be used, with the reason.
    pub damages: Vec<String>,
}

/// Finds the newest undamaged checkpoint of a directory. Its history.csv must reach the step of that checkpoint.
///
/// # Errors
/// Returns [`CheckpointError`] if there is none, or if a newer version of this program wrote a newer one.
pub fn newest(directory: &Path) -> Result<Found, CheckpointError> {
    if !directory.is_dir() {
        return Err(CheckpointError::None { directory: directory.to_owned() });
    }
    let unread = |path: &Path, source| CheckpointError::Read { path: path.to_owned(), source };
    let all = files(directory).map_err(|source| unread(directory, source))?;
    let history = fs::metadata(directory.join("history.csv")).map_or(0, |facts| facts.len());
    let mut damages = Vec::new();
    for path in all.into_iter().rev() {
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => {
                damages.push(format!("{}: {error}", path.display()));
                continue;
            }
        };
        if let Some(format) = format_of(MAGIC, &bytes).filter(|&format| format > FORMAT) {
            return Err(CheckpointError::Newer { path, format });
        }
        let why = match Checkpoint::decode(&bytes) {
            Ok(checkpoint) if checkpoint.history_bytes <= history => {
                return Ok(Found { checkpoint, path, damages });
            }
            Ok(_) => "history.csv ends before it".to_owned(),
            Err(damage) => damage.to_string(),
        };
        damages.push(format!("{}: {why}", path.display()));
    }
    let directory = directory.to_owned();
    Err(if damages.is_empty() {
        CheckpointError::None { directory }
    } else {
        CheckpointError::Damaged { directory, damages }
    })
}
