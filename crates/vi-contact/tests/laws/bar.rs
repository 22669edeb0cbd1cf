//! Case H1: an elastic bar hits a wall at v₀. In closed form, contact lasts 2L/c under the force ρ c v₀ A, and then
//! the bar leaves with +v₀. Contact acts by discrete gradient inside the energy–momentum step, or in the drift of
//! Störmer–Verlet.

use crate::support::body;
use nalgebra::{DMatrix, DVector};
use vi_contact::{Contact, Neighbours, StepSettings, Surface, SurfaceBuilder};

const LENGTH: f64 = 1.0;
const AREA: f64 = 0.01;
const YOUNG: f64 = 1e6;
const DENSITY: f64 = 1000.0;
const WAVE: f64 = 31.622_776_601_683_793;

/// A bar of equal linear elements along z over a half-space, which its lowest node meets.
struct Bar {
    surface: Surface,
    /// Heights of the nodes, the lowest first.
    z: DVector<f64>,
    v: DVector<f64>,
    rest: DVector<f64>,
    mass: DVector<f64>,
    stiffness: DMatrix<f64>,
    gap: f64,
}

impl Bar {
    /// Returns a bar at a relative gap of 1 from the wall, with a layer of `thinness` elements and modulus κ.
    fn new(elements: usize, thinness: f64, speed: f64, modulus: f64) -> Self {
        let edge = LENGTH / elements as f64;
        let distance = thinness * edge;
        let x = [0.0, 0.0, distance, 0.0, 0.0, 0.0];
        let mut builder = SurfaceBuilder::new(&x);
        let (end, wall) = (builder.body(body(distance, modulus)), builder.body(body(distance, modulus)));
        builder.point(end, 0, AREA);
        builder.half_space(wall, 1, [0.0, 0.0, 1.0]);
        let n = elements + 1;
        let rest = DVector::from_fn(n, |k, _| distance + edge * k as f64);
        let mass = DVector::from_fn(n, |k, _| {
            DENSITY * AREA * edge * if k == 0 || k == elements { 0.5 } else { 1.0 }
        });
        let mut stiffness = DMatrix::zeros(n, n);
        for k in 0..elements {
            let s = YOUNG * AREA / edge;
            stiffness[(k, k)] += s;
            stiffness[(k + 1, k + 1)] += s;
            stiffness[(k, k + 1)] -= s;
            stiffness[(k + 1, k)] -= s;
        }
        let surface = builder.build().expect("a valid surface");
        let v = DVector::from_element(n, -speed);
        Self { surface, z: rest.clone(), v, rest, mass, stiffness, gap: f64::INFINITY }
    }

    /// Returns the contact of the lowest node between two heights: G, its slope, and C at the end.
    fn contact(&self, z0: f64, z1: f64, h: f64) -> [f64; 3] {
        let x = [z0, z1].map(|z| [0.0, 0.0, z, 0.0, 0.0, 0.0]);
        let neighbours = Neighbours::find(&self.surface, &x[0], 4.0 * (z1 - z0).abs() + 0.01);
        let contact = Contact { surface: &self.surface, neighbours: &neighbours };
        let pairs = contact.step(&x[0], &x[1], &StepSettings::over(h));
        pairs.first().map_or([0.0; 3], |pair| [pair.gradient[0].z, pair.stiffness, pair.energy[1]])
    }

    /// Returns the end height w that solves a (w − free) + b G(z₀, w) = 0. The left side increases with w, so
    /// Newton's method inside a bracket finds it.
    fn meet(&self, z0: f64, free: f64, a: f64, b: f64, h: f64) -> f64 {
        let (mut low, mut high) = (0.0_f64, free.max(z0) + LENGTH);
        let mut w = if free > 0.0 { free } else { 0.5 * z0 };
        for _ in 0..200 {
            let [gradient, slope, _] = self.contact(z0, w, h);
            let residual = a * (w - free) + b * gradient;
            if residual > 0.0 {
                high = w;
            } else {
                low = w;
            }
            let next = w - residual / (a + b * slope);
            let next = if next > low && next < high { next } else { 0.5 * (low + high) };
            if (next - w).abs() <= 2.0 * f64::EPSILON * w {
                return next;
            }
            w = next;
        }
        w
    }

    /// Makes energy–momentum steps. Elasticity is linear: the matrix A = M + h²K/4 is factored once, and the bar
    /// follows its lowest node.
    fn energy_momentum(&mut self, h: f64, steps: usize, mut see: impl FnMut(usize, f64, &Self)) {
        let n = self.z.len();
        let matrix = DMatrix::from_diagonal(&self.mass) + &self.stiffness * (0.25 * h * h);
        let factor = matrix.cholesky().expect("positive");
        let mut unit = DVector::zeros(n);
        unit[0] = 1.0;
        let response = factor.solve(&unit);
        for step in 0..steps {
            // A Δ = h M v₀ − (h²/2)(K (z₀ − Z) + G e).
            let elastic = &self.stiffness * (&self.z - &self.rest);
            let load = self.mass.component_mul(&self.v) * h - elastic * (0.5 * h * h);
            let free = factor.solve(&load);
            let z0 = self.z[0];
            let w = self.meet(z0, z0 + free[0], 1.0 / response[0], 0.5 * h * h, h);
            let force = -self.contact(z0, w, h)[0];
            let delta = free + &response * (0.5 * h * h * force);
            self.v = &delta * (2.0 / h) - &self.v;
            self.z += &delta;
            self.z[0] = w;
            self.gap = self.gap.min(w);
            see(step, force, self);
        }
    }

