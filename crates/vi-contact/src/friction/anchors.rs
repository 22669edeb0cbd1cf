//! The memory of friction: the stretch of each bristle. It is part of the state.

use crate::pairs::{Blend, Partners};
use crate::surface::Surface;

use super::FrictionPair;

/// Number of kinds of partners.
const KINDS: u32 = 3;

/// One stretched bristle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// The pair that the bristle connects.
    pub partners: Partners,
    /// The cell in whose frame the stretch is measured; 0 if there is none. For a round body it is three times the
    /// cell plus the number of the direction that the tangents follow.
    pub cell: u32,
    /// Stretch along both tangents of the frame, m.
    pub stretch: [f64; 2],
    /// Whether the pair slid in the last step.
    pub slides: bool,
}

impl Anchor {
    /// Returns the energy stored by a bristle of stiffness k (N/m), J.
    pub(super) fn energy(&self, k: f64) -> f64 {
        0.5 * k * (self.stretch[0] * self.stretch[0] + self.stretch[1] * self.stretch[1])
    }
}

/// All stretched bristles, in the order of their partners.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Anchors(Vec<Anchor>);

impl Anchors {
    /// Returns the anchors after a step with this friction. Pairs that opened have no anchor.
    pub fn after(pairs: &[FrictionPair]) -> Self {
        Self::stretched(pairs.iter().map(|pair| pair.anchor))
    }

    /// Returns those of `anchors` that are stretched; they must be in the order of their partners.
    pub(crate) fn stretched(anchors: impl Iterator<Item = Anchor>) -> Self {
        Self(anchors.filter(|anchor| anchor.stretch != [0.0; 2]).collect())
    }

    /// Returns the anchor between partners.
    pub(super) fn of(&self, partners: Partners) -> Option<&Anchor> {
        self.0.binary_search_by(|anchor| anchor.partners.cmp(&partners)).ok().map(|found| &self.0[found])
    }

    /// Returns all anchors.
    pub fn as_slice(&self) -> &[Anchor] {
        &self.0
    }

    /// Returns the stored energy ½ Σ k |e|², J.
    pub fn energy(&self, surface: &Surface) -> f64 {
        let energy =
            |anchor: &Anchor| anchor.energy(surface.bristle_stiffness(anchor.partners).unwrap_or(0.0));
        self.0.iter().map(energy).sum()
    }

    /// Returns six numbers per anchor for a checkpoint: kind (plus 3 if it slides), both partners, cell, stretch.
    pub fn to_numbers(&self) -> Vec<f64> {
        let numbers = |anchor: &Anchor| {
            let (kind, a, b) = match anchor.partners {
                Partners::PointBody(a, b) => (0.0, a, b),
                Partners::PointPlane(a, b) => (1.0, a, b),
                Partners::Edges(a, b) => (2.0, a, b),
            };
            let kind = if anchor.slides { kind + f64::from(KINDS) } else { kind };
            [kind, f64::from(a), f64::from(b), f64::from(anchor.cell), anchor.stretch[0], anchor.stretch[1]]
        };
        self.0.iter().flat_map(numbers).collect()
    }

    /// Returns the anchors from the numbers of [`Anchors::to_numbers`]; `None` if the numbers are invalid.
    pub fn from_numbers(numbers: &[f64], surface: &Surface) -> Option<Self> {
        if !numbers.len().is_multiple_of(6) {
            return None;
        }
        let index = |value: f64| {
            (value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0).then_some(value as u32)
        };
        let mut anchors = Vec::with_capacity(numbers.len() / 6);
        for six in numbers.chunks_exact(6) {
            let (a, b) = (index(six[1])?, index(six[2])?);
            let kind = index(six[0])?;
            let partners = match kind % KINDS {
                0 => Partners::PointBody(a, b),
                1 => Partners::PointPlane(a, b),
                _ => Partners::Edges(a, b),
            };
            let cell = index(six[3])?;
            let known = match partners {
                Partners::PointBody(a, b) => {
                    let is_known = surface.points.len() > a as usize && surface.frames.len() > b as usize;
                    let cell = if is_known && surface.rolls(partners) { cell / 3 } else { cell };
                    is_known && surface.cells.get(cell as usize).is_some_and(|cell| cell.body == b)
                }
                Partners::PointPlane(a, b) => {
                    surface.points.len() > a as usize && surface.half_spaces.len() > b as usize
                }
                Partners::Edges(a, b) => surface.edges.len() > a.max(b) as usize,
            };
            if !(known && kind < 2 * KINDS && six[4].is_finite() && six[5].is_finite()) {
                return None;
            }
            anchors.push(Anchor { partners, cell, stretch: [six[4], six[5]], slides: kind >= KINDS });
        }
        anchors.is_sorted_by(|a, b| a.partners < b.partners).then_some(Self(anchors))
    }
}

/// Stiffness of a bristle relative to the layer's κ w/d̂. A block that starts to slide on a slope gains speed until
/// its bristles are stretched. With 1, at κ of ten times the pressure, its path after 1 s is 0.8 % too long; with
/// 100, 0.08 %.
const STIFF: f64 = 100.0;

impl Surface {
    /// Returns the stiffness of a bristle, N/m.
    pub(crate) fn bristle_stiffness(&self, partners: Partners) -> Option<f64> {
        let (gauge, weight) = match partners {
            Partners::PointBody(point, body) => (self.point_gauge(point as usize, body)?, 1.0),
            Partners::PointPlane(point, plane) => (self.plane_gauge(point as usize, plane as usize)?, 1.0),
            Partners::Edges(a, b) => {
                let [first, second] = [a, b].map(|edge| &self.edges[edge as usize]);
                let blend = Blend::of_edges(self.barrier, first, second);
                (self.edge_pair([a, b])?.gauge, blend.weight())
            }
        };
        Some(STIFF * weight * gauge.energy / (gauge.distance * gauge.distance))
    }
}
