//! The kernel of all bending models whose energy is a square of angles, V = Σ ½ |y|², with y = Σ form (θ − θ̄) over
//! the hinges of a stencil. It handles eight stencils at a time. The angle is replaced by a function that is smooth
//! around the circle (see `turn`).
//!
//! Stencils of a run whose hinges join the same local corners (the same "pattern") share a group, so that all work except
//! gathering nodes is done in lanes. A group that is not full repeats its last stencil. Sums of forces over a run are in
//! `runs`.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};
use vi_core::{Account, HessianKind, Patch, Potential, Stencils, Traits, packed_len, run_length};

use super::runs::Runs;
use super::sheet::BentSheet;
use super::stencil::{BENDS, Bend, CARRIED, FormPack, Stencil, dot_add, turn};
use crate::lanes::pack::{GROUP, Pack, interleave, parts};
use crate::lanes::real::{Lane, Real};
use crate::lanes::transpose::{gather, put};
use crate::sheet::dihedral::Fold;
use crate::small::tensor::{packed_index, vec3};

/// Largest number of nodes of a stencil.
const MOST: usize = 12;

/// Returns the local node with which corner c of a hinge moves.
#[inline(always)]
fn node_of(corners: &[u8; 4], c: usize) -> usize {
    usize::from(if corners[c] == CARRIED { corners[0] } else { corners[c] })
}

/// Returns the potentials of the stencils of a sheet, one for each number of nodes. Runs have the stencils in the given
/// order.
pub(super) fn patches<const F: usize>(
    stencils: Vec<Stencil<F>>,
    sheet: &BentSheet,
) -> Vec<Box<dyn Potential>> {
    let mut by_arity: BTreeMap<usize, Vec<Stencil<F>>> = BTreeMap::new();
    for stencil in stencils {
        by_arity.entry(stencil.nodes.len()).or_default().push(stencil);
    }
    let potential = |(arity, stencils): (usize, Vec<Stencil<F>>)| {
        Box::new(Patches::new(arity, &stencils, sheet)) as Box<dyn Potential>
    };
    by_arity.into_iter().map(potential).collect()
}

/// Up to eight stencils of one pattern.
struct Group {
    first: usize,
    count: usize,
    pattern: usize,
    /// The index of the first hinge.
    bends: usize,
    /// The index of the first held corner.
    held: usize,
}

impl Group {
    fn members(&self) -> Range<usize> {
        self.first..self.first + self.count
    }
}

struct Patches<const F: usize> {
    arch: Arch,
    arity: usize,
    count: usize,
    /// Node numbers, `arity` per stencil. The list is padded so that the last group can be gathered whole.
    nodes: Vec<u32>,
    patterns: Vec<Vec<[u8; 4]>>,
    groups: Vec<Group>,
    /// The group of each stencil.
    group_of: Vec<u32>,
    /// The coefficients of each hinge of each group. They are apart from the rest angles, which sums of forces do not read:
    /// large sheets wait for memory.
    forms: Vec<FormPack<F>>,
    /// sin θ̄ and cos θ̄ of each hinge of each group.
    rests: Vec<[Pack; 2]>,
    held: Vec<[Pack; 3]>,
    runs: Runs,
    /// The unit of energy for the squares of the forms, J.
    unit: f64,
    name: String,
}

impl<const F: usize> Patches<F> {
    fn new(arity: usize, stencils: &[Stencil<F>], sheet: &BentSheet) -> Self {
        let mut patches = Self {
            arch: Arch::new(),
            arity,
            count: 0,
            nodes: Vec::new(),
            patterns: Vec::new(),
            groups: Vec::new(),
            group_of: Vec::new(),
            forms: Vec::new(),
            rests: Vec::new(),
            held: Vec::new(),
            // Stencils share most of their nodes and hinges with others of the run, as triangles do.
            runs: Runs::new(run_length(stencils.len(), 9)),
            unit: sheet.unit(),
            name: sheet.name.clone(),
        };
        for run in stencils.chunks(patches.runs.length) {
            patches.add_run(run);
        }
        // Pad the nodes so that the last group can be gathered whole.
        let last = patches.nodes[patches.nodes.len() - arity..].to_vec();
        patches.nodes.extend(last.iter().cycle().take(GROUP * arity));
        patches
    }

