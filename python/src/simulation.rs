//! A simulation that Python steps, reads and sets.

use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::Instant;

use numpy::{PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use variational::auto::settle;
use variational::core::StepEnergy;
use variational::fem::ElementField;
use variational::model::BodyModel;
use variational::scene::Problem;
use variational::simulation::{self, AddedTerm, Snapshot};

use crate::arrays::{float_array, int_array, points_array, vectors};
use crate::callables::{CallableForce, CallablePotential, Raised};
use crate::errors;
use crate::mesh::Mesh;
use crate::observation::{observation, triangle};
use crate::scene::Scene;
use crate::supervise::{QUANTUM, supervise};
use crate::threads::Threads;

/// A term written in Python: the number of its body, `potential` or `force`, and the object.
type Term = (usize, String, Py<PyAny>);

/// The parts of a simulation that is not closed.
struct Open {
    simulation: simulation::Simulation,
    threads: Threads,
    raised: Raised,
    /// The contributions to the change of energy of all steps since it was made or restored.
    ledger: StepEnergy,
    /// Whether the scene has terms or motions written in Python.
    has_callables: bool,
}

/// A simulation of a scene; use `variational_sim.Simulation` instead.
#[pyclass(frozen, module = "variational_sim._core")]
pub(crate) struct Simulation {
    open: Mutex<Option<Open>>,
    /// The process that made it; after a fork its threads do not exist.
    process: u32,
    scene: Scene,
}

impl Drop for Simulation {
    fn drop(&mut self) {
        // The threads of a forked simulation do not exist: waiting for them would not end.
        if self.process != std::process::id()
            && let Ok(open) = self.open.get_mut()
        {
            std::mem::forget(open.take());
        }
    }
}

impl Simulation {
    /// Locks the simulation for this thread. Raises an error if another thread is using it, or if it was made before a
    /// fork.
    fn claim(&self, py: Python<'_>) -> PyResult<MutexGuard<'_, Option<Open>>> {
        if self.process != std::process::id() {
            let message = "this simulation was made before a fork, and its threads are in the parent process: start \
                           processes with the method \"spawn\", or make the simulation here";
            return Err(errors::plain(py, "ForkError", message));
        }
        self.open.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => {
                let message =
                    "another thread is using this simulation: wait for it, or make one simulation per thread";
                errors::plain(py, "BusyError", message)
            }
            TryLockError::Poisoned(_) => {
                let message =
                    "an earlier call panicked, which is a defect of the program: make a new simulation";
                errors::plain(py, "Error", message)
            }
        })
    }

    /// Calls `act` with the simulation, without Python's lock. Raises the errors of [`Simulation::claim`], an error if
    /// the simulation was closed, and the exceptions of callables.
    fn with<T: Send>(&self, py: Python<'_>, act: impl FnOnce(&mut Open) -> T + Send) -> PyResult<T> {
        call(py, &mut *self.claim(py)?, act)
    }

    /// As [`Simulation::with`], on the threads of the simulation.
    fn within<T: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut simulation::Simulation) -> T + Send,
    ) -> PyResult<T> {
        self.with(py, |Open { simulation, threads, .. }| threads.install(|| act(simulation)))
    }

    fn nodal<'py>(
        &self,
        py: Python<'py>,
        values: impl FnOnce(&simulation::Simulation) -> Vec<[f64; 3]> + Send,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        points_array(py, self.within(py, |simulation| values(simulation))?)
    }
}

/// Calls `act` with an open simulation, without Python's lock.
fn call<T: Send>(
    py: Python<'_>,
    open: &mut Option<Open>,
    act: impl FnOnce(&mut Open) -> T + Send,
) -> PyResult<T> {
    let Some(open) = open else {
        return Err(errors::plain(py, "ClosedError", "this simulation is closed: make a new one"));
    };
    let result = py.detach(|| act(&mut *open));
    match open.raised.take() {
        Some(error) => Err(error),
        None => Ok(result),
    }
}

/// The end of a group of steps.
enum End {
    Quantum,
    Failed(u64, variational::solvers::StepError),
}

