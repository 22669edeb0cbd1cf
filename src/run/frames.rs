//! Writes frames for viewing: all bodies at rest with their displacements, as a VTU series. Only fields that the scene
//! names are computed.

mod names;
mod observe;
mod rounding;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use vi_fem::{ElementField, nodal_field};
use vi_io::{IoError, PvdSeries, VtuArray, VtuFrame, VtuOptions, VtuValues};
use vi_mesh::{CellBlock, CellKind, FarBlock};

use super::checkpoint::CheckpointError;
use super::error::RunError;
use crate::run::surfaces::SurfaceWriter;
use crate::scene::{Cache, Encoding, Field, Precision, Schedule};
use crate::simulation::Simulation;
pub(crate) use names::frame_number;
use names::{files_from, frame_file};
use rounding::{ROUNDING, largest, smallest_edge};

/// Writes `<name>.pvd` and `<name>_000000.vtu` …
pub(crate) struct FrameWriter {
    directory: PathBuf,
    name: String,
    series: PvdSeries,
    series_file: PathBuf,
    /// Number of frames known to be on disk.
    synced: usize,
    schedule: Schedule,
    options: VtuOptions,
    /// Largest number of points of a file.
    piece_points: usize,
    /// Smallest distance between two nodes of a cell, m.
    smallest_edge: f64,
    cache: Option<SurfaceWriter>,
    fields: Vec<Field>,
    /// Rest positions of all bodies, then points of the surfaces of rigid bodies at the start, m.
    points: Vec<[f64; 3]>,
    /// The points of the surface of each rigid body in its own axes, m, and the total number of their cells.
    surfaces: Vec<Vec<[f64; 3]>>,
    surface_cells: usize,
    blocks: Vec<CellBlock>,
    /// The cells of bodies whose elements this process does not hold. There are no others then.
    far: Vec<FarBlock>,
    cell_count: usize,
    /// The number of the body and of the material of the cells, each with the number of cells in succession that have it.
    body_ids: Vec<(i32, usize)>,
    material_ids: Vec<(i32, usize)>,
}

impl FrameWriter {
    /// Starts a series in a directory.
    ///
    /// # Errors
    /// Returns an error if a mesh cannot be written.
    pub(crate) fn create(
        directory: &Path,
        name: &str,
        simulation: &Simulation,
        schedule: Schedule,
    ) -> Result<Self, IoError> {
        let output = &simulation.scene().output;
        let options = VtuOptions {
            encoding: match output.encoding {
                Encoding::Raw => vi_io::VtuEncoding::AppendedRaw,
                Encoding::Base64 => vi_io::VtuEncoding::InlineBase64,
            },
            precision: match output.precision {
                Precision::F32 => vi_io::Precision::Single,
                Precision::F64 => vi_io::Precision::Double,
            },
            ..VtuOptions::default()
        };
        let series_file = directory.join(format!("{name}.pvd"));
        let mut writer = Self {
            directory: directory.to_owned(),
            name: name.to_owned(),
            series: PvdSeries::new(&series_file),
            series_file,
            synced: 0,
            schedule,
            options,
            piece_points: usize::try_from(output.piece_points).unwrap_or(usize::MAX),
            smallest_edge: f64::INFINITY,
            cache: output.cache.map(|cache| SurfaceWriter::new(directory, name, simulation, cache)),
            fields: output.fields.clone(),
            points: Vec::new(),
            surfaces: Vec::new(),
            surface_cells: 0,
            blocks: Vec::new(),
            far: Vec::new(),
            cell_count: 0,
            body_ids: Vec::new(),
            material_ids: Vec::new(),
        };
        for (id, body) in simulation.bodies().iter().enumerate() {
            writer.add(id as i32, body);
        }
        for id in 0..simulation.rigids().len() {
            writer.add_surface(id, simulation);
        }
        if writer.points.len() > u32::MAX as usize {
            let what =
                format!("{} points of all bodies are more than 32 bits can number", writer.points.len());
            return Err(IoError::BadOutput { file: writer.series_file, what });
        }
        writer.smallest_edge = smallest_edge(&writer.points, &writer.blocks, &writer.far);
        if writer.loses(largest(&writer.points)) {
            writer.options.precision = vi_io::Precision::Double;
        }
        Ok(writer)
    }

    /// Returns whether 32 bits would round lengths up to `length` (m) by more than a thousandth of the smallest edge.
    fn loses(&self, length: f64) -> bool {
        length * ROUNDING > 1e-3 * self.smallest_edge
    }

