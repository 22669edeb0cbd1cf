//! Circulatory forces: those that depend on positions and have no potential. Their tangent −∂f/∂x has a part that is not
//! symmetric, so that the symmetric part of K judges neither divergence nor flutter (Ziegler 1952).

use vi_core::{ForceAccount, System};

use crate::assemble::force_sum::ForceSum;
use crate::vectors;

/// Largest displacement by which tangents are measured, relative to the extent of the bodies. The force of a pressure is a
/// quadratic function of positions, so that its central difference is exact to round-off.
const DISPLACEMENT: f64 = 1e-3;

/// Returns the name of the first force that may be circulatory: all but damping, which is zero at rest.
pub fn circulatory(system: &System) -> Option<&str> {
    let found = system.forces().iter().find(|force| force.account() == ForceAccount::Force);
    found.map(|force| force.name())
}

/// Measures the part of the tangent that is not symmetric.
pub(crate) struct Circulation {
    forces: ForceSum,
}

impl Circulation {
    /// Returns the measure of a system; `None` if it has no circulatory force.
    pub(crate) fn new(system: &System) -> Option<Self> {
        circulatory(system)?;
        Some(Self { forces: ForceSum::new(system)? })
    }

    /// Returns A φ for a `shape` φ of the free coordinates, where −∂f/∂q at (x, t) is a symmetric matrix plus A.
    pub(crate) fn along(&mut self, system: &System, (x, t): (&[f64], f64), shape: &[f64]) -> Vec<f64> {
        let coordinates = system.coordinates();
        let (mut dx, still) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        coordinates.embed_change(shape, &mut dx);
        let farthest = vectors::max_abs(dx.len(), |dof| dx[dof]);
        let [extent, _] = coordinates.extent_and_reach(x);
        let mut part = vec![0.0; shape.len()];
        if farthest == 0.0 {
            return part;
        }
        // A single coordinate has no extent.
        let size = DISPLACEMENT * if extent > 0.0 { extent } else { 1.0 } / farthest;
        let Self { forces } = self;
        let mut force_at = |size: f64| {
            let place: Vec<f64> = x.iter().zip(&dx).map(|(x, dx)| x + size * dx).collect();
            forces.evaluate(&place, &still, t);
            let all: Vec<f64> = (0..x.len()).map(|dof| forces.total(dof)).collect();
            let mut free = vec![0.0; shape.len()];
            coordinates.restrict(&all, &mut free);
            free
        };
        let (there, back) = (force_at(size), force_at(-size));
        forces.evaluate(x, &still, t);
        if let Some(symmetric) = forces.stiffness(system) {
            symmetric.multiply(shape, &mut part);
        }
        vectors::update(&mut part, |k, part| *part = (back[k] - there[k]) / (2.0 * size) - *part);
        part
    }
}
