//! The small system of one Newton step, J δ = −R on the nodes in contact, with J = M + ½h² Σ a ⊗ b. Bodies with constraints are
//! in it with all their coordinates, and move in their tangent spaces (`reduced.rs`).

use nalgebra::Vector3;
use vi_core::{Acting, Coordinates, System};

use crate::assemble::pairs::pull_back;
use crate::error::SolverError;
use crate::index::NONE;
use crate::linear::bicgstab;
use crate::linear::block_rows::{BlockRows, IncompleteLu};
use crate::linear::dense_lu;
use crate::schemes::constraint::middle::ConstrainedBodies;
use crate::schemes::kick_drift::touching::reduced::Reduced;
use crate::unit_of_mass::per_unit_of_mass;

/// Largest number of products of an iterative solve.
const MOST_PRODUCTS: f64 = 400.0;
/// A complete factor of n equations costs about n³ divided by this number and the number of blocks, in products with these blocks, each
/// with a solve with the incomplete factor (by counts of operations, at 8 · 10⁹ per second in the factor and 1.5 · 10⁹ in products).
const FACTOR_PER_BLOCK: f64 = 430.0;
/// Systems whose complete factor costs less than this number of products are solved with it.
const FEWEST_PRODUCTS: f64 = 10.0;
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
    /// The cluster of each node, or [`NONE`]; empty without constraints.
    cluster_of: Vec<u32>,
    /// The nodes of each cluster.
    members: Vec<Vec<u32>>,
    /// The clusters in the small system, with the first place of each.
    clusters: Vec<(usize, usize)>,
    /// The map to the tangent spaces of these clusters, if there are any.
    reduced: Option<Reduced>,
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
    /// Returns the empty system of `node_count` nodes, some of which belong to clusters.
    pub(super) fn new(node_count: usize, clusters: &[Vec<u32>]) -> Self {
        let mut cluster_of = vec![NONE; if clusters.is_empty() { 0 } else { node_count }];
        for (nodes, cluster) in clusters.iter().zip(0..) {
            nodes.iter().for_each(|&node| cluster_of[node as usize] = cluster);
        }
        Self {
            drifted: Vec::new(),
            place_of: vec![NONE; node_count],
            nodes: Vec::new(),
            cluster_of,
            members: clusters.to_vec(),
            clusters: Vec::new(),
            reduced: None,
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
        self.clusters.clear();
        self.free.clear();
        self.force.clear();
    }

    /// Adds a node to the system if it is not there yet, and all nodes of its cluster; returns its index.
    pub(super) fn touch(&mut self, node: u32) -> u32 {
        if self.place_of[node as usize] == NONE {
            let first = self.nodes.len();
            match self.cluster_of.get(node as usize) {
                None | Some(&NONE) => self.nodes.push(node),
                Some(&cluster) => {
                    self.clusters.push((cluster as usize, first));
                    self.nodes.extend(&self.members[cluster as usize]);
                }
            }
            for (place, &node) in self.nodes.iter().enumerate().skip(first) {
                self.place_of[node as usize] = place as u32;
            }
        }
        self.place_of[node as usize]
    }

    /// Returns the clusters in the system, with the first place of each.
    pub(super) fn clusters(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.clusters.iter().copied()
    }

    /// Replaces the coordinates of clusters by those of their tangent spaces at the iterate y of a drift from q.
    ///
    /// # Errors
    /// Returns an error if constraints that were independent of each other depend on each other here.
    pub(super) fn reduce(
        &mut self,
        bodies: &mut ConstrainedBodies,
        q: &[f64],
        y: &[f64],
    ) -> Result<(), SolverError> {
        let mut spaces = Vec::new();
        for &(cluster, first) in &self.clusters {
            let count = self.members[cluster].len();
            let residual = self.residual_of(cluster, first);
            spaces.push((first, count, bodies.tangent_space(cluster, [q, y], self.c, &residual)?));
        }
        self.reduced = (!spaces.is_empty()).then(|| Reduced::new(self.nodes.len(), spaces.into_iter()));
        Ok(())
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
        self.set_residual(system.free_mass(), y);
    }

    /// Sets the residual from the forces and the iterate y.
    fn set_residual(&mut self, mass: &[f64], y: &[f64]) {
        self.residual.clear();
        for (place, &k) in self.free.iter().enumerate() {
            let k = k as usize;
            let held = k == NONE as usize;
            let value =
                if held { 0.0 } else { mass[k] * (y[k] - self.drifted[k]) + self.c * self.force[place] };
            self.residual.push(-value);
        }
    }

    /// Returns R/c, M (y − u)/c + G, at each coordinate of a cluster whose nodes begin at the place `first`.
    pub(super) fn residual_of(&self, cluster: usize, first: usize) -> Vec<f64> {
        let places = 3 * first..3 * (first + self.members[cluster].len());
        self.residual[places].iter().map(|r| -r / self.c).collect()
    }

    /// Solves for δ to the relative error `forcing`; returns δ·(−R).
    pub(super) fn correct(&mut self, mass: &[f64], forcing: f64) -> Result<f64, SolverError> {
        let mass: Vec<f64> =
            self.free.iter().map(|&k| if k == NONE { 1.0 } else { mass[k as usize] / self.c }).collect();
        let (tangents, c) = (&self.tangents, self.c);
        let count = (tangents.starts.len() - 1) / 2;
        let factors = (0..count).map(|number| (tangents.of(2 * number), tangents.of(2 * number + 1)));
        let residual = match &mut self.reduced {
            Some(reduced) => {
                reduced.begin(&mut self.matrix, |place| vector(&mass, place));
                factors.for_each(|(left, right)| reduced.add(&mut self.matrix, left, right));
                reduced.residual(&self.residual)
            }
            None => {
                self.matrix.begin((0..self.nodes.len()).map(|node| vector(&mass, node)));
                factors.for_each(|(left, right)| self.matrix.add(left, right));
                self.residual.clone()
            }
        };
        self.matrix.finish();
        let scaled: Vec<f64> = residual.iter().map(|r| r / c).collect();
        self.solve(&scaled, forcing);
        let decrement = self.delta.iter().zip(&residual).map(|(a, b)| a * b).sum();
        if let Some(reduced) = &self.reduced {
            let delta = std::mem::take(&mut self.delta);
            reduced.expand(&delta, &mut self.delta);
        }
        Ok(decrement)
    }

    /// Solves for δ to the relative error `forcing`.
    fn solve(&mut self, rhs: &[f64], forcing: f64) {
        let Self { matrix, factor, delta, reduced, .. } = self;
        delta.clear();
        delta.resize(rhs.len(), 0.0);
        let size = rhs.len() as f64;
        // Bodies couple all nodes that touch them, so incomplete factors serve less well.
        let worth = match reduced {
            Some(_) => size * size * size / (FACTOR_PER_BLOCK * matrix.block_count() as f64),
            None => f64::INFINITY,
        };
        if worth < FEWEST_PRODUCTS && dense_lu::solve(matrix, rhs, delta) {
            return;
        }
        factor.factor(matrix);
        let apply = |v: &[f64], out: &mut [f64]| matrix.apply(v, out);
        let precondition = |v: &mut [f64]| factor.solve(matrix, v);
        let most = worth.min(MOST_PRODUCTS);
        let solved = bicgstab::solve(apply, precondition, rhs, delta, forcing, most as usize);
        if solved.is_some() || (most < MOST_PRODUCTS && dense_lu::solve(matrix, rhs, delta)) {
            return;
        }
        // Use the last iterate, or what the incomplete factor gives if there is none.
        if delta.iter().all(|&value| value == 0.0) {
            delta.copy_from_slice(rhs);
            factor.solve(matrix, delta);
        }
    }

    /// Returns √(RᵀM⁻¹R) in a unit of mass, without the parts of R that constraints balance.
    pub(super) fn size(&self, mass: &[f64]) -> f64 {
        let is_of_body = |place: usize| self.reduced.as_ref().is_some_and(|map| map.is_of_body(place / 3));
        let parts = self.free.iter().zip(&self.residual).enumerate();
        let parts = parts.filter(|(place, (k, _))| **k != NONE && !is_of_body(*place));
        let sum = parts.map(|(_, (&k, residual))| residual * residual / mass[k as usize]).sum::<f64>();
        let bodies =
            self.reduced.as_ref().map_or(0.0, |map| map.square_of_bodies(&map.residual(&self.residual)));
        // Bases of tangent spaces are orthonormal in the norm of M in the unit, so that `bodies` has the unit twice.
        let per_unit = per_unit_of_mass(mass);
        (per_unit * (sum + per_unit * bodies)).sqrt()
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

    /// Writes δ to the free coordinates, with length `longest` (m) at nodes where it is longer. The length of a cluster is the root
    /// of Σ m δ² over its mass. Returns whether it was longer at no node.
    pub(super) fn spread(
        &self,
        delta: &mut [f64],
        longest: f64,
        mass: &[f64],
        bodies: Option<&ConstrainedBodies>,
    ) -> bool {
        let mut is_whole = true;
        let mut parts = Vec::with_capacity(self.nodes.len());
        for values in self.delta.chunks_exact(3) {
            let length = values.iter().map(|value| value * value).sum::<f64>().sqrt();
            parts.push(if length > longest { longest / length } else { 1.0 });
        }
        for (&(cluster, first), bodies) in self.clusters.iter().zip(bodies.into_iter().cycle()) {
            let places = first..first + self.members[cluster].len();
            let coordinates = 3 * places.start..3 * places.end;
            let values = self.free[coordinates.clone()].iter().zip(&self.delta[coordinates]);
            let square: f64 = values.map(|(&k, value)| mass[k as usize] * value * value).sum();
            let length = (square / bodies.mass(cluster)).sqrt();
            parts[places].fill(if length > longest { longest / length } else { 1.0 });
        }
        for ((free, values), &part) in self.free.chunks_exact(3).zip(self.delta.chunks_exact(3)).zip(&parts) {
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

    /// Adds the changes of the forces along the correction that leads to y, by the tangents.
    pub(super) fn follow(&mut self, mass: &[f64], delta: &[f64], y: &[f64]) {
        for tangent in 0..(self.tangents.starts.len() - 1) / 2 {
            let along = self.along(tangent, delta);
            for &(place, value) in self.tangents.of(2 * tangent) {
                let place = 3 * place as usize;
                (0..3).for_each(|axis| self.force[place + axis] += value[axis] * along);
            }
        }
        self.set_residual(mass, y);
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