impl Open {
    /// Makes steps up to the number `last` for at most one quantum of time.
    fn steps(&mut self, last: u64) -> End {
        let Self { simulation, threads, raised, ledger, has_callables } = self;
        threads.install(|| {
            let begin = Instant::now();
            while simulation.steps() < last && begin.elapsed() < QUANTUM && !raised.is_set() {
                let left = last - simulation.steps();
                let before = has_callables.then(|| simulation.snapshot());
                let made = match &before {
                    Some(_) => simulation.step(),
                    None => simulation.advance(left),
                };
                match before {
                    // A step with an exception is undone. The snapshot belongs to this simulation, so restoring it does
                    // not fail.
                    Some(before) if raised.is_set() => drop(simulation.restore(&before)),
                    _ => match made {
                        Ok(made) => *ledger += made.energy,
                        Err(error) => return End::Failed(simulation.steps() + 1, error),
                    },
                }
            }
            End::Quantum
        })
    }
}

#[pymethods]
impl Simulation {
    /// Builds a simulation; a scheme "auto" is chosen by trials first, which report to `hear`.
    #[new]
    fn new(
        py: Python<'_>,
        scene: &Scene,
        threads: Option<usize>,
        terms: Vec<Term>,
        hear: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (threads, raised) = (Threads::new(threads)?, Raised::default());
        let armed = scene.reporting_to(py, &raised)?;
        let has_callables = !terms.is_empty() || !scene.motions(py).is_empty();
        let reported = raised.clone();
        let mut failure = None;
        let built = {
            let (terms, failure) = (&terms, &mut failure);
            supervise(py, &threads, &raised, hear, move |mut link| {
                if terms.is_empty() {
                    let (scene, _) = settle(armed, &mut link)?;
                    return simulation::Simulation::new(scene).map_err(variational::auto::SettleError::Scene);
                }
                let add = |bodies: &[BodyModel]| {
                    let made = Python::attach(|py| added(py, terms, bodies, &reported));
                    made.map_err(|error| *failure = Some(error)).unwrap_or_default()
                };
                simulation::Simulation::with_terms(armed, add).map_err(variational::auto::SettleError::Scene)
            })
        };
        if let Some(error) = failure {
            return Err(error);
        }
        let simulation = built?.map_err(|error| scene.failed(py, error.into()))?;
        let scene = scene.settled(py, simulation.scene().clone());
        let open = Open { simulation, threads, raised, ledger: StepEnergy::default(), has_callables };
        Ok(Self { open: Mutex::new(Some(open)), process: std::process::id(), scene })
    }

