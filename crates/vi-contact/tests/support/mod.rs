//! Meshes and random numbers for the tests of this crate.
#![allow(dead_code)]

pub(crate) mod drift;
pub(crate) mod particles;

use nalgebra::Vector3;
use vi_contact::{Body, SurfaceBuilder};

pub(crate) type Vec3 = Vector3<f64>;

/// A fixed sequence of random numbers from a seed (SplitMix64, Steele et al. 2014).
pub(crate) struct Numbers(u64);

impl Numbers {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    /// Returns a uniform number in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a uniform vector in [−1, 1)³.
    pub(crate) fn vector(&mut self) -> Vec3 {
        Vec3::new(2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0)
    }
}

/// A mesh of triangles: flat positions and nodes.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sheet {
    pub(crate) x: Vec<f64>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Sheet {
    /// Returns n × n squares of two triangles over [low, high]² at height z.
    pub(crate) fn grid(n: usize, low: f64, high: f64, z: f64) -> Self {
        let mut sheet = Self::default();
        for j in 0..=n {
            for i in 0..=n {
                let at = |k: usize| low + (high - low) * k as f64 / n as f64;
                sheet.x.extend([at(i), at(j), z]);
            }
        }
        let node = |i: usize, j: usize| (i + j * (n + 1)) as u32;
        for j in 0..n {
            for i in 0..n {
                let [a, b, c, d] = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
                // Alternate the diagonals, so that no direction is favoured.
                let pair = if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
                sheet.triangles.extend(pair);
            }
        }
        sheet
    }

    /// Appends another mesh; returns its triangles in the new numbering.
    pub(crate) fn join(&mut self, other: &Self) -> Vec<[u32; 3]> {
        let base = (self.x.len() / 3) as u32;
        self.x.extend(&other.x);
        let triangles: Vec<[u32; 3]> = other.triangles.iter().map(|t| t.map(|node| node + base)).collect();
        self.triangles.extend(&triangles);
        triangles
    }
}

/// Returns the constants of a body without thickness.
pub(crate) fn body(distance: f64, stiffness: f64) -> Body {
    Body { radius: 0.0, distance, stiffness, meets_itself: false }
}

/// Returns the position of a node.
pub(crate) fn at(x: &[f64], node: u32) -> Vec3 {
    Vec3::from_column_slice(&x[3 * node as usize..3 * node as usize + 3])
}

/// Returns two sheets half a layer apart and shifted against each other, the upper one at z = .02 m, and their positions.
pub(crate) fn sheets_half_a_layer_apart() -> (SurfaceBuilder, Vec<f64>) {
    let (lower, upper) = (Sheet::grid(5, 0.0, 1.0, 0.0), Sheet::grid(4, 0.07, 0.93, 0.02));
    let x: Vec<f64> = lower.x.iter().chain(&upper.x).copied().collect();
    let count = (lower.x.len() / 3) as u32;
    let mut builder = SurfaceBuilder::new(&x);
    let bodies = [builder.body(body(0.04, 2e3)), builder.body(body(0.04, 2e3))];
    builder.triangles(bodies[0], &lower.triangles);
    let above: Vec<[u32; 3]> = upper.triangles.iter().map(|cell| cell.map(|node| node + count)).collect();
    builder.triangles(bodies[1], &above);
    (builder, x)
}
