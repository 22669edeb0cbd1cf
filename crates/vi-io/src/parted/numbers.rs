//! Writes lists of numbers, little-endian; `sections.rs` reads them.

use std::io::{self, Write};

/// Writes points.
pub(super) fn put_points(points: &[[f64; 3]], out: &mut impl Write) -> io::Result<()> {
    put_reals(points.as_flattened(), out)
}

/// Writes numbers of 32 bits.
pub(super) fn put_integers(numbers: &[u32], out: &mut impl Write) -> io::Result<()> {
    put(numbers, |number| number.to_le_bytes(), out)
}

/// Writes real numbers.
pub(super) fn put_reals(numbers: &[f64], out: &mut impl Write) -> io::Result<()> {
    put(numbers, |number| number.to_le_bytes(), out)
}

fn put<T: Copy, const N: usize>(
    numbers: &[T],
    bytes_of: impl Fn(T) -> [u8; N],
    out: &mut impl Write,
) -> io::Result<()> {
    // The sum of many bytes takes less time than that of few.
    numbers.chunks(1 << 12).try_for_each(|numbers| {
        let bytes: Vec<u8> = numbers.iter().flat_map(|&number| bytes_of(number)).collect();
        out.write_all(&bytes)
    })
}