    fn add_run(&mut self, run: &[Stencil<F>]) {
        let mut by_pattern: BTreeMap<Vec<[u8; 4]>, Vec<u32>> = BTreeMap::new();
        for (index, stencil) in run.iter().enumerate() {
            let pattern = stencil.bends.iter().map(|bend| bend.corners).collect();
            by_pattern.entry(pattern).or_default().push(index as u32);
        }
        by_pattern.values_mut().for_each(|members| interleave(members.len(), members));
        let in_order: Vec<_> = by_pattern.values().flatten().map(|&index| &run[index as usize]).collect();
        let numbers = self.runs.begin(&in_order, self.arity);
        let mut rest = &in_order[..];
        for (pattern, members) in by_pattern {
            let (stencils, after) = rest.split_at(members.len());
            rest = after;
            let known = self.patterns.iter().position(|known| *known == pattern);
            let pattern = known.unwrap_or_else(|| {
                self.patterns.push(pattern);
                self.patterns.len() - 1
            });
            for stencils in stencils.chunks(GROUP) {
                self.add_group(stencils, pattern);
                self.runs.add_group(stencils, &numbers);
            }
        }
    }

    fn add_group(&mut self, stencils: &[&Stencil<F>], pattern: usize) {
        let (bends, held, count) = (self.forms.len(), self.held.len(), stencils.len());
        self.group_of.extend(std::iter::repeat_n(self.groups.len() as u32, count));
        self.groups.push(Group { first: self.count, count, pattern, bends, held });
        let lane = |lane: usize| stencils[lane.min(count - 1)];
        for (b, bend) in stencils[0].bends.iter().enumerate() {
            let pack =
                |value: &dyn Fn(&Bend<F>) -> f64| Pack(std::array::from_fn(|l| value(&lane(l).bends[b])));
            self.forms.push(FormPack(std::array::from_fn(|f| pack(&|bend| bend.form[f]))));
            self.rests.push([pack(&|bend| bend.rest_angle.sin()), pack(&|bend| bend.rest_angle.cos())]);
            if bend.corners[3] == CARRIED {
                self.held.push([0, 1, 2].map(|i| pack(&|bend| bend.vector[i])));
            }
        }
        self.nodes.extend(stencils.iter().flat_map(|stencil| &stencil.nodes));
        self.count += count;
    }

    /// Returns the coefficients and rest angles of the hinges of a group.
    #[inline(always)]
    fn bends(&self, group: &Group) -> (&[FormPack<F>], &[[Pack; 2]]) {
        let count = self.patterns[group.pattern].len();
        (&self.forms[group.bends..][..count], &self.rests[group.bends..][..count])
    }

    fn groups(&self, range: &Range<usize>) -> &[Group] {
        if range.is_empty() {
            return &[];
        }
        &self.groups[self.group_of[range.start] as usize..=self.group_of[range.end - 1] as usize]
    }

    /// Reads the corner positions of the stencils in one part of a group.
    #[inline(always)]
    fn gather<S: Simd>(
        &self,
        simd: S,
        (group, part): (&Group, usize),
        x: &[f64],
        at: &mut [[Lane<S>; 3]; MOST],
    ) {
        let first = (group.first + part * S::F64_LANES) * self.arity;
        for a in 0..self.arity {
            at[a] = gather(simd, x, &self.nodes[first + a..], self.arity);
        }
    }

    /// Returns the fold of hinge b with its four corners. `held` counts the held corners of the hinges before it, and
    /// advances.
    #[inline(always)]
    fn fold<S: Simd>(
        &self,
        simd: S,
        part: usize,
        corners: [u8; 4],
        held: &mut usize,
        at: &[[Lane<S>; 3]; MOST],
    ) -> Fold<Lane<S>> {
        let last = if corners[3] == CARRIED {
            let (first, vector) = (at[usize::from(corners[0])], &self.held[*held]);
            *held += 1;
            vec3!(i => first[i] + vector[i].load(simd, part))
        } else {
            at[usize::from(corners[3])]
        };
        let [a, b, c] = [usize::from(corners[0]), usize::from(corners[1]), usize::from(corners[2])];
        Fold::new(&[at[a], at[b], at[c], last])
    }
}

struct Energies<'a, const F: usize> {
    patches: &'a Patches<F>,
    range: Range<usize>,
    x: &'a [f64],
    out: &'a mut [f64],
}

