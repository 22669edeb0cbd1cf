//! Writes the surfaces of bodies for animation programs: per body a point cache (PC2, and MDD at the end of the run) with
//! one OBJ file, or a sequence of OBJ or PLY files.

use std::path::{Path, PathBuf};

use vi_io::{IoError, Pc2File, TriangleSurface, write_mdd, write_obj, write_ply};
use vi_mesh::Surface;

use crate::scene::{Cache, Scene};
use crate::simulation::Simulation;

/// Writes the surface of every body at regular times.
pub(crate) struct SurfaceWriter {
    directory: PathBuf,
    cache: Cache,
    parts: Vec<Part>,
    /// Number of samples written.
    samples: usize,
}

/// The surface of one body.
struct Part {
    name: String,
    /// Name of its files without extension.
    stem: String,
    source: Source,
    triangles: Vec<[u32; 3]>,
    texture: Option<Vec<[[f64; 2]; 3]>>,
    file: Option<Pc2File>,
}

/// The source of its points.
enum Source {
    /// These nodes of a body.
    Nodes(usize, Vec<u32>),
    /// Points in the local axes of a rigid body, m.
    Carried(usize, Vec<[f64; 3]>),
}

/// Largest number of bytes of a body's name in the names of its files: file systems allow names of 255 bytes.
const LONGEST: usize = 100;

/// Returns the file names without extension of all bodies, deformable ones first: `<run>.<body>`. Characters that file
/// names cannot hold are replaced, and equal names are numbered.
fn stems(name: &str, scene: &Scene) -> Vec<String> {
    let bodies =
        scene.bodies.iter().map(|body| &body.name).chain(scene.rigids.iter().map(|rigid| &rigid.name));
    let mut stems: Vec<String> = Vec::new();
    for body in bodies {
        let plain = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' };
        let letters = body.char_indices().take_while(|(at, c)| at + c.len_utf8() <= LONGEST);
        let stem = format!("{name}.{}", letters.map(|(_, c)| plain(c)).collect::<String>());
        let mut unique = stem.clone();
        let mut number = 2;
        while stems.contains(&unique) {
            unique = format!("{stem}-{number}");
            number += 1;
        }
        stems.push(unique);
    }
    stems
}

/// Returns the name of file number `number` of a sequence.
fn numbered(stem: &str, number: usize, ending: &str) -> String {
    format!("{stem}.{number:06}{ending}")
}

/// Returns the number of a file of a sequence, if `file` is the name of one.
fn number_of(stem: &str, file: &str, ending: &str) -> Option<usize> {
    let digits = file.strip_prefix(stem)?.strip_prefix('.')?.strip_suffix(ending)?;
    let is_number = digits.len() >= 6 && digits.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| digits.parse().ok()).flatten()
}

/// The surface files of a scene in a directory.
pub(crate) struct SurfaceFiles {
    /// The stem of the files of each body, and whether it has a point cache.
    stems: Vec<(String, bool)>,
}

impl SurfaceFiles {
    pub(crate) fn new(directory: &Path, name: &str, scene: &Scene) -> Self {
        let with_cache = |stem: String| {
            let has_cache = directory.join(format!("{stem}.pc2")).is_file();
            (stem, has_cache)
        };
        Self { stems: stems(name, scene).into_iter().map(with_cache).collect() }
    }

    /// Returns whether a run of the scene wrote the file with this name. An OBJ file without a number and
    /// an MDD file belong to a point cache; otherwise they are not ours.
    pub(crate) fn contain(&self, file: &str) -> bool {
        self.stems.iter().any(|(stem, has_cache)| match file.strip_prefix(stem.as_str()) {
            Some(".pc2") => true,
            Some(".obj" | ".mdd") => *has_cache,
            Some(_) => [".obj", ".ply"].iter().any(|ending| number_of(stem, file, ending).is_some()),
            None => false,
        })
    }
}

impl SurfaceWriter {
    /// Collects the surfaces of a simulation, without writing them.
    pub(crate) fn new(directory: &Path, name: &str, simulation: &Simulation, cache: Cache) -> Self {
        let scene = simulation.scene();
        let mut stems = stems(name, scene).into_iter();
        let mut parts = Vec::new();
        for ((number, body), stem) in simulation.bodies().iter().enumerate().zip(&mut stems) {
            let dimension = scene.bodies[number].dimension();
            // The elements were accepted as those of a body when it was built, so they have faces.
            let Ok(surface) = Surface::of_body(&body.mesh, dimension) else { continue };
            let mut triangles = surface.triangles();
            let mut nodes: Vec<u32> = triangles.as_flattened().to_vec();
            nodes.sort_unstable();
            nodes.dedup();
            let place = |node: u32| nodes.partition_point(|&other| other < node) as u32;
            triangles.iter_mut().for_each(|triangle| *triangle = triangle.map(place));
            let texture = body.texture.as_ref().filter(|_| dimension == 2);
            let cells = body.mesh.cells_of_dimension(2);
            let texture = texture.map(|corners| cells.iter().map(|&cell| corners[cell as usize]).collect());
            let source = Source::Nodes(number, nodes);
            parts.push(Part { name: body.name.clone(), stem, source, triangles, texture, file: None });
        }
        for ((number, rigid), stem) in simulation.rigids().iter().enumerate().zip(stems) {
            let Some(form) = &rigid.form else { continue };
            let (points, triangles) = (form.points.clone(), form.triangles.clone());
            let source = Source::Carried(number, points);
            parts.push(Part { name: rigid.name.clone(), stem, source, triangles, texture: None, file: None });
        }
        Self { directory: directory.to_owned(), cache, parts, samples: 0 }
    }

