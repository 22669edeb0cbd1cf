//! Reports on contact: the pairs of bodies with their laws, the smallest gap, and the entry of report.json.

use std::collections::BTreeMap;

use vi_contact::Gap;

use super::Simulation;
use super::contact::ContactWatch;
use crate::model::{self, Parted, part_in_words};

/// A start with a gap below this fraction of its layer is reported. A gap that is meant to be as wide as its layer may be less by
/// round-off.
const INSIDE: f64 = 0.99;

impl Simulation {
    /// Returns the smallest gap between surfaces with a contact force, at the start and after any step so far, m;
    /// infinite without such surfaces.
    pub fn smallest_gap(&self) -> f64 {
        self.contact.smallest_gap
    }

    /// Returns the largest number of surface crossings in any observation so far; counted only if the scene asserts
    /// it, or the smallest gap.
    pub(crate) fn intersections(&self) -> u64 {
        self.contact.intersections
    }

    /// Returns the first crossing of surfaces in words; `None` if there is none.
    pub(crate) fn first_crossing(&self) -> Option<String> {
        let (t, (a, b)) = self.contact.first_crossing?;
        let [a, b] = [a, b].map(|number| model::name_of(&self.scene, number as usize));
        let who =
            if a == b { format!("of '{a}' cross themselves") } else { format!("of '{a}' and '{b}' cross") };
        Some(format!("the surfaces {who} at t = {t:.4e} s"))
    }

    /// Adds notes on joined bodies that cross, on bodies that were moved before the start, on contact without effect, and on
    /// contact that pushes at the start.
    pub(super) fn note_contact(&mut self) {
        let name = |number: usize| model::name_of(&self.scene, number);
        let overlaps = self.meeting.overlapping().map(|(a, b)| {
            format!("'{}' and '{}' are joined and cross where they start: they do not meet", name(a), name(b))
        });
        let moves = self.parted.iter().map(|Parted { bodies, by: [x, y, z], energy }| {
            let names: Vec<String> = bodies.iter().map(|&body| format!("'{}'", name(body))).collect();
            let who = match names.as_slice() {
                [one] => format!("{one} was moved"),
                all => format!("{}, which are joined, were moved together", all.join(", ")),
            };
            format!(
                "{who} by ({x:.3e}, {y:.3e}, {z:.3e}) m before the start, so that nothing touches; potential energy \
                 changed by {energy:.3e} J, and the energy balance begins after that"
            )
        });
        let is_idle =
            self.scene.contact.is_some() && self.contact_pairs().all(|(_, reason)| reason.is_some());
        let idle = is_idle.then(|| {
            "nothing can meet, so that [contact] has no effect: `variational info` names the reason for each pair of bodies"
                .to_owned()
        });
        let watches = self.components.iter().filter_map(|component| component.contact.as_ref());
        let sewn = watches.flat_map(ContactWatch::sewn).map(|&([a, b], count)| {
            let who = match a == b {
                true => format!("'{}'", name(a)),
                false => format!("'{}' and '{}'", name(a), name(b)),
            };
            format!(
                "stitches of `stiffness` keep {count} pairs of points with faces and of edges of {who} out of contact: surfaces may \
                 cross there, and `check-frames` counts it"
            )
        });
        let notes: Vec<String> = overlaps.chain(moves).chain(idle).chain(sewn).collect();
        self.notes.extend(notes);
        let pressed = self.pressed_at_start();
        self.notes.extend(pressed);
    }

    /// Returns notes on components in which contact stores energy at the start of a motion, which then drives the bodies apart.
    /// Default layers fit the gaps, so that only a `distance` of the scene can be larger than a gap.
    fn pressed_at_start(&mut self) -> Vec<String> {
        let has_own_distance = self.scene.contact.as_ref().is_some_and(|contact| {
            contact.distance.is_some() || contact.pairs.iter().any(|pair| pair.distance.is_some())
        });
        if !has_own_distance || self.scene.statics.is_some() {
            return Vec::new();
        }
        let mut notes = Vec::new();
        for (number, component) in self.components.iter_mut().enumerate() {
            let Some(contact) = &mut component.contact else { continue };
            let x = component.system.positions(&component.state);
            let Some((Gap { gap, distance, nodes, .. }, energy)) = contact.pressed(&x, INSIDE) else {
                continue;
            };
            let [first, second] =
                nodes.map(|nodes| part_in_words(&self.bodies, &self.rigids, number, &nodes));
            notes.push(format!(
                "contact stores {energy:.3e} J at the start, which drives bodies apart: the gap of {first} and {second} is \
                 {gap:.3e} m, of a layer of {distance:.3e} m; move them apart, make `distance` of [contact] shorter than the gaps, \
                 or leave it out, so that layers fit the gaps"
            ));
        }
        notes
    }

    /// Returns all pairs of bodies, and each body with itself, by their numbers in the scene. A pair that is not
    /// searched for contact comes with the reason.
    pub(crate) fn contact_pairs(&self) -> impl Iterator<Item = ([usize; 2], Option<&'static str>)> {
        let count = self.bodies.len() + self.rigids.len();
        let pairs = (0..count).flat_map(move |a| (a..count).map(move |b| [a, b]));
        pairs.map(|[a, b]| ([a, b], self.meeting.reason_not(&self.scene, a, b)))
    }

    /// Returns the constants of contact between two bodies by their numbers in the scene; `None` if they do not meet.
    #[cfg(feature = "cli")]
    pub(crate) fn contact_law(&self, [first, second]: [usize; 2]) -> Option<vi_contact::Law> {
        let mut watches = self.components.iter().filter_map(|component| component.contact.as_ref());
        watches.find_map(|watch| watch.law(first, second))
    }

    /// Returns the size of the contact search for report.json; null in a scene without contact.
    pub(crate) fn contact_report(&self) -> serde_json::Value {
        if self.scene.contact.is_none() {
            return serde_json::Value::Null;
        }
        let systems = self.components.iter().filter_map(|component| component.contact.as_ref());
        let sewn: usize = systems.clone().flat_map(ContactWatch::sewn).map(|(_, count)| count).sum();
        let systems: Vec<_> = systems.map(ContactWatch::report).collect();
        let mut searched = 0;
        let mut skipped: BTreeMap<&str, usize> = BTreeMap::new();
        for (_, reason) in self.contact_pairs() {
            match reason {
                None => searched += 1,
                Some(reason) => *skipped.entry(reason).or_default() += 1,
            }
        }
        let parted = self.parted.iter().map(|Parted { bodies, by, energy }| {
            let names: Vec<&str> = bodies.iter().map(|&body| model::name_of(&self.scene, body)).collect();
            serde_json::json!({ "bodies": names, "moved_by": by, "potential_energy": energy })
        });
        let smallest_gap = Some(self.contact.smallest_gap).filter(|gap| gap.is_finite());
        serde_json::json!({
            "smallest_gap": smallest_gap, "pairs_of_bodies_searched": searched,
            "pairs_of_bodies_skipped": skipped.values().sum::<usize>(), "reasons_to_skip": skipped,
            "pairs_of_parts_sewn_by_springs": sewn, "systems": systems,
            "parted_at_start": parted.collect::<Vec<_>>(),
        })
    }
}