impl<const F: usize> WithSimd for Energies<'_, F> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { patches, range, x, out } = self;
        let zero = Lane::splat(simd, 0.0);
        let mut at = [[zero; 3]; MOST];
        for group in patches.groups(&range) {
            let mut energy = [Pack::default()];
            for part in 0..parts::<S>() {
                patches.gather(simd, (group, part), x, &mut at);
                let mut held = group.held;
                let (mut y, mut surplus) = ([zero; F], zero);
                for (b, &corners) in patches.patterns[group.pattern].iter().enumerate() {
                    let (form, rest) = (&patches.forms[group.bends + b], &patches.rests[group.bends + b]);
                    let fold = patches.fold(simd, part, corners, &mut held, &at);
                    let (turn, form) = (turn(simd, part, rest, &fold), form.load(simd, part));
                    let psi = turn.value();
                    for f in 0..F {
                        y[f] = form[f].mul_add(psi, y[f]);
                    }
                    surplus = dot_add(&form, &form, zero).mul_add(turn.surplus(), surplus);
                }
                let sum = dot_add(&y, &y, zero).mul_add(zero + 0.5, surplus);
                energy[0].store(part, sum * patches.unit);
            }
            put(simd, &energy, group.members(), &range, out);
        }
    }
}

struct Gradients<'a, const F: usize> {
    patches: &'a Patches<F>,
    range: Range<usize>,
    x: &'a [f64],
    out: &'a mut [f64],
}

impl<const F: usize> WithSimd for Gradients<'_, F> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { patches, range, x, out } = self;
        let size = 3 * patches.arity;
        let mut local = [Pack::default(); 3 * MOST];
        // These are written before they are read. To clear them for each group took 14 % of a step.
        let zero = Lane::splat(simd, 0.0);
        let (mut at, mut sum) = ([[zero; 3]; MOST], [[zero; 3]; MOST]);
        let mut slopes = [[[zero; 3]; 4]; BENDS];
        // ψ and 1 − ψ′ of each hinge.
        let mut turns = [[zero; 2]; BENDS];
        for group in patches.groups(&range) {
            let pattern = &patches.patterns[group.pattern][..];
            let (forms, rests) = patches.bends(group);
            for part in 0..parts::<S>() {
                patches.gather(simd, (group, part), x, &mut at);
                let mut held = group.held;
                let mut y = [zero; F];
                for b in 0..pattern.len() {
                    let fold = patches.fold(simd, part, pattern[b], &mut held, &at);
                    let (turn, form) = (turn(simd, part, &rests[b], &fold), forms[b].load(simd, part));
                    let psi = turn.value();
                    for f in 0..F {
                        y[f] = form[f].mul_add(psi, y[f]);
                    }
                    turns[b] = [psi, turn.softening()];
                    slopes[b] = fold.gradient();
                }
                sum[..patches.arity].fill([zero; 3]);
                for b in 0..pattern.len() {
                    let (form, [psi, softening]) = (forms[b].load(simd, part), turns[b]);
                    let coupled = dot_add(&form, &y, zero);
                    let own = dot_add(&form, &form, zero) * psi;
                    // ∂V/∂Δ_a = ψ′ Kψ + (1 − ψ′) K_aa ψ_a.
                    let moment = softening.mul_add(own - coupled, coupled);
                    for c in 0..4 {
                        let corner = node_of(&pattern[b], c);
                        for i in 0..3 {
                            sum[corner][i] = moment.mul_add(slopes[b][c][i], sum[corner][i]);
                        }
                    }
                }
                for k in 0..size {
                    local[k].store(part, sum[k / 3][k % 3] * patches.unit);
                }
            }
            put(simd, &local[..size], group.members(), &range, out);
        }
    }
}

struct Hessians<'a, const F: usize> {
    patches: &'a Patches<F>,
    range: Range<usize>,
    x: &'a [f64],
    /// Whether to omit terms that may be negative.
    is_projected: bool,
    /// Scratch memory for the packed Hessians of a group.
    block: &'a mut [Pack],
    out: &'a mut [f64],
}

