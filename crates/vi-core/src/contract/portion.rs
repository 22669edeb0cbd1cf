//! A portion of a system: some of its nodes and stencils with numbers of their own, for one of several processes.

use std::cell::RefCell;
use std::ops::Range;
use std::sync::Arc;

use crate::contract::coordinates::{Coordinates, Fixed, Path, Prescribed};
use crate::contract::patch::Patch;
use crate::contract::potential::{Account, Fault, Potential, Stencils, Traits};

thread_local! {
    /// Positions of all coordinates of a whole system, of which only those of the last stencils are valid. Memory that
    /// is never written takes no space.
    static POSITIONS: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

/// A run of the stencils of a potential, on the nodes of a portion. Every stencil has the bits that it has in the whole
/// potential.
pub struct Portion {
    whole: Arc<dyn Potential>,
    /// Its stencils in the whole potential.
    stencils: Range<usize>,
    /// Their nodes in the numbers of the portion.
    nodes: Vec<u32>,
    run_length: usize,
    /// Number of coordinates of the whole system.
    dof_count: usize,
}

impl Portion {
    /// Returns the stencils `stencils` of `whole`, a term of a system with `dof_count` coordinates. `number` gives the
    /// number that a node of these stencils has in the portion. It shares the data of `whole`.
    pub fn new(
        whole: Arc<dyn Potential>,
        stencils: Range<usize>,
        dof_count: usize,
        number: impl Fn(u32) -> u32,
    ) -> Self {
        let all = whole.stencils();
        let nodes = &all.nodes[stencils.start * all.arity..stencils.end * all.arity];
        let nodes = nodes.iter().map(|&node| number(node)).collect();
        let run_length = whole.run_length();
        Self { whole, stencils, nodes, run_length, dof_count }
    }

    /// Returns the portion with data of its own, so that the whole potential can be dropped if it is large.
    #[must_use]
    pub fn detached(self) -> Self {
        match self.whole.portion(self.stencils.clone()) {
            Some(whole) => Self { whole, stencils: 0..self.stencils.len(), ..self },
            None => self,
        }
    }

    /// Returns the range in the whole potential.
    fn in_whole(&self, range: &Range<usize>) -> Range<usize> {
        range.start + self.stencils.start..range.end + self.stencils.start
    }

    /// Calls `evaluate` with a range of the whole potential and positions in which the nodes of that range are valid.
    fn placed<R>(
        &self,
        range: Range<usize>,
        x: &[f64],
        evaluate: impl FnOnce(Range<usize>, &[f64]) -> R,
    ) -> R {
        let (all, whole) = (self.whole.stencils(), self.in_whole(&range));
        let (arity, block) = (all.arity, all.block);
        let own = &self.nodes[range.start * arity..range.end * arity];
        let far = &all.nodes[whole.start * arity..whole.end * arity];
        POSITIONS.with_borrow_mut(|positions| {
            if positions.len() < self.dof_count {
                *positions = vec![0.0; self.dof_count];
            }
            for (&own, &far) in own.iter().zip(far) {
                let (own, far) = (own as usize * block, far as usize * block);
                positions[far..far + block].copy_from_slice(&x[own..own + block]);
            }
            evaluate(whole, &positions[..self.dof_count])
        })
    }
}

impl Potential for Portion {
    fn name(&self) -> &str {
        self.whole.name()
    }

    fn account(&self) -> Account {
        self.whole.account()
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { nodes: &self.nodes, ..self.whole.stencils() }
    }

    fn run_length(&self) -> usize {
        self.run_length
    }

    fn traits(&self) -> Traits {
        self.whole.traits()
    }

    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.placed(range, x, |range, x| self.whole.energies(range, x, t, out));
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.placed(range, x, |range, x| self.whole.gradients(range, x, t, out));
    }

    fn adds_gradients(&self) -> bool {
        self.whole.adds_gradients()
    }

    fn add_gradients(&self, range: Range<usize>, t: f64, patch: Patch<'_>) {
        self.whole.add_gradients(self.in_whole(&range), t, patch);
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.placed(range, x, |range, x| self.whole.hessians(range, x, t, out));
    }

    fn projected_hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.placed(range, x, |range, x| self.whole.projected_hessians(range, x, t, out));
    }

    fn mean_deformations(&self, range: Range<usize>, x: &[f64], out: &mut [f64]) -> bool {
        self.placed(range, x, |range, x| self.whole.mean_deformations(range, x, out))
    }

    fn element(&self, stencil: usize) -> usize {
        self.whole.element(stencil + self.stencils.start)
    }

    fn fault(&self, stencil: usize, x: &[f64], t: f64) -> Option<Fault> {
        self.placed(stencil..stencil + 1, x, |range, x| self.whole.fault(range.start, x, t))
    }
}

/// Some of the coordinates of a path.
struct PathPortion {
    whole: Arc<Coordinates>,
    /// Index of the path in the whole coordinates.
    group: usize,
    /// Places of its coordinates among those of the path.
    places: Vec<u32>,
}

impl PathPortion {
    fn choose(&self, out: &mut [f64], evaluate: impl FnOnce(&dyn Path, &mut [f64])) {
        let Prescribed { dofs, path } = &self.whole.prescribed()[self.group];
        let mut all = vec![0.0; dofs.len()];
        evaluate(path.as_ref(), &mut all);
        for (out, &place) in out.iter_mut().zip(&self.places) {
            *out = all[place as usize];
        }
    }
}

impl Path for PathPortion {
    fn position(&self, t: f64, out: &mut [f64]) {
        self.choose(out, |path, all| path.position(t, all));
    }

    fn velocity(&self, t: f64, out: &mut [f64]) {
        self.choose(out, |path, all| path.velocity(t, all));
    }
}

/// Returns the coordinates of the nodes `nodes` (ascending, `block` coordinates each), numbered in this order, with
/// their prescribed motions. `whole` must satisfy [`Coordinates::is_plain`].
pub fn coordinates_of_nodes(
    whole: &Arc<Coordinates>,
    nodes: &[u32],
    block: usize,
) -> Result<Coordinates, crate::error::CoreError> {
    let mut prescribed = Vec::new();
    for (group, Prescribed { dofs, path }) in whole.prescribed().iter().enumerate() {
        let (mut own, mut places) = (Vec::new(), Vec::new());
        for (place, &dof) in (0_u32..).zip(dofs) {
            if let Ok(node) = nodes.binary_search(&(dof / block as u32)) {
                own.push((node * block) as u32 + dof % block as u32);
                places.push(place);
            }
        }
        if own.is_empty() {
            continue;
        }
        let portion = PathPortion { whole: Arc::clone(whole), group, places };
        let path: Box<dyn Path> = if path.is_fixed() {
            // It need not keep the whole coordinates.
            let mut at = vec![0.0; own.len()];
            portion.position(0.0, &mut at);
            Box::new(Fixed(at))
        } else {
            Box::new(portion)
        };
        prescribed.push(Prescribed { dofs: own, path });
    }
    Coordinates::new(block * nodes.len(), prescribed)
}
