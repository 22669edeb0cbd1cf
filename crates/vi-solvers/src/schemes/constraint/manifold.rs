//! The manifold g(x) = 0 of the configurations that the constraints of a system allow. Multipliers project positions
//! onto it (SHAKE) and momenta onto its tangent space (RATTLE), both to round-off.
//!
//! Constraints that share free coordinates form a cluster (a rigid body, a mechanism). The Jacobian G of a cluster is
//! a small dense matrix over the few coordinates that it reads; the lumped mass is diagonal. So the cost depends on
//! the clusters and not on the bodies attached to them. If constraints of a cluster depend on each other in its first
//! configuration (closed loops), the multipliers of least norm are taken. Constraints have different dimensions (a
//! distance in m², a perpendicularity in 1); therefore S = G M⁻¹ Gᵀ is judged and solved in units of its own rows
//! (`units.rs`).

use nalgebra::DVector;
use vi_core::System;

use crate::error::SolverError;
use crate::index::{NONE, free_of};
use crate::schemes::constraint::cluster::{Cluster, clusters};

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

    /// Returns the number of free coordinates that constraints read.
    pub(crate) fn coordinate_count(&self) -> usize {
        let of = |cluster: &Cluster| cluster.free.iter().filter(|&&free| free != NONE).count();
        self.clusters.iter().map(of).sum()
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
            let metric = cluster.set_directions();
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
            let m = cluster.constraints.len();
            let curvature = cluster.curvature(&lambda[first..first + m]);
            for (j, &column) in cluster.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
                for (i, &row) in cluster.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
                    each(row, column, curvature[(i, j)]);
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

    /// Returns the largest |g| in units of its round-off, at the place of the last linearisation.
    pub(crate) fn worst(&self) -> f64 {
        let of = |cluster: &Cluster| cluster.worst(&cluster.defect()).0;
        self.clusters
            .iter()
            .map(of)
            .fold(0.0, |worst, value| if value > worst || value.is_nan() { value } else { worst })
    }

    /// Returns the error of an iteration that did not reach the manifold, with the worst constraint at the place of the last
    /// linearisation.
    pub(crate) fn not_met(&self, iterations: u32) -> SolverError {
        let mut worst = (0.0, SolverError::NoConvergence { iterations, residual: f64::NAN, tolerance: 0.0 });
        for cluster in &self.clusters {
            let defect = cluster.defect();
            let (value, which) = cluster.worst(&defect);
            if value > worst.0 || value.is_nan() {
                worst = (value, cluster.failure(which, iterations, defect[which]));
            }
        }
        worst.1
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
            let total = cluster.project_positions(q, &self.x, drift)?;
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
