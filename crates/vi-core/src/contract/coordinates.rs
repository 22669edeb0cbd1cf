//! Generalised coordinates of a body of points: x = x(q, t), where q are the free coordinates. The others follow a
//! prescribed path, or are weighted sums of free and prescribed coordinates (`combination.rs`). The coordinates of a
//! node may be components along its own axes (`node_axes.rs`). All coordinates that are not free are eliminated, never
//! penalised.

use std::borrow::Cow;

use crate::contract::combination::{Combination, Combinations};
use crate::contract::node_axes::{AllNodeAxes, NodeAxes};
use crate::error::CoreError;

/// A prescribed motion of a list of coordinates.
pub trait Path: Send + Sync {
    /// Writes the positions at time t (s), m, one per coordinate of the list.
    fn position(&self, t: f64, out: &mut [f64]);
    /// Writes the velocities at time t, m/s, one per coordinate of the list.
    fn velocity(&self, t: f64, out: &mut [f64]);
    /// Returns whether all velocities are always zero. Terms that depend only on such coordinates are evaluated once.
    fn is_fixed(&self) -> bool {
        false
    }
    /// Returns whether one coordinate of the list, by its place there, is known to stay where it is at all times.
    fn is_still(&self, _place: usize) -> bool {
        self.is_fixed()
    }
}

/// A path that does not move: the given positions, m.
#[derive(Debug, Clone)]
pub struct Fixed(pub Vec<f64>);

impl Path for Fixed {
    fn position(&self, _t: f64, out: &mut [f64]) {
        out.copy_from_slice(&self.0);
    }
    fn velocity(&self, _t: f64, out: &mut [f64]) {
        out.fill(0.0);
    }
    fn is_fixed(&self) -> bool {
        true
    }
}

/// Coordinates that follow one path together.
pub struct Prescribed {
    /// The coordinates x_i, in the order of the path's values.
    pub dofs: Vec<u32>,
    /// Path that gives their positions.
    pub path: Box<dyn Path>,
}

/// The map x(q, t) from the free coordinates and time to all coordinates.
pub struct Coordinates {
    dof_count: usize,
    free: Vec<u32>,
    prescribed: Vec<Prescribed>,
    axes: AllNodeAxes,
    combinations: Option<Combinations>,
    /// Directors, ascending: nodes that translations do not move.
    directors: Vec<u32>,
    /// For each node, how far places move per unit of its own motion; empty if there are no directors.
    levers: Vec<f64>,
}

impl Coordinates {
    /// Returns coordinates that are all free, x = q, with `dof_count` entries.
    pub fn all_free(dof_count: usize) -> Self {
        let free = (0..dof_count as u32).collect();
        let (prescribed, axes) = (Vec::new(), AllNodeAxes::default());
        Self {
            dof_count,
            free,
            prescribed,
            axes,
            combinations: None,
            directors: Vec::new(),
            levers: Vec::new(),
        }
    }

    /// Returns coordinates that are free, in ascending order, except for those in a path of `prescribed`.
    ///
    /// # Errors
    /// Returns [`CoreError::Coordinate`] if a coordinate is out of range or given twice.
    pub fn new(dof_count: usize, prescribed: Vec<Prescribed>) -> Result<Self, CoreError> {
        let mut is_free = vec![true; dof_count];
        for &dof in prescribed.iter().flat_map(|group| &group.dofs) {
            match is_free.get_mut(dof as usize) {
                Some(free) if *free => *free = false,
                _ => {
                    return Err(CoreError::Coordinate {
                        what: "prescribed coordinates",
                        dof: dof as usize,
                        count: dof_count,
                    });
                }
            }
        }
        let mut free = Vec::with_capacity(is_free.iter().filter(|&&is_free| is_free).count());
        free.extend((0..dof_count as u32).filter(|&dof| is_free[dof as usize]));
        let axes = AllNodeAxes::default();
        Ok(Self {
            dof_count,
            free,
            prescribed,
            axes,
            combinations: None,
            directors: Vec::new(),
            levers: Vec::new(),
        })
    }

