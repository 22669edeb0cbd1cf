//! Tests friction: balance of energy and momenta, sticking without creep, and stopping as Coulomb's law predicts.

use crate::support::particles::Particles;
use crate::support::{Numbers, Vec3, at, body};
use vi_contact::{Anchors, Body, Contact, Neighbours, Partners, StepSettings, Surface, SurfaceBuilder};
use vi_core::Tube;

const STEP: StepSettings = StepSettings::over(1e-3);

/// Returns a tetrahedron that touches another one with a corner; both spin and tumble. `friction` is μ.
fn spinning_pair(friction: f64) -> Particles {
    let x = [
        [0.3, 0.3, 0.04],
        [0.1, 0.2, 0.5],
        [0.6, 0.1, 0.6],
        [0.3, 0.7, 0.55],
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.2, 0.2, -0.6],
    ]
    .concat();
    let mut builder = SurfaceBuilder::new(&x);
    let bodies = [builder.body(body(0.05, 2e3)), builder.body(body(0.05, 2e3))];
    let faces =
        |base: u32| [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]].map(|t| t.map(|node: u32| node + base));
    builder.triangles(bodies[0], &faces(0));
    builder.triangles(bodies[1], &faces(4));
    builder.friction(friction);
    let surface = builder.build().expect("a valid surface");
    let mut particles = Particles::new(surface, vec![0.1, 0.2, 0.3, 0.2, 0.3, 0.1, 0.2, 0.4], x);
    particles.tie(&[0, 1, 2, 3], 1e3);
    particles.tie(&[4, 5, 6, 7], 1e3);
    // This spring pulls the corner back to the face, without any external force.
    particles.springs.push((0, 7, 0.3, 30.0));
    let (spin, tumble) = (Vec3::new(0.2, 0.1, 3.0), Vec3::new(1.5, -0.7, -1.0));
    for node in 0..8 {
        let place = at(&particles.x, node);
        let v = if node < 4 { spin.cross(&place) + Vec3::new(0.3, 0.0, -0.5) } else { tumble.cross(&place) };
        particles.v[3 * node as usize..3 * node as usize + 3].copy_from_slice(v.as_slice());
    }
    particles
}

/// Case H13: neither momentum changes, and the lost energy equals the dissipation by friction.
#[test]
fn a_spinning_pair_keeps_its_momenta() {
    for friction in [0.0, 0.4] {
        let mut particles = spinning_pair(friction);
        particles.step(1e-9);
        let ([p0, l0], e0) = (particles.momenta(), particles.energy());
        let mut touched = 0;
        for _ in 0..1000 {
            let before = particles.v.clone();
            particles.step(1e-3);
            touched += usize::from(particles.smallest_gap() < 0.05 && before != particles.v);
        }
        let [p, l] = particles.momenta();
        assert!(touched > 100, "{touched}");
        assert!((p - p0).norm() <= 1e-12 * p0.norm(), "{:e}", (p - p0).norm() / p0.norm());
        assert!((l - l0).norm() <= 1e-12 * l0.norm(), "{:e}", (l - l0).norm() / l0.norm());
        let balance = particles.energy() + particles.dissipated - e0;
        assert!(balance.abs() <= 1e-12 * e0, "{:e}", balance / e0);
        assert!(if friction > 0.0 { particles.dissipated > 1e-3 * e0 } else { particles.dissipated == 0.0 });
    }
}

