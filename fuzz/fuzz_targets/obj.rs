//! Tests that for any bytes the reader of .obj files does not panic, uses memory in proportion to the input, and returns
//! only valid meshes.
#![no_main]

use std::path::Path;

#[path = "../../crates/vi-io/tests/laws/mod.rs"]
mod laws;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = Path::new("fuzz.obj");
    laws::hold(file, &vi_io::parse_obj(bytes, file));
});
