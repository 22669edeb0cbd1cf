//! Tests the files that the program reads and writes.

mod check_frames;
mod decks;
mod frames;
mod interruption;
mod meshes;
mod output_directory;
#[path = "../program/mod.rs"]
mod program;
mod provenance;
mod results;
mod resume;
mod resume_files;
mod viewers;
