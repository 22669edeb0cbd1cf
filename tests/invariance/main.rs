//! Tests invariance under units and translations. A scene in units of length, mass and time that are powers of two
//! times SI moves as it does in SI, to the bit. A translated scene moves as the original does, to the round-off of its
//! coordinates.

mod contact;
mod parts;
mod scenes;

use scenes::{RIGID, SHEET, SOLID, SPRINGS, TIES};
use variational::prelude::*;
use variational::simulation::stability::{stability, warning};
use variational::study::stress::Transform;

/// Units from 1e-9 to 1e9 of the original ones, as even and odd powers of two, alone and combined.
const UNITS: [[i32; 3]; 7] =
    [[-30, 0, 0], [0, -29, 0], [0, 0, 29], [30, 29, 0], [-29, 30, -30], [30, -30, 30], [1, 1, 1]];

/// Reads a scene with a scheme such as `gauss` with `stages = 2`.
fn scene(body: &str, step: f64, steps: u32, scheme: &str) -> Scene {
    let end = step * f64::from(steps);
    let text = format!("{body}\n[time]\nend = {end}\nstep = {step}\nscheme = {scheme}\n");
    let parsed = Scene::parse(&text, &[]);
    assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
    parsed.scene.unwrap()
}

/// Reads a scene without its initial velocities, in search of equilibria.
fn statics(body: &str) -> Scene {
    let body: String =
        body.lines().filter(|line| !line.contains("velocity = ")).map(|line| format!("{line}\n")).collect();
    let text = format!("{body}\n[time]\nend = 1.0\nstep = 0.5\nscheme = \"implicit-midpoint\"\n[static]\n");
    let parsed = Scene::parse(&text, &[]);
    assert!(parsed.problems.is_empty(), "{:?}", parsed.problems);
    parsed.scene.unwrap()
}

/// The positions of all nodes (m) and the orientations of rigid bodies at the end.
#[derive(Debug, PartialEq)]
struct End {
    places: Vec<[f64; 3]>,
    turns: Vec<[f64; 4]>,
}

fn run(scene: Scene) -> End {
    let mut simulation = Simulation::new(scene).unwrap_or_else(|problems| panic!("{problems:?}"));
    while !simulation.is_done() {
        simulation.step().unwrap();
    }
    let mut places: Vec<[f64; 3]> =
        (0..simulation.bodies().len()).flat_map(|body| simulation.positions(body)).collect();
    let poses = simulation.observe().rigids;
    places.extend(poses.iter().map(|pose| pose.position));
    End { places, turns: poses.iter().map(|pose| pose.orientation).collect() }
}

fn in_units([length, mass, time]: [i32; 3]) -> Transform {
    Transform::Units { length, mass, time }
}

/// Checks that a run in any of the units gives the same bits.
fn check_units(name: &str, scene: &Scene) {
    let own = run(scene.clone());
    assert!(own.places.iter().flatten().all(|x| x.is_finite()));
    for units in UNITS {
        let transform = in_units(units);
        let mut there = run(transform.of(scene).unwrap());
        let per_length = 1.0 / transform.factor([1, 0, 0]);
        there.places.iter_mut().flatten().for_each(|x| *x *= per_length);
        let off = own.places.iter().flatten().zip(there.places.iter().flatten());
        let off = off.fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
        assert!(own == there, "{name} in units {units:?}: off by {off:e}");
    }
}

/// The translation: 10⁵ to 10⁶ times the extent of the scenes, which is about 1 m.
const FAR: [f64; 3] = [1e6, -7e5, 4e5];

/// Largest growth of the round-off of a coordinate: the ratio of the stiffness of an element to that of the body. The
/// runs are short, less than a period of most modes.
const CONDITION: f64 = 500.0;

fn check_moved(name: &str, scene: &Scene) {
    let own = run(scene.clone());
    let there = run(Transform::Moved(FAR).of(scene).unwrap());
    let mut off = 0.0_f64;
    for (a, b) in own.places.iter().zip(&there.places) {
        off = (0..3).fold(off, |off, k| off.max((b[k] - FAR[k] - a[k]).abs()));
    }
    for (a, b) in own.turns.iter().zip(&there.turns) {
        off = (0..4).fold(off, |off, k| off.max((a[k] - b[k]).abs()));
    }
    let bound = CONDITION * f64::EPSILON * FAR[0];
    assert!(off <= bound, "{name}: off by {off:e} m, {bound:e} m of round-off");
}

