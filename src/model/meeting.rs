//! Determines which bodies of a scene may meet, and why others may not.

use std::collections::{BTreeSet, HashSet};

use crate::scene::{Rigid, Scene};

/// The pairs of bodies that may meet. Bodies are numbered as in the scene, rigid ones after the others.
#[derive(Debug, Clone, Default)]
pub(crate) struct Meeting {
    /// Pairs that are joined, including a body with itself; they meet only away from the joint.
    joined: HashSet<(usize, usize)>,
    /// Joined pairs whose surfaces cross at the start.
    overlapping: BTreeSet<(usize, usize)>,
    /// Pairs with prescribed motion that are parts of one obstacle.
    composed: BTreeSet<(usize, usize)>,
}

/// Returns the name of a body by its number.
pub(crate) fn name_of(scene: &Scene, number: usize) -> &str {
    match number.checked_sub(scene.bodies.len()) {
        Some(rigid) => &scene.rigids[rigid].name,
        None => &scene.bodies[number].name,
    }
}

/// Returns the rigid body with this number; `None` for a deformable one.
fn rigid_of(scene: &Scene, number: usize) -> Option<&Rigid> {
    number.checked_sub(scene.bodies.len()).map(|rigid| &scene.rigids[rigid])
}

impl Meeting {
    pub(super) fn new(joined: HashSet<(usize, usize)>) -> Self {
        Self { joined, ..Self::default() }
    }

    /// Returns whether these bodies are joined.
    pub(crate) fn is_joined(&self, a: usize, b: usize) -> bool {
        self.joined.contains(&(a.min(b), a.max(b)))
    }

    /// Records joined bodies whose surfaces cross; they do not meet.
    pub(super) fn overlap(&mut self, a: usize, b: usize) {
        self.overlapping.insert((a.min(b), a.max(b)));
    }

    /// Records bodies with prescribed motion whose surfaces cross at the start; they are parts of one obstacle.
    pub(crate) fn compose(&mut self, a: usize, b: usize) {
        self.composed.insert((a.min(b), a.max(b)));
    }

    /// Returns the joined pairs whose surfaces cross at the start.
    pub(crate) fn overlapping(&self) -> impl Iterator<Item = (usize, usize)> {
        self.overlapping.iter().copied()
    }

    /// Returns why two bodies, or a body with itself, do not meet; `None` if they may.
    pub(crate) fn reason_not(&self, scene: &Scene, a: usize, b: usize) -> Option<&'static str> {
        let both = [a, b].into_iter().all(|number| rigid_of(scene, number).is_some_and(Rigid::is_prescribed));
        self.reason_to_pass(scene, a, b).or(both.then_some("the motion of both is prescribed"))
    }

    /// Returns whether the surfaces of two bodies, or of a body with itself, must not cross: they may meet, or would if the
    /// motion of one were not prescribed, and are not parts of one obstacle.
    pub(crate) fn must_not_cross(&self, scene: &Scene, a: usize, b: usize) -> bool {
        self.reason_to_pass(scene, a, b).is_none() && !self.composed.contains(&(a.min(b), a.max(b)))
    }

    /// Returns why the surfaces of two bodies, or of a body with itself, may pass through each other; `None` if they may not.
    fn reason_to_pass(&self, scene: &Scene, a: usize, b: usize) -> Option<&'static str> {
        let Some(contact) = &scene.contact else { return Some("the scene has no table [contact]") };
        let is_shapeless = |number| rigid_of(scene, number).is_some_and(|rigid| rigid.shape.is_none());
        if is_shapeless(a) || is_shapeless(b) {
            Some("a rigid body without a shape has no surface")
        } else if a == b && rigid_of(scene, a).is_some() {
            Some("a rigid body does not meet itself")
        } else if !contact.admits(name_of(scene, a), name_of(scene, b)) {
            Some(if a == b && !contact.own {
                "`contact.self` is false"
            } else {
                "listed in `contact.exclude`"
            })
        } else if self.overlapping.contains(&(a.min(b), a.max(b))) {
            Some("they are joined, and cross where they start")
        } else {
            None
        }
    }

    /// Returns whether two bodies, or a body with itself, may meet.
    pub(crate) fn may_meet(&self, scene: &Scene, a: usize, b: usize) -> bool {
        self.reason_not(scene, a, b).is_none()
    }
}