/// For random steps of a pair, dissipation is never negative and equals the energy taken by the forces, to round-off.
#[test]
fn the_work_of_friction_is_dissipated_or_stored() {
    let mut numbers = Numbers::new(21);
    let x = [[0.3, 0.3, 0.05], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].concat();
    let wires = [[-0.5, 0.1, 0.05], [0.6, 0.0, 0.04], [0.1, -0.6, 0.0], [0.0, 0.7, 0.0]].concat();
    for (kind, rest) in [(0, x), (1, wires)] {
        let mut builder = SurfaceBuilder::new(&rest);
        let bodies = [builder.body(body(0.1, 1e4)), builder.body(body(0.1, 1e4))];
        if kind == 0 {
            builder.point(bodies[0], 0, 0.1);
            builder.triangles(bodies[1], &[[1, 2, 3]]);
        } else {
            builder.wires(bodies[0], &[[0, 1]]);
            builder.wires(bodies[1], &[[2, 3]]);
        }
        builder.friction(0.3);
        let surface = builder.build().expect("a valid surface");
        let neighbours = Neighbours::find(&surface, &rest, 1.0);
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let (mut anchors, mut x0) = (Anchors::default(), rest.clone());
        let mut stuck = 0;
        for round in 0..2000 {
            let size = if round % 2 == 0 { 1e-2 } else { 1e-4 };
            let x1: Vec<f64> = rest
                .iter()
                .zip(&x0)
                .map(|(rest, now)| now + size * (2.0 * numbers.unit() - 1.0) + 0.1 * size * (rest - now))
                .collect();
            let pairs = contact.step(&x0, &x1, &STEP);
            let rubs = contact.friction(&x0, &x1, &pairs, &anchors, &STEP);
            let after = Anchors::after(&rubs);
            for rub in &rubs {
                let work: f64 = (0..4)
                    .filter(|&a| a < rub.arity)
                    .map(|a| rub.gradient[a].dot(&(at(&x1, rub.nodes[a]) - at(&x0, rub.nodes[a]))))
                    .sum();
                let done = rub.traction.dot(&rub.slip);
                let stored = anchors.as_slice().iter().find(|anchor| anchor.partners == rub.partners);
                let k = 2.0 * rub.stiffness.max(1e-300);
                let before = stored.map_or(0.0, |anchor| anchor.stretch.iter().map(|e| e * e).sum::<f64>());
                let scale = rub.traction.norm() * (rub.slip.norm() + before.sqrt()) + k * before + 1e-12;
                assert!((work - done).abs() <= 1e-13 * scale.max(rub.traction.norm()), "{work:e} {done:e}");
                assert!(rub.dissipated >= 0.0);
                assert!(rub.traction.norm() <= 0.3 * rub.normal_force * (1.0 + 1e-12));
                stuck += usize::from(rub.traction.norm() < 0.299 * rub.normal_force);
                let force: Vec3 = rub.gradient.iter().sum();
                let torque: Vec3 = (0..4)
                    .map(|a| ((at(&x0, rub.nodes[a]) + at(&x1, rub.nodes[a])) * 0.5).cross(&rub.gradient[a]))
                    .sum();
                assert!(force.norm() + torque.norm() <= 1e-13 * rub.traction.norm(), "{force:?} {torque:?}");
            }
            // The energy accounts of all pairs close.
            let done: f64 = rubs.iter().map(|rub| rub.traction.dot(&rub.slip)).sum();
            let taken: f64 = rubs.iter().map(|rub| rub.dissipated).sum();
            let released: f64 = anchors.energy(&surface) - rubs.iter().map(|rub| rub.stored).sum::<f64>();
            let open = anchors.as_slice().iter().any(|a| !rubs.iter().any(|rub| rub.partners == a.partners));
            let size = anchors.energy(&surface) + after.energy(&surface) + done.abs();
            assert!(open || (done + released - taken).abs() <= 1e-14 * size.max(1.0));
            let numbers = after.to_numbers();
            assert_eq!(Anchors::from_numbers(&numbers, &surface), Some(after.clone()));
            (anchors, x0) = (after, x1);
        }
        assert!(stuck > 100, "{stuck}");
    }
}

/// Returns a point, node 0, that touches a triangle with friction, and the positions of the nodes.
fn point_over_triangle() -> (Surface, Vec<f64>) {
    let rest = [[0.3, 0.3, 0.05], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].concat();
    let mut builder = SurfaceBuilder::new(&rest);
    let bodies = [builder.body(body(0.1, 1e4)), builder.body(body(0.1, 1e4))];
    builder.point(bodies[0], 0, 0.1);
    builder.triangles(bodies[1], &[[1, 2, 3]]);
    builder.friction(0.3);
    let surface = builder.build().expect("a valid surface");
    (surface, rest)
}

