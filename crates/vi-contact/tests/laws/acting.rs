//! Tests the forces of a step, pair by pair: their sum is the discrete gradient, and their tangents are the derivatives
//! of the forces.

use std::sync::Arc;

use crate::support::{Numbers, sheets_half_a_layer_apart};
use vi_contact::{ContactPotential, Surface};
use vi_core::{Acting, DiscreteGradient, Potential, Stencils, StepSpan, Tube};

/// A step over which all damping acts.
const OVER: StepSpan = StepSpan { duration: 1e-3, acts_at_end: false, damps_end: false };
/// A step in which forces act at the end.
const AT_END: StepSpan = StepSpan { acts_at_end: true, ..OVER };

/// Returns two sheets half a layer apart, shifted against each other, and a motion that presses and slides them.
fn sheets(friction: f64) -> (Arc<Surface>, [Vec<f64>; 2]) {
    let (mut builder, x) = sheets_half_a_layer_apart();
    builder.friction(friction);
    let mut numbers = Numbers::new(11);
    let moved = x.iter().enumerate().map(|(k, value)| {
        let is_upper = x[k - k % 3 + 2] > 0.01;
        let slide = if k % 3 == 0 && is_upper { 2e-3 } else { 0.0 };
        value + slide + 1e-3 * (numbers.unit() - 0.5)
    });
    let end = moved.collect();
    (Arc::new(builder.build().expect("a valid surface")), [x, end])
}

fn sum(acting: &Acting, count: usize) -> Vec<f64> {
    let mut sum = vec![0.0; count];
    for &(node, value) in acting.gradients().flatten() {
        (0..3).for_each(|axis| sum[3 * node as usize + axis] += value[axis]);
    }
    sum
}

/// Returns the gradient of a potential.
fn summed(term: &dyn Potential, x: &[f64]) -> Vec<f64> {
    let stencils = term.stencils();
    let mut blocks = vec![0.0; stencils.count() * stencils.size()];
    term.gradients(0..stencils.count(), x, 0.0, &mut blocks);
    add_blocks(stencils, &blocks, x.len())
}

/// Returns the sum of the blocks of stencils.
fn add_blocks(stencils: Stencils<'_>, blocks: &[f64], count: usize) -> Vec<f64> {
    let mut sum = vec![0.0; count];
    for (stencil, block) in blocks.chunks_exact(stencils.size()).enumerate() {
        for (&node, three) in stencils.of(stencil).iter().zip(block.chunks_exact(3)) {
            (0..3).for_each(|axis| sum[3 * node as usize + axis] += three[axis]);
        }
    }
    sum
}

/// Returns vᵀHv for the packed blocks H of stencils.
fn along(stencils: Stencils<'_>, blocks: &[f64], direction: &[f64]) -> f64 {
    let packed = vi_core::packed_len(stencils.size());
    let of_block = |(stencil, block): (usize, &[f64])| {
        let of_node = |&node: &u32| (0..3).map(move |k| direction[3 * node as usize + k]);
        let v: Vec<f64> = stencils.of(stencil).iter().flat_map(of_node).collect();
        let mut sum = 0.0;
        for row in 0..v.len() {
            for column in 0..=row {
                let twice = if row == column { 1.0 } else { 2.0 };
                sum += twice * v[row] * v[column] * block[vi_core::packed_len(row) + column];
            }
        }
        sum
    };
    blocks.chunks_exact(packed).enumerate().map(of_block).sum()
}

/// Returns vᵀHv for the Hessian H of a potential.
fn curvature_along(term: &dyn Potential, x: &[f64], direction: &[f64]) -> f64 {
    let stencils = term.stencils();
    let mut blocks = vec![0.0; stencils.count() * vi_core::packed_len(stencils.size())];
    term.hessians(0..stencils.count(), x, 0.0, &mut blocks);
    along(stencils, &blocks, direction)
}

#[test]
fn pairs_sum_to_the_forces_of_a_step_with_friction_and_in_a_narrowed_list() {
    [OVER, AT_END].into_iter().for_each(sum_to_the_forces_of);
}

fn sum_to_the_forces_of(span: StepSpan) {
    let (surface, [start, end]) = sheets(0.4);
    let wide = ContactPotential::near(surface, &start, 0.1);
    let narrow = wide.narrowed(&Tube::about(&start, 3e-3)).expect("contact narrows");
    assert!(narrow.stencils().count() < wide.stencils().count());
    let over = wide.over_step(span, &[]).expect("friction acts over a step");
    let stencils = wide.stencils();
    let mut blocks = vec![0.0; stencils.count() * stencils.size()];
    over.gradients(0..stencils.count(), &start, &end, &mut blocks);
    let expected = add_blocks(stencils, &blocks, start.len());
    let narrow = narrow.discrete_gradient().and_then(|term| term.over_step(span, &[]));
    for term in [over, narrow.expect("friction acts over a step")] {
        let mut acting = Acting::default();
        term.acting(&start, &end, &mut acting);
        assert!(acting.count() > 20);
        let largest = expected.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        for (found, expected) in sum(&acting, start.len()).iter().zip(&expected) {
            assert!((found - expected).abs() <= 1e-13 * largest, "{found} {expected}");
        }
    }
}

