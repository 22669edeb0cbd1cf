//! Violent scenes: combines each kind of violence with a random body, law, element, scheme, step and support. The
//! same seed and index give the same scene.

use std::path::Path;

use serde_json::{Value, json};
use vi_fem::{Bending, Law, SheetLaw};
use vi_io::{IoError, VtuArray, VtuFrame, VtuOptions, VtuValues};
use vi_mesh::{BoxMesh, CellBlock, Mesh, Region, SheetMesh};
use vi_solvers::AcceptedForces;

use super::kinds::Violence;
use super::random::Random;
use super::transform::{Quantity, Transform, quantity};
use crate::scene::{
    Body, Checkpoints, Damping, Fix, Guard, GuardAction, MaterialEntry, Materials, Output, Precision, Probe,
    Scene, SchemeName, Selection, Strike, Substance, Time,
};

/// Error that prevents a case.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// The mesh cannot be written.
    #[error(transparent)]
    Mesh(#[from] IoError),
    /// A scene in which bodies meet does not parse; its generator must support its keys.
    #[error("the scene: {0}")]
    Scene(String),
    /// The parameters of a case do not fit a law of the registry; `stress/violence.rs` must support its keys.
    #[error("law {law}: {why}")]
    Law {
        /// Name of the law.
        law: String,
        /// Error of the parser.
        why: String,
    },
}

/// A scene of the stress test.
#[derive(Debug, Clone)]
pub struct Case {
    /// Number of the scene in the seed.
    pub index: u64,
    /// Action on the bodies.
    pub violence: Violence,
    /// The scene.
    pub scene: Scene,
    /// Whether something other than its initial state, elasticity and constant weight acts on the body.
    pub is_driven: bool,
    /// Whether the body has no supports and no weight, so that momentum is conserved.
    pub is_free: bool,
    /// A change that must not change the result: the changed scene is also run and judged.
    pub twin: Option<Transform>,
}

impl Case {
    /// Returns a case of bodies that meet, from the tables of its scene.
    ///
    /// # Errors
    /// Returns [`CaseError::Scene`] if the scene does not parse.
    pub(super) fn of_meeting(index: u64, violence: Violence, scene: Value) -> Result<Self, CaseError> {
        let scene = serde_json::from_value(scene).map_err(|error| CaseError::Scene(error.to_string()))?;
        Ok(Self { index, violence, scene, is_driven: true, is_free: false, twin: None })
    }
}

/// A body that is being built.
struct Making {
    mesh: Mesh,
    displacement: Vec<[f64; 3]>,
    is_sheet: bool,
    /// Stiffness and density of its second half, as multiples of those of its first half.
    ratio: (f64, f64),
    /// Young's modulus, Pa; density, kg/m³; Poisson's ratio.
    young: f64,
    density: f64,
    poisson: f64,
    law: usize,
    bending: Bending,
    size: f64,
}

