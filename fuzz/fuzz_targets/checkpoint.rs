//! No bytes make the reader of checkpoints panic or take memory out of proportion, whether their checksum is right
//! or not; what is read is written to the same bytes.
#![no_main]

use variational::run::checkpoint::Checkpoint;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = Checkpoint::decode(bytes);
    // The same with the header and the checksum that belong to it, so that the fuzzer reaches the record.
    let mut whole = b"VI-CHECK".to_vec();
    whole.extend_from_slice(&1_u64.to_le_bytes());
    whole.extend_from_slice(&(bytes.len() as u64).to_le_bytes());
    whole.extend_from_slice(bytes);
    let sum = crc32fast::hash(&whole);
    whole.extend_from_slice(&sum.to_le_bytes());
    if let Ok(checkpoint) = Checkpoint::decode(&whole) {
        assert_eq!(checkpoint.encode(), whole);
    }
});
