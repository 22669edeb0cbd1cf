//! Rigid bodies in natural coordinates (c, d₁, d₂, d₃): the nodes that they add to a component, the ties of attached
//! nodes, and the constraints of their joints.
//!
//! Any rigid body has the mass, centre and inertia of six points at c ± √(3 J_k/m) e_k with a sixth of its mass each
//! (E. J. Routh's equimomental system; J_k = ∫ X_k² dm are Euler's moments). These points are tied to
//! (c, d_k) like attached nodes, so that one rule gives the mass of both.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use vi_core::constraints::{Place, QuadraticConstraint};
use vi_core::{Combination, Fixed, Path, Prescribed, TiedMass};
use vi_fem::Motion;

use super::shape::Form;
use crate::scene::{Joint, Rigid, RigidShape};

/// A rigid body of a scene as part of a component.
#[derive(Debug, Clone)]
pub struct RigidModel {
    /// Name of the body.
    pub name: String,
    /// Number of the component to which the body belongs.
    pub component: usize,
    /// Number of node c in the component; d₁, d₂, d₃ follow.
    pub node: usize,
    /// Centre of mass without attached nodes, from c in the basis (d₁, d₂, d₃), m.
    centre: Vector3<f64>,
    /// Principal axes without attached nodes in the basis (d₁, d₂, d₃), by columns.
    axes: Matrix3<f64>,
    /// Shape of the body.
    pub shape: Option<RigidShape>,
    /// Surface and volume of the body.
    pub(crate) form: Option<Arc<Form>>,
    /// Triangles of its surface, if it can meet others: nodes of the component.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Distance of the surface from its skeleton, m, if it is round; 0 otherwise.
    pub(crate) radius: f64,
    /// Number of nodes that it adds to the component.
    node_count: usize,
    /// Number of these that are points of its surface; they are the last ones.
    surface_count: usize,
}

/// Position and orientation of a rigid body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Centre of mass without attached nodes, m.
    pub position: [f64; 3],
    /// Local axes of the body in space, as a unit quaternion (w, x, y, z) with w ≥ 0.
    pub orientation: [f64; 4],
}

impl RigidModel {
    fn point(x: &[f64], node: usize) -> Vector3<f64> {
        Vector3::from_column_slice(&x[3 * node..3 * node + 3])
    }

    fn directors(&self, x: &[f64]) -> Matrix3<f64> {
        Matrix3::from_columns(&[1, 2, 3].map(|k| Self::point(x, self.node + k)))
    }

    /// Returns its pose from the positions of the component's nodes.
    pub fn pose(&self, x: &[f64]) -> Pose {
        let directors = self.directors(x);
        let position = Self::point(x, self.node) + directors * self.centre;
        let turn = nalgebra::Rotation3::from_matrix_unchecked(directors * self.axes);
        let turn = nalgebra::UnitQuaternion::from_rotation_matrix(&turn);
        let sign = if turn.w < 0.0 { -1.0 } else { 1.0 };
        let orientation = [turn.w, turn.i, turn.j, turn.k].map(|value| sign * value);
        Pose { position: position.into(), orientation }
    }

    /// Returns the place of c (m), the sum of the forces at its nodes c, d₁, d₂, d₃ (N), and their moment about c (N m), at positions
    /// `x` of the component's nodes: a force f on d_k does the work f · (θ × d_k) = θ · (d_k × f) in a turn θ.
    pub(crate) fn wrench(&self, x: &[f64], forces: &[f64]) -> [[f64; 3]; 3] {
        let of_director = |k: usize| Self::point(x, self.node + k).cross(&Self::point(forces, self.node + k));
        let moment: Vector3<f64> = (1..4).map(of_director).sum();
        [Self::point(x, self.node).into(), Self::point(forces, self.node).into(), moment.into()]
    }