const EXPLICIT: [&str; 3] = ["\"stormer-verlet\"", "\"blanes-moan-4\"", "\"symplectic-euler-a\""];
const IMPLICIT: [&str; 5] =
    ["\"implicit-midpoint\"", "\"gauss\"\nstages = 2", "\"energy-momentum\"", "\"newmark\"", "\"bdf2\""];
const OF_JOINTS: [&str; 3] = ["\"stormer-verlet\"", "\"implicit-midpoint\"", "\"energy-momentum\""];

/// Checks every body with every family of schemes that accepts it.
fn each(check: impl Fn(&str, &Scene)) {
    for (name, body, small, large) in [
        ("solid", SOLID, 2e-4, 0.01),
        ("sheet", SHEET, 5e-4, 0.01),
        ("springs", SPRINGS, 5e-4, 0.01),
        ("ties", TIES, 1e-4, 0.01),
    ] {
        for scheme in EXPLICIT {
            check(&format!("{name}, {scheme}"), &scene(body, small, 20, scheme));
        }
        for scheme in IMPLICIT {
            check(&format!("{name}, {scheme}"), &scene(body, large, 6, scheme));
        }
    }
    for scheme in OF_JOINTS {
        check(&format!("rigid, {scheme}"), &scene(RIGID, 5e-4, 20, scheme));
    }
}

#[test]
fn units_that_are_powers_of_two_change_no_bit_of_a_motion() {
    each(check_units);
}

#[test]
fn units_that_are_powers_of_two_change_no_bit_of_an_equilibrium() {
    for (name, body) in [("solid", SOLID), ("sheet", SHEET), ("springs", SPRINGS), ("ties", TIES)] {
        check_units(&format!("{name}, static"), &statics(body));
    }
}

#[test]
fn a_scene_moves_far_from_the_origin_as_it_does_near() {
    each(check_moved);
}

#[test]
fn equilibria_far_from_the_origin_are_those_near() {
    // The tied sheets buckle under weight in their plane, to either side: a part across the plane decides to which.
    let across = TIES.replace("gravity = [0.0, -9.81, 0.0]", "gravity = [0.0, -9.81, 0.5]");
    for (name, body) in [("solid", SOLID), ("ties", &across)] {
        check_moved(&format!("{name}, static"), &statics(body));
    }
}

/// Joints hold bodies of any size, from a picometre to a million kilometres.
#[test]
fn joints_hold_at_any_size() {
    let own = scene(RIGID, 5e-4, 20, "\"stormer-verlet\"");
    let end = run(own.clone());
    for length in [-40, -14, 10, 30] {
        let transform = in_units([length, 0, 0]);
        let there = run(transform.of(&own).unwrap());
        assert_eq!(there.turns, end.turns, "2^{length} m");
    }
}

/// `auto` chooses the same scheme and the same number of steps in all units and places.
#[test]
fn auto_does_not_see_units_or_places() {
    for body in [SOLID, SHEET] {
        let own = scene(body, 0.3, 1, "\"auto\"\ntolerance = 1e-2");
        let choice = |scene: Scene| {
            let (settled, _) = settle(scene, &mut ()).unwrap();
            let simulation = Simulation::new(settled).unwrap();
            (simulation.method(), simulation.step_count())
        };
        let chosen = choice(own.clone());
        assert!(chosen.1 > 10, "{chosen:?}");
        for units in [[-30, 0, 0], [0, -29, 0], [0, 0, 29], [-29, 30, -30]] {
            assert_eq!(choice(in_units(units).of(&own).unwrap()), chosen, "{units:?}");
        }
        assert_eq!(choice(Transform::Moved(FAR).of(&own).unwrap()), chosen);
    }
}

/// A warning about an explicit step above the limit is given wherever the scene lies. If the limit cannot be estimated,
/// the message says so.
#[test]
fn an_unstable_step_is_seen_from_afar() {
    let own = scene(SOLID, 0.05, 1, "\"stormer-verlet\"");
    let found = |scene: Scene| {
        let simulation = Simulation::new(scene).unwrap();
        (stability(&simulation), simulation.method())
    };
    let limit = found(own.clone()).0.unwrap().unwrap().step_limit;
    for by in [[0.0; 3], FAR, [3e7, 3e7, 3e7]] {
        let (note, method) = found(Transform::Moved(by).of(&own).unwrap());
        assert!(warning(&note, method).unwrap().contains("above the stability limit"), "{by:?}");
        let there = note.unwrap().unwrap().step_limit;
        assert!((there / limit - 1.0).abs() < 0.02, "{by:?}: {there} {limit}");
    }
    let (note, method) = found(Transform::Moved([2e12, 0.0, 0.0]).of(&own).unwrap());
    assert!(warning(&note, method).unwrap().contains("not known"), "{note:?}");
}
