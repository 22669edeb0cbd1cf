//! A scene: everything that a run needs, as one serde value that the Rust builder and TOML share.

mod attach;
mod body;
mod check;
mod columns;
mod contact;
mod fix;
mod functions;
mod idle_contact;
mod load;
mod material;
mod names;
mod output;
#[cfg(feature = "cli")]
mod parse;
mod plain;
mod probe;
mod problem;
mod rigid;
mod safety;
mod selection;
#[cfg(feature = "cli")]
mod set;
mod statics;
#[cfg(feature = "cli")]
mod structure;
mod time;

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_fem::{Amplitude, Wind};
use vi_solvers::Interrupt;

pub use attach::{Attach, Periodic, Seam};
pub(crate) use body::MOST_REFINED;
pub use body::{Axis, Body, Refine, RefineAlong, RestShape, Spring, SpringEnd, Strike};
pub(crate) use columns::history_columns;
pub use contact::{Contact, ContactPair};
pub use fix::{About, Fix, HeldAxis, LocalAxis};
pub(crate) use functions::{FunctionOfTime, integral};
pub(crate) use load::field;
pub use load::{Damping, FieldComponent, Load};
pub use material::{MaterialEntry, Materials, Substance};
pub use names::BodyId;
pub(crate) use names::{Names, RigidId};
pub(crate) use output::Schedule;
pub use output::{Assert, Cache, Encoding, Field, Output, Precision};
#[cfg(feature = "cli")]
pub use parse::Parsed;
pub use probe::{Component, Probe, Quantity, Statistic};
pub use problem::Problem;
pub use rigid::{Inertia, Joint, Rigid, RigidShape, Turn};
pub use safety::{Checkpoints, Guard, GuardAction};
pub use selection::{BoxRegion, PlaneRegion, Selection, SphereRegion};
pub use statics::{Control, Static};
pub use time::{AdaptiveWord, LinearChoice, MassKind, SchemeName, Solver, Time, TimeStep};

/// A scene. Its TOML form has the same names; unknown keys are errors.
///
/// ```
/// use variational::prelude::*;
/// let scene = Scene::new(Time::new(1.0, 0.01, SchemeName::StormerVerlet))
///     .gravity([0.0, -9.81, 0.0])
///     .body(Body::from_box(
///         "block",
///         BoxMesh { size: [1.0, 0.2, 0.2], cells: [5, 1, 1], element: CellKind::Tet4, origin: [0.0; 3] },
///         Law::NeoHookean(Isotropic { young: 1e6, poisson: 0.3, density: 1000.0 }),
///     ))
///     .fix(Fix::region("block", "x-min"));
/// assert!(scene.problems().is_empty());
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Description of the scene in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub title: String,
    /// Acceleration of gravity, m/s².
    #[serde(default)]
    pub gravity: [f64; 3],
    /// Factor on gravity in time (default 1): a number, a formula of t (s) or a table `[[t, factor], …]`; in a
    /// static solve t is the load factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity_amplitude: Option<Amplitude>,
    /// Time interval, step and integrator.
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
    /// Springs between points of bodies, or between such a point and a point fixed in space.
    #[serde(rename = "spring", default, skip_serializing_if = "Vec::is_empty")]
    pub springs: Vec<Spring>,
    /// Nodes attached to the surface of another body, or by springs to points in space.
    #[serde(rename = "attach", default, skip_serializing_if = "Vec::is_empty")]
    pub attachments: Vec<Attach>,
    /// Edges of sheets sewn together.
    #[serde(rename = "seam", default, skip_serializing_if = "Vec::is_empty")]
    pub seams: Vec<Seam>,
    /// Parts of a body with equal displacements, as if copies of the body lay side by side.
    #[serde(rename = "periodic", default, skip_serializing_if = "Vec::is_empty")]
    pub periodics: Vec<Periodic>,
    /// Impulses given to a region at t = 0.
    #[serde(rename = "strike", default, skip_serializing_if = "Vec::is_empty")]
    pub strikes: Vec<Strike>,
    /// Forces on bodies.
    #[serde(rename = "load", default, skip_serializing_if = "Vec::is_empty")]
    pub loads: Vec<Load>,
    /// Air around all sheets: drag and wind; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wind: Option<Wind>,
    /// Physical damping; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<Damping>,
    /// Contact between bodies and of bodies with themselves; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<Contact>,
    /// Solve for equilibria instead of stepping time.
    #[serde(rename = "static", default, skip_serializing_if = "Option::is_none")]
    pub statics: Option<Static>,
    /// Points whose motion is written to history.csv.
    #[serde(rename = "probe", default, skip_serializing_if = "Vec::is_empty")]
    pub probes: Vec<Probe>,
    /// Options for solving implicit equations.
    #[serde(default)]
    pub solver: Solver,
    /// Files to write.
    #[serde(default)]
    pub output: Output,
    /// Checkpoint files to continue the run from; none by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checkpoint: Option<Checkpoints>,
    /// Response to energy that no work accounts for; a warning by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guard: Option<Guard>,
    /// Assertions at the end; exit code 3 if one is broken.
    #[serde(default)]
    pub assert: Assert,
}

