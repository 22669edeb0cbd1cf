//! Exact test of which surfaces cross in the state of a simulation, those of bodies with prescribed motion too. It shares no
//! code with the contact search, which it verifies.

use std::collections::BTreeSet;

use super::{Component, Simulation};
use crate::intersections::{Intersection, intersections_where};
use crate::model::{Outline, name_of};
use crate::scene::Problem;

/// A place where the surfaces of two bodies cross.
struct Crossing {
    /// The bodies of both parts, by their numbers in the scene.
    bodies: [usize; 2],
    parts: Parts,
}

/// Parts that cross, by their nodes in the meshes of their bodies.
enum Parts {
    /// An edge and a triangle.
    Through([usize; 2], [usize; 3]),
    /// A point within a half-space.
    Below(u32),
}

impl Crossing {
    /// Returns the pair of bodies, the lower number first.
    fn pair(&self) -> [usize; 2] {
        let [a, b] = self.bodies;
        [a.min(b), a.max(b)]
    }
}

impl Simulation {
    /// Returns the number of crossings of triangles, and the pairs of bodies whose surfaces cross although contact applies to
    /// them. Bodies have their numbers in the scene; rigid ones follow the others. In a scene without contact there
    /// are none.
    pub fn crossings(&self) -> (usize, BTreeSet<[usize; 2]>) {
        let (meeting, scene) = (&self.meeting, &self.scene);
        let found = self.through(&self.outlines(), |a, b| meeting.may_meet(scene, a, b));
        (found.len(), found.iter().map(Crossing::pair).collect())
    }

    /// Returns the number of crossings of all surfaces that must not cross, including those of bodies whose motion is prescribed,
    /// with the first pair of bodies.
    pub(super) fn forbidden_crossings(&self) -> (usize, Option<[usize; 2]>) {
        let found = self.all_crossings();
        (found.len(), found.first().map(Crossing::pair))
    }

    /// Returns every crossing of surfaces that must not cross.
    fn all_crossings(&self) -> Vec<Crossing> {
        if self.scene.contact.is_none() {
            return Vec::new();
        }
        let outlines = self.outlines();
        let (meeting, scene) = (&self.meeting, &self.scene);
        let mut found = self.through(&outlines, |a, b| meeting.must_not_cross(scene, a, b));
        for (plane, half_space) in outlines.iter().enumerate().filter(|(_, outline)| outline.face.is_some()) {
            for (body, outline) in outlines.iter().enumerate() {
                // Contact leaves out the places where a body is joined to a half-space.
                let is_free = !self.meeting.is_joined(body, plane);
                if is_free && self.meeting.must_not_cross(&self.scene, body, plane) {
                    let sunk = half_space.sunk_points(outline).into_iter();
                    found.extend(
                        sunk.map(|point| Crossing { bodies: [body, plane], parts: Parts::Below(point) }),
                    );
                }
            }
        }
        found
    }

    /// Returns the edges that cross triangles, of pairs of bodies that `counts` accepts.
    fn through(&self, outlines: &[Outline], counts: impl Fn(usize, usize) -> bool + Sync) -> Vec<Crossing> {
        if self.scene.contact.is_none() {
            return Vec::new();
        }
        let (mut points, mut triangles, mut owners) = (Vec::new(), Vec::new(), Vec::new());
        for (body, outline) in outlines.iter().enumerate() {
            let first = points.len() as u32;
            owners.resize(points.len() + outline.points.len(), (body, first));
            points.extend(&outline.points);
            triangles.extend(outline.triangles.iter().map(|triangle| triangle.map(|node| first + node)));
        }
        let body_of = |node: u32| owners[node as usize].0;
        // Most parts that are near each other belong to one body.
        let crosses_itself: Vec<bool> = (0..outlines.len()).map(|body| counts(body, body)).collect();
        let found = intersections_where(&points, &triangles, &[], |a, b| match (body_of(a), body_of(b)) {
            (a, b) if a == b => crosses_itself[a],
            (a, b) => counts(a, b),
        });
        let own = |node: u32| (node - owners[node as usize].1) as usize;
        let crossing = |found: Intersection| Crossing {
            bodies: [found.segment[0], found.triangle[0]].map(body_of),
            parts: Parts::Through(found.segment.map(own), found.triangle.map(own)),
        };
        found.into_iter().map(crossing).collect()
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
                if inner == outer || !self.meeting.must_not_cross(&self.scene, inner, outer) {
                    continue;
                }
                if let Some(point) = around.enclosed_point(within) {
                    let place = within.points[point as usize];
                    let [x, y, z] = place;
                    let nearest = around.nearest_point(place).map_or(String::new(), |(node, distance)| {
                        format!(", {distance:.3e} m from point {node} of the surface around it")
                    });
                    let [inner, outer] = [inner, outer].map(|number| name_of(&self.scene, number));
                    let message = format!(
                        "'{inner}' starts within '{outer}': point {point} of '{inner}' is at ({x:.4e}, {y:.4e}, {z:.4e}) m{nearest}; \
                         move it out, let `contact.resolve = true` do it, or list the pair in `contact.exclude`"
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
        let crossings = self.all_crossings();
        let name = |number: usize| name_of(&self.scene, number);
        let mut pairs = BTreeSet::new();
        let is_new = |found: &&Crossing| pairs.insert(found.pair());
        let first_of_each: Vec<&Crossing> = crossings.iter().filter(is_new).collect();
        let words = |found: &&Crossing| {
            let [a, b] = found.bodies;
            match found.parts {
                Parts::Through([i, j], [k, l, m]) => {
                    let other = if a == b { "itself".to_owned() } else { format!("'{}'", name(b)) };
                    format!("'{}' through {other} (edge {i}–{j} through triangle {k}, {l}, {m})", name(a))
                }
                Parts::Below(point) => {
                    format!("'{}' through '{}' (point {point} is below its face)", name(a), name(b))
                }
            }
        };
        if first_of_each.is_empty() {
            return self.enclosed_start();
        }
        let named: Vec<String> = first_of_each.iter().take(NAMED).map(words).collect();
        let more = match first_of_each.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} pairs more"),
        };
        // Nothing but the scene moves bodies whose motion is prescribed.
        let may_part = |found: &Crossing| {
            let [a, b] = found.bodies;
            self.meeting.may_meet(&self.scene, a, b)
        };
        let resolve = match first_of_each.into_iter().any(may_part) {
            true => ", let `contact.resolve = true` do it,",
            false => "",
        };
        let message = format!(
            "surfaces cross at the start, so that there is no gap: {}{more}; move the bodies apart{resolve} or list the pairs \
             in `contact.exclude`",
            named.join(", ")
        );
        vec![Problem::new("contact", message)]
    }
}