    /// Returns notes on how the frames are written.
    pub(crate) fn notes(&self, simulation: &Simulation) -> Vec<String> {
        let length = largest(&self.points);
        if !self.loses(length) {
            return Vec::new();
        }
        let (rounding, edge) = (length * ROUNDING, self.smallest_edge);
        let mut notes = Vec::new();
        let output = &simulation.scene().output;
        if output.precision == Precision::F32 {
            notes.push(format!(
                "frames are written in 64 bits: at {length:.3e} m from the origin, 32 bits would round positions by \
                 {rounding:.1e} m, and the smallest edge is {edge:.1e} m"
            ));
        }
        if output.cache.is_some_and(Cache::is_point_cache) {
            notes.push(format!(
                "point caches have 32 bits, which round positions by {rounding:.1e} m here, with a smallest edge of \
                 {edge:.1e} m: bring the bodies nearer to the origin with `translate`, or write `cache = \"ply\"`"
            ));
        }
        notes
    }

    /// Adds the surface of a rigid body. Rigid bodies are numbered after the others and have no material (−1).
    fn add_surface(&mut self, id: usize, simulation: &Simulation) {
        let form = simulation.rigids()[id].form.as_ref();
        let (points, triangles) =
            form.map(|form| (form.points.clone(), form.triangles.clone())).unwrap_or_default();
        let offset = self.points.len() as u32;
        self.points.extend(simulation.carried(id, &points));
        self.surfaces.push(points);
        self.surface_cells += triangles.len();
        let body = (simulation.bodies().len() + id) as i32;
        self.add_ids(body, -1, triangles.len());
        let nodes = triangles.into_iter().flatten().map(|node| node + offset);
        match self.blocks.last_mut() {
            Some(block) if block.kind == CellKind::Tri3 => block.nodes.extend(nodes),
            _ => self.blocks.push(CellBlock { kind: CellKind::Tri3, nodes: nodes.collect() }),
        }
        self.blocks.retain(|block| !block.nodes.is_empty());
    }

    fn add(&mut self, id: i32, body: &crate::model::BodyModel) {
        let offset = self.points.len() as u32;
        self.points.extend_from_slice(&body.mesh.points);
        if let Some(far) = &body.far {
            self.far.push(FarBlock { elements: Arc::clone(far), first_node: offset });
            self.add_ids(id, 0, far.count());
        }
        for (material, part) in body.materials.iter().enumerate() {
            self.add_ids(id, material as i32, part.elements.len());
            for &element in &part.elements {
                let Some((kind, nodes)) = body.mesh.cell(element as usize) else { continue };
                let nodes = nodes.iter().map(|node| node + offset);
                match self.blocks.last_mut() {
                    Some(block) if block.kind == kind => block.nodes.extend(nodes),
                    _ => self.blocks.push(CellBlock { kind, nodes: nodes.collect() }),
                }
            }
        }
    }

    /// Enters the numbers of the body and of the material of the next cells.
    fn add_ids(&mut self, body: i32, material: i32, count: usize) {
        self.cell_count += count;
        self.body_ids.push((body, count));
        self.material_ids.push((material, count));
    }

    /// Returns the number of frames written.
    pub(crate) fn count(&self) -> usize {
        self.series.frames().len()
    }

    /// Returns the time and file of every frame.
    pub(crate) fn frames(&self) -> &[(f64, String)] {
        self.series.frames()
    }

    /// Continues after these frames of a checkpoint; files of later ones are removed.
    fn resume(&mut self, frames: &[(f64, String)]) -> Result<(), RunError> {
        let obstacle = self.cache.as_ref().and_then(|cache| cache.obstacle(frames.len()));
        if let Some((file, how)) = obstacle {
            return Err(CheckpointError::Changed { what: file.display().to_string(), how }.into());
        }
        // These frames were on disk before the checkpoint was written; files may have been moved since.
        self.synced = frames.len();
        Ok(self.keep(frames)?)
    }

    fn keep(&mut self, frames: &[(f64, String)]) -> Result<(), IoError> {
        self.series.set_frames(frames.to_vec())?;
        self.synced = self.synced.min(frames.len());
        if let Some(cache) = &mut self.cache {
            cache.resume(frames.len())?;
        }
        let refused = |file: &Path, action| {
            let file = file.to_owned();
            move |source| IoError::System { file, action, source }
        };
        for file in files_from(&self.directory, &self.name, frames.len())? {
            std::fs::remove_file(&file).map_err(refused(&file, "remove"))?;
        }
        Ok(())
    }

    fn is_in_pieces(&self) -> bool {
        self.points.len() > self.piece_points
    }

