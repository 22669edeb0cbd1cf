//! Bodies in the way of a prescribed motion.

use vi_core::State;

use crate::assemble::free_path::{FreePath, KEPT};
use crate::equilibrium::balance::Balance;
use crate::error::SolverError;

impl Balance<'_> {
    /// Checks that the terms allow the straight path from `from` to (q, t), including the prescribed coordinates.
    ///
    /// # Errors
    /// Returns [`SolverError::Blocked`].
    pub(crate) fn check_move(&mut self, from: &State, q: &[f64], t: f64) -> Result<(), SolverError> {
        if !self.assembler.limits_steps() {
            return Ok(());
        }
        let end = self.positions(q, t);
        let start = self.positions(&from.q, from.t);
        let dx: Vec<f64> = end.iter().zip(&start).map(|(end, start)| end - start).collect();
        let part = self.assembler.largest_step(&start, &dx, None);
        if part >= 1.0 {
            return Ok(());
        }
        let met = self.assembler.live().map(|live| live.meetings(&start, [&start, &end], 0.0).0);
        let first = met.unwrap_or_default().into_iter().min_by(|a, b| a.part.total_cmp(&b.part));
        Err(SolverError::Blocked { load_factor: t, part, nodes: first.map(|meeting| meeting.nodes) })
    }

    /// Changes `q`, a first guess of the equilibrium at t, so that no pair meets on the straight path from `from`: nodes in the way of a
    /// prescribed motion are taken along by it, and other nodes end their motion before they meet.
    pub(super) fn clear_way(&mut self, from: &State, q: &mut [f64], t: f64) {
        let coordinates = self.system.coordinates();
        let start = self.positions(&from.q, from.t);
        let Some(live) = self.assembler.live() else { return };
        let place = |delta: &[f64]| {
            let end: Vec<f64> = from.q.iter().zip(delta).map(|(q, delta)| q + delta).collect();
            coordinates.positions(&end, t)
        };
        let meetings = |from: &[f64], to: &[f64]| live.meetings(from, [from, to], KEPT).0;
        let mut path = FreePath { coordinates, from: &start, place, meetings };
        let mut delta: Vec<f64> = q.iter().zip(&from.q).map(|(q, from)| q - from).collect();
        path.shorten_past_obstacles(&mut delta, |_| ());
        q.iter_mut().zip(from.q.iter().zip(&delta)).for_each(|(q, (from, delta))| *q = from + delta);
    }
}
