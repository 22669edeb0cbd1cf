//! Contact over a step from x₀ to x₁: forces that do exactly the work C₁ − C₀, pair by pair.
//!
//! With the quotient Q = (C(d₁) − C(d₀))/(d₁ − d₀) ≤ 0 and the discrete gradient N of the distance (`chord.rs`), a
//! pair exerts −G with G_a = Q N_a. Hence Σ G·Δx = C₁ − C₀, Σ G_a = 0 and Σ x_m,a × G_a = 0, for any step and any
//! change of closest features. The pairs are simplices and not features, so their energies add up from step to step. Where a point passes
//! from one cell to another, two pairs together have these properties (`crossing.rs`).
//!
//! Damping adds to Q; see `viscosity.rs`.

use vi_core::StepSpan;

use super::edges::Mollifier;
use super::energy::{Strength, in_order, pack_rank_one};
use super::viscosity::{Damped, Damping, Resistance, Viscosity};
use super::{Blend, Contact, DistanceChange, Group, Partners, chord};
use crate::distance::{Shape, Vec3, at};

/// Parameters of the forces of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSettings {
    /// Duration of the step, s; that of the drift if contact acts in the drift. It is infinite between two equilibria:
    /// then nothing is damped.
    pub duration: f64,
    /// Whether forces act with the values that they have at the end of the step; see [`StepSpan::acts_at_end`].
    pub acts_at_end: bool,
    /// The share of damping that acts on velocities at the end of the step instead: zero, [`AT_END`], or all of it if forces act
    /// at the end.
    pub damping_at_end: f64,
}

/// The share of damping that acts on velocities at the end of a step.
///
/// Damping over a step acts on changes of gaps. If a layer of stiffness k is so stiff that the midpoint rule does not resolve it,
/// it has a mode of velocities that alternate between ±v while gaps do not change. With the time constant τ, mass m and b = τ k h/(2m),
/// its factor per step is λ = −1 + 2/b, so that the stiffest layers oscillate longest. If a share a of τ acts on velocities, λ is
/// divided by 1 + 2ab. This share gives |λ| < .45 for any b. A smaller share damps gaps that close slowly, as of bodies that
/// settle, more exactly: they follow (1 − a) τ where the layer is not resolved.
pub const AT_END: f64 = 1.0 / 16.0;

impl StepSettings {
    /// Returns the settings of a step of `duration` (s) over which all damping acts.
    pub const fn over(duration: f64) -> Self {
        Self { duration, acts_at_end: false, damping_at_end: 0.0 }
    }

    /// Returns the settings of a step.
    pub(crate) fn of(span: StepSpan) -> Self {
        let damping_at_end = match (span.damps_end, span.acts_at_end) {
            (false, _) => 0.0,
            (true, false) => AT_END,
            (true, true) => 1.0,
        };
        Self { duration: span.duration, acts_at_end: span.acts_at_end, damping_at_end }
    }

    /// Returns τ/h of the damping over the step.
    pub(crate) fn damping_rate(&self, damping: f64) -> f64 {
        (1.0 - self.damping_at_end) * damping / self.duration
    }

    /// Returns the coefficient of the damper of a pair at the end of the step, N s/m. `stiffness` is its tangent over a step
    /// without motion, which is that of a layer or bristle times [`StepSettings::response`].
    pub(crate) fn coefficient_at_end(&self, stiffness: f64, damping: f64) -> f64 {
        self.damping_at_end * damping * stiffness / self.response(damping)
    }

    /// Returns whether the step leads from one equilibrium to the next.
    pub(crate) fn is_equilibrium(&self) -> bool {
        self.acts_at_end && self.duration.is_infinite()
    }

    /// Returns r of the traction k (e₀ + r u) of a bristle that sticks, with the damping time τ: ½ + τ/h between both ends of a step,
    /// and 1 at its end.
    pub(crate) fn response(&self, damping: f64) -> f64 {
        if self.acts_at_end { 1.0 } else { 0.5 + self.damping_rate(damping) }
    }

    /// Returns how many ends of the step move with x₁.
    fn moving_ends(&self) -> f64 {
        if self.acts_at_end { 2.0 } else { 1.0 }
    }

    /// Returns the positions between which pairs act, given both ends of the step.
    pub(crate) fn places<'a>(&self, [start, end]: [&'a [f64]; 2]) -> [&'a [f64]; 2] {
        if self.acts_at_end { [end, end] } else { [start, end] }
    }
}

