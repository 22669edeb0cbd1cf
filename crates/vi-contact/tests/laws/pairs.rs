//! Tests energies and forces of pairs: patch test, balance of energy and momenta over a step, derivatives.

use std::sync::Arc;

use crate::support::{Numbers, Sheet, Vec3, at, body};
use vi_contact::{
    ActivePair, Barrier, Body, Contact, ContactPotential, Neighbours, Partners, StepPair, StepSettings,
    Surface, SurfaceBuilder,
};
use vi_core::Potential;

const STEP: StepSettings = StepSettings::over(1e-3);

/// Returns two sheets as two bodies.
fn two_sheets(low: &Sheet, high: &Sheet, distance: f64, stiffness: f64) -> (Surface, Vec<f64>) {
    let mut all = Sheet::default();
    let (first, second) = (all.join(low), all.join(high));
    let mut builder = SurfaceBuilder::new(&all.x);
    let bodies = [builder.body(body(distance, stiffness)), builder.body(body(distance, stiffness))];
    builder.triangles(bodies[0], &first);
    builder.triangles(bodies[1], &second);
    (builder.build().expect("a valid surface"), all.x)
}

/// Case H14: a patch of 17 × 17 squares inside one of 20 × 20, half an activation distance apart.
#[test]
fn energy_per_area_and_pressure_do_not_depend_on_the_meshes() {
    for (n, m, low, high) in [(20, 17, 0.1, 0.9), (20, 20, 0.1, 0.9), (20, 10, 0.25, 0.75), (8, 31, 0.2, 0.7)]
    {
        let (d, kappa) = (0.01, 1e5);
        let (surface, x) =
            two_sheets(&Sheet::grid(n, 0.0, 1.0, 0.0), &Sheet::grid(m, low, high, 0.5 * d), d, kappa);
        let neighbours = Neighbours::find(&surface, &x, 0.1 * d);
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let per_area = kappa * d * Barrier::Cubic.value(0.5);
        let pressure = -kappa * Barrier::Cubic.slope(0.5);
        let pairs = contact.active(&x);
        // Every point of the smaller patch faces the larger one, so its half of the energy is that of its area.
        let nodes_below = (n + 1) * (n + 1);
        let own =
            pairs.iter().filter(|pair| is_point_of(pair, &surface, |node| node as usize >= nodes_below));
        let energy: f64 = own.map(|pair| pair.energy).sum();
        let area = (high - low) * (high - low);
        assert!((energy / (0.5 * area * per_area) - 1.0).abs() < 1e-12, "{n} on {m}: {energy}");
        // Every point away from the rim carries the pressure of its area, from both sides.
        let mut force = vec![Vec3::zeros(); x.len() / 3];
        for pair in pairs.iter().filter(|pair| matches!(pair.partners, Partners::PointBody(..))) {
            force[pair.nodes[0] as usize] += pair.gradient(&x)[0];
        }
        for point in surface.points() {
            let place = at(&x, point.node);
            let inside = (0..2).all(|k| place[k] > low + 1.01 * d && place[k] < high - 1.01 * d);
            if inside {
                let ratio = force[point.node as usize].norm() / (0.5 * point.area * pressure);
                assert!((ratio - 1.0).abs() < 1e-12, "{n} on {m}: {ratio} at {place:?}");
            }
        }
    }
}

fn is_point_of(pair: &ActivePair, surface: &Surface, of: impl Fn(u32) -> bool) -> bool {
    match pair.partners {
        Partners::PointBody(point, _) => of(surface.points()[point as usize].node),
        _ => false,
    }
}

