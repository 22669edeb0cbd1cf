//! A cluster: constraints that share free coordinates (a rigid body, a mechanism). Its Jacobian G is a small dense matrix over the
//! few coordinates that it reads, and the lumped mass is diagonal. Forms the products with G, and projects momenta onto the tangent
//! space of one cluster.

use nalgebra::{DMatrix, DVector};
use vi_core::System;
use vi_core::constraints::QuadraticConstraint;

use crate::error::SolverError;
use crate::index::NONE;
use crate::schemes::constraint::units::{Factored, Units};

/// Number of iterations for the multipliers after which a step fails.
const MAX_ITERATIONS: u32 = 50;
/// A defect counts as zero if it is below this many units of its round-off.
const NOISE: f64 = 4.0;

/// Returns whether an iteration has reached the manifold, or as near as round-off allows: |g| is `worst` units of round-off, and
/// was `previous` before.
pub(super) fn is_met(worst: f64, previous: f64) -> bool {
    worst <= NOISE || (worst < 1e4 && worst >= 0.5 * previous)
}

/// Constraints that share free coordinates, with coordinates numbered from 0.
pub(super) struct Cluster {
    pub(super) constraints: Vec<QuadraticConstraint>,
    /// The coordinates x_i that the cluster reads.
    pub(super) dofs: Vec<u32>,
    /// The free coordinate of each of `dofs`, or [`NONE`] if it is prescribed.
    pub(super) free: Vec<u32>,
    /// Whether each node of the cluster is a director, whose coordinates are not lengths.
    is_director: Vec<bool>,
    /// Inverse masses of the free coordinates; zero for the others.
    pub(super) inverse_mass: DVector<f64>,
    /// The current values of the coordinates.
    pub(super) y: Vec<f64>,
    /// G at the configuration from which the step takes the directions of the multipliers.
    pub(super) normal: DMatrix<f64>,
    /// Units of N M⁻¹ Nᵀ with these directions N.
    pub(super) units: Units,
    /// Whether its constraints depend on each other.
    pub(super) is_redundant: bool,
}