    /// Returns a copy in which some nodes have their own axes: coordinate k of such a node, free or prescribed, is
    /// e_k · x. The nodes have three coordinates.
    ///
    /// # Errors
    /// Returns [`CoreError::Coordinate`] if a node is out of range or given twice, [`CoreError::Axes`] if axes are not
    /// orthonormal.
    pub fn with_axes(mut self, axes: Vec<NodeAxes>) -> Result<Self, CoreError> {
        self.axes = AllNodeAxes::new(self.dof_count, axes)?;
        Ok(self)
    }

    /// Returns a copy with tied nodes and with directors (see `combination.rs`), both with three coordinates per
    /// node. A tie may refer to other tied nodes.
    ///
    /// # Errors
    /// Returns [`CoreError::Coordinate`] if a node is out of range or tied twice; [`CoreError::Combination`] if a tied
    /// node is prescribed, ties form a cycle, or the weights of points do not sum to one.
    pub fn with_combinations(
        mut self,
        combinations: &[Combination],
        directors: &[u32],
    ) -> Result<Self, CoreError> {
        let node_count = self.dof_count / 3;
        let mut is_director = vec![false; node_count];
        for &node in directors {
            match is_director.get_mut(node as usize) {
                Some(flag) => *flag = true,
                None => {
                    let (dof, count) = (3 * node as usize, self.dof_count);
                    return Err(CoreError::Coordinate { what: "directors", dof, count });
                }
            }
        }
        self.directors = (0..node_count as u32).filter(|&node| is_director[node as usize]).collect();
        if combinations.is_empty() {
            self.levers = self.measured_levers();
            return Ok(self);
        }
        let tied = Combinations::new(node_count, combinations, &is_director)?;
        for &dof in self.prescribed.iter().flat_map(|group| &group.dofs) {
            if tied.of(dof / 3).is_some() {
                let reason =
                    "it is prescribed too; a node follows a path or other nodes, not both".to_owned();
                return Err(CoreError::Combination { node: dof as usize / 3, reason });
            }
        }
        self.free.retain(|&dof| tied.of(dof / 3).is_none());
        self.combinations = Some(tied);
        self.levers = self.measured_levers();
        Ok(self)
    }

    fn measured_levers(&self) -> Vec<f64> {
        if self.directors.is_empty() {
            return Vec::new();
        }
        let mut levers = vec![1.0; self.dof_count / 3];
        self.directors.iter().for_each(|&node| levers[node as usize] = 0.0);
        for (node, weight) in self.combinations().flat_map(|(_, terms)| terms.iter().copied()) {
            if self.is_director(node) {
                levers[node as usize] = f64::max(levers[node as usize], weight.abs());
            }
        }
        levers
    }

    /// Returns how far places move at most per unit of the motion of a node: 1 for a point, and for a director, whose numbers are
    /// not lengths, the largest weight (m) with which points follow it; 0 if none does.
    pub fn lever(&self, node: u32) -> f64 {
        self.levers.get(node as usize).copied().unwrap_or(1.0)
    }

    /// Returns how far places move at most along one axis if the free coordinates change by these numbers, m. `changes`
    /// may hold the changes of several stages, one stage after the other.
    pub fn farthest(&self, changes: impl ExactSizeIterator<Item = f64>) -> f64 {
        let levers = self.free.iter().map(|dof| self.lever(dof / 3)).cycle();
        changes.zip(levers).map(|(change, lever)| lever * change.abs()).fold(0.0, f64::max)
    }

    /// Returns whether x(q, t) only copies entries: no node is tied and none has its own axes.
    pub fn is_plain(&self) -> bool {
        self.combinations.is_none() && self.axes.is_empty()
    }

    /// Returns the nodes with their own axes, ascending.
    pub fn node_axes(&self) -> &[NodeAxes] {
        self.axes.list()
    }

    /// Returns the axes of a node, if it has its own.
    pub fn axes_of(&self, node: u32) -> Option<&[[f64; 3]; 3]> {
        self.axes.of(node)
    }

