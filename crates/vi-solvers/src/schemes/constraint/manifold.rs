//! The manifold g(x) = 0 of the configurations that the constraints of a system allow. Multipliers project positions
//! onto it (SHAKE) and momenta onto its tangent space (RATTLE), both to round-off.
//!
//! Constraints that share free coordinates form a cluster (a rigid body, a mechanism). The Jacobian G of a cluster is
//! a small dense matrix over the few coordinates that it reads; the lumped mass is diagonal. So the cost depends on
//! the clusters and not on the bodies attached to them. If constraints of a cluster depend on each other in its first
//! configuration (closed loops), the multipliers of least norm are taken. Constraints have different dimensions (a
//! distance in m², a perpendicularity in 1); therefore S = G M⁻¹ Gᵀ is judged and solved in units of its own rows
//! ([`Units`]).

use nalgebra::{DMatrix, DVector};
use vi_core::System;
use vi_core::constraints::QuadraticConstraint;

use crate::error::SolverError;
use crate::index::{NONE, free_of};
use crate::schemes::constraint::units::Units;

/// Number of iterations for the multipliers after which a step fails.
const MAX_ITERATIONS: u32 = 50;
/// A defect counts as zero if it is below this many units of its round-off.
const NOISE: f64 = 4.0;

/// Constraints that share free coordinates, with coordinates numbered from 0.
struct Cluster {
    constraints: Vec<QuadraticConstraint>,
    /// The coordinates x_i that the cluster reads.
    dofs: Vec<u32>,
    /// Their free coordinates, or [`NONE`] if they are prescribed.
    free: Vec<u32>,
    /// Which of its nodes are directors, whose coordinates are not lengths.
    is_director: Vec<bool>,
    /// Inverse masses of the free coordinates; zero for the others.
    inverse_mass: DVector<f64>,
    /// The current values of the coordinates.
    y: Vec<f64>,
    /// G at the configuration from which the step takes the directions of the multipliers.
    normal: DMatrix<f64>,
    /// Units of N M⁻¹ Nᵀ with these directions N.
    units: Units,
    /// Whether its constraints depend on each other.
    is_redundant: bool,
}