    /// Ends the threads and frees the memory.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let open = &mut *self.claim(py)?;
        call(py, open, |_| ())?;
        let taken = open.take();
        py.detach(|| drop(taken));
        Ok(())
    }

    /// Returns the scene, with scheme and step in place of "auto".
    fn scene(&self, py: Python<'_>) -> PyResult<Scene> {
        let scene = self.with(py, |open| open.simulation.scene().clone())?;
        Ok(self.scene.settled(py, scene))
    }

    /// Returns time, step, steps made, steps of the scene, whether it is done, and the load factor.
    fn clock(&self, py: Python<'_>) -> PyResult<(f64, f64, u64, u64, bool, Option<f64>)> {
        self.with(py, |open| {
            let s = &open.simulation;
            (s.time(), s.step_size(), s.steps(), s.step_count(), s.is_done(), s.load_factor())
        })
    }

    /// Makes `count` steps; returns notes on them. Signals take effect between steps.
    fn step(&self, py: Python<'_>, count: u64) -> PyResult<Vec<String>> {
        // The lock is kept between groups of steps, so that no other thread comes between them.
        let open = &mut *self.claim(py)?;
        let (made, all) = call(py, open, |open| (open.simulation.steps(), open.simulation.step_count()))?;
        if count > all.saturating_sub(made) {
            let left = all.saturating_sub(made);
            return Err(errors::value(format!(
                "step({count}): the scene ends after {left} more steps; make a scene with a larger time.end"
            )));
        }
        loop {
            let (end, steps, done) = call(py, open, |open| {
                let end = open.steps(made + count);
                (end, open.simulation.steps(), open.simulation.is_done())
            })?;
            if let End::Failed(number, error) = end {
                return Err(errors::step(py, number, &error));
            }
            if steps >= made + count || done {
                return call(py, open, |open| open.simulation.take_findings());
            }
            py.check_signals()?;
        }
    }

    /// Returns the notes of the mesh readers.
    fn notes(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.with(py, |open| open.simulation.notes().to_vec())
    }

    /// Returns energies, momenta, probes and rigid bodies as a dict.
    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (seen, probes, rigids) = self.within(py, |simulation| {
            let probes: Vec<_> = simulation.scene().node_probes().map(|probe| probe.name.clone()).collect();
            let rigids: Vec<_> = simulation.rigids().iter().map(|rigid| rigid.name.clone()).collect();
            (simulation.observe(), probes, rigids)
        })?;
        observation(py, &seen, &probes, &rigids)
    }

    /// Returns the counted work, {name: count}.
    fn work(&self, py: Python<'_>) -> PyResult<Vec<(String, u64)>> {
        let of = |open: &mut Open| -> Vec<(String, u64)> {
            open.simulation.work().iter().map(|(name, count)| (name.to_owned(), count)).collect()
        };
        self.with(py, of)
    }

    /// Returns the contributions to the change of energy since the simulation was made or restored, {name: J}.
    fn ledger(&self, py: Python<'_>) -> PyResult<Vec<(&'static str, f64)>> {
        let StepEnergy { prescribed, force, damping, friction, contact_damping, scheme, residual } =
            self.with(py, |open| open.ledger)?;
        Ok(vec![
            ("prescribed", prescribed),
            ("force", force),
            ("damping", damping),
            ("friction", friction),
            ("contact_damping", contact_damping),
            ("scheme", scheme),
            ("residual", residual),
        ])
    }

    /// Returns name and dimension (3 or 2) of the bodies.
    fn bodies(&self, py: Python<'_>) -> PyResult<Vec<(String, usize)>> {
        let of = |open: &mut Open| -> Vec<(String, usize)> {
            open.simulation.bodies().iter().map(|body| (body.name.clone(), body.dimension)).collect()
        };
        self.with(py, of)
    }

    /// Returns the mesh of a body at rest.
    fn mesh(&self, py: Python<'_>, body: usize) -> PyResult<Mesh> {
        self.with(py, |open| Mesh(open.simulation.bodies()[body].mesh.clone().into()))
    }

    fn positions<'py>(&self, py: Python<'py>, body: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.nodal(py, |simulation| simulation.positions(body))
    }

    fn velocities<'py>(&self, py: Python<'py>, body: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.nodal(py, |simulation| simulation.velocities(body))
    }

    fn accelerations<'py>(&self, py: Python<'py>, body: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.nodal(py, |simulation| simulation.accelerations(body))
    }

    fn reactions<'py>(&self, py: Python<'py>, body: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.nodal(py, |simulation| simulation.reactions(body))
    }

    fn external_forces<'py>(&self, py: Python<'py>, body: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.nodal(py, |simulation| simulation.external_forces(body))
    }

    /// Returns a field on the solid elements of a body, one row per element, and the numbers of their cells.
    fn field<'py>(
        &self,
        py: Python<'py>,
        body: usize,
        name: &str,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Vec<u32>)> {
        use ElementField::{EnergyDensity, J, Strain, Stress, VonMises};
        let fields = [Stress, VonMises, Strain, J, EnergyDensity];
        let Some(field) = fields.into_iter().find(|field| field.name() == name) else {
            let names: Vec<_> = fields.map(ElementField::name).to_vec();
            return Err(errors::value(format!("unknown field '{name}'; there are {}", names.join(", "))));
        };
        let (values, cells) = self.within(py, |simulation| {
            let cells = simulation.bodies()[body].solids().flat_map(|(cells, _)| cells.to_vec());
            (simulation.element_values(body, field), cells.collect())
        })?;
        Ok((float_array(py, values, field.component_count())?, cells))
    }

    /// Sets positions and velocities of a body; missing ones keep their values.
    fn set_motion(
        &self,
        py: Python<'_>,
        body: usize,
        x: Option<PyReadonlyArray2<'_, f64>>,
        v: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<()> {
        let count = self.with(py, |open| open.simulation.bodies()[body].mesh.points.len())?;
        let x = x.map(|x| vectors("x", &x, count)).transpose()?;
        let v = v.map(|v| vectors("v", &v, count)).transpose()?;
        let set = self.within(py, |simulation| {
            let x = x.unwrap_or_else(|| simulation.positions(body));
            let v = v.unwrap_or_else(|| simulation.velocities(body));
            simulation.set_motion(body, &x, &v)
        })?;
        set.map_err(errors::value)
    }

    /// Returns the state as bytes with a checksum.
    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.with(py, |open| open.simulation.snapshot().to_bytes())?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Sets the state from the bytes of `snapshot`.
    fn restore(&self, py: Python<'_>, bytes: &[u8]) -> PyResult<()> {
        let snapshot = Snapshot::from_bytes(bytes)
            .map_err(|damage| errors::plain(py, "CheckpointError", &damage.to_string()))?;
        let restored = self.within(py, |simulation| simulation.restore(&snapshot))?;
        restored.map_err(|error| errors::plain(py, "CheckpointError", &error.to_string()))
    }

    /// Returns the number of components, systems of bodies that act on each other.
    fn component_count(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |open| open.simulation.components().len())
    }

    /// Returns M and K of a component as lower triangles (rows, columns, values), the residual, and body, node and
    /// axis of each free coordinate.
    #[allow(clippy::type_complexity, reason = "the tuple is unpacked in Python")]
    fn matrices<'py>(
        &self,
        py: Python<'py>,
        component: usize,
    ) -> PyResult<([Bound<'py, PyAny>; 6], Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<i64>>)> {
        let found = self.within(py, |simulation| {
            let count = simulation.components().len();
            if component >= count {
                return Err(format!("component {component}: there are {count}, from 0"));
            }
            let matrices = simulation.matrices(component).map_err(|error| error.to_string())?;
            Ok((matrices, free_coordinates(simulation, component)))
        })?;
        let (matrices, free) = found.map_err(errors::value)?;
        let [mass, stiffness] = [&matrices.mass, &matrices.stiffness].map(|part| triangle(py, part));
        let arrays = mass.into_iter().chain(stiffness).collect::<Vec<_>>();
        let arrays = arrays.try_into().map_err(|_| errors::value("six arrays"))?;
        Ok((arrays, PyArray1::from_vec(py, matrices.residual), int_array(py, free, 3)?))
    }
}

