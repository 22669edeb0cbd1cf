//! Tests the command line: bad input, signals, sweeps.

mod bad_input;
mod open_to_users;
#[path = "../program/mod.rs"]
mod program;
mod say;
mod signals;
mod sweep;
mod tutorials;