impl Cluster {
    fn new(system: &System, members: &[&QuadraticConstraint], free_of: &[u32]) -> Self {
        let mut nodes: Vec<u32> = members.iter().flat_map(|constraint| constraint.nodes()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        // Constraints were resolved against the coordinates, so every node has a number.
        let number = |node: u32| nodes.binary_search(&node).unwrap_or(0) as u32;
        let dofs: Vec<u32> = nodes.iter().flat_map(|&node| 3 * node..3 * node + 3).collect();
        let free: Vec<u32> = dofs.iter().map(|&dof| free_of[dof as usize]).collect();
        let mass = system.free_mass();
        let inverse = |&k: &u32| if k == NONE { 0.0 } else { 1.0 / mass[k as usize] };
        Self {
            constraints: members.iter().map(|constraint| constraint.renumbered(number)).collect(),
            is_director: nodes.iter().map(|&node| system.coordinates().is_director(node)).collect(),
            inverse_mass: DVector::from_iterator(free.len(), free.iter().map(inverse)),
            y: vec![0.0; dofs.len()],
            normal: DMatrix::zeros(members.len(), dofs.len()),
            units: Units::of(&DVector::from_element(members.len(), 1.0)),
            is_redundant: false,
            dofs,
            free,
        }
    }

    /// Sets the configuration to q; reads prescribed coordinates from `x`.
    fn place(&mut self, q: &[f64], x: &[f64]) {
        for (k, y) in self.y.iter_mut().enumerate() {
            *y = if self.free[k] == NONE { x[self.dofs[k] as usize] } else { q[self.free[k] as usize] };
        }
    }

    /// Returns G at the current configuration, m × coordinates.
    fn jacobian(&self) -> DMatrix<f64> {
        let mut transposed = DMatrix::zeros(self.dofs.len(), self.constraints.len());
        let columns = transposed.as_mut_slice().chunks_exact_mut(self.dofs.len());
        for (constraint, column) in self.constraints.iter().zip(columns) {
            constraint.add_gradient(&self.y, 1.0, column);
        }
        transposed.transpose()
    }

    /// Returns g at the current configuration.
    fn defect(&self) -> DVector<f64> {
        DVector::from_iterator(self.constraints.len(), self.constraints.iter().map(|c| c.value(&self.y)))
    }

    /// Returns the largest |g| in units of its round-off, and its constraint.
    fn worst(&self, defect: &DVector<f64>) -> (f64, usize) {
        // Coordinates near zero are sums of others. Therefore all points have the round-off of the farthest of them,
        // and all directors that of the longest.
        let mut size = [0.0_f64; 2];
        for (node, y) in self.y.chunks_exact(3).enumerate() {
            let size = &mut size[usize::from(self.is_director[node])];
            *size = y.iter().fold(*size, |size, y| size.max(y.abs()));
        }
        let of_node = |node: u32| size[usize::from(self.is_director[node as usize])];
        let sizes = self.constraints.iter().map(|c| f64::EPSILON * c.magnitude(&self.y, of_node));
        let relative = defect.iter().zip(sizes).map(|(g, size)| if *g == 0.0 { 0.0 } else { g.abs() / size });
        relative.enumerate().fold((0.0, 0), |worst, (k, value)| {
            if value > worst.0 || value.is_nan() { (value, k) } else { worst }
        })
    }

    /// Returns G M⁻¹ Nᵀ.
    fn metric(&self, g: &DMatrix<f64>, normal: &DMatrix<f64>) -> DMatrix<f64> {
        let mut weighted = normal.transpose();
        for (mut row, inverse) in weighted.row_iter_mut().zip(&self.inverse_mass) {
            row *= *inverse;
        }
        g * weighted
    }

    /// Solves S λ = r.
    fn solve(&self, matrix: DMatrix<f64>, rhs: &DVector<f64>) -> Option<DVector<f64>> {
        self.units.solve(matrix, rhs, self.is_redundant)
    }

    fn failure(&self, constraint: usize, iterations: u32, defect: f64) -> SolverError {
        let constraint = self.constraints[constraint].name().to_owned();
        SolverError::ConstraintDefect { constraint, iterations, defect }
    }
}

/// All clusters of a system.
pub(crate) struct ConstraintManifold {
    clusters: Vec<Cluster>,
    /// Whether any cluster reads prescribed coordinates. Then `x` holds all coordinates.
    reads_prescribed: bool,
    x: Vec<f64>,
    x_dot: Vec<f64>,
    is_ranked: bool,
}

impl ConstraintManifold {
    /// Returns the manifold of a system; `None` if the system has no constraints.
    pub(crate) fn new(system: &System) -> Option<Self> {
        if system.constraints().is_empty() {
            return None;
        }
        let count = system.coordinates().dof_count();
        let free_of = free_of(system.coordinates());
        let clusters: Vec<Cluster> = clusters(system, &free_of)
            .iter()
            .map(|members| Cluster::new(system, members, &free_of))
            .collect();
        let reads_prescribed = clusters.iter().any(|cluster| cluster.free.contains(&NONE));
        let length = if reads_prescribed { count } else { 0 };
        let (x, x_dot) = (vec![0.0; length], vec![0.0; length]);
        Some(Self { clusters, reads_prescribed, x, x_dot, is_ranked: false })
    }

    /// Returns the number of multipliers.
    pub(crate) fn multiplier_count(&self) -> usize {
        self.clusters.iter().map(|cluster| cluster.constraints.len()).sum()
    }

    fn place(&mut self, system: &System, q: &[f64], t: f64) {
        if self.reads_prescribed {
            system.coordinates().embed(q, t, &mut self.x);
        }
        for cluster in &mut self.clusters {
            cluster.place(q, &self.x);
        }
    }

    /// Takes the directions of the multipliers at (q, t).
    pub(crate) fn set_directions(&mut self, system: &System, q: &[f64], t: f64) {
        self.place(system, q, t);
        if self.reads_prescribed {
            // Only the prescribed entries are read.
            system.coordinates().embed_velocity(q, t, &mut self.x_dot);
        }
        for cluster in &mut self.clusters {
            cluster.normal = cluster.jacobian();
            let metric = cluster.metric(&cluster.normal, &cluster.normal);
            cluster.units = Units::of(&metric.diagonal());
            if !self.is_ranked {
                cluster.is_redundant = cluster.units.are_dependent(metric);
            }
        }
        self.is_ranked = true;
    }

    /// Adds out_k += scale (Gᵀλ)_k with the current directions.
    pub(crate) fn add_force(&self, lambda: &[f64], scale: f64, out: &mut [f64]) {
        let mut first = 0;
        for cluster in &self.clusters {
            let m = cluster.constraints.len();
            for (k, &free) in cluster.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
                let sum: f64 = (0..m).map(|i| cluster.normal[(i, k)] * lambda[first + i]).sum();
                out[free as usize] += scale * sum;
            }
            first += m;
        }
    }