/// Returns a crumpled sheet that meets itself and another one, with all kinds of features: valleys, ridges and rims.
fn crumpled(seed: u64) -> (Surface, Vec<f64>, Numbers) {
    let mut numbers = Numbers::new(seed);
    let mut all = Sheet::default();
    let first = all.join(&Sheet::grid(5, 0.0, 1.0, 0.0));
    let second = all.join(&Sheet::grid(4, 0.1, 0.8, 0.08));
    let wire: Vec<u32> = (0..4).map(|k| all.x.len() as u32 / 3 + k).collect();
    for k in 0..4 {
        all.x.extend([0.15 + 0.2 * f64::from(k), 0.5, 0.16]);
    }
    let single = all.x.len() as u32 / 3;
    all.x.extend([0.5, 0.52, 0.25]);
    let plane = single + 1;
    all.x.extend([0.0, 0.0, -0.1]);
    let mut builder = SurfaceBuilder::new(&all.x);
    let sheet = Body { meets_itself: true, ..body(0.15, 1e4) };
    for triangles in [&first, &second] {
        let number = builder.body(sheet);
        builder.triangles(number, triangles);
    }
    let rope = builder.body(Body { radius: 0.01, ..body(0.15, 2e4) });
    builder.wires(rope, &[[wire[0], wire[1]], [wire[1], wire[2]], [wire[2], wire[3]]]);
    let ball = builder.body(Body { radius: 0.03, ..body(0.15, 2e4) });
    builder.point(ball, single, 0.01);
    let ground = builder.body(body(0.15, 1e4));
    builder.half_space(ground, plane, [0.1, 0.0, 1.0]);
    let surface = builder.build().expect("a valid surface");
    let mut x = all.x;
    for value in &mut x[..3 * plane as usize] {
        *value += 0.03 * (2.0 * numbers.unit() - 1.0);
    }
    (surface, x, numbers)
}

#[test]
fn work_over_a_step_is_the_change_of_energy_and_no_momentum_is_made() {
    for seed in 0..40 {
        let (surface, x0, mut numbers) = crumpled(seed);
        let size = 0.02 * 10_f64.powf(-12.0 * numbers.unit());
        let plane = surface.half_spaces()[0].node as usize;
        let x1: Vec<f64> = x0
            .iter()
            .enumerate()
            .map(|(k, x)| if k / 3 == plane { *x } else { x + size * (2.0 * numbers.unit() - 1.0) })
            .collect();
        let neighbours = Neighbours::find(&surface, &x0, 0.2);
        assert!(neighbours.covers(&x1));
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let pairs = contact.step(&x0, &x1, &STEP);
        let mut gradient = vec![0.0; x0.len()];
        pairs.iter().for_each(|pair| pair.add_gradient(&mut gradient));
        let work: f64 = gradient.iter().zip(x0.iter().zip(&x1)).map(|(g, (a, b))| g * (b - a)).sum();
        let [before, after] = [&x0, &x1].map(|x| contact.energy(x));
        let size = contact.active(&x0).iter().map(|pair| pair.energy.abs()).sum::<f64>();
        assert!(pairs.len() > 100 && before.is_finite());
        let sum = |k: usize| pairs.iter().map(|pair| pair.energy[k]).sum::<f64>();
        assert!((sum(0) - before).abs() <= 1e-13 * size && (sum(1) - after).abs() <= 1e-13 * size);
        assert!((work - (after - before)).abs() <= 1e-13 * size, "{work:e} {:e} of {size:e}", after - before);
        for pair in &pairs {
            let force: Vec3 = pair.gradient.iter().sum();
            let largest = pair.gradient.iter().map(Vec3::norm).fold(0.0, f64::max);
            assert!(force.norm() <= 1e-14 * largest);
        }
        // Where a point passes from one cell to another, two pairs together have no moment.
        for of_point in pairs.chunk_by(|a, b| a.partners == b.partners) {
            if !matches!(of_point[0].partners, Partners::PointPlane(..)) {
                let middle = |node: u32| (at(&x0, node) + at(&x1, node)) * 0.5;
                let moment = |pair: &StepPair| -> Vec3 {
                    (0..4).map(|a| middle(pair.nodes[a]).cross(&pair.gradient[a])).sum()
                };
                let torque: Vec3 = of_point.iter().map(moment).sum();
                let norms = of_point.iter().flat_map(|pair| pair.gradient.iter().map(Vec3::norm));
                assert!(torque.norm() <= 1e-14 * norms.sum::<f64>(), "{torque:?}");
            }
        }
    }
}

