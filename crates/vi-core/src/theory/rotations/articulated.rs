//! Articulated bodies q = (q_1 … q_m): a tree of rigid links, each connected to its parent by one joint. The pose of
//! every link is a function of q, and differentiation gives its velocity. The sum of the links' Lagrangians is one
//! Lagrangian of q, so no equation of a mechanism is written by hand.

use num_dual::Dual;

use crate::error::CoreError;
use crate::theory::lagrange::lagrangian::{Lagrangian, Scalar};
use crate::theory::rotations::so3::{Matrix3, Vector3, cayley, identity, product, rotate};

/// Motion of a link relative to its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Joint {
    /// Rotation by q (rad) about a unit axis.
    Revolute(Vector3<f64>),
    /// Translation by q (m) along a unit axis.
    Prismatic(Vector3<f64>),
    /// Free rotation about a point, cay(q) with three coordinates. The chart ends at a rotation of π from q = 0.
    Ball,
}

impl Joint {
    /// Returns the number of its coordinates.
    pub fn dof_count(&self) -> usize {
        match self {
            Self::Revolute(_) | Self::Prismatic(_) => 1,
            Self::Ball => 3,
        }
    }
}

/// A rigid link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// The parent link, which comes earlier in the list; `None` for the ground.
    pub parent: Option<usize>,
    /// Position of the joint in the parent's frame, m.
    pub anchor: Vector3<f64>,
    /// The joint, with its axis in the parent's frame.
    pub joint: Joint,
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass in the link's own frame, with its origin at the joint, m.
    pub centre: Vector3<f64>,
    /// Inertia about the centre of mass, in the link's frame, kg m².
    pub inertia: Matrix3<f64>,
}

/// A tree of links under uniform gravity.
#[derive(Debug, Clone, PartialEq)]
pub struct Articulated {
    links: Vec<Link>,
    gravity: Vector3<f64>,
}

impl Articulated {
    /// Returns the tree of `links` in a uniform gravity field (m/s²).
    ///
    /// # Errors
    /// Returns [`CoreError::Coordinate`] if a link's parent does not come before it.
    pub fn new(links: Vec<Link>, gravity: Vector3<f64>) -> Result<Self, CoreError> {
        for (k, link) in links.iter().enumerate() {
            if let Some(parent) = link.parent.filter(|&parent| parent >= k) {
                return Err(CoreError::Coordinate { what: "parent of a link", dof: parent, count: k });
            }
        }
        Ok(Self { links, gravity })
    }

    /// Returns the links.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Returns the pose (origin, rotation) of every link.
    pub fn poses<D: Scalar>(&self, q: &[D]) -> Vec<(Vector3<D>, Matrix3<D>)> {
        let mut poses: Vec<(Vector3<D>, Matrix3<D>)> = Vec::with_capacity(self.links.len());
        let mut rest = q;
        for link in &self.links {
            let (q, later) = rest.split_at(link.joint.dof_count());
            rest = later;
            let (place, turn) = match link.parent {
                Some(parent) => poses[parent],
                None => ([D::from(0.0); 3], identity()),
            };
            let mut offset = link.anchor.map(D::from);
            let mut own = identity();
            match link.joint {
                Joint::Revolute(axis) => own = rotation_about(&axis, q[0]),
                Joint::Prismatic(axis) => offset = std::array::from_fn(|i| offset[i] + q[0] * axis[i]),
                Joint::Ball => own = cayley(&[q[0], q[1], q[2]]),
            }
            let moved = rotate(&turn, &offset);
            poses.push((std::array::from_fn(|i| place[i] + moved[i]), product(&turn, &own)));
        }
        poses
    }
}

/// Rodrigues' formula: cos q I + sin q â + (1 − cos q) a aᵀ.
fn rotation_about<D: Scalar>(a: &Vector3<f64>, q: D) -> Matrix3<D> {
    let (sin, cos) = q.sin_cos();
    let hat = [[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]];
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let unit = if i == j { cos } else { D::from(0.0) };
            unit + sin * hat[i][j] + (-cos + 1.0) * (a[i] * a[j])
        })
    })
}

impl Lagrangian for Articulated {
    fn dof_count(&self) -> usize {
        self.links.iter().map(|link| link.joint.dof_count()).sum()
    }

    fn value<D: Scalar>(&self, _t: D, q: &[D], v: &[D]) -> D {
        let moving: Vec<Dual<D>> = q.iter().zip(v).map(|(&q, &v)| Dual::new(q, v)).collect();
        let mut sum = D::from(0.0);
        for (link, (origin, turn)) in self.links.iter().zip(self.poses(&moving)) {
            let arm = rotate(&turn, &link.centre.map(|x| Dual::from_re(D::from(x))));
            for i in 0..3 {
                let centre = origin[i] + arm[i];
                sum +=
                    centre.eps * centre.eps * (0.5 * link.mass) + centre.re * (link.mass * self.gravity[i]);
            }
            // ½ ω·I ω = ½ tr(Ṙ J Ṙᵀ), J = ½ tr(I) 1 − I the second moment of mass.
            let trace: f64 = (0..3).map(|i| link.inertia[i][i]).sum();
            for i in 0..3 {
                for j in 0..3 {
                    let moment = if i == j { 0.5 * trace } else { 0.0 } - link.inertia[i][j];
                    if moment != 0.0 {
                        let pair: D = (0..3).map(|k| turn[k][i].eps * turn[k][j].eps).sum();
                        sum += pair * (0.5 * moment);
                    }
                }
            }
        }
        sum
    }
}
