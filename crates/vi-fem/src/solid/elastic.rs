//! The strain energy Σ_e ∫ Ψ(F) dV of a region. Elements and law are combined once into a `dyn Potential`.

pub(crate) mod build;
mod deferred;
pub(crate) mod elsewhere;
#[cfg(test)]
mod laws;
mod over_step;
#[cfg(test)]
mod properties;

use std::cell::RefCell;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

use pulp::Arch;
use vi_core::{Account, Fault, HessianKind, Patch, Potential, Stencils, Traits, packed_len, run_length};

use crate::error::FemError;
use crate::lanes::instructions::InstructionSet;
use crate::lanes::pack::{GROUP, Pack, interleave, whole_groups};
use crate::small::tensor::Mat3;
use crate::solid::element::contract::{Element, SolidVisitor};
use crate::solid::element::{kernel::Solids, visit_solid};
use crate::solid::law_kernels::{LawKernels, kernels_of, stiffness_weight};
use crate::solid::material::Law;
use crate::solid::material::batch::{PackedMat3, PackedTangent};
use crate::solid::material::contract::Outside;
use build::Build;
use deferred::Deferred;
use vi_mesh::sort_by_place;
use vi_mesh::{CellKind, Mesh, MeshError};

/// Number of groups of points that are processed together: so many that the cost of starting a kernel is negligible,
/// so few that F stays in the first-level cache. No element has more quadrature points.
pub(crate) const POINTS: usize = 32;

/// Returns the elastic potentials of `elements` (numbers in the mesh's cell order, of one kind or several) with one
/// law. Node a of the mesh is node a + `node_offset` of the system.
///
/// There is one potential per element kind, in the order in which the kinds first occur.
///
/// # Errors
/// Returns [`FemError::Mesh`] for elements that do not exist or have no positive volume; [`FemError::Unsupported`] for
/// cells that are not solid elements; [`FemError::Parameter`] for the first parameter out of its range ([`Law::check`]
/// gives all).
pub fn elastic(
    mesh: &Mesh,
    elements: &[u32],
    law: &Law,
    node_offset: usize,
    name: &str,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    elastic_on(InstructionSet::Best, mesh, elements, law, node_offset, name)
}

/// Returns the potentials of [`elastic`] on a chosen instruction set, to compare the sets.
///
/// # Errors
/// Returns the errors of [`elastic`], and [`FemError::Invalid`] if the machine lacks the instruction set.
pub fn elastic_on(
    instructions: InstructionSet,
    mesh: &Mesh,
    elements: &[u32],
    law: &Law,
    node_offset: usize,
    name: &str,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    by_kind::<Plain>((instructions, Storage::Whole), mesh, elements, law, node_offset, name)
}

/// Returns the potentials of [`elastic`] without their shapes at rest, for a process that evaluates only portions of them
/// ([`Potential::portion`]). The mesh must be one that [`elastic`] has accepted.
///
/// # Errors
/// Returns the errors of [`elastic`], except for elements without volume.
pub fn elastic_in_portions(
    mesh: &Mesh,
    elements: &[u32],
    law: &Law,
    node_offset: usize,
    name: &str,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    by_kind::<Plain>((InstructionSet::Best, Storage::Portions), mesh, elements, law, node_offset, name)
}

/// Returns the potentials of [`elastic_in_portions`] for some runs of the elements of a larger mesh. `elements` are these runs
/// in the order of [`sort_by_place`] in the larger mesh, each of `run_length` elements; the last one may be shorter. Every
/// run has the bits that it has in the potential of the larger mesh.
///
/// # Errors
/// Returns the errors of [`elastic_in_portions`].
pub fn elastic_in_runs(
    mesh: &Mesh,
    (elements, run_length): (&[u32], usize),
    law: &Law,
    node_offset: usize,
    name: &str,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let storage = Storage::Runs(run_length);
    by_kind::<Plain>((InstructionSet::Best, storage), mesh, elements, law, node_offset, name)
}

/// The elements whose shapes at rest a potential stores.
#[derive(Clone, Copy)]
pub(crate) enum Storage {
    /// All.
    Whole,
    /// None; the shapes of a portion are computed when the portion is made.
    Portions,
    /// None, as for `Portions`. The elements are already in runs of this length, and keep their order.
    Runs(usize),
}

