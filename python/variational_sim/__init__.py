"""Deformable bodies, cloth and solids, by finite elements and variational time integrators.

    import variational_sim as vs

`Scene` describes a scene, `Simulation` steps it in memory, `run` writes files as the command `variational run` does,
and `bench`, `convergence`, `modes`, `static` and `sweep` study it. All units are SI, angles in radians. Arrays are
float64 in C order, in the numbering of the mesh, and belong to you: later steps do not change them.
"""

from __future__ import annotations

from importlib.util import find_spec as _find_spec

if _find_spec("numpy") is None:
    raise ImportError("variational_sim needs numpy: pip install numpy")

from ._core import Mesh, schema
from .body import Body
from .errors import (
    BusyError,
    CheckpointError,
    ClosedError,
    Error,
    ForkError,
    GuardError,
    OutputError,
    Problem,
    SceneError,
    StepError,
    StudyError,
)
from .meshes import mesh, write_mesh
from .observation import Contact, Observation, Pose, Probe
from .run import Frame, History, Report, Run, load, resume, run
from .scene import Scene
from .simulation import Simulation
from .study import Modes, Sweep, bench, convergence, modes, static, sweep
from .usd import write_usd
from .view import movie, picture, view
from .vtkhdf import write_vtkhdf

__version__ = "0.1.0"

__all__ = [
    "Body",
    "BusyError",
    "CheckpointError",
    "ClosedError",
    "Contact",
    "Error",
    "ForkError",
    "Frame",
    "GuardError",
    "History",
    "Mesh",
    "Modes",
    "Observation",
    "OutputError",
    "Pose",
    "Probe",
    "Problem",
    "Report",
    "Run",
    "Scene",
    "SceneError",
    "Simulation",
    "StepError",
    "StudyError",
    "Sweep",
    "bench",
    "convergence",
    "load",
    "mesh",
    "modes",
    "movie",
    "picture",
    "resume",
    "run",
    "schema",
    "static",
    "sweep",
    "view",
    "write_mesh",
    "write_usd",
    "write_vtkhdf",
]
