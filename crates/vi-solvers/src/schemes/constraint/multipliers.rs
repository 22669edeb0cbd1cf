//! The multipliers of a constrained step, besides the unknowns of its stage:
//! ```text
//! M w + c (∂V/∂q(û + w) + Nᵀℓ) = 0,   g(q₁) = 0,   q₁ = q₀ + s (û − q₀ + w)
//! ```
//! with s = 2 if the stage is in the middle of the step (then c = h²/4), and s = 1 if it is the end. The ℓ are the forces
//! of the constraints and N = ∂g/∂q their directions. Directions at the start make the midpoint scheme variational: then
//! p₁ = p₀ + (4/h) M w + (h/2) Nᵀℓ − G₁ᵀμ with μ from G₁ M⁻¹ p₁ = 0. Directions at the stage leave the scheme's own p₁; in the
//! middle they conserve energy. Newton's method eliminates ℓ: with A ≈ M + cK, y = −A⁻¹R and Z = A⁻¹Nᵀ,
//! ```text
//! s c G₁ Z Δℓ = g(q₁) + s G₁ y,   δ = y − c Z Δℓ.
//! ```
//! Z costs one solve per multiplier and is computed once per step and factor. ℓ + Δℓ and δ depend on w alone and not
//! on the ℓ in R, so Newton's method and its accelerations only see w. After the stage is solved to its tolerance, q₁
//! is projected onto the manifold to round-off along M⁻¹Nᵀ.

mod kept;

use nalgebra::DVector;
use vi_core::{State, System};

use crate::assemble::evaluator::Evaluator;
use crate::error::SolverError;
use crate::newton::inverse::Inverse;
use crate::schemes::constraint::manifold::{ConstraintManifold, Row};
use crate::schemes::constraint::units::Factored;
use crate::schemes::one_stage::rule::MultiplierDirections;

pub(crate) struct Multipliers {
    manifold: ConstraintManifold,
    directions: MultiplierDirections,
    /// ℓ of the last step.
    last: Vec<f64>,
    /// ℓ of the last correction.
    forces: Vec<f64>,
    /// A δ of the last correction.
    load: Vec<f64>,
    h: f64,
    /// s: change of the end of the step per change of the stage.
    end_per_stage: f64,
    end_t: f64,
    /// g and G at the end of the step, from the last evaluation.
    defect: DVector<f64>,
    rows: Vec<Row>,
    /// Work of prescribed motion against the impulses at both ends of the last step, J.
    end_work: f64,
    /// Z by columns, and the number of the factor and step for which it was computed.
    z: Vec<f64>,
    z_is_of: Option<u64>,
    /// The factors of s c G₁ Z since the last evaluation.
    factored: Option<Factored>,
    q_end: Vec<f64>,
    p_scratch: Vec<f64>,
    /// Whether iterates are kept on the manifold, and why the last one did not reach it.
    is_kept: bool,
    failure: Option<SolverError>,
}

/// The part of a correction from which multipliers are eliminated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    /// The whole correction, which also meets the constraints.
    Whole,
    /// A change that is added to the correction.
    Change,
    /// A change that is only computed and not added.
    Trial,
}

impl Multipliers {
    /// Returns `None` if the system has no constraints.
    pub(crate) fn new(system: &System, directions: MultiplierDirections) -> Option<Self> {
        let manifold = ConstraintManifold::new(system)?;
        let (m, n) = (manifold.multiplier_count(), system.coordinates().free_count());
        Some(Self {
            manifold,
            directions,
            last: vec![0.0; m],
            forces: vec![0.0; m],
            load: vec![0.0; n],
            h: 0.0,
            end_per_stage: 1.0,
            end_t: 0.0,
            defect: DVector::zeros(m),
            rows: Vec::new(),
            end_work: 0.0,
            z: Vec::new(),
            z_is_of: None,
            factored: None,
            q_end: vec![0.0; n],
            p_scratch: vec![0.0; n],
            is_kept: false,
            failure: None,
        })
    }

    /// Returns ℓ of the last step, from which the next one starts.
    pub(crate) fn multipliers(&self) -> &[f64] {
        &self.last
    }

    pub(crate) fn restore(&mut self, multipliers: &[f64]) -> Result<(), SolverError> {
        if multipliers.len() != self.last.len() {
            return Err(SolverError::Memory { missing: "stage.multipliers" });
        }
        self.last.copy_from_slice(multipliers);
        Ok(())
    }

    pub(crate) fn open(&mut self, system: &System, state: &State, h: f64, end_per_stage: f64) {
        (self.h, self.end_t, self.end_per_stage) = (h, state.t + h, end_per_stage);
        self.manifold.set_directions(system, &state.q, state.t);
        self.z_is_of = None;
        self.forces.copy_from_slice(&self.last);
    }

