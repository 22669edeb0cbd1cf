//! Tests the dampers at the end of a step: they keep both momenta, have their share of the damping, never pull, and leave sliding to
//! friction.

use std::sync::Arc;

use crate::support::{Numbers, sheets_half_a_layer_apart};
use vi_contact::{AT_END, ContactPotential};
use vi_core::{Damper, DiscreteGradient, EndForces, Potential, StepSpan};

const TAU: f64 = 1e-2;
const H: f64 = 1e-3;
const SPAN: StepSpan = StepSpan { duration: H, acts_at_end: false, damps_end: true };

/// Returns two damped sheets half a layer apart.
fn sheets(friction: f64) -> (ContactPotential, Vec<f64>) {
    let (mut builder, x) = sheets_half_a_layer_apart();
    builder.friction(friction);
    builder.damping(TAU);
    let surface = Arc::new(builder.build().expect("a valid surface"));
    (ContactPotential::near(surface, &x, 0.1), x)
}

fn dampers(contact: &ContactPotential, x: &[f64], velocity: &[f64]) -> Vec<Damper> {
    after(contact, SPAN, &[], x, velocity)
}

/// Returns the dampers after a step that ended with this memory.
fn after(
    contact: &ContactPotential,
    span: StepSpan,
    memory: &[f64],
    x: &[f64],
    velocity: &[f64],
) -> Vec<Damper> {
    let over = contact.over_step(span, memory).expect("damping acts over a step");
    let mut forces = EndForces::default();
    over.end_forces(x, velocity, &mut forces);
    // Those of friction have the coefficients of these rates, as if no damper pressed.
    let of_friction = forces.friction.iter().flat_map(|friction| {
        let rates = friction.along.each_ref().map(|damper| damper.rate(velocity));
        let coefficient = friction.coefficient_at(rates[0].hypot(rates[1]), 0.0);
        friction.along.each_ref().map(|damper| Damper { coefficient, ..damper.clone() })
    });
    let all = forces.dampers.iter().cloned().chain(of_friction);
    all.filter(|damper| damper.coefficient > 0.0).collect()
}

/// The velocity field in which the upper sheet moves with `v`.
fn moving(x: &[f64], v: [f64; 3]) -> Vec<f64> {
    x.chunks_exact(3).flat_map(|x| if x[2] > 0.01 { v } else { [0.0; 3] }).collect()
}

#[test]
fn dampers_have_neither_resultant_nor_moment() {
    let (contact, mut x) = sheets(0.4);
    let mut numbers = Numbers::new(5);
    x.iter_mut().for_each(|x| *x += 1e-3 * (numbers.unit() - 0.5));
    let found = dampers(&contact, &x, &moving(&x, [1e-9, 1e-9, -1e-9]));
    assert!(found.len() > 60, "{}", found.len());
    for damper in &found {
        let (mut sum, mut moment) = ([0.0; 3], [0.0; 3]);
        for &(node, b) in &damper.covector {
            let at = &x[3 * node as usize..][..3];
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                sum[k] += b[k];
                moment[k] += at[i] * b[j] - at[j] * b[i];
            }
        }
        let largest = sum.iter().chain(&moment).fold(0.0_f64, |largest, value| largest.max(value.abs()));
        assert!(largest < 1e-13, "{damper:?}");
    }
}

