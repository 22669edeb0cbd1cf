//! The rigid motions of an aggregate, as an orthonormal basis.

use crate::index::NONE;
use crate::linear::matrix::Pattern;

/// Length of the part of a motion that is independent of the others, relative to the motion, below which the motion counts as
/// dependent; for example, a turn of collinear nodes about their line.
const DEPENDENT: f64 = 1e-3;

/// Returns the number of rigid motions of nodes with `block` coordinates: translations and turns.
pub(super) fn count(block: usize) -> usize {
    block * (block + 1) / 2
}

/// Writes the motions of the coordinates of `rows` to `motions` (per row `B` × `M` numbers), with zeros at prescribed
/// coordinates and in motions that depend on the others. Returns which motions are dependent.
///
/// The turns are those of the node positions about the centre of the aggregate. A prescribed coordinate counts as lying at the
/// centre.
pub(super) fn write<const B: usize, const M: usize>(
    pattern: &Pattern,
    rows: &[u32],
    positions: &[f64],
    motions: &mut [[f64; M]],
) -> [bool; M] {
    let position = |row: u32, k: usize| match pattern.free_of[row as usize * B + k] {
        NONE => None,
        free => Some(positions[free as usize]),
    };
    let centre: [f64; B] = std::array::from_fn(|k| {
        let (mut sum, mut count) = (0.0, 0);
        for position in rows.iter().filter_map(|&row| position(row, k)) {
            sum += position;
            count += 1;
        }
        sum / f64::from(count.max(1))
    });
    for &row in rows {
        let arm: [f64; B] = std::array::from_fn(|k| position(row, k).map_or(0.0, |x| x - centre[k]));
        for i in 0..B {
            let motion = &mut motions[row as usize * B + i];
            *motion = [0.0; M];
            if position(row, i).is_some() {
                motion[i] = 1.0;
                turns(i, &arm, &mut motion[B..]);
            }
        }
    }
    make_orthonormal::<B, M>(rows, motions)
}

/// Writes the velocity of coordinate `i` at `arm` under a unit turn in each coordinate plane.
fn turns<const B: usize>(i: usize, arm: &[f64; B], out: &mut [f64]) {
    let planes = (0..B).flat_map(|p| (p + 1..B).map(move |q| (p, q)));
    for (out, (p, q)) in out.iter_mut().zip(planes) {
        if i == p {
            *out = -arm[q];
        } else if i == q {
            *out = arm[p];
        }
    }
}

/// Replaces the motions Z by Z L⁻ᵀ with the Cholesky factor L of ZᵀZ. Sets dependent motions to zero, and returns which
/// they are.
fn make_orthonormal<const B: usize, const M: usize>(rows: &[u32], motions: &mut [[f64; M]]) -> [bool; M] {
    let coordinates = || rows.iter().flat_map(|&row| row as usize * B..(row as usize + 1) * B);
    let mut gram = [[0.0; M]; M];
    for coordinate in coordinates() {
        let motion = &motions[coordinate];
        for m in 0..M {
            for n in 0..=m {
                gram[m][n] += motion[m] * motion[n];
            }
        }
    }
    let mut l = [[0.0; M]; M];
    let mut dependent = [false; M];
    for j in 0..M {
        let pivot = gram[j][j] - (0..j).map(|k| l[j][k] * l[j][k]).sum::<f64>();
        dependent[j] = pivot <= DEPENDENT * DEPENDENT * gram[j][j];
        if dependent[j] {
            continue;
        }
        l[j][j] = pivot.sqrt();
        for i in j + 1..M {
            l[i][j] = (gram[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>()) / l[j][j];
        }
    }
    for coordinate in coordinates() {
        let motion = &mut motions[coordinate];
        for m in 0..M {
            let others: f64 = (0..m).map(|k| l[m][k] * motion[k]).sum();
            motion[m] = if dependent[m] { 0.0 } else { (motion[m] - others) / l[m][m] };
        }
    }
    dependent
}
