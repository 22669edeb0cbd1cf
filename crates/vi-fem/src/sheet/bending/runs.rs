//! Adds the forces of bending on a patch. Each hinge of a run of stencils is evaluated once, however many stencils it
//! bends: a stencil of a regular mesh has nine hinges, but a mesh has only 1.5 hinges per triangle.
//!
//! With ψ_h of every hinge h of the run, a pass over its stencils forms y = Σ form ψ and the sums c_h = Σ form·y over
//! the stencils of each hinge. The moment of a hinge is c_h + (1 − ψ′_h)(k_h ψ_h − c_h), where k_h = Σ |form|² over
//! these stencils. A pass over the hinges adds the moments times ∂θ_h/∂x.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};
use vi_core::{Patch, PatchArray};

use super::stencil::{BENDS, Bend, CARRIED, FormPack, Stencil, dot_add, turn};
use crate::lanes::pack::{GROUP, Pack, parts};
use crate::lanes::places::{add_to_places, gather_places};
use crate::lanes::real::{Lane, Real};
use crate::sheet::dihedral::{Fold, Slopes};
use crate::small::tensor::vec3;

/// The runs of the stencils of a potential.
pub(super) struct Runs {
    /// The number of stencils of a run; the last one may have fewer.
    pub(super) length: usize,
    runs: Vec<Run>,
    /// The hinges of the groups of stencils, as indices into the forms of the potential.
    groups: Vec<Range<usize>>,
    /// The number in its run of each hinge of each lane of these groups.
    numbers: Vec<[u16; GROUP]>,
    hinges: Vec<HingePack>,
}

/// The groups of stencils and the groups of hinges of one run.
struct Run {
    groups: Range<usize>,
    hinges: Range<usize>,
}

/// Up to eight hinges of a run, all of triangles or all of supports. A group that is not full repeats its last hinge; no
/// stencil acts on the copies.
struct HingePack {
    /// Each corner by its index among the places of the run. The fourth corner of a support repeats the first.
    corners: [[u16; GROUP]; 4],
    /// The vectors from the first corners to [`CARRIED`] fourth ones, m.
    carried: Option<Box<[Pack; 3]>>,
    /// sin θ̄ and cos θ̄.
    rest: [Pack; 2],
    /// Σ |form|² over the stencils of the run.
    stiffness: Pack,
}

/// A hinge of a run while the run is built.
struct Member<'a, const F: usize> {
    bend: &'a Bend<F>,
    corners: [u16; 4],
    stiffness: f64,
}

/// Returns the hinges of a run in groups, and the number of each in the run by its number in the sheet: lane l of group
/// g has the number 8 g + l. `stencils` are in the order of the run, with `arity` nodes each.
fn hinges_of_run<const F: usize>(
    stencils: &[&Stencil<F>],
    arity: usize,
) -> (Vec<HingePack>, BTreeMap<u32, u16>) {
    let mut places = BTreeMap::new();
    let mut members: Vec<Member<F>> = Vec::new();
    for (index, stencil) in stencils.iter().enumerate() {
        for bend in &stencil.bends {
            let place = *places.entry(bend.hinge).or_insert_with(|| {
                let place = |c: usize| {
                    let corner = bend.corners[if bend.corners[c] == CARRIED { 0 } else { c }];
                    (index * arity + usize::from(corner)) as u16
                };
                members.push(Member { bend, corners: [0, 1, 2, 3].map(place), stiffness: 0.0 });
                members.len() - 1
            });
            members[place].stiffness += bend.form.iter().map(|form| form * form).sum::<f64>();
        }
    }
    let kind = |member: &Member<F>| member.bend.corners[3] == CARRIED;
    members.sort_by_key(kind);
    let (mut packs, mut numbers) = (Vec::new(), BTreeMap::new());
    for members in members.chunk_by(|a, b| kind(a) == kind(b)) {
        // Neighbours are in different groups, so that additions at a node need not wait for each other.
        let count = members.len().div_ceil(GROUP);
        for group in 0..count {
            for lane in 0..GROUP {
                if let Some(member) = members.get(lane * count + group) {
                    numbers.insert(member.bend.hinge, (packs.len() * GROUP + lane) as u16);
                }
            }
            packs.push(pack(|lane| members.get(lane * count + group), &members[group]));
        }
    }
    (packs, numbers)
}

