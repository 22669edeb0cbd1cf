//! `variational modes`.

use std::path::PathBuf;

use clap::Args;

use super::exit;
use super::run::{accept, code_of, name_of, output_directory};
use super::say::{message, out};
use crate::scene::MassKind;
use crate::vibration::write_modes;

#[derive(Debug, Args)]
pub(super) struct ModesArguments {
    /// The scene file; with [static] the modes are those of the loaded body
    scene: PathBuf,
    /// How many modes of each body, rigid ones included
    #[arg(long, default_value_t = 12)]
    count: usize,
    /// Use lumped mass, whatever `solver.mass` of the scene says (default: consistent)
    #[arg(long)]
    lumped: bool,
    /// Output directory (default: the scene's, else out/<scene>)
    #[arg(long, value_name = "DIRECTORY")]
    out: Option<PathBuf>,
    /// Set a key of the scene, e.g. time.step=0.01
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
}

pub(super) fn modes(arguments: &ModesArguments) -> u8 {
    let scene = match accept(&arguments.scene, &arguments.overrides) {
        Ok((scene, _)) => scene,
        Err(code) => return code,
    };
    let directory = output_directory(&scene, &name_of(&arguments.scene), arguments.out.as_deref());
    let mass = arguments.lumped.then_some(MassKind::Lumped);
    match write_modes(scene, &directory, arguments.count, mass) {
        Ok(modes) => {
            for (number, found) in modes.iter().enumerate() {
                let mode = &found.mode;
                let name = match (mode.is_rigid, mode.omega_squared < 0.0) {
                    (true, _) => "  rigid",
                    (false, true) => "  unstable",
                    (false, false) => "",
                };
                out!("{number:4} {:16.9} Hz{name}", mode.frequency());
            }
            out!("written to {}", directory.display());
            exit::DONE
        }
        Err(error) => {
            message!("error: {error}");
            code_of(&error)
        }
    }
}
