//! `variational info`: prints the contents of a scene or a mesh, as text or as JSON. This file runs no scene.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::exit;
use super::run::{accept, name_of, print_problems};
use super::say::{Say, message, out};
use crate::auto::stand_in;
use crate::run::provenance::Provenance;
use crate::scene::{SchemeName, Substance};
use crate::simulation::Simulation;
use crate::simulation::stability::stability;

#[derive(Debug, Args)]
pub(super) struct InfoArguments {
    /// A scene (.toml) or a mesh file
    file: PathBuf,
    /// Write mass, stiffness and residual of a scene at its start into this directory (Matrix Market)
    #[arg(long, value_name = "DIRECTORY")]
    matrices: Option<PathBuf>,
    #[command(flatten)]
    say: Say,
}

/// Describes the contents of a mesh file.
#[derive(Serialize)]
struct MeshFacts {
    provenance: Provenance,
    points: usize,
    cells: usize,
    /// Smallest and largest coordinates, m; `None` without points.
    extent: Option<[[f64; 3]; 2]>,
    /// Number of cells by kind.
    kinds: Vec<(&'static str, usize)>,
    regions: Vec<RegionFacts>,
    /// Names and numbers of components of arrays over points and cells.
    point_data: Vec<(String, usize)>,
    cell_data: Vec<(String, usize)>,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct RegionFacts {
    name: String,
    dimension: usize,
    cells: usize,
}

/// Describes the contents of a scene.
#[derive(Serialize)]
struct SceneFacts {
    provenance: Provenance,
    title: String,
    steps: Option<u64>,
    /// Step, s.
    step: Option<f64>,
    scheme: &'static str,
    /// Whether `steps` and `step` are those of the intervals of adaptive steps.
    adaptive: bool,
    bodies: Vec<BodyFacts>,
    systems: Vec<SystemFacts>,
    /// All pairs of bodies of a scene with contact.
    contact: Vec<MeetingFacts>,
    /// Limit of explicit steps, s, and the frequency that determines it, rad/s.
    step_limit: Option<f64>,
    highest_frequency: Option<f64>,
    /// The rate of damping that determines it too, 1/s.
    damping_rate: Option<f64>,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct BodyFacts {
    name: String,
    nodes: usize,
    elements: usize,
    /// Mass, kg.
    mass: f64,
    system: usize,
    materials: Vec<MaterialFacts>,
    regions: Vec<RegionFacts>,
}

#[derive(Serialize)]
struct MaterialFacts {
    law: &'static str,
    /// Region; `None` for the cells of no other entry.
    region: Option<String>,
    /// Thickness (m) and mass per area (kg/m²) of a sheet.
    sheet: Option<[f64; 2]>,
}

/// Describes the contact of two bodies, or of a body with itself.
#[derive(Serialize)]
struct MeetingFacts {
    between: [String; 2],
    /// The reason why the pair is not searched for contact; `None` if it is.
    skipped: Option<&'static str>,
    /// Thickness d̂ of the contact layer, m, and its modulus κ, Pa.
    distance: Option<f64>,
    stiffness: Option<f64>,
    friction: Option<f64>,
    /// Time constant of contact damping, s.
    damping: Option<f64>,
}

#[derive(Serialize)]
struct SystemFacts {
    free: usize,
    coordinates: usize,
    /// Name and number of stencils of each term.
    terms: Vec<(String, usize)>,
}

pub(super) fn info(arguments: &InfoArguments) -> u8 {
    let path = &arguments.file;
    if path.extension().is_some_and(|extension| extension == "toml") {
        let facts = match scene(path) {
            Ok(facts) => facts,
            Err(code) => return code,
        };
        arguments.say.result(&facts, || say_scene(path, &facts));
        if let Some(directory) = &arguments.matrices {
            return write_matrices(path, directory, &arguments.say);
        }
    } else if arguments.matrices.is_some() {
        message!("error: --matrices needs a scene (.toml); {} is a mesh", path.display());
        return exit::BAD_INPUT;
    } else {
        let file = match vi_io::read_mesh(path) {
            Ok(file) => file,
            Err(error) => {
                message!("error: {error}");
                return exit::BAD_INPUT;
            }
        };
        let facts = mesh(path, &file);
        arguments.say.result(&facts, || say_mesh(path, &facts));
    }
    exit::DONE
}

/// Writes the matrices of each system. If there are several systems, file names begin with the number of the system.
fn write_matrices(path: &Path, directory: &Path, say: &Say) -> u8 {
    let Ok((scene, parsed)) = accept(path, &[]) else { return exit::BAD_INPUT };
    let simulation = match Simulation::new(stand_in(&scene)) {
        Ok(simulation) => simulation,
        Err(problems) => {
            print_problems(problems, &parsed, path);
            return exit::BAD_INPUT;
        }
    };
    let count = simulation.components().len();
    for number in 0..count {
        let prefix = if count == 1 { String::new() } else { format!("system-{number}-") };
        let matrices = match simulation.matrices(number) {
            Ok(matrices) => matrices,
            Err(error) => {
                message!("error: {error}");
                return exit::NO_CONVERGENCE;
            }
        };
        if let Err(error) = matrices.write(directory, &prefix) {
            message!("error: {}: the matrices cannot be written: {error}", directory.display());
            return exit::INPUT_OUTPUT;
        }
    }
    if !say.is_brief() {
        message!("the matrices are in {}", directory.display());
    }
    exit::DONE
}

fn mesh(path: &Path, file: &vi_io::MeshFile) -> MeshFacts {
    let bound = |start: f64, pick: fn(f64, f64) -> f64| {
        [0, 1, 2].map(|k| file.mesh.points.iter().map(|x| x[k]).fold(start, pick))
    };
    let extent = [bound(f64::INFINITY, f64::min), bound(f64::NEG_INFINITY, f64::max)];
    let count = |kind: &vi_mesh::CellKind| {
        let cells: usize = file.mesh.blocks.iter().filter(|b| b.kind == *kind).map(|b| b.cell_count()).sum();
        (cells > 0).then_some((kind.name(), cells))
    };
    let arrays = |arrays: &[vi_io::DataArray]| {
        arrays.iter().map(|array| (array.name.clone(), array.components)).collect()
    };
    let region = |region: &vi_mesh::Region| RegionFacts {
        name: region.name.clone(),
        dimension: region.dimension,
        cells: region.cells.len(),
    };
    MeshFacts {
        provenance: Provenance::new(&path.display().to_string(), 0),
        points: file.mesh.points.len(),
        cells: file.mesh.cell_count(),
        extent: (!file.mesh.points.is_empty()).then_some(extent),
        kinds: vi_mesh::CellKind::ALL.iter().filter_map(count).collect(),
        regions: file.mesh.regions.iter().map(region).collect(),
        point_data: arrays(&file.point_data),
        cell_data: arrays(&file.cell_data),
        notes: file.notes.clone(),
    }
}

fn say_mesh(path: &Path, facts: &MeshFacts) {
    out!("{}: {} points, {} cells", path.display(), facts.points, facts.cells);
    if let Some([min, max]) = facts.extent {
        out!("extent   {min:?} to {max:?}");
    }
    for (kind, count) in &facts.kinds {
        out!("cells    {count} {kind}");
    }
    for region in &facts.regions {
        let what = ["points", "curve", "surface", "volume"][region.dimension.min(3)];
        out!("region   '{}', {what}, {} cells", region.name, region.cells);
    }
    for (site, arrays) in [("points", &facts.point_data), ("cells ", &facts.cell_data)] {
        for (name, components) in arrays {
            out!("{site}   '{name}', {components} components");
        }
    }
    for note in &facts.notes {
        out!("note     {note}");
    }
}

fn scene(path: &Path) -> Result<SceneFacts, u8> {
    let (scene, parsed) = accept(path, &[])?;
    let is_open = scene.time.scheme == Some(SchemeName::Auto);
    let simulation = Simulation::new(stand_in(&scene)).map_err(|problems| {
        print_problems(problems, &parsed, path);
        exit::BAD_INPUT
    })?;
    let scene = simulation.scene();
    let components = simulation.components();
    let body = |body: &crate::model::BodyModel| {
        let nodes = body.node_offset..body.node_offset + body.mesh.points.len();
        let mass = components[body.component].system().mass();
        let material = |part: &crate::model::MaterialPart| MaterialFacts {
            law: part.law.name(),
            region: part.region.clone(),
            sheet: match &part.law {
                Substance::Sheet(law) => Some([law.parameters().common().thickness, law.area_density()]),
                Substance::Solid(_) => None,
            },
        };
        let region = |region: &vi_mesh::Region| RegionFacts {
            name: region.name.clone(),
            dimension: region.dimension,
            cells: region.cells.len(),
        };
        BodyFacts {
            name: body.name.clone(),
            nodes: body.mesh.points.len(),
            elements: body.element_count(),
            mass: nodes.map(|node| mass[3 * node]).sum(),
            system: body.component,
            materials: body.materials.iter().map(material).collect(),
            regions: body.mesh.regions.iter().map(region).collect(),
        }
    };
    let system = |component: &crate::simulation::Component| {
        let coordinates = component.system().coordinates();
        let terms = component.system().potentials().iter();
        SystemFacts {
            free: coordinates.free_count(),
            coordinates: coordinates.dof_count(),
            terms: terms.map(|term| (term.name().to_owned(), term.stencils().count())).collect(),
        }
    };
    let (limit, unknown) = match stability(&simulation) {
        Ok(limit) => (limit, None),
        Err(error) => (None, Some(format!("explicit step limit not known: {error}"))),
    };
    Ok(SceneFacts {
        provenance: Provenance::new(&name_of(path), simulation.free_coordinates()),
        title: scene.title.clone(),
        steps: (!is_open).then(|| simulation.step_count()),
        step: (!is_open).then(|| simulation.step_size()),
        scheme: if is_open { "auto" } else { simulation.method().name() },
        adaptive: scene.time.is_adaptive(),
        bodies: simulation.bodies().iter().map(body).collect(),
        systems: components.iter().map(system).collect(),
        contact: meetings(&simulation),
        step_limit: limit.as_ref().map(|limit| limit.step_limit),
        highest_frequency: limit.as_ref().map(|limit| limit.highest_frequency),
        damping_rate: limit.as_ref().map(|limit| limit.damping_rate),
        notes: simulation.notes().iter().cloned().chain(unknown).collect(),
    })
}

/// Lists all pairs of bodies of a scene with contact.
fn meetings(simulation: &Simulation) -> Vec<MeetingFacts> {
    if simulation.scene().contact.is_none() {
        return Vec::new();
    }
    let meeting = |(pair, skipped): ([usize; 2], Option<&'static str>)| {
        let law = simulation.contact_law(pair).filter(|_| skipped.is_none());
        MeetingFacts {
            between: pair.map(|number| simulation.name_of(number).to_owned()),
            skipped,
            distance: law.map(|law| law.distance),
            stiffness: law.map(|law| law.stiffness),
            friction: law.map(|law| law.friction),
            damping: law.map(|law| law.damping),
        }
    };
    simulation.contact_pairs().map(meeting).collect()
}

fn say_scene(path: &Path, facts: &SceneFacts) {
    out!("{}: {}", path.display(), facts.title);
    match (facts.steps, facts.step) {
        (Some(steps), Some(step)) => {
            let what = if facts.adaptive { "intervals of adaptive steps, each of" } else { "steps of" };
            out!("time     {steps} {what} {step:.6e} s by {}", facts.scheme);
        }
        _ => out!("time     scheme and step are chosen by trials when it runs"),
    }
    for body in &facts.bodies {
        out!(
            "body     '{}': {} nodes, {} elements, {:.6e} kg, component {}",
            body.name,
            body.nodes,
            body.elements,
            body.mass,
            body.system
        );
        for material in &body.materials {
            let place = material.region.as_deref().unwrap_or("the rest");
            let sheet = material.sheet.map_or(String::new(), |[thickness, density]| {
                format!(", a sheet of {thickness:e} m and {density:e} kg/m²")
            });
            out!("material {} in {place}{sheet}", material.law);
        }
        for region in &body.regions {
            out!("region   '{}', dimension {}", region.name, region.dimension);
        }
    }
    for (number, system) in facts.systems.iter().enumerate() {
        out!("system {number}: {} of {} coordinates are free", system.free, system.coordinates);
        for (name, stencils) in &system.terms {
            out!("term     '{name}': {stencils} stencils");
        }
    }
    for MeetingFacts { between: [a, b], skipped, distance, stiffness, friction, .. } in &facts.contact {
        let pair = if a == b { format!("'{a}' with itself") } else { format!("'{a}' with '{b}'") };
        match (skipped, distance, stiffness) {
            (Some(reason), ..) => out!("contact  {pair}: not searched, {reason}"),
            (None, Some(distance), Some(stiffness)) => out!(
                "contact  {pair}: layer {distance:.3e} m, {stiffness:.3e} Pa, friction {}",
                friction.unwrap_or_default()
            ),
            _ => out!("contact  {pair}: searched"),
        }
    }
    if let (Some(limit), Some(highest)) = (facts.step_limit, facts.highest_frequency) {
        let damping = match facts.damping_rate {
            Some(rate) if rate > 0.0 => format!(", damping up to {rate:.4e} 1/s"),
            _ => String::new(),
        };
        out!("explicit step limit {limit:.4e} s (highest frequency {highest:.4e} rad/s{damping})");
    }
    for note in &facts.notes {
        out!("note     {note}");
    }
}