    /// Calls `each` with the entries of Nᵀ: free coordinate, multiplier and value.
    pub(crate) fn for_each_direction(&self, mut each: impl FnMut(u32, u32, f64)) {
        let mut first = 0;
        for cluster in &self.clusters {
            for (k, &free) in cluster.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
                for i in 0..cluster.constraints.len() {
                    each(free, first + i as u32, cluster.normal[(i, k)]);
                }
            }
            first += cluster.constraints.len() as u32;
        }
    }

    /// Calls `each` with the entries of Σ λ_i ∂²g_i/∂q² on the free coordinates: row, column and value.
    pub(crate) fn for_each_curvature(&self, lambda: &[f64], mut each: impl FnMut(u32, u32, f64)) {
        let mut first = 0;
        for cluster in &self.clusters {
            let (m, count) = (cluster.constraints.len(), cluster.dofs.len());
            let gradient = |y: &[f64]| {
                let mut sum = vec![0.0; count];
                let members = cluster.constraints.iter().zip(&lambda[first..first + m]);
                members.for_each(|(constraint, &lambda)| constraint.add_gradient(y, lambda, &mut sum));
                sum
            };
            // Gradients of quadratic constraints are affine, so unit differences are exact.
            let mut y = vec![0.0; count];
            let origin = gradient(&y);
            for (j, &column) in cluster.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
                y[j] = 1.0;
                let there = gradient(&y);
                y[j] = 0.0;
                for (i, &row) in cluster.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
                    each(row, column, there[i] - origin[i]);
                }
            }
            first += m;
        }
    }

    /// Returns λᵀN d over prescribed coordinates with the current directions N, J: the work of prescribed motion
    /// along d against the multipliers λ.
    pub(crate) fn prescribed_work(&self, lambda: &[f64], d: &[f64]) -> f64 {
        if !self.reads_prescribed {
            return 0.0;
        }
        let (mut first, mut work) = (0, 0.0);
        for cluster in &self.clusters {
            let m = cluster.constraints.len();
            work += cluster.prescribed_work(&cluster.normal, &lambda[first..first + m], d);
            first += m;
        }
        work
    }

    /// Returns the work of prescribed motion against impulses λ, with the velocities at the configuration of the
    /// directions, J.
    pub(crate) fn impulse_work(&self, lambda: &[f64]) -> f64 {
        self.prescribed_work(lambda, &self.x_dot)
    }

    /// Writes the column Nᵀe_i of one multiplier as a free vector.
    pub(crate) fn direction(&self, multiplier: usize, out: &mut [f64]) {
        out.fill(0.0);
        let mut unit = vec![0.0; self.multiplier_count()];
        unit[multiplier] = 1.0;
        self.add_force(&unit, 1.0, out);
    }

    /// Returns g and G at (q, t) in the order of the multipliers: (g, G as free entries).
    pub(crate) fn linearize(&mut self, system: &System, q: &[f64], t: f64) -> (DVector<f64>, Vec<Row>) {
        self.place(system, q, t);
        let mut defects = Vec::with_capacity(self.multiplier_count());
        let mut rows = Vec::with_capacity(self.multiplier_count());
        for cluster in &self.clusters {
            defects.extend_from_slice(cluster.defect().as_slice());
            let g = cluster.jacobian();
            for i in 0..cluster.constraints.len() {
                let entries = cluster.free.iter().enumerate().filter(|(_, free)| **free != NONE);
                rows.push(entries.map(|(k, &free)| (free, g[(i, k)])).collect());
            }
        }
        (DVector::from_vec(defects), rows)
    }

    /// Returns whether the constraints of any cluster depend on each other.
    pub(crate) fn is_redundant(&self) -> bool {
        self.clusters.iter().any(|cluster| cluster.is_redundant)
    }

    /// Projects a change r of momentum onto the tangent space at the configuration of the directions, r −= Gᵀμ with
    /// G M⁻¹r = 0. Returns the work of prescribed motion against μ, J.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if constraints that were independent of each other depend on each
    /// other here.
    pub(crate) fn project_covector(&self, r: &mut [f64]) -> Result<f64, SolverError> {
        let mut work = 0.0;
        for cluster in &self.clusters {
            let (step, _) = cluster.project(&cluster.normal, r, &[])?;
            if self.reads_prescribed {
                work += cluster.prescribed_work(&cluster.normal, step.as_slice(), &self.x_dot);
            }
        }
        Ok(work)
    }

    /// Projects q onto the manifold at time t by impulses along the current directions: p −= Nᵀλ and q −= drift
    /// M⁻¹Nᵀλ with g(q) = 0. Adds λ to `lambda`, and returns the change of ½ pᵀM⁻¹p, J.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if the iteration does not converge.
    pub(crate) fn project_positions(
        &mut self,
        system: &System,
        q: &mut [f64],
        p: &mut [f64],
        t: f64,
        drift: f64,
        lambda: &mut [f64],
    ) -> Result<f64, SolverError> {
        if self.reads_prescribed {
            system.coordinates().embed(q, t, &mut self.x);
        }
        let (mut change, mut first) = (0.0, 0);
        for cluster in &mut self.clusters {
            let m = cluster.constraints.len();
            let mut total = DVector::zeros(m);
            let (mut previous, mut iterations) = (f64::INFINITY, 0);
            loop {
                cluster.place(q, &self.x);
                let defect = cluster.defect();
                let (worst, which) = cluster.worst(&defect);
                // q is on the manifold, or as near as round-off allows.
                if worst <= NOISE || (worst < 1e4 && worst >= 0.5 * previous) {
                    break;
                }
                if !worst.is_finite() || iterations >= MAX_ITERATIONS {
                    return Err(cluster.failure(which, iterations, defect[which]));
                }
                (previous, iterations) = (worst, iterations + 1);
                let matrix = cluster.metric(&cluster.jacobian(), &cluster.normal) * drift;
                let step = cluster.solve(matrix, &defect);
                let step = step.ok_or_else(|| cluster.failure(which, iterations, defect[which]))?;
                let impulse = cluster.normal.tr_mul(&step);
                for (k, &free) in cluster.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
                    q[free as usize] -= drift * cluster.inverse_mass[k] * impulse[k];
                }
                total += step;
            }
            change += cluster.kick(&cluster.normal.tr_mul(&total), p);
            for (lambda, total) in lambda[first..first + m].iter_mut().zip(&total) {
                *lambda += total;
            }
            first += m;
        }
        Ok(change)
    }

    /// Projects p onto the tangent space at (q, t), G M⁻¹p + G ẋ_prescribed = 0, by impulses along G. Returns the
    /// change of ½ pᵀM⁻¹p and the work of prescribed motion, J.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if constraints that were independent of each other depend on each
    /// other here.
    pub(crate) fn project_momenta(
        &mut self,
        system: &System,
        q: &[f64],
        p: &mut [f64],
        t: f64,
    ) -> Result<[f64; 2], SolverError> {
        self.place(system, q, t);
        if self.reads_prescribed {
            // Only the prescribed entries are read.
            system.coordinates().embed_velocity(p, t, &mut self.x_dot);
        }
        let (mut change, mut work) = (0.0, 0.0);
        for cluster in &self.clusters {
            let g = cluster.jacobian();
            // Project twice, so that the round-off of the first projection is projected too.
            for _ in 0..2 {
                let (step, done) = cluster.project(&g, p, &self.x_dot)?;
                change += done;
                if self.reads_prescribed {
                    work += cluster.prescribed_work(&g, step.as_slice(), &self.x_dot);
                }
            }
        }
        Ok([change, work])
    }
}

