//! Tests the theory and the contract: discrete equations, symmetries, reference cases.

mod constraints;
mod diagnostics;
mod discrete;
mod generalised;
mod lagrange;
mod oracle;
mod oscillations;
mod problems;
mod reference_cases;
mod rotations;
mod theory;
