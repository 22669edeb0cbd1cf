//! The state of a run between two steps, from which it continues bit for bit: the simulation and the snapshots of all
//! observers. `store.rs` manages the files.
//!
//! A file is a sealed record (`record.rs`). The seal is the same in all formats, so that every version recognises a
//! file of a newer one.

mod store;

use std::path::{Path, PathBuf};

use serde_json::Value;
use vi_mesh::Mesh;

use crate::record::{self, Bytes, Damage, record};
use crate::scene::{Scene, SchemeName};
use crate::simulation::Snapshot;
pub use store::{Found, newest};
pub(crate) use store::{Store, is_file_name};

const MAGIC: &[u8; 8] = b"VI-CHECK";
/// Number of the format; increased with every change of the record.
const FORMAT: u64 = 19;

/// Error that prevents a run from continuing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// There is no checkpoint.
    #[error(
        "{}: no checkpoint here; a scene writes them with [checkpoint] interval = …; run it again", .directory.display()
    )]
    None {
        /// The directory.
        directory: PathBuf,
    },
    /// Every checkpoint is damaged.
    #[error("{}: every checkpoint is damaged: {}; run the scene again", .directory.display(), .damages.join("; "))]
    Damaged {
        /// The directory.
        directory: PathBuf,
        /// The damage of each checkpoint.
        damages: Vec<String>,
    },
    /// A newer version of the program wrote the newest checkpoint.
    #[error(
        "{}: a newer version of this program has written it (format {format}; this version reads format {FORMAT}); \
         resume with that version",
        .path.display()
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// Format version of the file.
        format: u64,
    },
    /// The scene or a mesh differs from the one that was run.
    #[error("{what} has changed since the checkpoint: {how}; bring back what was run, or run it anew")]
    Changed {
        /// The scene, or a mesh.
        what: String,
        /// The first difference.
        how: String,
    },
    /// The state does not match the scene.
    #[error("the checkpoint does not fit its scene: {0}")]
    Unfit(String),
    /// A file cannot be read.
    #[error("{}: {source}", .path.display())]
    Read {
        /// The file or directory.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
}

/// Identity of the run: enough to find its scene again, and to recognise it.
#[derive(Debug, Clone, PartialEq)]
pub struct Origin {
    /// Version of the program.
    pub program: String,
    /// Name of the scene.
    pub name: String,
    /// The scene file, if there was one, and the keys that were set in it.
    pub file: Option<(PathBuf, Vec<String>)>,
    /// The scene's text, as [`scene_text`] gives it.
    pub scene: String,
    /// The files that the scene reads, meshes first, and the CRC-32 of their bytes.
    pub meshes: Vec<(PathBuf, u64)>,
    /// Scheme, stages (0: unset) and number of steps that `auto` chose.
    pub(crate) choice: Option<(String, (u64, u64))>,
    /// The report of `auto`, as JSON.
    pub(crate) auto: String,
}

/// The snapshots of the observers of a run, by name.
pub(crate) type Snapshots = Vec<(String, Bytes)>;

/// A run between two steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// Identity of the run.
    pub origin: Origin,
    pub(crate) simulation: Snapshot,
    /// Bytes of history.csv at this point.
    pub(crate) history_bytes: u64,
    pub(crate) observers: Snapshots,
    /// The last state to which the energy guard can go back. It is stored, because an extra checkpoint between two regular ones
    /// must not change it.
    pub(crate) good: Option<(Snapshot, Snapshots)>,
    /// Notes made during the run, e.g. on limit points.
    pub(crate) findings: Vec<String>,
    /// Seconds spent so far on set-up, stepping and output.
    pub(crate) seconds: [f64; 3],
}

record!(Origin {
    program: String,
    name: String,
    file: Option<(PathBuf, Vec<String>)>,
    scene: String,
    meshes: Vec<(PathBuf, u64)>,
    choice: Option<(String, (u64, u64))>,
    auto: String,
});
record!(Checkpoint {
    origin: Origin,
    simulation: Snapshot,
    history_bytes: u64,
    observers: Snapshots,
    good: Option<(Snapshot, Snapshots)>,
    findings: Vec<String>,
    seconds: [f64; 3],
});

impl Checkpoint {
    /// Returns the number of steps made.
    pub fn steps(&self) -> u64 {
        self.simulation.steps()
    }

    /// Encodes the checkpoint as the bytes of its file.
    pub fn encode(&self) -> Vec<u8> {
        record::seal(MAGIC, FORMAT, self)
    }

    /// Decodes the bytes of a file.
    ///
    /// # Errors
    /// Returns [`Damage`] if they differ from those that were written.
    pub fn decode(bytes: &[u8]) -> Result<Self, Damage> {
        record::unseal(MAGIC, FORMAT, bytes)
    }
}

impl Origin {
    /// Returns the identity of the current run.
    ///
    /// # Errors
    /// Returns an error if a mesh cannot be read again.
    pub(crate) fn new(scene: &Scene, name: &str) -> Result<Self, CheckpointError> {
        Ok(Self {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            name: name.to_owned(),
            file: None,
            scene: scene_text(scene),
            meshes: mesh_sums(scene)?,
            choice: None,
            auto: String::new(),
        })
    }

