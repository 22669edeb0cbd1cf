//! `variational part`: parses arguments and prints the files of a parted mesh.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use vi_io::IoError;

use super::exit;
use super::say::{Say, message, out};
use crate::model::pieces::{PartError, part};
use crate::run::provenance::Provenance;

#[derive(Debug, Args)]
pub(super) struct PartArguments {
    /// A mesh file of volumes of one kind (tet4, hex8 or wedge6)
    mesh: PathBuf,
    /// Number of pieces; as many as ranks, or some times more, so that a rank reads little that it does not need
    #[arg(long)]
    parts: usize,
    /// Factor of all coordinates, for example 1e-3 for a mesh in millimetres
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// The index, which scenes give as `mesh`; the pieces are written beside it [default: the mesh, ending in .parted]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    say: Say,
}

#[derive(Serialize)]
struct PartReport {
    provenance: Provenance,
    index: PathBuf,
    element: &'static str,
    elements: usize,
    nodes: usize,
    files: Vec<PathBuf>,
}

pub(super) fn run(arguments: &PartArguments) -> u8 {
    if !arguments.scale.is_finite() || arguments.scale <= 0.0 {
        message!("error: --scale {} must be a positive number", arguments.scale);
        return exit::BAD_INPUT;
    }
    let index = arguments.out.clone().unwrap_or_else(|| arguments.mesh.with_extension("parted"));
    let facts = match part(&arguments.mesh, arguments.parts, arguments.scale, &index) {
        Ok(facts) => facts,
        Err(error) => {
            message!("error: {error}");
            let is_write = matches!(&error, PartError::File(IoError::System { action: "write", .. }));
            return if is_write { exit::INPUT_OUTPUT } else { exit::BAD_INPUT };
        }
    };
    let report = PartReport {
        provenance: Provenance::new(&arguments.mesh.display().to_string(), 3 * facts.nodes),
        index,
        element: facts.kind.name(),
        elements: facts.elements,
        nodes: facts.nodes,
        files: facts.files,
    };
    arguments.say.result(&report, || {
        let (count, index) = (arguments.parts, report.index.display());
        out!("{index}: {} {} and {} nodes in {count} pieces", report.elements, report.element, report.nodes);
        out!("a scene takes it with `mesh = \"{index}\"`; keep its {} files together", report.files.len());
    });
    exit::DONE
}