    /// Returns the global direction of a vector given in its local axes, at positions `x` of the component's nodes.
    pub(super) fn directions_at_start(&self, x: &[f64], direction: [f64; 3]) -> [f64; 3] {
        (self.directors(x) * (self.axes * Vector3::from(direction))).into()
    }

    /// Iterates over the nodes of the component that move with it.
    pub(super) fn nodes(&self) -> std::ops::Range<u32> {
        self.node as u32..(self.node + self.node_count) as u32
    }

    /// Returns the nodes c, d₁, d₂, d₃ of the component.
    pub(super) fn frame(&self) -> [u32; 4] {
        [0, 1, 2, 3].map(|k| (self.node + k) as u32)
    }

    /// Returns the nodes of the component on its surface, or on its skeleton if it is round.
    pub(crate) fn surface_nodes(&self) -> std::ops::Range<usize> {
        let end = self.node + self.node_count;
        end - self.surface_count..end
    }

    /// Returns the positions (or velocities) of points that are given in its local axes from its centre, from those of
    /// the component's nodes.
    pub fn carry(&self, x: &[f64], points: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let (c, directors) = (Self::point(x, self.node), self.directors(x));
        let at = |point: &[f64; 3]| c + directors * (self.centre + self.axes * Vector3::from(*point));
        points.iter().map(|point| at(point).into()).collect()
    }
}

/// The terms that a rigid body adds to a component, in the component's node numbers.
pub(super) struct Added {
    pub(super) model: RigidModel,
    /// Mass of its nodes, kg.
    pub(super) mass: Vec<f64>,
    pub(super) x: Vec<f64>,
    pub(super) v: Vec<f64>,
    pub(super) ties: Vec<Combination>,
    pub(super) directors: [u32; 3],
    pub(super) constraints: Vec<QuadraticConstraint>,
    is_prescribed: bool,
    motion: Option<Motion>,
    frame: Frame,
}

impl Added {
    /// Returns the path of the body, if it is prescribed.
    pub(super) fn prescribed(&self) -> Option<Prescribed> {
        if !self.is_prescribed {
            return None;
        }
        let first = 3 * self.frame.node;
        let path: Box<dyn Path> = match &self.motion {
            Some(motion) => Box::new(Carried { motion: motion.clone(), frame: self.frame }),
            None => Box::new(Fixed(self.x[..12].to_vec())),
        };
        Some(Prescribed { dofs: (first..first + 12).collect(), path })
    }
}

/// Initial position c and directors.
#[derive(Debug, Clone, Copy)]
struct Frame {
    node: u32,
    origin: Vector3<f64>,
    /// e_k by columns.
    axes: Matrix3<f64>,
    /// The centre of mass from `origin` in the basis (d₁, d₂, d₃), m. It differs from zero only by the round-off of
    /// coordinates far from the global origin. Weights are relative to it, so that no mass couples c and the directors.
    centre: Vector3<f64>,
}

impl Frame {
    /// Returns a director at the start.
    fn director(&self, number: usize) -> [f64; 3] {
        self.axes.column(number).into_owned().into()
    }

    /// Returns the weights of a point in space that moves with the body.
    fn point(&self, x: [f64; 3]) -> Vec<(u32, f64)> {
        let local = self.axes.transpose() * (Vector3::from(x) - self.origin) - self.centre;
        std::iter::once((self.node, 1.0)).chain(self.direction(local)).collect()
    }

    fn direction(&self, local: Vector3<f64>) -> impl Iterator<Item = (u32, f64)> {
        (1..=3).zip([local.x, local.y, local.z]).map(|(k, weight)| (self.node + k, weight))
    }

    /// Returns a direction in space that rotates with the body.
    fn carried(&self, direction: Vector3<f64>) -> Place {
        Place::sum(self.direction(self.axes.transpose() * direction).collect())
    }
}

/// An attached node: its number in the component, its initial position (m) and its mass (kg).
pub(super) struct Attached {
    pub(super) node: u32,
    pub(super) x: [f64; 3],
    pub(super) mass: f64,
}

