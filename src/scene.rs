//! A scene: everything that a run needs, as one serde value that the builder and TOML share.
//! It must not know how a scene is run, nor read a mesh.

mod attach;
mod body;
mod check;
mod columns;
mod load;
mod material;
mod output;
#[cfg(feature = "cli")]
mod parse;
mod plain;
mod rigid;
mod safety;
#[cfg(feature = "cli")]
mod set;
mod statics;
#[cfg(feature = "cli")]
mod structure;
mod time;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_fem::Wind;

pub use attach::{Attach, Seam};
pub(crate) use body::MOST_REFINED;
pub use body::{Axis, Body, BoxRegion, Fix, Probe, RestShape, Spring, SpringEnd, Strike};
pub use check::Problem;
pub(crate) use columns::history_columns;
pub(crate) use load::field;
pub use load::{Damping, FieldComponent, Load};
pub use material::{MaterialEntry, Materials, Substance};
pub(crate) use output::Schedule;
pub use output::{Assert, Cache, Encoding, Field, Output, Precision};
#[cfg(feature = "cli")]
pub use parse::Parsed;
pub use rigid::{Inertia, Joint, Rigid, RigidShape, Turn};
pub use safety::{Checkpoints, Guard, GuardAction};
pub use statics::{Control, Static};
pub use time::{LinearChoice, MassKind, SchemeName, Solver, Time};

/// A scene. Its TOML form has the same names; unknown keys are errors.
///
/// ```
/// use variational::prelude::*;
/// let scene = Scene::new(Time::new(1.0, 0.01, SchemeName::StormerVerlet))
///     .gravity([0.0, -9.81, 0.0])
///     .body(Body::from_box(
///         "block",
///         BoxMesh { size: [1.0, 0.2, 0.2], cells: [5, 1, 1], element: ElementKind::Tet4, origin: [0.0; 3] },
///         Law::NeoHookean(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 }),
///     ))
///     .fix(Fix::region("block", "x-min"));
/// assert!(scene.problems().is_empty());
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// What the scene is, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub title: String,
    /// Acceleration of gravity, m/s².
    #[serde(default)]
    pub gravity: [f64; 3],
    /// How time is stepped.
    pub time: Time,
    /// Deformable bodies.
    #[serde(rename = "body", default, skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<Body>,
    /// Rigid bodies, free, held or moved.
    #[serde(rename = "rigid", default, skip_serializing_if = "Vec::is_empty")]
    pub rigids: Vec<Rigid>,
    /// Joints of rigid bodies.
    #[serde(rename = "joint", default, skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<Joint>,
    /// Prescribed coordinates: fixed, or moving on a given path.
    #[serde(rename = "fix", default, skip_serializing_if = "Vec::is_empty")]
    pub fixes: Vec<Fix>,
    /// Springs between points, or between a point and a place in space.
    #[serde(rename = "spring", default, skip_serializing_if = "Vec::is_empty")]
    pub springs: Vec<Spring>,
    /// Nodes held by springs on another body's surface, or on places in space.
    #[serde(rename = "attach", default, skip_serializing_if = "Vec::is_empty")]
    pub attachments: Vec<Attach>,
    /// Edges of sheets sewn together.
    #[serde(rename = "seam", default, skip_serializing_if = "Vec::is_empty")]
    pub seams: Vec<Seam>,
    /// Impulses given to a region at t = 0.
    #[serde(rename = "strike", default, skip_serializing_if = "Vec::is_empty")]
    pub strikes: Vec<Strike>,
    /// Forces on bodies.
    #[serde(rename = "load", default, skip_serializing_if = "Vec::is_empty")]
    pub loads: Vec<Load>,
    /// Air around all sheets: drag and wind; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wind: Option<Wind>,
    /// Physical damping; off by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<Damping>,
    /// Solve for equilibria instead of stepping time.
    #[serde(rename = "static", default, skip_serializing_if = "Option::is_none")]
    pub statics: Option<Static>,
    /// Points whose motion is written to history.csv.
    #[serde(rename = "probe", default, skip_serializing_if = "Vec::is_empty")]
    pub probes: Vec<Probe>,
    /// How implicit equations are solved.
    #[serde(default)]
    pub solver: Solver,
    /// What is written.
    #[serde(default)]
    pub output: Output,
    /// Files to continue from; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checkpoint: Option<Checkpoints>,
    /// What to do about energy that nothing has put in; by default it warns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guard: Option<Guard>,
    /// What must hold at the end; exit code 3 if broken.
    #[serde(default)]
    pub assert: Assert,
}

