//! The kick and drift coefficients of the explicit schemes. They are derived from interpolation × quadrature if the
//! scheme is of that form.
//!
//! Otherwise they are from S. Blanes, P.C. Moan, "Practical symplectic partitioned Runge–Kutta and
//! Runge–Kutta–Nyström methods", J. Comput. Appl. Math. 142 (2002) 313–330, Table 3: SRKN₆ᵇ (order 4) and SRKN₁₁ᵇ
//! (order 6).

use vi_core::Scheme;

/// Kick and drift coefficients in units of h, with one kick more than drifts.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Splitting {
    pub(crate) kicks: Vec<f64>,
    pub(crate) drifts: Vec<f64>,
}

impl Splitting {
    /// Returns the coefficients of a scheme with a linear trajectory and a quadrature with nodes only at the ends of
    /// the step; `None` for other schemes.
    ///
    /// With the weights b₀ and b₁ of the two ends, L_d = h T((q₁ − q₀)/h) − h (b₀ V(q₀) + b₁ V(q₁)). Its Legendre
    /// transforms are p₀ = M(q₁ − q₀)/h + h b₀ ∇V(q₀) and p₁ = M(q₁ − q₀)/h − h b₁ ∇V(q₁): kick b₀ h, drift h, kick
    /// b₁ h (Marsden & West 2001, §2.6).
    pub(crate) fn of(scheme: &Scheme) -> Option<Self> {
        let quadrature = &scheme.quadrature;
        let weight_at = |end: f64| {
            let place = quadrature.nodes().iter().position(|&node| node == end);
            place.map_or(0.0, |place| quadrature.weights()[place])
        };
        scheme.is_explicit().then(|| Self { kicks: vec![weight_at(0.0), weight_at(1.0)], drifts: vec![1.0] })
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
