"""Runs that write files, and their results."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

from . import _core
from .errors import OutputError
from .progress import Listener, Progress
from .scene import Scene

if TYPE_CHECKING:
    import tempfile

    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]



def run(
    scene: Scene,
    out: str | os.PathLike[str] | None = None,
    *,
    name: str | None = None,
    threads: int | None = None,
    quiet: bool = False,
    progress: Progress | None = None,
) -> Run:
    """Runs a scene to its end and writes the files of `variational run` into the directory `out`.

    Without `out` the files are in a temporary directory that lives as long as the result. Notes go to the logger
    `variational`. `progress(t, end, steps_per_second)` is called at most every 50 ms; without it a bar of tqdm shows
    on terminals and in notebooks. Ctrl-C abandons the step in progress and ends the run, with all files written; `resume`
    continues it if the scene has a [checkpoint].

    Raises SceneError, StepError, GuardError (the results so far are written) or OutputError.
    """
    name = scene.name if name is None else name
    temporary: tempfile.TemporaryDirectory[str] | None = None
    if out is None:
        from tempfile import TemporaryDirectory

        temporary = TemporaryDirectory(prefix="variational-")
        out = temporary.name
    directory = os.fspath(out)
    with Listener(progress, quiet) as hear:
        report = _core.run(scene._core, name, directory, threads, hear)
    return Run(name, directory, json.loads(report), temporary)


def resume(
    directory: str | os.PathLike[str],
    *,
    scene: Scene | None = None,
    threads: int | None = None,
    quiet: bool = False,
    progress: Progress | None = None,
) -> Run:
    """Continues the run in a directory from its newest checkpoint, with the same bits as an uninterrupted run.

    A run that is finished is returned as it is. Pass `scene` again if it has meshes from arrays or callables.

    Raises CheckpointError if there is no checkpoint, or if scene or meshes have changed.
    """
    directory = os.fspath(directory)
    finished = _finished(directory)
    if finished is not None:
        return Run(finished["name"], directory, finished, None)
    with Listener(progress, quiet) as hear:
        name, report = _core.resume(directory, None if scene is None else scene._core, threads, hear)
    return Run(name, directory, json.loads(report), None)


def load(directory: str | os.PathLike[str]) -> Run:
    """Returns the results of a run that has ended, from its directory."""
    directory = os.fspath(directory)
    report = _report(directory)
    if report is None:
        raise OutputError(f"{directory}: there is no report.json here; the run has not ended, or is elsewhere")
    return Run(report["name"], directory, report, None)


def _report(directory: str) -> Any:
    try:
        with open(os.path.join(directory, "report.json"), encoding="utf-8") as file:
            return json.load(file)
    except (OSError, ValueError):
        return None


def _finished(directory: str) -> Any:
    report = _report(directory)
    return report if report is not None and report.get("outcome") == "done" else None


class Report(Mapping[str, Any]):
    """A report as a mapping whose keys are also attributes: `report.energy.relative_drift`."""

    __slots__ = ("_tree",)

    def __init__(self, tree: Mapping[str, Any]) -> None:
        self._tree = tree

    def __getitem__(self, key: str) -> Any:
        return _wrapped(self._tree[key])

    def __getattr__(self, key: str) -> Any:
        if key.startswith("_"):
            raise AttributeError(key)
        try:
            return self[key]
        except KeyError:
            raise AttributeError(f"the report has no '{key}'; it has: {', '.join(self._tree)}") from None

    def __getstate__(self) -> Any:
        return self._tree

    def __setstate__(self, tree: Any) -> None:
        self._tree = tree

    def __iter__(self) -> Iterator[str]:
        return iter(self._tree)

    def __len__(self) -> int:
        return len(self._tree)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._tree]

    def to_dict(self) -> dict[str, Any]:
        """Returns the report as a dict."""
        return dict(self._tree)

    def __repr__(self) -> str:
        leaves = [f"{key}={value!r}" for key, value in self._tree.items() if not isinstance(value, (dict, list))]
        parts = [key for key, value in self._tree.items() if isinstance(value, (dict, list))]
        return f"<Report: {', '.join(leaves + parts)}>"

    def _repr_html_(self) -> str:
        from .html import table

        rows = []
        for title in ("energy", "momentum"):
            part = self._tree.get(title)
            if isinstance(part, Mapping):
                rows += [(f"{title}.{key}", value) for key, value in part.items()]
        if not rows:
            rows = [(key, value) for key, value in self._tree.items() if not isinstance(value, (dict, list))]
        return table(str(self._tree.get("name", "report")), ("", ""), rows)


def _wrapped(value: Any) -> Any:
    if isinstance(value, Mapping):
        return Report(value)
    if isinstance(value, list):
        return [_wrapped(entry) for entry in value]
    return value


class History(Mapping[str, "Array"]):
    """The columns of history.csv as arrays, by name."""

    __slots__ = ("_columns",)

    def __init__(self, path: str) -> None:
        import numpy as np

        with open(path, encoding="utf-8") as file:
            names = file.readline().rstrip("\n").split(",")
            rows = [line.split(",") for line in file]
        # The last row of an interrupted write may be cut.
        rows = [row for row in rows if len(row) == len(names)]
        table = np.array([[float(entry or "nan") for entry in row] for row in rows]).reshape(-1, len(names))
        self._columns = {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}

    def __getitem__(self, name: str) -> Array:
        try:
            return self._columns[name]
        except KeyError:
            raise KeyError(f"there is no column '{name}'; there are: {', '.join(self._columns)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def to_pandas(self) -> Any:
        """Returns a `pandas.DataFrame`. Needs pandas."""
        import pandas

        return pandas.DataFrame(self._columns)

    def __repr__(self) -> str:
        count = len(next(iter(self._columns.values()), ()))
        return f"<History: {count} rows of {', '.join(self._columns)}>"


class Frame:
    """One written frame of a run."""

    __slots__ = ("path", "t")

    def __init__(self, t: float, path: str) -> None:
        self.t = t
        """Time, s."""
        self.path = path
        """The .vtu file."""

    def to_pyvista(self, warp: bool = True) -> Any:
        """Reads the frame with pyvista; `warp` moves the points by the displacement."""
        from .body import import_pyvista

        grid = import_pyvista().read(self.path)
        if warp and "displacement" in grid.point_data:
            grid.points = grid.points + grid.point_data["displacement"]
        return grid

    def __repr__(self) -> str:
        return f"<Frame t = {self.t:.6g} s: {self.path}>"


class Frames(Sequence[Frame]):
    """The frames of a run, in the order of time; files are read when they are used."""

    def __init__(self, directory: str, name: str) -> None:
        self._frames: list[Frame] = []
        path = os.path.join(directory, f"{name}.pvd")
        if os.path.exists(path):
            from xml.etree import ElementTree

            for entry in ElementTree.parse(path).iter("DataSet"):
                file = os.path.join(directory, entry.attrib["file"])
                self._frames.append(Frame(float(entry.attrib["timestep"]), file))

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        return self._frames[index]

    def __len__(self) -> int:
        return len(self._frames)

    def __repr__(self) -> str:
        return f"<{len(self._frames)} frames>"


class Run:
    """The results of a run: `report`, `history` and `frames`."""

    def __init__(
        self,
        name: str,
        directory: str,
        report: dict[str, Any],
        temporary: tempfile.TemporaryDirectory[str] | None,
    ) -> None:
        self.name = name
        self.directory = directory
        self.report = Report(report)
        self._temporary = temporary
        self._history: History | None = None

    @property
    def history(self) -> History:
        """The columns of history.csv."""
        if self._history is None:
            self._history = History(os.path.join(self.directory, "history.csv"))
        return self._history

    @property
    def frames(self) -> Frames:
        """The frames, if the scene asks for them."""
        return Frames(self.directory, self.name)

    def __getstate__(self) -> dict[str, Any]:
        # The history travels along, because a temporary directory does not.
        return {"name": self.name, "directory": self.directory, "report": self.report, "history": self.history}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.name, self.directory = state["name"], state["directory"]
        self.report, self._history, self._temporary = state["report"], state["history"], None

    def __repr__(self) -> str:
        return f"<Run '{self.name}': {self.report.get('outcome')}, {self.report.get('steps')} steps, {self.directory}>"

    def _repr_html_(self) -> str:
        return self.report._repr_html_()
