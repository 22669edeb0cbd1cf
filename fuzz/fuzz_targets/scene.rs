//! Tests that for any text the reader of scenes does not panic: it returns a scene, or problems.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let parsed = variational::scene::Scene::parse(text, &[]);
    assert!(parsed.scene.is_some() || !parsed.problems.is_empty());
});