/// Computes the sum over simplices without grouping, directly from the definition.
#[test]
fn grouping_by_closest_feature_does_not_change_the_sum() {
    use vi_contact::Shape;
    for seed in 100..120 {
        let (surface, x, _) = crumpled(seed);
        let neighbours = Neighbours::find(&surface, &x, 0.0);
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let grouped: f64 = contact
            .active(&x)
            .iter()
            .filter(|pair| is_point_of(pair, &surface, |node| node < 36) && is_against(pair, 1))
            .map(|pair| pair.energy)
            .sum();
        // The points of the first sheet against the second: 25 nodes from number 36 on.
        let cells: Vec<[u32; 3]> =
            surface.cells().iter().filter(|cell| cell.body == 1).map(|cell| cell.nodes).collect();
        let mut sum = 0.0;
        for point in surface.points().iter().filter(|point| point.body == 0) {
            let energy = 0.5 * point.area * 1e4 * 0.15;
            let place = at(&x, point.node);
            let value = |shape: Shape, nodes: &[u32]| {
                let mut positions = [place; 4];
                nodes.iter().zip(&mut positions[1..]).for_each(|(&node, place)| *place = at(&x, node));
                energy * Barrier::Cubic.value(shape.closest(&positions).distance() / 0.15)
            };
            let mut edges = std::collections::BTreeMap::<[u32; 2], i32>::new();
            let mut nodes = std::collections::BTreeMap::<u32, i32>::new();
            for &[a, b, c] in &cells {
                sum += value(Shape::PointTriangle, &[a, b, c]);
                for edge in [[a, b], [a, c], [b, c]] {
                    *edges.entry(edge).or_insert(1) -= 1;
                }
                [a, b, c].iter().for_each(|&node| *nodes.entry(node).or_insert(1) += 1);
            }
            for (&[a, b], &n) in &edges {
                sum += f64::from(n) * value(Shape::PointEdge, &[a, b]);
                [a, b].iter().for_each(|&node| *nodes.entry(node).or_insert(1) -= 1);
            }
            for (&node, &n) in &nodes {
                sum += f64::from(n) * value(Shape::PointPoint, &[node]);
            }
        }
        assert!(grouped > 0.0 && (grouped - sum).abs() <= 1e-12 * grouped, "{grouped} {sum}");
    }
}

fn is_against(pair: &ActivePair, body: u32) -> bool {
    matches!(pair.partners, Partners::PointBody(_, other) if other == body)
}

#[test]
fn gradients_and_hessians_agree_with_differences() {
    let (surface, x, mut numbers) = crumpled(7);
    let neighbours = Neighbours::find(&surface, &x, 0.1);
    let contact = Contact { surface: &surface, neighbours: &neighbours };
    let pairs = contact.active(&x);
    let direction: Vec<f64> = x.iter().map(|_| 2.0 * numbers.unit() - 1.0).collect();
    let shifted = |s: f64| -> Vec<f64> { x.iter().zip(&direction).map(|(x, d)| x + s * d).collect() };
    let gradient_at = |x: &[f64]| {
        let mut sum = vec![0.0; x.len()];
        for pair in contact.active(x) {
            for (node, g) in pair.nodes.iter().zip(pair.gradient(x)).take(pair.shape.arity()) {
                (0..3).for_each(|k| sum[3 * *node as usize + k] += g[k]);
            }
        }
        sum
    };
    let h = 1e-7;
    let slope: f64 = gradient_at(&x).iter().zip(&direction).map(|(g, d)| g * d).sum();
    let difference = (contact.energy(&shifted(h)) - contact.energy(&shifted(-h))) / (2.0 * h);
    assert!((slope - difference).abs() <= 1e-6 * slope.abs(), "{slope} {difference}");
    // Hessian times direction.
    let mut product = vec![0.0; x.len()];
    for pair in &pairs {
        let n = 3 * pair.shape.arity();
        let mut packed = vec![0.0; n * (n + 1) / 2];
        pair.hessian(&x, &mut packed);
        let dof = |i: usize| 3 * pair.nodes[i / 3] as usize + i % 3;
        let mut k = 0;
        for i in 0..n {
            for j in 0..=i {
                product[dof(i)] += packed[k] * direction[dof(j)];
                if i != j {
                    product[dof(j)] += packed[k] * direction[dof(i)];
                }
                k += 1;
            }
        }
    }
    let (plus, minus) = (gradient_at(&shifted(h)), gradient_at(&shifted(-h)));
    let size = product.iter().fold(0.0_f64, |size, v| size.max(v.abs()));
    for (k, product) in product.iter().enumerate() {
        let difference = (plus[k] - minus[k]) / (2.0 * h);
        assert!((product - difference).abs() <= 1e-5 * size, "{k}: {product} {difference} of {size}");
    }
}

