//! The passes of explicit steps over all nodes: each adds the sums of chunks, kicks and drifts at once.

use vi_core::{MassFilter, State, System};

use super::Evaluator;
use crate::assemble::filtered::FilteredDrift;
use crate::assemble::sweep::{Arrays, Pass, Sweep};

impl Evaluator {
    /// Returns whether this process can make passes of explicit steps ([`Evaluator::sweep`]).
    pub(crate) fn can_sweep(&self) -> bool {
        self.assembler.gather().is_some()
    }

    /// Makes a pass of an explicit step over q and p. `closing` is the factor of the kick that ends the previous step,
    /// `kick` that of the kick before the drift. If `sums`, first sums the chunks of the last [`Evaluator::sum_chunks`]
    /// into the gradient; otherwise the gradient is already valid. Returns whether all numbers that it wrote are
    /// finite.
    pub(crate) fn sweep(
        &mut self,
        sweep: &Sweep,
        from: Option<&State>,
        sums: bool,
        [closing, kick]: [f64; 2],
        drift: f64,
        (q, p): (&mut [f64], &mut [f64]),
    ) -> bool {
        let sums_of = self.assembler.gather().filter(|_| sums);
        let pass = Pass { from, sums: sums_of, closing, kick, drift, sets: false };
        let is_sound = sweep.pass(pass, Arrays { gradient: &mut self.gradient, x: &mut self.x, q, p });
        self.gradient_is_of_x = (sums || self.gradient_is_of_x) && drift == 0.0 && is_sound;
        is_sound
    }

    /// Makes a pass as [`Evaluator::sweep`] does, but with v = M⁻¹p in place of the drift. v has all coordinates.
    pub(crate) fn sweep_to_velocity(
        &mut self,
        sweep: &Sweep,
        sums: bool,
        [closing, kick]: [f64; 2],
        (q, p): (&mut [f64], &mut [f64]),
        v: &mut [f64],
    ) -> bool {
        let sums = self.assembler.gather().filter(|_| sums);
        let pass = Pass { from: None, sums, closing, kick, drift: 1.0, sets: true };
        self.gradient_is_of_x = false;
        sweep.pass(pass, Arrays { gradient: &mut self.gradient, x: v, q, p })
    }

    /// Drifts with the velocities of the last [`Evaluator::sweep_to_velocity`]; returns whether all is finite.
    pub(crate) fn drift_filtered(
        &mut self,
        filter: &MassFilter,
        filtered: &mut FilteredDrift,
        drift: f64,
    ) -> bool {
        self.gradient_is_of_x = false;
        filtered.drift(filter, drift, &mut self.x)
    }

    /// Evaluates ∂V/∂x at the result of the last pass and time t, but without the sums over nodes: the next pass
    /// computes them.
    pub(crate) fn sum_chunks(&mut self, system: &System, t: f64) {
        if system.coordinates().is_moving() {
            system.coordinates().place_prescribed(t, &mut self.x);
        }
        self.t = t;
        self.gradient_is_of_x = false;
        self.work.gradients += 1;
        self.assembler.sum_chunks(&self.x, t);
    }
}