/// Returns a group of hinges; lanes that have none repeat `first`.
fn pack<'a, const F: usize>(
    member: impl Fn(usize) -> Option<&'a Member<'a, F>>,
    first: &'a Member<'a, F>,
) -> HingePack {
    let lanes: [_; GROUP] = std::array::from_fn(|lane| member(lane).unwrap_or(first));
    let angle = |value: fn(f64) -> f64| Pack(lanes.map(|member| value(member.bend.rest_angle)));
    let vectors = [0, 1, 2].map(|i| Pack(lanes.map(|member| member.bend.vector[i])));
    HingePack {
        corners: [0, 1, 2, 3].map(|c| lanes.map(|member| member.corners[c])),
        carried: (first.bend.corners[3] == CARRIED).then(|| Box::new(vectors)),
        rest: [angle(f64::sin), angle(f64::cos)],
        stiffness: Pack(std::array::from_fn(|lane| member(lane).map_or(0.0, |member| member.stiffness))),
    }
}

impl HingePack {
    /// Returns the places of the corners in the patch.
    #[inline(always)]
    fn places(&self, places: &[u16]) -> [[u16; GROUP]; 4] {
        let mut found = [[0; GROUP]; 4];
        for c in 0..4 {
            for lane in 0..GROUP {
                found[c][lane] = places[usize::from(self.corners[c][lane])];
            }
        }
        found
    }

    #[inline(always)]
    fn fold<S: Simd>(
        &self,
        simd: S,
        part: usize,
        places: &[[u16; GROUP]; 4],
        x: &PatchArray,
    ) -> Fold<Lane<S>> {
        let first_lane = part * S::F64_LANES;
        let [first, second, third] = vec3!(c => gather_places(simd, x, &places[c][first_lane..], 1));
        let last = if let Some(vectors) = &self.carried {
            vec3!(i => first[i] + vectors[i].load(simd, part))
        } else {
            gather_places(simd, x, &places[3][first_lane..], 1)
        };
        Fold::new(&[first, second, third, last])
    }
}

/// A hinge group after its evaluation.
#[derive(Clone, Copy, Default)]
struct Evaluated {
    /// [`Slopes::free`] and [`Slopes::s`].
    free: [[Pack; 3]; 2],
    s: [Pack; 2],
    psi: Pack,
    /// 1 − ψ′.
    softening: Pack,
    /// Σ form·y over the stencils of the run.
    coupled: Pack,
}

thread_local! {
    /// Scratch memory for the hinges of one run; each thread allocates it once.
    static SCRATCH: RefCell<Vec<Evaluated>> = const { RefCell::new(Vec::new()) };
}

impl Runs {
    pub(super) fn new(length: usize) -> Self {
        Self { length, runs: Vec::new(), groups: Vec::new(), numbers: Vec::new(), hinges: Vec::new() }
    }

    /// Begins a run of `stencils`, of `arity` nodes each. Returns the number in the run of each of its hinges, by its number
    /// in the sheet.
    pub(super) fn begin<const F: usize>(
        &mut self,
        stencils: &[&Stencil<F>],
        arity: usize,
    ) -> BTreeMap<u32, u16> {
        let (hinges, numbers) = hinges_of_run(stencils, arity);
        let (group, first) = (self.groups.len(), self.hinges.len());
        self.hinges.extend(hinges);
        self.runs.push(Run { groups: group..group, hinges: first..self.hinges.len() });
        numbers
    }

    /// Adds the next group of up to eight stencils to the last run, with the `numbers` of its hinges.
    pub(super) fn add_group<const F: usize>(
        &mut self,
        stencils: &[&Stencil<F>],
        numbers: &BTreeMap<u32, u16>,
    ) {
        let Some(run) = self.runs.last_mut() else { return };
        // Lanes that repeat a stencil act on a group after those of the run.
        let nowhere = (GROUP * run.hinges.len()) as u16;
        let first = self.numbers.len();
        for b in 0..stencils[0].bends.len() {
            let number = |lane: usize| stencils.get(lane).map_or(nowhere, |one| numbers[&one.bends[b].hinge]);
            self.numbers.push(std::array::from_fn(number));
        }
        self.groups.push(first..self.numbers.len());
        run.groups.end = self.groups.len();
    }

