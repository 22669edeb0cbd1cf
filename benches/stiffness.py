#!/usr/bin/env python3
"""Newton iterations per step as stiffness grows: within a body, of a sheet, and with the slenderness of a solid.

    cargo build --release
    python benches/stiffness.py [--binary target/release/variational] [--only band,sheet] [--limit 60]

Each entry is the mean number of iterations and of factorisations per solve, then the energy drift relative to the largest kinetic
energy, and how many of 50 steps were divided, e.g. because the scheme's own error was too large. Runs that exceed `--limit` processor
seconds are given up and shown as "> ...". Only the standard library is needed.
"""
import json
import tempfile
from pathlib import Path

from large_steps import P1, ROOT, SOFT, band_mesh, launch, options, written

STEP = 5e-3
SCHEMES = ["implicit-midpoint", "energy-momentum", "backward-euler"]


def band(ratio):
    """P1 n5 with E x ratio for .3 < x < .5 (docs/performance.md)."""
    def make(directory):
        band_mesh(directory / "band.msh")
        stiff = SOFT.replace("1e6", f"{1e6 * ratio:g}")
        material = f'[{{ region = "soft", {SOFT} }}, {{ region = "band", {stiff} }}]'
        return P1.format(end=1.0, mesh='mesh = "band.msh"', material=material), []
    return make


def sheet(young):
    """The flag of scenes/flag.toml with 20 x 20 cells."""
    text = (ROOT / "scenes" / "flag.toml").read_text().replace("cells = [40, 40]", "cells = [20, 20]")
    return lambda directory: (text, [f"body.0.material.young={young:g}", "output.history=1"])


def plate(thickness):
    """A clamped plate of 1 x .25 m whose cells become flat: 16 x 4 x 2 cells, E = 1e8 Pa; it hangs down if it is thin."""
    def make(directory):
        mesh = f"box = {{ size = [1.0, {thickness:g}, 0.25], cells = [16, 2, 4] }}"
        return P1.format(end=1.0, mesh=mesh, material=f"{{ {SOFT.replace('1e6', '1e8')} }}"), []
    return make


def compressed(young, relaxed="false"):
    """A membrane without bending stiffness whose ends come together by 10 %; as a tension field if `relaxed`."""
    text = f"""
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.5
step = 1e-3
scheme = "implicit-midpoint"
[[body]]
name = "membrane"
sheet = {{ size = [1.0, 1.0], cells = [20, 20] }}
material = {{ law = "st-venant-kirchhoff", young = {young:g}, poisson = 0.3, area_density = 0.2, thickness = 1e-3, tension_field = {relaxed} }}
[[fix]]
body = "membrane"
region = "x-min"
[[fix]]
body = "membrane"
region = "x-max"
motion = {{ kind = "translate", velocity = [-0.5, 0.0, 0.0], end = 0.2 }}
[output]
history = 1
"""
    return lambda directory: (text, [])


# Name: scenes by growing stiffness, and simulated time in s.
SERIES = {
    "band, E ratio": ({ratio: band(ratio) for ratio in (1, 1e2, 1e4, 1e6, 1e8)}, 0.25),
    "sheet, E (Pa)": ({young: sheet(young) for young in (1e5, 1e6, 1e7, 1e8, 1e9)}, 0.25),
    "compressed membrane, E (Pa)": ({young: compressed(young) for young in (1e5, 1e6, 1e7, 1e8, 1e9)}, 0.25),
    "tension field, E (Pa)": ({young: compressed(young, "true") for young in (1e5, 1e6, 1e7, 1e8, 1e9)}, 0.25),
    "plate, thickness (m)": ({size: plate(size) for size in (0.25, 0.1, 0.03, 0.01, 0.003, 0.001)}, 0.25),
}


def entry(binary, path, sets, scheme, end, limit, out):
    sets = [*sets, f'time.scheme="{scheme}"', f"time.step={STEP!r}", f"time.end={end!r}"]
    _, problem = launch(binary, path, sets, limit, out)
    if problem:
        return problem
    report = json.loads((Path(out) / "report.json").read_text())
    work = report["work"]
    steps = work["steps"]
    cut = report["substeps"]["steps_cut"]
    text = f"{work['newton_iterations'] / steps:.1f}, {work['factorizations'] / steps:.2f}"
    text += f" ({report['energy']['relative_drift']:.0e}"
    return text + (f", {cut} cut)" if cut else ")")


def main():
    arguments = options(__doc__, SCHEMES)
    with tempfile.TemporaryDirectory() as scratch:
        scratch = Path(scratch)
        for name, (scenes, end) in SERIES.items():
            if not name.startswith(arguments.only):
                continue
            print(f"\n| {name} | " + " | ".join(f"{value:g}" for value in scenes) + " |")
            print("|---|" + "---|" * len(scenes), flush=True)
            for scheme in arguments.schemes:
                row = []
                for make in scenes.values():
                    text, sets = make(scratch)
                    path = written(text, scratch)
                    row.append(entry(arguments.binary, path, sets, scheme, end, arguments.limit, scratch / "out"))
                print(f"| {scheme} | {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
