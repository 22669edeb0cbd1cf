//! How far bodies move on the way to an equilibrium: corrections that are too long, and bodies that nothing stops.

use crate::equilibrium::balance::Balance;
use crate::error::SolverError;
use crate::newton::free_translations::FreeTranslations;
use crate::vectors;

/// A body that moves farther than this multiple of its extent from one equilibrium to the next counts as unsupported.
const FARTHEST: f64 = 30.0;

/// The same of linear bodies, whose displacements under large loads are long.
const FARTHEST_LINEAR: f64 = 1e3;

/// The same in a pass with lagged friction, once bodies touch. With 30, a block of 6 × 6 × 3 cells that is pulled off a floor takes 32
/// instead of 4 s to fail.
const FARTHEST_SLIDE: f64 = 4.0;

/// Resultants below this fraction of the sum of absolute forces are round-off.
const ROUND_OFF: f64 = 1e-6;

impl Balance<'_> {
    /// Checks that no coordinate differs between two configurations by so many extents of the first that no support can stop
    /// the body.
    ///
    /// # Errors
    /// Returns [`SolverError::MovesAway`].
    pub(super) fn check_distance(&mut self, from: &[f64], to: &[f64], t: f64) -> Result<(), SolverError> {
        self.go_to(from, t);
        let (far, extent) = (vectors::max_abs(to.len(), |k| to[k] - from[k]), self.extent());
        if extent == 0.0 || far <= self.farthest() * extent {
            return Ok(());
        }
        Err(SolverError::MovesAway { extents: far / extent })
    }

    /// Returns the fraction of the change `dq` beyond which [`Balance::check_distance`] fails in any case, at most 1. Obstacles farther
    /// away are not looked for.
    pub(super) fn sensible_part(&self, dq: &[f64]) -> f64 {
        let (far, extent) = (vectors::max_abs(dq.len(), |k| dq[k]), self.extent());
        if extent > 0.0 { (2.0 * self.farthest() * extent / far).min(1.0) } else { 1.0 }
    }

    /// Returns the distance that bodies may move, as a multiple of their extent.
    fn farthest(&self) -> f64 {
        let may_slide =
            self.bond.is_none() && self.friction.as_ref().is_some_and(|friction| friction.is_lagged());
        match (self.is_linear, may_slide) {
            (true, _) => FARTHEST_LINEAR,
            (false, true) => FARTHEST_SLIDE,
            (false, false) => FARTHEST,
        }
    }

    /// Returns whether a correction is longer than the bodies, although V is not quadratic.
    pub(super) fn is_too_long(&self, step: &[f64]) -> bool {
        let extent = self.extent();
        !self.is_linear && extent > 0.0 && vectors::max_abs(step.len(), |k| step[k]) > extent
    }

    /// Returns the shift σ for which the root mean square of (K + σM)⁻¹ r is at most the extent L of the bodies, |r|/(L √m) with
    /// |r|² = Σ rᵢ²/mᵢ and m = Σ mᵢ, 1/s². Under weight alone this is g/L. Zero for a body without extent.
    pub(super) fn gentle_shift(&self, r: &[f64]) -> f64 {
        let (mass, extent) = (self.system.free_mass(), self.extent());
        if extent == 0.0 {
            return 0.0;
        }
        // The root of a square of an acceleration has the same bits in units that are powers of two.
        let square = vectors::sum(r.len(), |k| r[k] * r[k] / mass[k]) / vectors::sum(r.len(), |k| mass[k]);
        square.sqrt() / extent
    }

    /// Returns the size of an eigenvalue of M⁻¹K that is round-off, 1/s².
    pub(super) fn round_off_of_eigenvalues(&self) -> f64 {
        let mass = self.system.free_mass();
        let parts = self.diagonal.iter().zip(mass).map(|(stiffness, mass)| stiffness.abs() / mass);
        f64::EPSILON * parts.fold(0.0, f64::max)
    }

    /// Checks that the forces `r` balance along every axis of space along which nothing holds a body. Bodies that may touch others
    /// pass.
    ///
    /// # Errors
    /// Returns [`SolverError::MovesAway`] with an infinite distance.
    pub(super) fn check_supports(&self, r: &[f64]) -> Result<(), SolverError> {
        let Some(translations) = self.translations.get_or_init(|| FreeTranslations::new(self.system)) else {
            return Ok(());
        };
        let sizes: Vec<f64> = r.iter().map(|r| r.abs()).collect();
        let (net, all) = (translations.resultants(r), translations.resultants(&sizes));
        if net.iter().zip(&all).any(|(net, all)| net.abs() > ROUND_OFF * all) {
            return Err(SolverError::MovesAway { extents: f64::INFINITY });
        }
        Ok(())
    }
}
