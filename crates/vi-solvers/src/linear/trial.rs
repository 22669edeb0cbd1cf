//! Provides the data for the choice of a linear solver, in time steps and equilibria: the size of a factor, and the
//! cost of a trial solve by conjugate gradients.

use crate::linear::cost;
use crate::linear::factor::FactorFacts;
use crate::linear::model::Model;
use crate::linear::pcg::Pcg;
use crate::linear::pcg::block::Preconditioner;
use crate::work::Work;

/// A factor with fewer operations is taken without comparing, since there is little to gain.
pub(crate) const CONSIDER_FLOPS: f64 = 3e9;
/// Largest fraction of the machine's memory that a factor may take.
const FACTOR_MEMORY_SHARE: f64 = 0.5;

/// Solves with A and a random load, weighted by the masses `weights`, by conjugate gradients to the relative `accuracy`. Returns
/// the number of iterations and the cost of a solve in seconds of the reference core, or `None` if it would exceed `most`.
pub(crate) fn try_gradients(
    Model { mass, c, k, positions }: Model<'_>,
    weights: &[f64],
    accuracy: f64,
    most: f64,
    work: &mut Work,
) -> Option<[f64; 2]> {
    let mut pcg = Pcg::new(k, Preconditioner::BlockIncompleteCholesky);
    if pcg.prepare(mass, c, k, positions).is_err() {
        return None;
    }
    let iteration = cost::iteration(&pcg.facts());
    let limit = (most / iteration) as u32;
    let load = load_of_all_frequencies(weights);
    let mut x = vec![0.0; load.len()];
    let report = pcg.solve(&load, &mut x, accuracy, limit).ok()?;
    work.pcg_iterations += u64::from(report.iterations);
    let iterations = f64::from(report.iterations);
    Some([iterations, (iterations + 1.0) * iteration])
}

/// Describes a factor.
pub(crate) fn describe(facts: &FactorFacts, single: bool) -> String {
    let (flops, megabytes) = (1e-9 * facts.flops, 1e-6 * facts.bytes as f64);
    let precision = if single { "single" } else { "double" };
    format!("cholesky: {flops:.2} Gflop per factor, {megabytes:.1} MB, {precision} precision")
}

/// Returns a load with all frequencies, the same at every call.
pub(crate) fn load_of_all_frequencies(mass: &[f64]) -> Vec<f64> {
    mass.iter().zip(0..).map(|(m, i)| m * rough(i)).collect()
}

/// Returns a pseudo-random number from −1 to 1, the same at every call.
fn rough(k: u64) -> f64 {
    let mixed = (k + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (mixed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// Returns why a factor is too large for this machine, if it is.
pub(crate) fn too_large(facts: &FactorFacts) -> Option<String> {
    let bytes = facts.bytes as f64;
    let is_too_large = bytes > FACTOR_MEMORY_SHARE * memory_of_machine();
    is_too_large.then(|| format!("a factor would take {:.1} GB", 1e-9 * bytes))
}

/// Returns the machine's memory in bytes; 8 GB if it cannot be read.
fn memory_of_machine() -> f64 {
    let told = std::fs::read_to_string("/proc/meminfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
        line.split_whitespace().nth(1)?.parse::<f64>().ok()
    });
    told.map_or(8e9, |kilobytes| 1024.0 * kilobytes)
}
