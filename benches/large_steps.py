#!/usr/bin/env python3
"""What a larger step costs: processor seconds per simulated second as h grows, for twelve scenes and the implicit schemes.

    cargo build --release
    python benches/large_steps.py [--binary target/release/variational] [--only flag,skirt] [--limit 60]

A step never costs more than its halves, so the seconds fall or stay level along a row, up to the noise of the machine.
Each entry is the processor time of the whole program on one thread over the simulated time, and below it the energy drift
relative to the largest kinetic energy; "cut" counts the steps that were divided. Runs that exceed `--limit` processor seconds are
given up and shown as "> ...". Only the standard library is needed.
"""
import argparse
import json
import os
import resource
import signal
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

P1 = """
gravity = [0.0, -9.81, 0.0]
[time]
end = {end}
step = 1e-3
scheme = "implicit-midpoint"
[[body]]
name = "block"
{mesh}
material = {material}
[[fix]]
body = "block"
box = {{ min = [-1e-9, -1.0, -1.0], max = [1e-9, 1.0, 1.0] }}
[output]
history = 1
"""
SOFT = 'law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, density = 1000.0'
STIFF = SOFT.replace("1e6", "1e10")


def block(n):
    """P1 (docs/performance.md) with n cells across."""
    mesh = f"box = {{ size = [1.0, 0.25, 0.25], cells = [{4 * n}, {n}, {n}] }}"
    return lambda directory: P1.format(end=1.0, mesh=mesh, material=f"{{ {SOFT} }}")


def band_mesh(path):
    """Writes P1 n5 as a mesh with the regions "soft" and, for .3 < x < .5, "band"."""
    cells = (20, 5, 5)
    node = lambda i, j, k: 1 + i + (cells[0] + 1) * (j + (cells[1] + 1) * k)
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '3 1 "soft"', '3 2 "band"', "$EndPhysicalNames"]
    points = [
        (node(i, j, k), i / cells[0], 0.25 * j / cells[1], 0.25 * k / cells[2])
        for k in range(cells[2] + 1) for j in range(cells[1] + 1) for i in range(cells[0] + 1)
    ]
    lines += ["$Nodes", str(len(points)), *("%d %.17g %.17g %.17g" % point for point in points), "$EndNodes"]
    kuhn = [(0, 1, 3, 7), (0, 5, 1, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 6, 4, 7)]
    elements = []
    for k in range(cells[2]):
        for j in range(cells[1]):
            for i in range(cells[0]):
                at = [node(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1)) for c in range(8)]
                region = 2 if 0.3 < (i + 0.5) / cells[0] < 0.5 else 1
                elements += [(region, *(at[c] for c in tet)) for tet in kuhn]
    lines += ["$Elements", str(len(elements))]
    lines += [f"{1 + i} 4 2 {e[0]} {e[0]} {e[1]} {e[2]} {e[3]} {e[4]}" for i, e in enumerate(elements)]
    lines += ["$EndElements", ""]
    path.write_text("\n".join(lines))


def stiff_band(directory):
    """P1 n5 with E x 1e4 for .3 < x < .5."""
    band_mesh(directory / "band.msh")
    material = f'[{{ region = "soft", {SOFT} }}, {{ region = "band", {STIFF} }}]'
    return P1.format(end=1.0, mesh='mesh = "band.msh"', material=material)


def scene(name):
    return lambda directory: ROOT / "scenes" / f"{name}.toml"


