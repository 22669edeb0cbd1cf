//! Laws of the forces over a step and of their tangents, for every element and material.

use vi_core::{Potential, packed_len};
use vi_mesh::CellKind;

use crate::solid::elastic::laws::{
    STRETCH, apply, bent, distorted, energy, flat, gradient_blocks, potential, size_of,
};
use crate::solid::element::SOLIDS;
use crate::solid::material::Law;

/// Returns a rotation by .8 rad about the third axis.
fn turn() -> [[f64; 3]; 3] {
    let (sin, cos) = 0.8_f64.sin_cos();
    [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]
}

/// Returns positions after [`turn`].
fn turned(x: &[f64]) -> Vec<f64> {
    x.chunks_exact(3).flat_map(|x| apply(&turn(), [x[0], x[1], x[2]])).collect()
}

/// Returns the forces over a step between two ends, one block per stencil.
fn forces_over_step(potential: &dyn Potential, ends: [&[f64]; 2]) -> Option<Vec<f64>> {
    let middle: Vec<f64> = ends[0].iter().zip(ends[1]).map(|(start, end)| 0.5 * (start + end)).collect();
    let mut forces = gradient_blocks(potential, &middle);
    let mut corrections = vec![0.0; forces.len()];
    let has = potential.corrections_over_step(0..potential.stencils().count(), ends, &mut corrections);
    forces.iter_mut().zip(&corrections).for_each(|(force, correction)| *force += correction);
    has.then_some(forces)
}

/// The forces over a step exchange exactly the change of energy, have neither a resultant nor a moment about the mean positions, and do
/// not see a rotation of both ends together or of one after the other.
#[test]
fn forces_over_a_step_exchange_the_change_of_energy() {
    for &kind in SOLIDS {
        let mesh = distorted(kind);
        for law in Law::examples() {
            let potential = potential(&mesh, &law);
            let stencils = potential.stencils();
            let turn = turn();
            let start = flat(&mesh, |point| apply(&STRETCH, point));
            let end = flat(&mesh, |point| apply(&turn, bent(point)));
            let Some(forces) = forces_over_step(potential.as_ref(), [&start, &end]) else {
                assert_eq!(law.name(), "linear");
                continue;
            };
            let (mut work, mut resultant, mut moment) = (0.0, [0.0; 3], [0.0; 3]);
            for (&node, force) in stencils.nodes.iter().zip(forces.chunks_exact(3)) {
                let first = 3 * node as usize;
                let middle = [0, 1, 2].map(|k: usize| 0.5 * (start[first + k] + end[first + k]));
                for k in 0..3 {
                    work += force[k] * (end[first + k] - start[first + k]);
                    resultant[k] += force[k];
                    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                    moment[k] += middle[i] * force[j] - middle[j] * force[i];
                }
            }
            let scale = size_of(&forces) * stencils.count() as f64;
            let change = energy(potential.as_ref(), &end) - energy(potential.as_ref(), &start);
            let name = law.name();
            assert!((work - change).abs() <= 1e-13 * scale, "{kind} {name}: {work} {change}");
            assert!(size_of(&resultant) <= 1e-13 * scale, "{kind} {name}: {resultant:?}");
            assert!(size_of(&moment) <= 1e-13 * scale, "{kind} {name}: {moment:?}");
            // Without a change of shape the forces are those at rest in between.
            let turned = turned(&start);
            let forces = forces_over_step(potential.as_ref(), [&start, &turned]).expect("a rotation");
            let at_start = gradient_blocks(potential.as_ref(), &start);
            for (over, before) in forces.chunks_exact(3).zip(at_start.chunks_exact(3)) {
                let after = apply(&turn, [before[0], before[1], before[2]]);
                for k in 0..3 {
                    let mean = 0.5 * (before[k] + after[k]);
                    assert!((over[k] - mean).abs() <= 1e-12 * size_of(&at_start), "{kind} {name}");
                }
            }
        }
    }
}

/// Over a short step they differ from the gradient in its middle by terms of second order.
#[test]
fn forces_over_a_step_have_order_two() {
    let mesh = distorted(CellKind::Hex8);
    for law in Law::examples().iter().filter(|law| law.name() != "linear") {
        let potential = potential(&mesh, law);
        let error = |h: f64| {
            let at = |s: f64| {
                flat(&mesh, |point| {
                    let (rest, moved) = (apply(&STRETCH, point), bent([point[1], point[2], point[0]]));
                    [0, 1, 2].map(|k: usize| rest[k] + s * moved[k])
                })
            };
            let forces = forces_over_step(potential.as_ref(), [&at(-h), &at(h)]).expect("a nonlinear law");
            let middle = gradient_blocks(potential.as_ref(), &at(0.0));
            let difference: Vec<f64> = forces.iter().zip(&middle).map(|(a, b)| a - b).collect();
            size_of(&difference)
        };
        let order = (error(0.04) / error(0.02)).log2();
        assert!((1.8..2.2).contains(&order), "{}: {order}", law.name());
    }
}

/// The tangent of the forces over a step that moves nothing is the Hessian. Over a step that turns a body at rest, rotations about the mean
/// positions have no moment.
#[test]
fn tangents_over_a_step_do_not_see_rotations() {
    for &kind in SOLIDS {
        let mesh = distorted(kind);
        for law in Law::examples().iter().filter(|law| law.name() != "linear") {
            let potential = potential(&mesh, law);
            let stencils = potential.stencils();
            let (count, size) = (stencils.count(), stencils.size());
            let [mut over, mut plain] = [(); 2].map(|()| vec![0.0; count * packed_len(size)]);
            let x = flat(&mesh, |point| apply(&STRETCH, point));
            assert!(potential.hessians_over_step(0..count, [&x, &x], false, &mut over));
            potential.hessians(0..count, &x, 0.0, &mut plain);
            let scale = size_of(&plain);
            let off = over.iter().zip(&plain).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off <= 1e-12 * scale, "{kind} {}: {off:e} of {scale:e}", law.name());

            let rest = flat(&mesh, |point| point);
            let turned = turned(&rest);
            for is_projected in [false, true] {
                potential.hessians_over_step(0..count, [&rest, &turned], is_projected, &mut over);
                for (stencil, block) in over.chunks_exact(packed_len(size)).enumerate() {
                    let nodes = stencils.of(stencil);
                    // The rotation about the third axis.
                    let along = |local: usize| {
                        let first = 3 * nodes[local / 3] as usize;
                        let middle = |k: usize| 0.5 * (rest[first + k] + turned[first + k]);
                        [-middle(1), middle(0), 0.0][local % 3]
                    };
                    for row in 0..size {
                        let entry = |column: usize| block[packed_len(row.max(column)) + row.min(column)];
                        let moment: f64 = (0..size).map(|column| entry(column) * along(column)).sum();
                        assert!(moment.abs() <= 1e-11 * scale, "{kind} {}: {moment:e}", law.name());
                    }
                }
            }
        }
    }
}
