"""Pictures, films and an interactive view of runs, with pyvista.

    python -m variational_sim.view out/flag                 # a window with a slider over the frames
    python -m variational_sim.view out/flag picture.png     # the last frame, also without a display
    python -m variational_sim.view out/flag film.mp4
"""

from __future__ import annotations

import os
import sys
from typing import Any

from .run import Run, load
from .body import import_pyvista
from .simulation import Simulation


def frames_of(source: Run | str | os.PathLike[str]) -> Run:
    """Returns a run that has frames."""
    run = source if isinstance(source, Run) else load(source)
    if len(run.frames) == 0:
        raise ValueError(f"{run.directory}: the run has no frames: set output.fps in the scene")
    return run


def _scene(source: Run | Simulation | str | os.PathLike[str], frame: int) -> list[Any]:
    """Returns the meshes to show."""
    if isinstance(source, Simulation):
        return [body.to_pyvista() for body in source]
    return [frames_of(source).frames[frame].to_pyvista()]


def picture(
    source: Run | Simulation | str | os.PathLike[str],
    path: str | os.PathLike[str] | None = None,
    *,
    frame: int = -1,
    scalars: str | None = "displacement",
    size: tuple[int, int] = (1024, 768),
) -> Any:
    """Draws a simulation, or one frame of a run or its directory, without a display.

    Writes the file `path` (.png, .jpg), or returns the pixels (height, width, 3) without it.
    """
    plotter = import_pyvista().Plotter(off_screen=True, window_size=list(size))
    for grid in _scene(source, frame):
        plotter.add_mesh(grid, scalars=_named(grid, scalars), show_edges=True)
    plotter.add_axes()
    pixels = plotter.screenshot(None if path is None else os.fspath(path), return_img=True)
    plotter.close()
    return pixels if path is None else None


def movie(
    source: Run | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    fps: float = 25.0,
    scalars: str | None = "displacement",
    size: tuple[int, int] = (1024, 768),
) -> None:
    """Draws all frames of a run into a film (.mp4, which needs imageio-ffmpeg, or .gif), without a display."""
    run = frames_of(source)
    plotter = import_pyvista().Plotter(off_screen=True, window_size=list(size))
    text = os.fspath(path)
    if text.endswith(".gif"):
        plotter.open_gif(text, fps=round(fps))
    else:
        plotter.open_movie(text, framerate=round(fps))
    for number, frame in enumerate(run.frames):
        grid = frame.to_pyvista()
        plotter.add_mesh(grid, scalars=_named(grid, scalars), name="body", reset_camera=number == 0)
        plotter.add_text(f"{frame.t:.3f} s", name="time", font_size=12)
        plotter.write_frame()
    plotter.close()


def view(source: Run | Simulation | str | os.PathLike[str], *, scalars: str | None = "displacement") -> Any:
    """Shows a run with a slider over its frames, or a simulation; in a notebook inside the cell."""
    plotter = import_pyvista().Plotter()
    if isinstance(source, Simulation):
        for grid in _scene(source, -1):
            plotter.add_mesh(grid, scalars=_named(grid, scalars), show_edges=True)
        return plotter.show()
    run = frames_of(source)

    def show(value: float) -> None:
        grid = run.frames[round(value)].to_pyvista()
        plotter.add_mesh(grid, scalars=_named(grid, scalars), name="body")

    if len(run.frames) > 1:
        plotter.add_slider_widget(show, [0, len(run.frames) - 1], value=0, title="frame", fmt="%.0f")
    else:
        show(0)
    return plotter.show()


def _named(grid: Any, scalars: str | None) -> str | None:
    return scalars if scalars in grid.array_names else None


def main(arguments: list[str]) -> int:
    """Shows the run in a directory, or draws it into a file."""
    if len(arguments) not in (1, 2):
        print(__doc__, file=sys.stderr)
        return 2
    if len(arguments) == 1:
        view(arguments[0])
    elif arguments[1].endswith((".png", ".jpg")):
        picture(arguments[0], arguments[1])
    else:
        movie(*arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
