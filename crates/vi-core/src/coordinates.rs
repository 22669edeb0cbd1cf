//! Generalised coordinates of a body of points: x = x(q, t), where q are the free coordinates and
//! the others follow a prescribed path. Prescribed coordinates are eliminated, never penalised.
//! This room must not know why a coordinate is prescribed.

use crate::CoreError;

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
}

impl Coordinates {
    /// All `dof_count` coordinates are free: x = q.
    pub fn all_free(dof_count: usize) -> Self {
        Self { dof_count, free: (0..dof_count as u32).collect(), prescribed: Vec::new() }
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
        Ok(Self { dof_count, free, prescribed })
    }

    /// Number of coordinates x_i.
    pub fn dof_count(&self) -> usize {
        self.dof_count
    }

    /// Number of free coordinates q_i.
    pub fn free_count(&self) -> usize {
        self.free.len()
    }

    /// The coordinates x_i that are free, ascending: `q[k] = x[free[k]]`.
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
        self.scatter_prescribed(x, |path, out| path.position(t, out));
    }

    /// ẋ = ∂x/∂q q̇ + ∂x/∂t, m/s.
    pub fn embed_velocity(&self, q_dot: &[f64], t: f64, x_dot: &mut [f64]) {
        self.scatter_free(q_dot, x_dot);
        self.scatter_prescribed(x_dot, |path, out| path.velocity(t, out));
    }

    /// q from x: the entries of the free coordinates. Also pulls a covector back, Sᵀf.
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