    /// Checks that `scene` is the one that was run.
    ///
    /// # Errors
    /// Returns [`CheckpointError::Changed`] with the difference, or an error if a mesh cannot be read.
    pub fn check(&self, scene: &Scene) -> Result<(), CheckpointError> {
        let text = scene_text(scene);
        if text != self.scene {
            let mut pairs = self.scene.lines().zip(text.lines());
            let how = match pairs.find(|(old, new)| old != new) {
                Some((old, new)) => format!("`{}` was `{}`", new.trim(), old.trim()),
                None => "keys were added or taken out at its end".to_owned(),
            };
            return Err(CheckpointError::Changed { what: "the scene".to_owned(), how });
        }
        for ((mesh, old), (_, new)) in self.meshes.iter().zip(mesh_sums(scene)?) {
            if *old != new {
                let how = format!("its checksum is {new:08x}, was {old:08x}");
                return Err(CheckpointError::Changed { what: mesh.display().to_string(), how });
            }
        }
        Ok(())
    }

    /// Reads the scene of the run again: from its file, or from the checkpoint if there is no file (any more).
    ///
    /// # Errors
    /// Returns [`CheckpointError::Read`] if the file exists and cannot be read.
    #[cfg(feature = "cli")]
    pub fn read_scene(&self) -> Result<crate::scene::Parsed, CheckpointError> {
        match &self.file {
            Some((file, overrides)) if file.exists() => Scene::read(file, overrides)
                .map_err(|source| CheckpointError::Read { path: file.clone(), source }),
            _ => Ok(self.parse()),
        }
    }

    /// Parses the recorded scene.
    #[cfg(feature = "cli")]
    pub(super) fn parse(&self) -> crate::scene::Parsed {
        let mut parsed = Scene::parse(&self.scene, &[]);
        // The text cannot represent paths that are not UTF-8.
        let mut paths = self.meshes.iter().map(|(path, _)| path);
        if let Some(scene) = &mut parsed.scene {
            scene.for_each_file(|file| {
                if let Some(path) = paths.next() {
                    file.clone_from(path);
                }
            });
        }
        parsed
    }

    /// Returns the account of the choice that `auto` made, for report.json; null without one.
    ///
    /// # Errors
    /// Returns [`CheckpointError::Unfit`] if it is no JSON.
    pub(crate) fn account_of_auto(&self) -> Result<Value, CheckpointError> {
        if self.auto.is_empty() {
            return Ok(Value::Null);
        }
        let account = serde_json::from_str(&self.auto);
        account.map_err(|error| CheckpointError::Unfit(format!("its account of `auto`: {error}")))
    }

    /// Returns the scene with the choice that `auto` made.
    pub(crate) fn settle(&self, mut scene: Scene) -> Result<Scene, CheckpointError> {
        if let Some((name, (stages, steps))) = &self.choice {
            let scheme: SchemeName = serde_json::from_value(name.as_str().into())
                .map_err(|error| CheckpointError::Unfit(error.to_string()))?;
            let stages = (*stages > 0).then_some(*stages as usize);
            scene.time.choose(scheme, stages, (*steps).max(1));
        }
        Ok(scene)
    }
}

/// Returns a text that is equal for equal scenes, with absolute paths to the files that it reads.
pub fn scene_text(scene: &Scene) -> String {
    let scene = scene.clone().with_absolute_paths();
    #[cfg(feature = "cli")]
    if let Ok(text) = scene.to_toml() {
        return text;
    }
    format!("{scene:#?}")
}

fn mesh_sums(scene: &Scene) -> Result<Vec<(PathBuf, u64)>, CheckpointError> {
    let scene = scene.clone().with_absolute_paths();
    let sum = |path: &Path| match std::fs::read(path) {
        Ok(bytes) => Ok((path.to_owned(), u64::from(crc32fast::hash(&bytes)))),
        Err(source) => Err(CheckpointError::Read { path: path.to_owned(), source }),
    };
    let files = scene.files().into_iter().map(|(_, path)| sum(path));
    let arrays = scene.bodies.iter().filter_map(|body| {
        let name = PathBuf::from(format!("the mesh from arrays of body '{}'", body.name));
        Some(Ok((name, array_sum(body.arrays.as_ref()?))))
    });
    files.chain(arrays).collect()
}

/// Returns the CRC-32 of the points and cells of a mesh.
fn array_sum(mesh: &Mesh) -> u64 {
    let mut sum = crc32fast::Hasher::new();
    mesh.points.as_flattened().iter().for_each(|x| sum.update(&x.to_le_bytes()));
    for block in &mesh.blocks {
        sum.update(block.kind.name().as_bytes());
        block.nodes.iter().for_each(|node| sum.update(&node.to_le_bytes()));
    }
    u64::from(sum.finalize())
}

#[cfg(test)]
mod tests;
