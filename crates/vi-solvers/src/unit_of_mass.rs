//! Chooses a power of two as unit of mass. Square roots of masses and of energies are taken in this unit. The root of a
//! power of two need not be a power of two, so with roots in kilograms the bits of a motion would depend on the unit of
//! mass of the scene.

use crate::vectors::per_unit;

/// Returns the inverse of the unit for these masses of the free coordinates, kg⁻¹.
pub(crate) fn per_unit_of_mass(mass: &[f64]) -> f64 {
    mass.first().map_or(1.0, |mass| per_unit(*mass))
}
