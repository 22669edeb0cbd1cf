#!/usr/bin/env python3
"""The cost of contact of cloth: a folded cloth with and without contact, and a stack of layers.

    cargo build --release
    python benches/layers.py folded [--cells 200] [--steps 300] [--binary target/release/variational]
    python benches/layers.py stack [--layers 50] [--cells 69] [--steps 20] [--step 5e-3] [--friction 0.3]
        [--threads 2]

`folded`: a cloth of 1 m x 1 m in four layers, 4 mm apart, falls with .5 m/s on itself and on a floor by `stormer-verlet`; processor
time per step with the table `[contact]` and without. `stack`: square cloths of 1 m, 1.2 mm apart, on a floor, by
`backward-euler` or `--scheme`; time per step, iterations and peak memory per triangle. Times are those of the whole
program minus those of a run of one step. Only the standard library is needed.
"""
import argparse
import json
import math
import os
import resource
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CLOTH = ('material = { law = "st-venant-kirchhoff", young = 1e5, poisson = 0.3, area_density = 0.2, '
         'thickness = 1e-3 }')
FRICTION = 0.3


def contact(friction=FRICTION):
    return f"[contact]\nfriction = {friction:g}\n"


def floor(height):
    return f"""
[[rigid]]
name = "floor"
shape = {{ kind = "plane", normal = [0, 0, 1] }}
position = [0, 0, {height:g}]
fixed = true
"""


def accordion(path, cells, layers=4, apart=4e-3):
    """Writes a cloth in layers that are joined by half circles; arc length is kept, so that the cloth is not strained."""
    turn = 0.5 * math.pi * apart
    flat = (1.0 - (layers - 1) * turn) / layers

    def place(s):
        layer = min(int(s / (flat + turn)), layers - 1)
        s -= layer * (flat + turn)
        sign = 1.0 if layer % 2 == 0 else -1.0
        start = 0.0 if layer % 2 == 0 else flat
        if s <= flat:
            return start + sign * s, layer * apart
        angle = (s - flat) / (0.5 * apart)
        return start + sign * (flat + 0.5 * apart * math.sin(angle)), (layer + 0.5 - 0.5 * math.cos(angle)) * apart

    lines = []
    for i in range(cells + 1):
        x, z = place(i / cells)
        lines += [f"v {x!r} {j / cells!r} {z!r}" for j in range(cells + 1)]
    for i in range(cells):
        for j in range(cells):
            a = 1 + i * (cells + 1) + j
            b, c, d = a + cells + 1, a + cells + 2, a + 1
            lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    path.write_text("\n".join(lines) + "\n")


def folded(cells, step):
    text = f"""
gravity = [0.0, 0.0, -9.81]
[time]
end = 1.0
step = {step:g}
scheme = "stormer-verlet"
[output]
history = 0
[[body]]
name = "cloth"
mesh = "folded.obj"
velocity = [0.0, 0.0, -0.5]
{CLOTH}
"""
    return text + contact() + floor(-2e-3), text


def stack(layers, cells, step, scheme, friction):
    text = f"""
gravity = [0.0, 0.0, -9.81]
[time]
end = 10.0
step = {step:g}
scheme = "{scheme}"
[output]
history = 0
"""
    text += contact(friction) + floor(0.0)
    for layer in range(layers):
        shift = 3e-3 * (layer % 7)
        text += f"""
[[body]]
name = "layer {layer}"
sheet = {{ size = [1.0, 1.0], cells = [{cells}, {cells}], origin = [{shift:g}, {-shift:g}, {1.2e-3 * (layer + 1):g}] }}
{CLOTH}
"""
    return text


def run(binary, directory, text, steps, step, threads):
    """Returns processor time, wall time (s), peak memory (bytes) and report of a run."""
    scene = directory / "scene.toml"
    scene.write_text(text)
    out = directory / "out"
    command = [binary, "run", str(scene), "--out", str(out), "--quiet", "--threads", str(threads),
               "--set", f"time.end={steps * step:.17g}"]
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.Popen(command, cwd=directory, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    if status:
        raise SystemExit(f"failed: {' '.join(command)}")
    report = json.loads((out / "report.json").read_text())
    return usage.ru_utime + usage.ru_stime, wall, 1024 * usage.ru_maxrss, report


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", choices=["folded", "stack"])
    parser.add_argument("--binary", default=str(ROOT / "target" / "release" / "variational"))
    parser.add_argument("--cells", type=int)
    parser.add_argument("--layers", type=int, default=50)
    parser.add_argument("--steps", type=int)
    parser.add_argument("--step", type=float)
    parser.add_argument("--scheme", default="backward-euler")
    parser.add_argument("--friction", type=float, default=FRICTION, help="coefficient of friction of `stack`")
    parser.add_argument("--threads", type=int)
    options = parser.parse_args()
    binary = os.path.abspath(options.binary)
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        if options.scene == "folded":
            cells, steps = options.cells or 200, options.steps or 300
            step = options.step or 8e-3 / cells
            accordion(directory / "folded.obj", cells)
            costs = []
            for text in folded(cells, step):
                short = run(binary, directory, text, 1, step, options.threads or 1)
                long = run(binary, directory, text, 1 + steps, step, options.threads or 1)
                costs.append((long[0] - short[0]) / steps)
                work = long[3]["work"]
                print(f"{2 * cells * cells} triangles: {1e3 * costs[-1]:.2f} ms per step, {work['searches']} searches, "
                      f"{work['newton_iterations']} iterations, {work['pair_forces']} pair forces, "
                      f"{work['path_checks']} path checks in {steps} steps, {long[2] / 1e6:.0f} MB", flush=True)
            print(f"contact costs {costs[0] / costs[1] - 1:.2f} of the contact-free step")
        else:
            cells, steps, step = options.cells or 69, options.steps or 20, options.step or 5e-3
            text = stack(options.layers, cells, step, options.scheme, options.friction)
            threads = options.threads or 2
            short = run(binary, directory, text, 1, step, threads)
            long = run(binary, directory, text, 1 + steps, step, threads)
            count, work = 2 * options.layers * cells * cells, long[3]["work"]
            print(f"{count} triangles, one step: {short[0]:.1f} s, wall {short[1]:.1f} s; then per step "
                  f"{(long[0] - short[0]) / steps:.2f} s, wall {(long[1] - short[1]) / steps:.2f} s, "
                  f"{work['newton_iterations'] / (1 + steps):.1f} iterations, {work['searches']} searches; "
                  f"{long[2] / count:.0f} bytes per triangle")


if __name__ == "__main__":
    main()
