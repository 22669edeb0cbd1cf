//! Lagrangians: functions that can be evaluated with any number type that carries derivatives.

use num_dual::DualNum;

/// A real number with or without derivatives: f64 and every dual number over f64.
pub trait Scalar: DualNum<Primitive = f64> + Copy {}
impl<D: DualNum<Primitive = f64> + Copy> Scalar for D {}

/// A Lagrangian L(t, q, q̇) of n generalised coordinates, in J.
///
/// It is twice differentiable in all arguments, and regular (∂²L/∂q̇² invertible) if accelerations are computed.
/// Write it with [`lagrangian!`](crate::lagrangian), or implement the trait for your own type.
pub trait Lagrangian {
    /// Returns the number n of coordinates.
    fn dof_count(&self) -> usize;
    /// Returns L at time t (s), coordinates q and velocities v = q̇, n entries each.
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

/// Makes a [`Lagrangian`](crate::lagrange::Lagrangian) from an expression:
/// `lagrangian!(n; [constants] |t, q, v| expression)`.
///
/// The constants are `f64` variables in scope, captured by value. Plain numbers must be on the right of `*` and `+`
/// (`v[0] * 0.5`), as dual numbers require.
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
