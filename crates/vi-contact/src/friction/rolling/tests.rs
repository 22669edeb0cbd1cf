//! Tests the friction of balls and capsules.

use std::collections::BTreeMap;

use nalgebra::Rotation3;

use super::*;
use crate::broad_phase::Neighbours;
use crate::pairs::StepPair;
use crate::surface::{Body, Surface, SurfaceBuilder};
use crate::testing::Numbers;

/// Returns a ball (skeleton 0, frame 1–4) over a capsule (skeleton 5 and 6, frame 7–10) over a triangle (11–13).
fn round_bodies() -> (Surface, Vec<f64>) {
    let frame = |c: [f64; 3]| [c, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].concat();
    let x = [
        [0.1, 0.02, 0.515].to_vec(),
        frame([0.1, 0.02, 0.515]),
        [-0.3, 0.0, 0.105, 0.3, 0.0, 0.105].to_vec(),
        frame([0.0, 0.0, 0.105]),
        [-2.0, -1.0, 0.0, 2.0, -1.0, 0.0, 0.0, 2.0, 0.0].to_vec(),
    ]
    .concat();
    let mut builder = SurfaceBuilder::new(&x);
    let body = |radius| Body { radius, distance: 0.05, stiffness: 1e5, meets_itself: false };
    let bodies = [0.3, 0.1, 0.0].map(|radius| builder.body(body(radius)));
    builder.point(bodies[0], 0, 0.01);
    builder.frame(bodies[0], [1, 2, 3, 4]);
    builder.segment(bodies[1], [5, 6], 0.01);
    builder.frame(bodies[1], [7, 8, 9, 10]);
    builder.triangles(bodies[2], &[[11, 12, 13]]);
    builder.friction(0.3);
    (builder.build().expect("a valid surface"), x)
}

/// Moves node `c`, its directors and the skeleton by a rotation about c and a translation.
fn moved(x: &mut [f64], c: usize, skeleton: &[usize], turn: Rotation3<f64>, shift: Vec3) {
    let centre = at(x, c as u32);
    let mut set = |node: usize, place: Vec3| x[3 * node..3 * node + 3].copy_from_slice(place.as_slice());
    let place = |x: Vec3| centre + turn * (x - centre) + shift;
    set(c, centre + shift);
    (1..4).for_each(|k| set(c + k, turn * Vec3::ith(k - 1, 1.0)));
    let own: Vec<Vec3> = skeleton
        .iter()
        .map(
            |&node| {
                if node == 0 { centre } else { Vec3::new(if node == 5 { -0.3 } else { 0.3 }, 0.0, 0.105) }
            },
        )
        .collect();
    skeleton.iter().zip(own).for_each(|(&node, own)| set(node, place(own)));
}

fn rolling(contact: &Contact<'_>, x: [&[f64]; 2], anchors: &Anchors) -> Vec<RollingPair> {
    rolling_over(contact, x, anchors, StepSettings::over(1e-3))
}

fn rolling_over(
    contact: &Contact<'_>,
    x: [&[f64]; 2],
    anchors: &Anchors,
    settings: StepSettings,
) -> Vec<RollingPair> {
    let mut pressed: BTreeMap<Partners, Vec3> = BTreeMap::new();
    let [from, to] = settings.places(x);
    for pair in contact.step(from, to, &settings) {
        *pressed.entry(pair.partners).or_insert_with(Vec3::zeros) += StepPair::force(&pair);
    }
    let roll = |(partners, force): (Partners, Vec3)| {
        contact.roll(partners, Pressed::by(force.norm()), x, anchors, &settings)
    };
    pressed.into_iter().filter_map(roll).collect()
}

