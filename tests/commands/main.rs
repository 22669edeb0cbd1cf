//! Tests the command line: bad input, doors to other programs, signals, sweeps.

mod bad_input;
mod doors;
mod open_to_users;
#[path = "../program/mod.rs"]
mod program;
mod say;
mod signals;
mod sweep;
mod tutorials;