impl Scene {
    /// Makes an empty scene with these time settings.
    pub fn new(time: Time) -> Self {
        Self {
            title: String::new(),
            gravity: [0.0; 3],
            gravity_amplitude: None,
            time,
            bodies: Vec::new(),
            rigids: Vec::new(),
            joints: Vec::new(),
            fixes: Vec::new(),
            springs: Vec::new(),
            attachments: Vec::new(),
            seams: Vec::new(),
            periodics: Vec::new(),
            strikes: Vec::new(),
            loads: Vec::new(),
            wind: None,
            damping: None,
            contact: None,
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

    /// Sets the variation of gravity in time.
    pub fn gravity_amplitude(mut self, amplitude: Amplitude) -> Self {
        self.gravity_amplitude = Some(amplitude);
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

    /// Ties two parts of a body to equal displacements.
    pub fn periodic(mut self, periodic: Periodic) -> Self {
        self.periodics.push(periodic);
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

    /// Switches contact on.
    pub fn contact(mut self, contact: Contact) -> Self {
        self.contact = Some(contact);
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

    /// Sets the options for implicit equations.
    pub fn solver(mut self, solver: Solver) -> Self {
        self.solver = solver;
        self
    }

    /// Sets the request that abandons a step, or another solve, in progress. It stays with the scene and all simulations of it.
    pub fn interruptible(mut self, interrupt: Interrupt) -> Self {
        self.solver.interrupt = interrupt;
        self
    }

    /// Sets the output.
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

    /// Returns the JSON schema of a scene, with units and ranges in the descriptions.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(Scene).into()
    }

    /// Returns the files that the scene reads, each with its key.
    pub fn files(&self) -> Vec<(String, &Path)> {
        let meshes = self.bodies.iter().enumerate();
        let meshes = meshes.filter_map(|(i, body)| Some((format!("body[{i}].mesh"), body.mesh.as_deref()?)));
        let lists = self.selections().into_iter();
        let lists =
            lists.filter_map(|(key, on)| Some((format!("{key}.node_file"), on.node_file.as_deref()?)));
        let rigids = self.rigids.iter().enumerate();
        let shapes = rigids.filter_map(|(i, rigid)| match rigid.shape.as_ref()? {
            RigidShape::Mesh { file, .. } => Some((format!("rigid[{i}].shape.file"), file.as_path())),
            _ => None,
        });
        meshes.chain(shapes).chain(lists).collect()
    }

    /// Takes the paths of meshes and node lists as relative to `directory`, the folder of the scene file.
    pub fn relative_to(mut self, directory: &Path) -> Self {
        self.for_each_file(|path| {
            if path.is_relative() {
                *path = normal(directory.join(&*path));
            }
        });
        self
    }

    /// Calls `change` with the paths of the files that the scene reads, in the order of [`Scene::files`].
    pub(crate) fn for_each_file(&mut self, mut change: impl FnMut(&mut PathBuf)) {
        self.bodies.iter_mut().filter_map(|body| body.mesh.as_mut()).for_each(&mut change);
        let shapes = self.rigids.iter_mut().filter_map(|rigid| match rigid.shape.as_mut()? {
            RigidShape::Mesh { file, .. } => Some(file),
            _ => None,
        });
        shapes.for_each(&mut change);
        self.selections_mut().filter_map(|on| on.node_file.as_mut()).for_each(change);
    }

    /// Returns the scene with absolute paths in their shortest form.
    pub(crate) fn with_absolute_paths(mut self) -> Self {
        self.for_each_file(|path| {
            // A path that cannot be made absolute (an empty one) is reported by the checks of the scene.
            if let Ok(absolute) = std::path::absolute(&*path) {
                *path = normal(absolute);
            }
        });
        self
    }

    /// Returns the selections of parts of bodies, each with the key of its table.
    fn selections(&self) -> Vec<(String, &Selection)> {
        let mut all: Vec<(String, &Selection)> = Vec::new();
        all.extend(self.fixes.iter().enumerate().map(|(i, fix)| (format!("fix[{i}]"), &fix.on)));
        all.extend(
            self.attachments.iter().enumerate().map(|(i, attach)| (format!("attach[{i}]"), &attach.on)),
        );
        for (i, periodic) in self.periodics.iter().enumerate() {
            all.push((format!("periodic[{i}].from"), &periodic.from));
            all.push((format!("periodic[{i}].to"), &periodic.to));
        }
        all.extend(self.strikes.iter().enumerate().map(|(i, strike)| (format!("strike[{i}]"), &strike.on)));
        let loads = self.loads.iter().enumerate();
        all.extend(loads.filter_map(|(i, load)| Some((format!("load[{i}]"), load.selection()?))));
        all.extend(self.probes.iter().enumerate().map(|(i, probe)| (format!("probe[{i}]"), &probe.on)));
        all
    }

    fn selections_mut(&mut self) -> impl Iterator<Item = &mut Selection> {
        let fixes = self.fixes.iter_mut().map(|fix| &mut fix.on);
        let attachments = self.attachments.iter_mut().map(|attach| &mut attach.on);
        let periodics = self.periodics.iter_mut().flat_map(|periodic| [&mut periodic.from, &mut periodic.to]);
        let strikes = self.strikes.iter_mut().map(|strike| &mut strike.on);
        let loads = self.loads.iter_mut().filter_map(Load::selection_mut);
        let probes = self.probes.iter_mut().map(|probe| &mut probe.on);
        fixes.chain(attachments).chain(periodics).chain(strikes).chain(loads).chain(probes)
    }

    /// Iterates over the node probes, in the order of the scene.
    pub fn node_probes(&self) -> impl Iterator<Item = &Probe> {
        self.probes.iter().filter(|probe| probe.is_node())
    }
}

/// Shortens `a/b/../c` to `a/c`, for readable messages; symbolic links are not followed.
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

/// Writes a path as text. Bytes that are not UTF-8 are replaced, as in messages.
pub(crate) fn path_as_text<S: serde::Serializer>(
    path: &Option<PathBuf>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(serializer)
}
