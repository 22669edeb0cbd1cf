//! Variational: deformable bodies by finite elements and variational integrators.
