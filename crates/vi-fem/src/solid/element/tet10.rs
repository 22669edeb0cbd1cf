//! The quadratic tetrahedron.

use vi_mesh::CellKind;

use super::contract::Element;

/// The corners are those of `Tet4`; then follow the midpoints of the edges 01 12 20 03 13 23. With barycentric
/// coordinates b, N = b_a (2 b_a − 1) at corners and 4 b_a b_b on edges. The rule has four points and is exact to
/// degree 2.
#[derive(Debug, Clone, Copy)]
pub struct Tet10;

const SLOPES: [[f64; 3]; 4] = [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Element<10, 4> for Tet10 {
    const KIND: CellKind = CellKind::Tet10;
    const DEGREE: usize = 2;

    fn rule() -> [([f64; 3], f64); 4] {
        // (5 ± 3√5)/20 and (5 − √5)/20: Keast 1986, rule 2.
        let near = 0.138_196_601_125_010_5;
        let far = 1.0 - 3.0 * near;
        let weight = 1.0 / 24.0;
        [
            ([near, near, near], weight),
            ([far, near, near], weight),
            ([near, far, near], weight),
            ([near, near, far], weight),
        ]
    }

    /// Lumping needs degree 4: this rule has 14 points and is exact to degree 5 (Walkington 2000).
    fn mass_rule() -> Vec<([f64; 3], f64)> {
        let mut rule = Vec::new();
        for (near, weight) in [
            (0.310_885_919_263_300_6, 0.018_781_320_953_002_642),
            (0.092_735_250_310_891_23, 0.012_248_840_519_393_659),
        ] {
            let far = 1.0 - 3.0 * near;
            for xi in [[near; 3], [far, near, near], [near, far, near], [near, near, far]] {
                rule.push((xi, weight));
            }
        }
        let (a, b, weight) = (0.045_503_704_125_649_65, 0.454_496_295_874_350_35, 0.007_091_003_462_846_911);
        for xi in [[a, b, b], [b, a, b], [b, b, a], [b, a, a], [a, b, a], [a, a, b]] {
            rule.push((xi, weight));
        }
        rule
    }

    fn values([x, y, z]: [f64; 3]) -> [f64; 10] {
        let b = [1.0 - x - y - z, x, y, z];
        std::array::from_fn(|a| match a.checked_sub(4) {
            None => b[a] * (2.0 * b[a] - 1.0),
            Some(edge) => {
                let [p, q] = Self::KIND.edges()[edge];
                4.0 * b[p] * b[q]
            }
        })
    }

    fn gradients([x, y, z]: [f64; 3]) -> [[f64; 3]; 10] {
        let b = [1.0 - x - y - z, x, y, z];
        std::array::from_fn(|a| match a.checked_sub(4) {
            None => SLOPES[a].map(|slope| (4.0 * b[a] - 1.0) * slope),
            Some(edge) => {
                let [p, q] = Self::KIND.edges()[edge];
                [0, 1, 2].map(|i| 4.0 * (SLOPES[p][i] * b[q] + b[p] * SLOPES[q][i]))
            }
        })
    }
}
