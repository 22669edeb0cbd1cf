//! `variational check-frames`: prints the intersections in the frames of a run.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use vi_io::{IoError, PvdSeries};

use super::exit;
use super::frame_planes::FramePlanes;
use super::say::{Say, message, out};
use crate::intersections::frame::FrameSurface;
use crate::intersections::{Intersection, intersections};
use crate::run::provenance::Provenance;

/// Largest number of intersections printed per frame.
const PRINTED: usize = 10;

#[derive(Debug, Args)]
pub(super) struct CheckFramesArguments {
    /// An output directory of a run. Frames in f32 round positions: write them with `precision = "f64"`
    directory: PathBuf,
    #[command(flatten)]
    say: Say,
}

#[derive(Serialize)]
struct FramesReport {
    provenance: Provenance,
    /// Number of intersections in all frames, with points within half-spaces.
    intersections: usize,
    frames: Vec<FrameReport>,
}

#[derive(Serialize)]
struct FrameReport {
    file: String,
    intersections: Vec<IntersectionReport>,
    /// Points of surfaces within half-spaces.
    below: Vec<BelowReport>,
}

#[derive(Serialize)]
struct BelowReport {
    point: u32,
    half_space: String,
}

#[derive(Serialize)]
struct IntersectionReport {
    edge: [u32; 2],
    triangle: [u32; 3],
}

pub(super) fn run(arguments: &CheckFramesArguments) -> u8 {
    let frames = match check(&arguments.directory, &arguments.say) {
        Ok(frames) => frames,
        Err(error) => {
            message!("error: {error}");
            return exit::BAD_INPUT;
        }
    };
    let directory = arguments.directory.display();
    if frames.is_empty() {
        message!(
            "error: {directory} contains no .vtu frames; give the output directory of a run with `output.interval`"
        );
        return exit::BAD_INPUT;
    }
    let count = frames.iter().map(|frame| frame.intersections.len() + frame.below.len()).sum();
    let provenance = Provenance::new(&directory.to_string(), 0);
    let report = FramesReport { provenance, intersections: count, frames };
    arguments.say.result(&report, || out!("{} frames, {count} intersections", report.frames.len()));
    if count == 0 { exit::DONE } else { exit::BROKEN }
}

/// Finds the intersections of each frame, and prints the first ones for a reader.
fn check(directory: &Path, say: &Say) -> Result<Vec<FrameReport>, IoError> {
    let planes = FramePlanes::of_run(directory);
    let mut frames = Vec::new();
    for (time, file) in frames_of(directory)? {
        let mesh = vi_io::read_mesh(&file)?;
        let surface = FrameSurface::new(&mesh);
        let found = intersections(&surface.points, &surface.triangles, &surface.wires);
        let below = time.or(mesh.time).map_or(Vec::new(), |t| planes.sunk(&surface, t));
        let count = found.len() + below.len();
        if count > 0 && !say.is_brief() {
            out!("{}: {count} intersections", file.display());
            for Intersection { segment: [a, b], triangle: [i, j, k] } in found.iter().take(PRINTED) {
                out!("  edge {a} {b} meets triangle {i} {j} {k}");
            }
            for (point, plane) in below.iter().take(PRINTED) {
                out!("  point {point} is below the face of '{plane}'");
            }
        }
        let report =
            |found: &Intersection| IntersectionReport { edge: found.segment, triangle: found.triangle };
        let sunk = |&(point, plane): &(u32, &str)| BelowReport { point, half_space: plane.to_owned() };
        frames.push(FrameReport {
            file: file.display().to_string(),
            intersections: found.iter().map(report).collect(),
            below: below.iter().map(sunk).collect(),
        });
    }
    Ok(frames)
}

/// Returns the frames of the series in a directory with their times (s), or all its .vtu files in the order of their names.
fn frames_of(directory: &Path) -> Result<Vec<(Option<f64>, PathBuf)>, IoError> {
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
        let series = PvdSeries::open(&series)?;
        frames.extend(series.frames().iter().map(|(time, file)| (Some(*time), directory.join(file))));
    }
    let alone = || with("vtu").into_iter().map(|file| (None, file)).collect();
    Ok(if frames.is_empty() { alone() } else { frames })
}
