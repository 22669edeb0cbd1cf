//! Terms whose stencils are divided among several processes (ranks).

/// The sums of the fixed terms of a system that several ranks compute together. The first rank asks for them; the others
/// wait for its questions.
///
/// All sums have the bits of one process. Only one caller may ask at a time: components whose terms are shared must not
/// be evaluated in parallel.
pub trait SharedTerms: Send + Sync {
    /// Returns the energies at positions `x` (m, all coordinates) and time t (s): those of each run of stencils that a rank
    /// sums. Affine terms and runs without a free coordinate are left out.
    fn energies(&self, x: &[f64], t: f64) -> Vec<RunEnergy>;

    /// Writes ∂V/∂x of every coordinate, N.
    fn gradient(&self, x: &[f64], t: f64, out: &mut [f64]);

    /// Returns the number of bytes that the first rank sends to others per gradient, without those of `x`.
    fn bytes_sent(&self) -> usize;
}

/// The energy of a run of stencils.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunEnergy {
    /// Index of the term.
    pub term: usize,
    /// The first stencil of the run.
    pub first: usize,
    /// The sum of the energies, J.
    pub sum: f64,
    /// The sum of the rounding errors of this sum, J.
    pub error: f64,
}