impl<const F: usize> WithSimd for Hessians<'_, F> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { patches, range, x, is_projected, block, out } = self;
        let size = 3 * patches.arity;
        for group in patches.groups(&range) {
            let pattern = &patches.patterns[group.pattern][..];
            let (forms, rests) = patches.bends(group);
            for part in 0..parts::<S>() {
                let zero = Lane::splat(simd, 0.0);
                let mut at = [[zero; 3]; MOST];
                patches.gather(simd, (group, part), x, &mut at);
                let mut held = group.held;
                let mut y = [zero; F];
                let mut slopes = [[zero; 3 * MOST]; F];
                for b in 0..pattern.len() {
                    let fold = patches.fold(simd, part, pattern[b], &mut held, &at);
                    let (turn, form) = (turn(simd, part, &rests[b], &fold), forms[b].load(simd, part));
                    let (psi, slope, steepness) = (turn.value(), fold.gradient(), -turn.softening() + 1.0);
                    for f in 0..F {
                        y[f] = form[f].mul_add(psi, y[f]);
                        let form = form[f] * steepness;
                        for c in 0..4 {
                            let corner = node_of(&pattern[b], c);
                            if corner < MOST {
                                for i in 0..3 {
                                    let entry = &mut slopes[f][3 * corner + i];
                                    *entry = form.mul_add(slope[c][i], *entry);
                                }
                            }
                        }
                    }
                }
                for row in 0..size {
                    for column in 0..=row {
                        let mut entry = zero;
                        for f in 0..F {
                            entry = slopes[f][row].mul_add(slopes[f][column], entry);
                        }
                        block[packed_index(row, column)].store(part, entry * patches.unit);
                    }
                }
                let mut held = group.held;
                for b in 0..pattern.len() {
                    let fold = patches.fold(simd, part, pattern[b], &mut held, &at);
                    let (turn, form) = (turn(simd, part, &rests[b], &fold), forms[b].load(simd, part));
                    let (psi, softening) = (turn.value(), turn.softening());
                    let (coupled, stiffness) = (dot_add(&form, &y, zero), dot_add(&form, &form, zero));
                    let own = stiffness * psi;
                    // Add the part of ∂²V/∂Δ² that the slopes above do not contain: K_aa ψ′(1 − ψ′) + ψ″ (Kψ − K_aa
                    // ψ_a).
                    let rest = stiffness * softening * (-softening + 1.0);
                    let (second, moment) = if is_projected {
                        (rest.if_positive(rest, zero), zero)
                    } else {
                        let moment = softening.mul_add(own - coupled, coupled);
                        (turn.second().mul_add(coupled - own, rest), moment)
                    };
                    let (second, moment) = (second * patches.unit, moment * patches.unit);
                    let slope = fold.gradient();
                    let curvature = if is_projected { [[zero; 12]; 12] } else { fold.hessian() };
                    for n in 0..12 {
                        let row = 3 * node_of(&pattern[b], n / 3) + n % 3;
                        let along = second * slope[n / 3][n % 3];
                        for m in 0..=n {
                            let column = 3 * node_of(&pattern[b], m / 3) + m % 3;
                            // If two corners are the same node, this entry stands for both halves of the matrix.
                            let is_doubled = n != m && row == column;
                            let (along, moment) = match is_doubled {
                                true => (along + along, moment + moment),
                                false => (along, moment),
                            };
                            let target = &mut block[packed_index(row.max(column), row.min(column))];
                            let sum = moment.mul_add(curvature[n][m], target.load(simd, part));
                            target.store(part, along.mul_add(slope[m / 3][m % 3], sum));
                        }
                    }
                }
            }
            put(simd, block, group.members(), &range, out);
        }
    }
}

thread_local! {
    /// Scratch memory for the Hessians of one group; each thread allocates it once.
    static SCRATCH: RefCell<Vec<Pack>> = const { RefCell::new(Vec::new()) };
}

impl<const F: usize> Patches<F> {
    fn blocks(&self, range: Range<usize>, x: &[f64], is_projected: bool, out: &mut [f64]) {
        SCRATCH.with_borrow_mut(|scratch| {
            let size = packed_len(3 * self.arity);
            scratch.resize(size.max(scratch.len()), Pack::default());
            let block = &mut scratch[..size];
            self.arch.dispatch(Hessians { patches: self, range, x, is_projected, block, out });
        });
    }
}

impl<const F: usize> Potential for Patches<F> {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.arity, block: 3, nodes: &self.nodes[..self.count * self.arity] }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.arch.dispatch(Energies { patches: self, range, x, out });
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.arch.dispatch(Gradients { patches: self, range, x, out });
    }

    fn run_length(&self) -> usize {
        self.runs.length
    }

    fn held_edge(&self, stencil: usize) -> Option<[u32; 2]> {
        let pattern = &self.patterns[self.groups[self.group_of[stencil] as usize].pattern];
        let [a, b, ..] = *pattern.iter().find(|corners| corners[3] == CARRIED)?;
        Some([a, b].map(|corner| self.nodes[stencil * self.arity + usize::from(corner)]))
    }

    fn adds_gradients(&self) -> bool {
        true
    }

    fn add_gradients(&self, range: Range<usize>, _t: f64, patch: Patch<'_>) {
        self.runs.add_gradients((self.arch, &self.forms, self.unit), range.start, patch);
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.blocks(range, x, false, out);
    }

    /// Writes only the parts that are squares of first derivatives, which are never negative.
    fn projected_hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.blocks(range, x, true, out);
    }
}
