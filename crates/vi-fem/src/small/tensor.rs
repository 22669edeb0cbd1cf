//! 3 × 3 matrices and packed fourth-order tangents over [`Real`].

use crate::lanes::real::Real;

/// A 3 × 3 matrix by rows: `f[i][j]` with the spatial index i and the material index j.
pub type Mat3<R> = [[R; 3]; 3];

/// Builds a vector: `vec3!(i => a[i])` is `[a[0], a[1], a[2]]`.
///
/// Kernels use these macros and plain loops, and never pass closures to the standard library. Code that is not
/// certain to be inlined is compiled without the vector instructions, and then each lane operation is a call
/// (measured: sixty times slower).
macro_rules! vec3 {
    ($i:ident => $entry:expr) => {
        [
            {
                let $i = 0usize;
                $entry
            },
            {
                let $i = 1usize;
                $entry
            },
            {
                let $i = 2usize;
                $entry
            },
        ]
    };
}

/// Builds a matrix: `mat3!(i j => a[j][i])` is Aᵀ.
macro_rules! mat3 {
    ($i:ident $j:ident => $entry:expr) => {
        $crate::small::tensor::vec3!($i => $crate::small::tensor::vec3!($j => $entry))
    };
}

pub(crate) use {mat3, vec3};

/// Returns A B.
#[inline(always)]
pub fn product<R: Real>(a: &Mat3<R>, b: &Mat3<R>) -> Mat3<R> {
    mat3!(i j => a[i][2].mul_add(b[2][j], a[i][1].mul_add(b[1][j], a[i][0] * b[0][j])))
}

/// Returns A Bᵀ.
#[inline(always)]
pub fn product_transposed<R: Real>(a: &Mat3<R>, b: &Mat3<R>) -> Mat3<R> {
    mat3!(i j => dot(a[i], b[j]))
}

/// Returns Aᵀ.
#[inline(always)]
pub fn transpose<R: Real>(a: &Mat3<R>) -> Mat3<R> {
    mat3!(i j => a[j][i])
}

/// Returns FᵀF, the right Cauchy–Green tensor.
#[inline(always)]
pub fn right_cauchy_green<R: Real>(f: &Mat3<R>) -> Mat3<R> {
    left_cauchy_green(&transpose(f))
}

/// Returns FFᵀ, the left Cauchy–Green tensor.
#[inline(always)]
pub fn left_cauchy_green<R: Real>(f: &Mat3<R>) -> Mat3<R> {
    let (b01, b02, b12) = (dot(f[0], f[1]), dot(f[0], f[2]), dot(f[1], f[2]));
    [[dot(f[0], f[0]), b01, b02], [b01, dot(f[1], f[1]), b12], [b02, b12, dot(f[2], f[2])]]
}

/// Returns a·b.
#[inline(always)]
pub fn dot<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

/// Returns a × b.
#[inline(always)]
pub fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns A:B = Σ A_ij B_ij.
#[inline(always)]
pub fn contract<R: Real>(a: &Mat3<R>, b: &Mat3<R>) -> R {
    dot(a[0], b[0]) + dot(a[1], b[1]) + dot(a[2], b[2])
}

/// Returns ∂J/∂F, the cofactor matrix. Its rows are f₁ × f₂, f₂ × f₀ and f₀ × f₁, where f_i are the rows of F.
#[inline(always)]
pub fn cofactor<R: Real>(f: &Mat3<R>) -> Mat3<R> {
    [cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1])]
}

/// Returns J = det F.
#[inline(always)]
pub fn determinant<R: Real>(f: &Mat3<R>) -> R {
    dot(f[0], cross(f[1], f[2]))
}

/// Returns α A + β B.
#[inline(always)]
pub fn combine<R: Real>(alpha: R, a: &Mat3<R>, beta: R, b: &Mat3<R>) -> Mat3<R> {
    mat3!(i j => alpha.mul_add(a[i][j], beta * b[i][j]))
}

/// The tangent ∂²Ψ/∂F∂F as a symmetric 9 × 9 matrix over the entries (i, j) ↦ 3i + j of F. It stores the packed lower
/// triangle by rows, 45 entries.
#[derive(Clone, Copy)]
pub struct Tangent<R>(pub [R; 45]);

