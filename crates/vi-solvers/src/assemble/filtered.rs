//! Drifts with a filtered mass, q += a h W p: two passes over the nodes after the one that computes M⁻¹p.

use pulp::{Arch, Simd, WithSimd};
use vi_core::{MassFilter, Padded, System};

/// Number of nodes per task, and the multiple at which tasks are cut.
const TASK: usize = 683;
const GRAIN: usize = 8;
/// Number of nodes that are processed together, so that their velocities stay in cache.
const TILE: usize = 64;

/// Products with W, and their memory.
pub(crate) struct FilteredDrift {
    /// M⁻¹p of all coordinates, zero at prescribed ones.
    unfiltered: Vec<f64>,
    /// M⁻¹p and M⁻¹L M⁻¹p, node by node.
    v: Vec<Padded>,
    z: Vec<Padded>,
    arch: Arch,
}

impl FilteredDrift {
    pub(crate) fn new(system: &System) -> Self {
        let count = system.mass().len();
        let nodes = vec![Padded::default(); count / 3];
        Self { unfiltered: vec![0.0; count], v: nodes.clone(), z: nodes, arch: Arch::new() }
    }

    /// Returns the place for M⁻¹p of all coordinates. Those of prescribed ones must remain zero.
    pub(crate) fn unfiltered(&mut self) -> &mut [f64] {
        &mut self.unfiltered
    }

    /// Computes x += drift W p for the M⁻¹p in [`FilteredDrift::unfiltered`]; returns whether x is finite.
    pub(crate) fn drift(&mut self, filter: &MassFilter, drift: f64, x: &mut [f64]) -> bool {
        let unfiltered = self.unfiltered.as_chunks::<3>().0;
        for (v, [a, b, c]) in self.v.iter_mut().zip(unfiltered) {
            v.0 = [*a, *b, *c, 0.0];
        }
        self.drift_by_nodes(filter, drift, x)
    }

    /// Computes x += drift W p for p(k) at free coordinate k; returns whether x is finite.
    pub(crate) fn drift_of(
        &mut self,
        (system, filter): (&System, &MassFilter),
        p: impl Fn(usize) -> f64,
        drift: f64,
        x: &mut [f64],
    ) -> bool {
        filter.divide(system.coordinates(), p, &mut self.v);
        self.drift_by_nodes(filter, drift, x)
    }

    fn drift_by_nodes(&mut self, filter: &MassFilter, drift: f64, x: &mut [f64]) -> bool {
        let Self { v, z, arch, .. } = self;
        let v = &v[..];
        halves(0, z, &|first, out| arch.dispatch(Laplacian { filter, first, v, out }));
        let z = &z[..];
        halves(0, x.as_chunks_mut::<3>().0, &|first, x| {
            arch.dispatch(Drift { filter, first, v, z, drift, x })
        })
    }
}

/// Calls `run` with parts of `nodes` and the number of the first node of each; returns whether all calls returned true.
fn halves<T: Send>(first: usize, nodes: &mut [T], run: &(impl Fn(usize, &mut [T]) -> bool + Sync)) -> bool {
    let length = nodes.len();
    if length <= TASK {
        return run(first, nodes);
    }
    let middle = (length / 2).next_multiple_of(GRAIN);
    let (left, right) = nodes.split_at_mut(middle);
    let (a, b) = rayon::join(|| halves(first, left, run), || halves(first + middle, right, run));
    a && b
}

// The products with the vector instructions of the machine, one vector of four lanes per node. No product is fused with a
// sum, so that every machine gives the same bits.

/// Writes M⁻¹L v.
struct Laplacian<'a> {
    filter: &'a MassFilter,
    first: usize,
    v: &'a [Padded],
    out: &'a mut [Padded],
}

impl WithSimd for Laplacian<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> bool {
        self.filter.laplacian(self.first, self.v, self.out);
        true
    }
}

/// Computes x += drift P(M⁻¹L) v with z = M⁻¹L v; returns whether x is finite.
struct Drift<'a> {
    filter: &'a MassFilter,
    first: usize,
    v: &'a [Padded],
    z: &'a [Padded],
    drift: f64,
    x: &'a mut [[f64; 3]],
}

impl WithSimd for Drift<'_> {
    type Output = bool;
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> bool {
        let Self { filter, first, v, z, drift, x } = self;
        // Use one sum per axis: the additions to a single sum would have to wait for each other.
        let mut zeros = [0.0; 3];
        let mut velocities = [Padded::default(); TILE];
        for (tile, x) in x.chunks_mut(TILE).enumerate() {
            let velocities = &mut velocities[..x.len()];
            filter.filtered(first + tile * TILE, (v, z), velocities);
            for (x, velocity) in x.iter_mut().zip(velocities) {
                for k in 0..3 {
                    x[k] += drift * velocity.0[k];
                    zeros[k] += 0.0 * x[k];
                }
            }
        }
        zeros == [0.0; 3]
    }
}
