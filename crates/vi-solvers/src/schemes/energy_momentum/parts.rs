//! The parts of a body that are connected by its stencils, and the rigid motions under which the energy of each is
//! invariant.

use vi_core::{DisjointSets, HessianKind, Potential, System};

use crate::assemble::invariance;
use crate::index::{NONE, free_of};

/// The parts of a body that are connected by stencils of terms that are not affine.
pub(super) struct Parts {
    pub(super) count: usize,
    /// The part of each free coordinate, or [`NONE`] if only affine terms act on it.
    pub(super) of_free: Vec<u32>,
    /// The part of each stencil, per term; empty for affine terms.
    pub(super) of_stencils: Vec<Vec<u32>>,
    /// For each part, the translations under which V is invariant, and whether it is invariant under rotations.
    pub(super) translations: Vec<[bool; 3]>,
    pub(super) rotations: Vec<bool>,
    /// Pairs of a part and a prescribed coordinate of its stencils; empty if no support moves.
    pub(super) prescribed: Vec<(u32, u32)>,
    /// Whether coordinates that move may belong to several parts, or the gradient of the system contains more than the
    /// gradients of its potentials in space.
    pub(super) share_coordinates: bool,
}

impl Parts {
    pub(super) fn new(system: &System) -> Self {
        let coordinates = system.coordinates();
        let free_of = free_of(coordinates);
        let mut sets = DisjointSets::new(coordinates.free_count());
        let terms: Vec<_> =
            system.potentials().iter().map(|term| (term, invariance::is_internal(term.as_ref()))).collect();
        let is_affine = |term: &dyn Potential| term.traits().hessian == HessianKind::Zero;
        let dofs = |term: &dyn Potential, stencil: usize| {
            let stencils = term.stencils();
            let block = stencils.block;
            let mut dofs = Vec::new();
            for &node in stencils.of(stencil) {
                // A tied node is replaced by the nodes of its sum.
                match coordinates.combination(node * block as u32 / 3) {
                    Some(terms) => {
                        dofs.extend(terms.iter().flat_map(|&(k, _)| 3 * k as usize..3 * k as usize + 3));
                    }
                    None => dofs.extend(node as usize * block..(node as usize + 1) * block),
                }
            }
            dofs
        };
        for (term, _) in terms.iter().filter(|(term, _)| !is_affine(term.as_ref())) {
            for stencil in 0..term.stencils().count() {
                let mut free = dofs(term.as_ref(), stencil).into_iter().map(|dof| free_of[dof]);
                let mut free = free.by_ref().filter(|&k| k != NONE);
                if let Some(first) = free.next() {
                    free.for_each(|k| sets.join(first, k));
                }
            }
        }
        // Number the parts in the order of their first coordinate.
        let mut number = vec![NONE; coordinates.free_count()];
        let mut count = 0;
        let mut of_stencils = Vec::new();
        let (mut translations, mut rotations): (Vec<[bool; 3]>, Vec<bool>) = (Vec::new(), Vec::new());
        let is_moving = coordinates.is_moving();
        let mut prescribed = Vec::new();
        for (term, internal) in &terms {
            let mut of_term = Vec::new();
            if !is_affine(term.as_ref()) {
                for stencil in 0..term.stencils().count() {
                    let dofs = dofs(term.as_ref(), stencil);
                    let first = dofs.iter().map(|&dof| free_of[dof]).find(|&k| k != NONE);
                    let Some(first) = first else {
                        of_term.push(NONE);
                        continue;
                    };
                    let root = sets.root(first) as usize;
                    if number[root] == NONE {
                        number[root] = count;
                        count += 1;
                        translations.push([true; 3]);
                        rotations.push(true);
                    }
                    let part = number[root] as usize;
                    of_term.push(part as u32);
                    // A fixed coordinate, or a term that depends on absolute position, breaks the symmetry.
                    for dof in dofs {
                        let node = dof as u32 / 3;
                        let has_own_axes = coordinates.axes_of(node).is_some();
                        if free_of[dof] == NONE && is_moving {
                            prescribed.push((part as u32, dof as u32));
                        }
                        if free_of[dof] == NONE || has_own_axes {
                            rotations[part] = false;
                            // A fixed director does not change under translations.
                            if has_own_axes {
                                translations[part] = [false; 3];
                            } else if !coordinates.is_director(node) {
                                translations[part][dof % 3] = false;
                            }
                        }
                    }
                    if !internal {
                        translations[part] = [false; 3];
                        rotations[part] = false;
                    }
                }
            }
            of_stencils.push(of_term);
        }
        let of_free = (0..coordinates.free_count() as u32).map(|k| number[sets.root(k) as usize]).collect();
        prescribed.sort_unstable();
        prescribed.dedup();
        let share_coordinates = is_moving
            || !coordinates.is_plain()
            || !system.forces().is_empty()
            || !system.terms().live().is_empty();
        let count = count as usize;
        Self { count, of_free, of_stencils, translations, rotations, prescribed, share_coordinates }
    }

    /// Returns the sums over the free coordinates of each part.
    pub(super) fn sums(&self, term: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.count];
        for (k, &part) in self.of_free.iter().enumerate() {
            if part != NONE {
                sums[part as usize] += term(k);
            }
        }
        sums
    }
}
