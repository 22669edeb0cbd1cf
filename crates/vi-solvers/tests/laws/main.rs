//! Tests of assembly, linear solvers and schemes.

mod assembly;
#[path = "../bodies/mod.rs"]
mod bodies;
mod consistent;
mod constrained;
#[path = "../contacts/mod.rs"]
mod contacts;
mod damped;
mod explicit;
mod factor;
mod filtered;
#[path = "../forces/mod.rs"]
mod forces;
mod implicit;
mod interrupt;
mod linear_statics;
mod live;
mod modes;
mod motion;
mod pcg;
mod ranks;
mod single;
#[path = "../springs/mod.rs"]
mod springs;
mod statics;
mod tied;
