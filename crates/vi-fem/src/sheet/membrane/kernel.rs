//! The kernel of all membranes. For eight triangles at a time it maps x to F and strain, and the response of the law
//! to energies, forces and Hessians.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};
use vi_core::{PatchArray, packed_len};

use crate::lanes::pack::{GROUP, Pack, members, parts};
use crate::lanes::places::{add_to_places, gather_places};
use crate::lanes::real::{Lane, Real};
use crate::lanes::transpose::{gather, put};
use crate::sheet::material::{SheetMaterial, SheetResponse};
use crate::sheet::triangle::Frame;
use crate::small::tensor::{dot, mat3, packed_index, vec3};

/// Eight triangles at rest.
#[derive(Clone, Copy, Default)]
pub(super) struct RestPack {
    /// Gradients of the barycentric coordinates of the second and third corner in the frame of the triangle, 1/m.
    pub(super) gradients: [[Pack; 2]; 2],
    /// Area × thickness, m³.
    pub(super) volume: Pack,
}

pub(super) struct Membrane<M> {
    pub(super) arch: Arch,
    pub(super) material: M,
    pub(super) relaxed: bool,
    pub(super) rest: Vec<RestPack>,
    pub(super) frames: Vec<Frame>,
    /// Node numbers of whole groups, three per triangle.
    pub(super) nodes: Vec<u32>,
    pub(super) cells: Vec<u32>,
    /// Weight of mean deformations, Pa.
    pub(super) weight: f64,
    pub(super) name: String,
}

/// Deformed triangles of a group: F by columns, and its strain.
pub(super) struct Deformed<R> {
    pub(super) f: [[R; 3]; 2],
    strain: [R; 3],
}

impl<R: Real> Deformed<R> {
    /// Computes F from the sides of a triangle, so that round-off does not grow with the distance from the origin.
    #[inline(always)]
    fn new(u: [R; 3], v: [R; 3], g: [[R; 2]; 2]) -> Self {
        let f = [
            vec3!(i => u[i].mul_add(g[0][0], v[i] * g[1][0])),
            vec3!(i => u[i].mul_add(g[0][1], v[i] * g[1][1])),
        ];
        let strain = [(dot(f[0], f[0]) - 1.0) * 0.5, (dot(f[1], f[1]) - 1.0) * 0.5, dot(f[0], f[1])];
        Self { f, strain }
    }
}

impl<M: SheetMaterial> Membrane<M> {
    #[inline(always)]
    fn gradients_of<S: Simd>(&self, simd: S, group: usize, part: usize) -> [[Lane<S>; 2]; 2] {
        let g = &self.rest[group].gradients;
        [
            [g[0][0].load(simd, part), g[0][1].load(simd, part)],
            [g[1][0].load(simd, part), g[1][1].load(simd, part)],
        ]
    }

    #[inline(always)]
    fn deform<S: Simd>(&self, simd: S, group: usize, part: usize, x: &[f64]) -> Deformed<Lane<S>> {
        let nodes = &self.nodes[3 * (group * GROUP + part * S::F64_LANES)..];
        let corners = vec3!(k => gather(simd, x, &nodes[k..], 3));
        self.deformed(simd, group, part, &corners)
    }

    #[inline(always)]
    fn deformed<S: Simd>(
        &self,
        simd: S,
        group: usize,
        part: usize,
        [a, b, c]: &[[Lane<S>; 3]; 3],
    ) -> Deformed<Lane<S>> {
        let g = self.gradients_of(simd, group, part);
        Deformed::new(vec3!(i => b[i] - a[i]), vec3!(i => c[i] - a[i]), g)
    }

    /// Returns the forces on the second and third corner, N; that on the first is minus their sum.
    #[inline(always)]
    fn forces<S: Simd>(
        &self,
        simd: S,
        group: usize,
        part: usize,
        Deformed { f, strain }: &Deformed<Lane<S>>,
    ) -> [[Lane<S>; 3]; 2] {
        let volume = self.rest[group].volume.load(simd, part);
        let stress = self.respond(simd, strain).stress;
        let [s11, s22, s12] = vec3!(k => stress[k] * volume);
        let g = self.gradients_of(simd, group, part);
        let p = [vec3!(i => f[0][i] * s11 + f[1][i] * s12), vec3!(i => f[0][i] * s12 + f[1][i] * s22)];
        [vec3!(i => p[0][i] * g[0][0] + p[1][i] * g[0][1]), vec3!(i => p[0][i] * g[1][0] + p[1][i] * g[1][1])]
    }

    #[inline(always)]
    fn respond<S: Simd>(&self, simd: S, strain: &[Lane<S>; 3]) -> SheetResponse<Lane<S>> {
        if self.relaxed {
            lane_by_lane(simd, strain, |strain| self.material.relaxed(&strain))
        } else {
            self.material.response(strain)
        }
    }

