//! How the slip of a round rigid body changes with the end of a step. A bristle that sticks is so stiff that Newton's method needs this
//! derivative in full: the mean of a step is the place of its middle, and z, its weights and the axis move with it.
//!
//! The displacement of side s at z is affine in z, with the gradient F_s (for a frame, F = Σ_k Δd_k ⊗ d*_k with the dual directors d*). Let t be
//! normal to the axis n, and D = Σ_a w_a Δx_a, so that t·u = t·D. Let σ = 1 for the first side and −1 for the second, and let ξ_k be the
//! coordinates of the closest points along the directions E_k of their cells. A motion dx of the ends, which moves the middle by dx/2, changes
//! ```text
//! t·u by Σ_a w_a t·dx_a + ½ [v·dz − Σ_frames σ (Fᵀt)·dz_s + Σ_cells σ dξ_k t·ΔE_k − (n·D) t·dn],   v = Σ_frames σ Fᵀt,
//! ```
//! where z_s is the material point of a frame at z. With r, the vector between the closest points, E_k·r = 0 gives
//! ```text
//! dξ_k = −σ_k Σ_j A⁻¹_kj (E_j·dr + r·dE_j),   E_k·dn = −n·dE_k,   A_kl = E_k·E_l,
//! ```
//! where dr is taken at constant weights; normal to all E_k, n turns by dr/|r|. Terms of the order of u are left out.

use nalgebra::Matrix3;

use super::{Axis, RollingPair, Touching};
use crate::distance::{Vec3, at, combine};
use crate::friction::slip::{invert, multiply};
use crate::pairs::{Contact, Partners};

/// Signs of both sides in the slip.
const SIGNS: [f64; 2] = [1.0, -1.0];

/// The directions E to which the axis of a pair is perpendicular wherever its nodes are: sides of the cell on which the closest point
/// lies, or both edges.
struct Across {
    /// The directions as weights of the nodes; zero if there are fewer. `None` if the axis does not turn.
    to_e: [[f64; 4]; 2],
    e: [Vec3; 2],
    /// The side to which each belongs.
    side: [usize; 2],
    /// A⁻¹.
    inverse: [[f64; 2]; 2],
    /// Vector r between the closest points, m.
    r: Vec3,
}

impl Across {
    /// Returns `None` if the axis does not turn.
    fn new(partners: Partners, axis: &Axis, corners: &[Vec3; 4]) -> Option<Self> {
        let (to_e, side) = match partners {
            Partners::PointPlane(..) => return None,
            Partners::Edges(..) => ([[-1.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.0]], [0, 1]),
            Partners::PointBody(..) => {
                let mut to_e = [[0.0; 4]; 2];
                let mut places = (1..4).filter(|&a| axis.weights[a] != 0.0);
                let origin = places.next()?;
                for (to_e, corner) in to_e.iter_mut().zip(places) {
                    (to_e[origin], to_e[corner]) = (-1.0, 1.0);
                }
                (to_e, [1, 1])
            }
        };
        let e = to_e.map(|weights| combine(&weights, corners));
        let gram = [0, 1].map(|k: usize| [0, 1].map(|l: usize| e[k].dot(&e[l])));
        let count = e.iter().filter(|e| **e != Vec3::zeros()).count();
        let inverse = if count == 0 { None } else { invert(gram, count) };
        let [first, second] = axis.places;
        Some(Self { to_e, e, side, inverse: inverse.unwrap_or_default(), r: first - second })
    }

    /// Adds the covectors of Σ_k g_k dξ_k.
    fn add_slide(&self, g: [f64; 2], axis: &Axis, out: &mut [Vec3; 4]) {
        let signed = [0, 1].map(|k: usize| -SIGNS[self.side[k]] * g[k]);
        let h = multiply(&self.inverse, signed);
        let along = self.e[0] * h[0] + self.e[1] * h[1];
        for (a, out) in out.iter_mut().enumerate() {
            *out += along * axis.weights[a] + self.r * (h[0] * self.to_e[0][a] + h[1] * self.to_e[1][a]);
        }
    }

