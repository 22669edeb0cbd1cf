//! What a finite element is, and how code finds an element whose kind is known only at run time.

use vi_mesh::CellKind;

use crate::lanes::real::Real;
use crate::small::tensor::Mat3;

/// An isoparametric solid element with `N` nodes and `Q` quadrature points on its reference cell:
/// x(ξ) = Σ x_a N_a(ξ).
pub trait Element<const N: usize, const Q: usize>: Send + Sync + 'static {
    /// The cell whose nodes it has.
    const KIND: CellKind;
    /// Degree of the polynomials that the rule integrates exactly.
    const DEGREE: usize;
    /// Is it the linear simplex, x₁ − x₀, x₂ − x₀, x₃ − x₀ the columns of ∂x/∂ξ, with one quadrature
    /// point? Its kernels are compiled with every law, instead of one for the element and one for the
    /// law that meet in memory: where so little is computed, that is a quarter of the time.
    const IS_SIMPLEX: bool = false;

    /// Quadrature of the strain energy: points ξ and weights, whose sum is the reference volume.
    fn rule() -> [([f64; 3], f64); Q];
    /// Quadrature of the mass.
    fn mass_rule() -> Vec<([f64; 3], f64)> {
        Self::rule().to_vec()
    }
    /// Nodes of the reference cell, by the table of cells.
    fn nodes() -> [[f64; 3]; N] {
        let nodes = Self::KIND.reference_nodes();
        std::array::from_fn(|a| nodes[a])
    }
    /// Shape functions N_a(ξ).
    fn values(xi: [f64; 3]) -> [f64; N];
    /// Their gradients ∂N_a/∂ξ.
    fn gradients(xi: [f64; 3]) -> [[f64; 3]; N];

    /// ∂x/∂ξ = Σ x_a ⊗ ∂N_a/∂ξ at a quadrature point, whose gradients are given. Overridden where
    /// the gradients are constants that fold away.
    #[inline(always)]
    fn reference_gradient<R: Real>(x: &[[R; 3]; N], gradients: &[[f64; 3]; N]) -> Mat3<R> {
        let mut sum = [[x[0][0].constant(0.0); 3]; 3];
        for (x, gradient) in x.iter().zip(gradients) {
            for i in 0..3 {
                for j in 0..3 {
                    sum[i][j] = x[i].mul_add(x[i].constant(gradient[j]), sum[i][j]);
                }
            }
        }
        sum
    }

    /// f_a += P̂ ∂N_a/∂ξ: the transpose of [`Element::reference_gradient`].
    #[inline(always)]
    fn add_reference_forces<R: Real>(p: &Mat3<R>, gradients: &[[f64; 3]; N], f: &mut [[R; 3]; N]) {
        for (f, gradient) in f.iter_mut().zip(gradients) {
            for i in 0..3 {
                for j in 0..3 {
                    f[i] = p[i][j].mul_add(p[i][j].constant(gradient[j]), f[i]);
                }
            }
        }
    }
}

/// Work to do with an element whose type is known only at run time.
pub(crate) trait SolidVisitor {
    type Output;
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) -> Self::Output;
}
