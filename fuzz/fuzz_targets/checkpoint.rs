//! Tests that for any bytes, with a correct checksum or not, the reader of checkpoints does not panic and uses memory
//! in proportion to the input, and that a checkpoint that was read is written to the same bytes.
#![no_main]

use variational::run::checkpoint::Checkpoint;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = Checkpoint::decode(bytes);
    // Add the matching header and checksum, so that the fuzzer reaches the record.
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
