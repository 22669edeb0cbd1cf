//! The kicks and drifts of the explicit schemes. It must not know how they are made.
//!
//! Marsden & West 2001 §2.6 for Euler and Störmer–Verlet; S. Blanes, P.C. Moan,
//! "Practical symplectic partitioned Runge–Kutta and Runge–Kutta–Nyström methods", J. Comput. Appl.
//! Math. 142 (2002) 313–330, Table 3, for SRKN₆ᵇ (order 4) and SRKN₁₁ᵇ (order 6).

/// Kick and drift coefficients, in units of h; one kick more than drifts.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Coefficients {
    pub(crate) kicks: Vec<f64>,
    pub(crate) drifts: Vec<f64>,
}

impl Coefficients {
    pub(crate) fn symplectic_euler_a() -> Self {
        Self { kicks: vec![1.0, 0.0], drifts: vec![1.0] }
    }

    pub(crate) fn symplectic_euler_b() -> Self {
        Self { kicks: vec![0.0, 1.0], drifts: vec![1.0] }
    }

    pub(crate) fn stormer_verlet() -> Self {
        Self { kicks: vec![0.5, 0.5], drifts: vec![1.0] }
    }

    pub(crate) fn blanes_moan_4() -> Self {
        let b = [0.082_984_406_417_405_2, 0.396_309_801_498_368, -0.039_056_304_922_348_6];
        let a = [0.245_298_957_184_271, 0.604_872_665_711_080];
        let a3 = 0.5 - (a[0] + a[1]);
        let b4 = 1.0 - 2.0 * (b[0] + b[1] + b[2]);
        Self {
            kicks: vec![b[0], b[1], b[2], b4, b[2], b[1], b[0]],
            drifts: vec![a[0], a[1], a3, a3, a[1], a[0]],
        }
    }

    pub(crate) fn blanes_moan_6() -> Self {
        let mut b = vec![
            0.041_464_998_518_262_4,
            0.198_128_671_918_067,
            -0.040_006_192_104_153_3,
            0.075_253_984_301_580_7,
            -0.011_511_387_420_687_9,
        ];
        let a = [
            0.123_229_775_946_271,
            0.290_553_797_799_558,
            -0.127_049_212_625_417,
            -0.246_331_761_062_075,
            0.357_208_872_795_928,
        ];
        b.push(0.5 - b.iter().sum::<f64>());
        let middle = 1.0 - 2.0 * a.iter().sum::<f64>();
        let kicks = b.iter().chain(b.iter().rev()).copied().collect();
        let drifts = a.iter().chain([&middle]).chain(a.iter().rev()).copied().collect();
        Self { kicks, drifts }
    }
}

#[cfg(test)]
mod tests {
    use super::Coefficients;
    use crate::Method;

    /// The smallest z = hω at which the trace of the step's 2 × 2 matrix on the oscillator leaves
    /// ±2, by a scan: the first gap of stability of the high orders near z = π is narrow.
    fn first_gap(scheme: &Coefficients) -> f64 {
        let trace = |z: f64| {
            // (q, p) in units where ω = 1 and h = z.
            let column = |mut q: f64, mut p: f64| {
                for i in 0..scheme.kicks.len() {
                    p -= scheme.kicks[i] * z * q;
                    q += scheme.drifts.get(i).unwrap_or(&0.0) * z * p;
                }
                (q, p)
            };
            column(1.0, 0.0).0 + column(0.0, 1.0).1
        };
        (1..).map(|k| 5e-5 * f64::from(k)).find(|&z| trace(z).abs() > 2.0 + 1e-12).unwrap()
    }

    #[test]
    fn stability_limits_of_the_table_are_the_first_gaps() {
        for (method, scheme) in [
            (Method::SymplecticEulerA, Coefficients::symplectic_euler_a()),
            (Method::SymplecticEulerB, Coefficients::symplectic_euler_b()),
            (Method::StormerVerlet, Coefficients::stormer_verlet()),
            (Method::BlanesMoan4, Coefficients::blanes_moan_4()),
            (Method::BlanesMoan6, Coefficients::blanes_moan_6()),
        ] {
            let facts = method.facts();
            let (stated, found) = (facts.stability_limit.unwrap(), first_gap(&scheme));
            assert!(stated <= found && stated > found - 2e-4, "{}: {stated} {found}", facts.name);
            assert!(facts.recommended_limit.unwrap() < stated);
        }
    }
}
