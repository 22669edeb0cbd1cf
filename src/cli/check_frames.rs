//! `variational check-frames`.

use std::path::{Path, PathBuf};

use clap::Args;
use vi_io::{IoError, PvdSeries};

use super::exit;
use super::say::{message, out};
use crate::intersections::frame::FrameSurface;
use crate::intersections::intersections;

/// Intersections that are printed per frame.
const PRINTED: usize = 10;

#[derive(Debug, Args)]
pub(super) struct CheckFramesArguments {
    /// A directory that a run has written. Frames in f32 round positions: write them with `precision = "f64"`
    directory: PathBuf,
}

pub(super) fn run(arguments: &CheckFramesArguments) -> u8 {
    match check(&arguments.directory) {
        Ok(Some((0, frames))) => {
            out!("{frames} frames, 0 intersections");
            exit::DONE
        }
        Ok(Some((count, frames))) => {
            out!("{frames} frames, {count} intersections");
            exit::BROKEN
        }
        Ok(None) => {
            let directory = arguments.directory.display();
            message!(
                "error: {directory} holds no .vtu frames; name the output directory of a run with `interval`"
            );
            exit::BAD_INPUT
        }
        Err(error) => {
            message!("error: {error}");
            exit::BAD_INPUT
        }
    }
}

/// Numbers of intersections and of frames; `None` where there are no frames.
fn check(directory: &Path) -> Result<Option<(usize, usize)>, IoError> {
    let files = frames_of(directory)?;
    let mut count = 0;
    for file in &files {
        let surface = FrameSurface::new(&vi_io::read_mesh(file)?);
        let found = intersections(&surface.points, &surface.triangles, &surface.wires);
        if !found.is_empty() {
            out!("{}: {} intersections", file.display(), found.len());
        }
        for crossing in found.iter().take(PRINTED) {
            let ([a, b], [i, j, k]) = (crossing.segment, crossing.triangle);
            out!("  edge {a} {b} meets triangle {i} {j} {k}");
        }
        count += found.len();
    }
    Ok((!files.is_empty()).then_some((count, files.len())))
}

/// The frames of the series in a directory, or all its .vtu files in the order of their names.
fn frames_of(directory: &Path) -> Result<Vec<PathBuf>, IoError> {
    let system = |source| IoError::System { file: directory.into(), action: "read", source };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(directory).map_err(system)? {
        files.push(entry.map_err(system)?.path());
    }
    files.sort();
    let with = |extension: &str| -> Vec<PathBuf> {
        files
            .iter()
            .filter(|file| file.extension().is_some_and(|found| found == extension))
            .cloned()
            .collect()
    };
    let mut frames = Vec::new();
    for series in with("pvd") {
        frames.extend(PvdSeries::open(&series)?.frames().iter().map(|(_, file)| directory.join(file)));
    }
    Ok(if frames.is_empty() { with("vtu") } else { frames })
}
