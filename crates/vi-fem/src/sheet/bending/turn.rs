//! The rotation of a hinge from rest, Δ = θ − θ̄, in the form in which bending energies use it.
//!
//! Δ itself is discontinuous: when a hinge folds through itself, which is possible without contact, Δ jumps from π to
//! −π. Then ½ Δ² has a kink, and a scheme that crosses it makes an energy error that no small step removes. Instead
//! the energy is a function of sin Δ and x = sin²(Δ/2) that is analytic around the whole circle and equals ½ Δ² up to
//! a relative error of Δ⁶/560. It is the series of arcsin²√x, cut after three terms:
//! ```text
//! V(Δ) = 2x + ⅔x² + 16/45 x³,    V′ = ψ(Δ) = sin Δ (1 + ⅔x + 8/15 x²),    ψ = Δ − Δ⁷/140 ….
//! ```
//! The first term, sin²(Δ/2), is used by Bridson, Marino & Fedkiw 2003 and Tamstorf & Grinspun 2013, §2. There are
//! two alternatives: 2 tan(Δ/2) (Gingold et al. 2004) diverges at π, so that a fold that closes at speed would
//! require ever shorter steps; tracked angles would be a state besides the positions.
//!
//! If angles are coupled, ½ ΔᵀKΔ, no continuous function on the circle can simply replace Δ, because it is zero
//! again at π. There V = ½ ψᵀKψ + Σ K_aa (V(Δ_a) − ½ ψ_a²). The second part is positive and of the order Δ⁸; it keeps
//! a hinge that is folded flat from being in equilibrium.

use crate::lanes::real::Real;

/// The rotation of a hinge, as sin Δ and x = sin²(Δ/2).
#[derive(Clone, Copy)]
pub(super) struct Turn<R> {
    sine: R,
    x: R,
}

impl<R: Real> Turn<R> {
    /// Returns the rotation from [sin θ, cos θ] and [sin θ̄, cos θ̄].
    #[inline(always)]
    pub(super) fn new([sine, cosine]: [R; 2], [rest_sine, rest_cosine]: [R; 2]) -> Self {
        let difference = cosine * rest_cosine + sine * rest_sine;
        Self { sine: sine * rest_cosine - cosine * rest_sine, x: (sine.constant(1.0) - difference) * 0.5 }
    }

    /// Returns ψ.
    #[inline(always)]
    pub(super) fn value(self) -> R {
        let Self { sine, x } = self;
        sine * (x * (x * (8.0 / 15.0) + 2.0 / 3.0) + 1.0)
    }

    /// Returns 1 − ψ′ = 16/5 x³.
    #[inline(always)]
    pub(super) fn softening(self) -> R {
        self.x * self.x * self.x * 3.2
    }

    /// Returns ψ″.
    #[inline(always)]
    pub(super) fn second(self) -> R {
        self.x * self.x * self.sine * -4.8
    }

    /// Returns V − ½ ψ² = 8/5 x⁴ + 64/75 x⁵ + 128/225 x⁶.
    #[inline(always)]
    pub(super) fn surplus(self) -> R {
        let x = self.x;
        let square = x * x;
        square * square * (x * (x * (128.0 / 225.0) + 64.0 / 75.0) + 1.6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turn(angle: f64, rest: f64) -> Turn<f64> {
        Turn::new([angle.sin(), angle.cos()], [rest.sin(), rest.cos()])
    }

    fn energy(turn: Turn<f64>) -> f64 {
        0.5 * turn.value().powi(2) + turn.surplus()
    }

    #[test]
    fn it_is_the_square_of_the_angle_near_rest() {
        for rest in [0.0, 0.7, -2.0] {
            for delta in [-0.5_f64, -0.1, 0.02, 0.3] {
                let error = energy(turn(rest + delta, rest)) / (0.5 * delta * delta) - 1.0;
                assert!(error.abs() <= delta.powi(6) / 500.0 + 1e-12, "{rest} {delta} {error:e}");
            }
        }
    }

    #[test]
    fn it_is_smooth_and_rises_all_the_way_to_the_fold() {
        let step = 1e-5;
        let slope = |f: &dyn Fn(Turn<f64>) -> f64, at: f64| {
            (f(turn(at + step, 0.4)) - f(turn(at - step, 0.4))) / (2.0 * step)
        };
        // The slope is continuous across the jump of the angle too.
        for k in 1..60 {
            let at = 0.4 + f64::from(k) * std::f64::consts::TAU / 60.0;
            let here = turn(at, 0.4);
            assert!((slope(&energy, at) - here.value()).abs() < 1e-9, "{at}");
            assert!((slope(&Turn::value, at) - (1.0 - here.softening())).abs() < 1e-9, "{at}");
            assert!((slope(&|turn| -turn.softening(), at) - here.second()).abs() < 1e-8, "{at}");
            assert!(here.surplus() > 0.0);
            assert!(k >= 30 || here.value() > 0.0, "a force that unfolds, {at}");
        }
    }
}