/// Builds a rigid body with its attached nodes. Its own nodes are `node` and following of component `component`,
/// including the points of its surface if it `can_meet` others.
pub(super) fn build(
    (rigid, form): (&Rigid, Option<&Arc<Form>>),
    attached: &[Attached],
    component: usize,
    node: usize,
    can_meet: bool,
) -> Result<Added, String> {
    let own = Own::new(rigid, form.map(Arc::as_ref));
    let mass = own.mass + attached.iter().map(|a| a.mass).sum::<f64>();
    let frame = if rigid.is_prescribed() {
        Frame { node: node as u32, origin: own.centre, axes: own.axes, centre: Vector3::zeros() }
    } else {
        principal(rigid, &own, attached, mass, node as u32)?
    };
    let omega = Vector3::from(rigid.angular_velocity.unwrap_or_default());
    let velocity = Vector3::from(rigid.velocity.unwrap_or_default());
    let [e1, e2, e3] = [0, 1, 2].map(|k| frame.axes.column(k).into_owned());
    let mut x: Vec<Vector3<f64>> = vec![frame.origin, e1, e2, e3];
    let mut v = vec![
        velocity + omega.cross(&(frame.origin - own.centre)),
        omega.cross(&e1),
        omega.cross(&e2),
        omega.cross(&e3),
    ];
    let mut masses = vec![0.0; 4];
    let mut ties: Vec<Combination> = attached
        .iter()
        .map(|a| Combination { node: a.node, terms: frame.point(a.x), mass: TiedMass::Exact })
        .collect();
    if !rigid.is_prescribed() && own.mass > 0.0 {
        for (point, share) in own.equimomental() {
            let number = (node + x.len()) as u32;
            ties.push(Combination { node: number, terms: frame.point(point.into()), mass: TiedMass::Exact });
            x.push(point);
            v.push(velocity + omega.cross(&(point - own.centre)));
            masses.push(share);
        }
    }
    let (points, triangles) = form.filter(|_| can_meet).map(|form| form.outside()).unwrap_or_default();
    let corners = corners(rigid).unwrap_or_default();
    let points = if can_meet && !corners.is_empty() { &corners } else { points };
    let (mut triangles, radius) = (triangles.to_vec(), form.map_or(0.0, |form| form.radius));
    let (first, surface_count) = ((node + x.len()) as u32, points.len());
    triangles.iter_mut().for_each(|triangle| *triangle = triangle.map(|k| first + k));
    for point in points {
        let point = own.centre + own.axes * Vector3::from(*point);
        let number = (node + x.len()) as u32;
        ties.push(Combination { node: number, terms: frame.point(point.into()), mass: TiedMass::Exact });
        x.push(point);
        v.push(velocity + omega.cross(&(point - own.centre)));
        masses.push(0.0);
    }
    let directors = [1, 2, 3].map(|k| frame.node + k);
    let constraints = match rigid.is_prescribed() {
        true => Vec::new(),
        false => QuadraticConstraint::orthonormal(&format!("rigid '{}'", rigid.name), directors).to_vec(),
    };
    let model = RigidModel {
        name: rigid.name.clone(),
        component,
        node,
        centre: frame.axes.transpose() * (own.centre - frame.origin),
        axes: frame.axes.transpose() * own.axes,
        shape: rigid.shape.clone(),
        form: form.cloned(),
        triangles,
        radius,
        node_count: x.len(),
        surface_count,
    };
    let flat = |list: &[Vector3<f64>]| list.iter().flat_map(|x| [x.x, x.y, x.z]).collect();
    Ok(Added {
        model,
        mass: masses,
        x: flat(&x),
        v: flat(&v),
        ties,
        directors,
        constraints,
        is_prescribed: rigid.is_prescribed(),
        motion: rigid.motion.clone(),
        frame,
    })
}