    /// Makes Störmer–Verlet steps: kick by elasticity, drift with contact by discrete gradient, kick.
    fn verlet(&mut self, h: f64, steps: usize, mut see: impl FnMut(usize, &Self)) {
        for step in 0..steps {
            for phase in 0..2 {
                let kick = &self.stiffness * (&self.z - &self.rest) * (-0.5 * h);
                self.v += kick.component_div(&self.mass);
                if phase == 0 {
                    let (z0, v0) = (self.z[0], self.v[0]);
                    self.z += &self.v * h;
                    // M (w − z₀ − h v₀) + (h²/2) G = 0.
                    let w = self.meet(z0, z0 + h * v0, self.mass[0], 0.5 * h * h, h);
                    self.z[0] = w;
                    self.v[0] = 2.0 * (w - z0) / h - v0;
                    self.gap = self.gap.min(w);
                }
            }
            see(step, self);
        }
    }

    fn energy(&self) -> f64 {
        let strain = &self.z - &self.rest;
        let elastic = 0.5 * strain.dot(&(&self.stiffness * &strain));
        self.kinetic() + elastic + self.contact(self.z[0], self.z[0], 1.0)[2]
    }

    fn kinetic(&self) -> f64 {
        0.5 * self.v.component_mul(&self.v).dot(&self.mass)
    }
}

/// Returns the step limit of Störmer–Verlet, L_e/c.
fn limit(elements: usize) -> f64 {
    LENGTH / elements as f64 / WAVE
}

const SPEED: f64 = 0.01 * WAVE;
/// κ at which the pressure of impact compresses the layer to half, −B'(½) = 2.
const MATCHED: f64 = 0.5 * DENSITY * WAVE * SPEED;

#[test]
fn force_impulse_and_duration_are_those_of_the_wave() {
    let mut bar = Bar::new(100, 0.1, SPEED, MATCHED);
    let (h, force) = (0.5 * limit(100), DENSITY * WAVE * SPEED * AREA);
    assert!((force - 100.0).abs() < 1e-9);
    let steps = (0.08 / h) as usize;
    let mut forces = Vec::new();
    bar.energy_momentum(h, steps, |_, force, _| forces.push(force));
    let impulse: f64 = forces.iter().map(|force| force * h).sum();
    let duration = forces.iter().filter(|&&f| f > 0.5 * force).count() as f64 * h;
    let plateau = &forces[80..320];
    let mean = plateau.iter().sum::<f64>() / plateau.len() as f64;
    let velocity = bar.v.component_mul(&bar.mass).sum() / bar.mass.sum();
    assert!((impulse / 6.3246 - 1.0).abs() < 0.005, "{impulse}");
    assert!((duration / 0.063_246 - 1.0).abs() < 0.03, "{duration}");
    assert!((mean / force - 1.0).abs() < 0.02, "{mean}");
    assert!(velocity > 0.995 * SPEED, "{velocity}");
}

/// Case H16: steps of 1 to 64 L_e/c, 30 times the speed, layers of a tenth and a hundredth of an element.
#[test]
fn energy_is_exact_and_the_gap_stays_open_at_any_step_and_speed() {
    for thinness in [0.1, 0.01] {
        for blow in [1.0, 30.0] {
            for courant in [1.0, 4.0, 16.0, 64.0] {
                let mut bar = Bar::new(50, thinness, blow * SPEED, 0.1 * YOUNG);
                let (h, before, mut worst) = (courant * limit(50), bar.energy(), 0.0_f64);
                let steps = ((0.2 / h) as usize).max(20);
                bar.energy_momentum(h, steps, |_, _, bar| worst = worst.max((bar.energy() - before).abs()));
                let (gap, error) = (bar.gap / (thinness * 0.02), worst / before);
                assert!(gap > 0.0 && gap < 1.0, "thinness {thinness}, blow {blow}, {courant}: gap {gap}");
                assert!(error < 1e-11, "thinness {thinness}, blow {blow}, {courant}: {error:e}");
            }
        }
    }
}

/// Contact in the drift adds no step limit: the energy after the first bounce stays in the band of the elastic
/// scheme.
#[test]
fn contact_in_the_drift_holds_at_the_elastic_limit() {
    for (thinness, courant, band) in
        [(0.1, 0.9, 5e-4), (0.1, 0.45, 1.5e-4), (0.01, 0.9, 4e-3), (0.01, 0.45, 1.4e-3)]
    {
        let mut bar = Bar::new(100, thinness, SPEED, MATCHED);
        let (h, before, mut worst) = (courant * limit(100), bar.energy(), 0.0_f64);
        bar.verlet(h, (0.1 / h) as usize, |_, bar| worst = worst.max((bar.energy() - before).abs()));
        let error = worst / before;
        assert!(bar.gap > 0.0 && error < band, "{thinness} {courant}: gap {:e}, energy {error:e}", bar.gap);
    }
    // 30 times the speed.
    let mut bar = Bar::new(100, 0.1, 30.0 * SPEED, MATCHED);
    bar.verlet(0.9 * limit(100), 400, |_, _| {});
    assert!(bar.gap > 0.0);
}
