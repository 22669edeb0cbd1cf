//! Summary that `variational run` prints at the end.

use std::path::Path;

use super::say::out;
use crate::run::report::Report;
use crate::run::results::{Peak, Results};

/// Largest number of lines of one kind; report.json contains all.
const MOST: usize = 10;

/// Prints the work and the results of a run.
pub(super) fn summary(report: &Report, directory: &Path) {
    let what = match report.scheme {
        Some(scheme) if report.adaptive.is_object() => {
            let number = |key: &str| report.adaptive[key].as_f64().unwrap_or(f64::NAN);
            format!(
                "{} steps of {:.3e} to {:.3e} s by {scheme}, in {} intervals",
                report.adaptive["steps"],
                number("smallest_step"),
                number("largest_step"),
                report.steps
            )
        }
        Some(scheme) => {
            format!("{} of {:.4e} s by {scheme}", counted(report.steps, "step", "steps"), report.h)
        }
        None => counted(report.steps, "load step", "load steps"),
    };
    out!(
        "{what} in {:.2} s (set-up {:.2} s, output {:.2} s)",
        report.stepping_seconds,
        report.setup_seconds,
        report.output_seconds
    );
    let cut = |key: &str| report.substeps[key].as_u64().unwrap_or(0);
    if cut("steps_cut") > 0 {
        let smallest = report.substeps["smallest"].as_f64().unwrap_or(f64::NAN);
        out!(
            "{} steps were cut into {} substeps, of {smallest:.3e} s at least",
            cut("steps_cut"),
            cut("substeps")
        );
    }
    for event in report.guard["events"].as_array().into_iter().flatten() {
        let number = |key: &str| event[key].as_f64().unwrap_or(f64::NAN);
        let cause = match event["failure"].as_str() {
            Some(failure) => format!("the step after t = {:.4e} s failed ({failure})", number("t")),
            None => format!("{:.3e} J gained at t = {:.4e} s", number("joules"), number("t")),
        };
        out!("energy guard: {cause}; went on {}", event["action"].as_str().unwrap_or_default());
    }
    // A static solution has no motion, and so no drift.
    let drift = report.energy_drift;
    if drift.is_finite() && report.scheme.is_some() {
        out!("energy drift {drift:.2e} of the largest kinetic energy");
    }
    results(&report.results);
    for (probe, estimate) in &report.estimate {
        let error = |axis: usize| estimate["error"][axis].as_f64().unwrap_or(f64::NAN);
        let order =
            estimate["observed_order"].as_f64().map_or("not seen".to_owned(), |order| format!("{order:.1}"));
        out!(
            "error of '{probe}' at the end: ± {:.1e}, {:.1e}, {:.1e} m (observed order {order})",
            error(0),
            error(1),
            error(2)
        );
    }
    for (probe, pitch) in &report.pitch {
        match pitch.as_f64() {
            Some(pitch) => out!("pitch at '{probe}': {pitch:.2} Hz"),
            None => out!("pitch at '{probe}': too few samples to tell"),
        }
    }
    if !report.notes.is_empty() {
        out!("{} notes and warnings, in report.json too", report.notes.len());
    }
    out!("written to {}", directory.display());
}

/// Prints the results of a run.
fn results(results: &Results) {
    if let Some(peak) = &results.largest_displacement {
        out!("largest displacement {:.4e} m {}", peak.value, place(peak));
    }
    if let Some(peak) = &results.largest_von_mises {
        out!("largest von Mises stress {:.4e} Pa {}", peak.value, place(peak));
    }
    for (number, reaction) in results.reactions.iter().enumerate().take(MOST) {
        let on = match &reaction.region {
            Some(region) => format!("fix {number}, region '{region}' of '{}'", reaction.body),
            None if reaction.nodes == 0 => format!("the support of '{}'", reaction.body),
            None => format!("fix {number}, {} nodes of '{}'", reaction.nodes, reaction.body),
        };
        out!(
            "reaction of {on}: force {} N, moment {} N m about {} m",
            vector(reaction.force),
            vector(reaction.moment),
            vector(reaction.centroid)
        );
    }
    rest(results.reactions.len(), "reactions");
    for range in results.probes.iter().take(MOST) {
        out!("{}: {:.4e} to {:.4e}", range.column, range.min, range.max);
    }
    rest(results.probes.len(), "columns of probes");
}

/// Formats a number with the name of the counted things.
pub(super) fn counted(count: u64, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

fn rest(count: usize, what: &str) {
    if count > MOST {
        out!("… {} more {what} in report.json", count - MOST);
    }
}

fn place(peak: &Peak) -> String {
    let at = match (peak.node, peak.element) {
        (Some(node), _) => format!("at node {node}"),
        (None, Some(element)) => format!("in element {element}"),
        (None, None) => "somewhere".to_owned(),
    };
    format!("{at} of '{}', which is at {} m at rest", peak.body, vector(peak.position))
}

fn vector(x: [f64; 3]) -> String {
    format!("({:.4e}, {:.4e}, {:.4e})", x[0], x[1], x[2])
}
