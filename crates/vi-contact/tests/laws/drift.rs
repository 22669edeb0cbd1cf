//! Tests the drift of clusters: energy and momenta over many collisions, at any step, with unequal masses.

use crate::support::drift::Drift;
use crate::support::{Numbers, Vec3, at};
use vi_contact::{Body, Contact, Neighbours, Surface, SurfaceBuilder};

/// Balls between two walls, with masses that differ by a factor of up to `ratio`.
struct Box {
    surface: Surface,
    mass: Vec<f64>,
    x: Vec<f64>,
    v: Vec<f64>,
}

impl Box {
    fn new(count: usize, ratio: f64, spread: f64, seed: u64) -> Self {
        let mut numbers = Numbers::new(seed);
        let (mut x, mut v, mut mass) = (Vec::new(), Vec::new(), Vec::new());
        for ball in 0..count {
            x.extend([spread * numbers.unit(), spread * numbers.unit(), 0.25 * ball as f64 + 0.2]);
            v.extend([0.0, 0.0, 2.0 * numbers.unit() - 1.0]);
            mass.push(if ball % 2 == 0 { 1.0 } else { ratio });
        }
        // Walls at both ends.
        let walls = [count as u32, count as u32 + 1];
        x.extend([0.0, 0.0, 0.0, 0.0, 0.0, 0.25 * count as f64 + 0.15]);
        v.extend([0.0; 6]);
        mass.extend([f64::INFINITY; 2]);
        let mut builder = SurfaceBuilder::new(&x);
        let ball = Body { radius: 0.1, distance: 0.02, stiffness: 1e6, meets_itself: false };
        for node in 0..count as u32 {
            let body = builder.body(ball);
            builder.point(body, node, 0.01);
        }
        for (node, up) in walls.into_iter().zip([1.0, -1.0]) {
            let wall = builder.body(ball);
            builder.half_space(wall, node, [0.0, 0.0, up]);
        }
        Self { surface: builder.build().expect("a valid surface"), mass, x, v }
    }

    fn energy(&self) -> f64 {
        let neighbours = Neighbours::find(&self.surface, &self.x, 0.0);
        let kinetic = self.mass.iter().zip(self.v.chunks(3)).filter(|(mass, _)| mass.is_finite());
        let kinetic: f64 = kinetic.map(|(mass, v)| 0.5 * mass * v.iter().map(|v| v * v).sum::<f64>()).sum();
        kinetic + Contact { surface: &self.surface, neighbours: &neighbours }.energy(&self.x)
    }

    fn order_is_kept(&self) -> bool {
        (1..self.mass.len() - 2).all(|ball| self.x[3 * ball + 2] > self.x[3 * ball - 1])
    }
}

#[test]
fn columns_of_balls_keep_their_energy_at_any_step() {
    for (count, ratio) in [(10, 1.0), (10, 1000.0), (30, 10.0)] {
        for h in [1e-4, 1e-3, 1e-2, 1e-1] {
            let mut set = Box::new(count, ratio, 0.0, count as u64);
            let before = set.energy();
            let mut drift = Drift { surface: &set.surface, mass: &set.mass, corrections: 0, solves: 0 };
            for _ in 0..100 {
                drift.run(&mut set.x, &mut set.v, h);
            }
            let mean = drift.corrections as f64 / drift.solves.max(1) as f64;
            println!("{count} balls, ratio {ratio}, h {h}: {mean:.2} corrections, {} maps", drift.solves);
            let error = set.energy() / before - 1.0;
            assert!(error.abs() < 1e-11, "{count} balls, ratio {ratio}, h {h}: {error:e}");
            assert!(set.order_is_kept(), "balls have passed each other");
        }
    }
}

/// In space and off centre, the momenta of free balls are conserved too.
#[test]
fn glancing_balls_keep_both_momenta() {
    let mut set = Box::new(8, 5.0, 0.08, 3);
    let sums = |set: &Box| {
        (0..8).fold([Vec3::zeros(); 2], |[p, l], ball| {
            let momentum = at(&set.v, ball) * set.mass[ball as usize];
            [p + momentum, l + at(&set.x, ball).cross(&momentum)]
        })
    };
    // Stop before any ball reaches a wall.
    for ball in 0..8 {
        set.v[3 * ball + 2] = 3.5 - ball as f64;
    }
    set.x[3 * 8 + 2] = -100.0;
    set.x[3 * 9 + 2] = 100.0;
    let ([p0, l0], before) = (sums(&set), set.energy());
    let mut drift = Drift { surface: &set.surface, mass: &set.mass, corrections: 0, solves: 0 };
    for _ in 0..300 {
        drift.run(&mut set.x, &mut set.v, 2e-3);
    }
    let [p, l] = sums(&set);
    let size: f64 = (0..8).map(|ball| at(&set.v, ball).norm() * set.mass[ball as usize]).sum();
    assert!((p - p0).norm() <= 1e-12 * size && (l - l0).norm() <= 1e-12 * size, "{:?} {:?}", p - p0, l - l0);
    assert!((set.energy() / before - 1.0).abs() < 1e-11);
}
