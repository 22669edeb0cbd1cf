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
    /// Number of threads (default: one per core)
    #[arg(long)]
    threads: Option<usize>,
    #[command(flatten)]
    pub(super) say: Say,
}

/// A study that is ready to start.
pub(super) struct Study {
    pub(super) scene: Scene,
    pub(super) parsed: Parsed,
    pub(super) pool: rayon::ThreadPool,
    /// Name of the scene file without its extension.
    pub(super) name: String,
    pub(super) directory: PathBuf,
    /// Claim that prevents others from writing into the directory during the study.
    pub(super) claim: Claim,
}

impl StudyArguments {
    /// Checks the scene, the threads and the output directory of `command`; prints the problems.
    pub(super) fn open(&self, command: &str) -> Result<Study, u8> {
        self.open_in(|_, name| Path::new("out").join(format!("{name}-{command}")))
    }

    /// Returns the study with an output directory next to the scene, if none is given.
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