/// Moves the ball and the capsule at random.
fn shaken(rest: &[f64], numbers: &mut Numbers) -> Vec<f64> {
    let mut x = rest.to_vec();
    let mut turn = |size: f64| Rotation3::from_scaled_axis(numbers.vector() * size);
    // Gaps of 10 and 5 mm stay open at the largest of these motions.
    let turns = [turn(0.5), turn(0.01)];
    moved(&mut x, 1, &[0], turns[0], numbers.vector() * 0.005);
    moved(&mut x, 7, &[5, 6], turns[1], numbers.vector() * 0.001);
    x
}

/// Between equilibria, the forces have no moment in the second one.
#[test]
fn friction_of_round_bodies_has_no_moment_in_equilibrium() {
    let (surface, rest) = round_bodies();
    let neighbours = Neighbours::find(&surface, &rest, 1.0);
    let contact = Contact { surface: &surface, neighbours: &neighbours };
    let settings = StepSettings { duration: f64::INFINITY, acts_at_end: true, damping_at_end: 0.0 };
    let (mut numbers, mut count) = (Numbers::new(32), 0);
    for _ in 0..200 {
        let ends = [(); 2].map(|()| shaken(&rest, &mut numbers));
        let x = [ends[0].as_slice(), ends[1].as_slice()];
        for pair in rolling_over(&contact, x, &Anchors::default(), settings) {
            let nodes = contact.rolling_nodes(pair.partners, pair.cell);
            let forces = nodes.iter().zip(pair.spread.of(pair.held.traction));
            let moment: Vec3 = forces.map(|(&node, force)| at(x[1], node).cross(&force)).sum();
            assert!(moment.norm() <= 1e-13 * pair.held.traction.norm(), "{moment:?}");
            count += 1;
        }
    }
    assert!(count > 200, "{count}");
}

/// The work of friction is T·u, and the forces have neither a resultant nor a moment, however the bodies rotate.
#[test]
fn friction_of_round_bodies_keeps_both_momenta() {
    let (surface, rest) = round_bodies();
    let neighbours = Neighbours::find(&surface, &rest, 1.0);
    let contact = Contact { surface: &surface, neighbours: &neighbours };
    let (mut numbers, mut anchors, mut count) = (Numbers::new(31), Anchors::default(), 0);
    for _ in 0..500 {
        let ends = [(); 2].map(|()| shaken(&rest, &mut numbers));
        let x = [ends[0].as_slice(), ends[1].as_slice()];
        let pairs = rolling(&contact, x, &anchors);
        for pair in &pairs {
            let nodes = contact.rolling_nodes(pair.partners, pair.cell);
            let (mut work, mut force, mut torque) = (0.0, Vec3::zeros(), Vec3::zeros());
            for (&node, gradient) in nodes.iter().zip(pair.spread.of(pair.held.traction)) {
                work += gradient.dot(&(at(x[1], node) - at(x[0], node)));
                torque += ((at(x[0], node) + at(x[1], node)) * 0.5).cross(&gradient);
                // Directors are differences of positions: only points c and the nodes of triangles carry a
                // resultant force.
                if !matches!(node, 2..=4 | 8..=10) {
                    force += gradient;
                }
            }
            let size = pair.held.traction.norm();
            assert!((work - pair.held.traction.dot(&pair.slip)).abs() <= 1e-13 * size.max(1.0));
            assert!(force.norm() <= 1e-13 * size && torque.norm() <= 1e-13 * size, "{force:?} {torque:?}");
            assert!(pair.held.dissipated >= 0.0);
            count += 1;
        }
        anchors = Anchors::stretched(pairs.iter().map(|pair| pair.anchor));
    }
    assert!(count > 1000, "{count}");
}

