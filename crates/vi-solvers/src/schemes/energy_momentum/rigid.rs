//! Removes the rigid part of a motion, part by part.

use nalgebra::{Matrix3, Vector3};
use vi_core::System;

use super::parts::Parts;
use crate::index::NONE;

impl Parts {
    /// Removes the rigid part about positions x from dq, part by part.
    pub(super) fn deform(&self, system: &System, x: &[f64], dq: &mut [f64]) {
        let (mass, free) = (system.free_mass(), system.coordinates().free());
        let mut rigid = vec![Rigid::default(); self.count];
        // Directors rotate about the origin and are not translated.
        let is_director = |k: usize| system.coordinates().is_director(free[k] / 3);
        let arm_of = |rigid: &Rigid, k: usize| match is_director(k) {
            true => place(x, free[k] as usize),
            false => place(x, free[k] as usize) - rigid.centre,
        };
        let each = || {
            let parts = self.of_free.iter().enumerate().filter(|&(_, &part)| part != NONE);
            parts.map(|(k, &part)| (k, part as usize, free[k] as usize % 3))
        };
        for (k, part, axis) in each().filter(|&(k, ..)| !is_director(k)) {
            rigid[part].mass[axis] += mass[k];
            rigid[part].momentum[axis] += mass[k] * dq[k];
            rigid[part].centre[axis] += mass[k] * x[free[k] as usize];
        }
        for (part, rigid) in rigid.iter_mut().enumerate() {
            for axis in 0..3 {
                if rigid.mass[axis] > 0.0 {
                    rigid.centre[axis] /= rigid.mass[axis];
                    rigid.velocity[axis] = rigid.momentum[axis] / rigid.mass[axis];
                }
                if !self.translations[part][axis] {
                    rigid.velocity[axis] = 0.0;
                }
            }
        }
        for (k, part, axis) in each() {
            if !is_director(k) {
                dq[k] -= rigid[part].velocity[axis];
            }
            if self.rotations[part] {
                let arm = arm_of(&rigid[part], k);
                rigid[part].spin += mass[k] * dq[k] * arm.cross(&Vector3::ith(axis, 1.0));
                let direction = arm.cross(&Vector3::ith(axis, 1.0));
                rigid[part].inertia += mass[k] * direction * direction.transpose();
            }
        }
        for (part, rigid) in rigid.iter_mut().enumerate() {
            if self.rotations[part] {
                // A straight or single part has no inertia about some axes; rotations about these move nothing.
                let size = rigid.inertia.trace();
                if let Ok(inverse) = rigid.inertia.pseudo_inverse(1e-12 * size) {
                    rigid.rotation = inverse * rigid.spin;
                }
            }
        }
        for (k, part, axis) in each() {
            if self.rotations[part] {
                dq[k] -= rigid[part].rotation.cross(&arm_of(&rigid[part], k))[axis];
            }
        }
    }
}

/// The rigid part of a motion.
#[derive(Clone, Default)]
struct Rigid {
    mass: Vector3<f64>,
    momentum: Vector3<f64>,
    centre: Vector3<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
    inertia: Matrix3<f64>,
    rotation: Vector3<f64>,
}

/// Returns the position of the node to which a coordinate belongs.
fn place(x: &[f64], dof: usize) -> Vector3<f64> {
    let node = dof - dof % 3;
    Vector3::new(x[node], x[node + 1], x[node + 2])
}
