#!/usr/bin/env python3
"""Reads the output directory of a run with pyvista (and meshio) and holds it against history.csv.

    pip install -r tests/python/requirements.txt
    python tests/python/check_outputs.py out/cantilever [--meshio] [--allow-no-probe]

Checked: history.csv and report.json are whole and finite; every frame the .pvd lists opens, is finite,
and has the same points at rest and the same cells; at every frame time that has a row in history.csv
the displacement of each probe's node equals the row's: to the bit in f64 frames, to 1e-6 relative in
f32 frames. --meshio reads every frame a second time with meshio (which knows the base64 variant only)
and wants the same numbers. One line per check; exit code 0 if all hold, 1 if one does not or a file of the
run is not there.
"""

import argparse
import csv
import json
import math
import pathlib
import sys
import xml.etree.ElementTree as xml

import numpy as np
import pyvista
from pyvista.core.errors import VTKExecutionError

CONSERVED = ["t", "kinetic", "elastic", "gravity", "total", "px", "py", "pz", "lx", "ly", "lz"]
AXES = "xyz"
F32_TOLERANCE = 1e-6
F32_SMALLEST = float(np.finfo(np.float32).tiny)  # below it f32 has no relative accuracy to speak of
TIME_TOLERANCE = 1e-9  # of the length of the run: a frame and a row are of the same step


class Missing(Exception):
    """A file that a run writes is not there: nothing to check."""


class Report:
    def __init__(self):
        self.failed = 0

    def check(self, holds, what, detail=""):
        self.failed += not holds
        print(f"{'ok  ' if holds else 'FAIL'}  {what}{': ' + detail if detail else ''}")
        return holds


def read_history(path, report):
    """The columns of history.csv as arrays, by name."""
    if not path.is_file():
        raise Missing(f"{path} is not there")
    with path.open(newline="") as file:
        header, *lines = csv.reader(file)
    report.check(header[: len(CONSERVED)] == CONSERVED, "history.csv: columns", ",".join(header))
    ragged = [number for number, line in enumerate(lines, 2) if len(line) != len(header)]
    if not report.check(bool(lines) and not ragged, "history.csv: rows",
                        f"{len(lines)}" + (f", wrong length in lines {ragged[:5]}" if ragged else "")):
        return {}
    values = np.array(lines, dtype=float)
    bad = np.argwhere(~np.isfinite(values))
    report.check(len(bad) == 0, "history.csv: finite",
                 "" if len(bad) == 0 else f"line {bad[0][0] + 2}, column {header[bad[0][1]]}")
    times = values[:, header.index("t")] if "t" in header else np.zeros(0)
    report.check(bool(np.all(np.diff(times) > 0)), "history.csv: time grows")
    return dict(zip(header, values.T))


def check_report(path, report):
    if not path.is_file():
        raise Missing(f"{path} is not there")

    def refuse(constant):
        raise ValueError(f"{constant} is not JSON")

    try:
        value = json.loads(path.read_text(), parse_constant=refuse)
        report.check(isinstance(value, dict) and bool(value), "report.json: an object")
    except ValueError as error:
        report.check(False, "report.json: valid JSON", str(error))


def probes_in(history):
    """Names that have all of .x .y .z .ux .uy .uz among the columns."""
    names = [column[: -len(".ux")] for column in history if column.endswith(".ux")]
    return [n for n in names if all(f"{n}.{p}{a}" in history for p in ("", "u") for a in AXES)]


def columns(history, probe, kind):
    return np.column_stack([history[f"{probe}.{kind}{axis}"] for axis in AXES])


def series_in(directory):
    found = sorted(directory.glob("*.pvd"))
    if len(found) != 1:
        raise Missing(f"{directory} holds {len(found)} .pvd files, one expected")
    return found[0]


def read_frame(reader, time):
    """The frame as one grid. VTK by itself logs an error and goes on with what it has; here it raises."""
    reader.set_active_time_value(time)
    with pyvista.VtkErrorCatcher(raise_errors=True):
        blocks = reader.read()
    return blocks[0] if len(blocks) == 1 else blocks.combine(merge_points=False)


def not_finite(frame):
    """The first array of the frame with a NaN or an infinity in it, or None."""
    arrays = {"points": frame.points}
    for kind, data in [("point", frame.point_data), ("cell", frame.cell_data)]:
        arrays |= {f"{kind} data '{name}'": np.asarray(data[name]) for name in data}
    for name, values in arrays.items():
        if values.dtype.kind == "f" and not np.all(np.isfinite(values)):
            return name
    return None


