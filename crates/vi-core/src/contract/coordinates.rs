//! Generalised coordinates of a body of points: x = x(q, t), where q are the free coordinates and the others follow a
//! prescribed path, or are weighted sums of these two (`combination.rs`). Nodes may count their coordinates along
//! axes of their own (`node_axes.rs`). All that is not free is eliminated, never penalised.

use crate::contract::combination::{Combination, Combinations};
use crate::contract::node_axes::{AllNodeAxes, NodeAxes};
use crate::error::CoreError;

/// A prescribed motion of a list of coordinates.
pub trait Path: Send + Sync {
    /// Positions at time t (s), m: one a coordinate of the list.
    fn position(&self, t: f64, out: &mut [f64]);
    /// Velocities at time t, m/s: one a coordinate of the list.
    fn velocity(&self, t: f64, out: &mut [f64]);
    /// Does nothing ever move? Then what depends on these coordinates alone is made once.
    fn is_fixed(&self) -> bool {
        false
    }
}

/// The path that stays where it is.
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

/// Coordinates and the path that they follow together.
pub struct Prescribed {
    /// The coordinates x_i, in the order of the path's values.
    pub dofs: Vec<u32>,
    /// Where they are.
    pub path: Box<dyn Path>,
}

/// The map x(q, t): which coordinates are free, and where the others are.
pub struct Coordinates {
    dof_count: usize,
    free: Vec<u32>,
    prescribed: Vec<Prescribed>,
    axes: AllNodeAxes,
    combinations: Option<Combinations>,
    /// Nodes that translations do not move, ascending.
    directors: Vec<u32>,
}

impl Coordinates {
    /// All `dof_count` coordinates are free: x = q.
    pub fn all_free(dof_count: usize) -> Self {
        let free = (0..dof_count as u32).collect();
        let (prescribed, axes) = (Vec::new(), AllNodeAxes::default());
        Self { dof_count, free, prescribed, axes, combinations: None, directors: Vec::new() }
    }

