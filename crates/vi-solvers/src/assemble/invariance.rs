//! Rigid motions under which the energy of a term is invariant. Terms do not declare them; they are found from
//! gradients at positions without symmetry. A few stencils are enough, because all stencils of a term have the same
//! form of energy.

use std::ops::Range;

use nalgebra::Vector3;
use vi_core::{Potential, Stencils};

/// Largest sum of forces or moments that counts as round-off, relative to the sizes of the summands.
const ROUND_OFF: f64 = 1e-9;

/// Returns coordinates without symmetry, m.
pub(crate) fn scattered(count: usize) -> Vec<f64> {
    (0..count).map(|k| (1.7 * k as f64 + 0.3).sin() + 0.01 * k as f64).collect()
}

/// Returns whether the forces of a term change if all its nodes are displaced equally. Terms of single nodes that are not affine do.
pub(crate) fn resists_translation(term: &dyn Potential) -> bool {
    let stencils = term.stencils();
    if stencils.arity < 2 || stencils.count() == 0 {
        return stencils.count() > 0;
    }
    let x = places(&stencils);
    let moved: Vec<f64> = x.iter().enumerate().map(|(k, x)| x + [0.7, -1.1, 0.4][k % 3]).collect();
    let [mut before, mut after] = [(); 2].map(|()| vec![0.0; stencils.size()]);
    some(&stencils).any(|stencil| {
        term.gradients(stencil.clone(), &x, 0.0, &mut before);
        term.gradients(stencil, &moved, 0.0, &mut after);
        let size = before.iter().fold(0.0_f64, |size, g| size.max(g.abs()));
        let change = before.iter().zip(&after).fold(0.0_f64, |change, (a, b)| change.max((a - b).abs()));
        // Outside its domain a term gives no answer; hyperelastic terms do not resist.
        size.is_finite() && change > ROUND_OFF * size
    })
}

/// Returns whether all stencils of a term depend on shape alone: no net force and no net moment.
pub(crate) fn is_internal(term: &dyn Potential) -> bool {
    let stencils = term.stencils();
    if stencils.block != 3 || stencils.arity < 2 || stencils.count() == 0 {
        return false;
    }
    let x = places(&stencils);
    let mut gradient = vec![0.0; stencils.size()];
    some(&stencils).all(|stencil| {
        let nodes = stencils.of(stencil.start);
        term.gradients(stencil, &x, 0.0, &mut gradient);
        let (mut force, mut torque, mut size) = (Vector3::zeros(), Vector3::zeros(), 0.0_f64);
        for (&node, g) in nodes.iter().zip(gradient.chunks_exact(3)) {
            let g = Vector3::new(g[0], g[1], g[2]);
            let at = Vector3::from_column_slice(&x[3 * node as usize..3 * node as usize + 3]);
            force += g;
            torque += at.cross(&g);
            size += g.norm() * (1.0 + at.norm());
        }
        // Outside its domain a term gives no answer; hyperelastic terms are internal.
        !size.is_finite() || force.norm() + torque.norm() <= ROUND_OFF * size
    })
}

/// Returns positions without symmetry for the nodes of stencils, m.
fn places(stencils: &Stencils<'_>) -> Vec<f64> {
    scattered(3 * stencils.nodes.iter().max().map_or(0, |&node| node as usize + 1))
}

/// Returns at most 16 of the stencils, each as a range.
fn some(stencils: &Stencils<'_>) -> impl Iterator<Item = Range<usize>> + use<> {
    let count = stencils.count();
    (0..count).step_by(count.div_ceil(16)).map(|stencil| stencil..stencil + 1)
}
