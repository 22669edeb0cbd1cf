//! Mean dilation at the quadrature points of a group of elements, in SIMD lanes.
//!
//! With J = det F, G = F⁻ᵀ, s = (θ/J)^⅓, F̄ = s F, and the law's stress P and tangent C at F̄: τ = ⅓ P:F̄ = θ ∂Ψ/∂θ,
//! ∂Ψ/∂F = s P − τ G at fixed θ, D = C:F̄ and d = F̄:D. The linearised map is the same algebra at F = I (s = J = θ =
//! 1, G = F̄ = I), without stress in the curvature.

use pulp::{Arch, Simd, WithSimd};

use crate::lanes::pack::{GROUP, Pack, parts};
use crate::lanes::real::{Lane, Real};
use crate::small::tensor::{Mat3, Tangent, cofactor, contract, determinant, mat3, symmetric_index};
use crate::solid::elastic::POINTS;
use crate::solid::material::batch::{PackedMat3, PackedTangent, load_mat3, store_mat3};

/// The mean dilation θ of each element of a group, and the scale s at each point.
#[derive(Default)]
pub(super) struct Dilation {
    theta: Pack,
    /// Volume at rest, m³.
    volume: Pack,
    /// s = (θ/J)^⅓; for the linearised map the shift ⅓ (θ − tr F).
    scales: Vec<Pack>,
}

/// Input and output of the curvature at fixed θ.
pub(super) struct Curvature<'a> {
    pub(super) deformations: &'a [PackedMat3],
    pub(super) adjusted: &'a [PackedMat3],
    /// P at F̄ as input, ∂²Ψ/∂F∂θ as output.
    pub(super) stresses: &'a mut [PackedMat3],
    /// C at F̄ as input; as output ∂²Ψ/∂F∂F at fixed θ plus the contribution of ∂²θ/∂F∂F.
    pub(super) tangents: &'a mut [PackedTangent],
    /// Output: ∂θ/∂F over the quadrature volume, cof F/V.
    pub(super) slopes: &'a mut [PackedMat3],
}

impl Dilation {
    /// Computes θ and s from F at the points, whose volumes are w det J.
    pub(super) fn find<'a>(
        &mut self,
        arch: Arch,
        is_linear: bool,
        deformations: &[PackedMat3],
        volumes: impl Iterator<Item = &'a Pack>,
    ) {
        self.scales.resize(deformations.len(), Pack::default());
        arch.dispatch(Measures { is_linear, deformations, out: &mut self.scales });
        let (mut theta, mut whole) = ([0.0; GROUP], [0.0; GROUP]);
        for (volume, measure) in volumes.zip(&self.scales) {
            for lane in 0..GROUP {
                theta[lane] += volume.0[lane] * measure.0[lane];
                whole[lane] += volume.0[lane];
            }
        }
        for lane in 0..GROUP {
            theta[lane] /= whole[lane];
        }
        (self.theta, self.volume) = (Pack(theta), Pack(whole));
        arch.dispatch(Scales { is_linear, theta: &self.theta, scales: &mut self.scales });
    }

    /// Computes F̄ from F.
    pub(super) fn adjust(
        &self,
        arch: Arch,
        is_linear: bool,
        deformations: &[PackedMat3],
        out: &mut [PackedMat3],
    ) {
        arch.dispatch(Adjust { is_linear, scales: &self.scales, deformations, out });
    }

    /// Converts P(F̄) to the stress that does work on δF: s P + (p − τ/J) cof F, where p is the mean of τ/θ.
    pub(super) fn pull_back<'a>(
        &self,
        arch: Arch,
        is_linear: bool,
        deformations: &[PackedMat3],
        volumes: impl Iterator<Item = &'a Pack> + Clone,
        stresses: &mut [PackedMat3],
    ) {
        let pressure = self.pressure(arch, is_linear, deformations, volumes, stresses);
        arch.dispatch(PullBack {
            is_linear,
            scales: &self.scales,
            pressure: &pressure,
            deformations,
            stresses,
        });
    }

    /// Computes the curvatures; returns κ = Σ w ∂²Ψ/∂θ² (J) of each element.
    pub(super) fn curve<'a>(
        &self,
        arch: Arch,
        is_linear: bool,
        mut at: Curvature,
        volumes: impl Iterator<Item = &'a Pack> + Clone,
    ) -> Pack {
        let pressure = self.pressure(arch, is_linear, at.deformations, volumes.clone(), at.stresses);
        let mut curvatures = [Pack::default(); POINTS];
        let curvatures = &mut curvatures[..at.deformations.len()];
        arch.dispatch(Curve { is_linear, dilation: self, pressure: &pressure, at: &mut at, curvatures });
        let mut kappa = [0.0; GROUP];
        for (volume, curvature) in volumes.zip(curvatures.iter()) {
            for lane in 0..GROUP {
                kappa[lane] += volume.0[lane] * curvature.0[lane];
            }
        }
        Pack(kappa)
    }

    /// Returns p = Σ w τ/(V θ), the derivative of the energy by the volume of the element.
    fn pressure<'a>(
        &self,
        arch: Arch,
        is_linear: bool,
        deformations: &[PackedMat3],
        volumes: impl Iterator<Item = &'a Pack>,
        stresses: &[PackedMat3],
    ) -> Pack {
        let mut taus = [Pack::default(); POINTS];
        let taus = &mut taus[..deformations.len()];
        arch.dispatch(Taus { is_linear, scales: &self.scales, deformations, stresses, out: taus });
        let mut sum = [0.0; GROUP];
        for (volume, tau) in volumes.zip(taus.iter()) {
            for lane in 0..GROUP {
                sum[lane] += volume.0[lane] * tau.0[lane];
            }
        }
        for lane in 0..GROUP {
            sum[lane] /= self.volume.0[lane] * if is_linear { 1.0 } else { self.theta.0[lane] };
        }
        Pack(sum)
    }
}

