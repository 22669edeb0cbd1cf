//! Meshes, elements and materials: a mass and potentials.
