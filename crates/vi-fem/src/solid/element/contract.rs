//! The contract of a finite element, and the visitor that finds an element whose kind is known only at run time.

use vi_mesh::CellKind;

use crate::lanes::real::Real;
use crate::small::tensor::Mat3;

/// An isoparametric solid element with `N` nodes and `Q` quadrature points on its reference cell:
/// x(ξ) = Σ x_a N_a(ξ).
pub trait Element<const N: usize, const Q: usize>: Send + Sync + 'static {
    /// The cell kind that gives the element its nodes.
    const KIND: CellKind;
    /// Degree of the polynomials that the quadrature rule integrates exactly.
    const DEGREE: usize;
    /// Whether the element is the linear simplex with one quadrature point, for which the columns of ∂x/∂ξ are x₁ −
    /// x₀, x₂ − x₀ and x₃ − x₀. Its kernels are compiled together with every law. Other elements have one kernel for
    /// the element and one for the law, which exchange data in memory. For the simplex, with its few operations, this
    /// exchange would take a quarter of the time.
    const IS_SIMPLEX: bool = false;

    /// Returns the quadrature rule of the strain energy: points ξ and weights. The weights sum to the reference
    /// volume.
    fn rule() -> [([f64; 3], f64); Q];
    /// Returns the quadrature rule of the mass.
    fn mass_rule() -> Vec<([f64; 3], f64)> {
        Self::rule().to_vec()
    }
    /// Returns the nodes of the reference cell from the table of cells.
    fn nodes() -> [[f64; 3]; N] {
        let nodes = Self::KIND.reference_nodes();
        std::array::from_fn(|a| nodes[a])
    }
    /// Returns the shape functions N_a(ξ).
    fn values(xi: [f64; 3]) -> [f64; N];
    /// Returns the gradients ∂N_a/∂ξ of the shape functions.
    fn gradients(xi: [f64; 3]) -> [[f64; 3]; N];

    /// Returns ∂x/∂ξ = Σ x_a ⊗ ∂N_a/∂ξ at a quadrature point with these `gradients`. Elements with constant gradients
    /// override it, so that the compiler can fold the constants.
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

    /// Adds f_a += P̂ ∂N_a/∂ξ, the transpose of [`Element::reference_gradient`].
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

/// An operation on an element whose type is known only at run time.
pub(crate) trait SolidVisitor {
    type Output;
    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) -> Self::Output;
}
