//! Options and checks shared by the studies of a scene (`bench`, `convergence`).

use std::path::{Path, PathBuf};

use clap::Args;

use super::exit;
use super::run::{accept, name_of, thread_pool, writable};
use super::say::{Say, message};
use crate::run::claim::Claim;
use crate::scene::{Parsed, Scene};

#[derive(Debug, Args)]
pub(super) struct StudyArguments {
    /// The scene file
    pub(super) scene: PathBuf,
    /// Output directory (default: out/<scene>-<command>; for modes the scene's, else out/<scene>)
    #[arg(long, value_name = "DIRECTORY")]
    out: Option<PathBuf>,
    /// Set a key of the scene, e.g. time.end=0.5
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Threads (default: one a core)
    #[arg(long)]
    threads: Option<usize>,
    #[command(flatten)]
    pub(super) say: Say,
}

/// A study that may begin.
pub(super) struct Study {
    pub(super) scene: Scene,
    pub(super) parsed: Parsed,
    pub(super) pool: rayon::ThreadPool,
    /// The scene file's name without its ending.
    pub(super) name: String,
    pub(super) directory: PathBuf,
    /// Nobody else writes into the directory while the study lasts.
    pub(super) claim: Claim,
}

impl StudyArguments {
    /// Accepts the scene, the threads and the output directory of `command`, or says what is wrong.
    pub(super) fn open(&self, command: &str) -> Result<Study, u8> {
        self.open_in(|_, name| Path::new("out").join(format!("{name}-{command}")))
    }

    /// Returns the options with an output directory next to the scene, if none is given.
    pub(super) fn open_in(&self, default: impl Fn(&Scene, &str) -> PathBuf) -> Result<Study, u8> {
        let (scene, parsed) = accept(&self.scene, &self.overrides)?;
        let pool = thread_pool(self.threads)?;
        let name = name_of(&self.scene);
        let directory = self.out.clone().unwrap_or_else(|| default(&scene, &name));
        if let Err(error) = writable(&directory) {
            message!(
                "error: {}: output directory not writable: {error}; choose another with --out",
                directory.display()
            );
            return Err(exit::BAD_INPUT);
        }
        let claim = Claim::new(&directory).map_err(|error| {
            message!("error: {error}");
            exit::BAD_INPUT
        })?;
        Ok(Study { scene, parsed, pool, name, directory, claim })
    }
}