impl Cluster {
    pub(super) fn new(system: &System, members: &[&QuadraticConstraint], free_of: &[u32]) -> Self {
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

    /// Returns its nodes, in the order of its coordinates.
    pub(super) fn nodes(&self) -> Vec<u32> {
        self.dofs.iter().step_by(3).map(|dof| dof / 3).collect()
    }

    /// Returns the mass of its points, kg; directors do not count.
    pub(super) fn mass_of_points(&self) -> f64 {
        let nodes = self.inverse_mass.as_slice().chunks_exact(3).zip(&self.is_director);
        nodes.filter(|(_, is_director)| !**is_director).map(|(inverse, _)| 1.0 / inverse[0]).sum()
    }

    /// Returns the largest change of its free coordinates from `before`, in their order, to their values in q. It is relative to the
    /// farthest point, and for directors, which are not lengths, to the longest of them.
    pub(super) fn relative_change(&self, before: &[f64], q: &[f64]) -> f64 {
        let (mut change, mut size) = ([0.0_f64; 2], [0.0_f64; 2]);
        for (place, (&k, before)) in self.free.iter().zip(before).enumerate() {
            let (kind, now) = (usize::from(self.is_director[place / 3]), q[k as usize]);
            change[kind] = change[kind].max((now - before).abs());
            size[kind] = size[kind].max(now.abs());
        }
        let relative = |kind: usize| if change[kind] == 0.0 { 0.0 } else { change[kind] / size[kind] };
        relative(0).max(relative(1))
    }

    /// Sets the configuration to q; reads prescribed coordinates from `x`.
    pub(super) fn place(&mut self, q: &[f64], x: &[f64]) {
        for (k, y) in self.y.iter_mut().enumerate() {
            *y = if self.free[k] == NONE { x[self.dofs[k] as usize] } else { q[self.free[k] as usize] };
        }
    }

    /// Takes the directions of the multipliers at the current configuration. Returns their metric N M⁻¹ Nᵀ.
    pub(super) fn set_directions(&mut self) -> DMatrix<f64> {
        self.normal = self.jacobian();
        let metric = self.metric(&self.normal, &self.normal);
        self.units = Units::of(&metric.diagonal());
        metric
    }

    /// Returns G at the current configuration, m × coordinates.
    pub(super) fn jacobian(&self) -> DMatrix<f64> {
        let mut transposed = DMatrix::zeros(self.dofs.len(), self.constraints.len());
        let columns = transposed.as_mut_slice().chunks_exact_mut(self.dofs.len());
        for (constraint, column) in self.constraints.iter().zip(columns) {
            constraint.add_gradient(&self.y, 1.0, column);
        }
        transposed.transpose()
    }

    /// Returns g at the current configuration.
    pub(super) fn defect(&self) -> DVector<f64> {
        DVector::from_iterator(self.constraints.len(), self.constraints.iter().map(|c| c.value(&self.y)))
    }

    /// Returns the largest |g| in units of its round-off, and its constraint.
    pub(super) fn worst(&self, defect: &DVector<f64>) -> (f64, usize) {
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

    /// Returns whether the current configuration is on the manifold, up to round-off.
    pub(super) fn is_on_manifold(&self) -> bool {
        self.worst(&self.defect()).0 <= NOISE
    }

    /// Returns G M⁻¹ Nᵀ.
    pub(super) fn metric(&self, g: &DMatrix<f64>, normal: &DMatrix<f64>) -> DMatrix<f64> {
        let mut weighted = normal.transpose();
        for (mut row, inverse) in weighted.row_iter_mut().zip(&self.inverse_mass) {
            row *= *inverse;
        }
        g * weighted
    }

    /// Solves S λ = r.
    pub(super) fn solve(&self, matrix: DMatrix<f64>, rhs: &DVector<f64>) -> Option<DVector<f64>> {
        self.units.solve(matrix, rhs, self.is_redundant)
    }

    /// Factors S for several solutions of S λ = r.
    pub(super) fn factor(&self, matrix: DMatrix<f64>) -> Factored {
        self.units.clone().factor(matrix, self.is_redundant)
    }

    /// Moves q onto the manifold along the directions of the multipliers, q −= scale M⁻¹Nᵀλ with g(q) = 0; reads prescribed
    /// coordinates from `x`. Returns λ.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if the iteration does not converge.
    pub(super) fn project_positions(
        &mut self,
        q: &mut [f64],
        x: &[f64],
        scale: f64,
    ) -> Result<DVector<f64>, SolverError> {
        let mut total = DVector::zeros(self.constraints.len());
        let (mut previous, mut iterations) = (f64::INFINITY, 0);
        loop {
            self.place(q, x);
            let defect = self.defect();
            let (worst, which) = self.worst(&defect);
            if is_met(worst, previous) {
                return Ok(total);
            }
            if !worst.is_finite() || iterations >= MAX_ITERATIONS {
                return Err(self.failure(which, iterations, defect[which]));
            }
            (previous, iterations) = (worst, iterations + 1);
            let matrix = self.metric(&self.jacobian(), &self.normal) * scale;
            let step = self.solve(matrix, &defect);
            let step = step.ok_or_else(|| self.failure(which, iterations, defect[which]))?;
            let impulse = self.normal.tr_mul(&step);
            for (k, &free) in self.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
                q[free as usize] -= scale * self.inverse_mass[k] * impulse[k];
            }
            total += step;
        }
    }

    /// Returns Σ λ_i ∂²g_i/∂x², coordinates × coordinates.
    pub(super) fn curvature(&self, lambda: &[f64]) -> DMatrix<f64> {
        curvature(self.constraints.iter().zip(lambda.iter().copied()), self.dofs.len())
    }

    pub(super) fn failure(&self, constraint: usize, iterations: u32, defect: f64) -> SolverError {
        let constraint = self.constraints[constraint].name().to_owned();
        SolverError::ConstraintDefect { constraint, iterations, defect }
    }

    /// Returns λᵀG d over the prescribed coordinates of the cluster.
    pub(super) fn prescribed_work(&self, g: &DMatrix<f64>, lambda: &[f64], d: &[f64]) -> f64 {
        let mut work = 0.0;
        for (k, _) in self.free.iter().enumerate().filter(|(_, free)| **free == NONE) {
            let sum: f64 = lambda.iter().enumerate().map(|(i, lambda)| g[(i, k)] * lambda).sum();
            work += sum * d[self.dofs[k] as usize];
        }
        work
    }

    /// Projects p by p −= Gᵀμ so that G M⁻¹p + G ẋ = 0, where ẋ holds the velocities of prescribed coordinates (none move if it
    /// is empty). Returns μ and the change of ½ pᵀM⁻¹p.
    pub(super) fn project(
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
    pub(super) fn kick(&self, impulse: &DVector<f64>, p: &mut [f64]) -> f64 {
        let mut change = 0.0;
        for (k, &free) in self.free.iter().enumerate().filter(|(_, free)| **free != NONE) {
            let before = p[free as usize];
            p[free as usize] -= impulse[k];
            change -= impulse[k] * (before - 0.5 * impulse[k]) * self.inverse_mass[k];
        }
        change
    }
}

/// Returns Σ λ_i ∂²g_i/∂x² of constraints on `count` coordinates, numbered from 0.
pub(crate) fn curvature<'a>(
    members: impl Iterator<Item = (&'a QuadraticConstraint, f64)> + Clone,
    count: usize,
) -> DMatrix<f64> {
    let gradient = |y: &[f64]| {
        let mut sum = DVector::zeros(count);
        let members = members.clone();
        members.for_each(|(constraint, lambda)| constraint.add_gradient(y, lambda, sum.as_mut_slice()));
        sum
    };
    // Gradients of quadratic constraints are affine, so unit differences are exact.
    let mut y = vec![0.0; count];
    let origin = gradient(&y);
    let mut curvature = DMatrix::zeros(count, count);
    for (j, mut column) in curvature.column_iter_mut().enumerate() {
        y[j] = 1.0;
        column.copy_from(&(gradient(&y) - &origin));
        y[j] = 0.0;
    }
    curvature
}

/// Returns the constraints by cluster, both in the order of the system.
pub(super) fn clusters<'a>(system: &'a System, free_of: &[u32]) -> Vec<Vec<&'a QuadraticConstraint>> {
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
