//! Quadrature rules on reference cells.

/// Two Gauss points on [−1, 1], exact to degree 3.
pub(super) const GAUSS_2: [(f64, f64); 2] = [(-0.577_350_269_189_625_8, 1.0), (0.577_350_269_189_625_8, 1.0)];

/// Three Gauss points on [−1, 1], exact to degree 5.
pub(super) const GAUSS_3: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

/// Three points on the triangle (0,0) (1,0) (0,1), exact to degree 2 (Strang & Fix 1973).
pub(super) const TRIANGLE_3: [([f64; 2], f64); 3] = [
    ([1.0 / 6.0, 1.0 / 6.0], 1.0 / 6.0),
    ([2.0 / 3.0, 1.0 / 6.0], 1.0 / 6.0),
    ([1.0 / 6.0, 2.0 / 3.0], 1.0 / 6.0),
];

const A: f64 = 0.445_948_490_915_964_9;
const B: f64 = 0.091_576_213_509_770_74;
const WA: f64 = 0.5 * 0.223_381_589_678_011_47;
const WB: f64 = 0.5 * 0.109_951_743_655_321_87;

/// Six points on the triangle, exact to degree 4 (Dunavant 1985).
pub(super) const TRIANGLE_6: [([f64; 2], f64); 6] = [
    ([A, A], WA),
    ([1.0 - 2.0 * A, A], WA),
    ([A, 1.0 - 2.0 * A], WA),
    ([B, B], WB),
    ([1.0 - 2.0 * B, B], WB),
    ([B, 1.0 - 2.0 * B], WB),
];

/// Returns the product rule on [−1, 1]³ of a rule on [−1, 1]; x varies fastest.
pub(super) fn cube<const P: usize, const Q: usize>(rule: [(f64, f64); P]) -> [([f64; 3], f64); Q] {
    debug_assert_eq!(P * P * P, Q);
    std::array::from_fn(|q| {
        let [x, y, z] = [rule[q % P], rule[q / P % P], rule[q / (P * P)]];
        ([x.0, y.0, z.0], x.1 * y.1 * z.1)
    })
}

/// Returns the product of a rule on the triangle with a rule on [−1, 1], mapped to ζ ∈ [0, 1].
pub(super) fn prism<const T: usize, const P: usize, const Q: usize>(
    triangle: [([f64; 2], f64); T],
    line: [(f64, f64); P],
) -> [([f64; 3], f64); Q] {
    debug_assert_eq!(T * P, Q);
    std::array::from_fn(|q| {
        let ((xy, area), (z, length)) = (triangle[q % T], line[q / T]);
        ([xy[0], xy[1], 0.5 * (1.0 + z)], area * 0.5 * length)
    })
}