    /// The coordinates that no path of `prescribed` names are free, in ascending order.
    ///
    /// # Errors
    /// [`CoreError::Coordinate`] where a coordinate is out of range or named twice.
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
        let free = (0..dof_count as u32).filter(|&dof| is_free[dof as usize]).collect();
        let axes = AllNodeAxes::default();
        Ok(Self { dof_count, free, prescribed, axes, combinations: None, directors: Vec::new() })
    }

    /// Returns a copy whose nodes have axes of their own: coordinate k of such a node,
    /// free or prescribed, is e_k · x. The nodes have three coordinates.
    ///
    /// # Errors
    /// [`CoreError::Coordinate`] where a node is out of range or named twice, [`CoreError::Axes`] where axes are
    /// not orthonormal.
    pub fn with_axes(mut self, axes: Vec<NodeAxes>) -> Result<Self, CoreError> {
        self.axes = AllNodeAxes::new(self.dof_count, axes)?;
        Ok(self)
    }

    /// Returns a copy with tied nodes, and with nodes that are directors (see `combination.rs`), both of
    /// three coordinates a node. Tied nodes may be named by those that are tied to them.
    ///
    /// # Errors
    /// [`CoreError::Coordinate`] where a node is out of range or tied twice; [`CoreError::Combination`]
    /// where a tied node is prescribed, ties go in a ring, or weights on points do not sum to one.
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
        Ok(self)
    }

    /// Is x(q, t) no more than a list of entries: no node is tied, none has axes of its own?
    pub fn is_plain(&self) -> bool {
        self.combinations.is_none() && self.axes.is_empty()
    }

    /// The nodes with axes of their own, ascending.
    pub fn node_axes(&self) -> &[NodeAxes] {
        self.axes.list()
    }

    /// The axes of a node, where it has its own.
    pub fn axes_of(&self, node: u32) -> Option<&[[f64; 3]; 3]> {
        self.axes.of(node)
    }

    /// From vectors along the axes of space to coordinates along the nodes' own axes, in place.
    pub fn to_own_axes(&self, vectors: &mut [f64]) {
        self.axes.to_own(vectors);
    }

    /// The reverse of [`Coordinates::to_own_axes`].
    pub fn to_space(&self, vectors: &mut [f64]) {
        self.axes.to_space(vectors);
    }

    /// Completes vectors in space (velocities, displacements) at nodes that are not tied: those of tied nodes
    /// follow, without the parts that move by themselves.
    pub fn complete(&self, vectors: &mut [f64]) {
        if let Some(tied) = &self.combinations {
            tied.embed(vectors);
        }
    }

    /// The tied nodes, ascending, each with its sum over nodes that are not tied: (node, weight).
    pub fn combinations(&self) -> impl Iterator<Item = (u32, &[(u32, f64)])> {
        self.combinations.iter().flat_map(Combinations::iter)
    }

    /// The sum of a node over nodes that are not tied, where it is tied.
    pub fn combination(&self, node: u32) -> Option<&[(u32, f64)]> {
        self.combinations.as_ref()?.of(node)
    }

    /// The nodes that turn as points do but are not moved by translations, ascending.
    pub fn directors(&self) -> &[u32] {
        &self.directors
    }

    /// Is a node a director?
    pub fn is_director(&self, node: u32) -> bool {
        !self.directors.is_empty() && self.directors.binary_search(&node).is_ok()
    }

    /// The largest extent along an axis of the points at x, and their largest coordinate, m. Directors are no points.
    pub fn extent_and_reach(&self, x: &[f64]) -> [f64; 2] {
        let (mut least, mut greatest, mut reach) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3], 0.0_f64);
        for (dof, &x) in x.iter().enumerate().filter(|(dof, _)| !self.is_director((dof / 3) as u32)) {
            least[dof % 3] = least[dof % 3].min(x);
            greatest[dof % 3] = greatest[dof % 3].max(x);
            reach = reach.max(x.abs());
        }
        [(0..3).map(|k| greatest[k] - least[k]).fold(0.0, f64::max), reach]
    }

    /// Sᵀ on a covector of all coordinates, in place: what acts on tied nodes acts on the nodes they
    /// are tied to instead, and the entries of tied nodes are zero; at nodes with axes of their own it counts
    /// along these.
    pub fn pull_back(&self, covector: &mut [f64]) {
        if let Some(tied) = &self.combinations {
            tied.pull_back(covector);
        }
        self.axes.to_own(covector);
    }

    /// The lumped mass of the free coordinates from that of every coordinate, kg.
    pub(crate) fn free_mass(&self, mass: &[f64]) -> Result<Vec<f64>, CoreError> {
        let of_free = |mass: &[f64]| self.free.iter().map(|&dof| mass[dof as usize]).collect();
        let Some(tied) = &self.combinations else { return Ok(of_free(mass)) };
        let mut pulled = mass.to_vec();
        let is_free = |node: u32| (0..3).any(|k| self.free.binary_search(&(3 * node + k)).is_ok());
        tied.pull_back_mass(&mut pulled, is_free)?;
        Ok(of_free(&pulled))
    }

    /// Returns the coordinates with all prescribed ones held at zero.
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
        }
    }

    /// Number of coordinates x_i.
    pub fn dof_count(&self) -> usize {
        self.dof_count
    }

    /// Number of free coordinates q_i.
    pub fn free_count(&self) -> usize {
        self.free.len()
    }

    /// The coordinates x_i that are free, ascending: `q[k] = x[free[k]]` where [`Coordinates::is_plain`].
    pub fn free(&self) -> &[u32] {
        &self.free
    }

    /// The prescribed coordinates and their paths.
    pub fn prescribed(&self) -> &[Prescribed] {
        &self.prescribed
    }

    /// Does any prescribed coordinate move?
    pub fn is_moving(&self) -> bool {
        self.prescribed.iter().any(|group| !group.path.is_fixed())
    }

    /// x(q, t), m.
    pub fn embed(&self, q: &[f64], t: f64, x: &mut [f64]) {
        self.scatter_free(q, x);
        self.place_prescribed(t, x);
        self.axes.to_space(x);
        if let Some(tied) = &self.combinations {
            tied.embed(x);
        }
    }

    /// The prescribed entries of x(q, t), m, along nodes' own axes; the others stay as they are.
    pub fn place_prescribed(&self, t: f64, x: &mut [f64]) {
        self.scatter_prescribed(x, |path, out| path.position(t, out));
    }

    /// ẋ = ∂x/∂q q̇ + ∂x/∂t, m/s.
    pub fn embed_velocity(&self, q_dot: &[f64], t: f64, x_dot: &mut [f64]) {
        self.scatter_free(q_dot, x_dot);
        self.scatter_prescribed(x_dot, |path, out| path.velocity(t, out));
        self.axes.to_space(x_dot);
        if let Some(tied) = &self.combinations {
            tied.embed(x_dot);
        }
    }

    /// ∂x/∂q dq: the change of all coordinates with that of the free ones, at a fixed time, m.
    pub fn embed_change(&self, dq: &[f64], dx: &mut [f64]) {
        dx.fill(0.0);
        self.scatter_free(dq, dx);
        self.axes.to_space(dx);
        if let Some(tied) = &self.combinations {
            tied.embed(dx);
        }
    }

    /// q from positions x, or q̇ from velocities: the free coordinates, along nodes' own axes.
    pub fn coordinates_of(&self, x: &[f64], q: &mut [f64]) {
        if self.axes.is_empty() {
            return self.restrict(x, q);
        }
        let mut own = x.to_vec();
        self.axes.to_own(&mut own);
        self.restrict(&own, q);
    }

    /// The entries of the free coordinates: of a covector that has been pulled back, Sᵀf.
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