/// Returns case `index` of a seed. Required meshes are written into `directory`.
///
/// # Errors
/// Returns [`CaseError`] if a mesh cannot be written, or a law of the registry is not supported.
pub fn case(seed: u64, index: u64, directory: &Path) -> Result<Case, CaseError> {
    let mut random = Random::of(seed, index);
    let random = &mut random;
    // The kinds take turns, so that any count covers them evenly.
    let kinds = Violence::of_one_body();
    let violence = kinds[(index % kinds.len() as u64) as usize];
    let mut making = make(random, violence);
    deform(random, violence, &mut making);
    let wave_speed = (making.young / making.density).sqrt();
    // The time scale is that of a wave crossing the body; the step is between 1/100 of it and all of it.
    let crossing = making.size / wave_speed;
    let scheme = random.of_all(&SchemeName::ALL);
    let step = match violence {
        Violence::Steps => random.decades(1e-8, 1.0),
        _ => crossing * random.decades(0.01, 1.0),
    };
    let count = 4 + random.below(16);
    let mut time = Time::new(step * count as f64, step, scheme);
    if scheme == SchemeName::Gauss {
        time.stages = Some(1 + random.below(5));
    }
    let mut body = body(&making, directory, index)?;
    let mut scene = Scene::new(time);
    let gravity = match violence {
        Violence::Gravity => random.decades(1e-2, 1e6),
        Violence::Moderate => 1.0,
        _ if random.once_in(3) => random.decades(1e-2, 1e2),
        _ => 0.0,
    };
    scene.gravity = [0.0, 0.0, -9.81 * gravity];
    if violence == Violence::Spinning {
        let rate = random.between(0.2, 1.2) * wave_speed / making.size;
        let axis = random.vector(1.0);
        let length = axis.iter().map(|a| a * a).sum::<f64>().sqrt().max(1e-3);
        body.angular_velocity = Some(axis.map(|a| a / length * rate));
    } else if random.once_in(4) {
        body = body.velocity(random.vector(wave_speed));
    }
    scene.bodies.push(body);
    let mut is_driven = false;
    let mut is_free = gravity == 0.0;
    let ends = ends(&making.mesh);
    match violence {
        Violence::Twisted | Violence::Pulled => {
            let end = scene.time.end;
            let motion = if violence == Violence::Twisted {
                json!({ "kind": "rotate", "axis": [1.0, 0.0, 0.0], "point": [0.0, 0.5, 0.5],
                        "rate": 20.0 * std::f64::consts::PI / end })
            } else if random.once_in(2) {
                json!({ "kind": "translate", "velocity": random.vector(3.0 * wave_speed) })
            } else {
                json!({ "kind": "sine", "amplitude": random.vector(making.size),
                        "frequency": random.decades(0.01, 1.0) / crossing })
            };
            let mut moved = Fix::nodes("body", ends[1].clone());
            moved.motion = serde_json::from_value(motion).ok();
            scene.fixes.push(moved);
            if random.once_in(2) {
                scene.fixes.push(Fix::nodes("body", ends[0].clone()));
            }
            (is_driven, is_free) = (true, false);
        }
        Violence::Struck => {
            let region = if making.is_sheet { "sheet" } else { "box" };
            let mass = making.density * making.size.powi(3);
            let share = random.decades(0.01, 3.0);
            let impulse = random.vector(mass * wave_speed * share);
            scene.strikes.push(Strike { body: "body".into(), on: Selection::region(region), impulse });
        }
        _ => {}
    }
    if !is_driven {
        match random.below(4) {
            0 => {}
            1 => scene.fixes.push(Fix::nodes("body", vec![0])),
            2 => scene.fixes.push(Fix::nodes("body", ends[0].clone())),
            _ if random.once_in(6) => {
                scene.fixes.push(Fix::nodes("body", (0..making.mesh.points.len()).collect()));
            }
            _ => {}
        }
        is_free &= scene.fixes.is_empty();
    }
    // Only variational schemes up to order 2: with `newmark` a struck sheet in the wind ends differently in other
    // units.
    let takes_forces = scheme.method().map(|method| method.facts()).is_some_and(|facts| {
        facts.accepts.forces == AcceptedForces::All && facts.is_variational() && facts.order <= 2
    });
    if takes_forces && !making.is_sheet && random.once_in(6) {
        let stiffness_time = crossing * random.decades(1e-3, 1.0);
        let rate = if random.once_in(2) { random.decades(1e-2, 10.0) / crossing } else { 0.0 };
        scene.damping = Some(Damping { stiffness_time, mass_rate: rate, ..Damping::default() });
        is_free &= rate == 0.0;
        is_driven = true;
    }
    if takes_forces && making.is_sheet && random.once_in(3) {
        let wind = json!({ "velocity": random.vector(wave_speed) });
        scene.wind = serde_json::from_value(wind).ok();
        (is_driven, is_free) = (true, false);
    }
    scene.probes.push(Probe::node("probe", "body", random.below(making.mesh.points.len())));
    scene.solver.tolerance = random.of_all(&[1e-4, 1e-6, 1e-6, 1e-10]);
    scene.guard = match random.below(8) {
        0 => Some(Guard::new(GuardAction::Halve)),
        1 => Some(Guard::new(GuardAction::Switch)),
        2 => Some(Guard::new(GuardAction::Stop)),
        _ => None,
    };
    if random.once_in(8) {
        scene.checkpoint = Some(Checkpoints::every(4.0 * step));
    }
    let precision = random.of_all(&[Precision::F32, Precision::F64]);
    scene.output = Output { interval: Some(3.0 * step), precision, ..Output::default() };
    let twin = twin(&mut Random::of(!seed, index), making.size);
    Ok(Case { index, violence, scene, is_driven, is_free, twin })
}

/// Half of the scenes have a twin, in other units or far from the origin.
fn twin(random: &mut Random, size: f64) -> Option<Transform> {
    let mut power = || random.below(61) as i32 - 30;
    let units = Transform::Units { length: power(), mass: power(), time: power() };
    let distance = size * random.decades(1e2, 1e6);
    match random.below(4) {
        0 => Some(units),
        1 => Some(Transform::Moved(random.vector(distance))),
        _ => None,
    }
}