    /// Transforms vectors along the axes of space to components along the nodes' own axes, in place.
    pub fn to_own_axes(&self, vectors: &mut [f64]) {
        self.axes.to_own(vectors);
    }

    /// Inverts [`Coordinates::to_own_axes`].
    pub fn to_space(&self, vectors: &mut [f64]) {
        self.axes.to_space(vectors);
    }

    /// Completes vectors in space (velocities, displacements): sets those of tied nodes to the sums, with the weights
    /// of the positions, of the vectors given at the other nodes.
    pub fn complete(&self, vectors: &mut [f64]) {
        if let Some(tied) = &self.combinations {
            tied.embed(vectors);
        }
    }

    /// Returns the tied nodes in ascending order, each with its sum over nodes that are not tied: (node, weight).
    pub fn combinations(&self) -> impl Iterator<Item = (u32, &[(u32, f64)])> {
        self.combinations.iter().flat_map(Combinations::iter)
    }

    /// Returns the sum of a tied node over nodes that are not tied.
    pub fn combination(&self, node: u32) -> Option<&[(u32, f64)]> {
        self.combinations.as_ref()?.of(node)
    }

    /// Returns the directors, ascending: nodes that rotate as points do but that translations do not move.
    pub fn directors(&self) -> &[u32] {
        &self.directors
    }

    /// Returns whether a node is a director.
    pub fn is_director(&self, node: u32) -> bool {
        !self.directors.is_empty() && self.directors.binary_search(&node).is_ok()
    }