#[inline(always)]
fn trace<R: Real>(a: &Mat3<R>) -> R {
    a[0][0] + a[1][1] + a[2][2]
}

#[inline(always)]
fn identity<R: Real>(like: R) -> Mat3<R> {
    mat3!(i j => like.constant(if i == j { 1.0 } else { 0.0 }))
}

/// Computes J, or tr F for the linearised map.
struct Measures<'a> {
    is_linear: bool,
    deformations: &'a [PackedMat3],
    out: &'a mut [Pack],
}

impl WithSimd for Measures<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (f, out) in self.deformations.iter().zip(self.out) {
            for part in 0..parts::<S>() {
                let f = load_mat3(simd, f, part);
                out.store(part, if self.is_linear { trace(&f) } else { determinant(&f) });
            }
        }
    }
}

/// Computes (θ/J)^⅓ from J, or ⅓ (θ − tr F) from tr F.
struct Scales<'a> {
    is_linear: bool,
    theta: &'a Pack,
    scales: &'a mut [Pack],
}

impl WithSimd for Scales<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for scale in self.scales {
            for part in 0..parts::<S>() {
                let (theta, measure) = (self.theta.load(simd, part), scale.load(simd, part));
                let outside = Lane::splat(simd, f64::NAN);
                scale.store(
                    part,
                    if self.is_linear {
                        (theta - measure) * (1.0 / 3.0)
                    } else {
                        measure.if_positive(theta.if_positive((theta / measure).cbrt(), outside), outside)
                    },
                );
            }
        }
    }
}

struct Adjust<'a> {
    is_linear: bool,
    scales: &'a [Pack],
    deformations: &'a [PackedMat3],
    out: &'a mut [PackedMat3],
}

impl WithSimd for Adjust<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for ((f, out), scale) in self.deformations.iter().zip(self.out).zip(self.scales) {
            for part in 0..parts::<S>() {
                let (f, scale) = (load_mat3(simd, f, part), scale.load(simd, part));
                let adjusted = if self.is_linear {
                    mat3!(i j => if i == j { f[i][j] + scale } else { f[i][j] })
                } else {
                    mat3!(i j => f[i][j] * scale)
                };
                store_mat3(out, part, &adjusted);
            }
        }
    }
}

/// Computes τ = ⅓ P:F̄, or ⅓ tr P for the linearised map.
struct Taus<'a> {
    is_linear: bool,
    scales: &'a [Pack],
    deformations: &'a [PackedMat3],
    stresses: &'a [PackedMat3],
    out: &'a mut [Pack],
}

impl WithSimd for Taus<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (q, out) in self.out.iter_mut().enumerate() {
            for part in 0..parts::<S>() {
                let p = load_mat3(simd, &self.stresses[q], part);
                let f = load_mat3(simd, &self.deformations[q], part);
                let work = if self.is_linear {
                    trace(&p)
                } else {
                    self.scales[q].load(simd, part) * contract(&p, &f)
                };
                out.store(part, work * (1.0 / 3.0));
            }
        }
    }
}

struct PullBack<'a> {
    is_linear: bool,
    scales: &'a [Pack],
    pressure: &'a Pack,
    deformations: &'a [PackedMat3],
    stresses: &'a mut [PackedMat3],
}