/// Returns two points on the face of a half-space that rotates, 1 m from its position, in its local axes: the cross product
/// of the first and the second points outward.
fn corners(rigid: &Rigid) -> Option<Vec<[f64; 3]>> {
    let (Some(RigidShape::Plane { normal }), Some(Motion::Rotate(_))) = (&rigid.shape, &rigid.motion) else {
        return None;
    };
    let normal = Vector3::from(*normal).normalize();
    let first = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    Some(vec![first.into(), normal.cross(&first).into()])
}

/// Smallest Euler moment of a flat body, across its plane, relative to the largest. With zero the director across the
/// plane would have no mass. The moments of inertia change by this fraction, and the motion by less than the
/// integrators' error.
const FLAT: f64 = 1e-9;

/// Mass without attached nodes (kg), centre, principal axes by columns, and Euler's tensor ∫ r rᵀ dm about the centre
/// (kg m²).
struct Own {
    mass: f64,
    centre: Vector3<f64>,
    axes: Matrix3<f64>,
    euler: Matrix3<f64>,
}

impl Own {
    fn new(rigid: &Rigid, form: Option<&Form>) -> Self {
        let axes = rigid.orientation.map_or(Matrix3::identity(), |turn| {
            let axis = nalgebra::Unit::new_normalize(Vector3::from(turn.axis));
            nalgebra::Rotation3::from_axis_angle(&axis, turn.angle).into_inner()
        });
        let volume = form.map_or(0.0, |form| form.volume);
        let mass = rigid.mass.or(rigid.density.map(|density| density * volume)).unwrap_or(0.0);
        let local = match (&rigid.inertia, form) {
            (Some(inertia), _) => {
                let inertia = inertia.matrix();
                let inertia = Matrix3::from_fn(|i, j| inertia[i][j]);
                Matrix3::identity() * (0.5 * inertia.trace()) - inertia
            }
            (None, Some(form)) => form.squares * mass,
            (None, None) => Matrix3::zeros(),
        };
        let eigen = local.symmetric_eigen();
        let (least, thick) = (eigen.eigenvalues.imin(), FLAT * eigen.eigenvalues.max());
        let normal = eigen.eigenvectors.column(least);
        let missing = (thick - eigen.eigenvalues[least]).max(0.0);
        let local = local + normal * normal.transpose() * missing;
        let from_position = axes * form.map_or(Vector3::zeros(), |form| Vector3::from(form.centre));
        let centre = Vector3::from(rigid.position) + from_position;
        Self { mass, centre, axes, euler: axes * local * axes.transpose() }
    }

    /// Returns six points of equal mass that have its mass, centre and inertia.
    fn equimomental(&self) -> Vec<(Vector3<f64>, f64)> {
        let eigen = self.euler.symmetric_eigen();
        let pair = |k: usize| {
            let arm = eigen.eigenvectors.column(k) * (3.0 * eigen.eigenvalues[k].max(0.0) / self.mass).sqrt();
            [self.centre + arm, self.centre - arm]
        };
        (0..3).flat_map(pair).map(|point| (point, self.mass / 6.0)).collect()
    }
}

/// Returns the centre of mass and the principal axes of the body with all attached nodes.
fn principal(rigid: &Rigid, own: &Own, attached: &[Attached], mass: f64, node: u32) -> Result<Frame, String> {
    if mass <= 0.0 {
        return Err("has no mass: give it `mass` and `inertia`, a `density` and a `shape`, or attach nodes \
                    with mass to it"
            .to_owned());
    }
    // Positions are relative to its own centre, so that no digits are lost far from the origin.
    let moment: Vector3<f64> = attached.iter().map(|a| (Vector3::from(a.x) - own.centre) * a.mass).sum();
    let origin = own.centre + moment / mass;
    let outer = |r: Vector3<f64>, m: f64| r * r.transpose() * m;
    let mut euler = own.euler + outer(own.centre - origin, own.mass);
    for a in attached {
        euler += outer(Vector3::from(a.x) - origin, a.mass);
    }
    // Makes it exactly symmetric, so that principal axes along the global axes are found exactly.
    let euler = (euler + euler.transpose()) * 0.5;
    let eigen = euler.symmetric_eigen();
    if eigen.eigenvalues.min() <= 1e-12 * eigen.eigenvalues.max() {
        return Err(format!(
            "'{}' is flat or straight: its mass has no extent along some direction; give it a shape or an inertia of \
             its own",
            rigid.name
        ));
    }
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes = -axes;
    }
    let mut moment = (own.centre - origin) * own.mass;
    for a in attached {
        moment += (Vector3::from(a.x) - origin) * a.mass;
    }
    Ok(Frame { node, origin, axes, centre: axes.transpose() * (moment / mass) })
}

