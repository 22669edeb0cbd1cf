//! Contact as a [`vi_core::Live`] term: C(x) as a sum over the candidates near one configuration.
//!
//! Every candidate is a stencil of four nodes. Pairs with fewer nodes repeat their last node, where their blocks are
//! zero. The energy of a point is grouped by closest feature before it is distributed. Each group goes to the first
//! candidate of its point that contains it, so that the block of a stencil depends on positions alone.

mod acting;
mod book;
mod damping;
mod lagged;
mod listed;
mod rolling;
mod sliding;
mod step;

pub use rolling::RollingTerm;

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use vi_core::{
    Account, Acting, DiscreteGradient, Fault, HessianKind, Impulse, Live, Meeting, Potential, Stencils,
    StepSpan, Traits, Tube, packed_len,
};

use crate::broad_phase::{Neighbours, Search};
use crate::ccd::Impact;
use crate::distance::at;
use crate::error::ContactError;
use crate::friction::Step;
use crate::pairs::Contact;
use crate::surface::{Gauge, Surface};

/// Sizes of the gradient and of the packed Hessian of a stencil.
const SIZE: usize = 12;
const PACKED: usize = packed_len(SIZE);

/// Fraction of the proved free path that a correction of all nodes may use.
const MARGIN: f64 = 0.9;

/// The contact energy of surfaces, at every configuration.
#[derive(Debug, Clone)]
pub struct ContactTerm {
    surface: Arc<Surface>,
    reach: f64,
    /// The last search along a path. The next one often differs at few nodes.
    search: Arc<Mutex<Option<Search>>>,
    /// The last result about one configuration, and its tube. Observers ask several times for the same one.
    about: Arc<Mutex<Option<(Tube, ContactPotential)>>>,
}

impl ContactTerm {
    /// Returns the contact of surfaces. Nodes may move by `reach` (m) before candidates are searched again; a quarter of
    /// the activation distance is a good choice.
    pub fn new(surface: Arc<Surface>, reach: f64) -> Self {
        Self { surface, reach, search: Arc::default(), about: Arc::default() }
    }

    /// Returns the contact with other activation distances (m) of some pairs of bodies, none of which is larger than before, and
    /// other positions at the start, m. Candidates about the last configuration are chosen from the known ones.
    ///
    /// # Errors
    /// Returns [`ContactError`] if a distance is not positive and finite.
    pub fn with_distances(
        &self,
        distances: &BTreeMap<[u32; 2], f64>,
        start: &[f64],
    ) -> Result<Self, ContactError> {
        let surface = Arc::new(self.surface.with_distances(distances, start)?);
        let new = Self::new(Arc::clone(&surface), self.reach);
        // Places where bodies are joined form pairs again if d̂ becomes smaller.
        if let Some((tube, found)) = lock(&self.about).as_ref().filter(|_| !surface.has_joints()) {
            let neighbours = found.neighbours.narrowed(&surface, tube, Some(tube.clone()));
            *lock(&new.about) = Some((tube.clone(), ContactPotential::on(surface, Arc::new(neighbours))));
        }
        Ok(new)
    }

    /// Returns the contact in a tube along a path.
    fn along(&self, tube: &Tube) -> ContactPotential {
        let tube = self.surface.loosened(tube.clone());
        // Take the search out of its lock while it works, because it uses all threads.
        let search = lock(&self.search).take();
        let search = match search {
            Some(search) if *search.tube() == tube => search,
            Some(mut search) => match search.update(&self.surface, tube.clone()) {
                true => search,
                false => Search::new(&self.surface, tube),
            },
            None => Search::new(&self.surface, tube),
        };
        let found = ContactPotential::on(Arc::clone(&self.surface), Arc::clone(search.found()));
        *lock(&self.search) = Some(search);
        found
    }

    /// Returns the contact about x, valid until a node is farther than `reach` (m) from there. If a known list is valid
    /// there, candidates are chosen from it; they are the same.
    pub fn about(&self, x: &[f64], reach: f64) -> ContactPotential {
        let tube = self.surface.loosened(Tube::about(x, reach));
        let known = lock(&self.search)
            .as_ref()
            .filter(|search| search.tube().contains_tube(&tube))
            .map(|search| Arc::clone(search.found()));
        if let Some(found) = known {
            let found = found.narrowed(&self.surface, &tube, Some(tube.clone()));
            return ContactPotential::on(Arc::clone(&self.surface), Arc::new(found));
        }
        if let Some((last, found)) = lock(&self.about).as_ref()
            && *last == tube
        {
            return found.clone();
        }
        let found = ContactPotential::within(Arc::clone(&self.surface), tube.clone());
        *lock(&self.about) = Some((tube, found.clone()));
        found
    }
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ContactTerm {
    /// Returns the surfaces.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Returns the contact near x, valid until a node is farther than the reach from there.
    pub fn at(&self, x: &[f64]) -> ContactPotential {
        self.about(x, self.reach)
    }
}

impl Live for ContactTerm {
    fn name(&self) -> &str {
        "contact"
    }

