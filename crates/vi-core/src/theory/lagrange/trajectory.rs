//! Paths t ↦ q(t) that can be differentiated any number of times.

use num_dual::Dual2_64;

use crate::theory::lagrange::lagrangian::Scalar;

/// A path q(t), evaluated at any [`Scalar`] time, which gives its derivatives.
pub trait Trajectory {
    /// Returns q at time t, one entry per coordinate.
    fn at<D: Scalar>(&self, t: D) -> Vec<D>;
}

impl<P: Trajectory> Trajectory for &P {
    fn at<D: Scalar>(&self, t: D) -> Vec<D> {
        (**self).at(t)
    }
}

/// Makes a [`Trajectory`](crate::lagrange::Trajectory) from an expression:
/// `trajectory!([constants] |t| vec![…])`.
#[macro_export]
macro_rules! trajectory {
    (|$t:ident| $body:expr) => {
        $crate::trajectory!([] |$t| $body)
    };
    ([$($constant:ident),*] |$t:ident| $body:expr) => {{
        struct Expression {
            $($constant: f64),*
        }
        impl $crate::lagrange::Trajectory for Expression {
            fn at<D: $crate::lagrange::Scalar>(&self, $t: D) -> Vec<D> {
                $(let $constant = self.$constant;)*
                $body
            }
        }
        Expression { $($constant),* }
    }};
}

/// Returns (q, q̇, q̈) of a path at time t.
pub fn motion(path: &impl Trajectory, t: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let jets = path.at(Dual2_64::from_re(t).derivative());
    let part = |pick: fn(&Dual2_64) -> f64| jets.iter().map(pick).collect();
    (part(|jet| jet.re), part(|jet| jet.v1), part(|jet| jet.v2))
}