    /// Requests that Z is computed anew before the next correction, because another start has other directions.
    pub(crate) fn forget_directions(&mut self) {
        self.z_is_of = None;
    }

    /// Adds Nᵀℓ to the additions to ∂V/∂q at the stage (q, t), and evaluates the constraints at the end of the step.
    pub(crate) fn evaluate(
        &mut self,
        system: &System,
        q: &[f64],
        t: f64,
        end: impl Fn(usize) -> f64,
        added: &mut [f64],
    ) {
        if self.directions == MultiplierDirections::Stage {
            self.manifold.set_directions(system, q, t);
        }
        self.manifold.add_force(&self.forces, 1.0, added);
        self.q_end.iter_mut().enumerate().for_each(|(k, q)| *q = end(k));
        self.factored = None;
        (self.defect, self.rows) = self.manifold.linearize(system, &self.q_end, self.end_t);
    }

    /// Computes δ from y in `correction`; returns its energy δᵀAδ/c.
    pub(crate) fn correct(
        &mut self,
        c: f64,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        residual: &[f64],
        correction: &mut [f64],
    ) -> Result<f64, SolverError> {
        self.load.copy_from_slice(residual);
        self.eliminate(c, inverse, evaluator, correction, Part::Whole)?;
        Ok(self.load.iter().zip(&*correction).map(|(r, d)| r * d).sum::<f64>() / c)
    }

    /// Computes v ← v − c Z s such that the linearised constraints do not change along v. This is how a change of the
    /// residual, for which v = A⁻¹r, changes δ.
    pub(crate) fn project_change(
        &mut self,
        c: f64,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        v: &mut [f64],
    ) -> Result<(), SolverError> {
        self.eliminate(c, inverse, evaluator, v, Part::Trial)
    }

    /// Adds the change of δ that a change r of the residual causes to `correction`; `change` = A⁻¹r. Returns the energy
    /// −R·δ/c with the forces of the multipliers in R, without that change.
    pub(crate) fn add_change(
        &mut self,
        c: f64,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        change: &mut [f64],
        correction: &mut [f64],
    ) -> Result<f64, SolverError> {
        self.eliminate(c, inverse, evaluator, change, Part::Change)?;
        correction.iter_mut().zip(&*change).for_each(|(value, change)| *value += change);
        Ok(self.load.iter().zip(&*correction).map(|(r, d)| r * d).sum::<f64>() / c)
    }

    /// Returns whether constraints read all free coordinates: the system consists of rigid bodies and joints.
    pub(crate) fn read_all(&self) -> bool {
        self.manifold.coordinate_count() == self.load.len()
    }

    /// Returns the number of multipliers; `None` if constraints depend on each other, so that no matrix with them has factors.
    pub(crate) fn count_of_independent(&self) -> Option<usize> {
        (!self.manifold.is_redundant()).then_some(self.forces.len())
    }

    /// Calls `each` with the entries of Nᵀ: free coordinate, multiplier and value. With further unknowns c Δℓ the equations of
    /// J = M + c ∂²V/∂q² become [J + c Σ ℓ ∂N/∂q, Nᵀ; G₁, 0]; the right side is continued by [`Multipliers::complete_rhs`].
    pub(crate) fn for_each_direction(&self, each: impl FnMut(u32, u32, f64)) {
        self.manifold.for_each_direction(each);
    }

    /// Calls `each` with the entries of Σ ℓ ∂N/∂q on the free coordinates: row, column and value. There are none if N does not depend
    /// on the stage.
    pub(crate) fn for_each_curvature(&self, each: impl FnMut(u32, u32, f64)) {
        if self.directions == MultiplierDirections::Stage {
            self.manifold.for_each_curvature(&self.forces, each);
        }
    }

    /// Returns the rows of G₁.
    pub(crate) fn rows(&self) -> impl Iterator<Item = &[(u32, f64)]> {
        self.rows.iter().map(Vec::as_slice)
    }

    /// Appends −g/s to the right side of the equations with the further unknowns c Δℓ.
    pub(crate) fn complete_rhs(&self, rhs: &mut Vec<f64>) {
        rhs.extend(self.defect.iter().map(|defect| -defect / self.end_per_stage));
    }

    /// Takes the change c Δℓ of a correction of the equations with this residual.
    pub(crate) fn change(&mut self, c: f64, change: &[f64], residual: &[f64]) {
        self.load.copy_from_slice(residual);
        self.manifold.add_force(change, -1.0, &mut self.load);
        self.forces.iter_mut().zip(change).for_each(|(force, change)| *force += change / c);
    }