    /// Returns the places of all nodes, or their changes, given all coordinates. Directors are no places, and their numbers are not
    /// lengths; they are at the origin, where they never move.
    pub fn places<'a>(&self, x: &'a [f64]) -> Cow<'a, [f64]> {
        let mut places = Cow::Borrowed(x);
        for &node in &self.directors {
            places.to_mut()[3 * node as usize..][..3].fill(0.0);
        }
        places
    }

    /// Returns the largest extent of the points at x along an axis, and their largest absolute coordinate, m.
    /// Directors do not count.
    pub fn extent_and_reach(&self, x: &[f64]) -> [f64; 2] {
        let (mut least, mut greatest, mut reach) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3], 0.0_f64);
        for (dof, &x) in x.iter().enumerate().filter(|(dof, _)| !self.is_director((dof / 3) as u32)) {
            least[dof % 3] = least[dof % 3].min(x);
            greatest[dof % 3] = greatest[dof % 3].max(x);
            reach = reach.max(x.abs());
        }
        [(0..3).map(|k| greatest[k] - least[k]).fold(0.0, f64::max), reach]
    }

    /// Applies Sᵀ to a covector of all coordinates, in place. Forces on tied nodes act on the nodes of their sums
    /// instead, and the entries of tied nodes become zero. At nodes with their own axes the result has components
    /// along these.
    pub fn pull_back(&self, covector: &mut [f64]) {
        if let Some(tied) = &self.combinations {
            tied.pull_back(covector);
        }
        self.axes.to_own(covector);
    }

    /// Returns the lumped mass of the free coordinates from that of every coordinate, kg; `None` if no node is tied, so that each
    /// coordinate has its own.
    pub(crate) fn tied_mass(&self, mass: &[f64]) -> Result<Option<Vec<f64>>, CoreError> {
        let Some(tied) = &self.combinations else { return Ok(None) };
        let mut pulled = mass.to_vec();
        let is_free = |node: u32| (0..3).any(|k| self.free.binary_search(&(3 * node + k)).is_ok());
        tied.pull_back_mass(&mut pulled, is_free)?;
        Ok(Some(self.free.iter().map(|&dof| pulled[dof as usize]).collect()))
    }

    /// Returns a copy in which all prescribed coordinates are zero at all times.
    #[must_use]
    pub fn held(&self) -> Self {
        let dofs: Vec<u32> = self.prescribed.iter().flat_map(|group| group.dofs.iter().copied()).collect();
        let path = Box::new(Fixed(vec![0.0; dofs.len()]));
        Self {
            dof_count: self.dof_count,
            free: self.free.clone(),
            prescribed: vec![Prescribed { dofs, path }],
            axes: self.axes.clone(),
            combinations: self.combinations.clone(),
            directors: self.directors.clone(),
            levers: self.levers.clone(),
        }
    }

    /// Returns the number of coordinates x_i.
    pub fn dof_count(&self) -> usize {
        self.dof_count
    }

    /// Returns the number of free coordinates q_i.
    pub fn free_count(&self) -> usize {
        self.free.len()
    }

    /// Returns the free coordinates x_i in ascending order; `q[k] = x[free[k]]` if [`Coordinates::is_plain`].
    pub fn free(&self) -> &[u32] {
        &self.free
    }

    /// Returns the prescribed coordinates and their paths.
    pub fn prescribed(&self) -> &[Prescribed] {
        &self.prescribed
    }

    /// Returns whether any prescribed coordinate moves.
    pub fn is_moving(&self) -> bool {
        self.prescribed.iter().any(|group| !group.path.is_fixed())
    }

    /// Computes x(q, t), m.
    pub fn embed(&self, q: &[f64], t: f64, x: &mut [f64]) {
        self.scatter_free(q, x);
        self.place_prescribed(t, x);
        self.axes.to_space(x);
        if let Some(tied) = &self.combinations {
            tied.embed(x);
        }
    }

    /// Returns x(q, t), m.
    pub fn positions(&self, q: &[f64], t: f64) -> Vec<f64> {
        let mut x = vec![0.0; self.dof_count()];
        self.embed(q, t, &mut x);
        x
    }

    /// Sets the prescribed entries of x(q, t), m, along the nodes' own axes; the others remain unchanged.
    pub fn place_prescribed(&self, t: f64, x: &mut [f64]) {
        self.scatter_prescribed(x, |path, out| path.position(t, out));
    }

    /// Computes ẋ = ∂x/∂q q̇ + ∂x/∂t, m/s.
    pub fn embed_velocity(&self, q_dot: &[f64], t: f64, x_dot: &mut [f64]) {
        self.scatter_free(q_dot, x_dot);
        self.scatter_prescribed(x_dot, |path, out| path.velocity(t, out));
        self.axes.to_space(x_dot);
        if let Some(tied) = &self.combinations {
            tied.embed(x_dot);
        }
    }

    /// Computes ∂x/∂q dq, m: the change of all coordinates for a change of the free ones at fixed time.
    pub fn embed_change(&self, dq: &[f64], dx: &mut [f64]) {
        dx.fill(0.0);
        self.scatter_free(dq, dx);
        self.axes.to_space(dx);
        if let Some(tied) = &self.combinations {
            tied.embed(dx);
        }
    }

    /// Computes q from positions x, or q̇ from velocities, with components along the nodes' own axes.
    pub fn coordinates_of(&self, x: &[f64], q: &mut [f64]) {
        if self.axes.is_empty() {
            return self.restrict(x, q);
        }
        let mut own = x.to_vec();
        self.axes.to_own(&mut own);
        self.restrict(&own, q);
    }

    /// Copies the free entries of x to q. For a covector after [`Coordinates::pull_back`] this gives Sᵀf.
    pub fn restrict(&self, x: &[f64], q: &mut [f64]) {
        for (value, &dof) in q.iter_mut().zip(&self.free) {
            *value = x[dof as usize];
        }
    }

    fn scatter_free(&self, q: &[f64], x: &mut [f64]) {
        if self.free.len() == self.dof_count {
            x.copy_from_slice(q);
            return;
        }
        for (&value, &dof) in q.iter().zip(&self.free) {
            x[dof as usize] = value;
        }
    }

    fn scatter_prescribed(&self, x: &mut [f64], evaluate: impl Fn(&dyn Path, &mut [f64])) {
        let mut values = Vec::new();
        for group in &self.prescribed {
            values.resize(group.dofs.len(), 0.0);
            evaluate(group.path.as_ref(), &mut values);
            for (&dof, &value) in group.dofs.iter().zip(&values) {
                x[dof as usize] = value;
            }
        }
    }
}