    /// Adds the forces of the run that begins with stencil `start` to the sums of a patch; `forms` are those of the
    /// potential, in the `unit` of energy, J.
    pub(super) fn add_gradients<const F: usize>(
        &self,
        (arch, forms, unit): (Arch, &[FormPack<F>], f64),
        start: usize,
        patch: Patch<'_>,
    ) {
        let Some(run) = self.runs.get(start / self.length) else { return };
        SCRATCH.with_borrow_mut(|scratch| {
            let needed = run.hinges.len() + 1;
            scratch.resize(needed.max(scratch.len()), Evaluated::default());
            // The last one belongs to the lanes that repeat a stencil: its ψ is zero.
            scratch[needed - 1] = Evaluated::default();
            arch.dispatch(Forces { runs: self, run, forms, unit, evaluated: &mut scratch[..needed], patch });
        });
    }
}

struct Forces<'a, const F: usize> {
    runs: &'a Runs,
    run: &'a Run,
    forms: &'a [FormPack<F>],
    unit: f64,
    evaluated: &'a mut [Evaluated],
    patch: Patch<'a>,
}

impl<const F: usize> WithSimd for Forces<'_, F> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { runs, run, forms, unit, evaluated, patch } = self;
        let Patch { places, x, sums } = patch;
        let zero = Lane::splat(simd, 0.0);
        let hinges = &runs.hinges[run.hinges.clone()];
        for (hinges, evaluated) in hinges.iter().zip(&mut *evaluated) {
            let places = hinges.places(places);
            for part in 0..parts::<S>() {
                let fold = hinges.fold(simd, part, &places, x);
                let turn = turn(simd, part, &hinges.rest, &fold);
                let Slopes { free, s } = fold.slopes();
                for side in 0..2 {
                    for i in 0..3 {
                        evaluated.free[side][i].store(part, free[side][i]);
                    }
                    evaluated.s[side].store(part, s[side]);
                }
                evaluated.psi.store(part, turn.value());
                evaluated.softening.store(part, turn.softening());
            }
            evaluated.coupled = Pack::default();
        }
        let mut values = [Pack::default(); BENDS];
        for group in &runs.groups[run.groups.clone()] {
            let (forms, numbers) = (&forms[group.clone()], &runs.numbers[group.clone()]);
            for (value, hinges) in values.iter_mut().zip(numbers) {
                for lane in 0..GROUP {
                    let hinge = usize::from(hinges[lane]);
                    value.0[lane] = evaluated[hinge / GROUP].psi.0[hinge % GROUP];
                }
            }
            for part in 0..parts::<S>() {
                let mut y = [zero; F];
                for (value, form) in values.iter().zip(forms) {
                    let (psi, form) = (value.load(simd, part), form.load(simd, part));
                    for f in 0..F {
                        y[f] = form[f].mul_add(psi, y[f]);
                    }
                }
                for (value, form) in values.iter_mut().zip(forms) {
                    value.store(part, dot_add(&form.load(simd, part), &y, zero));
                }
            }
            for (value, hinges) in values.iter().zip(numbers) {
                for lane in 0..GROUP {
                    let hinge = usize::from(hinges[lane]);
                    evaluated[hinge / GROUP].coupled.0[hinge % GROUP] += value.0[lane];
                }
            }
        }
        for (hinges, evaluated) in hinges.iter().zip(&*evaluated) {
            let places = hinges.places(places);
            for part in 0..parts::<S>() {
                let first_lane = part * S::F64_LANES;
                let coupled = evaluated.coupled.load(simd, part);
                let own = hinges.stiffness.load(simd, part) * evaluated.psi.load(simd, part);
                let moment = evaluated.softening.load(simd, part).mul_add(own - coupled, coupled) * unit;
                let [one, two] = &evaluated.free;
                let slopes = Slopes {
                    free: [vec3!(i => one[i].load(simd, part)), vec3!(i => two[i].load(simd, part))],
                    s: [evaluated.s[0].load(simd, part), evaluated.s[1].load(simd, part)],
                };
                let slopes = slopes.at_corners();
                for c in 0..4 {
                    let force = vec3!(i => moment * slopes[c][i]);
                    add_to_places(simd, force, &places[c][first_lane..], 1, sums);
                }
            }
        }
    }
}