    /// Evaluates one triangle by itself.
    pub(super) fn scalar(&self, triangle: usize, x: &[f64]) -> (Deformed<f64>, SheetResponse) {
        let rest = &self.rest[triangle / GROUP];
        let g = rest.gradients.map(|g| g.map(|pack| pack.0[triangle % GROUP]));
        let [a, b, c] = [0, 1, 2].map(|k| {
            let first = 3 * self.nodes[3 * triangle + k] as usize;
            [x[first], x[first + 1], x[first + 2]]
        });
        let deformed = Deformed::new([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]), g);
        let response = if self.relaxed {
            self.material.relaxed(&deformed.strain)
        } else {
            self.material.response(&deformed.strain)
        };
        (deformed, response)
    }

    /// Writes the Hessians of a range, projected or not.
    pub(super) fn blocks(&self, range: Range<usize>, x: &[f64], is_projected: bool, out: &mut [f64]) {
        self.arch.dispatch(Hessians { membrane: self, range, x, is_projected, out });
    }
}

/// Evaluates lane by lane a response that is defined for single numbers only.
#[inline(always)]
fn lane_by_lane<S: Simd>(
    simd: S,
    strain: &[Lane<S>; 3],
    response: impl Fn([f64; 3]) -> SheetResponse,
) -> SheetResponse<Lane<S>> {
    let mut strains = [Pack::default(); 3];
    for k in 0..3 {
        strains[k].store(0, strain[k]);
    }
    let mut packs = [Pack::default(); 13];
    for lane in 0..S::F64_LANES {
        let SheetResponse { energy, stress, tangent } = response(strains.map(|pack| pack.0[lane]));
        packs[0].0[lane] = energy;
        for k in 0..3 {
            packs[1 + k].0[lane] = stress[k];
            for l in 0..3 {
                packs[4 + 3 * k + l].0[lane] = tangent[k][l];
            }
        }
    }
    SheetResponse {
        energy: packs[0].load(simd, 0),
        stress: vec3!(k => packs[1 + k].load(simd, 0)),
        tangent: mat3!(k l => packs[4 + 3 * k + l].load(simd, 0)),
    }
}

fn groups(range: &Range<usize>) -> Range<usize> {
    range.start / GROUP..range.end.div_ceil(GROUP)
}

pub(super) struct Energies<'a, M> {
    pub(super) membrane: &'a Membrane<M>,
    pub(super) range: Range<usize>,
    pub(super) x: &'a [f64],
    pub(super) out: &'a mut [f64],
}

impl<M: SheetMaterial> WithSimd for Energies<'_, M> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { membrane, range, x, out } = self;
        for group in groups(&range) {
            let mut energy = [Pack::default()];
            for part in 0..parts::<S>() {
                let Deformed { strain, .. } = membrane.deform(simd, group, part, x);
                let density = membrane.respond(simd, &strain).energy;
                energy[0].store(part, density * membrane.rest[group].volume.load(simd, part));
            }
            put(simd, &energy, members(group), &range, out);
        }
    }
}

pub(super) struct Gradients<'a, M> {
    pub(super) membrane: &'a Membrane<M>,
    pub(super) range: Range<usize>,
    pub(super) x: &'a [f64],
    pub(super) out: &'a mut [f64],
}

impl<M: SheetMaterial> WithSimd for Gradients<'_, M> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { membrane, range, x, out } = self;
        let mut local = [Pack::default(); 9];
        for group in groups(&range) {
            for part in 0..parts::<S>() {
                let deformed = membrane.deform(simd, group, part, x);
                let [second, third] = membrane.forces(simd, group, part, &deformed);
                for i in 0..3 {
                    local[i].store(part, -(second[i] + third[i]));
                    local[3 + i].store(part, second[i]);
                    local[6 + i].store(part, third[i]);
                }
            }
            put(simd, &local, members(group), &range, out);
        }
    }
}

/// Adds the forces of whole groups to the sums of a patch; `places` holds three per triangle.
pub(super) struct PatchForces<'a, M> {
    pub(super) membrane: &'a Membrane<M>,
    pub(super) groups: Range<usize>,
    pub(super) places: &'a [u16],
    pub(super) x: &'a PatchArray,
    pub(super) sums: &'a mut PatchArray,
}

