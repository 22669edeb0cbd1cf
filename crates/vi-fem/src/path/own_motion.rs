//! Prescribed motions that a program defines itself, for all nodes of a fix at once.

use std::fmt;
use std::sync::Arc;

use serde::{Serialize, Serializer};
use vi_core::Path;

/// The motion of points that start at given positions.
pub trait NodalMotion: Send + Sync + 'static {
    /// Writes the positions (m) at time t (s) of the points that start at `start` (m).
    fn positions(&self, start: &[[f64; 3]], t: f64, out: &mut [[f64; 3]]);
    /// Writes their velocities (m/s), the derivatives of the positions.
    fn velocities(&self, start: &[[f64; 3]], t: f64, out: &mut [[f64; 3]]);
}

/// A motion that a program defines itself. Directions that a body carries, such as the normals of a clamped sheet, do
/// not turn with it. In reports it is its name, from which it cannot be read back.
#[derive(Clone)]
pub struct OwnMotion {
    name: Arc<str>,
    motion: Arc<dyn NodalMotion>,
}

impl OwnMotion {
    /// Makes a motion; `name` appears in reports.
    pub fn new(name: &str, motion: impl NodalMotion) -> Self {
        Self { name: name.into(), motion: Arc::new(motion) }
    }

    /// Returns the position (m) at time t (s) of the point that starts at x.
    pub(crate) fn position(&self, x: [f64; 3], t: f64) -> [f64; 3] {
        let mut out = [[0.0; 3]];
        self.motion.positions(&[x], t, &mut out);
        out[0]
    }

    /// Returns the velocity (m/s) at time t (s) of the point that starts at x.
    pub(crate) fn velocity(&self, x: [f64; 3], t: f64) -> [f64; 3] {
        let mut out = [[0.0; 3]];
        self.motion.velocities(&[x], t, &mut out);
        out[0]
    }

    /// Returns the path of coordinates, each given by the start of its node and its axis.
    pub(crate) fn path(&self, coordinates: &[([f64; 3], usize)]) -> OwnPath {
        let mut starts: Vec<[f64; 3]> = Vec::new();
        let mut entries = Vec::with_capacity(coordinates.len());
        for &(x, axis) in coordinates {
            // The coordinates of a node usually follow each other.
            if starts.last() != Some(&x) {
                starts.push(x);
            }
            entries.push((starts.len() - 1, axis));
        }
        OwnPath { motion: Arc::clone(&self.motion), starts, entries }
    }
}

impl fmt::Debug for OwnMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "OwnMotion({})", self.name)
    }
}

/// Two motions are equal if they are clones of one.
impl PartialEq for OwnMotion {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.motion, &other.motion)
    }
}

impl Serialize for OwnMotion {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Said<'a> {
            name: &'a str,
        }
        Said { name: &self.name }.serialize(serializer)
    }
}

/// The coordinates of nodes that follow a motion of the program's own.
pub(crate) struct OwnPath {
    motion: Arc<dyn NodalMotion>,
    starts: Vec<[f64; 3]>,
    /// For each coordinate, the index of its node in `starts`, and its axis.
    entries: Vec<(usize, usize)>,
}

impl OwnPath {
    fn pick(&self, write: impl FnOnce(&mut [[f64; 3]]), out: &mut [f64]) {
        let mut values = vec![[0.0; 3]; self.starts.len()];
        write(&mut values);
        for (out, &(node, axis)) in out.iter_mut().zip(&self.entries) {
            *out = values[node][axis];
        }
    }
}

impl Path for OwnPath {
    fn position(&self, t: f64, out: &mut [f64]) {
        self.pick(|values| self.motion.positions(&self.starts, t, values), out);
    }

    fn velocity(&self, t: f64, out: &mut [f64]) {
        self.pick(|values| self.motion.velocities(&self.starts, t, values), out);
    }
}
