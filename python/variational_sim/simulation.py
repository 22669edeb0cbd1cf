"""Simulations in memory: step, read and set."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any

from . import _core
from .body import Body
from .meshes import as_mesh
from .observation import Contact, Observation, Pose, Probe
from .progress import Listener, Progress, note
from .scene import Scene

if TYPE_CHECKING:
    import numpy as np
    import scipy.sparse
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

Terms = Mapping[str, "object | Sequence[object]"]


class Simulation:
    """A scene with its state, ready for steps.

    A scheme "auto" is chosen by trials first. `threads` is the number of threads (default: one per core); results do
    not depend on it.

    `potentials` and `forces` add your own physics to bodies, `{"name of the body": term or [terms]}`:

    - a potential is an object with `nodes` (m, k), node numbers of m stencils of k nodes, and vectorised methods for
      positions x (m, k, 3) in m: `energy(x)` (m,) in J, `gradient(x)` (m, k, 3) in N, and optionally `hessian(x)`
      (m, k, 3, k, 3) in N/m, which is differenced if missing. The energy of a stencil depends on its own nodes only.
      With `time_dependent = True` the methods take `(x, t)`.
    - a force is a callable `f(x, v, t)` that returns (n, 3) in N, for positions and velocities (n, 3) of all nodes.
      Set `depends_on_velocity = False` on it if it does not; methods `stiffness(x, v, t)` and `damping(x, v, t)`
      (n, 3, 3) give −∂f/∂x and −∂f/∂v of each node to implicit schemes.

    They are called once per evaluation. If one raises an exception, the step ends, the state stays that before the
    step, and the exception is raised. The energy ledger books their work.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        threads: int | None = None,
        potentials: Terms | None = None,
        forces: Terms | None = None,
        progress: Progress | None = None,
    ) -> None:
        names = [body["name"] for body in scene.to_dict().get("body", [])]
        terms = [
            *_terms("potential", potentials or {}, names),
            *_terms("force", forces or {}, names),
        ]
        self._threads = threads
        self._terms = (potentials, forces)
        self._name = scene.name
        with Listener(progress, quiet=True) as hear:
            self._core = _core.Simulation(scene._core, threads, terms, hear)
        note(self._core.notes(), warn=False)
        # No `Body` is kept here: it refers to the simulation, and a cycle would hold its memory for long.
        self._numbers = {name: number for number, (name, _) in enumerate(self._core.bodies())}

    @property
    def scene(self) -> Scene:
        """The scene, with scheme and step in place of "auto"."""
        return Scene._of(self._core.scene(), self._name)

    @property
    def t(self) -> float:
        """Time, s."""
        return self._core.clock()[0]

    @property
    def h(self) -> float:
        """The step, s; it lands on the end of the scene."""
        return self._core.clock()[1]

    @property
    def steps(self) -> int:
        """Number of steps made."""
        return self._core.clock()[2]

    @property
    def step_count(self) -> int:
        """Number of steps to the end of the scene."""
        return self._core.clock()[3]

    @property
    def is_done(self) -> bool:
        """Whether the end of the scene is reached."""
        return self._core.clock()[4]

    @property
    def load_factor(self) -> float | None:
        """The load factor, if a path of equilibria is followed."""
        return self._core.clock()[5]

    def step(self, count: int = 1) -> None:
        """Makes steps. Ctrl-C takes effect between steps, at most 50 ms after a step's end.

        Raises StepError if a step fails; the state is then that before the step. Raises ValueError if fewer than
        `count` steps are left to the end of the scene.
        """
        note(self._core.step(count), warn=True)

    def every(self, interval: float) -> Iterator[float]:
        """Steps to the end of the scene; yields the time at the step nearest to each multiple of `interval` (s), and
        at the end."""
        if not interval > 0.0:
            raise ValueError(f"interval must be positive (s), is {interval}")
        while not self.is_done:
            t, h, steps, count, _, _ = self._core.clock()
            number = round(t / interval) + 1
            target = max(steps + 1, round(number * interval / h))
            self.step(min(target, count) - steps)
            yield self.t

    def run(self, observer: Callable[[Simulation], object] | None = None, interval: float | None = None) -> None:
        """Steps to the end of the scene; calls `observer(self)` at multiples of `interval` (s; default: every
        step)."""
        if observer is None:
            while not self.is_done:
                _, _, steps, count, _, _ = self._core.clock()
                self.step(count - steps)
            return
        for _ in self.every(self.h if interval is None else interval):
            observer(self)

    def observe(self) -> Observation:
        """Returns energies, momenta, probes and rigid bodies. It costs one energy evaluation."""
        seen = self._core.observe()
        seen["probes"] = {name: Probe(*values) for name, values in seen["probes"].items()}
        seen["rigids"] = {name: Pose(*values) for name, values in seen["rigids"].items()}
        facts = seen.get("contact_facts")
        seen["contact_facts"] = None if facts is None else Contact(*facts)
        return Observation(**seen)

    def ledger(self) -> dict[str, float]:
        """Returns the contributions to the change of the total energy since the simulation was made or restored, J.

        `prescribed`: work of supports; `force`: work of forces, and the energy that assignments of `x` and `v` add, from
        the next step on; `damping`, `friction`, `contact_damping` (≤ 0); `scheme` and `residual`: errors of scheme and
        solver. With output=dict(ledger=True) their sum is the change; otherwise the last two may be left out.
        """
        return dict(self._core.ledger())

    def work(self) -> dict[str, int]:
        """Returns the counted work so far, such as force evaluations and factorisations."""
        return dict(self._core.work())

    @property
    def bodies(self) -> Mapping[str, Body]:
        """The deformable bodies by name."""
        return {name: Body(self, name, number) for name, number in self._numbers.items()}

    def __getitem__(self, name: str) -> Body:
        try:
            return Body(self, name, self._numbers[name])
        except KeyError:
            known = ", ".join(self._numbers)
            raise KeyError(f"there is no deformable body '{name}'; there are: {known}") from None

    def __iter__(self) -> Iterator[Body]:
        return iter(self.bodies.values())

    def matrices(
        self, component: int = 0
    ) -> tuple[scipy.sparse.csr_array, scipy.sparse.csr_array, Array, NDArray[np.int64]]:
        """Returns M (kg), K = ∂²V/∂q² (N/m), the residual f − ∂V/∂q (N) on the n free coordinates of a component, and
        body, node and axis of each coordinate (n, 3), −1 for those of rigid bodies. Needs scipy."""
        import numpy as np
        from scipy.sparse import coo_array

        arrays, residual, free = self._core.matrices(component)
        size = len(residual)

        def full(rows: Any, columns: Any, values: Any) -> scipy.sparse.csr_array:
            below = rows != columns
            i = np.concatenate([rows, columns[below]])
            j = np.concatenate([columns, rows[below]])
            data = np.concatenate([values, values[below]])
            return coo_array((data, (i, j)), shape=(size, size)).tocsr()

        return full(*arrays[:3]), full(*arrays[3:]), residual, free

    def snapshot(self) -> bytes:
        """Returns scene and state as bytes; the next steps of a restored simulation have the same bits."""
        import io

        import numpy as np

        text, meshes, _, name = self.scene.__reduce__()[1]
        arrays: dict[str, Any] = {
            "scene": np.frombuffer(text.encode(), np.uint8),
            "name": np.frombuffer(name.encode(), np.uint8),
            "state": np.frombuffer(self._core.snapshot(), np.uint8),
        }
        for body, (points, blocks, regions) in meshes:
            arrays[f"mesh/{body}/points"] = points
            for k, (kind, nodes) in enumerate(blocks):
                arrays[f"mesh/{body}/block/{k}/{kind}"] = nodes
            for region, cells in regions.items():
                arrays[f"mesh/{body}/region/{region}"] = np.asarray(cells)
        file = io.BytesIO()
        np.savez(file, **arrays)
        return file.getvalue()

    @classmethod
    def restore(
        cls,
        snapshot: bytes,
        *,
        threads: int | None = None,
        potentials: Terms | None = None,
        forces: Terms | None = None,
    ) -> Simulation:
        """Makes a simulation from a snapshot. Your own physics is not part of the bytes: pass it again.

        Raises CheckpointError if the bytes are damaged.
        """
        import io

        import numpy as np

        from .errors import CheckpointError

        meshes: dict[int, tuple[list[Any], list[Any], dict[str, Any]]] = {}
        try:
            with np.load(io.BytesIO(snapshot), allow_pickle=False) as arrays:
                text, name, state = (arrays[key].tobytes() for key in ("scene", "name", "state"))
                for key in arrays.files:
                    if key.startswith("mesh/"):
                        _, body, kind, *rest = key.split("/", 4 if "/block/" in key else 3)
                        points, blocks, regions = meshes.setdefault(int(body), ([], [], {}))
                        if kind == "points":
                            points.append(arrays[key])
                        elif kind == "block":
                            blocks.append((int(rest[0]), rest[1], arrays[key]))
                        else:
                            regions[rest[0]] = arrays[key]
        except Exception as error:
            raise CheckpointError(f"the bytes are not a snapshot of this package, or damaged: {error}") from error
        made = [
            (body, as_mesh((points[0], [(kind, nodes) for _, kind, nodes in sorted(blocks, key=lambda b: b[0])], regions)))
            for body, (points, blocks, regions) in meshes.items()
        ]
        core = _core.Scene.parse(text.decode(), [], made, [], False)
        scene = Scene._of(core, name.decode())
        simulation = cls(scene, threads=threads, potentials=potentials, forces=forces)
        simulation._core.restore(state)
        return simulation

    def __getstate__(self) -> dict[str, Any]:
        return {
            "scene": self.scene,
            "state": self._core.snapshot(),
            "threads": self._threads,
            "terms": self._terms,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        potentials, forces = state["terms"]
        self.__init__(state["scene"], threads=state["threads"], potentials=potentials, forces=forces)  # type: ignore[misc]
        self._core.restore(state["state"])

    def close(self) -> None:
        """Ends the threads and frees the memory. Further use raises ClosedError."""
        self._core.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        t, _, steps, count, _, _ = self._core.clock()
        return f"<Simulation '{self._name}': t = {t:.6g} s, step {steps} of {count}>"

    def _repr_html_(self) -> str:
        from .html import table

        seen = self.observe()
        rows = [(name, f"{getattr(seen, name):.6g} J") for name in ("kinetic", "elastic", "gravity", "load", "total")]
        return table(repr(self)[1:-1], ("energy", ""), rows)


def _terms(kind: str, terms: Terms, names: list[str]) -> list[tuple[int, str, object]]:
    out = []
    for name, given in terms.items():
        if name not in names:
            raise ValueError(f"{kind}s: there is no deformable body '{name}'; there are: {', '.join(names)}")
        many = given if isinstance(given, (list, tuple)) else [given]
        out += [(names.index(name), kind, term) for term in many]
    return out