    /// Writes the current surfaces.
    ///
    /// # Errors
    /// Returns an error if a coordinate is not finite or a file cannot be written.
    pub(crate) fn write(&mut self, simulation: &Simulation) -> Result<(), IoError> {
        let place = |file: String| self.directory.join(file);
        for part in &mut self.parts {
            let points = part.points(simulation);
            match self.cache {
                Cache::Pc2 | Cache::Mdd => {
                    if part.file.is_none() {
                        write_obj(&place(format!("{}.obj", part.stem)), &part.surface(&points))?;
                        part.file =
                            Some(Pc2File::create(&place(format!("{}.pc2", part.stem)), points.len())?);
                    }
                    if let Some(file) = &mut part.file {
                        file.append(&points)?;
                    }
                }
                Cache::Obj => {
                    write_obj(&place(numbered(&part.stem, self.samples, ".obj")), &part.surface(&points))?
                }
                Cache::Ply => {
                    write_ply(&place(numbered(&part.stem, self.samples, ".ply")), &part.surface(&points))?
                }
            }
        }
        self.samples += 1;
        Ok(())
    }

    /// Returns the file that prevents continuing after the first `samples` of an earlier run, with the problem. A
    /// checkpoint cannot restore the samples of a point cache.
    pub(crate) fn obstacle(&self, samples: usize) -> Option<(PathBuf, String)> {
        if !self.cache.is_point_cache() || samples == 0 {
            return None;
        }
        self.parts.iter().find_map(|part| {
            let [shape, cache] =
                [".obj", ".pc2"].map(|end| self.directory.join(format!("{}{end}", part.stem)));
            if let Some(gone) = [&shape, &cache].into_iter().find(|file| !file.is_file()) {
                return Some((gone.clone(), "it is gone".to_owned()));
            }
            let error = Pc2File::resume(&cache, part.source.count(), samples).err()?;
            Some((cache, error.to_string()))
        })
    }

    /// Continues after the first `samples` of an earlier run, and removes the later ones.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written or removed.
    pub(crate) fn resume(&mut self, samples: usize) -> Result<(), IoError> {
        self.samples = samples;
        for part in &mut self.parts {
            if !self.cache.is_point_cache() {
                continue;
            }
            match &mut part.file {
                Some(file) => file.truncate(samples)?,
                None if samples > 0 => {
                    let path = self.directory.join(format!("{}.pc2", part.stem));
                    part.file = Some(Pc2File::resume(&path, part.source.count(), samples)?);
                }
                None => {}
            }
        }
        let ending = match self.cache {
            Cache::Pc2 | Cache::Mdd => return Ok(()),
            Cache::Obj => ".obj",
            Cache::Ply => ".ply",
        };
        let refused = |file: &Path, action| {
            let file = file.to_owned();
            move |source| IoError::System { file, action, source }
        };
        for entry in std::fs::read_dir(&self.directory).map_err(refused(&self.directory, "list"))? {
            let entry = entry.map_err(refused(&self.directory, "list"))?;
            let name = entry.file_name();
            let number = |part: &Part| number_of(&part.stem, name.to_str()?, ending);
            if self.parts.iter().filter_map(number).any(|number| number >= samples) {
                let file = entry.path();
                std::fs::remove_file(&file).map_err(refused(&file, "remove"))?;
            }
        }
        Ok(())
    }

    /// Writes the MDD files, if they are wanted, of `rate` samples per second.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub(crate) fn finish(&self, rate: f64) -> Result<(), IoError> {
        if self.cache == Cache::Mdd {
            for part in &self.parts {
                if let Some(file) = &part.file {
                    write_mdd(&self.directory.join(format!("{}.mdd", part.stem)), file, rate)?;
                }
            }
        }
        Ok(())
    }

    /// Waits until the samples from number `from` on are on disk.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub(crate) fn sync(&self, from: usize) -> Result<(), IoError> {
        let sync = |file: String| {
            let file = self.directory.join(file);
            let synced = std::fs::File::options().write(true).open(&file).and_then(|file| file.sync_all());
            synced.map_err(|source| IoError::System { file, action: "write", source })
        };
        for part in &self.parts {
            match self.cache {
                Cache::Pc2 | Cache::Mdd => {
                    if let Some(file) = &part.file {
                        file.sync()?;
                        sync(format!("{}.obj", part.stem))?;
                    }
                }
                Cache::Obj => (from..self.samples).try_for_each(|n| sync(numbered(&part.stem, n, ".obj")))?,
                Cache::Ply => (from..self.samples).try_for_each(|n| sync(numbered(&part.stem, n, ".ply")))?,
            }
        }
        Ok(())
    }
}

impl Source {
    fn count(&self) -> usize {
        match self {
            Self::Nodes(_, nodes) => nodes.len(),
            Self::Carried(_, points) => points.len(),
        }
    }
}

impl Part {
    fn points(&self, simulation: &Simulation) -> Vec<[f64; 3]> {
        match &self.source {
            Source::Nodes(body, nodes) => {
                let x = simulation.positions(*body);
                nodes.iter().map(|&node| x[node as usize]).collect()
            }
            Source::Carried(rigid, points) => simulation.carried(*rigid, points),
        }
    }

    fn surface<'a>(&'a self, points: &'a [[f64; 3]]) -> TriangleSurface<'a> {
        TriangleSurface {
            name: &self.name,
            points,
            triangles: &self.triangles,
            texture: self.texture.as_deref(),
        }
    }
}
