//! The strain energy of elements that do not lock near incompressibility: each quadrature point takes the volume
//! change of its whole element.
//!
//! V = Σ_e Σ_q w_q Ψ(F̄_q) with F̄_q = (θ_e/J_q)^⅓ F_q and the mean dilation θ_e = Σ w_q J_q / Σ w_q (Nagtegaal,
//! Parks & Rice 1974; Simo, Taylor & Pister 1985, eliminated on the element). It is a potential, so its gradient and
//! symmetric Hessian are exact, and every integrator conserves what it conserves with plain elements. Laws that are
//! linear in ∂u/∂X use the linearised map F̄ = F + ⅓ (mean tr F − tr F) I, which is the B̄ of Hughes (1980), and stay
//! linear.

mod points;

use std::cell::RefCell;
use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_core::{Account, Fault, HessianKind, Potential, Stencils, Traits, packed_len};

use self::points::{Curvature, Dilation};
use crate::error::FemError;
use crate::lanes::instructions::InstructionSet;
use crate::lanes::pack::{GROUP, Pack};
use crate::solid::elastic::build::Build;
use crate::solid::elastic::{Storage, by_kind, farthest_outside, fault};
use crate::solid::element::contract::Element;
use crate::solid::element::kernel::Solids;
use crate::solid::law_kernels::{LawKernels, stiffness_weight};
use crate::solid::material::Law;
use crate::solid::material::batch::{PackedMat3, PackedTangent};
use crate::solid::material::contract::positive_determinant;
use vi_mesh::Mesh;

/// The measure against volumetric locking.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LockingCure {
    /// None: evaluate the law at every quadrature point.
    #[default]
    None,
    /// One dilation for each element, so that hex8 and wedge6 do not lock as ν approaches ½.
    MeanDilation,
}

/// Returns the potentials of [`crate::elastic`] with mean dilation, for nearly incompressible materials (ν up to
/// .4999 and beyond) in `hex8` and `wedge6`. Quadratic elements accept it too; they then have one volume ratio each,
/// as P2/P0 elements do, and are of lower order than without it. An element with one quadrature point (`tet4`) is
/// unchanged. Every law that is not linear then requires J = det F > 0.
///
/// # Errors
/// Returns the errors of [`crate::elastic`].
pub fn mean_dilation(
    mesh: &Mesh,
    elements: &[u32],
    law: &Law,
    node_offset: usize,
    name: &str,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    by_kind::<MeanDilation>((InstructionSet::Best, Storage::Whole), mesh, elements, law, node_offset, name)
}

/// Returns the potentials of [`mean_dilation`] as [`elastic_in_portions`](crate::elastic_in_portions) does those of
/// [`crate::elastic`].
///
/// # Errors
/// Returns the errors of [`crate::elastic_in_portions`].
pub fn mean_dilation_in_portions(
    mesh: &Mesh,
    elements: &[u32],
    law: &Law,
    node_offset: usize,
    name: &str,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    by_kind::<MeanDilation>((InstructionSet::Best, Storage::Portions), mesh, elements, law, node_offset, name)
}

/// Builds the potential with mean dilation.
pub(crate) struct MeanDilation;

impl Build for MeanDilation {
    fn build<E: Element<N, Q>, const N: usize, const Q: usize>(
        solids: Solids<E, N, Q>,
        law: Box<dyn LawKernels>,
        elements: Vec<u32>,
        name: String,
    ) -> Box<dyn Potential> {
        let weight = stiffness_weight(law.as_ref());
        Box::new(MeanDilationPotential { solids, law, elements, weight, name })
    }
}

/// The potential V = Σ_e Σ_q w_q Ψ(F̄_q), one stencil per element.
struct MeanDilationPotential<E, const N: usize, const Q: usize> {
    solids: Solids<E, N, Q>,
    law: Box<dyn LawKernels>,
    /// The caller's number of each element.
    elements: Vec<u32>,
    /// Weight of mean deformations, Pa.
    weight: f64,
    name: String,
}

/// Scratch memory for one group; each thread allocates it once.
#[derive(Default)]
struct Scratch {
    /// F at the quadrature points.
    deformations: Vec<PackedMat3>,
    /// F̄ at the quadrature points.
    adjusted: Vec<PackedMat3>,
    /// P(F̄), then the stress from which the forces are computed.
    stresses: Vec<PackedMat3>,
    /// ∂θ/∂F at the quadrature points, divided by the element's volume.
    slopes: Vec<PackedMat3>,
    dilation: Dilation,
    tangents: Vec<PackedTangent>,
    block: Vec<Pack>,
    /// ∂θ/∂x and ∂²V/∂x∂θ, 3N per element.
    nodal_slopes: Vec<f64>,
    nodal_mixed: Vec<f64>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> MeanDilationPotential<E, N, Q> {
    /// Runs `work` on each group that overlaps `range`, with the group's number, its elements in the range, and
    /// scratch memory that holds F, θ and F̄.
    fn in_groups(
        &self,
        range: &Range<usize>,
        x: &[f64],
        mut work: impl FnMut(usize, Range<usize>, &mut Scratch),
    ) {
        let is_linear = self.law.is_linear();
        SCRATCH.with_borrow_mut(|scratch| {
            let empty = [Pack::default(); 9];
            scratch.deformations.resize(Q, empty);
            scratch.adjusted.resize(Q, empty);
            for group in range.start / GROUP..range.end.div_ceil(GROUP) {
                let first = group * GROUP;
                let part = range.start.max(first)..range.end.min(first + GROUP);
                self.solids.deformations(group..group + 1, x, &mut scratch.deformations);
                let arch = self.solids.arch();
                scratch.dilation.find(arch, is_linear, &scratch.deformations, self.solids.volumes(group));
                scratch.dilation.adjust(arch, is_linear, &scratch.deformations, &mut scratch.adjusted);
                work(group, part, scratch);
            }
        });
    }
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> Potential for MeanDilationPotential<E, N, Q> {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: N, block: 3, nodes: self.solids.nodes() }
    }

