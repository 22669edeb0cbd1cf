//! Dry friction in equilibria: forces without a potential, which depend on the equilibria before. From one equilibrium to
//! the next, terms act over a step of infinite duration.

use vi_core::{Coordinates, Impulse, StepSpan, System};

use crate::assemble::assembler::Assembler;
use crate::assemble::live::{LiveState, LiveSum};
use crate::assemble::pairs::Pairs;
use crate::assemble::stencil_forces::ListedForces;
use crate::error::SolverError;
use crate::linear::matrix::SymmetricMatrix;

const BETWEEN_EQUILIBRIA: StepSpan =
    StepSpan { duration: f64::INFINITY, acts_at_end: true, damps_end: false };

/// The state of friction after an equilibrium.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Rubbed {
    /// The stretched bristles.
    pub(crate) memory: LiveState,
    /// Energy stored in them, J.
    pub(crate) stored: f64,
    /// Work of friction since this was last set to zero, J (≤ 0).
    pub(crate) work: f64,
    /// Forces between bodies, N.
    pub(crate) forces: Vec<Impulse>,
    /// All forces of live terms in the equilibrium.
    pub(crate) listed: ListedForces,
    /// The smallest gap of the pairs that act, m.
    pub(crate) smallest_gap: Option<f64>,
}

/// The friction between the last equilibrium and the next.
pub(crate) struct Friction {
    live: LiveSum,
    pairs: Pairs,
    /// Positions of the last equilibrium, m.
    start: Vec<f64>,
    /// The product of the model and a vector.
    product: Vec<f64>,
    pub(crate) rubbed: Rubbed,
    /// Number of solves with lagged friction that failed since the last one that did not.
    pub(crate) failed_lags: u32,
}

impl Friction {
    /// Returns the friction of a system from an equilibrium at positions x; `None` if it has none.
    ///
    /// # Errors
    /// Returns an error if the forces cannot be summed.
    pub(crate) fn new(
        system: &System,
        assembler: &Assembler,
        x: &[f64],
        rubbed: &Rubbed,
    ) -> Result<Option<Self>, SolverError> {
        let Some(mut live) = assembler.new_split_live() else { return Ok(None) };
        live.go_to(&rubbed.memory);
        live.open_step(x, BETWEEN_EQUILIBRIA)?;
        if !live.dissipates(x) {
            return Ok(None);
        }
        let pairs = Pairs::new(system.coordinates());
        let product = vec![0.0; system.coordinates().free_count()];
        let mut friction =
            Self { live, pairs, start: x.to_vec(), product, rubbed: rubbed.clone(), failed_lags: 0 };
        friction.set_predicts(true);
        Ok(Some(friction))
    }

    /// Begins a series of iterations.
    pub(crate) fn restart(&mut self) {
        self.pairs.restart();
    }

    /// Sets the fraction of their stiffness with which bristles resist slip.
    pub(crate) fn set_stiffness(&mut self, fraction: f64) {
        self.pairs.set_stiffness(fraction);
    }

    /// Sets whether predicted tractions decide which pairs stick; otherwise slips alone do.
    pub(crate) fn set_predicts(&mut self, predicts: bool) {
        let count = if predicts { self.start.len() / 3 } else { 0 };
        // There is no inertia, so the stiffness of bristles is the only scale.
        self.pairs.set_compliance(vec![0.0; count].into());
    }

    /// Replaces friction by a potential, with the normal forces and the directions of slip at positions x, until [`Friction::end_lag`].
    pub(crate) fn lag(&mut self, x: &[f64]) {
        self.live.lag(&self.start, x, self.pairs.acting());
    }

    /// Ends [`Friction::lag`].
    pub(crate) fn end_lag(&mut self) {
        self.live.end_lag();
    }

    /// Returns whether friction is a potential.
    pub(crate) fn is_lagged(&self) -> bool {
        self.live.is_lagged()
    }

    /// Returns the potential of lagged friction at positions x, J.
    pub(crate) fn energy(&mut self, x: &[f64]) -> f64 {
        self.live.lagged_energy(x, 0.0)
    }

    /// Adds the forces of friction at positions x to `gradient`, both of all coordinates.
    pub(crate) fn add_gradient(&mut self, coordinates: &Coordinates, x: &[f64], gradient: &mut [f64]) {
        if self.live.add_lagged_gradient(x, 0.0, gradient) {
            return;
        }
        if self.live.list_pairs(&self.start, x, self.pairs.open()) {
            self.pairs.close(coordinates, gradient);
        } else {
            gradient.fill(f64::NAN);
        }
    }

    /// Returns a symmetric model of the tangent at positions x.
    pub(crate) fn model(&mut self, x: &[f64]) -> Option<&SymmetricMatrix> {
        if self.live.is_lagged() {
            return self.live.lagged_hessian(x, 0.0);
        }
        self.live.tangents_over(&self.start, x)
    }

    /// Adds E v to `out`, where E is the tangent of the last forces minus the last model.
    pub(crate) fn add_defect(&mut self, v: &[f64], out: &mut [f64]) {
        for (_, model) in self.live.last_tangents() {
            model.multiply(v, &mut self.product);
            out.iter_mut().zip(&self.product).for_each(|(out, product)| *out -= product);
        }
        self.pairs.add_product(1.0, v, out);
    }

    /// Returns the number of pairs whose traction does not obey the law of friction at the last evaluation; `None` without friction.
    pub(crate) fn unlawful(&self) -> Option<usize> {
        self.pairs.unlawful()
    }

    /// Predicts the tractions of friction after a change of the free coordinates by factor · `delta`.
    pub(crate) fn predict(&mut self, factor: f64, delta: &[f64]) {
        self.pairs.predict(factor, delta);
    }

    /// Accepts an equilibrium at positions x and time t, from which the next step begins.
    ///
    /// # Errors
    /// Returns an error if the forces cannot be summed.
    pub(crate) fn accept(&mut self, x: &[f64], t: f64) -> Result<(), SolverError> {
        let outcome = self.live.close_step(&self.start, x);
        self.live.accept_step(&self.start, x);
        let listed = ListedForces::new(x, |see| {
            self.live.see_forces(see);
            self.live.see_gradients(x, t, see);
        });
        self.rubbed = Rubbed {
            memory: LiveState::of_memory(self.live.state()),
            stored: outcome.stored,
            work: self.rubbed.work - outcome.friction,
            forces: outcome.impulses,
            listed,
            smallest_gap: outcome.smallest_gap,
        };
        self.start.copy_from_slice(x);
        self.live.open_step(x, BETWEEN_EQUILIBRIA)
    }
}
