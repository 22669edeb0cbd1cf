//! Decoding any bytes gives an error or the value that was written.

use super::*;
use crate::prelude::*;

fn some_bytes() -> Vec<u8> {
    let scene = Scene::new(Time::new(0.01, 1e-3, SchemeName::Bdf2))
        .body(Body::from_box(
            "block",
            BoxMesh { size: [1.0; 3], cells: [1; 3], element: CellKind::Tet4, origin: [0.0; 3] },
            Law::NeoHookean(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 }),
        ))
        .probe(Probe { pitch: Some(Axis::X), ..Probe::node("p", "block", 3) })
        .output(Output { interval: Some(1e-3), ..Output::default() })
        .checkpoint(Checkpoints::every(2e-3));
    let directory = tempfile::tempdir().unwrap();
    crate::run::run(scene, "test", directory.path(), &mut ()).unwrap();
    std::fs::read(newest(directory.path()).unwrap().path).unwrap()
}

#[test]
fn damage_is_found_wherever_it_is() {
    let good = some_bytes();
    let value = Checkpoint::decode(&good).unwrap();
    assert_eq!(value.steps(), 8);
    assert_eq!(value.encode(), good);
    for length in 0..good.len() {
        assert!(Checkpoint::decode(&good[..length]).is_err(), "cut at {length}");
    }
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 1 << (at % 8);
        assert!(Checkpoint::decode(&bad).is_err(), "a wrong bit at {at}");
    }
}

/// Records with a valid checksum may have invalid content. Lengths beyond the end of the data are refused before memory
/// is allocated for them.
#[test]
fn a_record_with_a_right_checksum_can_still_be_wrong() {
    let good = some_bytes();
    let mut accepted = 0;
    for at in (24..good.len() - 4).step_by(3) {
        for value in [0x00, 0x7f, 0xff] {
            let mut bad = good.clone();
            bad[at] = value;
            let end = bad.len() - 4;
            let sum = crc32fast::hash(&bad[..end]);
            bad[end..].copy_from_slice(&sum.to_le_bytes());
            accepted += u32::from(Checkpoint::decode(&bad).is_ok());
        }
    }
    // A changed number may still be valid.
    assert!(accepted > 0);
}

/// A value that is decoded is encoded to the same bytes. Fuzzing found a violation: a record with an empty list of work
/// counts was read as zero counts.
#[test]
fn what_is_read_is_written_to_the_same_bytes() {
    for length in 0..1500_usize {
        let mut whole = b"VI-CHECK".to_vec();
        whole.extend_from_slice(&1_u64.to_le_bytes());
        whole.extend_from_slice(&(length as u64).to_le_bytes());
        whole.resize(whole.len() + length, 0);
        let sum = crc32fast::hash(&whole);
        whole.extend_from_slice(&sum.to_le_bytes());
        if let Ok(checkpoint) = Checkpoint::decode(&whole) {
            assert_eq!(checkpoint.encode(), whole, "{length} zeros");
        }
    }
}
