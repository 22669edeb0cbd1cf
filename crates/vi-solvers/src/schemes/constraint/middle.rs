//! Steps of bodies with constraints whose multipliers act along the directions N in the middle of the step, where they do no
//! work:
//! ```text
//! M (y − u) + c (f(y) + Nᵀℓ) = 0,   g(y) = 0,   N = ∂g/∂q at (q₀ + y)/2
//! ```
//! u is the end without forces and y the end of the step. For quadratic g, N (y − q₀) = g(y) − g(q₀) = 0 exactly.
//! Newton's method moves y in the tangent space of its clusters and then projects it onto their manifold, so that bodies are
//! rigid in all iterates and no multiplier is an unknown:
//! ```text
//! Sᵀ (M + c ∂f/∂y + (c/2) Σ ℓ_i ∂²g_i/∂q²) T z = −Sᵀ R,   y ← y + T z
//! ```
//! The columns of S are a basis of the null space of N M⁻¹, orthonormal in the norm of M in a unit of mass, so Sᵀ removes Nᵀℓ. Those of T are the
//! columns of S without their parts across the manifold at y.

use nalgebra::{DMatrix, DVector};
use vi_core::System;

use crate::error::SolverError;
use crate::index::{NONE, free_of};
use crate::schemes::constraint::cluster::{Cluster, clusters};
use crate::unit_of_mass::per_unit_of_mass;

/// Largest number of times that the directions of a free drift are renewed. The error decreases by about (ωh/2)² each time for
/// bodies that spin at the rate ω.
const MOST_ROUNDS: u32 = 30;
/// Changes below this many units of round-off of the largest coordinate end the renewal.
const NOISE: f64 = 4.0 * f64::EPSILON;
/// If constraints depend on each other, singular values of M^(−½)Nᵀ below this fraction of the largest count as zero.
const SINGULAR: f64 = 1e-8;

/// The clusters of a system, none of which reads prescribed coordinates.
pub(crate) struct ConstrainedBodies {
    clusters: Vec<Cluster>,
    nodes: Vec<Vec<u32>>,
    /// Mass of the points of each cluster, kg. Directors do not count.
    mass: Vec<f64>,
    /// The inverse of the unit of mass in whose norm bases are orthonormal.
    per_unit: f64,
    is_ranked: bool,
}

/// The tangent space of a cluster at an iterate.
pub(crate) struct TangentSpace {
    /// S and T, coordinates × dimension of the tangent space.
    pub(crate) left: DMatrix<f64>,
    pub(crate) right: DMatrix<f64>,
    /// Sᵀ (M/c + ½ Σ ℓ_i ∂²g_i/∂q²) T.
    pub(crate) inertia: DMatrix<f64>,
}

impl ConstrainedBodies {
    /// Returns the clusters of a system. Returns `None` if one of them reads prescribed coordinates.
    pub(crate) fn new(system: &System) -> Option<Self> {
        let free_of = free_of(system.coordinates());
        let of = |members: &Vec<_>| Cluster::new(system, members, &free_of);
        let clusters: Vec<Cluster> = clusters(system, &free_of).iter().map(of).collect();
        if clusters.iter().any(|cluster| cluster.free.contains(&NONE)) {
            return None;
        }
        let nodes: Vec<Vec<u32>> = clusters.iter().map(Cluster::nodes).collect();
        let mass = clusters.iter().map(Cluster::mass_of_points).collect();
        Some(Self { clusters, nodes, mass, per_unit: per_unit_of_mass(system.free_mass()), is_ranked: false })
    }

    /// Returns the nodes of each cluster, three coordinates per node.
    pub(crate) fn nodes(&self) -> &[Vec<u32>] {
        &self.nodes
    }

    /// Returns the mass of the points of a cluster, kg.
    pub(crate) fn mass(&self, cluster: usize) -> f64 {
        self.mass[cluster]
    }

    /// Moves the end of a drift over h (s) without forces to that with the forces of constraints alone, and writes their impulses
    /// −h Nᵀℓ (N s) for the coordinates of the clusters. `start` is the start of the drift, on the manifold.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if the iteration does not converge.
    pub(crate) fn drift(
        &mut self,
        start: &[f64],
        end: &mut [f64],
        h: f64,
        impulses: &mut [f64],
    ) -> Result<(), SolverError> {
        for cluster in &mut self.clusters {
            let drifted: Vec<f64> = cluster.free.iter().map(|&k| end[k as usize]).collect();
            let mut before = drifted.clone();
            let mut last = f64::INFINITY;
            for round in 0.. {
                set_middle(cluster, start, end, self.is_ranked);
                cluster.free.iter().zip(&drifted).for_each(|(&k, drifted)| end[k as usize] = *drifted);
                // y = u − (h/2) M⁻¹Nᵀλ with λ = h ℓ.
                let lambda = cluster.project_positions(end, &[], 0.5 * h)?;
                let impulse = cluster.normal.tr_mul(&lambda);
                cluster.free.iter().zip(&impulse).for_each(|(&k, value)| impulses[k as usize] = -value);
                let change = cluster.relative_change(&before, end);
                cluster.free.iter().zip(&mut before).for_each(|(&k, before)| *before = end[k as usize]);
                if change <= NOISE || (change <= 1e-12 && change >= 0.5 * last) {
                    break;
                }
                if round == MOST_ROUNDS {
                    return Err(cluster.failure(0, round, change));
                }
                last = change;
            }
        }
        self.is_ranked = true;
        Ok(())
    }

