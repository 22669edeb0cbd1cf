//! A unit of mass that is a power of two. Square roots of masses, and of energies, which are proportional to masses, are taken in it:
//! the root of a power of two need not be one, so that roots in kilograms would make the bits of a motion depend on the unit of mass.

use crate::vectors::per_unit;

/// Returns the inverse of the unit for these masses of the free coordinates, kg⁻¹.
pub(crate) fn per_unit_of_mass(mass: &[f64]) -> f64 {
    mass.first().map_or(1.0, |mass| per_unit(*mass))
}
