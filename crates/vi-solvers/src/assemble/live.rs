//! Sums live terms. They are evaluated with the stencils near one configuration. When a node leaves the reach of
//! these stencils, new ones are requested.
//!
//! If a scheme uses discrete gradients, the terms that have one are kept apart from the others. They are summed from
//! an array that holds the end of the step followed by its start.

mod near;
mod state;

use std::sync::Arc;

use vi_core::{Acting, Damper, Fault, Impulse, Live, Meeting, Potential, StepOutcome, StepSpan, Terms, Tube};

use crate::assemble::energy::Energies;
use crate::assemble::fixed::FixedSum;
use crate::assemble::hessian::HessianEvaluation;
use crate::assemble::passage::Passage;
use crate::error::{SolverError, TermFault};
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::matrix_sum::MatrixSum;
use crate::vectors;

use near::Near;
use state::{FAR, Region, distance};

pub(crate) use near::END_PER_STAGE;
pub(crate) use state::LiveState;

/// A matrix is not made of stencils whose reach is more than this multiple of the needed one.
const LONGEST_REACH: f64 = 2.0;

/// The sum of the live terms of a list.
pub(crate) struct LiveSum {
    terms: Terms,
    /// Whether terms with a discrete gradient are kept apart.
    splits: bool,
    /// Number of coordinates per node of the matrix of the fixed terms; `None` if there are no fixed terms.
    block: Option<usize>,
    state: LiveState,
    near: Option<Near>,
    /// The region of the stencils, if it has a path.
    tube: Option<Tube>,
    union: Option<MatrixSum>,
    /// The fault of a live term whose stencils cannot be used.
    fault: Option<TermFault>,
    buffer: Vec<f64>,
    /// Positions at the end of a step, then at its start.
    pair: Vec<f64>,
    passage: Passage,
    renewals: u64,
    patterns: u64,
}

impl LiveSum {
    /// Returns the sum, or `None` if the list has no live terms.
    pub(crate) fn new(terms: &Terms, block: usize, splits: bool) -> Option<Self> {
        if terms.live().is_empty() {
            return None;
        }
        Some(Self {
            terms: terms.clone(),
            splits,
            block: (!terms.fixed().is_empty()).then_some(block),
            state: LiveState::default(),
            near: None,
            tube: None,
            union: None,
            fault: None,
            buffer: vec![0.0; terms.coordinates().dof_count()],
            pair: Vec::new(),
            passage: Passage::new(terms.live().len()),
            renewals: 0,
            patterns: 0,
        })
    }

    /// Returns how often stencils were requested, and how often the pattern of the sum of Hessians was built.
    pub(crate) fn counts(&self) -> [u64; 2] {
        [self.renewals, self.patterns]
    }

    pub(crate) fn state(&self) -> LiveState {
        LiveState { step: self.passage.now().clone(), ..self.state.clone() }
    }

    /// Restores the stencils of a state.
    pub(crate) fn go_to(&mut self, state: &LiveState) {
        self.union = None;
        (self.near, self.tube) = (None, None);
        self.state = LiveState::default();
        self.passage.go_to(&state.step);
        if !state.region.about.is_empty() {
            self.renew(state.region.clone());
        }
        self.state = state.clone();
    }

    /// Requests the stencils of a region.
    fn renew(&mut self, region: Region) {
        self.renewals += 1;
        self.tube = region.tube();
        match self.ask(&region, self.tube.as_ref()) {
            Ok(near) => (self.near, self.fault) = (Some(near), None),
            Err(fault) => (self.near, self.fault) = (None, Some(fault)),
        }
        self.state.region = region;
    }