/// Returns one potential per element kind, each built by `B`.
pub(crate) fn by_kind<B: Build>(
    (instructions, storage): (InstructionSet, Storage),
    mesh: &Mesh,
    elements: &[u32],
    law: &Law,
    node_offset: usize,
    name: &str,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let arch = instructions.arch()?;
    if let Some(problem) = law.parameters().check().into_iter().next() {
        return Err(problem);
    }
    let mut kinds: Vec<(CellKind, Vec<u32>)> = Vec::new();
    for &element in elements {
        let (kind, _) = mesh.element(element, "elastic region, element")?;
        match kinds.iter_mut().find(|(other, _)| *other == kind) {
            Some((_, list)) => list.push(element),
            None => {
                // Most regions have elements of one kind.
                let mut list = Vec::with_capacity(elements.len());
                list.push(element);
                kinds.push((kind, list));
            }
        }
    }
    let label = format!("{name}: {}", law.name());
    kinds
        .into_iter()
        .map(|(kind, elements)| {
            let name = label.clone();
            let form = PhantomData;
            let build = BuildElement::<B> { arch, storage, mesh, elements, law, node_offset, name, form };
            visit_solid(kind, build).ok_or(FemError::Unsupported { kind, used: "solid elements" })?
        })
        .collect()
}

struct BuildElement<'a, B> {
    arch: Arch,
    storage: Storage,
    mesh: &'a Mesh,
    elements: Vec<u32>,
    law: &'a Law,
    node_offset: usize,
    name: String,
    form: PhantomData<B>,
}

impl<B: Build> SolidVisitor for BuildElement<'_, B> {
    type Output = Result<Box<dyn Potential>, FemError>;

    fn visit<E: Element<N, Q>, const N: usize, const Q: usize>(self) -> Self::Output {
        let Self { arch, storage, mesh, mut elements, law, node_offset, name, .. } = self;
        let run_length = match storage {
            Storage::Runs(length) => length,
            Storage::Whole | Storage::Portions => {
                sort_by_place(mesh, &mut elements);
                run_length(elements.len(), 3 * N)
            }
        };
        interleave(run_length, &mut elements);
        let cells = elements.iter().filter_map(|&element| mesh.cell(element as usize));
        let mut nodes: Vec<u32> = Vec::with_capacity(N * elements.len());
        cells.for_each(|(_, of_element)| nodes.extend_from_slice(of_element));
        if !matches!(storage, Storage::Whole) {
            let node_offset = node_offset as u32;
            nodes.iter_mut().for_each(|node| *node += node_offset);
            let (points, law, form) = (mesh.points.clone(), law.clone(), PhantomData);
            return Ok(Box::new(Deferred::<B, E, N, Q> {
                arch,
                points,
                node_offset,
                nodes,
                elements,
                run_length,
                law,
                name,
                form,
            }));
        }
        let total = elements.len();
        let mut solids = Solids::<E, N, Q>::new(arch, &mesh.points, nodes).map_err(|inverted| {
            let count = inverted.len();
            let named = inverted.into_iter().map(|(index, volume)| (elements[index] as usize, volume));
            let mut first: Vec<(usize, f64)> = named.collect();
            first.sort_by_key(|&(element, _)| element);
            first.truncate(5);
            FemError::from(MeshError::Inverted { count, total, first })
        })?;
        solids.shift_nodes(node_offset as u32);
        Ok(B::build(solids, kernels_of(law), elements, name))
    }
}

/// Builds the energy that evaluates Ψ(F) at every quadrature point.
struct Plain;

impl Build for Plain {
    fn build<E: Element<N, Q>, const N: usize, const Q: usize>(
        mut solids: Solids<E, N, Q>,
        law: Box<dyn LawKernels>,
        elements: Vec<u32>,
        name: String,
    ) -> Box<dyn Potential> {
        if E::IS_SIMPLEX && !law.is_linear() {
            solids.rotate_rest_shapes();
        }
        let weight = stiffness_weight(law.as_ref());
        Box::new(ElasticPotential { solids, law: law.into(), elements, weight, name })
    }
}