/// The path of (c, d₁, d₂, d₃) of a body with prescribed motion.
struct Carried {
    motion: Motion,
    frame: Frame,
}

impl Path for Carried {
    fn position(&self, t: f64, out: &mut [f64]) {
        out[..3].copy_from_slice(&self.motion.position(self.frame.origin.into(), t));
        for (k, out) in out[3..].chunks_exact_mut(3).enumerate() {
            out.copy_from_slice(&self.motion.turned(self.frame.director(k), t));
        }
    }
    fn velocity(&self, t: f64, out: &mut [f64]) {
        out[..3].copy_from_slice(&self.motion.velocity(self.frame.origin.into(), t));
        for (k, out) in out[3..].chunks_exact_mut(3).enumerate() {
            out.copy_from_slice(&self.motion.turning(self.frame.director(k), t));
        }
    }
    fn is_still(&self, place: usize) -> bool {
        match place {
            0..3 => self.motion.is_still_along_axis(place),
            _ => self.motion.keeps_directions(),
        }
    }
}

/// Returns the constraints of a joint between rigid bodies of one component, or to the world (`to` is `None`).
pub(super) fn joint(joint: &Joint, name: &str, body: &Added, to: Option<&Added>) -> Vec<QuadraticConstraint> {
    let of = |added: Option<&Added>, point: [f64; 3]| {
        added.map_or(Place::fixed(point), |added| Place::sum(added.frame.point(point)))
    };
    let along = |added: Option<&Added>, direction: Vector3<f64>| {
        added.map_or(Place::fixed(direction.into()), |added| added.frame.carried(direction))
    };
    let ball =
        |point: [f64; 3]| QuadraticConstraint::coincidence(name, &of(Some(body), point), &of(to, point));
    let perpendicular = |a: Vector3<f64>, b: Vector3<f64>| {
        QuadraticConstraint::product(name, &along(Some(body), a), &along(to, b), 0.0)
    };
    match joint {
        Joint::Ball { point, .. } => ball(*point).to_vec(),
        Joint::Hinge { point, axis, .. } => {
            let axis = Vector3::from(*axis).normalize();
            let [m, n] = beside(axis);
            ball(*point).into_iter().chain([perpendicular(axis, m), perpendicular(axis, n)]).collect()
        }
        Joint::Weld { point, .. } => {
            let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
            let turns = [perpendicular(x, y), perpendicular(y, z), perpendicular(z, x)];
            let centre = body.frame.origin.into();
            ball(point.unwrap_or(centre)).into_iter().chain(turns).collect()
        }
        Joint::Distance { point, to_point, .. } => {
            let length = (Vector3::from(*point) - Vector3::from(*to_point)).norm();
            vec![QuadraticConstraint::distance(name, &of(Some(body), *point), &of(to, *to_point), length)]
        }
    }
}

/// Returns two unit vectors normal to a unit vector and to each other.
fn beside(axis: Vector3<f64>) -> [Vector3<f64>; 2] {
    let other = Vector3::ith(axis.iamin(), 1.0);
    let first = axis.cross(&other).normalize();
    [first, axis.cross(&first)]
}