    fn ask(&self, region: &Region, tube: Option<&Tube>) -> Result<Near, TermFault> {
        let potential = |term: &Arc<dyn Live>| match tube {
            Some(tube) => term.within(tube),
            None => term.near(&region.about, region.reach.max(term.reach())),
        };
        let potentials: Vec<Arc<dyn Potential>> = self.terms.live().iter().map(potential).collect();
        for potential in &potentials {
            let stencils = potential.stencils();
            if self.block.is_some_and(|block| !stencils.block.is_multiple_of(block)) {
                let domain = "must be a multiple of that of the fixed terms";
                let value = stencils.block as f64;
                let fault =
                    Fault { element: 0, quantity: "coordinates per node of a stencil", value, domain };
                return Err(TermFault { term: potential.name().to_owned(), fault });
            }
        }
        let assembler = |potentials: Vec<Arc<dyn Potential>>| {
            let terms = Terms::new(Arc::clone(self.terms.shared_coordinates()), potentials);
            let terms = terms.map_err(|error| match error {
                vi_core::CoreError::Stencil { term, stencil, node, .. } => {
                    let (quantity, domain) = ("node", "must be a node of the system");
                    let fault = Fault { element: stencil, quantity, value: node as f64, domain };
                    TermFault { term, fault }
                }
                other => {
                    let fault = Fault {
                        element: 0,
                        quantity: "term",
                        value: f64::NAN,
                        domain: "must have valid stencils",
                    };
                    TermFault { term: other.to_string(), fault }
                }
            })?;
            Ok(FixedSum::new(terms, self.block))
        };
        let has_discrete = potentials.iter().any(|potential| potential.discrete_gradient().is_some());
        let numbered = potentials.iter().cloned().enumerate();
        let (discrete, plain): (Vec<_>, Vec<_>) =
            numbered.partition(|(_, potential)| potential.discrete_gradient().is_some());
        let parts = if self.splits && has_discrete {
            let plain = plain.into_iter().map(|(_, potential)| potential).collect();
            Some([assembler(plain)?, assembler(self.passage.paired(&discrete))?])
        } else {
            None
        };
        let over = self.passage.over_each(&discrete);
        Ok(Near { whole: assembler(potentials)?, parts, discrete, over, close: None })
    }

    /// Returns whether the stencils are valid at positions `x`.
    fn serves(&self, x: &[f64]) -> bool {
        match &self.tube {
            Some(tube) => tube.contains(x),
            None => self.state.region.is_near(x),
        }
    }

