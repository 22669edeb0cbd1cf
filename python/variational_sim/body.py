"""Bodies of a simulation, as arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import _core
from ._core import Mesh
from .meshes import VTK_TYPES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from .simulation import Simulation

    Array = NDArray[np.float64]


class Body:
    """A deformable body of a simulation. Arrays are in the numbering of its mesh."""

    __slots__ = ("_index", "_simulation", "name")

    def __init__(self, simulation: Simulation, name: str, index: int) -> None:
        self._simulation = simulation
        self._index = index
        self.name = name

    @property
    def _core(self) -> _core.Simulation:
        return self._simulation._core

    @property
    def mesh(self) -> Mesh:
        """The mesh at rest."""
        return self._core.mesh(self._index)

    @property
    def x(self) -> Array:
        """Positions (n, 3), m. Assign an array to set them; the energy ledger books the change as work of forces.
        Prescribed coordinates stay on their path."""
        return self._core.positions(self._index)

    @x.setter
    def x(self, value: ArrayLike) -> None:
        self._core.set_motion(self._index, _numbers("x", value), None)

    @property
    def v(self) -> Array:
        """Velocities (n, 3), m/s. Assign an array to set them."""
        return self._core.velocities(self._index)

    @v.setter
    def v(self, value: ArrayLike) -> None:
        self._core.set_motion(self._index, None, _numbers("v", value))

    @property
    def u(self) -> Array:
        """Displacements from rest (n, 3), m."""
        u: Array = self.x - self.mesh.points
        return u

    @property
    def a(self) -> Array:
        """Accelerations (n, 3), m/s²."""
        return self._core.accelerations(self._index)

    @property
    def reactions(self) -> Array:
        """Forces at prescribed coordinates (n, 3), N; zero elsewhere."""
        return self._core.reactions(self._index)

    @property
    def external_forces(self) -> Array:
        """Forces of weight, loads and wind (n, 3), N."""
        return self._core.external_forces(self._index)

    def read(self, name: str, out: Array | None = None) -> Array:
        """Returns the array `x`, `v`, `u`, `a`, `reactions` or `external_forces`. With `out`, an array (n, 3) of float64
        such as a part of a larger one, it is written there and `out` is returned."""
        import numpy as np

        if name not in ("x", "v", "u", "a", "reactions", "external_forces"):
            raise ValueError(f"name: there is no array '{name}'; use x, v, u, a, reactions or external_forces")
        found: Array = getattr(self, name)
        if out is None:
            return found
        if not isinstance(out, np.ndarray) or out.shape != found.shape or out.dtype != np.float64:
            kind = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
            raise ValueError(f"out: expected an array of float64 and shape {found.shape}, found {kind}")
        out[...] = found
        return out

    def stress(self, name: str = "stress") -> Array:
        """Returns a field of a solid, one row per element in the order of its cells: the Cauchy `stress` (m, 3, 3), Pa;
        `von_mises` (m,), Pa; the Green–Lagrange `strain` (m, 3, 3); `J` (m,); `energy_density` (m,), J/m³."""
        import numpy as np

        name = "stress" if name == "cauchy" else name
        values, cells = self._core.field(self._index, name)
        rows: Array = values[np.argsort(cells, kind="stable")]
        return rows.reshape(-1, 3, 3) if rows.shape[1] == 9 else rows[:, 0]

    def to_pyvista(self) -> Any:
        """Returns a `pyvista.UnstructuredGrid` with `displacement` and `velocity`. Needs pyvista."""
        import numpy as np

        pv = import_pyvista()
        dimension = self._core.bodies()[self._index][1]
        kinds = {3: ("tet", "hex", "wedge", "pyramid"), 2: ("tri", "quad")}[dimension]
        cells = {
            VTK_TYPES[kind]: nodes for kind, nodes in self.mesh.blocks if kind.startswith(kinds) and len(nodes) > 0
        }
        grid = pv.UnstructuredGrid(cells, np.asarray(self.x))
        grid.field_data["name"] = [self.name]
        grid.point_data["displacement"] = self.u
        grid.point_data["velocity"] = self.v
        return grid

    def __repr__(self) -> str:
        return f"<Body '{self.name}' of {self._simulation!r}>"


def _numbers(name: str, value: ArrayLike) -> Array:
    """Returns an array of float64 in C order with two dimensions."""
    import numpy as np

    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name}: expected real numbers, found dtype {array.dtype}")
    if array.ndim != 2:
        raise ValueError(f"{name}: expected an array of shape (n, 3), found shape {array.shape}")
    return np.ascontiguousarray(array, np.float64)


def import_pyvista() -> Any:
    """Returns the module pyvista."""
    try:
        import pyvista
    except ImportError as error:
        raise ImportError("this needs pyvista: pip install 'variational-sim[view]'") from error
    return pyvista
