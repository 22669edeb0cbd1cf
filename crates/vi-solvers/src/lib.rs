//! Time integrators, assembly, nonlinear and sparse solves.
