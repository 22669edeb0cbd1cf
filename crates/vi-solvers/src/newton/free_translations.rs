//! The translations of bodies that nothing holds, in solutions of A Δ = r with A = M + cK.
//!
//! K maps the translations of a body that nothing holds to zero, so the sums over its nodes satisfy Σ m Δ = Σ r. A factor in single
//! precision does not satisfy this, nor does one that is rotated with the material, nor conjugate gradients. The linear momentum of
//! the body would then be off by as much as a step is from its solution. Adding the translation (Σ r − Σ m Δ)/Σ m to Δ corrects it: after
//! one whole correction, every iterate of Newton's method has the momentum of the solution, to round-off.

use vi_core::System;

use crate::assemble::carried::Carried;
use crate::index::NONE;

/// The translations along the axes of space of the bodies that nothing holds.
pub(crate) struct FreeTranslations {
    /// The translation to which each free coordinate belongs, or [`NONE`].
    of_free: Vec<u32>,
    /// The lumped mass of each free coordinate, kg.
    mass: Vec<f64>,
    /// Σ m of each translation, kg.
    total: Vec<f64>,
}

impl FreeTranslations {
    /// Returns the translations of the bodies of a system with a lumped mass; `None` if there are none. Systems in which bodies touch, or in
    /// which forces depend on velocities, count as held.
    pub(crate) fn new(system: &System) -> Option<Self> {
        let coordinates = system.coordinates();
        let may_be_held = coordinates.is_moving()
            || !coordinates.is_plain()
            || !system.forces().is_empty()
            || !system.terms().live().is_empty()
            || system.terms().shared().is_some();
        if may_be_held {
            return None;
        }
        let carried = Carried::new(system);
        let mut numbers = vec![[NONE; 3]; carried.count()];
        let mut total = Vec::new();
        let mut of_free = vec![NONE; coordinates.free_count()];
        let mass = system.free_mass();
        for (k, &dof) in coordinates.free().iter().enumerate() {
            let Some((part, axis)) = carried.free_translation(coordinates, dof) else { continue };
            let number = &mut numbers[part][axis];
            if *number == NONE {
                *number = total.len() as u32;
                total.push(0.0);
            }
            of_free[k] = *number;
            total[*number as usize] += mass[k];
        }
        (!total.is_empty()).then(|| Self { of_free, mass: mass.to_vec(), total })
    }

    /// Returns Σ r of each translation.
    pub(crate) fn resultants(&self, r: &[f64]) -> Vec<f64> {
        self.sums(|k| r[k])
    }

    /// Adds translations to Δ, after which Σ m Δ is equal to these resultants.
    pub(crate) fn correct(&self, mut resultants: Vec<f64>, delta: &mut [f64]) {
        let reached = self.sums(|k| self.mass[k] * delta[k]);
        for (number, resultant) in resultants.iter_mut().enumerate() {
            *resultant = (*resultant - reached[number]) / self.total[number];
        }
        for (delta, &number) in delta.iter_mut().zip(&self.of_free) {
            if number != NONE {
                *delta += resultants[number as usize];
            }
        }
    }

    fn sums(&self, term: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.total.len()];
        for (k, &number) in self.of_free.iter().enumerate() {
            if number != NONE {
                sums[number as usize] += term(k);
            }
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A correction reaches the resultants along translations, keeps differences within them, and leaves held coordinates alone.
    #[test]
    fn corrections_reach_the_resultants() {
        let free = FreeTranslations {
            of_free: vec![0, 1, NONE, 0],
            mass: vec![1.0, 2.0, 5.0, 3.0],
            total: vec![4.0, 2.0],
        };
        let r = [8.0, 3.0, 7.0, -2.0];
        let mut delta = [0.5, 0.25, 9.0, 1.0];
        free.correct(free.resultants(&r), &mut delta);
        assert_eq!(delta[0] + 3.0 * delta[3], 6.0);
        assert_eq!(delta[3] - delta[0], 0.5);
        assert_eq!([delta[1], delta[2]], [1.5, 9.0]);
    }
}
