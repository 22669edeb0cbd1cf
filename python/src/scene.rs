//! Scenes: the value of the library, with the arrays and callables that a text cannot hold.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::prelude::*;
use variational::auto::stand_in;
use variational::fem::Motion;
use variational::model::all_problems;
use variational::run::RunError;
use variational::scene::{self, Parsed, Problem};

use crate::callables::{CallableMotion, Raised};
use crate::errors;
use crate::mesh::Mesh;

/// Placeholder in the text of a scene for a mesh from arrays.
const ARRAYS: &str = "(arrays)";

/// A scene whose text has no problems.
#[pyclass(frozen, module = "variational_sim._core")]
pub(crate) struct Scene {
    scene: scene::Scene,
    /// Prescribed motions that are callables, each with the number of its fix.
    motions: Vec<(usize, Py<PyAny>)>,
    /// The scene file, and the keys that were set in it.
    pub(crate) source: Option<(PathBuf, Vec<String>)>,
    /// The text whose lines problems name, if the user has written one.
    parsed: Option<Parsed>,
}

#[pymethods]
impl Scene {
    /// Parses a scene. `meshes` replaces the mesh files of bodies by arrays, `motions` gives fixes a callable motion.
    /// `lines` says whether problems name the lines of the text.
    #[staticmethod]
    fn parse(
        py: Python<'_>,
        text: &str,
        overrides: Vec<String>,
        meshes: Vec<(usize, Py<Mesh>)>,
        motions: Vec<(usize, Py<PyAny>)>,
        lines: bool,
    ) -> PyResult<Self> {
        let mut parsed = scene::Scene::parse(text, &overrides);
        if let Some(scene) = &mut parsed.scene {
            for (body, mesh) in &meshes {
                if let Some(body) = scene.bodies.get_mut(*body) {
                    (body.mesh, body.arrays) = (None, Some(Arc::clone(&mesh.get().0)));
                }
            }
        }
        let scene = accept(py, &parsed, lines, None)?;
        let here = std::env::current_dir().unwrap_or_default();
        Ok(Self { scene: scene.relative_to(&here), motions, source: None, parsed: lines.then_some(parsed) })
    }

    /// Reads a scene file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf, overrides: Vec<String>) -> PyResult<Self> {
        let parsed =
            scene::Scene::read(&path, &overrides).map_err(|error| errors::file(py, &path, &error))?;
        let scene = accept(py, &parsed, true, Some(&path))?;
        Ok(Self { scene, motions: Vec::new(), source: Some((path, overrides)), parsed: Some(parsed) })
    }

    /// Returns the scene as TOML, with absolute paths. It does not hold the arrays and callables.
    fn to_toml(&self) -> PyResult<String> {
        let here = std::env::current_dir().unwrap_or_default();
        let mut scene = self.scene.clone().relative_to(&here);
        for body in scene.bodies.iter_mut().filter(|body| body.arrays.is_some()) {
            (body.mesh, body.arrays) = (Some(ARRAYS.into()), None);
        }
        scene.to_toml().map_err(errors::value)
    }

    /// Returns the scene as JSON.
    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string(&self.scene).map_err(errors::value)
    }

    /// Meshes from arrays, [(body, mesh)].
    #[getter]
    fn meshes(&self) -> Vec<(usize, Mesh)> {
        let bodies = self.scene.bodies.iter().enumerate();
        bodies.filter_map(|(i, body)| Some((i, Mesh(Arc::clone(body.arrays.as_ref()?))))).collect()
    }

    /// Motions that are callables, [(fix, callable)].
    #[getter]
    pub(crate) fn motions(&self, py: Python<'_>) -> Vec<(usize, Py<PyAny>)> {
        self.motions.iter().map(|(fix, motion)| (*fix, motion.clone_ref(py))).collect()
    }

    /// Reads the meshes and builds the systems without running them; raises SceneError with all problems.
    fn check(&self, py: Python<'_>) -> PyResult<()> {
        let scene = stand_in(&self.scene);
        let problems = py.detach(|| variational::simulation::Simulation::new(scene).err());
        problems.map_or(Ok(()), |problems| Err(self.refused(py, problems)))
    }
}

impl Scene {
    /// Returns the scene of the library. Its callables report exceptions to `raised`.
    pub(crate) fn reporting_to(&self, py: Python<'_>, raised: &Raised) -> PyResult<scene::Scene> {
        let mut scene = self.scene.clone();
        // A step that "auto" chooses is not known yet.
        let step =
            scene.time.step.and_then(variational::scene::TimeStep::fixed).unwrap_or(1e-3 * scene.time.end);
        for (number, motion) in &self.motions {
            let Some(fix) = scene.fixes.get_mut(*number) else {
                let problem = Problem::new("fix", format!("there is no fix number {number}"));
                return Err(errors::scene(py, vec![problem]));
            };
            let motion = CallableMotion::new(motion.clone_ref(py), step, raised.clone());
            fix.motion = Some(Motion::own("callable", motion));
        }
        Ok(scene)
    }

    /// Makes `SceneError` from problems that were found after the text was read, with their lines.
    pub(crate) fn refused(&self, py: Python<'_>, mut problems: Vec<Problem>) -> PyErr {
        if let Some(parsed) = &self.parsed {
            problems = problems.into_iter().map(|problem| parsed.locate(problem)).collect();
        }
        let file = self.source.as_ref().map(|(path, _)| path);
        problems.iter_mut().for_each(|problem| problem.file = file.cloned());
        errors::scene(py, problems)
    }

    /// Makes the exception for a run of this scene that ended early.
    pub(crate) fn failed(&self, py: Python<'_>, error: RunError) -> PyErr {
        match error {
            RunError::Scene(problems) => self.refused(py, problems),
            error => errors::run(py, error),
        }
    }

    /// Wraps a scene that a simulation holds, with the callables of this one.
    pub(crate) fn settled(&self, py: Python<'_>, mut scene: scene::Scene) -> Self {
        for (number, _) in &self.motions {
            if let Some(fix) = scene.fixes.get_mut(*number) {
                fix.motion = None;
            }
        }
        Self { scene, motions: self.motions(py), source: None, parsed: None }
    }
}

/// Returns the scene of a text without problems, or all problems, with their lines and the file.
fn accept(py: Python<'_>, parsed: &Parsed, lines: bool, file: Option<&Path>) -> PyResult<scene::Scene> {
    match parsed.scene.clone().filter(|_| parsed.problems.is_empty()) {
        Some(scene) => Ok(scene),
        None => {
            let mut problems = py.detach(|| all_problems(parsed));
            for problem in &mut problems {
                problem.line = problem.line.filter(|_| lines);
                problem.file = file.map(Path::to_owned);
            }
            Err(errors::scene(py, problems))
        }
    }
}

/// Returns the JSON schema of scenes as a text.
#[pyfunction]
pub(crate) fn schema() -> String {
    scene::Scene::schema().to_string()
}
