//! The half-spaces of a run at the time of a frame, and the points of the frame that lie in them. Frames show surfaces only, so
//! they come from the scene in report.json.

use std::collections::HashSet;
use std::path::Path;

use nalgebra::{Rotation3, Unit, Vector3};
use serde::Deserialize;

use crate::intersections::frame::FrameSurface;
use crate::scene::{Rigid, RigidShape, Scene};

/// Depth that frames do not resolve, relative to the largest coordinate: positions in 32 bits are rest positions plus displacements,
/// each rounded.
const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// The half-spaces with which every body of a scene has contact everywhere.
pub(super) struct FramePlanes {
    planes: Vec<Rigid>,
}

impl FramePlanes {
    /// Reads the scene of the run in a directory; there are no half-spaces without a report.
    pub(super) fn of_run(directory: &Path) -> Self {
        let text = std::fs::read_to_string(directory.join("report.json")).unwrap_or_default();
        let report: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
        let scene: Option<Scene> = report.get("scene").and_then(|scene| Scene::deserialize(scene).ok());
        Self { planes: scene.map(planes).unwrap_or_default() }
    }

    /// Returns the points of the surfaces of a frame at time t (s) that lie in a half-space, with its name.
    pub(super) fn sunk(&self, surface: &FrameSurface, t: f64) -> Vec<(u32, &str)> {
        let on_surface = surface.triangles.as_flattened().iter().chain(surface.wires.as_flattened());
        let mut points: Vec<u32> = on_surface.copied().collect();
        points.sort_unstable();
        points.dedup();
        let mut sunk = Vec::new();
        for plane in &self.planes {
            let Some((origin, normal)) = face(plane, t) else { continue };
            let is_sunk = |point: &&u32| {
                let place = Vector3::from(surface.points[**point as usize]);
                normal.dot(&(place - origin)) < -ROUNDING * place.amax().max(origin.amax())
            };
            sunk.extend(points.iter().filter(is_sunk).map(|&point| (point, plane.name.as_str())));
        }
        sunk
    }
}

/// Returns the half-spaces of a scene that no key lets bodies pass.
fn planes(scene: Scene) -> Vec<Rigid> {
    let excluded = scene.contact.iter().flat_map(|contact| contact.exclude.iter().flatten());
    let joined = scene.joints.iter().flat_map(|joint| [Some(joint.body()), joint.to()]).flatten();
    let attached = scene.attachments.iter().filter_map(|attach| attach.to.as_deref());
    let passed: HashSet<String> =
        excluded.map(String::as_str).chain(joined).chain(attached).map(str::to_owned).collect();
    let is_half_space = |rigid: &Rigid| rigid.shape.as_ref().is_some_and(RigidShape::is_plane);
    scene.rigids.into_iter().filter(|rigid| is_half_space(rigid) && !passed.contains(&rigid.name)).collect()
}

/// Returns a point on the face of a half-space at time t (s), m, and its outward unit normal.
fn face(plane: &Rigid, t: f64) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let Some(RigidShape::Plane { normal }) = plane.shape else { return None };
    let normal = plane.orientation.map_or(Vector3::from(normal), |turn| {
        Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::from(turn.axis)), turn.angle)
            * Vector3::from(normal)
    });
    let (origin, normal) = match &plane.motion {
        Some(motion) => (motion.position(plane.position, t), motion.turned(normal.into(), t)),
        None => (plane.position, normal.into()),
    };
    Some((origin.into(), Vector3::from(normal).normalize()))
}