/// In the direction in which the sheets approach each other, D is the share of τ times the second derivative of the energy, and all
/// of it if forces act at the end of the step.
#[test]
fn dampers_have_their_share_of_the_damping_of_a_layer() {
    let (contact, x) = sheets(0.0);
    let approach = moving(&x, [0.0, 0.0, -1.0]);
    let along =
        |found: Vec<Damper>| -> f64 { found.iter().map(|d| d.coefficient * d.rate(&approach).powi(2)).sum() };
    let damped = along(dampers(&contact, &x, &approach));
    // Slow enough that no damper pulls.
    let slow: Vec<f64> = approach.iter().map(|v| 1e-9 * v).collect();
    let rate = |span: StepSpan| along(after(&contact, span, &[], &x, &slow));
    let at_end = rate(StepSpan { acts_at_end: true, ..SPAN });
    assert!((at_end * AT_END / rate(SPAN) - 1.0).abs() < 1e-12, "{at_end:e}");
    let energy = |s: f64| {
        let moved: Vec<f64> = x.iter().zip(&approach).map(|(x, v)| x + s * v).collect();
        let stencils = contact.stencils().count();
        let mut energies = vec![0.0; stencils];
        contact.energies(0..stencils, &moved, 0.0, &mut energies);
        energies.iter().sum::<f64>()
    };
    let s = 1e-5;
    let curvature = (energy(s) - 2.0 * energy(0.0) + energy(-s)) / (s * s);
    // Damping does not act on the pairs that inclusion and exclusion subtracts.
    let ratio = damped / (AT_END * TAU * curvature);
    assert!(ratio > 1.0 - 1e-4, "{ratio}");
    let faces: f64 = dampers(&contact, &x, &approach)
        .iter()
        .filter(|damper| damper.covector.len() == 4)
        .map(|d| d.coefficient * d.rate(&approach).powi(2))
        .sum();
    assert!(faces / damped > 0.1 && ratio < 20.0, "{ratio} {faces:e} {damped:e}");
}

#[test]
fn dampers_do_not_pull_and_leave_sliding_to_friction() {
    let (contact, x) = sheets(0.4);
    let push: f64 = {
        let mut gradients = vec![0.0; contact.stencils().count() * contact.stencils().size()];
        Potential::gradients(&contact, 0..contact.stencils().count(), &x, 0.0, &mut gradients);
        let stencils = contact.stencils();
        let upper = |stencil: usize, k: usize| x[3 * stencils.of(stencil)[k / 3] as usize + 2] > 0.01;
        let size = stencils.size();
        let forces = gradients.iter().enumerate().filter(|(k, _)| k % 3 == 2 && upper(k / size, k % size));
        -forces.map(|(_, force)| force).sum::<f64>()
    };
    let on_upper = |v: [f64; 3], axis: usize| -> f64 {
        let velocity = moving(&x, v);
        let forces = dampers(&contact, &x, &velocity);
        let force = |d: &Damper| -d.coefficient * d.rate(&velocity) * d.on_first[axis];
        forces.iter().map(force).sum::<f64>().abs()
    };
    // Slow motions are damped in proportion to their rates.
    let (slow, faster) = (on_upper([0.0, 0.0, 1e-9], 2), on_upper([0.0, 0.0, 2e-9], 2));
    assert!((faster / slow - 2.0).abs() < 1e-9, "{slow:e} {faster:e}");
    // Damping over the step may take the rest of the push.
    let (fast, share) = (on_upper([0.0, 0.0, 1e3], 2), AT_END * push);
    assert!(fast <= 1.5 * share && fast > 0.5 * share, "{fast:e} {share:e}");
    assert!(on_upper([1e-9, 0.0, 0.0], 0) > 0.0);
    let fast = on_upper([1e3, 0.0, 0.0], 0);
    assert!(fast <= 0.4 * 1.5 * push, "{fast:e} {push:e}");
    // After a step over which the sheets slid, slip is not damped, except at pairs that did not touch before the end.
    let end: Vec<f64> = x.iter().zip(moving(&x, [1e-3, 0.0, 0.0])).map(|(x, dx)| x + dx).collect();
    let memory = contact.over_step(SPAN, &[]).expect("damping acts over a step").outcome(&x, &end).memory;
    let velocity = moving(&x, [1e-9, 0.0, 0.0]);
    let drag = |dampers: Vec<Damper>| -> f64 {
        dampers.iter().map(|d| d.coefficient * d.rate(&velocity) * d.on_first[0]).sum::<f64>().abs()
    };
    let [stuck, slid] =
        [drag(dampers(&contact, &end, &velocity)), drag(after(&contact, SPAN, &memory, &end, &velocity))];
    assert!(slid < 0.05 * stuck, "{slid:e} {stuck:e}");
}