/// Makes the terms written in Python.
fn added(py: Python<'_>, terms: &[Term], bodies: &[BodyModel], raised: &Raised) -> PyResult<Vec<AddedTerm>> {
    let term = |(number, kind, object): &Term| {
        let Some(body) = bodies.get(*number) else {
            return Err(errors::scene(py, vec![Problem::new("body", format!("there is no body {number}"))]));
        };
        let object = object.bind(py);
        Ok(match kind.as_str() {
            "force" => AddedTerm::force(body, CallableForce::new(object, body, raised.clone())?),
            _ => AddedTerm::potential(body, CallablePotential::new(object, body, raised.clone())?),
        })
    };
    terms.iter().map(term).collect()
}

/// Returns body, node and axis of each free coordinate of a component; −1 for those of rigid bodies and others.
pub(crate) fn free_coordinates(simulation: &simulation::Simulation, component: usize) -> Vec<i64> {
    let coordinates = simulation.components()[component].system().coordinates();
    let mut owners = vec![[-1_i64; 3]; coordinates.dof_count()];
    for (number, body) in simulation.bodies().iter().enumerate() {
        if body.component == component {
            for node in 0..body.mesh.points.len() {
                let first = 3 * body.node(node);
                (0..3).for_each(|axis| owners[first + axis] = [number as i64, node as i64, axis as i64]);
            }
        }
    }
    coordinates.free().iter().flat_map(|&dof| owners[dof as usize]).collect()
}
