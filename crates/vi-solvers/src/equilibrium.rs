//! Static equilibrium: load steps, paths of equilibria through limit points, critical points, and the steppers built
//! from them. Also computes the forces on the nodes of a given state.

pub(crate) mod balance;
mod bond;
pub(crate) mod circulation;
mod constrained;
mod critical;
mod distances;
pub(crate) mod friction;
pub(crate) mod function;
mod headway;
mod lagging;
mod line_search;
pub(crate) mod load_control;
mod lowest_mode;
mod newton;
pub(crate) mod nodal_forces;
mod obstacles;
pub(crate) mod options;
mod path;
pub(crate) mod path_following;
mod persistence;
pub(crate) mod quasi_static;
mod release;
mod rubbing;
mod search;
mod tangent_solver;
mod trust_region;
mod work_done;