impl Scene {
    /// An empty scene with this stepping of time.
    pub fn new(time: Time) -> Self {
        Self {
            title: String::new(),
            gravity: [0.0; 3],
            time,
            bodies: Vec::new(),
            rigids: Vec::new(),
            joints: Vec::new(),
            fixes: Vec::new(),
            springs: Vec::new(),
            attachments: Vec::new(),
            seams: Vec::new(),
            strikes: Vec::new(),
            loads: Vec::new(),
            wind: None,
            damping: None,
            statics: None,
            probes: Vec::new(),
            solver: Solver::default(),
            output: Output::default(),
            checkpoint: None,
            guard: None,
            assert: Assert::default(),
        }
    }

    /// Sets the title.
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Sets gravity, m/s².
    pub fn gravity(mut self, gravity: [f64; 3]) -> Self {
        self.gravity = gravity;
        self
    }

    /// Adds a body.
    pub fn body(mut self, body: Body) -> Self {
        self.bodies.push(body);
        self
    }

    /// Adds a rigid body.
    pub fn rigid(mut self, rigid: Rigid) -> Self {
        self.rigids.push(rigid);
        self
    }

    /// Adds a joint of rigid bodies.
    pub fn joint(mut self, joint: Joint) -> Self {
        self.joints.push(joint);
        self
    }

    /// Adds prescribed coordinates.
    pub fn fix(mut self, fix: Fix) -> Self {
        self.fixes.push(fix);
        self
    }

    /// Adds a spring.
    pub fn spring(mut self, spring: Spring) -> Self {
        self.springs.push(spring);
        self
    }

    /// Attaches nodes of a body.
    pub fn attach(mut self, attach: Attach) -> Self {
        self.attachments.push(attach);
        self
    }

    /// Adds a seam.
    pub fn seam(mut self, seam: Seam) -> Self {
        self.seams.push(seam);
        self
    }

    /// Adds an impulse at t = 0.
    pub fn strike(mut self, strike: Strike) -> Self {
        self.strikes.push(strike);
        self
    }

    /// Adds a load.
    pub fn load(mut self, load: Load) -> Self {
        self.loads.push(load);
        self
    }

    /// Sets the air around all sheets.
    pub fn wind(mut self, wind: Wind) -> Self {
        self.wind = Some(wind);
        self
    }

    /// Sets physical damping.
    pub fn damping(mut self, damping: Damping) -> Self {
        self.damping = Some(damping);
        self
    }

    /// Solves for equilibria instead of stepping time.
    pub fn statics(mut self, statics: Static) -> Self {
        self.statics = Some(statics);
        self
    }

    /// Adds a probe.
    pub fn probe(mut self, probe: Probe) -> Self {
        self.probes.push(probe);
        self
    }

    /// Sets how implicit equations are solved.
    pub fn solver(mut self, solver: Solver) -> Self {
        self.solver = solver;
        self
    }

    /// Sets what is written.
    pub fn output(mut self, output: Output) -> Self {
        self.output = output;
        self
    }

    /// Writes checkpoints.
    pub fn checkpoint(mut self, checkpoint: Checkpoints) -> Self {
        self.checkpoint = Some(checkpoint);
        self
    }

    /// Sets the energy guard.
    pub fn guard(mut self, guard: Guard) -> Self {
        self.guard = Some(guard);
        self
    }

    /// Everything that is wrong with the values of this scene, without reading any file.
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = check::problems(self);
        // What a check of a key has said of its value is not said twice.
        let is_new = |problem: &Problem, known: &[Problem]| {
            let key = problem.key.trim_end_matches(|c: char| c.is_ascii_digit() || c == '[' || c == ']');
            !known.iter().any(|known| known.key == problem.key || known.key == key)
        };
        let found = plain::problems(self).into_iter().filter(|problem| is_new(problem, &problems));
        let found: Vec<_> = found.chain(columns::problems(self)).collect();
        problems.extend(found);
        problems
    }

    /// The JSON schema of a scene, with units and ranges in the descriptions.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(Scene).into()
    }

    /// The files that the scene reads, each with its key.
    pub fn files(&self) -> Vec<(String, &Path)> {
        let meshes = self.bodies.iter().enumerate();
        meshes.filter_map(|(i, body)| Some((format!("body[{i}].mesh"), body.mesh.as_deref()?))).collect()
    }

    /// Reads mesh paths as relative to `directory`, where the scene file lies.
    pub fn relative_to(mut self, directory: &Path) -> Self {
        for body in &mut self.bodies {
            if let Some(mesh) = &mut body.mesh
                && mesh.is_relative()
            {
                *mesh = normal(directory.join(&*mesh));
            }
        }
        self
    }
}

/// `a/b/../c` as `a/c`, for readable messages; symbolic links are not followed.
fn normal(path: PathBuf) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::CurDir => {}
            std::path::Component::ParentDir
                if matches!(out.components().next_back(), Some(std::path::Component::Normal(_))) =>
            {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

/// Writes a path as text; what is not UTF-8 in it is replaced, as in messages.
pub(crate) fn path_as_text<S: serde::Serializer>(
    path: &Option<PathBuf>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(serializer)
}
