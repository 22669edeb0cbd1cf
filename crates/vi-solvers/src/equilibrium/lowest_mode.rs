//! The lowest eigenpair of (K, M) at an equilibrium.

use crate::assemble::hessian::HessianEvaluation;
use crate::equilibrium::balance::Balance;
use crate::error::SolverError;
use crate::linear::lanczos::lowest_pairs;
use crate::linear::pencil::Pencil;

/// Returns the lowest ω² (1/s²) of (K, M) at (q, t), and its mode with mass norm 1.
pub(crate) fn lowest(balance: &mut Balance, q: &[f64], t: f64) -> Result<(f64, Vec<f64>), SolverError> {
    let stiffness = balance.tangent(q, t, HessianEvaluation::Exact)?.clone();
    let mass = balance.system.free_mass().to_vec();
    let mut pencil = Pencil::lumped(stiffness, mass)?.interruptible(&balance.interrupt);
    let mut pairs = lowest_pairs(&mut pencil, 1, 1e-6)?;
    pairs.pop().map(|pair| (pair.value, pair.vector)).ok_or(SolverError::NotFactored)
}
