//! Which bodies act on each other: those that springs, ties, attachments or joints join are one component.

use super::resolve::{End, Resolved};
use crate::scene::{BodyId, RigidId};

/// The number of the component of each body and of each rigid body.
pub(super) struct Partition {
    /// Of the bodies, then of the rigid bodies.
    component_of: Vec<usize>,
    body_count: usize,
}

impl Partition {
    /// Components are numbered by their first body.
    pub(super) fn new(scene: &Resolved<'_>) -> Self {
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
        for (a, b) in springs.chain(ties).chain(joints).chain(held) {
            let (keep, drop) = (label[a].min(label[b]), label[a].max(label[b]));
            label.iter_mut().filter(|l| **l == drop).for_each(|l| *l = keep);
        }
        let mut order = label.clone();
        order.sort_unstable();
        order.dedup();
        let component_of = label.iter().map(|l| order.partition_point(|o| o < l)).collect();
        Self { component_of, body_count }
    }

    /// Number of components.
    pub(super) fn count(&self) -> usize {
        self.component_of.iter().max().map_or(0, |&last| last + 1)
    }

    pub(super) fn of_body(&self, body: BodyId) -> usize {
        self.component_of[body.index()]
    }

    /// Of rigid body number `rigid` in the order of the scene.
    pub(super) fn of_rigid(&self, rigid: usize) -> usize {
        self.component_of[self.body_count + rigid]
    }
}
