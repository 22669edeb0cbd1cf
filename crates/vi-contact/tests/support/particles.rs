//! Particles with springs, gravity and contact, stepped by the energy–momentum rule
//! ```text
//! M (v₁ − v₀) = −h (G_springs + G_contact + G_friction − M g),   x₁ = x₀ + h (v₀ + v₁)/2.
//! ```
//! Newton's method solves for Δ = x₁ − x₀ with a dense matrix. Without springs and gravity this is the map by which
//! explicit schemes drift the nodes in contact. Iterates whose straight path is not proved free are shortened.

use nalgebra::{DMatrix, DVector};
use vi_contact::{Anchors, Contact, Neighbours, StepSettings, Surface};

use super::{Vec3, at};

pub(crate) struct Particles {
    pub(crate) surface: Surface,
    /// Mass per node, kg; infinite for held nodes.
    pub(crate) mass: Vec<f64>,
    pub(crate) x: Vec<f64>,
    pub(crate) v: Vec<f64>,
    /// Nodes, rest length (m) and stiffness (N/m).
    pub(crate) springs: Vec<(u32, u32, f64, f64)>,
    pub(crate) gravity: Vec3,
    pub(crate) anchors: Anchors,
    pub(crate) neighbours: Neighbours,
    /// Energy that friction and damping dissipated, J.
    pub(crate) dissipated: f64,
    pub(crate) iterations: usize,
}

/// Forces of a trial step.
struct Trial {
    gradient: Vec<f64>,
    anchors: Anchors,
    /// Work of friction and damping, J.
    work: f64,
    gap: f64,
}

impl Particles {
    pub(crate) fn new(surface: Surface, mass: Vec<f64>, x: Vec<f64>) -> Self {
        let v = vec![0.0; x.len()];
        Self {
            surface,
            mass,
            x,
            v,
            springs: Vec::new(),
            gravity: Vec3::zeros(),
            anchors: Anchors::default(),
            neighbours: Neighbours::default(),
            dissipated: 0.0,
            iterations: 0,
        }
    }

    /// Connects nodes by springs at their current distance.
    pub(crate) fn tie(&mut self, nodes: &[u32], stiffness: f64) {
        for (k, &a) in nodes.iter().enumerate() {
            for &b in &nodes[k + 1..] {
                self.springs.push((a, b, (at(&self.x, a) - at(&self.x, b)).norm(), stiffness));
            }
        }
    }

    pub(crate) fn is_free(&self, node: usize) -> bool {
        self.mass[node].is_finite()
    }

    fn trial(&self, x1: &[f64], h: f64) -> Trial {
        let mut gradient = vec![0.0; self.x.len()];
        for &(a, b, length, stiffness) in &self.springs {
            let [r0, r1] = [&self.x[..], x1].map(|x| at(x, a) - at(x, b));
            let (d0, d1) = (r0.norm(), r1.norm());
            // The difference quotient of ½k(d−l)² is k((d₀ + d₁)/2 − l) along (r₀ + r₁)/(d₀ + d₁).
            let force = (r0 + r1) * (stiffness * (0.5 * (d0 + d1) - length) / (d0 + d1));
            for k in 0..3 {
                gradient[3 * a as usize + k] += force[k];
                gradient[3 * b as usize + k] -= force[k];
            }
        }
        for (node, mass) in self.mass.iter().enumerate().filter(|(_, mass)| mass.is_finite()) {
            (0..3).for_each(|k| gradient[3 * node + k] -= mass * self.gravity[k]);
        }
        let contact = Contact { surface: &self.surface, neighbours: &self.neighbours };
        let settings = StepSettings::over(h);
        let pairs = contact.step(&self.x, x1, &settings);
        let rubs = contact.friction(&self.x, x1, &pairs, &self.anchors, &settings);
        pairs.iter().for_each(|pair| pair.add_gradient(&mut gradient));
        rubs.iter().for_each(|pair| pair.add_gradient(&mut gradient));
        let damped: f64 = pairs.iter().map(|pair| pair.dissipated).sum();
        let rubbed: f64 = rubs.iter().map(|pair| pair.traction.dot(&pair.slip)).sum();
        let gap = pairs.iter().map(|pair| pair.gap).fold(f64::INFINITY, f64::min);
        Trial { gradient, anchors: Anchors::after(&rubs), work: damped + rubbed, gap }
    }

    /// Returns M (2Δ/h − 2v₀) + h G on free coordinates.
    fn residual(&self, delta: &[f64], h: f64) -> (DVector<f64>, Trial) {
        let x1: Vec<f64> = self.x.iter().zip(delta).map(|(x, d)| x + d).collect();
        let trial = self.trial(&x1, h);
        let entries = self
            .free()
            .map(|k| self.mass[k / 3] * (2.0 * delta[k] / h - 2.0 * self.v[k]) + h * trial.gradient[k]);
        (DVector::from_iterator(self.free().count(), entries), trial)
    }

