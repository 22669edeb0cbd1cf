//! Exact test of which surfaces cross in the state of a simulation. It shares no code with the contact search, which
//! it verifies.

use std::collections::BTreeSet;

use super::{Component, Simulation};
use crate::intersections::intersections;
use crate::model::{Outline, name_of};
use crate::scene::Problem;

impl Simulation {
    /// Returns the number of crossings, and the pairs of bodies whose surfaces cross although contact applies to
    /// them. Bodies have their numbers in the scene; rigid ones follow the others. In a scene without contact there
    /// are none.
    pub fn crossings(&self) -> (usize, BTreeSet<[usize; 2]>) {
        if self.scene.contact.is_none() {
            return (0, BTreeSet::new());
        }
        let outlines = self.outlines();
        let (mut points, mut triangles, mut owners) = (Vec::new(), Vec::new(), Vec::new());
        for (body, outline) in outlines.iter().enumerate() {
            let first = points.len() as u32;
            owners.resize(points.len() + outline.points.len(), body);
            points.extend(&outline.points);
            triangles.extend(outline.triangles.iter().map(|triangle| triangle.map(|node| first + node)));
        }
        let bodies = |segment: [u32; 2], triangle: [u32; 3]| {
            let pair = [owners[segment[0] as usize], owners[triangle[0] as usize]];
            [pair[0].min(pair[1]), pair[0].max(pair[1])]
        };
        let found = intersections(&points, &triangles, &[]);
        let pairs = found.iter().map(|found| bodies(found.segment, found.triangle));
        let pairs: Vec<_> = pairs.filter(|&[a, b]| self.meeting.may_meet(&self.scene, a, b)).collect();
        (pairs.len(), pairs.into_iter().collect())
    }

    /// Returns the current surfaces of all bodies; rigid ones follow the others.
    fn outlines(&self) -> Vec<Outline> {
        let bodies = self.bodies.iter().enumerate();
        let bodies = bodies.map(|(number, body)| Outline::of_body(body, self.positions(number)));
        let rigids = self.rigids.iter().map(|rigid| {
            let Component { system, state, .. } = &self.components[rigid.component];
            Outline::of_rigid(rigid, &system.positions(state))
        });
        bodies.chain(rigids).collect()
    }

    /// Returns the bodies that start entirely inside another one. Contact could never separate them.
    fn enclosed_start(&self) -> Vec<Problem> {
        if self.scene.contact.is_none() {
            return Vec::new();
        }
        let outlines = self.outlines();
        let mut problems = Vec::new();
        for (outer, around) in outlines.iter().enumerate() {
            for (inner, within) in outlines.iter().enumerate() {
                if inner != outer
                    && self.meeting.may_meet(&self.scene, inner, outer)
                    && around.encloses(within)
                {
                    let [inner, outer] = [inner, outer].map(|number| name_of(&self.scene, number));
                    let message = format!(
                        "'{inner}' starts within '{outer}': move it out, let `contact.resolve = true` do it, or list the \
                         pair in `contact.exclude`"
                    );
                    problems.push(Problem::new("contact", message));
                }
            }
        }
        problems
    }

    /// Returns a problem that names the pairs whose surfaces cross or enclose each other at the start.
    pub(super) fn crossing_start(&self) -> Vec<Problem> {
        /// Largest number of pairs that are listed.
        const NAMED: usize = 8;
        let (_, pairs) = self.crossings();
        let name = |number: usize| name_of(&self.scene, number);
        let words = |&[a, b]: &[usize; 2]| match a == b {
            true => format!("'{}' through itself", name(a)),
            false => format!("'{}' through '{}'", name(a), name(b)),
        };
        if pairs.is_empty() {
            return self.enclosed_start();
        }
        let named: Vec<String> = pairs.iter().take(NAMED).map(words).collect();
        let more = if pairs.len() > NAMED {
            format!(" and {} pairs more", pairs.len() - NAMED)
        } else {
            String::new()
        };
        let message = format!(
            "surfaces cross at the start: {}{more}; move the bodies apart, let `contact.resolve = true` do it, or list the pairs \
             in `contact.exclude`",
            named.join(", ")
        );
        vec![Problem::new("contact", message)]
    }
}
