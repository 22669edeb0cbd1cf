//! Which surfaces cross in the state of a simulation, exactly. It shares no code with the search for contact, which it
//! judges.

use std::collections::BTreeSet;

use super::Simulation;
use crate::intersections::intersections;
use crate::model::{may_meet, name_of};
use crate::scene::Problem;

impl Simulation {
    /// Pairs of bodies whose surfaces cross now though they may meet, and the number of crossings: bodies by their
    /// numbers in the scene, rigid ones after the others. Empty in a scene without contact.
    pub fn crossings(&self) -> (usize, BTreeSet<[usize; 2]>) {
        if self.scene.contact.is_none() {
            return (0, BTreeSet::new());
        }
        let (mut points, mut triangles, mut owners) = (Vec::new(), Vec::new(), Vec::new());
        let mut add = |body: usize, own: Vec<[f64; 3]>, surface: &[[u32; 3]]| {
            let first = points.len() as u32;
            owners.resize(points.len() + own.len(), body);
            points.extend(own);
            triangles.extend(surface.iter().map(|triangle| triangle.map(|node| first + node)));
        };
        for (number, body) in self.bodies.iter().enumerate() {
            // The elements have been accepted as those of a body when it was built: they have faces.
            let Ok(surface) = vi_mesh::Surface::of_body(&body.mesh, body.dimension) else { continue };
            add(number, self.positions(number), &surface.triangles());
        }
        for (number, rigid) in self.rigids.iter().enumerate() {
            let Some(form) = &rigid.form else { continue };
            add(self.bodies.len() + number, self.carried(number, &form.points), &form.triangles);
        }
        let bodies = |segment: [u32; 2], triangle: [u32; 3]| {
            let pair = [owners[segment[0] as usize], owners[triangle[0] as usize]];
            [pair[0].min(pair[1]), pair[0].max(pair[1])]
        };
        let found = intersections(&points, &triangles, &[]);
        let pairs = found.iter().map(|found| bodies(found.segment, found.triangle));
        let pairs: Vec<_> = pairs.filter(|&[a, b]| may_meet(&self.scene, &self.joined, a, b)).collect();
        (pairs.len(), pairs.into_iter().collect())
    }

    /// A start whose surfaces cross, by the names of the pairs.
    pub(super) fn crossing_start(&self) -> Vec<Problem> {
        /// Pairs that are named.
        const NAMED: usize = 8;
        let (_, pairs) = self.crossings();
        let name = |number: usize| name_of(&self.scene, number);
        let words = |&[a, b]: &[usize; 2]| match a == b {
            true => format!("'{}' through itself", name(a)),
            false => format!("'{}' through '{}'", name(a), name(b)),
        };
        if pairs.is_empty() {
            return Vec::new();
        }
        let named: Vec<String> = pairs.iter().take(NAMED).map(words).collect();
        let more = if pairs.len() > NAMED {
            format!(" and {} pairs more", pairs.len() - NAMED)
        } else {
            String::new()
        };
        let message = format!(
            "surfaces cross at the start: {}{more}; move the bodies apart, or list the pairs in `contact.exclude`",
            named.join(", ")
        );
        vec![Problem::new("contact", message)]
    }
}