/// A row of G on the free coordinates: (coordinate, value).
pub(crate) type Row = Vec<(u32, f64)>;

impl Cluster {
    /// Returns λᵀG d over the prescribed coordinates of the cluster.
    fn prescribed_work(&self, g: &DMatrix<f64>, lambda: &[f64], d: &[f64]) -> f64 {
        let mut work = 0.0;
        for (k, _) in self.free.iter().enumerate().filter(|(_, free)| **free == NONE) {
            let sum: f64 = lambda.iter().enumerate().map(|(i, lambda)| g[(i, k)] * lambda).sum();
            work += sum * d[self.dofs[k] as usize];
        }
        work
    }

    /// Projects p by p −= Gᵀμ so that G M⁻¹p + G ẋ = 0, where ẋ holds the velocities of prescribed coordinates (none move if it
    /// is empty). Returns μ and the change of ½ pᵀM⁻¹p.
    fn project(
        &self,
        g: &DMatrix<f64>,
        p: &mut [f64],
        prescribed: &[f64],
    ) -> Result<(DVector<f64>, f64), SolverError> {
        let velocity = |(k, &free): (usize, &u32)| match free {
            NONE => prescribed.get(self.dofs[k] as usize).copied().unwrap_or(0.0),
            free => self.inverse_mass[k] * p[free as usize],
        };
        let velocities = self.free.iter().enumerate().map(velocity);
        let rate = g * DVector::from_iterator(self.free.len(), velocities);
        let step = self.solve(self.metric(g, g), &rate);
        let step = step.ok_or_else(|| self.failure(0, 0, rate.amax()))?;
        let change = self.kick(&g.tr_mul(&step), p);
        Ok((step, change))
    }