/// Without friction, forces at the end of a step are the derivatives of the energy there, and their symmetric tangent is part of its
/// second derivative: along the normal of two parallel sheets, all of it.
#[test]
fn forces_at_the_end_are_the_gradient_there() {
    let (surface, [start, end]) = sheets(0.0);
    let contact = ContactPotential::near(surface, &start, 0.1);
    let term = contact.over_step(AT_END, &[]).expect("contact acts over a step");
    let stencils = contact.stencils();
    let mut expected = vec![0.0; stencils.count() * stencils.size()];
    let mut found = expected.clone();
    Potential::gradients(&contact, 0..stencils.count(), &end, 0.0, &mut expected);
    term.gradients(0..stencils.count(), &start, &end, &mut found);
    let largest = expected.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    assert!(largest > 0.0);
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found - expected).abs() <= 1e-12 * largest, "{found} {expected}");
    }
    let approach = |k: usize| if k % 3 == 2 && start[k] > 0.01 { -1.0 } else { 0.0 };
    let direction: Vec<f64> = (0..start.len()).map(approach).collect();
    let along = |blocks: &[f64]| along(stencils, blocks, &direction);
    let count = stencils.count() * vi_core::packed_len(stencils.size());
    let (mut whole, mut part) = (vec![0.0; count], vec![0.0; count]);
    contact.hessians(0..stencils.count(), &start, 0.0, &mut whole);
    term.tangents(0..stencils.count(), &start, &start, &mut part);
    let [whole, part] = [along(&whole), along(&part)];
    assert!(whole > 0.0 && (part / whole - 1.0).abs() < 1e-9, "{part:e} {whole:e}");
}

/// Bounds spare most pairs of a narrowed list the check of their path, and limit the same nodes by the same parts.
#[test]
fn a_narrowed_list_limits_the_same_nodes() {
    let (surface, [start, end]) = sheets(0.0);
    let wide = ContactPotential::near(surface, &start, 0.1);
    // The upper sheet, which has fewer than half of the nodes, falls through the lower one.
    let falls = |k: usize| k % 3 == 2 && k >= start.len() * 6 / 11;
    let end: Vec<f64> = (0..).zip(&end).map(|(k, x)| if falls(k) { x - 0.03 } else { *x }).collect();
    let motion = end.iter().zip(&start).map(|(end, start)| end - start).collect();
    let tube = Tube { start: start.clone(), motion, reach: vec![1e-6; start.len() / 3] };
    let narrow = wide.narrowed(&tube).expect("contact narrows");
    assert!(narrow.stencils().count() < wide.stencils().count());
    let [expected, found] =
        [&wide as &dyn Potential, narrow.as_ref()].map(|term| term.meetings(&start, &end, 0.25));
    assert!(!expected.is_empty(), "sheets meet");
    assert_eq!(found, expected);
}

/// The upper sheet falls by more than the gap. A pair is limited where half of its gap is left, and only if less than a quarter
/// would be left.
#[test]
fn a_limited_motion_leaves_a_part_of_each_gap() {
    let (surface, [start, _]) = sheets(0.0);
    let contact = ContactPotential::near(surface, &start, 0.1);
    let falls = |k: usize| k % 3 == 2 && k >= start.len() * 6 / 11;
    let to = |part: f64| -> Vec<f64> {
        start.iter().enumerate().map(|(k, x)| if falls(k) { x - 0.03 * part } else { *x }).collect()
    };
    let least = |part: f64| {
        let met = contact.meetings(&start, &to(part), 0.25);
        met.iter().map(|meeting| meeting.part * part).fold(f64::INFINITY, f64::min)
    };
    let part = least(1.0);
    assert!((0.3..=1.0 / 3.0).contains(&part), "{part}");
    assert!(contact.meetings(&start, &to(1.0), 0.25).iter().all(|meeting| meeting.size > 0.05));
    assert_eq!(least(0.49), f64::INFINITY);
    assert!((least(0.51) - part).abs() < 0.05);
}