/// A pair that acts over a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepPair {
    /// The parts of the pair.
    pub partners: Partners,
    /// Number of nodes of the pair.
    pub arity: usize,
    /// Nodes of the pair.
    pub nodes: [u32; 4],
    /// G_a, N: the pair's force on node a is −G_a.
    pub gradient: [Vec3; 4],
    /// Mean weights c̄ of the closest points.
    pub weights: [f64; 4],
    /// Unit vector between the closest points at the midpoint.
    pub normal: Vec3,
    /// The discrete gradient N of the distance, and ∂d₁/∂x₁.
    pub distance: [[Vec3; 4]; 2],
    /// dQ/dd₁, N/m. Without a mollifier, ∂G/∂x₁ ≈ dQ/dd₁ N ⊗ ∂d₁/∂x₁. Damping can make it negative.
    pub tangent: f64,
    /// The mollifier of nearly parallel edges.
    pub(crate) parallel: Option<Parallel>,
    /// Q, N, times the mollifier; zero for pairs whose directions have no tangents.
    pub(crate) slope: f64,
    /// k of a symmetric part k c̄ c̄ᵀ ⊗ n nᵀ of ∂G/∂x₁, N/m; positive except for pairs that inclusion and
    /// exclusion subtracts.
    pub stiffness: f64,
    /// C₀ and C₁, J.
    pub energy: [f64; 2],
    /// Energy that damping dissipates, J: Σ G·Δx = C₁ − C₀ + dissipated.
    pub dissipated: f64,
    /// What damping at the end of the step needs to know of a pair; zero if nothing damps it.
    pub(crate) damped: Damped,
    /// The smaller gap of both ends, m.
    pub gap: f64,
    /// The gaps of both ends, relative to d̂.
    pub(crate) relative: [f64; 2],
    /// How many ends of the step move with x₁: one, or both if the pair acts at the end of the step. The derivatives above are those
    /// by one end.
    pub(crate) ends: f64,
    /// For a point against a body, the first cell that contains the simplex of the pair; zero for other pairs.
    pub(crate) cell: u32,
}

impl StepPair {
    /// Returns the force on the first part of the pair (the point, or the first edge), N.
    pub fn force(&self) -> Vec3 {
        -self.gradient[..self.partners.first_count()].iter().sum::<Vec3>()
    }

    /// Returns k of the symmetric part k c̄ c̄ᵀ ⊗ n nᵀ of the change of G with all ends of the step that move, N/m.
    pub(crate) fn stiffness_of_ends(&self) -> f64 {
        self.ends * self.stiffness
    }

    /// Writes k c̄ c̄ᵀ ⊗ n nᵀ as a packed lower triangle of 3·arity coordinates, N/m.
    pub fn packed_stiffness(&self, out: &mut [f64]) {
        pack_rank_one(self.stiffness_of_ends(), &self.weights, self.normal, 3 * self.arity, out);
    }

    /// Returns one of two parts into which the force of a pair is divided: each has half of its energies. How the directions of both
    /// parts turn is left out of the tangents, because it depends on the nodes of both.
    fn half(self) -> Self {
        let energy = self.energy.map(|energy| 0.5 * energy);
        Self { energy, stiffness: 0.5 * self.stiffness, slope: 0.0, ..self }
    }

    /// Adds the resistance of damping.
    fn resist(&mut self, resistance: &Resistance) {
        let Resistance { force, kept, stiffness, tangent, dissipated, damped, is_whole } = *resistance;
        let [along, _] = self.distance;
        (0..4).for_each(|a| self.gradient[a] += along[a] * force);
        self.slope += if is_whole { force } else { 0.0 };
        self.stiffness = kept * self.stiffness + stiffness;
        self.tangent = kept * self.tangent + tangent;
        self.dissipated += dissipated;
        self.damped = damped;
    }

