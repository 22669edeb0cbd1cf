//! A flag held at one edge in gusts of wind: its energy comes from the wind alone, and the ledger records how much.

use variational::prelude::*;

fn main() {
    let cloth = SheetLaw::examples().remove(0);
    let shape: SheetMesh =
        serde_json::from_str(r#"{ "size": [1.0, 0.6], "cells": [10, 6] }"#).expect("a sound shape");
    let mut scene = Scene::new(Time::new(0.2, 1e-4, SchemeName::StormerVerlet))
        .gravity([0.0, 0.0, -9.81])
        .body(Body::from_sheet("flag", shape, cloth))
        .fix(Fix::region("flag", "x-min"));
    scene.wind = serde_json::from_str(r#"{ "velocity": [8.0, 1.0, 0.0] }"#).ok();
    let mut simulation = Simulation::new(scene).expect("a valid scene");
    let before = simulation.observe().total();
    let mut work = 0.0;
    while !simulation.is_done() {
        let energy = simulation.step().expect("a stable step").energy;
        work += energy.force + energy.scheme;
    }
    let change = simulation.observe().total() - before;
    println!("the wind did {work:.6} J of work, the flag has {change:.6} J more");
    assert!((work - change).abs() < 1e-8 * work.abs().max(1.0));
}
