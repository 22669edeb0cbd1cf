//! The small system of one Newton step, J δ = −R on the nodes in contact, with J = M + ½h² Σ a ⊗ b.

use vi_core::{Acting, Coordinates, System};

use crate::assemble::pairs::pull_back;
use crate::error::SolverError;
use crate::index::NONE;
use crate::linear::bicgstab;

/// Relative error to which J δ = −R is solved. The error of the approximate tangents is larger.
const FORCING: f64 = 1e-5;
const MOST_PRODUCTS: usize = 400;
/// A body counts as at rest if its own motion has less than this fraction of the energy that pairs give it.
const AT_REST: f64 = 1e-8;

/// Sparse vectors, stored one after the other.
#[derive(Default)]
struct Vectors {
    places: Vec<u32>,
    values: Vec<f64>,
    starts: Vec<u32>,
}

impl Vectors {
    fn clear(&mut self) {
        self.places.clear();
        self.values.clear();
        self.starts.clear();
        self.starts.push(0);
    }

    fn close(&mut self) {
        self.starts.push(self.places.len() as u32);
    }

    fn of(&self, number: usize) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        let range = self.starts[number] as usize..self.starts[number + 1] as usize;
        self.places[range.clone()].iter().map(|&place| place as usize).zip(self.values[range].iter().copied())
    }
}

pub(super) struct Small {
    /// The free coordinates after the free drift, m.
    pub(super) drifted: Vec<f64>,
    /// Index of each node in the small system, or [`NONE`].
    place_of: Vec<u32>,
    /// The nodes of the small system.
    nodes: Vec<u32>,
    /// The free coordinate of each coordinate of the small system, three per node, or [`NONE`].
    free: Vec<u32>,
    /// Left and right factors of the tangents, alternately.
    tangents: Vectors,
    /// G at each coordinate of the small system, N.
    force: Vec<f64>,
    residual: Vec<f64>,
    delta: Vec<f64>,
    c: f64,
}

impl Small {
    pub(super) fn new(node_count: usize) -> Self {
        Self {
            drifted: Vec::new(),
            place_of: vec![NONE; node_count],
            nodes: Vec::new(),
            free: Vec::new(),
            tangents: Vectors::default(),
            force: Vec::new(),
            residual: Vec::new(),
            delta: Vec::new(),
            c: 0.0,
        }
    }

    /// Begins a solve with an empty system.
    pub(super) fn begin(&mut self) {
        self.nodes.iter().for_each(|&node| self.place_of[node as usize] = NONE);
        self.nodes.clear();
        self.free.clear();
        self.force.clear();
    }

    /// Adds a node to the system if it is not there yet; returns its index.
    pub(super) fn touch(&mut self, node: u32) -> u32 {
        let place = &mut self.place_of[node as usize];
        if *place == NONE {
            *place = self.nodes.len() as u32;
            self.nodes.push(node);
        }
        *place
    }

    /// Builds the system from the forces and tangents at y.
    pub(super) fn load(&mut self, system: &System, free_of: &[u32], acting: &Acting, c: f64, y: &[f64]) {
        let coordinates = system.coordinates();
        let is_free =
            |node: u32| free_of[3 * node as usize..3 * node as usize + 3].iter().any(|&k| k != NONE);
        self.c = c;
        self.force.clear();
        self.force.resize(3 * self.nodes.len(), 0.0);
        for gradient in acting.gradients() {
            pull_back(coordinates, gradient, |node, value| {
                if is_free(node) {
                    let place = 3 * self.touch(node) as usize;
                    self.force.resize(3 * self.nodes.len(), 0.0);
                    (0..3).for_each(|axis| self.force[place + axis] += value[axis]);
                }
            });
        }
        self.tangents.clear();
        for covector in acting.tangents() {
            pull_back(coordinates, covector, |node, value| {
                if is_free(node) {
                    let place = 3 * self.touch(node);
                    for axis in 0..3 {
                        if free_of[3 * node as usize + axis] != NONE {
                            self.tangents.places.push(place + axis as u32);
                            self.tangents.values.push(value[axis]);
                        }
                    }
                }
            });
            self.tangents.close();
        }
        self.force.resize(3 * self.nodes.len(), 0.0);
        self.free.clear();
        self.free.extend(
            self.nodes.iter().flat_map(|&node| (0..3).map(move |axis| free_of[3 * node as usize + axis])),
        );
        let mass = system.free_mass();
        self.residual.clear();
        for (place, &k) in self.free.iter().enumerate() {
            let k = k as usize;
            let held = k == NONE as usize;
            let value = if held { 0.0 } else { mass[k] * (y[k] - self.drifted[k]) + c * self.force[place] };
            self.residual.push(-value);
        }
    }

