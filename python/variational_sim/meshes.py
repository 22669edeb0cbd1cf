"""Meshes from arrays and from the objects of other libraries."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ._core import Mesh

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# VTK's cell types and meshio's names of the kinds of cells.
_VTK = {
    1: "point", 3: "line2", 21: "line3", 5: "tri3", 22: "tri6", 9: "quad4", 23: "quad8", 28: "quad9",
    10: "tet4", 24: "tet10", 12: "hex8", 25: "hex20", 29: "hex27", 13: "wedge6", 26: "wedge15", 14: "pyramid5",
}  # fmt: skip
_MESHIO = {
    "vertex": "point", "line": "line2", "triangle": "tri3", "triangle6": "tri6", "quad": "quad4",
    "tetra": "tet4", "tetra10": "tet10", "hexahedron": "hex8", "hexahedron20": "hex20",
    "hexahedron27": "hex27", "wedge": "wedge6", "wedge15": "wedge15", "pyramid": "pyramid5",
}  # fmt: skip
VTK_TYPES = {name: number for number, name in _VTK.items()}


def mesh(
    points: ArrayLike,
    cells: Mapping[str, ArrayLike] | Sequence[tuple[str, ArrayLike]],
    regions: Mapping[str, ArrayLike] | None = None,
) -> Mesh:
    """Makes a mesh from arrays.

    `points` (n, 3), m. `cells` gives the nodes (m, nodes per cell) of each kind in VTK's order, such as
    `{"tet4": …, "tri3": …}`. `regions` names sets of cells of one dimension; cells are numbered from 0 through all
    kinds, in the order given.

    Raises ValueError for wrong shapes, nodes out of range, and mirrored or flat cells.
    """
    import numpy as np

    given = cells.items() if isinstance(cells, Mapping) else cells
    blocks = [(kind, np.ascontiguousarray(nodes, np.int64)) for kind, nodes in given]
    for kind, nodes in blocks:
        if nodes.ndim != 2:
            raise ValueError(f"cells: {kind} needs an array of two dimensions, found shape {nodes.shape}")
    place = np.ascontiguousarray(points, np.float64)
    if place.ndim != 2:
        raise ValueError(f"points: expected shape (n, 3), found {place.shape}")
    named = [(name, np.asarray(numbers).tolist()) for name, numbers in (regions or {}).items()]
    return Mesh(place, blocks, named)


def as_mesh(value: Any) -> Mesh:
    """Takes a mesh, a pyvista data set, a meshio mesh, or `(points, cells[, regions])`."""
    if isinstance(value, Mesh):
        return value
    if isinstance(value, tuple) and len(value) in (2, 3):
        return mesh(*value)
    if hasattr(value, "cast_to_unstructured_grid"):
        return _from_pyvista(value.cast_to_unstructured_grid())
    if hasattr(value, "points") and hasattr(value, "cells"):
        return _from_meshio(value)
    raise TypeError(
        "a mesh is a path, a pyvista data set, a meshio mesh, variational_sim.mesh(…) or (points, cells, regions), "
        f"not {type(value).__name__}"
    )


def write_mesh(mesh: Mesh, path: str | os.PathLike[str]) -> None:
    """Writes a mesh with its regions as a .vtu file, from which scenes, ParaView and pyvista read the same numbers."""
    from xml.sax.saxutils import quoteattr

    import numpy as np

    if not os.fspath(path).endswith(".vtu"):
        raise ValueError(f"path: a mesh is written as .vtu, not {os.fspath(path)}")

    def array(name: str, kind: str, values: Any, columns: int = 1) -> str:
        text = " ".join(map(repr, np.asarray(values).ravel().tolist()))
        head = f'<DataArray type="{kind}" Name={quoteattr(name)} NumberOfComponents="{columns}" format="ascii">'
        return f"{head}{text}</DataArray>"

    nodes = [nodes for _, nodes in mesh.blocks]
    sizes = np.concatenate([np.full(len(block), block.shape[1]) for block in nodes])
    types = np.concatenate([np.full(len(block), VTK_TYPES[kind]) for kind, block in mesh.blocks])
    marks = {name: np.isin(np.arange(len(sizes)), cells).astype(int) for name, cells in mesh.regions.items()}
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="UnstructuredGrid" version="1.0"><UnstructuredGrid>',
        f'<Piece NumberOfPoints="{len(mesh.points)}" NumberOfCells="{len(sizes)}">',
        f"<Points>{array('Points', 'Float64', mesh.points, 3)}</Points>",
        "<Cells>",
        array("connectivity", "Int64", np.concatenate([block.ravel() for block in nodes])),
        array("offsets", "Int64", np.cumsum(sizes)),
        array("types", "UInt8", types),
        "</Cells>",
        "<CellData>",
        *(array(f"group:{name}", "Int64", values) for name, values in marks.items()),
        "</CellData>",
        "</Piece></UnstructuredGrid></VTKFile>",
    ]
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


def _from_pyvista(grid: Any) -> Mesh:
    blocks = []
    for number, nodes in grid.cells_dict.items():
        if int(number) not in _VTK:
            raise ValueError(f"mesh: cells of VTK type {number} are not supported")
        blocks.append((_VTK[int(number)], nodes))
    return mesh(grid.points, blocks)


def _from_meshio(value: Any) -> Mesh:
    import numpy as np

    blocks, first, starts = [], 0, []
    for block in value.cells:
        if block.type not in _MESHIO:
            raise ValueError(f"mesh: cells of type {block.type} are not supported")
        blocks.append((_MESHIO[block.type], block.data))
        starts.append(first)
        first += len(block.data)
    regions = {}
    for name, sets in getattr(value, "cell_sets", {}).items():
        parts = [
            start + np.asarray(cells, np.int64)
            for start, cells in zip(starts, sets)
            if cells is not None and len(cells) > 0
        ]
        if parts and not name.startswith("gmsh:"):
            regions[name] = np.concatenate(parts)
    return mesh(_in_space(value.points), blocks, regions)


def _in_space(points: Any) -> Any:
    import numpy as np

    points = np.asarray(points, np.float64)
    missing = 3 - points.shape[1]
    return np.pad(points, ((0, 0), (0, missing))) if missing > 0 else points
