//! Orders the parts of surfaces so that neighbours follow each other: body by body, along a curve through space (Morton
//! 1966) at rest. Neighbours in a mesh stay near each other while it moves, so that trees of boxes can be built in this order
//! without sorting again.

use crate::distance::Vec3;

/// Returns the numbers of parts in this order, given the body and the centre of each.
pub(super) fn order(parts: impl Iterator<Item = (u32, Vec3)>) -> Vec<u32> {
    let parts: Vec<(u32, Vec3)> = parts.collect();
    let low = parts.iter().fold(Vec3::repeat(f64::INFINITY), |low, (_, x)| low.inf(x));
    let high = parts.iter().fold(Vec3::repeat(f64::NEG_INFINITY), |high, (_, x)| high.sup(x));
    let code = |(&(body, x), part): (&(u32, Vec3), u32)| (body, morton(&x, &low, &high), part);
    let mut codes: Vec<(u32, u64, u32)> = parts.iter().zip(0..).map(code).collect();
    codes.sort_unstable();
    codes.into_iter().map(|(_, _, part)| part).collect()
}

/// Returns 21 bits of each coordinate in the box from `low` to `high`, interleaved.
fn morton(x: &Vec3, low: &Vec3, high: &Vec3) -> u64 {
    let mut code = 0;
    for k in 0..3 {
        let size = high[k] - low[k];
        let unit = if size > 0.0 { ((x[k] - low[k]) / size).clamp(0.0, 1.0) } else { 0.0 };
        code |= spread((unit * 2_097_151.0) as u64) << k;
    }
    code
}

/// Inserts two zero bits between the bits of a number below 2²¹.
fn spread(mut bits: u64) -> u64 {
    bits = (bits | (bits << 32)) & 0x1f_0000_0000_ffff;
    bits = (bits | (bits << 16)) & 0x1f_0000_ff00_00ff;
    bits = (bits | (bits << 8)) & 0x100f_00f0_0f00_f00f;
    bits = (bits | (bits << 4)) & 0x10c3_0c30_c30c_30c3;
    (bits | (bits << 2)) & 0x1249_2492_4924_9249
}