    /// Solves for δ; returns δ·(−R).
    pub(super) fn correct(&mut self, mass: &[f64]) -> Result<f64, SolverError> {
        let n = self.free.len();
        let mass: Vec<f64> =
            self.free.iter().map(|&k| if k == NONE { 1.0 } else { mass[k as usize] }).collect();
        let mut blocks = vec![nalgebra::Matrix3::<f64>::zeros(); n / 3];
        for (place, mass) in mass.iter().enumerate() {
            blocks[place / 3][(place % 3, place % 3)] = *mass;
        }
        let (tangents, c) = (&self.tangents, self.c);
        let count = (tangents.starts.len() - 1) / 2;
        for number in 0..count {
            for (row, left) in tangents.of(2 * number) {
                for (column, right) in tangents.of(2 * number + 1) {
                    if row / 3 == column / 3 {
                        blocks[row / 3][(row % 3, column % 3)] += c * left * right;
                    }
                }
            }
        }
        let inverses: Vec<_> = blocks
            .into_iter()
            .enumerate()
            .map(|(node, block)| {
                block.try_inverse().unwrap_or_else(|| {
                    nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::from_fn(|axis, _| {
                        1.0 / mass[3 * node + axis]
                    }))
                })
            })
            .collect();
        let apply = |v: &[f64], out: &mut [f64]| {
            for k in 0..n {
                out[k] = mass[k] * v[k];
            }
            for number in 0..count {
                let along: f64 = tangents.of(2 * number + 1).map(|(place, value)| value * v[place]).sum();
                if along != 0.0 {
                    let along = c * along;
                    tangents.of(2 * number).for_each(|(place, value)| out[place] += along * value);
                }
            }
        };
        let precondition = |v: &mut [f64]| {
            for (three, inverse) in v.chunks_exact_mut(3).zip(&inverses) {
                let out = inverse * nalgebra::Vector3::new(three[0], three[1], three[2]);
                three.copy_from_slice(out.as_slice());
            }
        };
        // If the tolerance is not reached, use the last iterate, or what the diagonal blocks give if there is none.
        let solved =
            bicgstab::solve(apply, precondition, &self.residual, &mut self.delta, FORCING, MOST_PRODUCTS);
        if solved.is_none() && self.delta.iter().all(|&value| value == 0.0) {
            self.delta.copy_from_slice(&self.residual);
            precondition(&mut self.delta);
        }
        Ok(self.delta.iter().zip(&self.residual).map(|(a, b)| a * b).sum())
    }

    /// Returns √(RᵀM⁻¹R).
    pub(super) fn size(&self, mass: &[f64]) -> f64 {
        let parts = self.free.iter().zip(&self.residual).filter(|(k, _)| **k != NONE);
        parts.map(|(&k, residual)| residual * residual / mass[k as usize]).sum::<f64>().sqrt()
    }

    /// Writes δ to the free coordinates, with length `longest` (m) at nodes where it is longer. Returns whether it was
    /// longer at no node.
    pub(super) fn spread(&self, delta: &mut [f64], longest: f64) -> bool {
        let mut is_whole = true;
        for (free, values) in self.free.chunks_exact(3).zip(self.delta.chunks_exact(3)) {
            let length = values.iter().map(|value| value * value).sum::<f64>().sqrt();
            let part = if length > longest { longest / length } else { 1.0 };
            is_whole &= part == 1.0;
            for (&k, value) in free.iter().zip(values).filter(|(k, _)| **k != NONE) {
                delta[k as usize] = part * value;
            }
        }
        is_whole
    }

    /// Returns Σ m (u − q)² over the system, with which δ·R is compared; for bodies at rest that are pushed, Σ m (y + δ − u)².
    pub(super) fn scale(&self, mass: &[f64], q: &[f64], y: &[f64]) -> f64 {
        let (mut free, mut pushed) = (0.0, 0.0);
        for (k, place) in self.coordinates() {
            free += mass[k] * (self.drifted[k] - q[k]).powi(2);
            pushed += mass[k] * (y[k] + self.delta[place] - self.drifted[k]).powi(2);
        }
        if free > AT_REST * pushed { free } else { pushed }
    }

    /// Returns whether δ is below the fraction `resolution` of the positions, both in the norm of mass.
    pub(super) fn is_at_resolution(&self, mass: &[f64], q: &[f64], resolution: f64) -> bool {
        let (mut change, mut place) = (0.0, 0.0);
        for (&k, delta) in self.free.iter().zip(&self.delta).filter(|(k, _)| **k != NONE) {
            change += mass[k as usize] * delta * delta;
            place += mass[k as usize] * q[k as usize].powi(2);
        }
        change <= resolution * resolution * place
    }

    /// Returns the free coordinates with their indices in the system.
    pub(super) fn coordinates(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let places = self.free.iter().enumerate().filter(|(_, k)| **k != NONE);
        places.map(|(place, &k)| (k as usize, place))
    }

    /// Returns G at a coordinate of the system, N.
    pub(super) fn force(&self, place: usize) -> f64 {
        self.force[place]
    }

    /// Returns the forces on coordinates that are not free: coordinate and force, N.
    pub(super) fn prescribed(
        &self,
        coordinates: &Coordinates,
        free_of: &[u32],
        acting: &Acting,
    ) -> Vec<(usize, f64)> {
        let mut out = Vec::new();
        for gradient in acting.gradients() {
            pull_back(coordinates, gradient, |node, value| {
                for axis in 0..3 {
                    let dof = 3 * node as usize + axis;
                    if free_of[dof] == NONE {
                        out.push((dof, value[axis]));
                    }
                }
            });
        }
        out
    }
}
