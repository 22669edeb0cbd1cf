//! Tests contact over steps in which a point passes from one cell of a surface to another.

use crate::support::{Numbers, Sheet, Vec3, at, body};
use vi_contact::{Contact, Neighbours, StepPair, StepSettings, Surface, SurfaceBuilder};

const LAYER: f64 = 0.02;

/// A floor of 5 × 5 squares over [0, 1]² whose nodes are lifted by a function of their place, and a point, the last node.
struct Scene {
    surface: Surface,
    x: Vec<f64>,
    point: usize,
}

fn scene(lift: impl Fn(f64, f64) -> f64) -> Scene {
    let mut floor = Sheet::grid(5, 0.0, 1.0, 0.0);
    for node in floor.x.chunks_exact_mut(3) {
        node[2] = lift(node[0], node[1]);
    }
    let point = floor.x.len() / 3;
    let mut x = floor.x.clone();
    x.extend([0.5, 0.5, 0.5 * LAYER]);
    let mut builder = SurfaceBuilder::new(&x);
    let (below, above) = (builder.body(body(LAYER, 1e4)), builder.body(body(LAYER, 1e4)));
    builder.triangles(below, &floor.triangles);
    builder.point(above, point as u32, 0.01);
    Scene { surface: builder.build().expect("a valid surface"), x, point }
}

impl Scene {
    fn with_point(&self, place: Vec3) -> Vec<f64> {
        let mut x = self.x.clone();
        x[3 * self.point..].copy_from_slice(place.as_slice());
        x
    }

    fn step(&self, x0: &[f64], x1: &[f64]) -> Vec<StepPair> {
        let neighbours = Neighbours::find(&self.surface, x0, 1.0);
        let contact = Contact { surface: &self.surface, neighbours: &neighbours };
        contact.step(x0, x1, &StepSettings::over(1e-3))
    }

    /// Returns the force on the point, N.
    fn force(&self, x0: &[f64], x1: &[f64]) -> Vec3 {
        self.step(x0, x1).iter().map(|pair| -pair.gradient[0]).sum()
    }
}

/// A flat floor pushes a point along its normal, by as much as over one large cell: (C₁ − C₀)/(d₁ − d₀), although the
/// point passes from one triangle to a neighbour. At both ends it is farther than the layer from all edges, and the
/// layer is compressed by more than half as much at the end as at the start.
#[test]
fn a_flat_floor_pushes_along_its_normal() {
    let scene = scene(|_, _| 0.0);
    let mut numbers = Numbers::new(7);
    // In the square [.4, .6]², which is cut along the diagonal u = v, below the diagonal, and farther than the layer from its sides.
    let mut below = || loop {
        let [u, v] = [(); 2].map(|()| 0.4 + 0.2 * numbers.unit());
        if [0.6 - u, v - 0.4, (u - v) / 2.0_f64.sqrt()].iter().all(|&far| far > 1.05 * LAYER) {
            return [u, v, LAYER * (0.2 + 0.35 * numbers.unit())];
        }
    };
    for round in 0..300 {
        let [u, v, z] = below();
        let x0 = scene.with_point(Vec3::new(u, v, z));
        let [u, v, other] = below();
        let z = if round % 3 == 0 { z } else { other };
        // Over the diagonal, or over the side u = .6 into the next square, whose diagonal is the other one.
        let end = if round % 2 == 0 { Vec3::new(v, u, z) } else { Vec3::new(1.2 - u, v, z) };
        let x1 = scene.with_point(end);
        let force = scene.force(&x0, &x1);
        // Without motion along the floor.
        let mut above = x1.clone();
        above[3 * scene.point + 2] = x0[3 * scene.point + 2];
        let expected = scene.force(&above, &x1);
        assert!(expected.z > 0.0 && expected.xy().norm() <= 1e-12 * expected.z);
        assert!((force - expected).norm() <= 1e-10 * expected.z, "{round}: {force:?} {expected:?}");
    }
}