    /// Adds the covectors of v·dn.
    fn add_turn(&self, v: Vec3, axis: &Axis, out: &mut [Vec3; 4]) {
        let v = v - axis.normal * axis.normal.dot(&v);
        let y = multiply(&self.inverse, self.e.map(|e| e.dot(&v)));
        let rest = (v - self.e[0] * y[0] - self.e[1] * y[1]) / self.r.norm();
        for (a, out) in out.iter_mut().enumerate() {
            let turned = y[0] * self.to_e[0][a] + y[1] * self.to_e[1][a];
            *out += rest * axis.weights[a] - axis.normal * turned;
        }
    }
}

impl Contact<'_> {
    /// Returns the derivatives of t_k·u with respect to the positions at the end of the step, for both tangents t_k of a pair, without
    /// terms of the order of u: of the nodes of [`Contact::rolling_nodes`], then of those of [`Contact::axis_nodes`]; a node may be
    /// among both. `x` are the ends for which [`Contact::roll`] returned the pair.
    pub(crate) fn rolling_change(&self, pair: &RollingPair, x: [&[f64]; 2]) -> Option<[[Vec3; 12]; 2]> {
        let RollingPair { partners, cell, middle: Touching { axis, weights, tangents }, .. } = *pair;
        let step = |node: u32| at(x[1], node) - at(x[0], node);
        let middle = |node: u32| (at(x[0], node) + at(x[1], node)) * 0.5;
        let (nodes, axis_nodes) = (self.rolling_nodes(partners, cell), self.axis_nodes(partners, cell));
        let touch = self.touch(partners, &axis);
        let across = Across::new(partners, &axis, &axis_nodes.map(middle));
        let steps = axis_nodes.map(step);
        let approach: f64 = (0..8).map(|a| weights[a] * axis.normal.dot(&step(nodes[a]))).sum();
        let frames = self.surface.frames_of(partners);
        let mut spins = [None; 2];
        for (spin, frame) in spins.iter_mut().zip(frames) {
            if let Some([_, directors @ ..]) = frame {
                let inverse = Matrix3::from_columns(&directors.map(middle)).try_inverse()?;
                *spin = Some(Matrix3::from_columns(&directors.map(step)) * inverse);
            }
        }
        let first_count = partners.first_count();
        let change = |t: Vec3| {
            let mut out = [Vec3::zeros(); 12];
            let mut on_axis = [Vec3::zeros(); 4];
            let pulled = spins.map(|spin| spin.map_or(Vec3::zeros(), |spin: Matrix3<f64>| spin.tr_mul(&t)));
            let v = pulled[0] - pulled[1];
            for a in 0..8 {
                out[a] = (t - pulled[a / 4] * 0.5) * weights[a];
            }
            let of_side = if touch.side == 0 { 0..first_count } else { first_count..4 };
            for a in of_side {
                on_axis[a] += v * (SIGNS[touch.side] * axis.weights[a]);
            }
            for (on_axis, weight) in on_axis.iter_mut().zip(axis.weights) {
                *on_axis -= axis.normal * (touch.share * axis.normal.dot(&v) * weight);
            }
            if let Some(across) = &across {
                let g = [0, 1].map(|k: usize| {
                    let side = across.side[k];
                    let by_place = if side == touch.side { v.dot(&across.e[k]) } else { 0.0 };
                    let by_cell = match spins[side] {
                        None => SIGNS[side] * t.dot(&combine(&across.to_e[k], &steps)),
                        Some(_) => 0.0,
                    };
                    by_place + by_cell
                });
                across.add_slide(g, &axis, &mut on_axis);
                across.add_turn(-(v * touch.offset + t * approach), &axis, &mut on_axis);
            }
            for (out, on_axis) in out[8..].iter_mut().zip(on_axis) {
                *out = on_axis * 0.5;
            }
            out
        };
        Some(tangents.map(change))
    }
}
