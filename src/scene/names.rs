//! The names of a scene: finds bodies, rigid bodies and probes by name.

use std::collections::HashMap;

use super::{Probe, Scene};

/// A body of a scene: its number in the order of the scene, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BodyId(usize);

impl BodyId {
    /// Makes the identifier of the body with this number in the order of the scene.
    pub(crate) fn new(index: usize) -> Self {
        Self(index)
    }

    /// Returns the number in the order of the scene.
    pub fn index(self) -> usize {
        self.0
    }
}

/// A rigid body of a scene: its number in the order of the scene, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct RigidId(usize);

impl RigidId {
    pub(crate) fn index(self) -> usize {
        self.0
    }
}

/// Looks up the names of a scene. If two bodies share a name, which the checks refuse, it finds the first.
pub(crate) struct Names<'a> {
    bodies: HashMap<&'a str, BodyId>,
    rigids: HashMap<&'a str, RigidId>,
    probes: HashMap<&'a str, &'a Probe>,
}

impl<'a> Names<'a> {
    pub(crate) fn new(scene: &'a Scene) -> Self {
        let (mut bodies, mut rigids, mut probes) = (HashMap::new(), HashMap::new(), HashMap::new());
        for (index, body) in scene.bodies.iter().enumerate() {
            bodies.entry(body.name.as_str()).or_insert(BodyId(index));
        }
        for (index, rigid) in scene.rigids.iter().enumerate() {
            rigids.entry(rigid.name.as_str()).or_insert(RigidId(index));
        }
        for probe in &scene.probes {
            probes.entry(probe.name.as_str()).or_insert(probe);
        }
        Self { bodies, rigids, probes }
    }

    pub(crate) fn body(&self, name: &str) -> Option<BodyId> {
        self.bodies.get(name).copied()
    }

    pub(crate) fn rigid(&self, name: &str) -> Option<RigidId> {
        self.rigids.get(name).copied()
    }

    pub(crate) fn probe(&self, name: &str) -> Option<&'a Probe> {
        self.probes.get(name).copied()
    }
}