    /// Subtracts an impulse from p; returns the change of ½ pᵀM⁻¹p.
    fn kick(&self, impulse: &DVector<f64>, p: &mut [f64]) -> f64 {
        let mut change = 0.0;
        for (k, &free) in self.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
            let before = p[free as usize];
            p[free as usize] -= impulse[k];
            change -= impulse[k] * (before - 0.5 * impulse[k]) * self.inverse_mass[k];
        }
        change
    }
}

/// Returns the constraints by cluster, both in the order of the system.
fn clusters<'a>(system: &'a System, free_of: &[u32]) -> Vec<Vec<&'a QuadraticConstraint>> {
    let constraints = system.constraints();
    let mut label: Vec<usize> = (0..constraints.len()).collect();
    let mut first_of = std::collections::BTreeMap::new();
    for (i, constraint) in constraints.iter().enumerate() {
        let free_nodes: Vec<u32> = constraint
            .nodes()
            .filter(|&node| (0..3).any(|k| free_of[3 * node as usize + k] != NONE))
            .collect();
        for node in free_nodes {
            let other = label[*first_of.entry(node).or_insert(i)];
            let (keep, drop) = (other.min(label[i]), other.max(label[i]));
            if keep != drop {
                label.iter_mut().filter(|l| **l == drop).for_each(|l| *l = keep);
            }
        }
    }
    let mut order = label.clone();
    order.sort_unstable();
    order.dedup();
    let members = |cluster: usize| {
        constraints.iter().zip(&label).filter(move |(_, l)| **l == cluster).map(|(constraint, _)| constraint)
    };
    order.into_iter().map(|cluster| members(cluster).collect()).collect()
}

/// Makes the momenta of `state` tangent to the constraints by impulses of the constraints, as at the beginning of a
/// run. Returns the change of the velocities relative to the velocities, both in the norm of the mass.
///
/// # Errors
/// Returns [`SolverError::ConstraintDefect`] if the state is not on the manifold to 1e-9 of the terms that the
/// constraints sum.
pub fn make_tangent(system: &System, state: &mut vi_core::State) -> Result<f64, SolverError> {
    let Some(mut manifold) = ConstraintManifold::new(system) else { return Ok(0.0) };
    manifold.set_directions(system, &state.q, state.t);
    for cluster in &manifold.clusters {
        let defect = cluster.defect();
        let (worst, which) = cluster.worst(&defect);
        if worst > 1e-9 / f64::EPSILON {
            return Err(cluster.failure(which, 0, defect[which]));
        }
    }
    let before = state.p.clone();
    manifold.project_momenta(system, &state.q, &mut state.p, state.t)?;
    let square = |p: &dyn Fn(usize) -> f64| -> f64 {
        system.free_mass().iter().enumerate().map(|(k, mass)| p(k) * p(k) / mass).sum()
    };
    let change = square(&|k| state.p[k] - before[k]);
    Ok(if change == 0.0 { 0.0 } else { (change / square(&|k| before[k]).max(change)).sqrt() })
}

/// Adds to the accelerations of all coordinates the part that keeps them on the constraints, for velocities `v` of
/// all coordinates: a −= M⁻¹Gᵀμ with G a + γ = 0 and γ = g(x + v) − 2 g(x) + g(x − v) for quadratic g. If constraints
/// unexpectedly depend on each other, adds nothing.
pub(crate) fn constrain_accelerations(system: &System, state: &vi_core::State, v: &[f64], a: &mut [f64]) {
    let Some(mut manifold) = ConstraintManifold::new(system) else { return };
    manifold.set_directions(system, &state.q, state.t);
    for cluster in &manifold.clusters {
        let local = |values: &[f64]| -> DVector<f64> {
            DVector::from_iterator(cluster.dofs.len(), cluster.dofs.iter().map(|&dof| values[dof as usize]))
        };
        let (y, v) = (DVector::from_column_slice(&cluster.y), local(v));
        let (ahead, behind) = (&y + &v, &y - &v);
        let bend = DVector::from_iterator(
            cluster.constraints.len(),
            cluster.constraints.iter().map(|g| {
                g.value(ahead.as_slice()) + g.value(behind.as_slice()) - 2.0 * g.value(y.as_slice())
            }),
        );
        let rate = &cluster.normal * local(a) + bend;
        if let Some(mu) = cluster.solve(cluster.metric(&cluster.normal, &cluster.normal), &rate) {
            let force = cluster.normal.tr_mul(&mu);
            for (k, &dof) in cluster.dofs.iter().enumerate() {
                a[dof as usize] -= cluster.inverse_mass[k] * force[k];
            }
        }
    }
}