/// In an equilibrium, friction has no moment, however far its parts moved from the equilibrium before.
#[test]
fn friction_of_equilibria_has_no_moment() {
    let mut numbers = Numbers::new(24);
    let (surface, rest) = point_over_triangle();
    let between = StepSettings { duration: f64::INFINITY, acts_at_end: true, damping_at_end: 0.0 };
    let mut largest = 0.0_f64;
    for _ in 0..300 {
        let mut shaken =
            || rest.iter().map(|x| x + 0.02 * (2.0 * numbers.unit() - 1.0)).collect::<Vec<f64>>();
        let [mut x0, x1] = [(); 2].map(|()| shaken());
        x0[2] += numbers.unit();
        let neighbours = Neighbours::find(&surface, &x1, 1.0);
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let pairs = contact.step(&x1, &x1, &between);
        for rub in contact.friction(&x0, &x1, &pairs, &Anchors::default(), &between) {
            let force: Vec3 = rub.gradient.iter().sum();
            let torque: Vec3 = (0..rub.arity).map(|a| at(&x1, rub.nodes[a]).cross(&rub.gradient[a])).sum();
            assert!(force.norm() + torque.norm() <= 1e-13 * rub.traction.norm(), "{force:?} {torque:?}");
            largest = largest.max(rub.traction.norm());
        }
    }
    assert!(largest > 0.0);
}

#[test]
fn slip_is_zero_where_a_pair_moves_rigidly() {
    let mut numbers = Numbers::new(22);
    let (surface, rest) = point_over_triangle();
    let neighbours = Neighbours::find(&surface, &rest, 100.0);
    let contact = Contact { surface: &surface, neighbours: &neighbours };
    for _ in 0..300 {
        let rotation = nalgebra::Rotation3::from_scaled_axis(numbers.vector() * 2.0);
        let shift = numbers.vector();
        let x1: Vec<f64> = (0..4)
            .flat_map(|node| {
                let x = rotation * at(&rest, node) + shift;
                [x.x, x.y, x.z]
            })
            .collect();
        let pairs = contact.step(&rest, &x1, &STEP);
        let rubs = contact.friction(&rest, &x1, &pairs, &Anchors::default(), &STEP);
        assert!(rubs.iter().any(|rub| matches!(rub.partners, Partners::PointBody(0, 1))));
        assert!(rubs.iter().all(|rub| rub.slip.norm() <= 1e-14), "{:?}", rubs[0].slip);
    }
}

/// Returns a particle on a half-space inclined by 30°, with damping so that it comes to rest; gravity is 9.81.
fn on_a_slope(friction: f64, speed: f64) -> Particles {
    let x = vec![0.0, 0.0, 0.9e-3, 0.0, 0.0, 0.0];
    let mut builder = SurfaceBuilder::new(&x);
    let particle = builder.body(Body { radius: 0.0, distance: 1e-3, stiffness: 1e4, meets_itself: false });
    let slope = builder.body(body(1e-3, 1e4));
    builder.point(particle, 0, 0.01);
    builder.half_space(slope, 1, [0.0, 0.0, 1.0]);
    builder.friction(friction);
    builder.damping(0.01);
    let surface = builder.build().expect("a valid surface");
    let mut particles = Particles::new(surface, vec![1.0, f64::INFINITY], x);
    let (sin, cos) = 30_f64.to_radians().sin_cos();
    particles.gravity = Vec3::new(9.81 * sin, 0.0, -9.81 * cos);
    particles.v[0] = speed;
    particles
}

