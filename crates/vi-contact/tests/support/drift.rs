//! The drift of nodes in contact, M (v₁ − v₀) = −h G(x₀, x₁), x₁ = x₀ + h (v₀ + v₁)/2, cluster by cluster, as an
//! explicit scheme makes it between two kicks. Nodes outside the clusters drift straight.
//!
//! Newton's method uses the positive part of ∂G/∂x₁ (rank one per pair) and starts from the free drift; iterates stay
//! on paths that are proved free. A cluster that does not converge drifts in two halves.

use nalgebra::{DMatrix, DVector};
use vi_contact::{Contact, Neighbours, StepPair, StepSettings, Surface, clusters};

/// Largest number of Newton corrections of one solve.
const CORRECTIONS: usize = 60;
/// Largest number of halvings of a drift.
const HALVINGS: usize = 8;

pub(crate) struct Drift<'a> {
    pub(crate) surface: &'a Surface,
    /// Mass per node, kg; infinite for held nodes.
    pub(crate) mass: &'a [f64],
    pub(crate) corrections: usize,
    pub(crate) solves: usize,
}

impl Drift<'_> {
    /// Drifts positions and velocities by h.
    pub(crate) fn run(&mut self, x: &mut [f64], v: &mut [f64], h: f64) {
        let far =
            v.chunks_exact(3).map(|v| v.iter().map(|v| v * v).sum::<f64>()).fold(0.0, f64::max).sqrt() * h;
        // Cover twice the free drift, and the velocities that contact may cause.
        let neighbours = Neighbours::find(self.surface, x, 16.0 * far + 1e-9);
        let contact = Contact { surface: self.surface, neighbours: &neighbours };
        let start = x.to_vec();
        x.iter_mut().zip(&*v).for_each(|(x, v)| *x += h * v);
        // Only nodes that candidates connect can push each other.
        let pairs = candidate_nodes(&contact);
        let free = |node: u32| self.mass[node as usize].is_finite();
        for cluster in clusters(self.mass.len(), pairs.iter().map(|nodes| &nodes[..]), free) {
            let dofs: Vec<usize> =
                cluster.iter().flat_map(|&node| (0..3).map(move |k| 3 * node as usize + k)).collect();
            self.cluster(&contact, &dofs, &start, x, v, h, 0);
        }
    }

    #[expect(clippy::too_many_arguments, reason = "a recursion over one state")]
    fn cluster(
        &mut self,
        contact: &Contact<'_>,
        dofs: &[usize],
        x0: &[f64],
        x1: &mut [f64],
        v: &mut [f64],
        h: f64,
        depth: usize,
    ) {
        if self.solve(contact, dofs, x0, x1, v, h) {
            return;
        }
        assert!(depth < HALVINGS, "the drift does not converge");
        let mut middle = x1.to_vec();
        self.cluster(contact, dofs, x0, &mut middle, v, 0.5 * h, depth + 1);
        self.cluster(contact, dofs, &middle, x1, v, 0.5 * h, depth + 1);
    }

    /// Solves one drift for the coordinates of a cluster; returns false if it does not converge.
    fn solve(
        &mut self,
        contact: &Contact<'_>,
        dofs: &[usize],
        x0: &[f64],
        x1: &mut [f64],
        v: &mut [f64],
        h: f64,
    ) -> bool {
        let settings = StepSettings::over(h);
        let local = |dof: usize| dofs.binary_search(&dof).ok();
        let mut trial = x1.to_vec();
        dofs.iter().for_each(|&k| trial[k] = x0[k] + h * v[k]);
        if let Some(impact) = contact.first_impact(x0, &trial) {
            dofs.iter().for_each(|&k| trial[k] = x0[k] + 0.9 * impact.time * h * v[k]);
        }
        let residual_of = |trial: &[f64]| -> (DVector<f64>, Vec<StepPair>) {
            let pairs = contact.step(x0, trial, &settings);
            let mut gradient = vec![0.0; x0.len()];
            pairs.iter().for_each(|pair| pair.add_gradient(&mut gradient));
            let entry =
                |&k: &usize| self.mass[k / 3] * (trial[k] - x0[k] - h * v[k]) + 0.5 * h * h * gradient[k];
            (DVector::from_iterator(dofs.len(), dofs.iter().map(entry)), pairs)
        };
        let scale: f64 = dofs.iter().map(|&k| (self.mass[k / 3] * h * v[k]).abs()).sum::<f64>() + 1e-300;
        let (mut residual, mut pairs) = residual_of(&trial);
        self.solves += 1;
        let mut done = residual.norm() <= 1e-14 * scale;
        for _ in 0..CORRECTIONS {
            if done {
                break;
            }
            self.corrections += 1;
            let mut matrix = DMatrix::from_diagonal(&DVector::from_iterator(
                dofs.len(),
                dofs.iter().map(|&k| self.mass[k / 3]),
            ));
            for pair in &pairs {
                let entries: Vec<(usize, f64)> = (0..3 * pair.arity)
                    .filter_map(|i| {
                        let place = local(3 * pair.nodes[i / 3] as usize + i % 3)?;
                        Some((place, pair.weights[i / 3] * pair.normal[i % 3]))
                    })
                    .collect();
                for &(i, a) in &entries {
                    entries.iter().for_each(|&(j, b)| matrix[(i, j)] += 0.5 * h * h * pair.stiffness * a * b);
                }
            }
            let Some(change) = matrix.lu().solve(&residual) else { return false };
            let gap = pairs.iter().map(|pair| pair.gap).fold(f64::INFINITY, f64::min);
            let mut part = 1.0;
            let next = (0..30).find_map(|_| {
                let mut next = trial.clone();
                dofs.iter().zip(change.iter()).for_each(|(&k, c)| next[k] -= part * c);
                if contact.neighbours.covers(&next) && contact.first_impact(x0, &next).is_none() {
                    let (other, found) = residual_of(&next);
                    let least = found.iter().map(|pair| pair.gap).fold(f64::INFINITY, f64::min);
                    if (gap.is_infinite() || least > 0.1 * gap) && other.norm() < residual.norm() {
                        return Some((next, other, found));
                    }
                }
                part *= 0.5;
                None
            });
            match next {
                Some(found) => (trial, residual, pairs) = found,
                None => {
                    done = residual.norm() <= 1e-11 * scale;
                    break;
                }
            }
            done = residual.norm() <= 1e-14 * scale;
        }
        if !(done || residual.norm() <= 1e-11 * scale) {
            return false;
        }
        for &k in dofs {
            v[k] = 2.0 * (trial[k] - x0[k]) / h - v[k];
            x1[k] = trial[k];
        }
        true
    }
}

/// Returns the nodes of all candidates.
fn candidate_nodes(contact: &Contact<'_>) -> Vec<Vec<u32>> {
    let (surface, neighbours) = (contact.surface, contact.neighbours);
    let mut pairs = Vec::new();
    for (point, part) in surface.points().iter().enumerate() {
        for &cell in neighbours.cells_of(point) {
            pairs.push([&[part.node], surface.cells()[cell as usize].nodes()].concat());
        }
    }
    for edges in neighbours.edge_pairs() {
        pairs.push(edges.map(|edge| surface.edges()[edge as usize].nodes).concat());
    }
    for &[point, plane] in neighbours.plane_pairs() {
        pairs.push(vec![surface.points()[point as usize].node, surface.half_spaces()[plane as usize].node]);
    }
    pairs
}
