//! Exact test of which surfaces cross in the state of a simulation. It shares no code with the contact search, which
//! it verifies.

use std::collections::BTreeSet;

use super::{Component, Simulation};
use crate::intersections::intersections;
use crate::model::{Outline, name_of};
use crate::scene::Problem;

/// An edge that crosses a triangle.
struct Crossing {
    /// The bodies of the edge and of the triangle, by their numbers in the scene.
    bodies: [usize; 2],
    /// Nodes of the edge in the mesh of its body.
    edge: [usize; 2],
    /// Nodes of the triangle in the mesh of its body.
    triangle: [usize; 3],
}

impl Simulation {
    /// Returns the number of crossings, and the pairs of bodies whose surfaces cross although contact applies to
    /// them. Bodies have their numbers in the scene; rigid ones follow the others. In a scene without contact there
    /// are none.
    pub fn crossings(&self) -> (usize, BTreeSet<[usize; 2]>) {
        let found = self.all_crossings();
        let pair = |crossing: &Crossing| {
            let [a, b] = crossing.bodies;
            [a.min(b), a.max(b)]
        };
        (found.len(), found.iter().map(pair).collect())
    }

    /// Returns every crossing of surfaces to which contact applies.
    fn all_crossings(&self) -> Vec<Crossing> {
        if self.scene.contact.is_none() {
            return Vec::new();
        }
        let outlines = self.outlines();
        let (mut points, mut triangles, mut owners) = (Vec::new(), Vec::new(), Vec::new());
        for (body, outline) in outlines.iter().enumerate() {
            let first = points.len() as u32;
            owners.resize(points.len() + outline.points.len(), (body, first));
            points.extend(&outline.points);
            triangles.extend(outline.triangles.iter().map(|triangle| triangle.map(|node| first + node)));
        }
        let own = |node: u32| (node - owners[node as usize].1) as usize;
        let crossings = intersections(&points, &triangles, &[]).into_iter().map(|found| Crossing {
            bodies: [found.segment[0], found.triangle[0]].map(|node| owners[node as usize].0),
            edge: found.segment.map(own),
            triangle: found.triangle.map(own),
        });
        crossings
            .filter(|found| self.meeting.may_meet(&self.scene, found.bodies[0], found.bodies[1]))
            .collect()
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
                if inner == outer || !self.meeting.may_meet(&self.scene, inner, outer) {
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
        let is_new = |found: &&Crossing| {
            let [a, b] = found.bodies;
            pairs.insert([a.min(b), a.max(b)])
        };
        let first_of_each: Vec<&Crossing> = crossings.iter().filter(is_new).collect();
        let words = |found: &&Crossing| {
            let ([a, b], [i, j], [k, l, m]) = (found.bodies, found.edge, found.triangle);
            let other = if a == b { "itself".to_owned() } else { format!("'{}'", name(b)) };
            format!("'{}' through {other} (edge {i}–{j} through triangle {k}, {l}, {m})", name(a))
        };
        if first_of_each.is_empty() {
            return self.enclosed_start();
        }
        let named: Vec<String> = first_of_each.iter().take(NAMED).map(words).collect();
        let more = match first_of_each.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!(" and {more} pairs more"),
        };
        let message = format!(
            "surfaces cross at the start, so that there is no gap: {}{more}; move the bodies apart, let \
             `contact.resolve = true` do it, or list the pairs in `contact.exclude`",
            named.join(", ")
        );
        vec![Problem::new("contact", message)]
    }
}