/// Case H5: the block stops after 0.479848 m, then stays within 1e-6 m for 10 s.
#[test]
fn a_block_stops_where_coulomb_says_and_does_not_creep() {
    for h in [1e-3, 1e-2] {
        let mut particles = on_a_slope(0.7, 1.0);
        // The block settles while it slides; the run-up changes the sliding distance by less than a thousandth.
        let steps = |time: f64| (time / h).round() as usize;
        for _ in 0..steps(1.5) {
            particles.step(h);
        }
        let stop = particles.x[0];
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let expected = 0.5 / (9.81 * (0.7 * cos - sin));
        assert!((expected - 0.479848).abs() < 1e-5);
        assert!((stop / expected - 1.0).abs() < 2e-3, "h = {h}: {stop} {expected}");
        for _ in 0..steps(10.0) {
            particles.step(h);
        }
        assert!((particles.x[0] - stop).abs() <= 1e-6, "h = {h}: creeps {:e}", particles.x[0] - stop);
    }
}

/// Case H6: the block sticks with μ = 1.01 tan θ and slides with 0.99 tan θ; with μ = 0.5 it accelerates at 0.657145
/// m/s².
#[test]
fn a_block_slides_where_the_slope_is_steeper_than_friction() {
    let limit = 30_f64.to_radians().tan();
    let run = |friction: f64| {
        let mut particles = on_a_slope(friction, 0.0);
        // Let it settle first without the slope.
        let slope = particles.gravity;
        particles.gravity = Vec3::new(0.0, 0.0, slope.z);
        (0..500).for_each(|_| particles.step(1e-3));
        particles.gravity = slope;
        [(); 2].map(|()| {
            (0..500).for_each(|_| particles.step(1e-3));
            particles.x[0]
        })
    };
    let [half, whole] = run(1.01 * limit);
    assert!((whole - half).abs() < 1e-9 && whole < 1e-3, "{half:e} {whole:e}");
    let [half, whole] = run(0.99 * limit);
    assert!(whole - half > 0.01);
    let [_, path] = run(0.5);
    assert!((path / 0.328573 - 1.0).abs() < 1e-3, "{path}");
}

/// Over a corner of a block, slip is measured along the face that presses, whatever the order of the cells is: to come nearer is
/// not to slip.
#[test]
fn slip_at_a_corner_is_along_the_face_that_presses() {
    let corners = (0..8).map(|k| [0, 1, 2].map(|axis: usize| if k >> axis & 1 == 1 { 1.0 } else { 0.0 }));
    let place = |point: [f64; 3]| std::iter::once(point).chain(corners.clone()).collect::<Vec<_>>().concat();
    // The faces x = 1, y = 1 and z = 1, which share the corner (1, 1, 1). The last one is cut there, so that its cells have the
    // most distant centroids.
    let faces = [[[1, 3, 5], [3, 7, 5]], [[2, 3, 6], [3, 7, 6]], [[4, 5, 7], [4, 7, 6]]];
    let (x0, x1) = (place([1.0, 1.0, 1.05]), place([1.003, 1.002, 1.04]));
    for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
        let mut builder = SurfaceBuilder::new(&x0);
        let bodies = [builder.body(body(0.1, 1e4)), builder.body(body(0.1, 1e4))];
        builder.point(bodies[0], 0, 0.1);
        let cells = order.map(|face: usize| faces[face].map(|cell| cell.map(|corner| 1 + corner))).concat();
        builder.triangles(bodies[1], &cells);
        builder.friction(0.3);
        let surface = builder.build().expect("a valid surface");
        let neighbours = Neighbours::find(&surface, &x0, 1.0);
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let pairs = contact.step(&x0, &x1, &STEP);
        let rubs = contact.friction(&x0, &x1, &pairs, &Anchors::default(), &STEP);
        assert_eq!(rubs.len(), 1);
        let error = rubs[0].slip - Vec3::new(0.003, 0.002, 0.0);
        assert!(error.norm() <= 1e-15, "{order:?}: {:?}", rubs[0].slip);
    }
}