impl WithSimd for PullBack<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (q, stress) in self.stresses.iter_mut().enumerate() {
            for part in 0..parts::<S>() {
                let pressure = self.pressure.load(simd, part);
                let p = load_mat3(simd, stress, part);
                let pulled = if self.is_linear {
                    let excess = pressure - trace(&p) * (1.0 / 3.0);
                    mat3!(i j => if i == j { p[i][j] + excess } else { p[i][j] })
                } else {
                    let f = load_mat3(simd, &self.deformations[q], part);
                    let s = self.scales[q].load(simd, part);
                    let tau = s * contract(&p, &f) * (1.0 / 3.0);
                    let excess = pressure - tau / determinant(&f);
                    let cofactor = cofactor(&f);
                    mat3!(i j => s.mul_add(p[i][j], excess * cofactor[i][j]))
                };
                store_mat3(stress, part, &pulled);
            }
        }
    }
}

struct Curve<'a, 'b> {
    is_linear: bool,
    dilation: &'a Dilation,
    pressure: &'a Pack,
    at: &'a mut Curvature<'b>,
    curvatures: &'a mut [Pack],
}

impl WithSimd for Curve<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { is_linear, dilation, pressure, at, curvatures } = self;
        for (q, curvature) in curvatures.iter_mut().enumerate() {
            for part in 0..parts::<S>() {
                let one = Lane::splat(simd, 1.0);
                let mut c = Tangent([one; 45]);
                for k in 0..45 {
                    c.0[k] = at.tangents[q][k].load(simd, part);
                }
                let f = load_mat3(simd, &at.deformations[q], part);
                let volume = dilation.volume.load(simd, part);
                // For the linearised map evaluate at F = I, without stress.
                let (s, theta, g, adjusted, p, cof) = if is_linear {
                    let zero = Lane::splat(simd, 0.0);
                    let eye = identity(one);
                    (one, one, eye, eye, mat3!(_i _j => zero), eye)
                } else {
                    let cof = cofactor(&f);
                    let inverse = one / determinant(&f);
                    (
                        dilation.scales[q].load(simd, part),
                        dilation.theta.load(simd, part),
                        mat3!(i j => cof[i][j] * inverse),
                        load_mat3(simd, &at.adjusted[q], part),
                        load_mat3(simd, &at.stresses[q], part),
                        cof,
                    )
                };
                // D = C:F̄ and d = F̄:D.
                let mut slope = mat3!(_i _j => Lane::splat(simd, 0.0));
                for row in 0..9 {
                    let mut sum = Lane::splat(simd, 0.0);
                    for column in 0..9 {
                        sum =
                            c.0[symmetric_index(row, column)].mul_add(adjusted[column / 3][column % 3], sum);
                    }
                    slope[row / 3][row % 3] = sum;
                }
                let second = contract(&adjusted, &slope);
                let tau = contract(&p, &adjusted) * (1.0 / 3.0);
                // ∂²Ψ/∂F∂F = s² C − (s/3)((D + P) ⊗ G + G ⊗ (D + P)) + (d/9 + 4τ/3) G ⊗ G + (p − τ/J) ∂²J/∂F∂F; the
                // term in p comes from ∂²θ/∂F∂F.
                let both = mat3!(i j => slope[i][j] + p[i][j]);
                let squared = s * s;
                for k in 0..45 {
                    c.0[k] = c.0[k] * squared;
                }
                c.add_product(s * (-1.0 / 3.0), &both, &g);
                c.add_square(second * (1.0 / 9.0) + tau * (4.0 / 3.0), &g);
                if !is_linear {
                    let excess = pressure.load(simd, part) - tau / determinant(&f);
                    c.add_cofactor_derivative(excess, &f);
                }
                for k in 0..45 {
                    at.tangents[q][k].store(part, c.0[k]);
                }
                // ∂²Ψ/∂F∂θ = s/(3θ) (P + D) − (d + 3τ)/(9θ) G and ∂²Ψ/∂θ² = (d − 6τ)/(9θ²).
                let (of_both, of_g) = (s / (theta * 3.0), (second + tau * 3.0) / (theta * 9.0));
                let mixed = mat3!(i j => of_both * both[i][j] - of_g * g[i][j]);
                store_mat3(&mut at.stresses[q], part, &mixed);
                curvature.store(part, (second - tau * 6.0) / (theta * theta * 9.0));
                store_mat3(&mut at.slopes[q], part, &mat3!(i j => cof[i][j] / volume));
            }
        }
    }
}
