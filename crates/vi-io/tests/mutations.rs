//! Reads sample files that are truncated at every byte and mutated at random: no panic, no mesh that breaks the laws,
//! no memory out of proportion. `VI_IO_MUTATIONS=1000000 cargo test --release -p vi-io --test mutations -- --nocapture`
//! tries that many mutations per sample; the default is sized for CI.

mod laws;

use std::path::{Path, PathBuf};

use peak_alloc::PeakAlloc;
use vi_io::parse_mesh;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Bytes of memory that a reader may take per byte of file, and its fixed allowance.
const MULTIPLE: usize = 64;
const BASE: usize = 1 << 16;
/// The multiple for compressed files: zlib packs up to 1032 bytes into one, and each may stand for a number of eight
/// bytes.
const COMPRESSED_MULTIPLE: usize = 1040 * 9 + MULTIPLE;

fn samples() -> Vec<(PathBuf, Vec<u8>)> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let mut samples: Vec<_> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension != "py"))
        .map(|path| (PathBuf::from(path.file_name().unwrap()), std::fs::read(path).unwrap()))
        .collect();
    samples.sort();
    assert!(samples.len() > 40);
    samples
}

/// Reads a file, checks the laws, and returns whether it gave a mesh.
fn try_to_read(file: &Path, bytes: &[u8]) -> bool {
    MEMORY.reset_peak_usage();
    let before = MEMORY.current_usage();
    let result = parse_mesh(bytes, file);
    let taken = MEMORY.peak_usage().saturating_sub(before);
    laws::hold(file, &result);
    let compressed = bytes.windows(10).any(|window| window == b"compressor");
    let multiple = if compressed { COMPRESSED_MULTIPLE } else { MULTIPLE };
    assert!(taken <= multiple * bytes.len() + BASE, "{taken} bytes for a file of {}", bytes.len());
    result.is_ok()
}

struct Random(u64);

impl Random {
    /// SplitMix64 (Steele, Lea, Flood 2014).
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

const WORDS: [&[u8]; 16] = [
    b"0",
    b"-1",
    b"1000000000000",
    b"18446744073709551615",
    b"9223372036854775807",
    b"2147483647",
    b"-2147483648",
    b"4294967295",
    b"nan",
    b"inf",
    b"1e400",
    b"\n\n",
    b"$End",
    b"<",
    b"\"",
    b"=",
];

fn mutate(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    for _ in 0..1 + random.below(3) {
        let n = bytes.len();
        let at = random.below(n);
        let span = at..(at + 1 + random.below(16)).min(n);
        match random.below(9) {
            0 => bytes.truncate(at),
            1 if n > 0 => bytes[at] ^= 1 << random.below(8),
            2 if n > 0 => bytes[at] = random.next() as u8,
            3 => drop(bytes.drain(span)),
            4 => {
                let copy = bytes[span].to_vec();
                let to = random.below(n);
                bytes.splice(to..to, copy);
            }
            5 => {
                let from = random.below(other.len());
                let copy = &other[from..(from + 1 + random.below(64)).min(other.len())];
                bytes.splice(span, copy.iter().copied());
            }
            6 => {
                // Replaces a number or word of the text by another one.
                let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'-' || *byte == b'.';
                let start = (0..at).rev().find(|&i| !is_word(&bytes[i])).map_or(0, |i| i + 1);
                let end = (at..n).find(|&i| !is_word(&bytes[i])).unwrap_or(n);
                bytes.splice(start..end.max(start), WORDS[random.below(WORDS.len())].iter().copied());
            }
            7 => {
                let extreme =
                    [0u64, 1, u64::MAX, 1 << 31, 1 << 40, i64::MAX as u64, 0x7FF0 << 48, 0xFFFF_FFFF]
                        [random.below(8)];
                let width = [1, 2, 4, 8][random.below(4)];
                let image = if random.below(2) == 0 { extreme.to_le_bytes() } else { extreme.to_be_bytes() };
                for (byte, new) in bytes[at.min(n)..].iter_mut().zip(&image[..width]) {
                    *byte = *new;
                }
            }
            _ => {
                let word = WORDS[random.below(WORDS.len())];
                bytes.splice(at..at, word.iter().copied());
            }
        }
    }
}

/// There is a single test, because peak memory is measured for the whole process.
#[test]
fn damaged_files_are_refused_or_read_within_the_laws() {
    let samples = samples();
    for (file, bytes) in &samples {
        assert!(try_to_read(file, bytes), "{}", file.display());
        for length in 0..bytes.len() {
            try_to_read(file, &bytes[..length]);
        }
    }
    let tries: usize = std::env::var("VI_IO_MUTATIONS")
        .ok()
        .map_or(1000, |count| count.parse().expect("VI_IO_MUTATIONS is a number"));
    let mut random = Random(2);
    let mut accepted = 0;
    for (file, bytes) in &samples {
        for _ in 0..tries {
            let mut mutant = bytes.clone();
            let other = &samples[random.below(samples.len())].1;
            mutate(&mut random, &mut mutant, other);
            accepted += usize::from(try_to_read(file, &mutant));
        }
    }
    println!(
        "{} mutants of {} samples, {accepted} still read as meshes",
        tries * samples.len(),
        samples.len()
    );
}
