#!/usr/bin/env python3
"""Draws frames of a run, warped by the displacement, to a PNG; or a mesh as it stands.

    pip install -r docs/figures/requirements.txt
    python docs/figures/render_frame.py out/cantilever/cantilever.pvd --out beam.png
    python docs/figures/render_frame.py out/fork/fork.pvd --at 0 0.001 --by velocity --exaggerate 200 --rest
    python docs/figures/render_frame.py meshes/bracket.msh --out docs/images/bracket.png

Several times stand side by side, on one colour scale and from one camera. Times are matched to the
nearest frame. Colour is the length of the displacement or velocity.
Needs no display: without one VTK warns of the missing X server and draws through EGL or Mesa.
"""

import argparse
import pathlib
import sys

import numpy as np
import pyvista
from PIL import Image

UNITS = {"displacement": "m", "velocity": "m/s"}
PLAIN, EDGE, INK, REST = "#B9CFE3", "#27384A", "#222222", "#9AA5B1"


def read_mesh(path):
    if path.suffix == ".msh":
        import meshio

        mesh = meshio.read(path)
        mesh.cell_sets = {}  # pyvista wants one entry for each block of cells, which Gmsh's sets lack
        grid = pyvista.from_meshio(mesh)
        cell_dimension = np.array([pyvista.CellType(kind).name for kind in grid.celltypes])
        solid = ~np.isin(cell_dimension, ["VERTEX", "LINE", "QUADRATIC_EDGE"])
        return grid.extract_cells(solid)
    return pyvista.read(path)


def read_frames(path, times):
    """Returns (time, grid) of the frames nearest to `times`; without times, of the last frame."""
    if path.suffix != ".pvd":
        return [(None, read_mesh(path))]
    reader = pyvista.get_reader(path)
    there = np.array(reader.time_values)
    frames = []
    for time in times or [there[-1]]:
        nearest = there[np.argmin(np.abs(there - time))]
        reader.set_active_time_value(nearest)
        blocks = reader.read()
        frames.append((nearest, blocks[0] if len(blocks) == 1 else blocks.combine(merge_points=False)))
    return frames


def label(time, grid):
    """Returns the text above a panel: the frequency of a mode shape, else the time."""
    if "frequency" in grid.field_data:
        return f"{grid.field_data['frequency'][0]:.4g} Hz"
    return f"t = {time:.4g} s"


def surface(grid, exaggerate, field):
    """The outer surface, moved by the displacement, with the field's length as `shown`."""
    skin = grid.extract_surface(algorithm="dataset_surface")
    if "displacement" in skin.point_data:
        skin.points = skin.points + exaggerate * np.asarray(skin.point_data["displacement"])
    if field:
        if field not in skin.point_data:
            sys.exit(f"no point data '{field}' in the frame; there are: {', '.join(skin.point_data) or 'none'}")
        skin.point_data["shown"] = np.linalg.norm(np.asarray(skin.point_data[field], float), axis=1)
    return skin