    fn traits(&self) -> Traits {
        let hessian = if self.law.is_linear() { HessianKind::Constant } else { HessianKind::Varying };
        Traits { hessian, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.in_groups(&range, x, |group, part, scratch| {
            scratch.block.resize(Q.max(scratch.block.len()), Pack::default());
            let densities = &mut scratch.block[..Q];
            self.law.energies(self.solids.arch(), &scratch.adjusted, densities);
            for element in part {
                let lane = element % GROUP;
                let terms = densities.iter().zip(self.solids.volumes(group));
                let sum: f64 = terms.map(|(density, volume)| density.0[lane] * volume.0[lane]).sum();
                // NaN marks a point without positive J.
                out[element - range.start] = if sum.is_nan() { f64::INFINITY } else { sum };
            }
        });
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.in_groups(&range, x, |group, part, scratch| {
            let arch = self.solids.arch();
            scratch.stresses.clone_from(&scratch.adjusted);
            self.law.stresses(arch, &mut scratch.stresses);
            scratch.dilation.pull_back(
                arch,
                self.law.is_linear(),
                &scratch.deformations,
                self.solids.volumes(group),
                &mut scratch.stresses,
            );
            let out = &mut out[3 * N * (part.start - range.start)..3 * N * (part.end - range.start)];
            self.solids.forces(group..group + 1, &scratch.stresses, part, out);
        });
    }

    /// Writes K = Σ_q w Bᵀ A B + h bᵀ + b hᵀ + κ b bᵀ with b = ∂θ/∂x and h = Σ_q w Bᵀ ∂²Ψ/∂F∂θ: the mean dilation
    /// couples all points of an element.
    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        let (size, rows) = (packed_len(3 * N), 3 * N);
        self.in_groups(&range, x, |group, part, scratch| {
            let arch = self.solids.arch();
            scratch.stresses.clone_from(&scratch.adjusted);
            self.law.stresses(arch, &mut scratch.stresses);
            scratch.tangents.resize(Q.max(scratch.tangents.len()), [Pack::default(); 45]);
            let tangents = &mut scratch.tangents[..Q];
            self.law.tangents(arch, &scratch.adjusted, tangents);
            scratch.slopes.resize(Q, [Pack::default(); 9]);
            let curvature = Curvature {
                deformations: &scratch.deformations,
                adjusted: &scratch.adjusted,
                stresses: &mut scratch.stresses,
                tangents,
                slopes: &mut scratch.slopes[..Q],
            };
            let kappa =
                scratch.dilation.curve(arch, self.law.is_linear(), curvature, self.solids.volumes(group));
            scratch.nodal_slopes.resize(GROUP * rows, 0.0);
            scratch.nodal_mixed.resize(GROUP * rows, 0.0);
            scratch.block.resize(size.max(scratch.block.len()), Pack::default());
            let count = part.len();
            let (slopes, mixed) =
                (&mut scratch.nodal_slopes[..count * rows], &mut scratch.nodal_mixed[..count * rows]);
            self.solids.forces(group..group + 1, &scratch.slopes[..Q], part.clone(), slopes);
            self.solids.forces(group..group + 1, &scratch.stresses, part.clone(), mixed);
            let out = &mut out[size * (part.start - range.start)..size * (part.end - range.start)];
            self.solids.hessians(group, tangents, &mut scratch.block[..size], part.clone(), out);
            let elements = slopes.chunks_exact(rows).zip(mixed.chunks_exact(rows));
            for ((element, block), (b, h)) in part.zip(out.chunks_exact_mut(size)).zip(elements) {
                add_dilation(block, b, h, kappa.0[element % GROUP]);
            }
        });
    }

    fn mean_deformations(&self, range: Range<usize>, x: &[f64], out: &mut [f64]) -> bool {
        self.in_groups(&range, x, |group, part, scratch| {
            for element in part {
                for (k, out) in out[9 * (element - range.start)..][..9].iter_mut().enumerate() {
                    let weighted = self.solids.volumes(group).zip(&scratch.deformations);
                    let sum: f64 =
                        weighted.map(|(volume, f)| volume.0[element % GROUP] * f[k].0[element % GROUP]).sum();
                    *out = self.weight * sum;
                }
            }
        });
        true
    }

    fn element(&self, stencil: usize) -> usize {
        self.elements.get(stencil).map_or(stencil, |&element| element as usize)
    }

    fn fault(&self, stencil: usize, x: &[f64], _t: f64) -> Option<Fault> {
        if self.law.is_linear() || stencil >= self.solids.count() {
            return None;
        }
        let mut worst = None;
        self.in_groups(&(stencil..stencil + 1), x, |_, _, scratch| {
            let lane = stencil % GROUP;
            worst = farthest_outside(&scratch.deformations, lane, positive_determinant)
                .or_else(|| farthest_outside(&scratch.adjusted, lane, |f| self.law.inside(f)));
        });
        worst.map(|outside| fault(self.element(stencil), outside))
    }
}

/// Adds h bᵀ + b hᵀ + κ b bᵀ to `block`, a packed lower triangle by rows.
fn add_dilation(block: &mut [f64], b: &[f64], h: &[f64], kappa: f64) {
    let mut start = 0;
    for i in 0..b.len() {
        let (bi, hi) = (b[i], h[i] + kappa * b[i]);
        for ((entry, bj), hj) in block[start..=start + i].iter_mut().zip(b).zip(h) {
            *entry += hi * bj + bi * hj;
        }
        start += i + 1;
    }
}