# Name: scene, keys to set, simulated time in s, steps in s from short to long.
SCENES = {
    "flag": (scene("flag"), [], 1.0, [2.5e-3, 5e-3, 1e-2, 1 / 60]),
    "skirt": (scene("skirt"), ["body.0.material.young=1e6"], 0.5, [2.5e-3, 5e-3, 1e-2, 1 / 60]),
    "tablecloth": (scene("tablecloth"), [], 0.6, [2.5e-3, 5e-3, 1e-2, 1 / 60]),
    "roll": (scene("roll"), [], 0.1, [2e-4, 5e-4, 1e-3, 2e-3]),
    "strip": (scene("strip"), [], 0.3, [1e-3, 2e-3, 5e-3, 1e-2]),
    "stiff band": (stiff_band, [], 1.0, [2e-3, 5e-3, 1e-2, 2e-2]),
    "tuning fork": (scene("tuning-fork"), [], 2e-3, [1e-5, 2e-5, 5e-5, 1e-4]),
    "blades": (scene("blades"), [], 0.5, [2e-3, 5e-3, 1e-2, 2e-2]),
    "P1 n4": (block(4), [], 1.0, [2e-3, 5e-3, 1e-2, 2e-2]),
    "P1 n8": (block(8), [], 1.0, [2e-3, 5e-3, 1e-2, 2e-2]),
    "P1 n16": (block(16), [], 0.2, [2e-3, 5e-3, 1e-2, 2e-2]),
    "million": (scene("million"), ["output.history=0", "solver.tolerance=1e-10"], 20.0, [1e-3, 2e-3, 5e-3, 1e-2]),
}
SCHEMES = ["implicit-midpoint", "energy-momentum", "backward-euler", "bdf2", "gauss"]


def written(scene, scratch):
    """Returns the path of a scene that is a path or a text, which is written into `scratch`."""
    if not isinstance(scene, str):
        return scene
    path = scratch / "scene.toml"
    path.write_text(scene)
    return path


def options(doc, schemes):
    """Returns the command line of a table."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--binary", default=str(ROOT / "target" / "release" / "variational"))
    parser.add_argument("--only", default="", help="comma-separated beginnings of names of rows or tables")
    parser.add_argument("--schemes", default=",".join(schemes))
    parser.add_argument("--limit", type=float, default=60.0, help="processor seconds after which a run is given up")
    arguments = parser.parse_args()
    arguments.binary = os.path.abspath(arguments.binary)
    arguments.schemes = arguments.schemes.split(",")
    arguments.only = tuple(arguments.only.split(","))
    return arguments


def launch(binary, path, sets, limit, out):
    """Runs a scene on one thread; returns its processor seconds, and a text if it was given up or failed."""
    command = [binary, "run", path, "--out", out, "--threads", "1", "--quiet"]
    for value in sets:
        command += ["--set", value]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    child = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 1)),
    )
    _, said = child.communicate()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if child.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return seconds, f"> {limit:g} s"
    if child.returncode == 2 and "does not" in said:
        return seconds, "refused"
    if child.returncode not in (0, 3):
        return seconds, f"fails: {said.strip().splitlines()[-1][:60]}"
    return seconds, None


def run(binary, path, sets, scheme, step, end, limit, out):
    sets = [*sets, f'time.scheme="{scheme}"', f"time.step={step!r}", f"time.end={end!r}"]
    if scheme == "gauss":
        sets.append("time.stages=2")
    seconds, problem = launch(binary, path, sets, limit, out)
    if problem:
        return f"> {limit / end:.3g}" if problem.startswith(">") else problem
    report = json.loads((Path(out) / "report.json").read_text())
    drift = report["energy"]["relative_drift"]
    cut = report["substeps"]["steps_cut"]
    text = f"{seconds / end:.3g} ({drift:.0e}"
    return text + (f", {cut} cut)" if cut else ")")


def main():
    arguments = options(__doc__, SCHEMES)
    print("| scene | scheme | s per simulated s (energy drift, steps cut), by h from short to long | |||")
    print("|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        scratch = Path(scratch)
        for name, (make, sets, end, steps) in SCENES.items():
            if not name.startswith(arguments.only):
                continue
            path = written(make(scratch), scratch)
            for scheme in arguments.schemes:
                entry = lambda h: run(arguments.binary, path, sets, scheme, h, end, arguments.limit, scratch / "out")
                steps_named = " ".join(f"{1e3 * h:.3g}" for h in steps)
                print(f"| {name}, h = {steps_named} ms | {scheme} | {' | '.join(map(entry, steps))} |", flush=True)


if __name__ == "__main__":
    main()
