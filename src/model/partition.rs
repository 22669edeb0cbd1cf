//! Divides the bodies into components: bodies act on each other if springs, ties, attachments or joints join them, or
//! if they may meet.

use std::collections::HashSet;

use super::meeting::Meeting;
use super::resolve::{End, Resolved};
use crate::scene::{BodyId, RigidId, Scene};

/// The component number of each body and of each rigid body.
pub(super) struct Partition {
    /// The bodies first, then the rigid bodies.
    component_of: Vec<usize>,
    body_count: usize,
}

impl Partition {
    /// Determines the components, numbered by their first body.
    pub(super) fn new(scene: &Scene, resolved: &Resolved<'_>, meeting: &Meeting) -> Self {
        let all = resolved.bodies.len() + resolved.rigids.len();
        let count = if scene.contact.is_some() { all } else { 0 };
        let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
        let meeting = pairs.filter(|&(a, b)| meeting.may_meet(scene, a, b));
        let scene = resolved;
        let body_count = scene.bodies.len();
        let body = |id: BodyId| id.index();
        let rigid = |id: RigidId| body_count + id.index();
        let springs = scene.springs.iter().filter_map(|spring| match &spring.ends {
            [End::Node(a), End::Node(b)] => Some((body(a.body), body(b.body))),
            _ => None,
        });
        let ties = scene.ties.iter().filter_map(|set| Some((body(set.body), body(set.to?))));
        let joints = scene.joints.iter().filter_map(|joint| Some((rigid(joint.body), rigid(joint.to?))));
        let rigids = scene.rigids.iter().enumerate();
        let held = rigids
            .flat_map(|(k, rigid)| rigid.held.iter().map(move |nodes| (body(nodes.body), body_count + k)));
        let mut label: Vec<usize> = (0..body_count + scene.rigids.len()).collect();
        for (a, b) in springs.chain(ties).chain(joints).chain(held).chain(meeting) {
            if label[a] == label[b] {
                continue;
            }
            let (keep, drop) = (label[a].min(label[b]), label[a].max(label[b]));
            label.iter_mut().filter(|l| **l == drop).for_each(|l| *l = keep);
        }
        let mut order = label.clone();
        order.sort_unstable();
        order.dedup();
        let component_of = label.iter().map(|l| order.partition_point(|o| o < l)).collect();
        Self { component_of, body_count }
    }

    /// Returns the number of components.
    pub(super) fn count(&self) -> usize {
        self.component_of.iter().max().map_or(0, |&last| last + 1)
    }

    pub(super) fn of_body(&self, body: BodyId) -> usize {
        self.component_of[body.index()]
    }

    /// Returns the component of rigid body number `rigid` in the order of the scene.
    pub(super) fn of_rigid(&self, rigid: usize) -> usize {
        self.component_of[self.body_count + rigid]
    }
}

/// Returns the pairs of bodies (rigid ones numbered after the others) that the scene joins, including a body with
/// itself.
pub(super) fn joined(scene: &Resolved<'_>) -> HashSet<(usize, usize)> {
    let body_count = scene.bodies.len();
    let rigid = |id: RigidId| body_count + id.index();
    let ties = scene.ties.iter().filter_map(|set| Some((set.body.index(), set.to?.index())));
    let joints = scene.joints.iter().filter_map(|joint| Some((rigid(joint.body), rigid(joint.to?))));
    let rigids = scene.rigids.iter().enumerate();
    let held = rigids
        .flat_map(|(k, rigid)| rigid.held.iter().map(move |nodes| (nodes.body.index(), body_count + k)));
    ties.chain(joints).chain(held).map(|(a, b): (usize, usize)| (a.min(b), a.max(b))).collect()
}
