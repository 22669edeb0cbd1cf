//! The theory in code.