    /// Projects the coordinates y of a cluster onto its manifold.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if the iteration does not converge.
    pub(crate) fn project(&mut self, cluster: usize, y: &mut [f64]) -> Result<(), SolverError> {
        let cluster = &mut self.clusters[cluster];
        cluster.place(y, &[]);
        if cluster.is_on_manifold() {
            return Ok(());
        }
        set_directions(cluster, self.is_ranked);
        cluster.project_positions(y, &[], 1.0).map(|_| ())
    }

    /// Returns the free coordinates of a cluster.
    pub(crate) fn free(&self, cluster: usize) -> &[u32] {
        &self.clusters[cluster].free
    }

    /// Returns the forces Nᵀℓ (N) of the constraints of a cluster for the step from `start` to `y`. `residual` has M (y − u)/c + f at each
    /// coordinate of the cluster.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if constraints that were independent of each other depend on each other here.
    pub(crate) fn reactions(
        &mut self,
        cluster: usize,
        ends: [&[f64]; 2],
        residual: &[f64],
    ) -> Result<DVector<f64>, SolverError> {
        let cluster = &mut self.clusters[cluster];
        let lambda = multipliers(cluster, ends, self.is_ranked, residual)?;
        Ok(cluster.normal.tr_mul(&lambda))
    }

    /// Returns the tangent space of a cluster at the iterate `y` of a step from `start`. `residual` returns M (y − u)/c + f at each
    /// coordinate of the cluster.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if constraints that were independent of each other depend on each other here.
    pub(crate) fn tangent_space(
        &mut self,
        cluster: usize,
        [start, y]: [&[f64]; 2],
        c: f64,
        residual: &[f64],
    ) -> Result<TangentSpace, SolverError> {
        let cluster = &mut self.clusters[cluster];
        let lambda = multipliers(cluster, [start, y], self.is_ranked, residual)?;
        let left = null_space(cluster, self.per_unit);
        // Remove the parts across the manifold at y.
        cluster.place(y, &[]);
        let g = cluster.jacobian();
        let across = cluster.factor(cluster.metric(&g, &g));
        let mut right = left.clone();
        for mut column in right.column_iter_mut() {
            let part = across.solve(&(&g * &column)).ok_or_else(|| cluster.failure(0, 0, f64::NAN))?;
            column -= cluster.inverse_mass.component_mul(&g.tr_mul(&part));
        }
        let mut inertia = cluster.curvature(lambda.as_slice()) * 0.5;
        for (k, inverse_mass) in cluster.inverse_mass.iter().enumerate() {
            inertia[(k, k)] += 1.0 / (inverse_mass * c);
        }
        let inertia = left.tr_mul(&(inertia * &right));
        Ok(TangentSpace { left, right, inertia })
    }
}

/// Takes the directions N in the middle of the step from `start` to `end`; returns the multipliers ℓ, for which N M⁻¹ (residual + Nᵀℓ) is zero.
fn multipliers(
    cluster: &mut Cluster,
    [start, end]: [&[f64]; 2],
    is_ranked: bool,
    residual: &[f64],
) -> Result<DVector<f64>, SolverError> {
    let metric = set_middle(cluster, start, end, is_ranked);
    let weighted = cluster.inverse_mass.component_mul(&DVector::from_column_slice(residual));
    let along = &cluster.normal * weighted;
    let lambda = cluster.solve(metric, &along).ok_or_else(|| cluster.failure(0, 0, f64::NAN))?;
    Ok(-lambda)
}

/// Takes the directions in the middle of a step; returns their metric.
fn set_middle(cluster: &mut Cluster, start: &[f64], end: &[f64], is_ranked: bool) -> DMatrix<f64> {
    for (y, &k) in cluster.y.iter_mut().zip(&cluster.free) {
        *y = 0.5 * (start[k as usize] + end[k as usize]);
    }
    set_directions(cluster, is_ranked)
}

/// Takes the directions at the current configuration; returns their metric. Finds whether constraints depend on each other if that is not
/// known yet.
fn set_directions(cluster: &mut Cluster, is_ranked: bool) -> DMatrix<f64> {
    let metric = cluster.set_directions();
    if !is_ranked {
        cluster.is_redundant = cluster.units.are_dependent(metric.clone());
    }
    metric
}

