//! GMRES (Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856–869) for systems whose matrix is close to the
//! identity, because they were preconditioned, and which need few products.

use crate::vectors;

/// Solves A x = b to ‖b − Ax‖ ≤ `tolerance` ‖b‖ from x = 0, with at most `most` products. `apply` returns A v, and may
/// fail. `dot` is the inner product of the norm. Returns x, which does not meet the tolerance if `most` products were not
/// enough, and their number.
pub(crate) fn solve<E>(
    mut apply: impl FnMut(&[f64]) -> Result<Vec<f64>, E>,
    dot: impl Fn(&[f64], &[f64]) -> f64,
    b: &[f64],
    tolerance: f64,
    most: usize,
) -> Result<(Vec<f64>, usize), E> {
    let norm = |v: &[f64]| dot(v, v).max(0.0).sqrt();
    let size = norm(b);
    let mut x = vec![0.0; b.len()];
    if size == 0.0 {
        return Ok((x, 0));
    }
    let mut basis: Vec<Vec<f64>> = vec![b.iter().map(|value| value / size).collect()];
    // Columns of the triangular factor of the Hessenberg matrix, the rotations that made it, and the rotated right side.
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let mut rotations: Vec<[f64; 2]> = Vec::new();
    let mut rhs = vec![size];
    for _ in 0..most {
        let mut image = apply(&basis[basis.len() - 1])?;
        let mut column = vec![0.0; basis.len()];
        // Orthogonalising twice is enough (Kahan, Parlett).
        for _ in 0..2 {
            for (entry, other) in column.iter_mut().zip(&basis) {
                let part = dot(other, &image);
                *entry += part;
                vectors::update(&mut image, |k, value| *value -= part * other[k]);
            }
        }
        let rest = norm(&image);
        for (row, &[cos, sin]) in rotations.iter().enumerate() {
            let (a, b) = (column[row], column[row + 1]);
            (column[row], column[row + 1]) = (cos * a + sin * b, cos * b - sin * a);
        }
        let last = columns.len();
        let length = column[last].hypot(rest);
        if length == 0.0 {
            break;
        }
        let [cos, sin] = [column[last] / length, rest / length];
        column[last] = length;
        let value = rhs[last];
        rhs[last] = cos * value;
        rhs.push(-sin * value);
        columns.push(column);
        rotations.push([cos, sin]);
        if rhs[last + 1].abs() <= tolerance * size || rest <= 1e-14 * size {
            break;
        }
        vectors::update(&mut image, |_, value| *value /= rest);
        basis.push(image);
    }
    for row in (0..columns.len()).rev() {
        let weight = rhs[row] / columns[row][row];
        rhs.iter_mut().zip(&columns[row]).take(row).for_each(|(value, entry)| *value -= weight * entry);
        vectors::update(&mut x, |k, value| *value += weight * basis[row][k]);
    }
    Ok((x, columns.len()))
}

#[cfg(test)]
mod tests {
    use crate::vectors::dot;

    /// In exact arithmetic, GMRES ends after one product more than the rank of A − I.
    #[test]
    fn a_perturbation_of_low_rank_needs_few_products() {
        let n = 60;
        let left = |j: usize, i: usize| ((3 * i + 7 * j) as f64).sin() * 10.0_f64.powi(j as i32);
        let right = |j: usize, i: usize| ((5 * i + 11 * j + 1) as f64).cos();
        let apply = |v: &[f64]| -> Result<Vec<f64>, ()> {
            let mut out = v.to_vec();
            for j in 0..4 {
                let along: f64 = (0..n).map(|i| right(j, i) * v[i]).sum();
                (0..n).for_each(|i| out[i] += left(j, i) * along);
            }
            Ok(out)
        };
        let b: Vec<f64> = (0..n).map(|i| 1.0 / (1.0 + i as f64)).collect();
        let (x, products) = super::solve(apply, dot, &b, 1e-10, 30).unwrap();
        let image = apply(&x).unwrap();
        let error = image.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        assert!(products <= 6 && error < 1e-9, "{products} {error:e}");
    }
}