def main():
    parser = argparse.ArgumentParser(description="Draws frames of a run, or a mesh, to a PNG.")
    parser.add_argument("path", type=pathlib.Path, help=".pvd, .vtu, .vtk or .msh")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("frame.png"))
    parser.add_argument("--at", type=float, nargs="+", default=[], metavar="TIME", help="seconds (default: last frame)")
    parser.add_argument("--by", choices=["displacement", "velocity", "none"], help="colour (default: displacement if there)")
    parser.add_argument("--exaggerate", type=float, default=1.0, help="factor on the displacement")
    parser.add_argument("--rest", action="store_true", help="the rest shape, as a wire frame, too")
    parser.add_argument("--no-edges", action="store_true")
    parser.add_argument("--view", type=float, nargs=3, default=[1.0, -1.4, 0.8], metavar=("X", "Y", "Z"),
                        help="from where the camera looks at the middle")
    parser.add_argument("--up", type=float, nargs=3, default=[0.0, 0.0, 1.0], metavar=("X", "Y", "Z"))
    parser.add_argument("--zoom", type=float, default=1.0)
    parser.add_argument("--size", type=int, nargs=2, default=[1200, 800], metavar=("WIDTH", "HEIGHT"), help="pixels")
    arguments = parser.parse_args()
    if not arguments.path.is_file():
        parser.error(f"{arguments.path} is not there")

    frames = read_frames(arguments.path, arguments.at)
    field = arguments.by or ("displacement" if "displacement" in frames[0][1].point_data else "none")
    field = None if field == "none" else field
    skins = [surface(grid, arguments.exaggerate, field) for _, grid in frames]
    panels = len(frames)
    plotter = pyvista.Plotter(off_screen=True, shape=(1, panels), window_size=arguments.size, border=False)
    plotter.set_background("white")
    look = dict(edge_color=EDGE, line_width=0.6, smooth_shading=False, ambient=0.25)
    if field:
        limit = max(float(skin["shown"].max()) for skin in skins)
        # The line break lifts the title off the numbers.
        bar = dict(title=f"{field}, {UNITS[field]}\n", color=INK, fmt="%.3g", n_labels=3, height=0.09,
                   width=0.4 if panels == 1 else 0.8, position_x=0.3 if panels == 1 else 0.1, position_y=0.02,
                   title_font_size=18, label_font_size=16)
        look |= dict(scalars="shown", cmap="YlGnBu", clim=[0, limit or 1], scalar_bar_args=bar)
    else:
        look |= dict(color=PLAIN)
    for i, ((time, grid), skin) in enumerate(zip(frames, skins)):
        plotter.subplot(0, i)
        if field:
            look["show_scalar_bar"] = i == panels // 2
        plotter.add_mesh(skin, show_edges=not arguments.no_edges, **look)
        if arguments.rest:
            edges = grid.extract_surface(algorithm="dataset_surface").extract_feature_edges(30)
            plotter.add_mesh(edges, color=REST, line_width=1.5)
        if panels > 1:
            plotter.add_text(label(time, grid), font_size=11, color=INK, position="upper_edge")
    points = np.concatenate([skin.points for skin in skins]).astype(float)
    for panel in range(panels):
        plotter.subplot(0, panel)
        frame_camera(plotter, points, arguments, panels, room=0.16 if field else 0.0)
    plotter.enable_anti_aliasing("ssaa")
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    picture = Image.fromarray(plotter.screenshot(return_img=True))
    if not field:
        picture = picture.quantize(256)  # shades of one colour: a palette halves the file and shows no bands
    picture.save(arguments.out, optimize=True)
    print(arguments.out)


def frame_camera(plotter, points, arguments, panels, room):
    """Parallel projection that fits all points into the panel, less `room` of its height at the bottom."""
    toward = np.array(arguments.view) / np.linalg.norm(arguments.view)
    right = np.cross(arguments.up, toward)
    if np.linalg.norm(right) < 1e-9 * np.linalg.norm(arguments.up):
        sys.exit("--view and --up are parallel")
    right /= np.linalg.norm(right)
    up = np.cross(toward, right)
    on_screen = points @ np.column_stack([right, up, toward])
    low, high = on_screen.min(axis=0), on_screen.max(axis=0)
    width, height, depth = high - low
    aspect = arguments.size[0] / panels / arguments.size[1]
    scale = 1.08 * max(height / (1 - room), width / aspect) / arguments.zoom / 2
    focus = (low + high) / 2 - np.array([0, room * scale, 0])
    middle = focus @ np.vstack([right, up, toward])
    camera = plotter.camera
    camera.focal_point, camera.up = middle, up
    camera.position = middle + (depth + 4 * scale) * toward
    camera.parallel_projection, camera.parallel_scale = True, scale
    camera.clipping_range = (scale, 2 * depth + 8 * scale)


if __name__ == "__main__":
    main()