/// Without those of directions, tangents neglect the rotation of normals and the motion of the closest points, which are of
/// the order of the gap and of the slip divided by the size of triangles. With them, the error is of the order of the product of
/// both, 2e-3 here.
#[test]
fn tangents_are_those_of_the_forces_while_friction_slides() {
    let cases = [(0.0, false, 0.1), (0.4, false, 0.1), (0.0, true, 5e-3), (0.4, true, 0.1)];
    for (span, (friction, turns, tolerance)) in
        [OVER, AT_END].into_iter().flat_map(|span| cases.map(|case| (span, case)))
    {
        let (surface, [start, end]) = sheets(friction);
        let contact = ContactPotential::near(surface, &start, 0.1);
        let term = contact.over_step(span, &[]).expect("contact acts over a step");
        let at = |x: &[f64]| {
            let mut acting = Acting::default();
            acting.turns = turns;
            term.acting(&start, x, &mut acting);
            acting
        };
        let mut numbers = Numbers::new(3);
        let direction: Vec<f64> = start.iter().map(|_| numbers.unit() - 0.5).collect();
        let shifted = |by: f64| -> Vec<f64> { end.iter().zip(&direction).map(|(x, d)| x + by * d).collect() };
        let [before, after] = [-1e-7, 1e-7].map(|by| sum(&at(&shifted(by)), start.len()));
        let mut product = vec![0.0; start.len()];
        let acting = at(&end);
        let tangents: Vec<_> = acting.tangents().collect();
        for pair in tangents.chunks_exact(2) {
            let dot = |&(node, value): &(u32, [f64; 3])| -> f64 {
                (0..3).map(|axis| value[axis] * direction[3 * node as usize + axis]).sum()
            };
            let along: f64 = pair[1].iter().map(dot).sum();
            for &(node, value) in pair[0] {
                (0..3).for_each(|axis| product[3 * node as usize + axis] += along * value[axis]);
            }
        }
        let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|v| v * v).sum::<f64>().sqrt();
        let size = norm(&mut product.iter().copied());
        let error =
            norm(&mut product.iter().zip(before.iter().zip(&after)).map(|(p, (a, b))| p - (b - a) / 2e-7));
        assert!(error < tolerance * size, "{span:?}, μ = {friction}, {turns}: {error:e} of {size:e}");
    }
}

/// Lagged friction is the friction of the step at the configuration whose normal forces it has, whether pairs slide or stick; its gradient is
/// the derivative of its energy, and its Hessian that of its gradient.
#[test]
fn lagged_friction_is_a_potential_of_the_friction_of_a_step() {
    for friction in [0.4, 400.0] {
        let (surface, [start, end]) = sheets(friction);
        let contact = ContactPotential::near(surface, &start, 0.1);
        let term = contact.over_step(AT_END, &[]).expect("friction acts over a step");
        let mut acting = Acting::default();
        term.acting(&start, &end, &mut acting);
        let both = sum(&acting, start.len());
        let lagged =
            contact.lagged_friction(AT_END, &[], [&start, &end], &acting).expect("friction is lagged");
        let gradient = |x: &[f64]| summed(lagged.as_ref(), x);
        let normal = summed(&contact, &end);
        let expected: Vec<f64> = both.iter().zip(&normal).map(|(both, normal)| both - normal).collect();
        let largest = expected.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        assert!(largest > 0.0);
        for (found, expected) in gradient(&end).iter().zip(&expected) {
            assert!((found - expected).abs() <= 1e-9 * largest, "{friction}: {found:e} {expected:e}");
        }
        let mut numbers = Numbers::new(5);
        let direction: Vec<f64> = start.iter().map(|_| numbers.unit() - 0.5).collect();
        let at = |length: f64| -> Vec<f64> {
            end.iter().zip(&direction).map(|(x, direction)| x + length * direction).collect()
        };
        let energy = |x: &[f64]| {
            let mut energies = vec![0.0; lagged.stencil_count()];
            lagged.energies(0..lagged.stencil_count(), x, 0.0, &mut energies);
            energies.iter().sum::<f64>()
        };
        let dot = |a: &[f64]| a.iter().zip(&direction).map(|(a, b)| a * b).sum::<f64>();
        let length = 1e-6;
        let slope = (energy(&at(length)) - energy(&at(-length))) / (2.0 * length);
        let along = dot(&gradient(&end));
        assert!((slope / along - 1.0).abs() < 1e-5, "{friction}: {slope:e} {along:e}");
        let curvature = (dot(&gradient(&at(length))) - dot(&gradient(&at(-length)))) / (2.0 * length);
        let second = curvature_along(lagged.as_ref(), &end, &direction);
        assert!(
            second > 0.0 && (curvature / second - 1.0).abs() < 1e-4,
            "{friction}: {curvature:e} {second:e}"
        );
    }
}