    /// Multiplies the force and its tangents by `factor`.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.gradient.iter_mut().for_each(|gradient| *gradient *= factor);
        self.tangent *= factor;
        self.slope *= factor;
        self.stiffness *= factor;
        if let Some(Parallel { by, .. }) = &mut self.parallel {
            by.iter_mut().for_each(|by| *by *= factor);
        }
    }

    /// Calls `each` with the factors a and b of the change of the force with the distance, of ∂G/∂x₁ ≈ Σ a ⊗ b.
    pub(crate) fn each_tangent(&self, mut each: impl FnMut(&[Vec3; 4], &[Vec3; 4])) {
        let [along, at_end] = &self.distance;
        match &self.parallel {
            None if self.tangent != 0.0 => {
                let tangent = self.ends * self.tangent;
                each(along, &at_end.map(|vector| vector * tangent));
            }
            None => {}
            Some(Parallel { change: [by_c, c_at_end], by: [force_by_c, by_d, by_c_of_c] }) => {
                let both = |d: f64, c: f64| {
                    [0, 1, 2, 3].map(|a: usize| (at_end[a] * d + c_at_end[a] * c) * self.ends)
                };
                each(along, &both(self.tangent, *force_by_c));
                each(by_c, &both(*by_d, *by_c_of_c));
            }
        }
    }

    /// Calls `each` with the factors a and b of the change of directions and weights, Q ∂N/∂x₁ = Σ a ⊗ b, over the step from x₀
    /// to x₁.
    pub(crate) fn each_turn(&self, x: [&[f64]; 2], mut each: impl FnMut(&[Vec3; 4], &[Vec3; 4])) {
        let shape = match (self.partners, self.arity) {
            (Partners::PointPlane(..), _) => return,
            (Partners::Edges(..), _) => Shape::EdgeEdge,
            (Partners::PointBody(..), 2) => Shape::PointPoint,
            (Partners::PointBody(..), 3) => Shape::PointEdge,
            (Partners::PointBody(..), _) => Shape::PointTriangle,
        };
        if self.slope == 0.0 {
            return;
        }
        let slope = self.ends * self.slope;
        let [x0, x1] = x.map(|x| self.nodes.map(|node| at(x, node)));
        let (start, end) = (shape.closest(&x0), shape.closest(&x1));
        chord::each_turn(shape, &start, &end, [&x0, &x1], |left, right| {
            each(left, &right.map(|vector| vector * slope));
        });
    }

    /// Adds G to `out`, three numbers per node.
    pub fn add_gradient(&self, out: &mut [f64]) {
        for (node, gradient) in self.nodes.iter().zip(&self.gradient).take(self.arity) {
            for k in 0..3 {
                out[3 * *node as usize + k] += gradient[k];
            }
        }
    }
}

/// The tangents of a pair of edges with a mollifier m(c), besides those of its distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Parallel {
    /// The discrete gradient of c, and ∂c₁/∂x₁.
    change: [[Vec3; 4]; 2],
    /// ∂(factor of N)/∂c₁, ∂(factor of the discrete gradient of c)/∂d₁ and the same by c₁.
    by: [f64; 3],
}

/// The scalar quotient Q = ΔC/Δd of a pair over a step, and its derivatives.
struct Quotient {
    slope: f64,
    /// dQ/dd₁.
    stiffness: f64,
    energy: [f64; 2],
    gap: f64,
    relative: [f64; 2],
}

impl Quotient {
    /// Computes the quotient between the distances at both `ends` (m).
    #[inline]
    fn new(strength: &Strength, ends: [f64; 2]) -> Self {
        let Strength { gauge, blend, multiplicity: n } = *strength;
        let [s0, s1] = ends.map(|distance| gauge.relative(distance));
        let per_square = gauge.energy / (gauge.distance * gauge.distance);
        let energy = n * gauge.energy;
        Self {
            slope: n * (gauge.energy / gauge.distance * blend.quotient(s0, s1)),
            stiffness: n * (per_square * blend.quotient_slope(s0, s1)),
            energy: [energy * blend.value(s0), energy * blend.value(s1)],
            gap: s0.min(s1) * gauge.distance,
            relative: [s0, s1],
        }
    }
}