def disagreement(found, expected):
    """max |found - expected| over what the precision of `found` allows: 1 is the limit. f64: 0 or inf."""
    if found.dtype == np.float64:
        return 0.0 if np.array_equal(found, expected) else math.inf
    allowed = F32_TOLERANCE * np.abs(expected) + F32_SMALLEST
    return float(np.max(np.abs(found.astype(float) - expected) / allowed))


def nodes_at(points, place):
    """Nodes of the frame at a rest position: more than one where bodies touch."""
    span = np.linalg.norm(np.ptp(points, axis=0)) + np.max(np.abs(points))
    distance = np.linalg.norm(points.astype(float) - place, axis=1)
    return np.flatnonzero(distance <= F32_TOLERANCE * span)


def check_meshio(path, frame, report):
    import meshio

    try:
        other = meshio.read(path)
    except Exception as error:  # whatever meshio throws on a file it cannot read is the finding
        report.check(False, f"meshio: {path.name}", f"{type(error).__name__}: {error}")
        return
    same = np.array_equal(other.points, frame.points) and all(
        name in other.point_data and np.array_equal(other.point_data[name], frame.point_data[name])
        for name in frame.point_data
    )
    report.check(same, f"meshio: {path.name}", f"points and {len(frame.point_data)} point fields equal pyvista's")


def check_frames(directory, history, report, with_meshio, allow_no_probe):
    series = series_in(directory)
    listed = [entry.get("file") for entry in xml.parse(series).iter("DataSet")]
    absent = [name for name in listed if not (series.parent / name).is_file()]
    if not report.check(bool(listed) and not absent, f"{series.name}: files",
                        f"{absent[:5]} not there" if absent else f"{len(listed)}"):
        return
    reader = pyvista.get_reader(series)
    frame_times = list(reader.time_values)
    report.check(all(a < b for a, b in zip(frame_times, frame_times[1:])), f"{series.name}: time grows",
                 f"{len(frame_times)} frames")

    probes = probes_in(history)
    report.check(bool(probes) or allow_no_probe, "probes", ", ".join(probes) or "none in history.csv")
    rest = {p: (columns(history, p, "") - columns(history, p, "u"))[0] for p in probes}
    worst = {probe: 0.0 for probe in probes}
    compared = 0
    first = None
    for time in frame_times:
        where = f"frame t = {time:.9g}"
        try:
            frame = read_frame(reader, time)
        except VTKExecutionError as error:
            report.check(False, where, f"VTK cannot read it: {error}".replace("\n", " "))
            continue
        if frame.n_points == 0 or "displacement" not in frame.point_data:
            report.check(False, where, "no points" if frame.n_points == 0 else "no 'displacement'")
            continue
        first = frame if first is None else first
        wrong = not_finite(frame)
        same = np.array_equal(frame.points, first.points) and np.array_equal(frame.cells, first.cells)
        report.check(wrong is None and same, where,
                     f"{wrong} is not finite" if wrong else
                     "points at rest or cells differ from the first frame's" if not same else
                     f"{frame.n_points} points, {frame.n_cells} cells, finite")
        if with_meshio:
            for part in reader.active_datasets:
                check_meshio(series.parent / part.path, frame, report)

        row = int(np.argmin(np.abs(history["t"] - time)))
        if abs(history["t"][row] - time) > TIME_TOLERANCE * max(history["t"][-1], abs(time)):
            continue
        compared += 1
        displacement = np.asarray(frame.point_data["displacement"])
        for probe in probes:
            expected = columns(history, probe, "u")[row]
            nodes = nodes_at(frame.points, rest[probe])
            worst[probe] = max(
                worst[probe], min((disagreement(displacement[n], expected) for n in nodes), default=math.inf)
            )
    if probes:
        report.check(compared > 0, "frames with a row in history.csv", f"{compared} of {len(frame_times)}")
    for probe in probes:
        report.check(worst[probe] <= 1, f"probe {probe}: displacement equals history.csv",
                     f"worst difference {worst[probe]:.3g} of what the frames' precision allows")


def main():
    parser = argparse.ArgumentParser(description="Holds a run's frames against its history.csv.")
    parser.add_argument("directory", type=pathlib.Path)
    parser.add_argument("--meshio", action="store_true", help="read every frame with meshio, too")
    parser.add_argument("--allow-no-probe", action="store_true", help="the scene has no probe")
    arguments = parser.parse_args()
    report = Report()
    try:
        history = read_history(arguments.directory / "history.csv", report)
        check_report(arguments.directory / "report.json", report)
        if "t" in history:
            check_frames(arguments.directory, history, report, arguments.meshio, arguments.allow_no_probe)
    except Missing as error:
        print(f"FAIL  {error}", file=sys.stderr)
        return 1
    print(f"{report.failed} checks failed" if report.failed else "all checks hold")
    return 1 if report.failed else 0


if __name__ == "__main__":
    sys.exit(main())