/// The potential V = Σ_e Σ_q w_q det J_q Ψ(F_q), one stencil per element.
struct ElasticPotential<E, const N: usize, const Q: usize> {
    solids: Solids<E, N, Q>,
    law: Arc<dyn LawKernels>,
    /// The caller's number of each element.
    elements: Vec<u32>,
    /// Weight of mean deformations, Pa.
    weight: f64,
    name: String,
}

thread_local! {
    /// Scratch memory for the tangents and the Hessian of one group; each thread allocates it once.
    static SCRATCH: RefCell<(Vec<PackedTangent>, Vec<Pack>)> = const { RefCell::new((Vec::new(), Vec::new())) };
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> ElasticPotential<E, N, Q> {
    /// Returns a function that computes F of groups at the positions `x` of all nodes.
    fn at<'a>(&'a self, x: &'a [f64]) -> impl Fn(Range<usize>, &mut [PackedMat3]) + 'a {
        |groups, out| self.solids.deformations(groups, x, out)
    }

    /// Runs `work` on the groups that overlap `range`, some at a time, with F at their points from `deform`.
    #[inline]
    fn in_passes(
        &self,
        range: &Range<usize>,
        deform: impl Fn(Range<usize>, &mut [PackedMat3]),
        mut work: impl FnMut(Range<usize>, &mut [PackedMat3]),
    ) {
        const { assert!(Q <= POINTS) };
        let mut scratch = [[Pack::default(); 9]; POINTS];
        let (mut group, end) = (range.start / GROUP, range.end.div_ceil(GROUP));
        while group < end {
            let next = end.min(group + POINTS / Q);
            let points = &mut scratch[..(next - group) * Q];
            deform(group..next, points);
            work(group..next, points);
            group = next;
        }
    }

    fn tangent_blocks(&self, range: Range<usize>, x: &[f64], out: &mut [f64], is_projected: bool) {
        if range.is_empty() {
            return;
        }
        SCRATCH.with_borrow_mut(|(scratch, block)| {
            scratch.resize(Q.max(scratch.len()), [Pack::default(); 45]);
            let size = packed_len(3 * N);
            block.resize(size.max(block.len()), Pack::default());
            let (scratch, block) = (&mut scratch[..Q], &mut block[..size]);
            self.in_passes(&range, self.at(x), |groups, points| {
                for (group, points) in groups.zip(points.chunks_exact(Q)) {
                    let arch = self.solids.arch();
                    match is_projected {
                        true => self.law.projected_tangents(arch, points, scratch),
                        false => self.law.tangents(arch, points, scratch),
                    }
                    self.solids.hessians(group, scratch, block, range.clone(), out);
                }
            });
        });
    }
}

/// Copies those lanes of `group` that lie in `range` to `out`, which begins with range.start.
fn scatter(
    group: usize,
    range: &Range<usize>,
    size: usize,
    out: &mut [f64],
    value: impl Fn(usize, usize) -> f64,
) {
    let first = group * GROUP;
    for element in range.start.max(first)..range.end.min(first + GROUP) {
        for k in 0..size {
            out[(element - range.start) * size + k] = value(element - first, k);
        }
    }
}

impl<E: Element<N, Q>, const N: usize, const Q: usize> Potential for ElasticPotential<E, N, Q> {
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
        let mut densities = [Pack::default(); POINTS];
        self.in_passes(&range, self.at(x), |groups, points| {
            self.law.energies(self.solids.arch(), points, &mut densities[..points.len()]);
            for (group, densities) in groups.zip(densities.chunks_exact(Q)) {
                let mut sum = Pack::default();
                for (density, volume) in densities.iter().zip(self.solids.volumes(group)) {
                    for lane in 0..GROUP {
                        sum.0[lane] += density.0[lane] * volume.0[lane];
                    }
                }
                scatter(group, &range, 1, out, |lane, _| sum.0[lane]);
            }
        });
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.in_passes(&range, self.at(x), |groups, points| {
            self.law.stresses(self.solids.arch(), points);
            self.solids.forces(groups, points, range.clone(), out);
        });
    }

    fn adds_gradients(&self) -> bool {
        true
    }

    fn add_gradients(&self, range: Range<usize>, _t: f64, patch: Patch<'_>) {
        let Patch { places, x, sums } = patch;
        whole_groups(range, places, N, |groups, places| {
            if E::IS_SIMPLEX {
                let (arch, shapes) = (self.solids.arch(), self.solids.shapes(groups));
                self.law.add_simplex_forces(arch, shapes, places, x, sums);
                return;
            }
            let places_of = |part: &Range<usize>| {
                let start = (part.start - groups.start) * GROUP * N;
                &places[start..start + part.len() * GROUP * N]
            };
            let deform = |part: Range<usize>, out: &mut [PackedMat3]| {
                self.solids.patch_deformations(part.clone(), places_of(&part), x, out);
            };
            self.in_passes(&(groups.start * GROUP..groups.end * GROUP), deform, |part, points| {
                self.law.stresses(self.solids.arch(), points);
                self.solids.add_forces(part.clone(), points, places_of(&part), sums);
            });
        });
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        if E::IS_SIMPLEX {
            let Self { solids, law, .. } = self;
            law.simplex_hessians(solids.arch(), &solids.geometry, solids.padded_nodes(), range, x, out);
            return;
        }
        self.tangent_blocks(range, x, out, false);
    }

    fn projected_hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.tangent_blocks(range, x, out, true);
    }

    fn mean_deformations(&self, range: Range<usize>, x: &[f64], out: &mut [f64]) -> bool {
        self.in_passes(&range, self.at(x), |groups, points| {
            for (group, points) in groups.zip(points.chunks_exact(Q)) {
                let value = |lane: usize, k: usize| {
                    let weighted = self.solids.volumes(group).zip(points.iter());
                    let sum: f64 = weighted.map(|(volume, f)| volume.0[lane] * f[k].0[lane]).sum();
                    self.weight * sum
                };
                scatter(group, &range, 9, out, value);
            }
        });
        true
    }

    fn corrections_over_step(&self, range: Range<usize>, ends: [&[f64]; 2], out: &mut [f64]) -> bool {
        // The gradient of a quadratic energy in the middle of a step is exact, and laws of small strains are not
        // objective.
        let is_exact = self.law.is_linear();
        if !is_exact && !range.is_empty() {
            self.write_corrections(range, ends, out);
        }
        !is_exact
    }

    fn hessians_over_step(
        &self,
        range: Range<usize>,
        ends: [&[f64]; 2],
        is_projected: bool,
        out: &mut [f64],
    ) -> bool {
        let is_exact = self.law.is_linear();
        if !is_exact {
            self.tangents_over_step(range, ends, is_projected, out);
        }
        !is_exact
    }

    fn portion(&self, range: Range<usize>) -> Option<Arc<dyn Potential>> {
        let (law, weight, name) = (Arc::clone(&self.law), self.weight, self.name.clone());
        let elements = self.elements[range.clone()].to_vec();
        Some(Arc::new(Self { solids: self.solids.portion(range)?, law, elements, weight, name }))
    }

    fn element(&self, stencil: usize) -> usize {
        self.elements.get(stencil).map_or(stencil, |&element| element as usize)
    }

    fn fault(&self, stencil: usize, x: &[f64], _t: f64) -> Option<Fault> {
        if stencil >= self.solids.count() {
            return None;
        }
        let mut worst = None;
        self.in_passes(&(stencil..stencil + 1), self.at(x), |_, points| {
            worst = farthest_outside(points, stencil % GROUP, |f| self.law.inside(f));
        });
        worst.map(|outside| fault(self.element(stencil), outside))
    }
}

/// Returns the point of one lane that is farthest outside the domain, if any.
pub(crate) fn farthest_outside(
    points: &[PackedMat3],
    lane: usize,
    inside: impl Fn(&Mat3<f64>) -> Result<(), Outside>,
) -> Option<Outside> {
    let f = |point: &PackedMat3| [0, 1, 2].map(|i| [0, 1, 2].map(|j| point[3 * i + j].0[lane]));
    let outside = points.iter().filter_map(|point| inside(&f(point)).err());
    outside.reduce(|a, b| if b.excess > a.excess { b } else { a })
}

pub(crate) fn fault(element: usize, Outside { quantity, value, domain, .. }: Outside) -> Fault {
    Fault { element, quantity, value, domain, at_any_state: false }
}