/// The slip over a needle has the round-off of positions, wherever the numbering of its nodes begins: coordinates along the sides of its
/// small angle would have that times the squared ratio of its sides.
#[test]
fn slip_over_a_needle_has_the_round_off_of_positions() {
    let mut numbers = Numbers::new(3);
    for round in 0..300 {
        let (along, across) = (Vec3::new(0.6, 0.48, 0.64), Vec3::new(-0.8, 0.36, 0.48));
        let normal = along.cross(&across);
        let corner = Vec3::new(numbers.unit(), numbers.unit(), numbers.unit());
        let mut corners = [corner, corner + along, corner + across * 2e-2 + along * (1e-3 * numbers.unit())];
        corners.rotate_left(round % 3);
        let foot = (corners[0] + corners[1] + corners[2]) / 3.0;
        let x0: Vec<f64> =
            [foot + normal * 0.05].iter().chain(&corners).flat_map(|x| [x[0], x[1], x[2]]).collect();
        let mut builder = SurfaceBuilder::new(&x0);
        let (ball, needle) = (builder.body(body(0.1, 1e5)), builder.body(body(0.1, 1e5)));
        builder.point(ball, 0, 1e-2);
        builder.triangles(needle, &[[1, 2, 3]]);
        builder.friction(0.5);
        let surface = builder.build().expect("a valid surface");
        let neighbours = Neighbours::find(&surface, &x0, 1.0);
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let slip = along * (1e-7 * (numbers.unit() - 0.5)) + across * (1e-7 * (numbers.unit() - 0.5));
        let mut x1 = x0.clone();
        (0..3).for_each(|k| x1[k] += slip[k]);
        let exact = at(&x1, 0) - at(&x0, 0);
        let pairs = contact.step(&x0, &x1, &STEP);
        let friction = contact.friction(&x0, &x1, &pairs, &Anchors::default(), &STEP);
        assert_eq!(friction.len(), 1);
        let error = (friction[0].slip - exact).norm();
        assert!(error < 2e-15, "{round}: {error:e}");
    }
}

/// A point that is out of reach at the start of a step rubs against the cell that it reaches, also if another one was nearer at the
/// start: that one is not in lists of the pairs that can act.
#[test]
fn a_point_that_arrives_within_a_step_rubs_against_the_cell_that_it_reaches() {
    let floor = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let wall = [[0.0, 0.5, 0.2], [0.5, 0.5, 0.2], [0.25, 0.6, 0.6]];
    let start = [&[[0.25, 0.3, 0.3]][..], &floor, &wall].concat().concat();
    let mut builder = SurfaceBuilder::new(&start);
    let bodies = [builder.body(body(0.05, 1e4)), builder.body(body(0.05, 1e4))];
    builder.point(bodies[0], 0, 0.1);
    builder.triangles(bodies[1], &[[1, 2, 3], [4, 5, 6]]);
    builder.friction(0.3);
    let surface = builder.build().expect("a valid surface");
    let mut end = start.clone();
    end[1..3].copy_from_slice(&[0.2, 0.02]);
    let motion = end.iter().zip(&start).map(|(end, start)| end - start).collect();
    let path = Tube { start: start.clone(), motion, reach: vec![1e-3; 7] };
    let lists = [Neighbours::find(&surface, &start, 1.0), Neighbours::within(&surface, path)];
    assert_eq!(lists.each_ref().map(|list| list.cells_of(0).len()), [2, 1]);
    let [of_all, of_path] = lists.map(|neighbours| {
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let pairs = contact.step(&start, &end, &STEP);
        contact.friction(&start, &end, &pairs, &Anchors::default(), &STEP)
    });
    assert_eq!(of_all, of_path);
    let [friction] = &of_all[..] else { panic!("{of_all:?}") };
    assert!(friction.nodes.iter().all(|&node| node < 4), "{friction:?}");
    assert!(friction.traction.y < 0.0 && friction.dissipated > 0.0, "{friction:?}");
}
