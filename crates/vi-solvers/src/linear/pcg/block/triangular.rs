//! Solves with P = (I + L) D (I + L)ᵀ: a forward and a backward sweep over the rows of each domain.

use std::ops::Range;

use pulp::Arch;

use crate::linear::matrix::Pattern;

/// Computes z = P⁻¹ r, with blocks of `B` coordinates in `W` lanes.
pub(super) struct Solve<'a, const B: usize, const W: usize> {
    pub(super) pattern: &'a Pattern,
    /// D⁻¹ by rows, and L by entries.
    pub(super) inverse: &'a [[f64; B]],
    pub(super) lower: &'a [f32],
    /// First entry of each row inside its domain.
    pub(super) first_inside: &'a [u32],
    pub(super) r: &'a [[f64; B]],
}

impl<const B: usize, const W: usize> Solve<'_, B, W> {
    /// Solves for the rows of some domains; `scratch` are two vectors in lanes for these rows.
    pub(super) fn domains(
        &self,
        domains: &[Range<usize>],
        z: &mut [[f64; B]],
        scratch: [&mut [[f64; W]]; 2],
    ) {
        match domains {
            [] => {}
            [rows] if self.lower.is_empty() => self.diagonal(rows.clone(), z),
            [rows] => Arch::new().dispatch(|| self.sweeps(rows.clone(), z, scratch)),
            _ => {
                let (left, right) = domains.split_at(domains.len() / 2);
                let rows = right[0].start - left[0].start;
                let (left_z, right_z) = z.split_at_mut(rows);
                // Without L there is no scratch memory.
                let [y, sums] = scratch.map(|vector| vector.split_at_mut(rows.min(vector.len())));
                rayon::join(
                    || self.domains(left, left_z, [y.0, sums.0]),
                    || self.domains(right, right_z, [y.1, sums.1]),
                );
            }
        }
    }

    fn diagonal(&self, rows: Range<usize>, z: &mut [[f64; B]]) {
        for (row, z) in rows.zip(z) {
            let inverse = &self.inverse[row * B..(row + 1) * B];
            *z = std::array::from_fn(|i| (0..B).map(|j| inverse[i][j] * self.r[row][j]).sum());
        }
    }

    /// Performs both sweeps. All loops over lanes have a fixed length, so that they become vector instructions. The lanes after
    /// the last coordinate read numbers of the next block: the forward sweep multiplies them by zero, and nothing uses what
    /// the backward sweep makes of them.
    #[inline(always)]
    fn sweeps(&self, rows: Range<usize>, z: &mut [[f64; B]], [y, sums]: [&mut [[f64; W]]; 2]) {
        let pattern = self.pattern;
        let first = rows.start;
        let entries = |row: usize| self.first_inside[row] as usize..pattern.row_start[row + 1] as usize - 1;
        // Forward: y_i = r_i − Σ L_ij y_j, then sums_i = D_i⁻¹ y_i.
        for row in rows.clone() {
            let mut products = [[0.0; W]; B];
            for entry in entries(row) {
                let l = &self.lower[entry * B * B..][..B * (B - 1) + W];
                let y = &y[pattern.columns[entry] as usize - first];
                for i in 0..B {
                    for lane in 0..W {
                        products[i][lane] += f64::from(l[i * B + lane]) * y[lane];
                    }
                }
            }
            let mut value = [0.0; W];
            for i in 0..B {
                value[i] = self.r[row][i] - products[i].iter().sum::<f64>();
            }
            y[row - first] = value;
            let inverse = &self.inverse[row * B..row * B + B];
            let mut improved = [0.0; W];
            for i in 0..B {
                improved[i] = (0..B).map(|j| inverse[i][j] * value[j]).sum();
            }
            sums[row - first] = improved;
        }
        // Backward: z_i = sums_i − Σ L_jiᵀ z_j. Each row, once known, is subtracted from the rows before it.
        for row in rows.rev() {
            let value = sums[row - first];
            z[row - first] = std::array::from_fn(|i| value[i]);
            for entry in entries(row) {
                let l = &self.lower[entry * B * B..][..B * (B - 1) + W];
                let sum = &mut sums[pattern.columns[entry] as usize - first];
                for i in 0..B {
                    for lane in 0..W {
                        sum[lane] -= f64::from(l[i * B + lane]) * value[i];
                    }
                }
            }
        }
    }
}