/// The potential gives the same sum, whatever ranges it is evaluated in.
#[test]
fn the_potential_of_candidates_is_the_sum_over_acting_pairs() {
    let (surface, x, _) = crumpled(9);
    let surface = Arc::new(surface);
    let potential = ContactPotential::near(Arc::clone(&surface), &x, 0.05);
    let count = potential.stencils().count();
    let pairs = potential.contact().active(&x);
    let mut energies = vec![0.0; count];
    potential.energies(0..count, &x, 0.0, &mut energies);
    let expected: f64 = pairs.iter().map(|pair| pair.energy).sum();
    assert!((energies.iter().sum::<f64>() - expected).abs() <= 1e-12 * expected);
    let (mut gradients, mut hessians) = (vec![0.0; 12 * count], vec![0.0; 78 * count]);
    potential.gradients(0..count, &x, 0.0, &mut gradients);
    potential.hessians(0..count, &x, 0.0, &mut hessians);
    let mut sum = vec![0.0; x.len()];
    for (nodes, block) in potential.stencils().nodes.chunks(4).zip(gradients.chunks(12)) {
        block.iter().enumerate().for_each(|(i, g)| sum[3 * nodes[i / 3] as usize + i % 3] += g);
    }
    for pair in &pairs {
        for (node, g) in pair.nodes.iter().zip(pair.gradient(&x)).take(pair.shape.arity()) {
            (0..3).for_each(|k| sum[3 * *node as usize + k] -= g[k]);
        }
    }
    let largest = gradients.iter().fold(0.0_f64, |size, g| size.max(g.abs()));
    assert!(sum.iter().all(|rest| rest.abs() <= 1e-12 * largest));
    let mut projected = vec![0.0; 78 * count];
    potential.projected_hessians(0..count, &x, 0.0, &mut projected);
    // It is the positive part: neither negative nor less than the Hessian in any direction.
    let mut numbers = Numbers::new(4);
    for (projected, hessian) in projected.chunks(78).zip(hessians.chunks(78)) {
        let v: Vec<f64> = (0..12).map(|_| numbers.unit() - 0.5).collect();
        let form = |packed: &[f64]| -> f64 {
            let entries = (0..12).flat_map(|i| (0..=i).map(move |j| (i, j)));
            let terms = entries
                .zip(packed)
                .map(|((i, j), entry)| entry * v[i] * v[j] * if i == j { 1.0 } else { 2.0 });
            terms.sum()
        };
        let (positive, exact) = (form(projected), form(hessian));
        let size = hessian.iter().fold(0.0_f64, |size, entry| size.max(entry.abs()));
        assert!(positive >= exact.max(0.0) - 1e-12 * size, "{positive} {exact} of {size}");
    }
    let there = potential.at(&x).expect("the stencils of a point have work in common");
    for range in [0..1, 3..17, count - 30..count, count / 2..count / 2 + 1] {
        for potential in [&potential as &dyn Potential, there.as_ref()] {
            let mut part = vec![0.0; range.len()];
            potential.energies(range.clone(), &x, 0.0, &mut part);
            assert_eq!(part, energies[range.clone()]);
            let mut part = vec![0.0; 12 * range.len()];
            potential.gradients(range.clone(), &x, 0.0, &mut part);
            assert_eq!(part, gradients[12 * range.start..12 * range.end]);
            let mut part = vec![0.0; 78 * range.len()];
            potential.hessians(range.clone(), &x, 0.0, &mut part);
            assert_eq!(part, hessians[78 * range.start..78 * range.end]);
            potential.projected_hessians(range.clone(), &x, 0.0, &mut part);
            assert_eq!(part, projected[78 * range.start..78 * range.end]);
        }
    }
    let down: Vec<f64> = (0..x.len()).map(|k| if k % 3 == 2 && k < 108 { 1.0 } else { 0.0 }).collect();
    let (free, step) = (potential.free_path(&x, &down), potential.largest_step(&x, &down));
    assert!(free > 0.0 && free < 0.2 && step < free);
    // The discrete gradient of the stencils equals that of the pairs.
    let x1: Vec<f64> = x.iter().zip(&down).map(|(x, d)| x + 0.5 * step * d).collect();
    let exact = potential.discrete_gradient().expect("contact has one");
    exact.gradients(0..count, &x, &x1, &mut gradients);
    let mut work = 0.0;
    for (nodes, block) in potential.stencils().nodes.chunks(4).zip(gradients.chunks(12)) {
        for (i, g) in block.iter().enumerate() {
            let dof = 3 * nodes[i / 3] as usize + i % 3;
            work += g * (x1[dof] - x[dof]);
        }
    }
    let [before, after] = [&x, &x1].map(|x| potential.contact().energy(x));
    assert!((work - (after - before)).abs() <= 1e-12 * after.max(before), "{work} {}", after - before);
    exact.tangents(0..count, &x, &x, &mut hessians);
    let trace: f64 =
        hessians.chunks(78).map(|block| (0..12).map(|i| block[i * (i + 3) / 2]).sum::<f64>()).sum();
    let expected: f64 = pairs
        .iter()
        .map(|pair| 0.5 * pair.curvature * pair.closest.weights.iter().map(|c| c * c).sum::<f64>())
        .sum();
    assert!((trace / expected - 1.0).abs() < 1e-9, "{trace} {expected}");
}