/// On a wavy floor whose nodes move too, the work is the change of energy, and the forces have neither a resultant nor a moment.
#[test]
fn work_and_momenta_are_exact_across_cells() {
    let scene = scene(|x, y| 0.05 * (7.0 * x).sin() * (5.0 * y).cos());
    let mut numbers = Numbers::new(11);
    let (mut pushed, mut crossed) = (0, 0);
    for _ in 0..2000 {
        let near = |numbers: &mut Numbers| {
            let (u, v) = (0.2 + 0.6 * numbers.unit(), 0.2 + 0.6 * numbers.unit());
            let z = 0.05 * (7.0 * u).sin() * (5.0 * v).cos() + LAYER * (1.2 * numbers.unit() - 0.1);
            Vec3::new(u, v, z)
        };
        let mut x0 = scene.with_point(near(&mut numbers));
        let mut x1 = scene.with_point(near(&mut numbers));
        for x in x0[..3 * scene.point].iter_mut().chain(&mut x1[..3 * scene.point]) {
            *x += 1e-3 * (2.0 * numbers.unit() - 1.0);
        }
        let pairs = scene.step(&x0, &x1);
        if pairs.iter().all(|pair| pair.energy == [0.0; 2]) {
            continue;
        }
        pushed += 1;
        crossed += usize::from(pairs.windows(2).any(|two| two[0].distance[0] != two[1].distance[0]));
        let size: f64 = pairs.iter().flat_map(|pair| pair.energy).map(f64::abs).sum();
        let sum = |k: usize| pairs.iter().map(|pair| pair.energy[k]).sum::<f64>();
        let (mut work, mut force, mut torque) = (0.0, Vec3::zeros(), Vec3::zeros());
        let mut largest = 0.0_f64;
        for pair in &pairs {
            for (&node, gradient) in pair.nodes.iter().zip(&pair.gradient).take(pair.arity) {
                let [start, end] = [&x0, &x1].map(|x| at(x, node));
                work += gradient.dot(&(end - start));
                force += gradient;
                torque += ((start + end) * 0.5).cross(gradient);
                largest = largest.max(gradient.norm());
            }
        }
        assert!((work - (sum(1) - sum(0))).abs() <= 1e-12 * (size + largest), "{work:e} of {size:e}");
        assert!(force.norm() <= 1e-13 * largest && torque.norm() <= 1e-13 * largest, "{force:?} {torque:?}");
    }
    assert!(pushed > 300 && crossed > 200, "{pushed} {crossed}");
}

/// Forces are continuous functions of the end of a step: through valleys and over ridges, and where a point enters and leaves the layer.
#[test]
fn forces_are_continuous_across_cells() {
    let scene = scene(|x, y| 0.02 * (7.0 * x).sin() * (5.0 * y).cos());
    let mut numbers = Numbers::new(13);
    for _ in 0..40 {
        let mut inside = || 0.2 + 0.6 * numbers.unit();
        let [a, b] = [(); 2].map(|()| [inside(), inside()]);
        let lifts = [0.3 + inside(), 0.2 + 1.2 * inside()];
        let place = |s: f64| {
            let [u, v] = [0, 1].map(|k: usize| a[k] + s * (b[k] - a[k]));
            let z = 0.02 * (7.0 * u).sin() * (5.0 * v).cos() + LAYER * (lifts[0] + s * (lifts[1] - lifts[0]));
            Vec3::new(u, v, z)
        };
        let x0 = scene.with_point(place(0.0));
        let force = |k: u32| scene.force(&x0, &scene.with_point(place(f64::from(k) / 4000.0)));
        let forces: Vec<Vec3> = (0..=4000).map(force).collect();
        let jump = forces.windows(2).map(|two| (two[1] - two[0]).norm()).fold(0.0, f64::max);
        let largest = forces.iter().map(Vec3::norm).fold(0.0, f64::max);
        // Points that pass far above the floor hardly touch it.
        assert!(largest < 1.0 || jump <= 2e-2 * largest, "{jump:e} of {largest:e}");
    }
}
