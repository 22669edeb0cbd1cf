//! The small system of one Newton step, J δ = −R on the nodes in contact, with J = M + ½h² Σ a ⊗ b.

use nalgebra::Vector3;
use vi_core::{Acting, Coordinates, System};

use crate::assemble::pairs::pull_back;
use crate::error::SolverError;
use crate::index::NONE;
use crate::linear::bicgstab;
use crate::linear::block_rows::{BlockRows, IncompleteLu};

const MOST_PRODUCTS: usize = 400;
/// A body counts as at rest if its own motion has less than this fraction of the energy that pairs give it.
const AT_REST: f64 = 1e-8;

/// Sparse vectors, stored one after the other: places of nodes in the small system, each with three numbers.
#[derive(Default)]
struct Vectors {
    entries: Vec<(u32, Vector3<f64>)>,
    starts: Vec<u32>,
}

impl Vectors {
    fn clear(&mut self) {
        self.entries.clear();
        self.starts.clear();
        self.starts.push(0);
    }

    fn push(&mut self, place: u32, value: Vector3<f64>) {
        // Pairs with fewer than four nodes repeat the last one without a part in it.
        if value != Vector3::zeros() {
            self.entries.push((place, value));
        }
    }

    fn close(&mut self) {
        self.starts.push(self.entries.len() as u32);
    }

    fn of(&self, number: usize) -> &[(u32, Vector3<f64>)] {
        &self.entries[self.starts[number] as usize..self.starts[number + 1] as usize]
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
    /// J/c, and its incomplete factor.
    matrix: BlockRows,
    factor: IncompleteLu,
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
            matrix: BlockRows::default(),
            factor: IncompleteLu::default(),
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
                    let place = self.touch(node);
                    let is_free = |axis: usize| free_of[3 * node as usize + axis] != NONE;
                    let value = Vector3::from_fn(|axis, _| if is_free(axis) { value[axis] } else { 0.0 });
                    self.tangents.push(place, value);
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

    /// Solves for δ to the relative error `forcing`; returns δ·(−R).
    pub(super) fn correct(&mut self, mass: &[f64], forcing: f64) -> Result<f64, SolverError> {
        let mass: Vec<f64> =
            self.free.iter().map(|&k| if k == NONE { 1.0 } else { mass[k as usize] / self.c }).collect();
        let (tangents, c) = (&self.tangents, self.c);
        let count = (tangents.starts.len() - 1) / 2;
        self.matrix.begin((0..self.nodes.len()).map(|node| vector(&mass, node)));
        (0..count).for_each(|number| self.matrix.add(tangents.of(2 * number), tangents.of(2 * number + 1)));
        self.matrix.finish();
        self.factor.factor(&self.matrix);
        let apply = |v: &[f64], out: &mut [f64]| self.matrix.apply(v, out);
        let precondition = |v: &mut [f64]| self.factor.solve(&self.matrix, v);
        let scaled: Vec<f64> = self.residual.iter().map(|r| r / c).collect();
        // If the tolerance is not reached, use the last iterate, or what the incomplete factor gives if there is none.
        let solved = bicgstab::solve(apply, precondition, &scaled, &mut self.delta, forcing, MOST_PRODUCTS);
        if solved.is_none() && self.delta.iter().all(|&value| value == 0.0) {
            self.delta.copy_from_slice(&scaled);
            precondition(&mut self.delta);
        }
        Ok(self.delta.iter().zip(&self.residual).map(|(a, b)| a * b).sum())
    }

    /// Returns √(RᵀM⁻¹R).
    pub(super) fn size(&self, mass: &[f64]) -> f64 {
        let parts = self.free.iter().zip(&self.residual).filter(|(k, _)| **k != NONE);
        parts.map(|(&k, residual)| residual * residual / mass[k as usize]).sum::<f64>().sqrt()
    }

    /// Returns the product of the right factor of a tangent and a change of the free coordinates.
    pub(super) fn along(&self, tangent: usize, delta: &[f64]) -> f64 {
        let of_node = |&(place, value): &(u32, Vector3<f64>)| -> f64 {
            let free = &self.free[3 * place as usize..3 * place as usize + 3];
            let moved = |axis: usize| if free[axis] == NONE { 0.0 } else { delta[free[axis] as usize] };
            (0..3).map(|axis| value[axis] * moved(axis)).sum()
        };
        self.tangents.of(2 * tangent + 1).iter().map(of_node).sum()
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

/// Returns three numbers of a node.
fn vector(values: &[f64], node: usize) -> Vector3<f64> {
    Vector3::new(values[3 * node], values[3 * node + 1], values[3 * node + 2])
}