    fn reach(&self) -> f64 {
        self.reach
    }

    fn near(&self, x: &[f64], reach: f64) -> Arc<dyn Potential> {
        Arc::new(self.about(x, reach))
    }

    fn within(&self, tube: &Tube) -> Arc<dyn Potential> {
        Arc::new(self.along(tube))
    }

    fn lists_pairs(&self) -> bool {
        true
    }

    fn dissipates(&self) -> bool {
        self.surface.has_friction() || self.surface.has_damping()
    }

    fn is_finite_on_free_paths(&self) -> bool {
        true
    }
}

/// The contact energy at all configurations near a given one.
#[derive(Debug, Clone)]
pub struct ContactPotential {
    surface: Arc<Surface>,
    neighbours: Arc<Neighbours>,
    /// The nodes of all stencils, as soon as they are asked for: explicit steps need only their number.
    nodes: Arc<OnceLock<Vec<u32>>>,
    /// The step, if friction and damping over a step are evaluated.
    step: Option<Step>,
}

impl ContactPotential {
    /// Returns the contact energy, exact as long as no node is farther than `reach` (m) from x.
    pub fn near(surface: Arc<Surface>, x: &[f64], reach: f64) -> Self {
        let tube = surface.loosened(Tube::about(x, reach));
        Self::within(surface, tube)
    }

    /// Returns the contact energy, exact in a tube.
    fn within(surface: Arc<Surface>, tube: Tube) -> Self {
        let neighbours = Neighbours::within(&surface, tube);
        Self::on(surface, Arc::new(neighbours))
    }

    fn on(surface: Arc<Surface>, neighbours: Arc<Neighbours>) -> Self {
        Self { surface, neighbours, nodes: Arc::default(), step: None }
    }

    /// Returns the nodes of all stencils, four each.
    fn nodes(&self) -> &[u32] {
        self.nodes.get_or_init(|| {
            let Self { surface, neighbours, .. } = self;
            let mut nodes = Vec::with_capacity(4 * neighbours.count());
            for &point in neighbours.near() {
                let (point, part) = (point as usize, &surface.points()[point as usize]);
                for &cell in neighbours.cells_of(point) {
                    nodes.push(part.node);
                    nodes.extend(surface.cells()[cell as usize].nodes);
                }
            }
            for edges in neighbours.edge_pairs() {
                nodes.extend(edges.iter().flat_map(|&edge| surface.edges()[edge as usize].nodes));
            }
            for &[point, plane] in neighbours.plane_pairs() {
                let face = &surface.half_spaces()[plane as usize];
                nodes.extend(face.nodes_with(surface.points()[point as usize].node));
            }
            nodes
        })
    }

    /// Returns the contact of the candidates that can act or meet in a tube.
    fn narrowed_to(&self, tube: &Tube) -> Self {
        let neighbours = self.neighbours.narrowed(&self.surface, tube, None);
        Self::on(Arc::clone(&self.surface), Arc::new(neighbours))
    }

    /// Returns the contact of the candidates with a round body.
    fn of_round_bodies(&self) -> Self {
        let is_round = |bodies: [u32; 2]| bodies.into_iter().any(|body| self.surface.is_round(body));
        let neighbours = self.neighbours.between(&self.surface, is_round);
        Self::on(Arc::clone(&self.surface), Arc::new(neighbours))
    }

    /// Returns the candidates.
    pub fn neighbours(&self) -> &Neighbours {
        &self.neighbours
    }

    /// Returns the surfaces.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Returns a view of surface and candidates that evaluates energies, steps and impacts.
    pub fn contact(&self) -> Contact<'_> {
        Contact { surface: &self.surface, neighbours: &self.neighbours }
    }

    /// Returns the smallest gap (m) of the candidates of each pair of bodies at x, by the numbers of both bodies.
    pub fn smallest_gaps(&self, x: &[f64]) -> BTreeMap<[u32; 2], f64> {
        self.contact().smallest_gaps(x)
    }

    /// Returns the fraction in [0, 1] of the straight path from x to x + dx that is proved free of contact.
    pub fn free_path(&self, x: &[f64], dx: &[f64]) -> f64 {
        let end: Vec<f64> = x.iter().zip(dx).map(|(x, dx)| x + dx).collect();
        let impact = if self.neighbours.covers(x) && self.neighbours.covers(&end) {
            self.contact().first_impact(x, &end)
        } else {
            let far = self.surface.nodes().map(|node| at(dx, node).norm()).fold(0.0, f64::max);
            let neighbours = Neighbours::find(&self.surface, x, 2.0 * far);
            Contact { surface: &self.surface, neighbours: &neighbours }.first_impact(x, &end)
        };
        impact.map_or(1.0, |impact| impact.time)
    }

