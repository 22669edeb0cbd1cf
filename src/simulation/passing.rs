//! Notes bodies with prescribed motion that pass through each other. Contact cannot keep them apart, and both motions
//! are known before the run.

use super::Simulation;
use crate::model::{Outline, name_of};

/// Least and largest number of times at which a pair is examined, and the number of triangles at all times together
/// that the number of times must not exceed: thus a run with boxes takes some milliseconds more, and one with two
/// meshes of 100 000 triangles less than two seconds.
const TIMES: [usize; 2] = [4, 64];
const TRIANGLES: usize = 1_000_000;
/// Largest number of pairs that a note lists.
const NAMED: usize = 8;

impl Simulation {
    /// Adds notes on rigid bodies with prescribed motion that cross. Those that cross at the start are parts of one
    /// obstacle and may cross from then on, unless `contact.resolve` requires a start at which nothing crosses.
    pub(super) fn note_passing(&mut self) {
        let Some(resolves) = self.scene.contact.as_ref().map(|contact| contact.resolve) else { return };
        let first = self.bodies.len();
        let is_prescribed = |&rigid: &usize| self.scene.rigids[rigid].is_prescribed();
        let prescribed: Vec<usize> = (0..self.rigids.len()).filter(is_prescribed).collect();
        let (mut one, mut passing) = (Vec::new(), Vec::new());
        for (k, &a) in prescribed.iter().enumerate() {
            for &b in &prescribed[k + 1..] {
                if !self.meeting.must_not_cross(&self.scene, first + a, first + b) {
                    continue;
                }
                let moves = [a, b].iter().any(|&rigid| self.scene.rigids[rigid].motion.is_some());
                if self.cross_at([a, b], 0.0) {
                    one.push([first + a, first + b]);
                } else if moves && let Some(t) = self.time_of_crossing([a, b]) {
                    passing.push(([first + a, first + b], t));
                }
            }
        }
        let words = |[a, b]: [usize; 2]| {
            let [a, b] = [a, b].map(|number| name_of(&self.scene, number));
            format!("'{a}' and '{b}'")
        };
        let mut notes = Vec::new();
        if !resolves && !one.is_empty() {
            let named: Vec<String> = one.iter().take(NAMED).map(|&pair| words(pair)).collect();
            let more = match one.len().saturating_sub(NAMED) {
                0 => String::new(),
                more => format!(" and {more} pairs more"),
            };
            notes.push(format!(
                "{}{more} cross at the start: the motion of both is prescribed, so that they count as parts of one obstacle, and \
                 assertions do not see them cross; list such pairs in `contact.exclude` to say so",
                named.join(", ")
            ));
            one.into_iter().for_each(|[a, b]| self.meeting.compose(a, b));
        }
        notes.extend(passing.into_iter().map(|(pair, t)| {
            format!(
                "{} cross at t = {t:.3e} s: the motion of both is prescribed, so that contact cannot keep them apart; change a \
                 motion, or list the pair in `contact.exclude`",
                words(pair)
            )
        }));
        self.notes.extend(notes);
    }

    /// Returns the first of some times during the run, s, at which two rigid bodies with prescribed motion cross.
    fn time_of_crossing(&self, pair: [usize; 2]) -> Option<f64> {
        let count = |rigid: usize| self.rigids[rigid].form.as_ref().map_or(0, |form| form.triangles.len());
        let most = TRIANGLES / pair.map(count).iter().sum::<usize>().max(1);
        let times = most.clamp(TIMES[0], TIMES[1]);
        let mut times = (1..=times).map(|k| self.scene.time.end * k as f64 / times as f64);
        times.find(|&t| self.cross_at(pair, t))
    }

    /// Returns whether two rigid bodies with prescribed motion cross at time t, s.
    fn cross_at(&self, pair: [usize; 2], t: f64) -> bool {
        let [a, b] = pair.map(|rigid| self.outline_at(rigid, t));
        let is_sunk = !a.sunk_points(&b).is_empty() || !b.sunk_points(&a).is_empty();
        is_sunk || (a.is_near(&b) && a.meets(&b))
    }

    /// Returns the outline of a rigid body with prescribed motion at time t, s.
    fn outline_at(&self, rigid: usize, t: f64) -> Outline {
        let rigid = &self.rigids[rigid];
        let coordinates = self.components[rigid.component].system.coordinates();
        let mut x = vec![0.0; coordinates.dof_count()];
        coordinates.place_prescribed(t, &mut x);
        Outline::of_rigid(rigid, &x)
    }
}