#[test]
fn damping_takes_energy_and_never_pulls() {
    let mut numbers = Numbers::new(5);
    for _ in 0..500 {
        let x0 = [0.3, 0.3, 0.02 + 0.2 * numbers.unit(), 0.0, 0.0, 0.0];
        let mut builder = SurfaceBuilder::new(&x0);
        let (ball, ground) = (builder.body(body(0.1, 1e5)), builder.body(body(0.1, 1e5)));
        builder.point(ball, 0, 1e-2);
        builder.half_space(ground, 1, [0.0, 0.0, 1.0]);
        builder.damping(0.01);
        let surface = builder.build().expect("a valid surface");
        let mut x1 = x0;
        x1[2] = 0.02 + 0.2 * numbers.unit();
        let neighbours = Neighbours::find(&surface, &x0, 1.0);
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        for pair in contact.step(&x0, &x1, &STEP) {
            assert!(pair.dissipated >= 0.0 && pair.force()[2] >= 0.0);
            let work = -pair.force()[2] * (x1[2] - x0[2]);
            let change = pair.energy[1] - pair.energy[0];
            let size = pair.energy[0] + pair.energy[1] + pair.dissipated;
            assert!((work - change - pair.dissipated).abs() <= 1e-13 * size);
        }
    }
}

/// A point that moves over the edge between two cells of a plane is damped as if it stayed over one of them.
#[test]
fn damping_does_not_depend_on_cells() {
    let force = |from: f64, to: f64| {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let place = |along: f64, z: f64| [&[[0.5 + along, 0.5, z]][..], &corners[..]].concat().concat();
        let (x0, x1) = (place(from, 0.06), place(to, 0.04));
        let mut builder = SurfaceBuilder::new(&x0);
        let (ball, ground) = (builder.body(body(0.1, 1e5)), builder.body(body(0.1, 1e5)));
        builder.point(ball, 0, 1e-2);
        builder.triangles(ground, &[[1, 2, 3], [1, 3, 4]]);
        builder.damping(0.01);
        let surface = builder.build().expect("a valid surface");
        let neighbours = Neighbours::find(&surface, &x0, 1.0);
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let pairs = contact.step(&x0, &x1, &STEP);
        let total = |value: &dyn Fn(&StepPair) -> f64| pairs.iter().map(value).sum::<f64>();
        (total(&|pair| pair.force()[2]), total(&|pair| pair.dissipated))
    };
    let (expected, dissipated) = force(0.1, 0.1);
    assert!(dissipated > 0.5 * expected * 0.02, "damping is a large part of the force");
    for (from, to) in [(1e-6, -1e-6), (1e-6, 0.0), (0.0, 0.0), (1e-17, -1e-17), (-1e-9, 1e-6)] {
        let (found, taken) = force(from, to);
        assert!((found / expected - 1.0).abs() < 1e-6, "{from} {to}: {found} and not {expected}");
        assert!((taken / dissipated - 1.0).abs() < 1e-6, "{from} {to}: {taken} and not {dissipated}");
    }
}