    /// Returns the points that have candidates in `range`.
    fn points_from(&self, range: &Range<usize>) -> impl Iterator<Item = usize> + use<'_> {
        let starts = &self.neighbours.starts;
        let first = starts.partition_point(|&start| start as usize <= range.start).saturating_sub(1);
        let end = range.end;
        (first..self.surface.points().len()).take_while(move |&point| (starts[point] as usize) < end)
    }

    /// Returns the number of the candidate of a point and a cell.
    fn candidate(&self, point: usize, cell: u32) -> usize {
        let cells = self.neighbours.cells_of(point);
        self.neighbours.starts[point] as usize + cells.binary_search(&cell).unwrap_or(0)
    }

    fn of(&self, stencil: usize) -> &[u32] {
        &self.nodes()[4 * stencil..4 * stencil + 4]
    }

    /// Returns the places of nodes in a stencil.
    fn places(&self, stencil: usize, of: &[u32; 4]) -> [usize; 4] {
        let nodes = self.of(stencil);
        of.map(|node| nodes.iter().position(|&other| other == node).unwrap_or(0))
    }
}

/// Adds the packed block of a pair to the packed block of its stencil.
fn add_packed(block: &[f64], size: usize, places: [usize; 4], out: &mut [f64]) {
    let place = |i: usize| 3 * places[i / 3] + i % 3;
    let mut values = block.iter();
    for i in 0..size {
        for (j, value) in (0..=i).zip(&mut values) {
            // A frame of slip may have its nodes in another order than the stencil.
            let (row, column) = (place(i).max(place(j)), place(i).min(place(j)));
            out[packed_len(row) + column] += value;
        }
    }
}

impl Potential for ContactPotential {
    fn name(&self) -> &str {
        "contact"
    }

    fn account(&self) -> Account {
        Account::Contact
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 4, block: 3, nodes: self.nodes() }
    }

    fn stencil_count(&self) -> usize {
        self.neighbours.count()
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }

    fn energy(&self, x: &[f64], _t: f64) -> Option<f64> {
        Some(self.contact().energy(x))
    }

    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.located(&range, x).energies(range, x, t, out);
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.located(&range, x).gradients(range, x, t, out);
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.located(&range, x).hessians(range, x, t, out);
    }

    fn at(&self, x: &[f64]) -> Option<Arc<dyn Potential>> {
        Some(Arc::new(self.located(&(0..self.stencil_count()), x)))
    }

    fn discrete_gradient(&self) -> Option<&dyn DiscreteGradient> {
        Some(self)
    }

    fn forces_between(&self, x: &[f64]) -> Vec<Impulse> {
        let mut forces = BTreeMap::<[u32; 2], [f64; 3]>::new();
        for pair in self.contact().active(x) {
            let [a, b] = self.surface.bodies_of(pair.partners);
            let force = forces.entry([a.min(b), a.max(b)]).or_default();
            let sign = if a <= b { -1.0 } else { 1.0 };
            for gradient in &pair.gradient(x)[..pair.partners.first_count()] {
                (0..3).for_each(|axis| force[axis] += sign * gradient[axis]);
            }
        }
        forces.into_iter().map(|(between, value)| Impulse { between, value }).collect()
    }

    fn lagged_friction(
        &self,
        span: StepSpan,
        memory: &[f64],
        places: [&[f64]; 2],
        acting: &Acting,
    ) -> Option<Arc<dyn Potential>> {
        self.lagged_at((span, memory), places, acting)
    }

    fn limits_steps(&self) -> bool {
        true
    }

    fn largest_step(&self, x: &[f64], dx: &[f64]) -> f64 {
        let free = self.free_path(x, dx);
        if free < 1.0 { (MARGIN * free).max(f64::MIN_POSITIVE) } else { 1.0 }
    }

    fn meetings(&self, x: &[f64], end: &[f64], kept: f64) -> Vec<Meeting> {
        let nearest = |gauge: &Gauge| gauge.thickness + kept * gauge.distance;
        let near = self.neighbours.near_path(&self.surface, [x, end], nearest);
        let contact = Contact { surface: &self.surface, neighbours: &near };
        let impacts = contact.impacts(x, end, kept).into_iter();
        let meeting = |Impact { time, nodes, partners }| {
            let size = self.surface.spacing(partners, x);
            Meeting { nodes, part: time, size }
        };
        impacts.map(meeting).collect()
    }

    fn narrowed(&self, tube: &Tube) -> Option<Arc<dyn Potential>> {
        Some(Arc::new(self.narrowed_to(tube)))
    }

    fn fault(&self, stencil: usize, x: &[f64], t: f64) -> Option<Fault> {
        self.located(&(stencil..stencil + 1), x).fault(stencil, x, t)
    }
}