    /// Computes v ← v − c Z Δℓ.
    fn eliminate(
        &mut self,
        c: f64,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        v: &mut [f64],
        part: Part,
    ) -> Result<(), SolverError> {
        let (m, n) = (self.forces.len(), v.len());
        self.refresh(inverse, evaluator, n)?;
        let along = |row: &Row, v: &[f64]| row.iter().map(|&(k, g)| g * v[k as usize]).sum::<f64>();
        let defect = |i: usize| if part == Part::Whole { self.defect[i] } else { 0.0 };
        let s = self.end_per_stage;
        let rhs = DVector::from_fn(m, |i, _| defect(i) + s * along(&self.rows[i], v));
        let factored = self.factored.take().unwrap_or_else(|| self.factor(c));
        let solved = factored.solve(&rhs);
        self.factored = Some(factored);
        // If constraints depend on each other, the projection at the end of the step reports it.
        let step = solved.unwrap_or_else(|| DVector::zeros(m));
        self.move_along(c, &step, v);
        if part != Part::Trial {
            // A δ = −R − c NᵀΔℓ.
            self.manifold.add_force(step.as_slice(), -c, &mut self.load);
            self.forces.iter_mut().zip(&step).for_each(|(force, change)| *force += change);
        }
        Ok(())
    }

    /// Recomputes Z if the factor has changed.
    fn refresh(
        &mut self,
        inverse: &mut Inverse,
        evaluator: &mut Evaluator,
        n: usize,
    ) -> Result<(), SolverError> {
        let factor = evaluator.work.factorizations;
        if self.z_is_of == Some(factor) {
            return Ok(());
        }
        self.factored = None;
        self.z.resize(n * self.forces.len(), 0.0);
        for (j, column) in self.z.chunks_exact_mut(n).enumerate() {
            self.manifold.direction(j, column);
            inverse.apply(evaluator, column)?;
        }
        self.z_is_of = Some(factor);
        Ok(())
    }

    /// Returns A δ of the last correction.
    pub(crate) fn load(&self) -> &[f64] {
        &self.load
    }

    /// Projects the end of the step onto the manifold by a change of w along M⁻¹Nᵀ, and changes ℓ accordingly.
    pub(crate) fn project_end(
        &mut self,
        system: &System,
        c: f64,
        end: impl Fn(usize, f64) -> f64,
        w: &mut [f64],
        t: f64,
    ) -> Result<(), SolverError> {
        // The impulses p −= Nᵀλ, q₁ −= h M⁻¹Nᵀλ correspond to w −= (h/s) M⁻¹Nᵀλ, ℓ += (h/(s c)) λ.
        let (w_per_impulse, force_per_impulse) =
            (self.h / self.end_per_stage, self.h / (self.end_per_stage * c));
        let mass = system.free_mass();
        self.q_end.iter_mut().enumerate().for_each(|(k, q)| *q = end(k, w[k]));
        self.p_scratch.fill(0.0);
        let mut impulses = vec![0.0; self.forces.len()];
        let (q, p) = (&mut self.q_end, &mut self.p_scratch);
        self.manifold.project_positions(system, q, p, t, self.h, &mut impulses)?;
        for (k, w) in w.iter_mut().enumerate() {
            if self.p_scratch[k] != 0.0 {
                *w += w_per_impulse * self.p_scratch[k] / mass[k];
            }
        }
        for (force, impulse) in self.forces.iter_mut().zip(&impulses) {
            *force += force_per_impulse * impulse;
        }
        Ok(())
    }

    /// Makes the scheme's momentum p at the end (q, t) tangent there, if directions are at the ends.
    pub(crate) fn close(
        &mut self,
        system: &System,
        q: &[f64],
        p: &mut [f64],
        t: f64,
    ) -> Result<(), SolverError> {
        if self.directions == MultiplierDirections::Ends {
            self.manifold.add_force(&self.forces, 0.5 * self.h, p);
            self.end_work = 0.5 * self.h * self.manifold.impulse_work(&self.forces);
            self.end_work += self.manifold.project_momenta(system, q, p, t)?[1];
        }
        self.last.copy_from_slice(&self.forces);
        Ok(())
    }

    /// Returns the work of prescribed motion through the multipliers along Δx of all coordinates, J.
    pub(crate) fn prescribed_work(&self, along: &[f64]) -> f64 {
        match self.directions {
            MultiplierDirections::Ends => self.end_work,
            MultiplierDirections::Stage => self.manifold.prescribed_work(&self.forces, along),
        }
    }
}