fn make(random: &mut Random, violence: Violence) -> Making {
    let can_be_sheet = !matches!(violence, Violence::Stiffness | Violence::Density);
    let is_sheet = can_be_sheet && random.once_in(3);
    let mut extent = [random.between(0.5, 2.0), random.between(0.5, 2.0), random.between(0.5, 2.0)];
    if violence == Violence::Slivers {
        extent[random.below(if is_sheet { 2 } else { 3 })] *= random.decades(1e-6, 1e-2);
    }
    let (young, density) = (random.decades(1e3, 1e11), random.decades(10.0, 2e4));
    let poisson = match violence {
        Violence::Poisson => random.of_all(&[-0.9, -0.5, 0.0, 0.45, 0.49, 0.499, 0.4999]),
        _ => random.between(0.0, 0.45),
    };
    let ratio = match violence {
        Violence::Stiffness => (random.decades(1e-8, 1e8), 1.0),
        Violence::Density => (1.0, random.decades(1e-6, 1e6)),
        _ => (1.0, 1.0),
    };
    let mesh = if is_sheet {
        let cells = [1 + random.below(5), 1 + random.below(5)];
        let shape = json!({ "size": [extent[0], extent[1]], "cells": cells });
        serde_json::from_value::<SheetMesh>(shape).ok().and_then(|shape| shape.build().ok())
    } else {
        let element = random.of_all(vi_fem::SOLIDS);
        let most = if element.node_count() > 10 { 1 } else { 3 };
        let mut cells = [0; 3].map(|_| 1 + random.below(most) as u32);
        cells[0] = cells[0].max(if ratio == (1.0, 1.0) { 1 } else { 2 });
        BoxMesh { size: extent, cells, element, origin: [0.0; 3] }.build().ok()
    };
    let mesh = mesh.unwrap_or_default();
    let bendings: Vec<Bending> = Bending::ALL.iter().copied().chain([Bending::None]).collect();
    Making {
        displacement: vec![[0.0; 3]; mesh.points.len()],
        ratio,
        law: random.below(if is_sheet { SheetLaw::NAMES.len() } else { Law::NAMES.len() }),
        bending: random.of_all(&bendings),
        size: extent.into_iter().fold(0.0, f64::max),
        mesh,
        is_sheet,
        young,
        density,
        poisson,
    }
}

/// Deforms the body from its shape at rest.
fn deform(random: &mut Random, violence: Violence, making: &mut Making) {
    let axis = random.below(3);
    let partly = random.once_in(3);
    // An incomplete collapse is as difficult as a complete one.
    let rest = if partly { random.decades(1e-12, 1e-2) } else { 0.0 };
    let keeps = |k: usize| match violence {
        Violence::Plane => k != axis,
        Violence::Line => k == axis,
        _ => false,
    };
    let size = making.size;
    for (x, u) in making.mesh.points.iter().zip(&mut making.displacement) {
        let target: [f64; 3] = match violence {
            Violence::Plane | Violence::Line | Violence::Point => {
                std::array::from_fn(|k| if keeps(k) { x[k] } else { rest * x[k] })
            }
            Violence::Inverted => std::array::from_fn(|k| if k == axis { -x[k] } else { x[k] }),
            Violence::Scrambled => [0; 3].map(|_| random.between(0.0, size)),
            Violence::Stretched => std::array::from_fn(|k| if k == axis { 20.0 * x[k] } else { x[k] }),
            _ => *x,
        };
        *u = std::array::from_fn(|k| target[k] - x[k]);
    }
}

/// Returns the nodes at the smallest and at the largest x.
fn ends(mesh: &Mesh) -> [Vec<usize>; 2] {
    let x = || mesh.points.iter().map(|point| point[0]);
    let (low, high) = (x().fold(f64::INFINITY, f64::min), x().fold(f64::NEG_INFINITY, f64::max));
    [low, high].map(|end| {
        let at_end = x().enumerate().filter(|(_, x)| (x - end).abs() <= 1e-9 * (high - low));
        at_end.map(|(node, _)| node).collect()
    })
}

