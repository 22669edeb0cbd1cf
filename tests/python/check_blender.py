#!/usr/bin/env python3
"""Blender shows the point caches of a run as docs/files.md says: check_blender.py DIRECTORY FORMAT BODY PROBE POINT

Imports <scene>.BODY.obj, adds a Mesh Cache modifier with its file of FORMAT (pc2 or mdd), and compares point number POINT at every frame of
the timeline with the columns PROBE.x, PROBE.y, PROBE.z of history.csv at the same time. Needs the package bpy.
"""

import csv
import pathlib
import sys

import bpy

directory, kind, body, probe, point = pathlib.Path(sys.argv[1]), *sys.argv[2:5], int(sys.argv[5])
rate = 50
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = rate
[cache] = directory.glob(f"*.{body}.{kind}")
bpy.ops.wm.obj_import(filepath=str(cache.with_suffix(".obj")), forward_axis="Y", up_axis="Z")
[thing] = bpy.context.selected_objects
modifier = thing.modifiers.new("cache", "MESH_CACHE")
modifier.cache_format = kind.upper()
modifier.filepath = str(cache)
modifier.time_mode = "FRAME"
modifier.play_mode = "SCENE"
modifier.frame_start = 1
modifier.interpolation = "NONE"
# Its settings for axes stay as they are.
rows = list(csv.DictReader((directory / "history.csv").open()))
compared = 0
for row in rows:
    frame = float(row["t"]) * rate
    if abs(frame - round(frame)) > 1e-6:
        continue
    scene.frame_set(1 + round(frame))
    shown = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    x = shown.matrix_world @ shown.data.vertices[point].co
    expected = [float(row[f"{probe}.{axis}"]) for axis in "xyz"]
    error = max(abs(a - b) for a, b in zip(x, expected))
    if error > 1e-6 * max(1, max(map(abs, expected))):
        sys.exit(f"{body} at t = {row['t']}: {tuple(x)} is shown, {expected} is in history.csv")
    compared += 1
if compared < 3:
    sys.exit("fewer than three frames were compared")
if "--textured" in sys.argv and not thing.data.uv_layers:
    sys.exit(f"{body} has no texture coordinates")
print(f"{body}: {compared} frames are shown as they were computed")
