//! `variational info`: what a scene or a mesh holds.

use std::path::Path;

use super::exit;
use super::say::{message, out};
use crate::auto::stand_in;
use crate::scene::{SchemeName, Substance};
use crate::simulation::Simulation;
use crate::stability::stability;

pub(super) fn info(path: &Path) -> u8 {
    if path.extension().is_some_and(|extension| extension == "toml") { scene(path) } else { mesh(path) }
}

fn mesh(path: &Path) -> u8 {
    let file = match vi_io::read_mesh(path) {
        Ok(file) => file,
        Err(error) => {
            message!("error: {error}");
            return exit::BAD_INPUT;
        }
    };
    out!("{}: {} points, {} cells", path.display(), file.points.len(), file.cell_count());
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for x in &file.points {
        for k in 0..3 {
            min[k] = min[k].min(x[k]);
            max[k] = max[k].max(x[k]);
        }
    }
    if !file.points.is_empty() {
        out!("extent   {min:?} to {max:?}");
    }
    for kind in vi_io::CellKind::ALL {
        let count: usize = file.blocks.iter().filter(|b| b.kind == *kind).map(|b| b.cell_count()).sum();
        if count > 0 {
            out!("cells    {count} {}", kind.name());
        }
    }
    for group in &file.groups {
        let what = ["points", "curve", "surface", "volume"][group.dimension.min(3)];
        out!("region   '{}', {what}, {} cells", group.name, group.cells.len());
    }
    for array in &file.point_data {
        out!("points   '{}', {} components", array.name, array.components);
    }
    for array in &file.cell_data {
        out!("cells    '{}', {} components", array.name, array.components);
    }
    for note in &file.notes {
        out!("note     {note}");
    }
    exit::DONE
}

fn scene(path: &Path) -> u8 {
    let Ok((scene, parsed)) = super::run::accept(path, &[]) else { return exit::BAD_INPUT };
    let is_open = scene.time.scheme == Some(SchemeName::Auto);
    let simulation = match Simulation::new(stand_in(&scene)) {
        Ok(simulation) => simulation,
        Err(problems) => {
            super::run::print_problems(problems, &parsed, path);
            return exit::BAD_INPUT;
        }
    };
    let scene = simulation.scene();
    out!("{}: {}", path.display(), scene.title);
    if is_open {
        out!("time     {:.6e} s; scheme and step are chosen by trials when it runs", scene.time.end);
    } else {
        out!(
            "time     {} steps of {:.6e} s by {}",
            simulation.step_count(),
            simulation.step_size(),
            simulation.method().name()
        );
    }
    for (body, said) in simulation.bodies().iter().zip(&scene.bodies) {
        let component = &simulation.components()[body.component];
        let nodes = body.node_offset..body.node_offset + body.mesh.points.len();
        let mass: f64 = nodes.map(|node| component.system().mass()[3 * node]).sum();
        out!(
            "body     '{}': {} nodes, {} elements, {mass:.6e} kg, component {}",
            body.name,
            body.mesh.points.len(),
            body.element_count(),
            body.component
        );
        for entry in &said.material.0 {
            let place = entry.region.as_deref().unwrap_or("the rest");
            let mut sheet = String::new();
            if let Substance::Sheet(law) = &entry.law {
                let thickness = law.parameters().common().thickness;
                sheet = format!(", a sheet of {thickness:e} m and {:e} kg/m²", law.area_density());
            }
            out!("material {} in {place}{sheet}", entry.law.name());
        }
        for region in &body.mesh.regions {
            out!("region   '{}', dimension {}", region.name, region.dimension);
        }
    }
    for (i, component) in simulation.components().iter().enumerate() {
        let coordinates = component.system().coordinates();
        let free = coordinates.free_count();
        out!("system {i}: {free} of {} coordinates are free", coordinates.dof_count());
        for term in component.system().potentials() {
            out!("term     '{}': {} stencils", term.name(), term.stencils().count());
        }
    }
    if let Some(note) = stability(&simulation) {
        out!(
            "explicit step limit {:.4e} s (highest frequency {:.4e} rad/s)",
            note.step_limit,
            note.highest_frequency
        );
    }
    for note in simulation.notes() {
        out!("note     {note}");
    }
    exit::DONE
}
