//! Reads and writes files: meshes and arrays, no physics.
