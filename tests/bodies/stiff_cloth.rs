//! Drops a stiff sheet from horizontal at steps far beyond those that resolve it, under every implicit scheme: it
//! completes its first swing. A step may be halved, as a run does if the solver says that a smaller step may help. The
//! stepper then returns to the whole step.

use variational::prelude::*;
use vi_core::{State, System, kinetic_energy, reference};
use vi_solvers::{Method, SolverOptions, Stepper};

const STEP: f64 = 0.01;

fn sheet(young: f64) -> Simulation {
    let sheet = serde_json::from_str(r#"{ "size": [1.0, 1.0], "cells": [10, 10] }"#).unwrap();
    let law = format!(
        r#"{{ "law": "st-venant-kirchhoff", "young": {young}, "poisson": 0.3, "area_density": 0.2,
              "thickness": 1e-3 }}"#
    );
    let scene = Scene::new(Time::new(1.0, STEP, SchemeName::ImplicitMidpoint))
        .gravity([0.0, 0.0, -9.81])
        .body(Body::from_sheet("flag", sheet, serde_json::from_str::<SheetLaw>(&law).unwrap()))
        .fix(Fix::region("flag", "x-min"));
    Simulation::new(scene).unwrap()
}

/// Makes one step, halved as often as needed. Returns the number of steps made.
fn step(stepper: &mut dyn Stepper, system: &System, state: &mut State, h: f64, depth: u32) -> u32 {
    let before = state.clone();
    match stepper.step(system, state, h) {
        Ok(_) => 1,
        Err(error) => {
            assert_eq!(*state, before, "a failed step changed the state");
            assert!(error.smaller_step_may_help() && depth < 4, "{error}");
            step(stepper, system, state, 0.5 * h, depth + 1)
                + step(stepper, system, state, 0.5 * h, depth + 1)
        }
    }
}

/// Returns the number of steps of the run, and |ΔH| at its end over the largest kinetic energy.
fn drop(method: Method, young: f64, end: f64) -> (u32, f64) {
    let simulation = sheet(young);
    let component = &simulation.components()[0];
    let (system, mut state) = (component.system(), component.state().clone());
    let mut stepper = vi_solvers::stepper(&method, system, &SolverOptions::default()).unwrap();
    let energy = |state: &State| {
        kinetic_energy(system, state) + reference::energy(system, &system.positions(state), state.t)
    };
    let first = energy(&state);
    let (mut steps, mut exchange) = (0, 0.0_f64);
    for _ in 0..(end / STEP).round() as u32 {
        steps += step(stepper.as_mut(), system, &mut state, STEP, 0);
        exchange = exchange.max(kinetic_energy(system, &state));
    }
    println!("{method:?} {young:e}: {steps} steps {:?}", stepper.work());
    (steps, (energy(&state) - first).abs() / exchange)
}

#[test]
fn every_implicit_scheme_gets_through() {
    for method in [
        Method::ImplicitMidpoint,
        Method::Gauss { stages: 2 },
        Method::BackwardEuler,
        Method::Bdf2,
        Method::Newmark { beta: 0.25, gamma: 0.5 },
    ] {
        for young in [1e5, 1e9] {
            let (steps, drift) = drop(method, young, 0.4);
            assert!(steps <= 60, "{method:?} {young}: {steps} steps");
            assert!(drift.is_finite(), "{method:?} {young}: {drift}");
        }
    }
}

#[test]
fn energy_momentum_keeps_the_energy_of_stiff_cloth() {
    for young in [1e5, 1e7, 1e9] {
        let (steps, drift) = drop(Method::EnergyMomentum, young, 0.5);
        assert!(steps <= 75 && drift < 1e-6, "{young}: {steps} steps, drift {drift:e}");
    }
}

/// A step never costs more than its halves by much: the counted cost of a second of a falling flag stays level as the
/// step grows far beyond what Newton's method solves at once.
#[test]
fn larger_steps_do_not_cost_more() {
    for scheme in [SchemeName::EnergyMomentum, SchemeName::BackwardEuler, SchemeName::ImplicitMidpoint] {
        let cost = |step: f64| {
            let scene = sheet(1e6).scene().clone();
            let scene = Scene { time: Time::new(0.8, step, scheme), ..scene };
            let mut simulation = Simulation::new(scene).unwrap();
            while !simulation.is_done() {
                simulation.step().unwrap();
            }
            simulation.counted_seconds()
        };
        let costs = [2.5e-3, 5e-3, 1e-2, 2e-2, 4e-2].map(cost);
        // The cost of finding the cheapest length is part of it.
        assert!(costs.iter().all(|&cost| cost < 1.6 * costs[0]), "{scheme:?}: {costs:?}");
    }
}
