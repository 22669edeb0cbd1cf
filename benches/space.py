#!/usr/bin/env python3
"""Error in space and time together against run time, for each element: which is the cheapest way to 1 % and .1 %?

    cargo build --release
    python benches/space.py [--binary target/release/variational] [--threads 1] [--quick] [--json space.json]

P1: a block 1 x 0.25 x 0.25 m of St. Venant-Kirchhoff material, E = 1e6 Pa, nu = 0.3, 1000 kg/m3, clamped at
x = 0, under its weight from rest to 1 s. Error is max over t = .05, .1 ... 1 s of |u - u_ref| of the middle of the
free end, over the largest |u_ref|. The reference is hex27 on a mesh finer than all that are measured, by Gauss of
4th order; its own error is shown as its distance from a coarser mesh. Seconds are those that the processor gave
to the whole run on one thread, user and system, so that other load of the machine hardly counts: the least of the
repeats, of which runs beyond half a minute have one. Only the standard library is needed.
"""
import argparse
import csv
import json
import os
import subprocess
import tempfile
from pathlib import Path

SCENE = """
gravity = [0.0, -9.81, 0.0]
[time]
end = 1.0
step = {step!r}
scheme = "{scheme}"
{stages}
[solver]
tolerance = {tolerance}
[[body]]
name = "beam"
box = {{ size = [1.0, 0.25, 0.25], cells = [{along}, {across}, {across}], element = "{element}" }}
material = {{ law = "st-venant-kirchhoff", young = 1e6, poisson = 0.3, density = 1000.0 }}
{cure}
[[fix]]
body = "beam"
region = "x-min"
[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.125, 0.125]
[output]
history = {history}
"""

# Cells across; 4 times as many along. Even numbers, so that the middle of the end is a node of linear meshes.
MESHES = {
    "tet4": [4, 8, 16],
    "hex8": [2, 4, 8],
    "hex8 mean-dilation": [2, 4, 8],
    "tet10": [1, 2, 3],
    "hex20": [1, 2, 3],
    "hex27": [1, 2, 3],
}
QUICK = {name: meshes[:2] for name, meshes in MESHES.items()}
# (scheme, stages, steps); explicit ones find their own steps.
IMPLICIT = [("implicit-midpoint", None, 40), ("implicit-midpoint", None, 100), ("implicit-midpoint", None, 200),
            ("gauss", 2, 20), ("gauss", 2, 40)]
TARGETS = [1e-2, 1e-3]
TIMES = 20


class Program:
    def __init__(self, binary, threads, directory):
        self.binary, self.threads, self.directory = binary, threads, directory

    def call(self, *arguments):
        return subprocess.run([self.binary, *arguments], capture_output=True, text=True)

    def run(self, element, across, scheme, stages, steps, tolerance=1e-6):
        """The tip at TIMES times, and the seconds of stepping; None where the run fails."""
        scene, out = self.directory / "space.toml", self.directory / "out"
        scene.write_text(self.text(element, across, scheme, stages, steps, tolerance))
        command = [self.binary, "run", str(scene), "--out", str(out), "--quiet", "--threads", str(self.threads)]
        child = os.posix_spawn(self.binary, command, os.environ)
        _, status, usage = os.wait4(child, 0)
        if status != 0:
            return None
        with open(out / "history.csv") as file:
            rows = list(csv.DictReader(file))[1:]
        tip = [[float(row[f"tip.u{axis}"]) for axis in "xyz"] for row in rows]
        return tip, usage.ru_utime + usage.ru_stime

    def text(self, element, across, scheme, stages, steps, tolerance):
        name, *cure = element.split()
        return SCENE.format(
            step=1.0 / steps, scheme=scheme, stages=f"stages = {stages}" if stages else "", tolerance=tolerance,
            along=4 * across, across=across, element=name, history=steps // TIMES,
            cure=f'locking = "{cure[0]}"' if cure else "",
        )

    def stable_steps(self, element, across, scheme, of_limit):
        """Steps of an explicit scheme at this share of its limit, a multiple of TIMES."""
        scene = self.directory / "space.toml"
        scene.write_text(self.text(element, across, scheme, None, 1000, 1e-6))
        said = self.call("info", str(scene)).stdout
        limit = next(float(line.split()[3]) for line in said.splitlines() if line.startswith("explicit step limit"))
        return TIMES * (int(1.0 / (of_limit * limit) / TIMES) + 1)


def distance(a, b):
    norm = lambda u: sum(value * value for value in u) ** 0.5
    return max(norm([p - q for p, q in zip(u, v)]) for u, v in zip(a, b)) / max(norm(v) for v in b)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--binary", default="target/release/variational")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeat", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="coarse meshes only: minutes")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        program = Program(arguments.binary, arguments.threads, Path(directory))
        finest = 3 if arguments.quick else 8
        coarse = finest - 1 if arguments.quick else finest - 2
        reference, _ = program.run("hex27", finest, "gauss", 2, 100, 1e-9)
        coarser, _ = program.run("hex27", coarse, "gauss", 2, 100, 1e-9)
        sharper, _ = program.run("hex27", 2, "gauss", 2, 200, 1e-9)
        blunter, _ = program.run("hex27", 2, "gauss", 2, 100, 1e-9)
        print(f"Reference: hex27, {4 * finest} x {finest} x {finest} cells, gauss 2 with h = 1/100; distance from "
              f"{coarse} cells across {distance(coarser, reference):.1e}, from half the step "
              f"{distance(blunter, sharper):.1e}.\n")
        print("| element | cells across | scheme | steps | error | seconds |\n|---|---|---|---|---|---|")
        rows = []
        for element, meshes in (QUICK if arguments.quick else MESHES).items():
            for across in meshes:
                choices = list(IMPLICIT)
                for scheme, share in [("stormer-verlet", 0.9), ("blanes-moan-4", 0.9)]:
                    choices.append((scheme, None, program.stable_steps(element, across, scheme, share)))
                for scheme, stages, steps in choices:
                    runs = []
                    while len(runs) < (1 if runs and runs[0] and runs[0][1] > 30.0 else arguments.repeat):
                        runs.append(program.run(element, across, scheme, stages, steps))
                    if None in runs:
                        continue
                    row = dict(element=element, across=across, scheme=f"{scheme} {stages or ''}".strip(), steps=steps,
                               error=distance(runs[0][0], reference), seconds=min(run[1] for run in runs))
                    rows.append(row)
                    print(f"| {element} | {across} | {row['scheme']} | {steps} | {row['error']:.2e} | {row['seconds']:.3f} |",
                          flush=True)
        print("\n| element | " + " | ".join(f"to {100 * target:g} %" for target in TARGETS) + " |")
        print("|---|" + "---|" * len(TARGETS))
        for element in MESHES:
            cells = []
            for target in TARGETS:
                good = [row for row in rows if row["element"] == element and row["error"] <= target]
                best = min(good, key=lambda row: row["seconds"], default=None)
                least = min((row["error"] for row in rows if row["element"] == element), default=float("nan"))
                cells.append(f"{best['seconds']:.3f} s ({best['across']} across, {best['scheme']}, {best['steps']} steps)"
                             if best else f"not reached (least {least:.1e})")
            print(f"| {element} | " + " | ".join(cells) + " |")
        if arguments.json:
            arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
