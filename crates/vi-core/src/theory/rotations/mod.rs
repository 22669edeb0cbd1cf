//! Rotations without angles: the orientation is the matrix R itself, every step moves in a chart of its own around
//! the present one, and so there is no gimbal lock and no quaternion to renormalise. Rigid bodies, free or about a
//! fixed point, by Lie-group variational integrators of any order; articulated bodies by joints.

pub(crate) mod articulated;
pub(crate) mod rigid;
pub(crate) mod so3;

pub use articulated::{Articulated, Joint, Link};
pub use rigid::{PosePotential, RigidBody, RigidState, Weight, Weightless};
pub use so3::{Matrix3, Vector3, cayley, identity, product, rotate, transpose};
