"""Films as VTKHDF, one file that ParaView and VTK read. Needs `pip install 'variational-sim[vtkhdf]'`."""

from __future__ import annotations

import os
from typing import Any

from .run import Run
from .view import frames_of


def write_vtkhdf(source: Run | str | os.PathLike[str], path: str | os.PathLike[str]) -> None:
    """Writes all frames of a run into one file (.vtkhdf): the cells once, positions (m) and all fields by time (s).

    The format is VTKHDF 2.0, UnstructuredGrid (docs.vtk.org, "VTK HDF File Formats").
    """
    try:
        import h5py
    except ImportError as error:
        raise ImportError("this needs h5py: pip install 'variational-sim[vtkhdf]'") from error
    import numpy as np

    frames = frames_of(source).frames
    count = len(frames)
    with h5py.File(os.fspath(path), "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0])
        kind = b"UnstructuredGrid"
        root.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = count
        steps["Values"] = [frame.t for frame in frames]
        for number, frame in enumerate(frames):
            grid = frame.to_pyvista()
            arrays = {
                ("PointData", name): np.asarray(grid.point_data[name]) for name in grid.point_data
            } | {("CellData", name): np.asarray(grid.cell_data[name]) for name in grid.cell_data}
            if number == 0:
                points, cells = grid.n_points, grid.n_cells
                for name, value in [
                    ("NumberOfPoints", points),
                    ("NumberOfCells", cells),
                    ("NumberOfConnectivityIds", len(grid.cell_connectivity)),
                ]:
                    root[name] = np.full(count, value)
                # pyvista 0.49 has renamed `offset`.
                offsets = grid.cell_offsets if hasattr(grid, "cell_offsets") else grid.offset
                root["Connectivity"], root["Offsets"] = grid.cell_connectivity, offsets
                root["Types"] = grid.celltypes
                _space(root, "Points", np.asarray(grid.points), count)
                # Each step is one part, whose cells are those of the first.
                for name in ("PartOffsets", "CellOffsets", "ConnectivityIdOffsets"):
                    steps[name] = np.zeros(count if name == "PartOffsets" else (count, 1), np.int64)
                steps["NumberOfParts"] = np.ones(count, np.int64)
                steps["PointOffsets"] = np.arange(count) * points
                for (kind_of, name), array in arrays.items():
                    _space(root.require_group(kind_of), name, array, count)
                    starts = steps.require_group(f"{kind_of}Offsets")
                    starts[name] = np.arange(count) * len(array)
            _put(root["Points"], np.asarray(grid.points), number)
            for (kind_of, name), array in arrays.items():
                _put(root[kind_of][name], array, number)


def _space(group: Any, name: str, array: Any, count: int) -> None:
    """Makes a compressed data set for an array at `count` times."""
    shape = (count * len(array), *array.shape[1:])
    options = dict(chunks=array.shape, compression="gzip", compression_opts=4, shuffle=True) if len(array) else {}
    group.create_dataset(name, shape, array.dtype, **options)


def _put(data: Any, array: Any, number: int) -> None:
    data[number * len(array) : (number + 1) * len(array)] = array