/// The derivative of the slip is exact for bodies that stick, however far they approach, roll and spin within the step, and however
/// the triangle is deformed.
#[test]
fn the_change_of_slip_is_its_derivative_where_there_is_none() {
    let (surface, rest) = round_bodies();
    let neighbours = Neighbours::find(&surface, &rest, 1.0);
    let contact = Contact { surface: &surface, neighbours: &neighbours };
    let (mut numbers, mut kinds) = (Numbers::new(37), BTreeMap::new());
    for _ in 0..200 {
        let ends = [(); 2].map(|()| {
            let mut x = shaken(&rest, &mut numbers);
            x[33..].iter_mut().for_each(|x| *x += 0.003 * (numbers.unit() - 0.5));
            x
        });
        let [start, end] = &ends;
        let partners: Vec<_> = rolling(&contact, [start, end], &Anchors::default())
            .iter()
            .map(|pair| (pair.partners, pair.cell))
            .collect();
        for (partners, cell) in partners {
            let roll = |x: &[f64]| {
                let pressed = Pressed::by(1.0);
                let settings = StepSettings::over(1e-3);
                contact.roll(partners, pressed, [start, x], &Anchors::default(), &settings).expect("a pair")
            };
            // The first body, a ball or a capsule, is moved until it does not slip.
            let mut end = end.clone();
            let own = contact.rolling_nodes(partners, cell)[0];
            let skeleton = if own == 1 { vec![0] } else { vec![5, 6] };
            for _ in 0..20 {
                let slip = roll(&end).slip;
                for node in skeleton.iter().copied().chain([own as usize]) {
                    (0..3).for_each(|k| end[3 * node + k] -= slip[k]);
                }
            }
            let pair = roll(&end);
            assert!(pair.slip.norm() < 1e-12, "{partners:?}: {:?}", pair.slip);
            let change = contact.rolling_change(&pair, [start, &end]).expect("a pair");
            let (nodes, axis) = (contact.rolling_nodes(partners, cell), contact.axis_nodes(partners, cell));
            let direction: Vec<f64> = end.iter().map(|_| numbers.unit() - 0.5).collect();
            let shifted =
                |by: f64| -> Vec<f64> { end.iter().zip(&direction).map(|(x, d)| x + by * d).collect() };
            let along = |by: f64| roll(&shifted(by)).slip;
            let slope = (along(1e-6) - along(-1e-6)) / 2e-6;
            for k in 0..2 {
                let found: f64 = nodes
                    .iter()
                    .chain(&axis)
                    .zip(&change[k])
                    .map(|(&node, change)| change.dot(&at(&direction, node)))
                    .sum();
                let expected = pair.tangents[k].dot(&slope);
                assert!((found - expected).abs() < 1e-6, "{partners:?}, {k}: {found:e} {expected:e}");
            }
            let kind = match partners {
                Partners::Edges(..) => "edges",
                Partners::PointBody(0, 1) => "round bodies",
                _ => "triangle",
            };
            *kinds.entry(kind).or_insert(0) += 1;
        }
    }
    assert!(kinds.len() >= 2 && kinds.values().all(|&count| count > 20), "{kinds:?}");
}

/// A ball that rolls on a fixed triangle has no slip: Cayley's rotation by 2 tan(θ/2) about the point of contact.
#[test]
fn a_step_of_rolling_has_no_slip() {
    let (surface, mut rest) = round_bodies();
    moved(&mut rest, 7, &[5, 6], Rotation3::identity(), Vec3::new(0.0, 0.0, 50.0));
    let height = 0.34;
    let drop = height - rest[2];
    moved(&mut rest, 1, &[0], Rotation3::identity(), Vec3::new(0.0, 0.0, drop));
    let neighbours = Neighbours::find(&surface, &rest, 1.0);
    let contact = Contact { surface: &surface, neighbours: &neighbours };
    let mut x1 = rest.clone();
    let angle = 0.2_f64;
    let way = height * 2.0 * (0.5 * angle).tan();
    let turn = Rotation3::from_axis_angle(&Vec3::y_axis(), angle);
    moved(&mut x1, 1, &[0], turn, Vec3::new(way, 0.0, 0.0));
    let pairs = rolling(&contact, [&rest, &x1], &Anchors::default());
    assert!(!pairs.is_empty());
    assert!(pairs.iter().all(|pair| pair.slip.norm() < 1e-15), "{pairs:?}");
}
