//! Whether a solve for an equilibrium still makes headway, so that more corrections are worth while.

/// Fraction to which the smallest energy norm of all corrections must fall.
const SMALLER: f64 = 0.7;
/// Part of all energy released so far that must be released.
const RELEASE: f64 = 1e-3;

/// The corrections of a solve.
///
/// Thin sheets take long to find how to bend without stretching: a horizontal sheet of 1 m × 1 m × 1 mm (E = 1 MPa) comes to rest
/// under its weight after 63 corrections. After 25 their relative energy norm is .6, and 1.4 under a quarter of the weight.
#[derive(Debug, Default)]
pub(super) struct Headway {
    /// The relative energy norm of each correction.
    norms: Vec<f64>,
    /// The energy released before each correction, J.
    released: Vec<f64>,
    /// Whether the tangent was positive definite at each iterate.
    definite: Vec<bool>,
}

impl Headway {
    /// Adds a correction with its relative energy norm, the energy released before it, J, and whether the tangent is positive definite.
    pub(super) fn add(&mut self, norm: f64, released: f64, is_definite: bool) {
        self.norms.push(norm);
        self.released.push(released);
        self.definite.push(is_definite);
    }

    /// Returns the number of corrections.
    pub(super) fn count(&self) -> u32 {
        self.norms.len() as u32
    }

    /// Returns the relative energy norm of the last correction.
    pub(super) fn last(&self) -> f64 {
        self.norms.last().copied().unwrap_or(f64::INFINITY)
    }

    /// Returns whether the last `patience` corrections were worth while: one of them is smaller than all before, or they released energy.
    pub(super) fn continues(&self, patience: usize) -> bool {
        let Some(start) = self.norms.len().checked_sub(patience) else { return true };
        let (before, late) = self.norms.split_at(start);
        let least = |norms: &[f64]| norms.iter().copied().fold(f64::INFINITY, f64::min);
        let released = self.released.last().copied().unwrap_or(0.0);
        least(late) <= SMALLER * least(before) || released - self.released[start] > RELEASE * released
    }

    /// Returns whether the tangent was positive definite at most of the last `count` iterates. A body that snaps passes through states
    /// where it is not; thin sheets meet few of them.
    pub(super) fn is_mostly_definite(&self, count: usize) -> bool {
        let last = &self.definite[self.definite.len().saturating_sub(count)..];
        2 * last.iter().filter(|&&is_definite| is_definite).count() >= last.len()
    }
}