/// Returns a basis of the vectors s with N s = 0 that is orthonormal in the norm of M, with masses in a unit.
fn null_space(cluster: &Cluster, per_unit: f64) -> DMatrix<f64> {
    let root = cluster.inverse_mass.map(|inverse| (inverse / per_unit).sqrt());
    let scale = |mut matrix: DMatrix<f64>| {
        matrix.row_iter_mut().zip(&root).for_each(|(mut row, root)| row *= *root);
        matrix
    };
    let mut span = scale(cluster.normal.transpose());
    if cluster.is_redundant {
        // Rows of different dimensions become comparable.
        span.column_iter_mut().for_each(|mut column| {
            column.normalize_mut();
        });
        let svd = span.svd(true, false);
        let limit = SINGULAR * svd.singular_values.max();
        let rank = svd.singular_values.iter().filter(|value| **value > limit).count();
        span = svd.u.map_or_else(|| DMatrix::zeros(root.len(), 0), |u| u.columns(0, rank).into_owned());
    }
    // The orthogonal factor of [span, 1] begins with a basis of the span and continues with one of its complement.
    let (count, rank) = (root.len(), span.ncols());
    let mut extended = DMatrix::zeros(count, rank + count);
    extended.columns_mut(0, rank).copy_from(&span);
    extended.columns_mut(rank, count).fill_with_identity();
    let basis = extended.qr().q();
    scale(basis.columns(rank, count - rank).into_owned())
}

#[cfg(test)]
mod tests {
    use vi_core::Coordinates;
    use vi_core::constraints::{Place, QuadraticConstraint};

    use super::*;

    /// Two points in space, one length unit apart, with a redundant copy of their constraint if asked for.
    fn rod(is_redundant: bool) -> System {
        let [a, b] = [Place::node(0), Place::node(1)];
        let constraint = || QuadraticConstraint::distance("rod", &a, &b, 1.0);
        let constraints = if is_redundant { vec![constraint(), constraint()] } else { vec![constraint()] };
        let mass = vec![2.0, 2.0, 2.0, 3.0, 3.0, 3.0];
        let system = System::new(mass, Vec::new(), Coordinates::all_free(6)).unwrap();
        system.with_constraints(constraints).unwrap()
    }

    const START: [f64; 6] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];

    #[test]
    fn a_drift_keeps_energy_and_momenta_on_the_manifold() {
        let (system, h) = (rod(false), 0.2);
        let mut bodies = ConstrainedBodies::new(&system).unwrap();
        let momentum = [1.0, -2.0, 0.5, 1.5, 3.0, -0.5];
        let mass = system.free_mass();
        let mut end: Vec<f64> = (0..6).map(|k| START[k] + h * momentum[k] / mass[k]).collect();
        let mut impulses = vec![0.0; 6];
        bodies.drift(&START, &mut end, h, &mut impulses).unwrap();
        let after: Vec<f64> = momentum.iter().zip(&impulses).map(|(p, impulse)| p + impulse).collect();
        let energy = |p: &[f64]| (0..6).map(|k| 0.5 * p[k] * p[k] / mass[k]).sum::<f64>();
        let length = (0..3).map(|k| (end[k] - end[k + 3]).powi(2)).sum::<f64>();
        assert!((length - 1.0).abs() < 1e-14, "{length}");
        assert!((energy(&after) - energy(&momentum)).abs() < 1e-14);
        for k in 0..3 {
            assert!((impulses[k] + impulses[k + 3]).abs() < 1e-14);
            // The impulses lead to the end: y = q₀ + h M⁻¹ (p₀ + p₁)/2.
            let mean = 0.5 * (momentum[k] + after[k]) / mass[k];
            assert!((START[k] + h * mean - end[k]).abs() < 1e-14);
        }
    }

    #[test]
    fn tangent_spaces_are_orthonormal_and_remove_constraints() {
        for is_redundant in [false, true] {
            let system = rod(is_redundant);
            let mut bodies = ConstrainedBodies::new(&system).unwrap();
            let mut y = vec![0.1, 0.0, 0.2, 1.0, 0.3, 0.1];
            bodies.project(0, &mut y).unwrap();
            let space = bodies.tangent_space(0, [&START, &y], 1.0, &[0.0; 6]).unwrap();
            assert_eq!(space.left.ncols(), 5);
            let mass = DMatrix::from_diagonal(&DVector::from_column_slice(system.free_mass()));
            // Masses are in the unit of the bodies.
            let unit = space.left.tr_mul(&(&mass * &space.left)) * bodies.per_unit;
            assert!((unit - DMatrix::identity(5, 5)).amax() < 1e-13);
            // Normals of |a − b|² in the middle and at y.
            let normal = |q: &dyn Fn(usize) -> f64| {
                DVector::from_fn(6, |k, _| if k < 3 { q(k) - q(k + 3) } else { q(k) - q(k - 3) })
            };
            let middle = normal(&|k| 0.5 * (START[k] + y[k]));
            assert!(space.left.tr_mul(&middle).amax() < 1e-13);
            assert!(space.right.tr_mul(&normal(&|k| y[k])).amax() < 1e-13);
        }
    }
}
