"""Studies of scenes: schemes, meshes and steps, vibration modes, equilibria, and sweeps over values."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from . import _core, toml
from .meshes import write_mesh
from .progress import Listener, Progress
from .run import Report, Run, load
from .scene import Scene
from .simulation import Simulation

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def bench(
    scene: Scene,
    *,
    budget: float = 60.0,
    error: float | None = None,
    schemes: Sequence[str] = (),
    threads: int | None = None,
    quiet: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Measures run time against error of schemes and steps on a scene, as `variational bench` does.

    `budget` is the time for the whole bench, s; `error` the required relative error at the end; `schemes` those to
    compare. `rows` of the result holds the table, `recommendation` the choice.
    """
    with Listener(progress, quiet) as hear:
        text = _core.bench(scene._core, scene.name, budget, error, list(schemes), threads, hear)
    return Report(json.loads(text))


def convergence(
    scene: Scene,
    *,
    levels: int = 3,
    space: bool = True,
    time: bool = True,
    modes: int | None = None,
    threads: int | None = None,
    quiet: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Refines mesh and step of a scene `levels` times: observed orders and estimates of the exact values.

    With `modes`, the space study considers that many frequencies of vibration instead of the end of the run.
    """
    with Listener(progress, quiet) as hear:
        text = _core.convergence(scene._core, scene.name, levels, space, time, modes, threads, hear)
    return Report(json.loads(text))


class Modes(Sequence[float]):
    """Frequencies of vibration (Hz), ascending; `shape` gives the shapes."""

    def __init__(self, scene: Scene, squares: Array, masses: Array, components: list[int], shapes: Any) -> None:
        import numpy as np

        self.omega_squared = squares
        """ω², 1/s²; negative if the state is unstable."""
        self.effective_masses = masses
        """Effective masses along x, y and z, kg, one row per mode."""
        self.frequencies: Array = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)
        """ω/2π, Hz."""
        self._scene = scene
        self._components = components
        self._shapes = {component: (rows, free) for component, rows, free in shapes}

    def __getitem__(self, index: Any) -> Any:
        return self.frequencies[index]

    def __len__(self) -> int:
        return len(self.frequencies)

    def shape(self, mode: int, body: str, nodes: int) -> Array:
        """Returns the shape of a mode on the `nodes` nodes of a body (nodes, 3), with φᵀMφ = 1 (kg^(−1/2))."""
        import numpy as np

        names = [entry["name"] for entry in self._scene.to_dict().get("body", [])]
        number, component = names.index(body), self._components[mode]
        row = self._components[:mode].count(component)
        rows, free = self._shapes[component]
        out = np.zeros((nodes, 3))
        own = free[:, 0] == number
        out[free[own, 1], free[own, 2]] = rows[row, own]
        return out

    def __repr__(self) -> str:
        return f"<Modes: {', '.join(f'{frequency:.5g}' for frequency in self.frequencies)} Hz>"


def modes(scene: Scene, count: int = 12, *, lumped: bool = False, threads: int | None = None) -> Modes:
    """Computes the lowest modes of each set of interacting bodies, including rigid ones.

    The mass is consistent unless `lumped`, or the scene says so. A scene with [static] is loaded first.
    """
    return Modes(scene, *_core.modes(scene._core, count, lumped, threads))


def static(scene: Scene, *, threads: int | None = None) -> Simulation:
    """Solves for the equilibrium at the end of the scene's time; returns the simulation there.

    A scene without the table [static] gets one with its defaults.
    """
    if scene.to_dict().get("static") is None:
        scene = scene.set({"static": {}})
    simulation = Simulation(scene, threads=threads)
    simulation.run()
    return simulation


class Sweep:
    """The results of a sweep: a table with one row per point, `sweep["tip.uz.min"]` a column of it, and the runs."""

    def __init__(self, directory: str, points: int, done: int, failed: int) -> None:
        self.directory = directory
        self.points = points
        """Number of points."""
        self.done = done
        """Number of points that have ended, in this call or before."""
        self.failed = failed
        """Number of those that ended with an error."""

    @property
    def rows(self) -> list[dict[str, str]]:
        """The rows of sweep.csv."""
        import csv

        with open(os.path.join(self.directory, "sweep.csv"), encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    def __getitem__(self, column: str) -> Any:
        """Returns a column as an array of float64, with NaN for points that failed; columns of texts as a list."""
        import numpy as np

        rows = self.rows
        if rows and column not in rows[0]:
            raise KeyError(f"there is no column '{column}'; there are: {', '.join(rows[0])}")
        entries = [row[column] for row in rows]
        try:
            return np.array([float(entry or "nan") for entry in entries])
        except ValueError:
            return entries

    def run(self, point: int) -> Run:
        """Returns the results of a point."""
        return load(os.path.join(self.directory, f"point-{point:04}"))

    def __len__(self) -> int:
        return self.points

    def __repr__(self) -> str:
        return f"<Sweep: {self.done} of {self.points} points are done, {self.failed} of them failed; {self.directory}>"

    def _repr_html_(self) -> str:
        from .html import table

        rows = self.rows
        head = list(rows[0]) if rows else []
        return table(repr(self)[1:-1], head, [[row[key] for key in head] for row in rows])


def sweep(
    scene: Scene,
    over: Mapping[str, Iterable[Any]],
    out: str | os.PathLike[str],
    *,
    jobs: int | None = None,
    threads: int = 1,
    task: tuple[int, int] = (0, 1),
    progress: Progress | None = None,
) -> Sweep:
    """Runs a scene at every combination of values, `{"body[0].material.young": [1e5, 1e6]}`, `jobs` at a time.

    Points that are done are not run again, and points with a checkpoint continue, so that a sweep can be ended at any
    time and called again. `task=(i, n)` runs every n-th point from number i: one task of an array of n. A point that
    fails is a row of the table. The scene is written to `scene.toml` in the directory, and meshes from arrays to .vtu
    files beside it. The files are those of `variational sweep`.

    Raises ValueError if motions are callables, which no file holds.
    """
    if scene._core.motions:
        raise ValueError("sweep: the motion of a fix is a callable: write it as a formula, or use joblib with `run`")
    directory = os.path.abspath(out)
    os.makedirs(directory, exist_ok=True)
    scene = _with_files(scene, directory)
    path, text = os.path.join(directory, f"{scene.name}.toml"), scene.to_toml()
    if not os.path.exists(path) or open(path, encoding="utf-8").read() != text:
        with _replaced(path) as temporary, open(temporary, "w", encoding="utf-8") as file:
            file.write(text)
    axes = [(key, [toml.value(value) for value in values]) for key, values in over.items()]
    jobs = max(1, (os.cpu_count() or 1) // threads) if jobs is None else jobs
    with Listener(progress, quiet=True) as hear:
        counts = _core.sweep(path, [], axes, directory, jobs, threads, task, hear)
    return Sweep(directory, *counts)


def _with_files(scene: Scene, directory: str) -> Scene:
    """Writes meshes from arrays into the directory; returns the scene with their files."""
    overrides = []
    for body, mesh in scene._core.meshes:
        path = os.path.join(directory, f"{scene.name}.{body}.vtu")
        with _replaced(path) as temporary:
            write_mesh(mesh, temporary)
        overrides.append(f"body[{body}].mesh={toml.value(path)}")
    return Scene._of(_core.Scene.parse(scene._core.to_toml(), overrides, [], [], False), scene.name)


@contextmanager
def _replaced(path: str) -> Iterator[str]:
    """Gives a path for a new file, which then replaces that at `path` at once: other tasks of a sweep may read it."""
    stem, ending = os.path.splitext(path)
    temporary = f"{stem}.{os.getpid()}{ending}"
    yield temporary
    os.replace(temporary, path)
