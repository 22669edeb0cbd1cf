//! No bytes make the reader of .inp files panic, take memory out of proportion, or give a mesh that breaks the laws.
#![no_main]

use std::path::Path;

#[path = "../../crates/vi-io/tests/laws/mod.rs"]
mod laws;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = Path::new("fuzz.inp");
    laws::hold(file, &vi_io::parse_inp(bytes, file));
});