/// At rest, neither the neighbours in a fine fold nor the two sides of a thin plate press on each other.
#[test]
fn a_body_at_rest_does_not_press_on_itself() {
    let (surface, _, _) = crumpled(1);
    let mut all = Sheet::default();
    let top = all.join(&Sheet::grid(6, 0.0, 1.0, 0.0));
    let bottom = all.join(&Sheet::grid(6, 0.0, 1.0, 0.01));
    let mut builder = SurfaceBuilder::new(&all.x);
    let plate = builder.body(Body { radius: 0.2, distance: 0.5, stiffness: 1e5, meets_itself: true });
    builder.triangles(plate, &top);
    builder.triangles(plate, &bottom);
    let thin = builder.build().expect("a valid surface");
    let neighbours = Neighbours::find(&thin, &all.x, 0.01);
    let contact = Contact { surface: &thin, neighbours: &neighbours };
    assert!(neighbours.count() > 0 && contact.smallest_gap(&all.x) > 0.0);
    assert_eq!(contact.active(&all.x), []);
    assert!(surface.points().len() > 60);
}

/// A ball against a fan of cells that wraps around it, all of whose nodes move at random. Inclusion and exclusion subtracts edges whose
/// distances change more than those of the cells: their damping must not add energy.
#[test]
fn damping_of_a_fan_of_cells_never_adds_energy() {
    let mut numbers = Numbers::new(11);
    let cells: Vec<[u32; 3]> = (0..6).map(|k| [1, 2 + k, 2 + (k + 1) % 6]).collect();
    let radius = 0.5;
    let mut crowded = 0;
    for _ in 0..500 {
        let fan = |k: usize| {
            let angle = k as f64 * std::f64::consts::TAU / 6.0;
            [0.1 * angle.cos(), 0.1 * angle.sin(), 0.01]
        };
        let rest = [[0.0, 0.0, radius + 0.05], [0.0; 3]].into_iter().chain((0..6).map(fan));
        let mut moved = |size: f64| -> Vec<f64> {
            rest.clone().flatten().map(|x| x + size * (numbers.unit() - 0.5)).collect()
        };
        let (x0, x1) = (moved(0.04), moved(0.04));
        let mut builder = SurfaceBuilder::new(&x0);
        let ball = builder.body(Body { radius, ..body(0.1, 1e5) });
        let sheet = builder.body(body(0.1, 1e5));
        builder.point(ball, 0, 1e-2);
        builder.triangles(sheet, &cells);
        builder.damping(0.01);
        let surface = builder.build().expect("a valid surface");
        let neighbours = Neighbours::find(&surface, &x0, 1.0);
        let contact = Contact { surface: &surface, neighbours: &neighbours };
        let pairs = contact.step(&x0, &x1, &STEP);
        let (mut work, mut change, mut dissipated, mut size) = (0.0, 0.0, 0.0, 0.0);
        for pair in &pairs {
            assert!(pair.dissipated >= 0.0, "{pair:?}");
            dissipated += pair.dissipated;
            change += pair.energy[1] - pair.energy[0];
            size += pair.energy[0].abs() + pair.energy[1].abs() + pair.dissipated;
            for (node, gradient) in pair.nodes.iter().zip(&pair.gradient).take(pair.arity) {
                let node = 3 * *node as usize;
                work += (0..3).map(|k| gradient[k] * (x1[node + k] - x0[node + k])).sum::<f64>();
            }
        }
        assert!((work - change - dissipated).abs() <= 1e-12 * size, "{work} {change} {dissipated}");
        crowded += usize::from(pairs.iter().any(|pair| pair.energy[1] < 0.0) && dissipated > 0.0);
    }
    assert!(crowded > 100, "inclusion and exclusion subtracts in {crowded} steps");
}