impl Contact<'_> {
    /// Returns all pairs that act between x₀ and x₁, in the order of points, edges, half-spaces.
    ///
    /// Surfaces must not cross on the path from x₀ to x₁ (see [`Contact::first_impact`]), because a distance has no
    /// sign.
    pub fn step(&self, x0: &[f64], x1: &[f64], settings: &StepSettings) -> Vec<StepPair> {
        let x = [x0, x1];
        let near = self.neighbours.near();
        let mut pairs = in_order(near.len(), Group::new, |k, group, out| {
            self.step_of_point(near[k] as usize, x, settings, group, out);
        });
        pairs.extend(in_order(
            self.neighbours.edges.len(),
            || (),
            |pair, (), out| {
                out.extend(self.step_of_edges(pair, x, settings));
            },
        ));
        let planes = 0..self.neighbours.planes.len();
        pairs.extend(planes.filter_map(|pair| self.step_of_plane(pair, x, settings)));
        pairs
    }

    pub(crate) fn step_of_point(
        &self,
        point: usize,
        x: [&[f64]; 2],
        settings: &StepSettings,
        group: &mut Group<2>,
        out: &mut Vec<StepPair>,
    ) {
        let part = self.surface.points[point];
        let blend = Blend::of_points(self.surface.barrier);
        for (body, cells) in self.bodies_of(point) {
            let Some(gauge) = self.surface.point_gauge(point, body) else { continue };
            let damping = self.damping(part.body, body, settings);
            group.gather(self.surface, part.node, cells, &gauge, x);
            let Group { terms, crossing, .. } = group;
            let (first, mut viscosities) = (out.len(), Vec::new());
            crossing.find(terms, &gauge, x);
            let partners = Partners::PointBody(point as u32, body);
            let strength = |multiplicity: f64| Strength { gauge, blend, multiplicity };
            for (number, term) in terms.iter().enumerate() {
                let multiplicity = crossing.number(number, term.multiplicity);
                let [start, end] = term.closest;
                if multiplicity == 0.0 || start.squared.min(end.squared) >= gauge.reach_squared() {
                    continue;
                }
                let [x0, x1] = term.positions(x);
                let change = DistanceChange::new(&start, &end, [&x0, &x1]);
                let ends = [start.distance(), end.distance()];
                let strength = strength(multiplicity);
                let quotient = Quotient::new(&strength, ends);
                let pair = assemble(partners, term.shape.arity(), term.nodes, &change, &quotient, settings);
                out.push(StepPair { cell: term.home, ..pair });
                if damping.is_some() {
                    viscosities.push(Viscosity::new(&strength, ends, change.change, quotient.slope));
                }
            }
            for chord in crossing.chords() {
                let strength = strength(chord.number);
                let quotient = Quotient::new(&strength, chord.distances);
                for (term, change) in chord.terms.map(|term| &terms[term]).iter().zip(&chord.parts) {
                    let pair =
                        assemble(partners, term.shape.arity(), term.nodes, change, &quotient, settings);
                    out.push(StepPair { cell: term.home, ..pair.half() });
                    if damping.is_some() {
                        let whole = Viscosity::new(&strength, chord.distances, change.change, quotient.slope);
                        viscosities.push(whole.half());
                    }
                }
            }
            if let Some(damping) = damping {
                damp(&mut out[first..], &damping, &viscosities);
            }
        }
    }

    pub(crate) fn step_of_edges(
        &self,
        pair: usize,
        x: [&[f64]; 2],
        settings: &StepSettings,
    ) -> Option<StepPair> {
        let pair = self.surface.edge_pair(self.neighbours.edges[pair])?;
        let nodes = pair.nodes;
        let x = x.map(|x| nodes.map(|node| at(x, node)));
        let [start, end] = Shape::EdgeEdge.closest_if_nearer(&x, pair.reach * pair.reach)?;
        let [x0, x1] = x;
        let [a, b] = pair.edges.map(|edge| &self.surface.edges[edge as usize]);
        let blend = Blend::of_edges(self.surface.barrier, a, b);
        let change = DistanceChange::new(&start, &end, [&x0, &x1]);
        let damping = self.damping(a.body, b.body, settings);
        let ends = [start.distance(), end.distance()];
        let strength = Strength { gauge: pair.gauge, blend, multiplicity: 1.0 };
        let quotient = Quotient::new(&strength, ends);
        if quotient.energy == [0.0; 2] {
            return None;
        }
        let partners = Partners::Edges(pair.edges[0], pair.edges[1]);
        let mut out = assemble(partners, 4, nodes, &change, &quotient, settings);
        if let Some(damping) = damping {
            let viscosity = Viscosity::new(&strength, ends, change.change, quotient.slope);
            damp(std::slice::from_mut(&mut out), &damping, &[viscosity]);
        }
        let mollifier = Mollifier::new(a, b);
        let [c0, c1] = [Mollifier::argument(&x0), Mollifier::argument(&x1)];
        let [m0, m1] = [mollifier.value(c0), mollifier.value(c1)];
        if m0 < 1.0 || m1 < 1.0 {
            // Δ(m B) = m̄ ΔB + B̄ Δm.
            let mean = 0.5 * (m0 + m1);
            let energy = 0.5 * (quotient.energy[0] + quotient.energy[1]);
            let by_c = energy * mollifier.quotient(c0, c1);
            let change_c = Mollifier::discrete_gradient(&x0, &x1);
            for (gradient, c) in out.gradient.iter_mut().zip(change_c) {
                *gradient = *gradient * mean + c * by_c;
            }
            let slope = pair.gauge.energy / pair.gauge.distance * blend.slope(pair.gauge.relative(ends[1]));
            out.parallel = Some(Parallel {
                change: [change_c, Mollifier::discrete_gradient(&x1, &x1)],
                by: [
                    0.5 * out.slope * mollifier.slope(c1),
                    0.5 * slope * mollifier.quotient(c0, c1),
                    energy * mollifier.quotient_slope(c0, c1),
                ],
            });
            out.stiffness *= mean;
            out.slope *= mean;
            out.tangent *= mean;
            out.dissipated *= mean;
            out.damped.scale(mean);
            out.energy = [m0 * out.energy[0], m1 * out.energy[1]];
        }
        Some(out)
    }

    pub(crate) fn step_of_plane(
        &self,
        pair: usize,
        x: [&[f64]; 2],
        settings: &StepSettings,
    ) -> Option<StepPair> {
        let [point, plane] = self.neighbours.planes[pair];
        let gauge = self.surface.plane_gauge(point as usize, plane as usize)?;
        let (part, face) = (self.surface.points[point as usize], &self.surface.half_spaces[plane as usize]);
        let [(nodes, x0), (_, x1)] = x.map(|x| self.over_plane(point, plane, x));
        let ends = [face.height(&x0), face.height(&x1)];
        if ends[0].min(ends[1]) >= gauge.reach() {
            return None;
        }
        let change = if face.corners.is_some() {
            DistanceChange::new(&face.closest(&x0), &face.closest(&x1), [&x0, &x1])
        } else {
            let (normal, zero) = (face.normal, Vec3::zeros());
            DistanceChange {
                gradient: [normal, -normal, zero, zero],
                at_end: [normal, -normal, zero, zero],
                change: normal.dot(&((x1[0] - x0[0]) - (x1[1] - x0[1]))),
                weights: [1.0, -1.0, 0.0, 0.0],
                normal,
            }
        };
        let damping = self.damping(part.body, face.body, settings);
        let blend = Blend::of_points(self.surface.barrier);
        let strength = Strength { gauge, blend, multiplicity: 1.0 };
        let quotient = Quotient::new(&strength, ends);
        let arity = face.shape().arity();
        let mut out =
            assemble(Partners::PointPlane(point, plane), arity, nodes, &change, &quotient, settings);
        if let Some(damping) = damping {
            let viscosity = Viscosity::new(&strength, ends, change.change, quotient.slope);
            damp(std::slice::from_mut(&mut out), &damping, &[viscosity]);
        }
        Some(out)
    }

    /// Returns the damping between two bodies; `None` if nothing damps them.
    fn damping(&self, a: u32, b: u32, settings: &StepSettings) -> Option<Damping> {
        let time = self.surface.law(a, b)?.damping;
        let rate = settings.damping_rate(time);
        (time > 0.0).then_some(Damping { rate, kept: settings.damping_at_end })
    }
}

/// Damps the pairs of a group.
fn damp(pairs: &mut [StepPair], damping: &Damping, viscosities: &[Viscosity]) {
    for (pair, resistance) in pairs.iter_mut().zip(damping.resist(viscosities)) {
        if let Some(resistance) = resistance {
            pair.resist(&resistance);
        }
    }
}

#[inline]
fn assemble(
    partners: Partners,
    arity: usize,
    nodes: [u32; 4],
    change: &DistanceChange,
    quotient: &Quotient,
    settings: &StepSettings,
) -> StepPair {
    StepPair {
        partners,
        arity,
        nodes,
        gradient: change.gradient.map(|gradient| gradient * quotient.slope),
        weights: change.weights,
        normal: change.normal,
        distance: [change.gradient, change.at_end],
        tangent: quotient.stiffness,
        parallel: None,
        slope: quotient.slope,
        stiffness: quotient.stiffness,
        energy: quotient.energy,
        dissipated: 0.0,
        damped: Damped::default(),
        gap: quotient.gap,
        relative: quotient.relative,
        ends: settings.moving_ends(),
        cell: 0,
    }
}