impl<M: SheetMaterial> WithSimd for PatchForces<'_, M> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { membrane, groups, places, x, sums } = self;
        for (group, places) in groups.zip(places.chunks_exact(3 * GROUP)) {
            for part in 0..parts::<S>() {
                let places = &places[3 * part * S::F64_LANES..];
                let corners = vec3!(k => gather_places(simd, x, &places[k..], 3));
                let deformed = membrane.deformed(simd, group, part, &corners);
                let [second, third] = membrane.forces(simd, group, part, &deformed);
                add_to_places(simd, vec3!(i => -(second[i] + third[i])), places, 3, sums);
                add_to_places(simd, second, &places[1..], 3, sums);
                add_to_places(simd, third, &places[2..], 3, sums);
            }
        }
    }
}

struct Hessians<'a, M> {
    membrane: &'a Membrane<M>,
    range: Range<usize>,
    x: &'a [f64],
    is_projected: bool,
    out: &'a mut [f64],
}

impl<M: SheetMaterial> WithSimd for Hessians<'_, M> {
    type Output = ();
    /// Writes A h [∂²W/∂e² applied to ∂e/∂x on both sides + S applied to the gradients of the nodes]. The projection
    /// makes each of the two parts positive semidefinite by itself, in closed form: the tangent as a 3 × 3 matrix,
    /// the stress as a 2 × 2 matrix. The result is positive semidefinite, but not always the nearest such matrix.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { membrane, range, x, is_projected, out } = self;
        let mut local = [Pack::default(); packed_len(9)];
        for group in groups(&range) {
            for part in 0..parts::<S>() {
                let Deformed { f, strain } = membrane.deform(simd, group, part, x);
                let response = if is_projected {
                    lane_by_lane(simd, &strain, |strain| membrane.projected(strain))
                } else {
                    membrane.respond(simd, &strain)
                };
                let volume = membrane.rest[group].volume.load(simd, part);
                let [s11, s22, s12] = vec3!(k => response.stress[k] * volume);
                let tangent = mat3!(k l => response.tangent[k][l] * volume);
                let h = membrane.gradients_of(simd, group, part);
                let g = [[-(h[0][0] + h[1][0]), -(h[0][1] + h[1][1])], h[0], h[1]];
                // ∂e/∂x for each local coordinate.
                let mut strains = [[volume; 3]; 9];
                for a in 0..3 {
                    for i in 0..3 {
                        let (along, across) = (f[0][i] * g[a][0], f[1][i] * g[a][1]);
                        strains[3 * a + i] = [along, across, f[0][i] * g[a][1] + f[1][i] * g[a][0]];
                    }
                }
                for row in 0..9 {
                    let stress = vec3!(k => dot(tangent[k], strains[row]));
                    let (a, i) = (row / 3, row % 3);
                    let pull = [s11 * g[a][0] + s12 * g[a][1], s12 * g[a][0] + s22 * g[a][1]];
                    for column in 0..=row {
                        let b = column / 3;
                        let mut entry = dot(stress, strains[column]);
                        if i == column % 3 {
                            entry = pull[0].mul_add(g[b][0], pull[1].mul_add(g[b][1], entry));
                        }
                        local[packed_index(row, column)].store(part, entry);
                    }
                }
            }
            put(simd, &local, members(group), &range, out);
        }
    }
}

impl<M: SheetMaterial> Membrane<M> {
    fn projected(&self, strain: [f64; 3]) -> SheetResponse {
        let mut response =
            if self.relaxed { self.material.relaxed(&strain) } else { self.material.response(&strain) };
        response.stress = positive_stress(response.stress);
        response.tangent = positive_tangent(response.tangent);
        response
    }
}

/// Returns a symmetric 2 × 2 matrix (s₁₁, s₂₂, s₁₂) with its negative eigenvalues set to zero.
fn positive_stress([s11, s22, s12]: [f64; 3]) -> [f64; 3] {
    let (mean, half) = (0.5 * (s11 + s22), 0.5 * (s11 - s22));
    let radius = half.hypot(s12);
    if mean >= radius {
        return [s11, s22, s12];
    }
    let largest = mean + radius;
    if largest.is_nan() || largest <= 0.0 {
        return [0.0; 3];
    }
    // ½ (I + deviator/radius) projects onto the eigenvector of the larger eigenvalue.
    let factor = 0.5 * largest / radius;
    [factor * (radius + half), factor * (radius - half), factor * s12]
}

/// Returns a symmetric 3 × 3 matrix with its negative eigenvalues set to zero.
fn positive_tangent(tangent: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let matrix = nalgebra::Matrix3::from_fn(|i, j| tangent[i][j]);
    if matrix.iter().any(|value| !value.is_finite()) {
        return tangent;
    }
    let eigen = matrix.symmetric_eigen();
    let scaled =
        eigen.eigenvectors * nalgebra::Matrix3::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0)));
    let positive = scaled * eigen.eigenvectors.transpose();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| 0.5 * (positive[(i, j)] + positive[(j, i)])))
}
