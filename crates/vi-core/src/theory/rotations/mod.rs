//! Rotations without angles: the orientation is the matrix R, and every step uses its own chart around the current
//! orientation. So there is no gimbal lock, and no quaternion must be normalised. Lie-group variational integrators
//! of any order move rigid bodies, free or about a fixed point; joints connect articulated bodies.

pub(crate) mod articulated;
pub(crate) mod rigid;
pub(crate) mod so3;

pub use articulated::{Articulated, Joint, Link};
pub use rigid::{PosePotential, RigidBody, RigidState, Weight, Weightless};
pub use so3::{Matrix3, Vector3, cayley, identity, product, rotate, transpose};
