//! `variational new`: writes a starter scene, and the schema by which editors complete and check its keys.

use std::fs::OpenOptions;
use std::io::{Error, ErrorKind, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;

use super::exit;
use super::say::{Say, message, out};
use crate::run::provenance::Provenance;
use crate::scene::Scene;

/// Name of the schema beside a scene.
const SCHEMA: &str = "variational.json";

#[derive(Debug, Args)]
pub(super) struct NewArguments {
    /// Path of the new scene file; the extension .toml may be left out
    scene: PathBuf,
    /// The scene to start from
    #[arg(long, value_enum, default_value_t = Starter::Beam)]
    from: Starter,
    #[command(flatten)]
    say: Say,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Starter {
    /// A rubber beam that is clamped at one end and swings under its weight
    Beam,
    /// Cloth that is held along one edge and falls
    Flag,
    /// A steel cantilever in equilibrium with a load at its end
    Static,
    /// A rubber block that falls on a floor and bounces
    Drop,
}

impl Starter {
    fn text(self) -> &'static str {
        match self {
            Self::Beam => include_str!("new/beam.toml"),
            Self::Flag => include_str!("new/flag.toml"),
            Self::Static => include_str!("new/static.toml"),
            Self::Drop => include_str!("new/drop.toml"),
        }
    }
}

#[derive(Serialize)]
struct NewReport {
    provenance: Provenance,
    scene: PathBuf,
    schema: PathBuf,
}

pub(super) fn run(arguments: &NewArguments) -> u8 {
    let mut scene = arguments.scene.clone();
    if scene.extension().is_none_or(|extension| extension != "toml") {
        scene.as_mut_os_string().push(".toml");
    }
    let schema = scene.with_file_name(SCHEMA);
    let text = arguments.from.text();
    let written = write_schema(&schema).map_err(|error| (&schema, error));
    let written = written.and_then(|()| create(&scene, text).map_err(|error| (&scene, error)));
    if let Err((path, error)) = written {
        message!("error: {}: {error}", path.display());
        let is_taken = error.kind() == ErrorKind::AlreadyExists;
        return if is_taken { exit::BAD_INPUT } else { exit::INPUT_OUTPUT };
    }
    let report = NewReport { provenance: Provenance::new(&super::run::name_of(&scene), 0), scene, schema };
    arguments.say.result(&report, || {
        let (scene, schema) = (report.scene.display(), report.schema.display());
        out!("{scene}: the scene; `variational run {scene}` runs it");
        out!("{schema}: its keys, for completion in editors with Taplo or Tombi (VS Code: Even Better TOML)");
    });
    exit::DONE
}

/// Writes a file that must not exist.
fn create(path: &Path, text: &str) -> std::io::Result<()> {
    let mut file =
        OpenOptions::new().write(true).create_new(true).open(path).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => Error::new(error.kind(), "the file exists; choose another name"),
            _ => error,
        })?;
    file.write_all(text.as_bytes())
}

/// Writes the schema of scenes; replaces that of another version.
fn write_schema(path: &Path) -> std::io::Result<()> {
    if let Some(directory) = path.parent() {
        std::fs::create_dir_all(directory)?;
    }
    let schema = Scene::schema();
    let text = format!("{schema:#}\n");
    match std::fs::read_to_string(path) {
        Ok(found) if found == text => return Ok(()),
        Ok(found) => {
            let found: Option<serde_json::Value> = serde_json::from_str(&found).ok();
            if found.is_none_or(|found| found["title"] != schema["title"]) {
                let message = "the file exists and is not a schema of scenes; choose another directory";
                return Err(Error::new(ErrorKind::AlreadyExists, message));
            }
        }
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    std::fs::write(path, text)
}
