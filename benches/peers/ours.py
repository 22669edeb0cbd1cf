"""P1 by `variational`, through its command line, as a user runs it."""
import json
import os
import resource
import subprocess
from pathlib import Path

import meshio
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(os.environ.get("VARIATIONAL", ROOT / "target" / "release" / "variational"))

SCENE = """
gravity = [0.0, -9.81, 0.0]
[time]
end = {end!r}
step = {step!r}
scheme = "{scheme}"
{stages}
[[body]]
name = "block"
box = {{ size = [1.0, 0.25, 0.25], cells = [{cells}, {n}, {n}] }}
material = {{ law = "{law}", young = 1e6, poisson = 0.3, density = 1000.0 }}
[[fix]]
body = "block"
box = {{ min = [-1e-9, -1.0, -1.0], max = [1e-9, 1.0, 1.0] }}
[solver]
tolerance = {tolerance!r}
{mass}
[output]
interval = {end!r}
history = 0
fields = ["displacement"]
precision = "f64"
encoding = "base64"
"""


class Failed(RuntimeError):
    """The program ended with another exit code than 0; its last words are the message."""


def _run(directory, n, law, scheme, steps, threads, tolerance, end):
    # The second word of a setting is the number of stages, or the mass.
    scheme, _, stages = scheme.partition(" ")
    mass, stages = (f'mass = "{stages}"', "") if stages == "filtered" else ("", stages)
    text = SCENE.format(
        end=end, step=1.0 / steps, scheme=scheme, stages=f"stages = {stages}" if stages else "",
        cells=4 * n, n=n, law=law, tolerance=tolerance, mass=mass,
    )
    scene, out = directory / "p1.toml", directory / "out"
    scene.write_text(text)
    command = [PROGRAM, "run", scene, "--out", out, "--threads", str(threads), "--quiet"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise Failed(f"exit code {done.returncode}: {done.stderr.strip()[-300:]}")
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return out, json.loads((out / "report.json").read_text()), cpu


def run(directory, n, law, scheme, steps, threads=1, tolerance=1e-5):
    """Displacements at T, processor seconds of stepping (those of the whole program less those of a
    run of one step, so that set-up and output drop out), wall seconds of stepping, work counts."""
    setup = min(_run(directory, n, law, scheme, steps, threads, tolerance, 1.0 / steps)[2] for _ in range(2))
    out, report, cpu = _run(directory, n, law, scheme, steps, threads, tolerance, 1.0)
    last = sorted(out.glob("*.vtu"))[-1]
    u = meshio.read(last).point_data["displacement"]
    return np.asarray(u), max(cpu - setup, 0.0), report["stepping_seconds"], report["work"]