    fn free(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.x.len()).filter(|k| self.is_free(k / 3))
    }

    /// Returns whether the straight path of these displacements is proved free.
    fn is_clear(&self, delta: &[f64]) -> Result<(), f64> {
        let x1: Vec<f64> = self.x.iter().zip(delta).map(|(x, d)| x + d).collect();
        let contact = Contact { surface: &self.surface, neighbours: &self.neighbours };
        assert!(self.neighbours.covers(&x1), "the candidates cover the step");
        contact.first_impact(&self.x, &x1).map_or(Ok(()), |impact| Err(impact.time))
    }

    /// Makes one step. The Jacobian is computed by differences, because the systems are tiny.
    pub(crate) fn step(&mut self, h: f64) {
        let speed = (0..self.mass.len()).map(|node| at(&self.v, node as u32).norm()).fold(0.0, f64::max);
        let reach = 4.0 * h * (speed + 2.0 * h * self.gravity.norm()) + 1e-2;
        self.neighbours = Neighbours::find(&self.surface, &self.x, reach);
        let mut delta: Vec<f64> = (0..self.x.len()).map(|k| h * self.v[k]).collect();
        if let Err(time) = self.is_clear(&delta) {
            delta.iter_mut().for_each(|d| *d *= 0.9 * time);
        }
        let free: Vec<usize> = self.free().collect();
        let scale: f64 =
            free.iter().map(|&k| self.mass[k / 3]).sum::<f64>() * (speed + h * self.gravity.norm() + 1e-3);
        let (mut residual, mut trial) = self.residual(&delta, h);
        for iteration in 0..100 {
            if residual.norm() <= 2e-15 * scale || iteration == 99 {
                break;
            }
            let mut jacobian = DMatrix::zeros(free.len(), free.len());
            for (column, &k) in free.iter().enumerate() {
                let tiny = 1e-7 * trial.gap.clamp(1e-6, 1e-2);
                let mut other = delta.clone();
                other[k] += tiny;
                let (moved, _) = self.residual(&other, h);
                jacobian.set_column(column, &((moved - &residual) / tiny));
            }
            let Some(change) = jacobian.lu().solve(&residual) else { break };
            let mut part = 1.0;
            let found = (0..40).find_map(|_| {
                let mut next = delta.clone();
                free.iter().zip(change.iter()).for_each(|(&k, c)| next[k] -= part * c);
                if self.is_clear(&next).is_ok() {
                    let (other, tried) = self.residual(&next, h);
                    let falls = trial.gap.is_finite() && tried.gap < 0.2 * trial.gap;
                    if !falls && other.norm() < (1.0 - 1e-4 * part) * residual.norm() {
                        return Some((next, other, tried));
                    }
                }
                part *= 0.5;
                None
            });
            // There is no decrease: the residual is round-off.
            let Some(found) = found else {
                assert!(residual.norm() <= 1e-9 * scale, "stalled at {:e} of {scale:e}", residual.norm());
                break;
            };
            (delta, residual, trial) = found;
            self.iterations += 1;
        }
        for k in free {
            self.v[k] = 2.0 * delta[k] / h - self.v[k];
            self.x[k] += delta[k];
        }
        let stored = |anchors: &Anchors| anchors.energy(&self.surface);
        self.dissipated += trial.work - (stored(&trial.anchors) - stored(&self.anchors));
        self.anchors = trial.anchors;
    }

    /// Returns the kinetic, spring, weight, contact and bristle energy, J.
    pub(crate) fn energy(&self) -> f64 {
        let contact = Contact { surface: &self.surface, neighbours: &self.neighbours };
        let springs = self.springs.iter().map(|&(a, b, length, stiffness)| {
            0.5 * stiffness * ((at(&self.x, a) - at(&self.x, b)).norm() - length).powi(2)
        });
        let weight = self.free().map(|k| -self.mass[k / 3] * self.gravity[k % 3] * self.x[k]);
        self.kinetic()
            + springs.sum::<f64>()
            + weight.sum::<f64>()
            + contact.energy(&self.x)
            + self.anchors.energy(&self.surface)
    }

    pub(crate) fn kinetic(&self) -> f64 {
        self.free().map(|k| 0.5 * self.mass[k / 3] * self.v[k] * self.v[k]).sum()
    }

    pub(crate) fn smallest_gap(&self) -> f64 {
        Contact { surface: &self.surface, neighbours: &self.neighbours }.smallest_gap(&self.x)
    }

    /// Returns linear and angular momentum.
    pub(crate) fn momenta(&self) -> [Vec3; 2] {
        let mut sums = [Vec3::zeros(); 2];
        for node in (0..self.mass.len()).filter(|&node| self.is_free(node)) {
            let momentum = at(&self.v, node as u32) * self.mass[node];
            sums[0] += momentum;
            sums[1] += at(&self.x, node as u32).cross(&momentum);
        }
        sums
    }
}
