//! Adds the matter of a body to a component: the mass, strain energy and initial state of its nodes.

use std::collections::HashSet;
use std::sync::Arc;

use vi_core::Potential;
use vi_fem::{
    FemError, Law, LockingCure, Sheet, SheetLaw, add_lumped_mass, add_row_sums, consistent_mass,
    mass_properties, rigid_velocities,
};
use vi_mesh::{FarElements, Numbering, Window};

use super::body::MaterialPart;
use super::component::ComponentBuilder;
use super::initial::{add_field, constant};
use super::read::ReadBody;
use super::sheets;
use crate::scene::{RestShape, Substance};

/// Nodes at boundary edges of a sheet that are not free.
pub(super) struct Edges {
    /// An edge between two nodes of one of these sets is clamped: it keeps its normal.
    pub(super) clamps: Vec<HashSet<u32>>,
    /// An edge between two nodes of one of these sets lies in a mirror plane with this normal.
    pub(super) mirrors: Vec<([f64; 3], HashSet<u32>)>,
}

/// The mass of a body's nodes, kg.
struct NodalMass {
    lumped: Vec<f64>,
    /// Row sums of the consistent mass of solids.
    row_sums: Vec<f64>,
}

/// Adds a body whose mesh is in the numbering of the component. Its nodes follow those that the component already has.
/// `numbering` leads to it from the numbering of the body's own mesh.
///
/// # Errors
/// Returns the problem of the body.
pub(super) fn add_body(
    component: &mut ComponentBuilder,
    body: &ReadBody<'_>,
    edges: &Edges,
    numbering: &Arc<Numbering>,
) -> Result<(), String> {
    let node_count = body.read.mesh.points.len();
    let mut mass = NodalMass { lumped: vec![0.0; node_count], row_sums: vec![0.0; node_count] };
    if let (Some(far), [MaterialPart { law: Substance::Solid(law), .. }]) = (&body.far, &body.materials[..]) {
        let name = &body.scene.name;
        let term = vi_fem::elastic_elsewhere(Arc::clone(far), law, Arc::clone(numbering), name);
        component.potentials.push(Box::new(term.map_err(|error| error.to_string())?));
        let rest = &body.read.mesh.points;
        let made = add_far_mass((far.as_ref(), rest), numbering, law.density(), &mut mass.lumped);
        made.map_err(|error| error.to_string())?;
        far.fault().map_or(Ok(()), Err)?;
    }
    for part in body.materials.iter().filter(|part| !part.elements.is_empty()) {
        let name = &body.scene.name;
        let place = part.region.as_ref().map_or_else(|| name.clone(), |region| format!("{name}/{region}"));
        let terms = match &part.law {
            Substance::Solid(law) => solid(component, body, (part, law), &place, &mut mass),
            Substance::Sheet(law) => sheet(component, body, (part, law), &place, edges, &mut mass.lumped),
        };
        component.potentials.extend(terms.map_err(|error| error.to_string())?);
    }
    let NodalMass { lumped, row_sums } = mass;
    let gravity_mass = match component.sums_rows && body.scene.dimension() == 3 {
        true => row_sums,
        false => lumped.clone(),
    };
    let [x, v] = initial_state(body, &gravity_mass)?;
    component.rest.extend_from_slice(&body.read.mesh.points);
    component.gravity_mass.extend(gravity_mass);
    component.mass.extend(lumped);
    append(&mut component.x, x);
    append(&mut component.v, v);
    Ok(())
}

/// Appends numbers, without a copy to an empty list.
fn append(all: &mut Vec<f64>, more: Vec<f64>) {
    if all.is_empty() {
        *all = more;
    } else {
        all.extend(more);
    }
}

/// Adds the mass of elements that this process does not hold, in their order. `rest` are the positions of the nodes in the numbering of
/// the component.
fn add_far_mass(
    (far, rest): (&dyn FarElements, &[[f64; 3]]),
    numbering: &Numbering,
    density: f64,
    masses: &mut [f64],
) -> Result<(), FemError> {
    for range in far.ranges() {
        let all: Vec<u32> = (0..range.len() as u32).collect();
        let Window { mesh, nodes } = far.window(range, |node| rest[numbering.of(node) as usize]);
        let numbers = || nodes.iter().map(|&node| numbering.of(node) as usize);
        let mut of_window: Vec<f64> = numbers().map(|node| masses[node]).collect();
        add_lumped_mass(&mesh, &all, density, &mut of_window)?;
        numbers().zip(of_window).for_each(|(node, mass)| masses[node] = mass);
    }
    Ok(())
}

