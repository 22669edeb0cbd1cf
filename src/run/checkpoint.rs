//! A run between two steps as one value, from which it continues bit for bit, and the bytes of its file.
//! It must not know how a run steps, nor where files lie: that is `store.rs`.
//!
//! A file is: 8 bytes of magic, the format's number, the length of the record, the record
//! (`record.rs`), and the CRC-32 of all before it. Numbers are little-endian, reals 64 bits. Only the record changes
//! from format to format, so that every version knows a file of a newer one.

mod store;

use std::path::{Path, PathBuf};

pub use crate::record::Damage;
use crate::record::{Record, Source, record};
use crate::run::Course;
use crate::run::estimate::{Companions, ProbeEstimate};
use crate::run::guard::GuardEvent;
use crate::scene::{Scene, SchemeName};
use crate::simulation::Snapshot;
pub use store::{Found, newest};
pub(crate) use store::{Store, is_file_name};

const MAGIC: &[u8; 8] = b"VI-CHECK";
/// Changes with every change of the record.
const FORMAT: u64 = 4;

/// Why a run cannot continue.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// There is nothing to continue from.
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
        /// What is wrong with each.
        damages: Vec<String>,
    },
    /// The newest checkpoint is of a newer version of the program.
    #[error(
        "{}: a newer version of this program has written it (format {format}; this version reads format {FORMAT}); \
         resume with that version",
        .path.display()
    )]
    Newer {
        /// The checkpoint.
        path: PathBuf,
        /// Its format.
        format: u64,
    },
    /// The scene or a mesh is not the one that was run.
    #[error("{what} has changed since the checkpoint: {how}; bring back what was run, or run it anew")]
    Changed {
        /// The scene, or a mesh.
        what: String,
        /// The first difference.
        how: String,
    },
    /// The state does not fit the scene.
    #[error("the checkpoint does not fit its scene: {0}")]
    Unfit(String),
    /// A file cannot be read.
    #[error("{}: {source}", .path.display())]
    Read {
        /// The file or directory.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
}

/// What was run: enough to find the scene again, and to know it.
#[derive(Debug, Clone, PartialEq)]
pub struct Origin {
    /// Version of the program.
    pub program: String,
    /// Name of the scene.
    pub name: String,
    /// The scene file, if there was one, and what was set in it.
    pub file: Option<(PathBuf, Vec<String>)>,
    /// The scene's text, as [`scene_text`] gives it.
    pub scene: String,
    /// The files that the scene reads, meshes first, and the CRC-32 of their bytes.
    pub meshes: Vec<(PathBuf, u64)>,
    /// Scheme, stages (0: none) and number of steps that `auto` has chosen.
    pub(crate) choice: Option<(String, (u64, u64))>,
    /// Why, as JSON.
    pub(crate) auto: String,
}

/// A run between two steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// What was run.
    pub origin: Origin,
    pub(crate) simulation: Snapshot,
    pub(crate) companions: Companions,
    pub(crate) course: Course,
    pub(crate) pitch: (Vec<f64>, Vec<Vec<f64>>),
    pub(crate) estimates: Vec<ProbeEstimate>,
    pub(crate) events: Vec<GuardEvent>,
    pub(crate) frames: Vec<(f64, String)>,
    /// What was found on the way, e.g. limit points.
    pub(crate) findings: Vec<String>,
    /// Seconds of set-up, stepping, output and estimating so far.
    pub(crate) seconds: [f64; 4],
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
    companions: Companions,
    course: Course,
    pitch: (Vec<f64>, Vec<Vec<f64>>),
    estimates: Vec<ProbeEstimate>,
    events: Vec<GuardEvent>,
    frames: Vec<(f64, String)>,
    findings: Vec<String>,
    seconds: [f64; 4],
});

impl Checkpoint {
    /// Steps made.
    pub fn steps(&self) -> u64 {
        self.simulation.steps()
    }

    /// The bytes of its file.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        FORMAT.write(&mut bytes);
        let mut body = Vec::new();
        self.write(&mut body);
        (body.len() as u64).write(&mut bytes);
        bytes.append(&mut body);
        let sum = crc32fast::hash(&bytes);
        bytes.extend_from_slice(&sum.to_le_bytes());
        bytes
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`Damage`] where they are not those that were written.
    pub fn decode(bytes: &[u8]) -> Result<Self, Damage> {
        let damage = |what: &str| Damage { at: 0, what: what.to_owned() };
        let (head, sum) = bytes.split_at_checked(bytes.len().wrapping_sub(4)).ok_or(damage("it is empty"))?;
        let Some(head_rest) = head.strip_prefix(MAGIC) else {
            return Err(damage("it is no checkpoint"));
        };
        let mut source = Source::new(head_rest);
        let format = u64::read(&mut source)?;
        if format != FORMAT {
            return Err(damage(&format!(
                "it has format {format}, this version of the program reads {FORMAT}"
            )));
        }
        let length = u64::read(&mut source)?;
        if length != source.left() as u64 {
            return Err(damage(&format!("{length} bytes were written, {} are there", source.left())));
        }
        if crc32fast::hash(head).to_le_bytes() != sum {
            return Err(damage("its checksum is wrong"));
        }
        let checkpoint = Self::read(&mut source)?;
        if source.left() > 0 {
            return Err(source.damage("there is more than one record"));
        }
        Ok(checkpoint)
    }
}

/// The format of a checkpoint file, if its bytes are those that were written.
fn format_of(bytes: &[u8]) -> Option<u64> {
    let (head, sum) = bytes.split_at_checked(bytes.len().checked_sub(4)?)?;
    let mut source = Source::new(head.strip_prefix(MAGIC)?);
    (crc32fast::hash(head).to_le_bytes() == sum).then(|| u64::read(&mut source).ok()).flatten()
}

impl Origin {
    /// What is run now.
    ///
    /// # Errors
    /// Where a mesh cannot be read again.
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

    /// Is this what `scene` would run? Otherwise, what differs.
    ///
    /// # Errors
    /// [`CheckpointError::Changed`], or where a mesh cannot be read.
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

    /// The scene as it was run.
    #[cfg(feature = "cli")]
    pub(crate) fn parse(&self) -> crate::scene::Parsed {
        let mut parsed = Scene::parse(&self.scene, &[]);
        // Text cannot hold paths that are not UTF-8.
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

    /// The scene with what `auto` had chosen.
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

/// A scene in words that are the same for equal scenes, with absolute paths to the files that it reads.
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
    scene.files().into_iter().map(|(_, path)| sum(path)).collect()
}

#[cfg(test)]
mod tests;