    /// Ensures that the stencils are valid at positions `x`, and at all `others` too. Positions that are not finite have no
    /// energy; the fixed terms report this to the caller.
    fn follow<'a>(&mut self, x: &[f64], others: impl IntoIterator<Item = &'a [f64]> + Clone) {
        if self.serves(x) && others.clone().into_iter().all(|x| self.serves(x)) {
            return;
        }
        if let Some(region) = Region::around(x, others, self.shortest_reach()) {
            self.renew(region);
        }
    }

    /// Requests stencils with a shorter reach if a step from `start` to `end` needs much less than the present one: the
    /// matrix has an entry for every stencil.
    fn tighten(&mut self, start: &[f64], end: &[f64]) {
        if let Some(needed) = Region::around(start, Some(end), self.shortest_reach())
            && self.near.is_some()
            && self.state.region.reach > LONGEST_REACH * needed.reach
        {
            self.renew(needed);
        }
    }

    /// Returns the shortest reach of the terms, m.
    pub(crate) fn shortest_reach(&self) -> f64 {
        self.terms.live().iter().map(|term| term.reach()).fold(f64::INFINITY, f64::min)
    }

    /// Returns Σ V of the live terms by account, J; infinite if a term cannot be used.
    pub(crate) fn energies(&mut self, x: &[f64], t: f64) -> Energies {
        self.follow(x, None);
        match &mut self.near {
            Some(near) => {
                let terms = near.whole.terms().fixed();
                let of = |term: &Arc<dyn Potential>| Some((term.account(), term.energy(x, t)?));
                match terms.iter().map(of).collect::<Option<Vec<_>>>() {
                    Some(parts) => parts.into_iter().fold(Energies::default(), Energies::with),
                    None => near.whole.energies(x, t),
                }
            }
            None => Energies { contact: f64::INFINITY, ..Energies::default() },
        }
    }

    /// Adds ∂V/∂x of the terms that act by their gradient.
    pub(crate) fn add_gradient(&mut self, x: &[f64], t: f64, out: &mut [f64]) {
        self.follow(x, None);
        let Self { near, buffer, .. } = self;
        let Some(near) = near else { return out.fill(f64::NAN) };
        let assembler = match &mut near.parts {
            Some([plain, _]) => plain,
            None => &mut near.whole,
        };
        assembler.gradient(x, t, buffer);
        vectors::update(out, |k, out| *out += buffer[k]);
    }

    /// Opens a step from positions `x` (m). Terms that dissipate continue from the memory that they
    /// have there.
    pub(crate) fn open_step(&mut self, x: &[f64], span: StepSpan) -> Result<(), SolverError> {
        if self.splits && self.passage.open(x, span) {
            self.exchange()?;
        }
        Ok(())
    }

    /// Gives the current step to the terms with a discrete gradient.
    fn exchange(&mut self) -> Result<(), SolverError> {
        let Self { near: Some(near), passage, .. } = self else { return Ok(()) };
        if let Some([_, discrete]) = &mut near.parts {
            discrete.exchange(passage.paired(&near.discrete))?;
            near.over = passage.over_each(&near.discrete);
            near.close = None;
        }
        Ok(())
    }

    /// Returns the effects of the terms' forces without a potential, over the step from `start` to `end`.
    pub(crate) fn close_step(&mut self, start: &[f64], end: &[f64]) -> StepOutcome {
        self.follow(start, Some(end));
        let near = self.near.as_ref().filter(|near| near.parts.is_some());
        self.passage.close(near.map_or(&[], |near| &near.discrete), start, end)
    }

    /// Returns the dampers at the end of the step that was closed last; see [`Passage::dampers`].
    pub(crate) fn dampers(&self, x: &[f64], velocity: &[f64]) -> Vec<Damper> {
        let near = self.near.as_ref().filter(|near| near.parts.is_some());
        self.passage.dampers(near.map_or(&[], |near| &near.discrete), x, velocity)
    }

    /// See [`Passage::add_impulses`].
    pub(crate) fn add_impulses(&mut self, impulses: &[Impulse]) {
        self.passage.add_impulses(impulses);
    }

    /// Accepts the step that was closed last.
    pub(crate) fn accept_step(&mut self, start: &[f64], end: &[f64]) {
        self.passage.accept(start, end);
    }

    /// Returns whether any term has a memory between steps.
    pub(crate) fn remembers(&self) -> bool {
        self.passage.remembers()
    }

    /// Returns the energy that the terms store between steps besides V, J.
    pub(crate) fn stored(&self) -> f64 {
        self.passage.stored()
    }

    /// Returns the impulses between parts since the last call, N s.
    pub(crate) fn take_impulses(&mut self) -> Vec<Impulse> {
        self.passage.take_impulses()
    }

    /// Returns the smallest gap of the pairs that acted in the steps since the last call, m.
    pub(crate) fn take_smallest_gap(&mut self) -> Option<f64> {
        self.passage.take_smallest_gap()
    }

    /// Returns the nodes of a pair that obstructs the straight path from `start` to `end`; `None` if all terms allow it. A
    /// term may keep a margin relative to the start of a step; then the rest of the path is checked again from the point
    /// that the term allows.
    pub(crate) fn obstacle(&mut self, start: &[f64], end: &[f64]) -> Option<[u32; 4]> {
        const ASKED: usize = 4;
        let mut x = start.to_vec();
        for _ in 0..ASKED {
            let dx: Vec<f64> = x.iter().zip(end).map(|(x, end)| end - x).collect();
            let part = self.largest_step(&x, &dx, None);
            if part >= 1.0 {
                return None;
            }
            x.iter_mut().zip(&dx).for_each(|(x, dx)| *x += part * dx);
        }
        let (meetings, _) = self.meetings(&x, [&x, end], 0.0);
        let first = meetings.into_iter().min_by(|a, b| a.part.total_cmp(&b.part));
        Some(first.map_or([0; 4], |meeting| meeting.nodes))
    }

    /// Adds G(start, end) of the terms that act by a discrete gradient.
    pub(crate) fn add_discrete_gradient(&mut self, start: &[f64], end: &[f64], out: &mut [f64]) {
        self.follow(start, Some(end));
        self.place(start, end);
        let Self { near, buffer, pair, .. } = self;
        let Some(near) = near else { return out.fill(f64::NAN) };
        if let Some([_, discrete]) = &mut near.parts {
            discrete.gradient(pair, 0.0, buffer);
            vectors::update(out, |k, out| *out += buffer[k]);
        }
    }

    /// Returns whether all terms list the forces of their pairs.
    pub(crate) fn lists_pairs(&self) -> bool {
        self.splits && self.terms.live().iter().all(|term| term.lists_pairs())
    }

    /// Returns whether any pair is near a step from `start` to `end`.
    pub(crate) fn has_candidates(&mut self, start: &[f64], end: &[f64]) -> bool {
        self.follow(start, Some(end));
        let near = self.near.as_ref();
        near.is_some_and(|near| near.discrete.iter().any(|(_, term)| term.stencil_count() > 0))
    }

    /// Appends the forces of the pairs over the open step to `out`. Returns false if a term cannot be used.
    pub(crate) fn list_pairs(&mut self, start: &[f64], end: &[f64], out: &mut Acting) -> bool {
        self.follow(start, Some(end));
        let Self { near: Some(near), passage, .. } = self else { return false };
        near.choose(start, &[end], passage);
        let (terms, over) = near.of_step();
        for ((_, term), over) in terms.iter().zip(over) {
            if let Some(discrete) = over.as_deref().or(term.discrete_gradient()) {
                discrete.acting(start, end, out);
            }
        }
        true
    }

    /// Returns whether any term dissipates energy over the open step near positions x.
    pub(crate) fn dissipates(&mut self, x: &[f64]) -> bool {
        self.follow(x, None);
        self.near.as_ref().is_some_and(|near| near.over.iter().any(Option::is_some))
    }

    /// Returns the tangents of the discrete gradients over the open step; `None` if there are none.
    pub(crate) fn tangents_over(&mut self, start: &[f64], end: &[f64]) -> Option<&SymmetricMatrix> {
        self.follow(start, Some(end));
        self.place(start, end);
        let Self { near, pair, .. } = self;
        let [_, discrete] = near.as_mut()?.parts.as_mut()?;
        Some(discrete.hessian(pair, 0.0, HessianEvaluation::Exact))
    }

    /// Returns the tangents of discrete gradients that the last Hessian contains, and their factor in it.
    pub(crate) fn last_tangents(&self) -> Option<(f64, &SymmetricMatrix)> {
        let [_, discrete] = self.near.as_ref()?.parts.as_ref()?;
        Some((END_PER_STAGE, discrete.last_hessian()?))
    }

    /// Returns the groups of nodes that meet on the path from `x` to `end` in a step from `start`, and the number of
    /// candidates that were checked; see [`Potential::meetings`](vi_core::Potential::meetings).
    pub(crate) fn meetings(
        &mut self,
        start: &[f64],
        [x, end]: [&[f64]; 2],
        kept: f64,
    ) -> (Vec<Meeting>, usize) {
        self.follow(start, [x, end]);
        let Self { near: Some(near), passage, .. } = self else { return (Vec::new(), 0) };
        near.choose(start, &[x, end], passage);
        let terms = || near.of_step().0.iter().map(|(_, term)| term);
        let meetings = terms().flat_map(|term| term.meetings(x, end, kept)).collect();
        (meetings, terms().map(|term| term.stencil_count()).sum())
    }

    fn place(&mut self, start: &[f64], end: &[f64]) {
        self.pair.clear();
        self.pair.extend_from_slice(end);
        self.pair.extend_from_slice(start);
    }

    /// Returns the Hessian of all terms, given the Hessian `fixed` of the fixed ones. For a step with two ends and
    /// its stage at `x` it contains the tangents of discrete gradients.
    pub(crate) fn hessian<'a>(
        &'a mut self,
        fixed: &'a SymmetricMatrix,
        x: &[f64],
        t: f64,
        kind: HessianEvaluation,
        ends: Option<[&[f64]; 2]>,
    ) -> Result<&'a SymmetricMatrix, SolverError> {
        match ends {
            Some([start, end]) => {
                self.tighten(start, end);
                self.follow(start, Some(end));
                self.place(start, end);
            }
            None => self.follow(x, None),
        }
        if self.union.is_none() && self.state.pattern != self.state.region {
            // The run that this one continues built the pattern at another place.
            self.restore_pattern(fixed, x, t, ends.is_some())?;
        }
        let Self { near, union, state, pair, patterns, .. } = self;
        let Some(near) = near else { return Ok(fixed) };
        let parts = near.hessians(fixed, x, pair, t, kind, ends.is_some());
        let matrices: Vec<&SymmetricMatrix> = parts.iter().map(|part| part.1).collect();
        let is_contained = union.as_mut().is_some_and(|union| union.admit(&matrices));
        if !is_contained {
            *union = Some(MatrixSum::new(&matrices)?);
            *patterns += 1;
            state.pattern.clone_from(&state.region);
        }
        match union {
            Some(union) => Ok(union.combine(&parts)),
            None => Ok(fixed),
        }
    }

    /// Returns the Hessian of the terms that act by their gradient, if terms with a discrete gradient are kept apart.
    pub(crate) fn plain_hessian(&mut self, x: &[f64], t: f64) -> Option<&SymmetricMatrix> {
        self.follow(x, None);
        let [plain, _] = self.near.as_mut()?.parts.as_mut()?;
        Some(plain.hessian(x, t, HessianEvaluation::Exact))
    }

    fn restore_pattern(
        &mut self,
        fixed: &SymmetricMatrix,
        x: &[f64],
        t: f64,
        has_ends: bool,
    ) -> Result<(), SolverError> {
        if self.state.pattern.about.is_empty() {
            return Ok(());
        }
        let Ok(mut near) = self.ask(&self.state.pattern, self.state.pattern.tube().as_ref()) else {
            return Ok(());
        };
        let parts = near.hessians(fixed, x, &self.pair, t, HessianEvaluation::Exact, has_ends);
        let matrices: Vec<&SymmetricMatrix> = parts.iter().map(|part| part.1).collect();
        self.union = Some(MatrixSum::new(&matrices)?);
        self.patterns += 1;
        Ok(())
    }

    /// Returns the largest fraction of a step that all terms allow: of the change `dx` from x, or, for terms that act
    /// by a discrete gradient, of the change of the end of the step, (end, change), with x in its middle.
    ///
    /// The first correction of a body that nothing holds yet can be many times its size. Of such a path first a short part is
    /// examined, then one twice as long, until a term stops it: with stencils for the whole path, all pairs would be candidates.
    pub(crate) fn largest_step(&mut self, x: &[f64], dx: &[f64], end: Option<[&[f64]; 2]>) -> f64 {
        let (from, along) = end.map_or((x, dx), |[end, change]| (end, change));
        let start: Vec<f64> = x.iter().zip(from).map(|(x, from)| 2.0 * x - from).collect();
        let short = (2.0 * FAR * self.shortest_reach()).max(distance(&start, from));
        let length = 3.0_f64.sqrt() * vectors::max_abs(along.len(), |k| along[k]);
        let mut part = match short / length {
            part if part > 0.0 => part.min(1.0),
            _ => 1.0,
        };
        let scaled = |part: f64, change: &[f64]| change.iter().map(|change| part * change).collect();
        while part < 1.0 {
            let [dx, along]: [Vec<f64>; 2] = [scaled(part, dx), scaled(part, along)];
            let allowed = self.allowed(&start, [x, &dx], end.map(|[end, _]| [end, &along[..]]));
            if allowed < 1.0 {
                return part * allowed;
            }
            part = (2.0 * part).min(1.0);
        }
        self.allowed(&start, [x, dx], end)
    }

    /// Returns the fraction of a path that all terms allow, as [`LiveSum::largest_step`] describes, in a step from `start`.
    fn allowed(&mut self, start: &[f64], [x, dx]: [&[f64]; 2], end: Option<[&[f64]; 2]>) -> f64 {
        let (from, along) = end.map_or((x, dx), |[end, change]| (end, change));
        let to: Vec<f64> = from.iter().zip(along).map(|(from, along)| from + along).collect();
        self.follow(start, [from, &to]);
        let Some(near) = &self.near else { return 1.0 };
        let least = |assembler: &FixedSum, x: &[f64], dx: &[f64]| {
            let terms = assembler.terms().fixed().iter().filter(|term| term.limits_steps());
            terms.map(|term| term.largest_step(x, dx)).fold(1.0, f64::min)
        };
        match (&near.parts, end) {
            (Some([plain, discrete]), Some([end, change])) => {
                least(plain, x, dx).min(least(discrete, end, change))
            }
            _ => least(&near.whole, x, dx),
        }
    }

    /// Returns whether any terms act by a discrete gradient.
    pub(crate) fn has_discrete(&self) -> bool {
        self.near.as_ref().is_some_and(|near| near.parts.is_some())
    }

    /// Returns the first stencil without a finite value.
    pub(crate) fn fault(&self, x: &[f64], t: f64) -> Option<TermFault> {
        self.fault.clone().or_else(|| self.near.as_ref()?.whole.fault(x, t))
    }
}
