//! How the nodes of a pair carry a force at its point of contact.

use nalgebra::Matrix3;

use crate::distance::Vec3;

/// Forces on the eight nodes of a pair that together are a force at its point of contact.
///
/// Over a step, node a carries w_a T. For a body with frame this is a force at a material point, and the potential of lagged friction
/// would keep that point. If the body turns by a rotation vector φ, the point moves by φ × r, and by ½ φ × (φ × r) in second order.
/// The tangential part of the second term is no slip of a round body, which touches with other points. It let a ball in a groove roll along
/// the groove by a radian, because this shortened the slip across the groove. Between equilibria, where bodies turn far, the directors
/// d_k therefore carry
/// ```text
/// f_k = μ × d_k,   (tr S · 1 − S) μ = Σ_k w_k d_k × T,   S = Σ_k d_k ⊗ d_k.
/// ```
/// These forces have the same resultant, the same moment and the same work in a small rotation. They differ by forces of the constraints that
/// keep a frame orthonormal, and their potential has no term of second order: a rotation by the angle φ about the unit vector a counts as a slip by
/// sin φ a × r.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spread {
    weights: [f64; 8],
    turning: [Option<Turning>; 2],
}

/// A frame that turns.
#[derive(Debug, Clone, Copy)]
struct Turning {
    directors: [Vec3; 3],
    /// (tr S · 1 − S)⁻¹.
    inverse: Matrix3<f64>,
}

impl Spread {
    /// Returns the forces w_a T.
    pub(super) fn of_material_points(weights: [f64; 8]) -> Self {
        Self { weights, turning: [None; 2] }
    }

    /// Returns the forces between equilibria, with the directors of both sides; `None` for a side without frame.
    pub(super) fn of_turning_bodies(weights: [f64; 8], directors: [Option<[Vec3; 3]>; 2]) -> Option<Self> {
        let mut turning = [None; 2];
        for (turning, directors) in turning.iter_mut().zip(directors) {
            let Some(directors) = directors else { continue };
            let squares: Matrix3<f64> =
                directors.iter().map(|director| director * director.transpose()).sum();
            let inverse = (Matrix3::identity() * squares.trace() - squares).try_inverse()?;
            *turning = Some(Turning { directors, inverse });
        }
        Some(Self { weights, turning })
    }

    /// Returns the forces on the nodes of a force T at the point of contact.
    pub(crate) fn of(&self, force: Vec3) -> [Vec3; 8] {
        let mut out = self.weights.map(|weight| force * weight);
        for (out, turning) in out.chunks_exact_mut(4).zip(&self.turning) {
            let (Some(Turning { directors, inverse }), [_, on_directors @ ..]) = (turning, out) else {
                continue;
            };
            let moment: Vec3 =
                directors.iter().zip(&*on_directors).map(|(director, own)| director.cross(own)).sum();
            let turn = inverse * moment;
            on_directors.iter_mut().zip(directors).for_each(|(out, director)| *out = turn.cross(director));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Unit};

    use super::*;
    use crate::testing::Numbers;

    /// Returns the forces on the directors d_k of the first side that carry `force` at c + Σ y_k d_k.
    fn on_directors(directors: [Vec3; 3], y: Vec3, force: Vec3) -> [Vec3; 3] {
        let weights = [1.0, y.x, y.y, y.z, 0.0, 0.0, 0.0, 0.0];
        let spread =
            Spread::of_turning_bodies(weights, [Some(directors), None]).expect("directors of a frame");
        let [on_centre, first, second, third, ..] = spread.of(force);
        assert_eq!(on_centre, force);
        [first, second, third]
    }

    /// The forces have the moment of the force at its point, also while a solver strains the frame.
    #[test]
    fn the_forces_on_directors_have_the_moment_of_the_force() {
        let mut numbers = Numbers::new(51);
        for _ in 0..1000 {
            let turn = Rotation3::from_scaled_axis(numbers.vector() * 2.0);
            let directors = [0, 1, 2].map(|k| turn * Vec3::ith(k, 1.0) + numbers.vector() * 0.1);
            let (y, force) = (numbers.vector(), numbers.vector());
            let forces = on_directors(directors, y, force);
            let moment: Vec3 = directors.iter().zip(forces).map(|(d, own)| d.cross(&own)).sum();
            let arm: Vec3 = directors.iter().zip(y.iter()).map(|(d, &y)| d * y).sum();
            assert!((moment - arm.cross(&force)).norm() <= 1e-13, "{moment:?}");
        }
    }

    /// A rotation by the angle φ about a is a slip by sin φ a × r: nothing of second order shortens or lengthens slips.
    #[test]
    fn a_rotation_is_a_slip_across_its_axis_alone() {
        let mut numbers = Numbers::new(52);
        for _ in 0..1000 {
            let frame = Rotation3::from_scaled_axis(numbers.vector() * 2.0);
            let directors = [0, 1, 2].map(|k| frame * Vec3::ith(k, 1.0));
            let (y, tangent) = (numbers.vector(), numbers.vector());
            let (axis, angle) = (Unit::new_normalize(numbers.vector()), 3.0 * numbers.unit());
            let turned = Rotation3::from_axis_angle(&axis, angle);
            let covectors = on_directors(directors, y, tangent);
            let slip: f64 = covectors.iter().zip(directors).map(|(own, d)| own.dot(&(turned * d - d))).sum();
            let expected = angle.sin() * axis.cross(&(frame * y)).dot(&tangent);
            assert!((slip - expected).abs() <= 1e-13, "{slip} {expected}");
        }
    }
}