    /// Waits until every frame written so far, and the series that lists them, is on disk.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub(crate) fn sync(&mut self) -> Result<(), IoError> {
        if let Some(cache) = &self.cache {
            cache.sync(self.synced)?;
        }
        let new = match self.is_in_pieces() {
            true => files_from(&self.directory, &self.name, self.synced)?,
            false => {
                let new = self.series.frames()[self.synced..].iter();
                new.map(|(_, name)| self.directory.join(name)).collect()
            }
        };
        for file in new.into_iter().chain((self.count() > 0).then(|| self.series_file.clone())) {
            let synced = std::fs::File::options().write(true).open(&file).and_then(|file| file.sync_all());
            synced.map_err(|source| IoError::System { file, action: "write", source })?;
        }
        self.synced = self.count();
        Ok(())
    }

    /// Writes the files that need all frames, at the end of the run.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub(crate) fn finish(&self) -> Result<(), IoError> {
        match (&self.cache, self.schedule) {
            (Some(cache), Schedule::Rate(rate)) => cache.finish(rate),
            _ => Ok(()),
        }
    }

    /// Removes all frames after the first `count`.
    fn truncate(&mut self, count: usize) -> Result<(), IoError> {
        let kept = self.frames()[..count.min(self.count())].to_vec();
        if kept.len() < self.count() { self.keep(&kept) } else { Ok(()) }
    }

    /// Returns whether a frame is due at the end of step `steps`, of h (s) each.
    pub(crate) fn is_due(&self, steps: u64, h: f64) -> bool {
        self.schedule.is_due(self.count(), steps, h)
    }

    /// Returns whether a frame is due before the end of that step.
    pub(crate) fn is_within(&self, steps: u64, h: f64) -> bool {
        self.schedule.is_within(self.count(), steps, h)
    }

    /// Returns whether the end of the run always has a frame.
    pub(crate) fn ends_with_frame(&self) -> bool {
        matches!(self.schedule, Schedule::Interval(_))
    }

    /// Returns the time of the next frame, s.
    pub(crate) fn next_time(&self) -> f64 {
        self.schedule.time(self.count())
    }

    /// Writes the frame that is due for the current state of the simulation, and the surfaces.
    ///
    /// # Errors
    /// Returns an error if a value is not finite or a file cannot be written.
    pub(crate) fn write(&mut self, simulation: &Simulation) -> Result<(), IoError> {
        if let Some(cache) = &mut self.cache {
            cache.write(simulation)?;
        }
        let time = match self.schedule {
            Schedule::Interval(_) => simulation.time(),
            Schedule::Rate(_) => self.next_time(),
        };
        self.write_at(simulation, time)
    }

    /// Writes a frame of the state at which a run ends early, at any time. Surfaces are written at even times only.
    ///
    /// # Errors
    /// Returns the errors of [`FrameWriter::write`].
    pub(crate) fn write_last(&mut self, simulation: &Simulation) -> Result<(), IoError> {
        self.write_at(simulation, simulation.time())
    }

    fn write_at(&mut self, simulation: &Simulation, time: f64) -> Result<(), IoError> {
        let bodies = 0..simulation.bodies().len();
        let mut points: Vec<(&str, Vec<f64>)> = Vec::new();
        let mut cells: Vec<(&str, &[(i32, usize)])> = Vec::new();
        let mut real_cells: Vec<(ElementField, Vec<f64>)> = Vec::new();
        let mut nodal: Vec<(String, usize, Vec<f64>)> = Vec::new();
        for &field in &self.fields {
            if let Some((of_elements, is_nodal)) = field.of_elements() {
                match is_nodal {
                    true => nodal.push(self.nodal_values(simulation, of_elements)),
                    false => real_cells.push(self.element_values(simulation, of_elements)),
                }
                continue;
            }
            // Rigid bodies have no nodes; the values on their surfaces are zero.
            let vectors = |values: &dyn Fn(usize) -> Vec<[f64; 3]>| -> Vec<f64> {
                let mut all: Vec<f64> = bodies.clone().flat_map(values).flatten().collect();
                all.resize(3 * self.points.len(), 0.0);
                all
            };
            if field.is_of_contact() {
                nodal.push((
                    field.name().to_owned(),
                    field.component_count(),
                    simulation.contact_values(field),
                ));
                continue;
            }
            match field {
                Field::Displacement => {
                    let surfaces = self.surfaces.iter().enumerate();
                    let carried = surfaces.flat_map(|(id, points)| simulation.carried(id, points));
                    let x = bodies.clone().flat_map(|body| simulation.positions(body)).chain(carried);
                    let u = x.zip(&self.points).flat_map(|(x, rest)| [0, 1, 2].map(|k| x[k] - rest[k]));
                    points.push(("displacement", u.collect()));
                }
                Field::Velocity => {
                    let surfaces = self.surfaces.iter().enumerate();
                    let carried = surfaces.flat_map(|(id, points)| simulation.carried_velocities(id, points));
                    let v = bodies.clone().flat_map(|body| simulation.velocities(body)).chain(carried);
                    points.push(("velocity", v.flatten().collect()));
                }
                Field::Acceleration => {
                    points.push(("acceleration", vectors(&|body| simulation.accelerations(body))));
                }
                Field::ExternalForce => {
                    points.push(("external_force", vectors(&|body| simulation.external_forces(body))));
                }
                Field::ReactionForce => {
                    points.push(("reaction_force", vectors(&|body| simulation.reactions(body))));
                }
                Field::BodyId => cells.push(("body_id", &self.body_ids)),
                Field::MaterialId => cells.push(("material_id", &self.material_ids)),
                _ => {}
            }
        }
        let point_data: Vec<VtuArray> = points
            .iter()
            .map(|(name, values)| VtuArray { name, components: 3, values: VtuValues::Real(values) })
            .chain(nodal.iter().map(|(name, components, values)| VtuArray {
                name,
                components: *components,
                values: VtuValues::Real(values),
            }))
            .collect();
        let integers = cells.iter().map(|(name, values)| VtuArray {
            name,
            components: 1,
            values: VtuValues::Repeated { runs: values, skip: 0, count: self.cell_count },
        });
        let reals = real_cells.iter().map(|(field, values)| VtuArray {
            name: field.name(),
            components: field.component_count(),
            values: VtuValues::Real(values),
        });
        let cell_data: Vec<VtuArray> = integers.chain(reals).collect();
        let frame = VtuFrame {
            points: &self.points,
            blocks: &self.blocks,
            far: &self.far,
            regions: &[],
            point_data: &point_data,
            cell_data: &cell_data,
            time: Some(time),
            field_data: &[],
        };
        let file = frame_file(&self.name, self.count(), self.is_in_pieces());
        let mut options = self.options;
        // The displacement of a body that flies far may need 64 bits, too.
        let u = points.iter().filter(|(name, _)| *name == "displacement").flat_map(|(_, values)| values);
        let longest = u.fold(0.0, |longest: f64, value| longest.max(value.abs()));
        if self.loses(longest) && longest <= f64::from(f32::MAX) {
            options.precision = vi_io::Precision::Double;
        }
        let path = self.directory.join(&file);
        match self.is_in_pieces() {
            true => vi_io::write_pvtu(&path, &frame, options, self.piece_points)?,
            false => vi_io::write_vtu(&path, &frame, options)?,
        }
        self.series.push(time, &file)
    }

    /// Returns a field of all elements, in the order of the cells.
    fn element_values(&self, simulation: &Simulation, field: ElementField) -> (ElementField, Vec<f64>) {
        let mut values = Vec::with_capacity(self.cell_count * field.component_count());
        // The check of the scene refuses these fields in a scene with sheets.
        for body in 0..simulation.bodies().len() {
            values.extend(simulation.element_values(body, field));
        }
        // The cells of rigid bodies get zeros.
        values.resize(values.len() + self.surface_cells * field.component_count(), 0.0);
        (field, values)
    }

    /// Returns a field smoothed to the nodes of all bodies: its name, components and values.
    fn nodal_values(&self, simulation: &Simulation, field: ElementField) -> (String, usize, Vec<f64>) {
        let mut values = Vec::with_capacity(self.points.len() * field.component_count());
        for (number, body) in simulation.bodies().iter().enumerate() {
            let x = simulation.positions(number);
            let parts: Vec<_> = body.solids().collect();
            // The cells were accepted as solid elements of this mesh when the body was built.
            if let Ok(part) = nodal_field(&body.mesh, &parts, body.locking, x.as_flattened(), field) {
                values.extend(part);
            }
        }
        // The points of rigid bodies get zeros.
        values.resize(self.points.len() * field.component_count(), 0.0);
        (format!("nodal_{}", field.name()), field.component_count(), values)
    }

    /// Writes a single file outside the series, with a displacement (m, 3 per point of all bodies), a time and further
    /// named numbers.
    ///
    /// # Errors
    /// Returns an error if a value is not finite or the file cannot be written.
    pub(crate) fn write_shape(
        &self,
        file: &str,
        displacement: &[f64],
        time: f64,
        field_data: &[(&str, &[f64])],
    ) -> Result<(), IoError> {
        let mut displacement = displacement.to_vec();
        displacement.resize(3 * self.points.len(), 0.0);
        let values = VtuValues::Real(&displacement);
        let frame = VtuFrame {
            points: &self.points,
            blocks: &self.blocks,
            far: &self.far,
            regions: &[],
            point_data: &[VtuArray { name: "displacement", components: 3, values }],
            cell_data: &[],
            time: Some(time),
            field_data,
        };
        vi_io::write_vtu(&self.directory.join(file), &frame, self.options)
    }
}
