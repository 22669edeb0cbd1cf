//! A Lagrangian in this crate is a function that can be evaluated on any numbers that carry derivatives.

use num_dual::DualNum;

/// A real number, or one that carries derivatives: f64 and every dual number over f64.
pub trait Scalar: DualNum<Primitive = f64> + Copy {}
impl<D: DualNum<Primitive = f64> + Copy> Scalar for D {}

/// A Lagrangian L(t, q, q̇) of n generalised coordinates, in J.
///
/// Twice differentiable in all arguments; regular (∂²L/∂q̇² invertible) where accelerations are
/// asked for. Write it with [`lagrangian!`](crate::lagrangian), or as a type of your own.
pub trait Lagrangian {
    /// Number of coordinates n.
    fn dof_count(&self) -> usize;
    /// L at time t (s), coordinates q and velocities v = q̇, n each.
    fn value<D: Scalar>(&self, t: D, q: &[D], v: &[D]) -> D;
}

impl<L: Lagrangian> Lagrangian for &L {
    fn dof_count(&self) -> usize {
        (**self).dof_count()
    }
    fn value<D: Scalar>(&self, t: D, q: &[D], v: &[D]) -> D {
        (**self).value(t, q, v)
    }
}

/// A [`Lagrangian`](crate::lagrange::Lagrangian) from an expression:
/// `lagrangian!(n; [constants] |t, q, v| expression)`.
///
/// The constants are `f64` variables in scope, captured by value; numbers stand on the right of
/// `*` and `+` (`v[0] * 0.5`), as dual numbers need.
#[macro_export]
macro_rules! lagrangian {
    ($count:expr; |$t:ident, $q:ident, $v:ident| $body:expr) => {
        $crate::lagrangian!($count; [] |$t, $q, $v| $body)
    };
    ($count:expr; [$($constant:ident),*] |$t:ident, $q:ident, $v:ident| $body:expr) => {{
        struct Expression {
            dof_count: usize,
            $($constant: f64),*
        }
        impl $crate::lagrange::Lagrangian for Expression {
            fn dof_count(&self) -> usize {
                self.dof_count
            }
            fn value<D: $crate::lagrange::Scalar>(&self, $t: D, $q: &[D], $v: &[D]) -> D {
                $(let $constant = self.$constant;)*
                $body
            }
        }
        Expression { dof_count: $count, $($constant),* }
    }};
}
