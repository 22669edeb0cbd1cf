//! The paths that live terms allow: how far nodes may move along a correction, and which of them meet on the way.

use vi_core::Meeting;

use super::LiveSum;
use super::state::{FAR, distance};
use crate::assemble::fixed::FixedSum;
use crate::vectors;

impl LiveSum {
    /// Returns the largest fraction of a step that all terms allow: of the change `dx` from x, or, for terms that act
    /// by a discrete gradient, of the change of the end of the step, (end, change), with x in its middle.
    ///
    /// The first correction of a body that nothing holds yet can be many times its size. Of such a path first a short part is
    /// examined, then one twice as long, until a term stops it: with stencils for the whole path, all pairs would be candidates.
    pub(crate) fn largest_step(&mut self, x: &[f64], dx: &[f64], end: Option<[&[f64]; 2]>) -> f64 {
        let (from, along) = end.map_or((x, dx), |[end, change]| (end, change));
        let start: Vec<f64> = x.iter().zip(from).map(|(x, from)| 2.0 * x - from).collect();
        let [begun, reached, moved] = [&start[..], from, along].map(|x| self.terms.coordinates().places(x));
        let short = (2.0 * FAR * self.shortest_reach()).max(distance(&begun, &reached));
        let length = 3.0_f64.sqrt() * vectors::max_abs(moved.len(), |k| moved[k]);
        let mut part = match short / length {
            part if part > 0.0 => part.min(1.0),
            _ => 1.0,
        };
        let scaled = |part: f64, change: &[f64]| change.iter().map(|change| part * change).collect();
        while part < 1.0 {
            let [dx, along]: [Vec<f64>; 2] = [scaled(part, dx), scaled(part, along)];
            let allowed = self.allowed(&start, [x, &dx], end.map(|[end, _]| [end, &along[..]]));
            if allowed < 1.0 {
                return part * allowed;
            }
            part = (2.0 * part).min(1.0);
        }
        self.allowed(&start, [x, dx], end)
    }

    /// Returns the fraction of a path that all terms allow, as [`LiveSum::largest_step`] describes, in a step from `start`.
    fn allowed(&mut self, start: &[f64], [x, dx]: [&[f64]; 2], end: Option<[&[f64]; 2]>) -> f64 {
        let (from, along) = end.map_or((x, dx), |[end, change]| (end, change));
        let to: Vec<f64> = from.iter().zip(along).map(|(from, along)| from + along).collect();
        self.follow(start, [from, &to]);
        let Some(near) = &self.near else { return 1.0 };
        let least = |assembler: &FixedSum, x: &[f64], dx: &[f64]| {
            let terms = assembler.terms().fixed().iter().filter(|term| term.limits_steps());
            terms.map(|term| term.largest_step(x, dx)).fold(1.0, f64::min)
        };
        match (&near.parts, end) {
            (Some([plain, discrete]), Some([end, change])) => {
                least(plain, x, dx).min(least(discrete, end, change))
            }
            _ => least(&near.whole, x, dx),
        }
    }

    /// Returns the nodes of a pair that obstructs the straight path from `start` to `end`; `None` if all terms allow it. A
    /// term may keep a margin relative to the start of a step; then the rest of the path is checked again from the point
    /// that the term allows.
    pub(crate) fn obstacle(&mut self, start: &[f64], end: &[f64]) -> Option<[u32; 4]> {
        const ASKED: usize = 4;
        let mut x = start.to_vec();
        for _ in 0..ASKED {
            let dx: Vec<f64> = x.iter().zip(end).map(|(x, end)| end - x).collect();
            let part = self.largest_step(&x, &dx, None);
            if part >= 1.0 {
                return None;
            }
            x.iter_mut().zip(&dx).for_each(|(x, dx)| *x += part * dx);
        }
        let (meetings, _) = self.meetings(&x, [&x, end], 0.0);
        let first = meetings.into_iter().min_by(|a, b| a.part.total_cmp(&b.part));
        Some(first.map_or([0; 4], |meeting| meeting.nodes))
    }

    /// Returns the groups of nodes that meet on the path from `x` to `end` in a step from `start`, and the number of
    /// candidates that were checked; see [`Potential::meetings`](vi_core::Potential::meetings).
    pub(crate) fn meetings(
        &mut self,
        start: &[f64],
        [x, end]: [&[f64]; 2],
        kept: f64,
    ) -> (Vec<Meeting>, usize) {
        self.follow(start, [x, end]);
        let Self { near: Some(near), passage, terms, .. } = self else { return (Vec::new(), 0) };
        let [begun, reached, goal] = [start, x, end].map(|x| terms.coordinates().places(x));
        near.choose(&begun, &[&reached, &goal], passage);
        let terms = || near.of_step().0.iter().map(|(_, term)| term);
        let meetings = terms().flat_map(|term| term.meetings(x, end, kept)).collect();
        (meetings, terms().map(|term| term.stencil_count()).sum())
    }
}
