//! No text makes the reader of scenes panic; it is read, or refused with reasons.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let parsed = variational::scene::Scene::parse(text, &[]);
    assert!(parsed.scene.is_some() || !parsed.problems.is_empty());
});