/// Returns the strain energy of a solid's elements of one law, and adds their mass.
fn solid(
    component: &mut ComponentBuilder,
    body: &ReadBody<'_>,
    (part, law): (&MaterialPart, &Law),
    place: &str,
    mass: &mut NodalMass,
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let (mesh, elements, density) = (&body.read.mesh, &part.elements, law.density());
    let node_offset = component.node_count();
    if component.is_consistent {
        let terms = consistent_mass(mesh, elements, density, node_offset, &body.scene.name)?;
        component.kinetic.extend(terms.into_iter().map(Arc::from));
    }
    if component.sums_rows {
        add_row_sums(mesh, elements, density, &mut mass.row_sums)?;
    }
    add_lumped_mass(mesh, elements, density, &mut mass.lumped)?;
    if let Some(part) = &body.part {
        let runs = (&part.elements[..], part.run_length);
        return vi_fem::elastic_in_runs(mesh, runs, law, node_offset, place);
    }
    let build = match (body.scene.locking, component.in_portions) {
        (LockingCure::None, false) => vi_fem::elastic,
        (LockingCure::None, true) => vi_fem::elastic_in_portions,
        (LockingCure::MeanDilation, false) => vi_fem::mean_dilation,
        (LockingCure::MeanDilation, true) => vi_fem::mean_dilation_in_portions,
    };
    build(mesh, elements, law, node_offset, place)
}

/// Returns the strain energy of a sheet's triangles of one law, and adds their mass.
fn sheet(
    component: &mut ComponentBuilder,
    body: &ReadBody<'_>,
    (part, law): (&MaterialPart, &SheetLaw),
    place: &str,
    edges: &Edges,
    mass: &mut [f64],
) -> Result<Vec<Box<dyn Potential>>, FemError> {
    let (read, elements) = (&body.read, &part.elements);
    let clamped = sheets::edges_between(&read.mesh, elements, &edges.clamps);
    let of_mirror = |(normal, nodes): &([f64; 3], HashSet<u32>)| {
        let edges = sheets::edges_between(&read.mesh, elements, std::slice::from_ref(nodes));
        edges.into_iter().map(|edge| (edge, *normal)).collect::<Vec<_>>()
    };
    let mirrored: Vec<_> = edges.mirrors.iter().flat_map(of_mirror).collect();
    let sheet = Sheet {
        flat: body.scene.rest == Some(RestShape::Flat),
        pattern: read.pattern.as_deref(),
        fields: &read.fields,
        clamped: &clamped,
        mirrored: &mirrored,
        ..Sheet::new(&read.mesh, elements, law, component.node_count(), place)
    };
    if component.is_consistent {
        component.kinetic.push(Arc::from(sheet.consistent_mass()?));
    }
    sheet.add_lumped_mass(mass)?;
    sheet.potentials()
}

/// Returns the initial positions (m) and velocities (m/s) of a body's nodes.
fn initial_state(body: &ReadBody<'_>, mass: &[f64]) -> Result<[Vec<f64>; 2], String> {
    let (read, scene) = (&body.read, body.scene);
    let rest = &read.mesh.points;
    let mut x = rest.as_flattened().to_vec();
    if let Some(displacement) = &read.displacement {
        x.iter_mut().zip(displacement).for_each(|(x, u)| *x += u);
    }
    if let Some(displacement) = &scene.displacement {
        add_field(displacement, rest, &mut x).map_err(|why| format!("displacement: {why}"))?;
    }
    let mut v = read.velocity.clone().unwrap_or_else(|| vec![0.0; x.len()]);
    let positions = x.as_chunks::<3>().0;
    let centre = mass_properties(positions, mass).centre;
    let linear = scene.velocity.as_ref().map_or(Some([0.0; 3]), constant);
    if let Some(velocity) = &scene.velocity
        && linear.is_none()
    {
        add_field(velocity, rest, &mut v).map_err(|why| format!("velocity: {why}"))?;
    }
    let angular = scene.angular_velocity.unwrap_or_default();
    let rigid = rigid_velocities(positions, centre, linear.unwrap_or_default(), angular);
    v.iter_mut().zip(rigid).for_each(|(v, rigid)| *v += rigid);
    Ok([x, v])
}
