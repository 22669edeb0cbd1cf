//! The contract of equations in which live terms act pair by pair.

use crate::assemble::evaluator::Evaluator;
use crate::error::SolverError;
use crate::newton::equations::{Equations, Solve};
use crate::newton::inverse::Inverse;

/// Equations in which live terms act pair by pair.
pub(crate) trait PairEquations: Equations {
    /// Returns how far the end of the step moves per unit of the unknowns.
    fn end_per_stage(&self) -> f64;
    /// Returns E v at the last evaluation, where A is the model that `inverse` holds; `None` if E is zero.
    fn pair_defect(&self, inverse: &Inverse, evaluator: &Evaluator, v: &[f64]) -> Option<Vec<f64>>;
    /// Computes the change of δ that a change v of −R causes, v ← A⁻¹v, without a change of the equations.
    fn solve_change(
        &mut self,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        v: &mut [f64],
    ) -> Result<(), SolverError>;
    /// Adds to the last correction δ the change that a change r of −R causes. Returns −R·δ/c, J, without this change.
    fn add_change(
        &mut self,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        r: &[f64],
    ) -> Result<f64, SolverError>;
    /// Returns the number of equations and constraints; `None` if their complete tangent cannot be factored.
    fn complete_size(&self) -> Option<usize>;
    /// Factors the complete tangent at the last evaluation, with the exact K.
    fn factor_completely(&mut self, evaluator: &mut Evaluator) -> Result<(), SolverError>;
    /// Solves for the correction by the last factors of a complete tangent. Returns its energy δᵀJδ/c, J.
    fn correct_completely(&mut self, evaluator: &mut Evaluator) -> Result<f64, SolverError>;
    /// Returns the size of the residual at the last evaluation, in the norm of the inverse mass.
    fn residual_size(&self) -> f64;
    /// Returns the size of the residual of the last correction without the forces of constraints, in the same norm.
    fn load_size(&self) -> f64;
    /// Returns the size of the forces of pairs in the residual, in the same norm.
    fn forces_size(&self, evaluator: &Evaluator) -> f64;
    /// Returns a bound on the size that the residual of the last correction has by the round-off of positions in the forces of pairs.
    fn round_off(&self, evaluator: &Evaluator) -> f64;
    /// Shortens the last correction: to the length `longest` (m), and until no pair meets on its path; node by node, or
    /// by the same fraction at all nodes. Returns whether it was not shortened.
    fn limit(&mut self, evaluator: &mut Evaluator, longest: f64, is_uniform: bool) -> bool;
    /// Returns whether the equations can [lag](PairEquations::lag).
    fn can_lag(&self, evaluator: &Evaluator) -> bool;
    /// Replaces the forces of pairs by potentials with the friction that they have at the unknowns, or, if `at_start`, at the beginning
    /// of the step, and other forces without a potential by their linearisation. The solution then minimises the merit.
    fn lag(&mut self, evaluator: &mut Evaluator, at_start: bool);
    /// Restores the forces that [`PairEquations::lag`] replaced.
    fn end_lag(&mut self, evaluator: &mut Evaluator);
    /// Moves the start of the iteration, node by node, to where no pair meets on the path from the beginning of the
    /// step.
    fn limit_start(&mut self, evaluator: &mut Evaluator);
}

/// Makes evaluations list the forces of pairs, without predictions of friction.
pub(super) fn begin_pairs<E: PairEquations>(solve: &mut Solve<'_, E>) {
    let per_mass = solve.equations.end_per_stage() * solve.equations.coefficient();
    solve.evaluator.begin_pairs(solve.system, per_mass);
}
