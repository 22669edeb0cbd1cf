"""Pictures, films and an interactive view of runs, with pyvista. The commands `variational view`, `picture` and `movie`
use this module. Needs `pip install 'variational-sim[view]'`."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from .body import import_pyvista
from .run import Run, load
from .simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

GEOMETRY = (".usdc", ".usda", ".usd", ".vtkhdf")
"""Endings of files that hold geometry instead of pixels."""

LIGHTING = "three lights"
"""Lights in front of and behind the camera: with the default, sheets are dark where they face away from it."""


def frames_of(source: Run | str | os.PathLike[str]) -> Run:
    """Returns a run that has frames."""
    run = source if isinstance(source, Run) else load(source)
    if len(run.frames) == 0:
        raise ValueError(f"{run.directory}: the run has no frames: set output.fps in the scene")
    return run


def picture(
    source: Run | Simulation | str | os.PathLike[str],
    path: str | os.PathLike[str] | None = None,
    *,
    frame: int = -1,
    scalars: str | None = "displacement",
    size: tuple[int, int] = (1024, 768),
) -> Any:
    """Draws a simulation, or one frame of a run or its directory, without a display.

    `scalars` names the field that colours the bodies, of vectors their length; `size` is width and height in pixels.
    Writes the file `path` (.png, .jpg), or returns the pixels (height, width, 3) without it.
    """
    if isinstance(source, Simulation):
        grids, time, up = [body.to_pyvista() for body in source], source.t, _up(source.scene.to_dict())
    else:
        run = frames_of(source)
        frames, up = run.frames, _up(run.report["scene"])
        if not -len(frames) <= frame < len(frames):
            raise ValueError(f"frame: there are {len(frames)} frames, numbered from 0; {frame} is not one of them")
        grids, time = [frames[frame].to_pyvista()], frames[frame].t
    limits = _limits(grids, scalars)
    with _plotter(size) as plotter:
        for grid in grids:
            _add(plotter, grid, scalars, limits)
        _finish(plotter, time, up)
        pixels = plotter.screenshot(None if path is None else os.fspath(path), return_img=True)
    return pixels if path is None else None


def movie(
    source: Run | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    fps: float = 25.0,
    scalars: str | None = "displacement",
    size: tuple[int, int] = (1024, 768),
) -> None:
    """Draws all frames of a run, or of its directory, into a film (.mp4, .gif), without a display.

    The film shows `fps` frames of the run per second. Camera and colours fit all frames.
    """
    run = frames_of(source)
    frames, up = run.frames, _up(run.report["scene"])
    text = os.fspath(path)
    if not text.endswith((".gif", ".mp4")):
        raise ValueError(f"{text}: films are .mp4 or .gif; `write_usd` and `write_vtkhdf` write geometry")
    # Two passes: a film is often larger than the memory.
    bounds: Sequence[float] | None = None
    limits: Sequence[float] | None = None
    for frame in frames:
        grid = frame.to_pyvista()
        bounds = _joined(bounds, grid.bounds)
        limits = _joined(limits, _limits([grid], scalars))
    # Encoders of .mp4 need even numbers of pixels.
    with _plotter([length - length % 2 for length in size]) as plotter:
        if text.endswith(".gif"):
            plotter.open_gif(text, fps=round(fps))
        else:
            try:
                plotter.open_movie(text, framerate=round(fps), macro_block_size=2)
            except ImportError as error:
                raise ImportError("films need imageio-ffmpeg: pip install 'variational-sim[view]'") from error
        for frame in frames:
            _add(plotter, frame.to_pyvista(), scalars, limits)
            _finish(plotter, frame.t, up, bounds)
            plotter.write_frame()


def view(source: Run | Simulation | str | os.PathLike[str], *, scalars: str | None = "displacement") -> Any:
    """Shows a run with a slider over its frames, or a simulation; in a notebook inside the cell."""
    plotter = import_pyvista().Plotter(lighting=LIGHTING)
    if isinstance(source, Simulation):
        grids = [body.to_pyvista() for body in source]
        limits = _limits(grids, scalars)
        for grid in grids:
            _add(plotter, grid, scalars, limits)
        _finish(plotter, source.t, _up(source.scene.to_dict()))
        return plotter.show()
    run = frames_of(source)
    common: Sequence[float] | None = None
    up = _up(run.report["scene"])
    for frame in run.frames:
        common = _joined(common, _limits([frame.to_pyvista()], scalars))

    def show(value: float) -> None:
        frame = run.frames[round(value)]
        _add(plotter, frame.to_pyvista(), scalars, common)
        _finish(plotter, frame.t, up)

    if len(run.frames) > 1:
        last = len(run.frames) - 1
        plotter.add_slider_widget(show, [0, last], value=0, title="frame", fmt="%.0f", style="modern")
    else:
        show(0)
    return plotter.show(title=run.name)


@contextmanager
def _plotter(size: Sequence[int]) -> Iterator[Any]:
    """Opens a plotter that needs no display."""
    pv = import_pyvista()
    from vtkmodules.vtkCommonCore import vtkLogger

    # VTK looks for a display first, and warns where there is none.
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting=LIGHTING)
    try:
        yield plotter
    finally:
        plotter.close()
        vtkLogger.SetStderrVerbosity(before)


def _add(plotter: Any, grid: Any, scalars: str | None, limits: Sequence[float] | None) -> None:
    """Adds a body, or replaces it if there is one of this name."""
    name = None if scalars not in grid.array_names else scalars
    plotter.add_mesh(
        grid,
        scalars=name,
        clim=None if name is None or limits is None else list(limits),
        color=None if name else "lightsteelblue",
        show_edges=grid.n_cells < 20_000,
        edge_color="gray",
        edge_opacity=0.3,
        ambient=0.3,
        name=str(grid.field_data["name"][0]) if "name" in grid.field_data else "frame",
        reset_camera=False,
        scalar_bar_args=dict(
            title=None if name is None else _title(name), n_labels=2, fmt="%.3g", vertical=False, title_font_size=18, label_font_size=16
        ),
    )


UNITS = {
    "displacement": "m",
    "velocity": "m/s",
    "acceleration": "m/s²",
    "external_force": "N",
    "reaction_force": "N",
    "stress": "Pa",
    "von_mises": "Pa",
    "energy_density": "J/m³",
}
"""Units of fields; the others are numbers."""


def _title(field: str) -> str:
    unit = UNITS.get(field.removeprefix("nodal_"))
    return field if unit is None else f"{field} ({unit})"


def _up(scene: Any) -> int:
    """Returns the axis (0, 1, 2) along which gravity acts; z without gravity."""
    gravity = scene.get("gravity") or [0.0, 0.0, 0.0]
    return max((2, 1, 0), key=lambda axis: abs(gravity[axis]))


def _finish(plotter: Any, time: float, up: int, bounds: Sequence[float] | None = None) -> None:
    """Adds axes and the time, and looks at these bounds (default: everything) from all three positive axes, with the
    axis `up` upwards, unless the camera has been set."""
    if not plotter.renderer.camera_set:
        plotter.camera_position = "iso"
        plotter.camera.up = [float(axis == up) for axis in range(3)]
        plotter.reset_camera(bounds=bounds)
    plotter.add_axes()
    plotter.add_text(f"t = {time:.3f} s", name="time", font_size=12)


def _limits(grids: list[Any], scalars: str | None) -> tuple[float, float] | None:
    """Returns the smallest and the largest value of a field, of vectors their length."""
    import numpy as np

    found = [np.asarray(grid[scalars]) for grid in grids if scalars in grid.array_names]
    values = [np.linalg.norm(array, axis=1) if array.ndim == 2 else array for array in found]
    return (min(map(np.min, values)), max(map(np.max, values))) if values else None


def _joined(a: Sequence[float] | None, b: Sequence[float] | None) -> tuple[float, ...] | None:
    """Returns the intervals (min, max, min, max …) that hold those of both."""
    if a is None or b is None:
        return tuple(a or b or ()) or None
    return tuple(min(x, y) if k % 2 == 0 else max(x, y) for k, (x, y) in enumerate(zip(a, b)))


def _size(text: str) -> tuple[int, int]:
    from argparse import ArgumentTypeError

    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) > 0 and int(height) > 0):
        raise ArgumentTypeError(f"write it as WIDTHxHEIGHT, e.g. 1024x768, not {text!r}")
    return int(width), int(height)


def main(arguments: list[str]) -> int:
    """Does what a command of the program asks; returns its exit code."""
    from argparse import ArgumentParser

    from .errors import Error

    parser = ArgumentParser(prog="variational", usage="variational view|picture|movie DIRECTORY [OPTIONS]")
    parser.add_argument("command", choices=["view", "picture", "movie"])
    parser.add_argument("directory")
    parser.add_argument("file", nargs="?")
    parser.add_argument("--frame", type=int, default=-1)
    parser.add_argument("--fps", type=float, default=25.0)
    parser.add_argument("--scalars", default="displacement")
    parser.add_argument("--size", type=_size, default=(1024, 768))
    given = parser.parse_args(arguments)
    scalars = None if given.scalars == "none" else given.scalars
    try:
        if given.command == "view":
            view(given.directory, scalars=scalars)
        elif given.command == "picture":
            picture(given.directory, given.file, frame=given.frame, scalars=scalars, size=given.size)
        elif given.file.endswith(GEOMETRY):
            from .usd import write_usd
            from .vtkhdf import write_vtkhdf

            if given.file.endswith(".vtkhdf"):
                write_vtkhdf(given.directory, given.file)
            else:
                write_usd(given.directory, given.file, fps=given.fps)
        else:
            movie(given.directory, given.file, fps=given.fps, scalars=scalars, size=given.size)
    except (Error, ValueError, ImportError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2 if isinstance(error, (Error, ValueError)) else 5
    return 0