/// Returns the index of the entry (row ≥ column) in a packed lower triangle.
#[inline(always)]
pub const fn packed_index(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// Returns the index of an entry of a symmetric matrix in its packed lower triangle; row and column in any order.
#[inline(always)]
pub const fn symmetric_index(row: usize, column: usize) -> usize {
    if row >= column { packed_index(row, column) } else { packed_index(column, row) }
}

impl<R: Real> Tangent<R> {
    /// Returns α δ_ik δ_jl, the tangent of α/2 F:F.
    #[inline(always)]
    pub fn identity(alpha: R) -> Self {
        let mut entries = [alpha.constant(0.0); 45];
        for row in 0..9 {
            entries[packed_index(row, row)] = alpha;
        }
        Self(entries)
    }

    /// Returns the entry (ij, kl) with row = 3i + j and column = 3k + l.
    #[inline(always)]
    pub fn entry(&self, row: usize, column: usize) -> R {
        self.0[symmetric_index(row, column)]
    }

    /// Adds α A ⊗ A.
    #[inline(always)]
    pub fn add_square(&mut self, alpha: R, a: &Mat3<R>) {
        for row in 0..9 {
            let scaled = alpha * a[row / 3][row % 3];
            for column in 0..=row {
                let entry = &mut self.0[packed_index(row, column)];
                *entry = scaled.mul_add(a[column / 3][column % 3], *entry);
            }
        }
    }

    /// Adds α (A ⊗ B + B ⊗ A).
    #[inline(always)]
    pub fn add_product(&mut self, alpha: R, a: &Mat3<R>, b: &Mat3<R>) {
        for row in 0..9 {
            let (scaled_a, scaled_b) = (alpha * a[row / 3][row % 3], alpha * b[row / 3][row % 3]);
            for column in 0..=row {
                let entry = &mut self.0[packed_index(row, column)];
                let (ac, bc) = (a[column / 3][column % 3], b[column / 3][column % 3]);
                *entry = scaled_a.mul_add(bc, scaled_b.mul_add(ac, *entry));
            }
        }
    }

    /// Adds α δ_ik S_jl for a symmetric S: the tangent of the stress F S at fixed S.
    #[inline(always)]
    pub fn add_material_blocks(&mut self, alpha: R, s: &Mat3<R>) {
        for i in 0..3 {
            for j in 0..3 {
                for l in 0..=j {
                    let entry = &mut self.0[packed_index(3 * i + j, 3 * i + l)];
                    *entry = alpha.mul_add(s[j][l], *entry);
                }
            }
        }
    }

    /// Adds α B_ik δ_jl for a symmetric B.
    #[inline(always)]
    pub fn add_spatial_blocks(&mut self, alpha: R, b: &Mat3<R>) {
        for i in 0..3 {
            for k in 0..=i {
                for j in 0..3 {
                    let entry = &mut self.0[packed_index(3 * i + j, 3 * k + j)];
                    *entry = alpha.mul_add(b[i][k], *entry);
                }
            }
        }
    }

    /// Adds α F_il F_kj.
    #[inline(always)]
    pub fn add_crossed(&mut self, alpha: R, f: &Mat3<R>) {
        for row in 0..9 {
            for column in 0..=row {
                let (i, j, k, l) = (row / 3, row % 3, column / 3, column % 3);
                let entry = &mut self.0[packed_index(row, column)];
                *entry = (alpha * f[i][l]).mul_add(f[k][j], *entry);
            }
        }
    }

    /// Adds α ∂²J/∂F∂F, whose entries are ε_ikm ε_jln F_mn.
    #[inline(always)]
    pub fn add_cofactor_derivative(&mut self, alpha: R, f: &Mat3<R>) {
        for (i, k, m) in [(1, 0, 2), (2, 0, 1), (2, 1, 0)] {
            // ε_ikm is −1, +1, −1 for these three index triples.
            let sign_ik = if i - k == 2 { 1.0 } else { -1.0 };
            for (j, l, n) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
                let value = alpha * f[m][n] * sign_ik;
                let even = packed_index(3 * i + j, 3 * k + l);
                let odd = packed_index(3 * i + l, 3 * k + j);
                self.0[even] = self.0[even] + value;
                self.0[odd] = self.0[odd] - value;
            }
        }
    }
}