fn body(making: &Making, directory: &Path, index: u64) -> Result<Body, CaseError> {
    let materials = materials(making, index)?;
    let path = directory.join(format!("body-{index}.vtu"));
    let mesh = &making.mesh;
    let dimension = if making.is_sheet { 2 } else { 3 };
    let cells = mesh.cells_of_dimension(dimension);
    let mut blocks: Vec<CellBlock> = Vec::new();
    for (kind, nodes) in cells.iter().filter_map(|&cell| mesh.cell(cell as usize)) {
        match blocks.last_mut() {
            Some(block) if block.kind == kind => block.nodes.extend(nodes),
            _ => blocks.push(CellBlock { kind, nodes: nodes.to_vec() }),
        }
    }
    let count = cells.len() as u32;
    let name = if making.is_sheet { "sheet" } else { "box" };
    let region = |name: &str, cells: Vec<u32>| Region { name: name.to_owned(), dimension, cells };
    let mut regions = vec![region(name, (0..count).collect())];
    if materials.0.len() > 1 {
        regions.push(region("first", (0..count / 2).collect()));
        regions.push(region("second", (count / 2..count).collect()));
    }
    let values = VtuValues::Real(making.displacement.as_flattened());
    let frame = VtuFrame {
        points: &mesh.points,
        blocks: &blocks,
        far: &[],
        regions: &regions,
        point_data: &[VtuArray { name: "displacement", components: 3, values }],
        cell_data: &[],
        time: None,
        field_data: &[],
    };
    vi_io::write_vtu(&path, &frame, VtuOptions::default())?;
    let mut body = Body::from_mesh("body", path, Law::examples()[0].clone());
    body.material = materials;
    Ok(body)
}

/// Young's modulus of the registry's examples, Pa: all are soft rubbers.
const EXAMPLE_YOUNG: f64 = 1e6;

/// Returns a law of the registry with moduli, densities and Poisson's ratio set to the given values. The example of
/// the law lists its keys; their dimensions identify them.
fn substance(making: &Making, tension_field: bool, young: f64, density: f64) -> Result<Substance, CaseError> {
    let mut value = match making.is_sheet {
        true => json!(SheetLaw::examples()[making.law]),
        false => json!(Law::examples()[making.law]),
    };
    let law = value["law"].as_str().unwrap_or_default().to_owned();
    let refused = |why: String| CaseError::Law { law, why };
    let Some(keys) = value.as_object_mut() else {
        return Err(refused("its parameters are not a table".to_owned()));
    };
    for (key, value) in keys.iter_mut() {
        match quantity(key) {
            Some(Quantity::Modulus) => *value = json!(value.as_f64().unwrap_or(1.0) * young / EXAMPLE_YOUNG),
            Some(Quantity::Density) => *value = json!(density),
            Some(Quantity::Length) => *value = json!(1e-2 * making.size),
            None => {}
        }
    }
    if keys.contains_key("poisson") {
        let isotropic = keys.contains_key("young");
        keys["poisson"] = json!(if isotropic { making.poisson } else { 0.5 * making.poisson.abs() });
    }
    if making.is_sheet {
        keys["bending"] = json!(making.bending);
        keys["tension_field"] = json!(tension_field);
        return serde_json::from_value(value)
            .map(Substance::Sheet)
            .map_err(|error| refused(error.to_string()));
    }
    serde_json::from_value(value).map(Substance::Solid).map_err(|error| refused(error.to_string()))
}

fn materials(making: &Making, index: u64) -> Result<Materials, CaseError> {
    let of = |young: f64, density: f64| substance(making, index.is_multiple_of(5), young, density);
    let first = of(making.young, making.density)?;
    let entry = |region: &str, law| MaterialEntry { region: Some(region.to_owned()), law };
    let (stiffness, density) = making.ratio;
    if making.ratio == (1.0, 1.0) {
        return Ok(Materials(vec![MaterialEntry { region: None, law: first }]));
    }
    let second = of(making.young * stiffness, making.density * density)?;
    Ok(Materials(vec![entry("first", first), entry("second", second)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scheme_element_and_law_of_the_registries_is_tried() {
        let directory = tempfile::tempdir().unwrap();
        let (mut laws, mut schemes_seen) = (std::collections::BTreeSet::new(), Vec::new());
        for index in 0..600 {
            let scene = case(1, index, directory.path()).unwrap().scene;
            let entry = &scene.bodies[0].material.0[0];
            assert!(entry.law.check().is_ok(), "scene {index}: {:?}", entry.law);
            laws.insert((entry.law.dimension(), entry.law.name()));
            schemes_seen.extend(scene.time.scheme);
        }
        assert_eq!(laws.len(), Law::NAMES.len() + SheetLaw::NAMES.len());
        assert!(SchemeName::ALL.iter().all(|scheme| schemes_seen.contains(scheme)));
    }
}
