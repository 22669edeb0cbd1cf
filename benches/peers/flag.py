"""A hanging flag against MuJoCo's 2-D flex: run time against energy error, as a Markdown table.

`flag.py [--cells 40] [--young 1e5] [--end 2.0] [--turns 4] [--binary target/release/variational]`

The sheet: 1 x 1 m, n x n cells of two triangles, 0.2 kg/m^2, nu = 0.3, 1 mm thick, without bending stiffness,
held along one edge and dropped from horizontal, without damping. MuJoCo's flex of dimension 2 with
`elastic2d="stretch"` has the elastic force of St. Venant-Kirchhoff's law in plane stress (the line "force
difference" compares the two); its nodes get our lumped masses, collision and constraints are off, and all
steps between two samples go in one call of its C library.

Both programs use one thread. The time is the processor's, MuJoCo's while stepping, ours of the whole program; the error is the largest
|E - E(0)| over 100 samples, over the largest weight's work, with E of both computed here by one formula.
"""
import argparse
import os
import pathlib
import resource
import subprocess
import tempfile
import time

import numpy as np

POISSON, THICKNESS, DENSITY, G, SAMPLES = 0.3, 1e-3, 0.2, 9.81, 100


class Flag:
    """Mesh, lumped mass, energy and elastic force."""

    def __init__(self, cells, young):
        i, j = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1))
        self.points = np.stack([i.ravel() / cells, j.ravel() / cells, 0.0 * i.ravel()], axis=1)
        node = lambda a, b: (a + (cells + 1) * b).ravel()
        i, j = np.meshgrid(np.arange(cells), np.arange(cells))
        a, b, c, d = node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)
        self.triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
        edges = self.points[self.triangles[:, 1:], :2] - self.points[self.triangles[:, :1], :2]
        self.inverse = np.linalg.inv(edges.transpose(0, 2, 1))
        area = 0.5 * np.abs(np.linalg.det(edges))
        self.volume = THICKNESS * area
        self.mass = np.bincount(self.triangles.ravel(), np.repeat(DENSITY * area / 3, 3))
        self.fixed = np.flatnonzero(self.points[:, 0] == 0.0)
        self.free = np.flatnonzero(self.points[:, 0] != 0.0)
        self.edge = np.flatnonzero(self.points[:, 0] == 1.0)
        self.shortest, self.cells, self.young = 1.0 / cells, cells, young
        self.lam, self.mu = young * POISSON / (1 - POISSON**2), young / (2 * (1 + POISSON))

    def scene(self, time_keys, tail):
        return sheet_scene(self.cells, self.young, time_keys, tail)

    def strain(self, x):
        edges = (x[self.triangles[:, 1:]] - x[self.triangles[:, :1]]).transpose(0, 2, 1)
        f = edges @ self.inverse
        return f, 0.5 * (f.transpose(0, 2, 1) @ f - np.eye(2))

    def elastic(self, x):
        _, e = self.strain(x)
        trace = np.trace(e, axis1=1, axis2=2)
        return (self.volume * (self.mu * (e * e).sum(axis=(1, 2)) + 0.5 * self.lam * trace**2)).sum()

    def force(self, x):
        f, e = self.strain(x)
        stress = 2 * self.mu * e + self.lam * np.trace(e, axis1=1, axis2=2)[:, None, None] * np.eye(2)
        sides = (self.volume[:, None, None] * f @ stress @ self.inverse.transpose(0, 2, 1)).transpose(0, 2, 1)
        out = np.zeros_like(x)
        np.add.at(out, self.triangles[:, 1:], -sides)
        np.add.at(out, self.triangles[:, 0], sides.sum(axis=1))
        return out

    def energies(self, x, v):
        weight = G * (self.mass * x[:, 2]).sum()
        return self.elastic(x) + weight + 0.5 * (self.mass[:, None] * v * v).sum(), weight


def judge(energies):
    total, weight = np.array(energies).T
    return float(np.abs(total - total[0]).max() / np.abs(weight - weight[0]).max())


def mujoco_model(flag, young, integrator, step):
    import mujoco

    words = lambda array: " ".join(f"{value:.17g}" for value in array.ravel())
    spec = f"""<mujoco>
      <option gravity="0 0 -{G}" jacobian="sparse" integrator="{integrator}" timestep="{step:.17g}">
        <flag contact="disable" constraint="disable" sensor="disable"/>
      </option>
      <size memory="4G"/>
      <worldbody>
        <flexcomp name="flag" type="direct" dim="2" radius="1e-4" mass="{DENSITY}"
            point="{words(flag.points)}" element="{words(flag.triangles)}">
          <contact contype="0" conaffinity="0" selfcollide="none"/>
          <edge equality="false"/>
          <elasticity young="{young}" poisson="{POISSON}" thickness="{THICKNESS}" elastic2d="stretch" damping="0"/>
          <pin id="{words(flag.fixed)}"/>
        </flexcomp>
      </worldbody>
    </mujoco>"""
    model = mujoco.MjModel.from_xml_string(spec)
    bodies = model.flex_vertbodyid[flag.free]
    model.body_mass[bodies] = flag.mass[flag.free]
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetData(model, data)
    return mujoco, model, data, model.body_dofadr[bodies][:, None] + np.arange(3)


def force_difference(flag, young):
    """The largest difference of MuJoCo's elastic force from ours, over the largest force."""
    mujoco, model, data, dofs = mujoco_model(flag, young, "Euler", 1e-3)
    u = np.zeros(flag.points.shape)
    u[flag.free] = 0.05 * np.sin(7 * flag.points[flag.free] + np.array([0, 1, 2]))
    data.qpos[dofs] = u[flag.free]
    mujoco.mj_forward(model, data)
    ours = flag.force(flag.points + u)[flag.free]
    return float(np.abs(data.qfrc_passive[dofs] - ours).max() / np.abs(ours).max())


def run_mujoco(flag, young, integrator, steps, end):
    per_sample = -(-steps // SAMPLES)
    step = end / (per_sample * SAMPLES)
    mujoco, model, data, dofs = mujoco_model(flag, young, integrator, step)
    x, v = flag.points.copy(), np.zeros_like(flag.points)
    energies, seconds = [flag.energies(x, v)], 0.0
    for sample in range(SAMPLES):
        start = time.process_time()
        mujoco.mj_step(model, data, per_sample)
        seconds += time.process_time() - start
        x[flag.free] = flag.points[flag.free] + data.qpos[dofs]
        v[flag.free] = data.qvel[dofs]
        if integrator == "Euler":
            # Its velocities are half a step off positions; half a kick makes them meet.
            mujoco.mj_forward(model, data)
            v[flag.free] += 0.5 * step * data.qacc[dofs]
        energies.append(flag.energies(x, v))
        if abs(data.time - (sample + 1) * per_sample * step) > 1e-6:  # MuJoCo resets a run that blows up
            return step, float("nan"), seconds
    return step, judge(energies), seconds


def cloth_scene(shape, held, young, time_keys, tail):
    """Returns our scene of a cloth, from the keys of its shape, of its held nodes and of its time table, and what follows."""
    return f"""
gravity = [0.0, 0.0, -{G}]
[time]
{time_keys}
[[body]]
name = "flag"
{shape}
material = {{ law = "st-venant-kirchhoff", young = {young!r}, poisson = {POISSON}, area_density = {DENSITY}, thickness = {THICKNESS}, bending = "none" }}
[[fix]]
body = "flag"
{held}
{tail}"""


def sheet_scene(cells, young, time_keys, tail):
    """Returns our scene of the sheet."""
    shape = f"sheet = {{ size = [1.0, 1.0], cells = [{cells}, {cells}] }}"
    return cloth_scene(shape, 'region = "x-min"', young, time_keys, tail)


def run_scene(binary, scene):
    """Runs a scene on one thread; returns the processor seconds of the program and history.csv, `None` if it failed."""
    with tempfile.TemporaryDirectory() as directory:
        path, out = pathlib.Path(directory, "flag.toml"), pathlib.Path(directory, "out")
        path.write_text(scene)
        command = [binary, "run", str(path), "--out", str(out), "--threads", "1", "--quiet"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "NO_COLOR": "1"})
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        if done.returncode:
            print(done.stderr)
            return float("nan"), None
        return seconds, np.genfromtxt(out / "history.csv", delimiter=",", names=True)


def run_ours(binary, cells, young, scheme, steps, end):
    per_sample = -(-steps // SAMPLES)
    step = end / (per_sample * SAMPLES)
    keys = f'end = {end}\nstep = {step!r}\nscheme = "{scheme}"'
    seconds, rows = run_scene(binary, sheet_scene(cells, young, keys, f"[output]\nhistory = {per_sample}"))
    error = float("nan") if rows is None else judge(np.stack([rows["total"], rows["gravity"]], 1))
    return step, error, seconds


def options(doc, cells, end, more=()):
    """Returns the options of a comparison and its sheet; `more` are further options with the keys of argparse."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=cells)
    parser.add_argument("--young", type=float, default=1e5)
    parser.add_argument("--end", type=float, default=end)
    parser.add_argument("--binary", default="target/release/variational")
    for name, keys in more:
        parser.add_argument(name, **keys)
    arguments = parser.parse_args()
    arguments.binary = str(pathlib.Path(arguments.binary).absolute())
    os.chdir(tempfile.mkdtemp())  # MuJoCo writes its log where it runs
    return arguments, Flag(arguments.cells, arguments.young)


def main():
    turns = ("--turns", dict(type=int, default=4, help="how often steps are halved, 1 to 4"))
    arguments, flag = options(__doc__, 40, 2.0, [turns])
    # Steps that keep explicit schemes stable: h = 0.4 of the time a wave takes across half a cell.
    speed = (arguments.young * THICKNESS / DENSITY / (1 - POISSON**2)) ** 0.5
    base = int(np.ceil(arguments.end * speed * arguments.cells / 0.2))
    import mujoco

    difference = force_difference(flag, arguments.young)
    print(f"{arguments.cells} x {arguments.cells} cells, E = {arguments.young:g} Pa, {arguments.end} s; MuJoCo "
          f"{mujoco.__version__}, force difference {difference:.1e}\n")
    print("| program | scheme | step, s | energy error | processor s |\n|---|---|---|---|---|")
    runs = {"MuJoCo": [], "variational": []}

    def enter(program, scheme, run):
        step, error, seconds = run
        print(f"| {program} | {scheme} | {step:.2e} | {error:.2e} | {seconds:.2f} |", flush=True)
        runs[program].append((seconds, error, f"{scheme}, {step:.1e} s, {error:.1e}"))

    peers = {"Euler": (0.5, 1, 2, 4), "RK4": (0.5, 1, 2), "discrete": (1 / 16, 1 / 4)}
    ours = {"stormer-verlet": (0.5, 1, 2, 4), "blanes-moan-4": (0.25, 0.5, 1)}
    for turn in range(arguments.turns):
        for integrator, factors in peers.items():
            if turn < len(factors):
                steps = int(base * factors[turn])
                enter("MuJoCo", integrator, run_mujoco(flag, arguments.young, integrator, steps, arguments.end))
        for scheme, factors in ours.items():
            if turn < len(factors):
                steps = int(base * factors[turn])
                enter("variational", scheme,
                      run_ours(arguments.binary, arguments.cells, arguments.young, scheme, steps, arguments.end))
    print("\n| energy error | variational | MuJoCo | ratio |\n|---|---|---|---|")
    for level in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        best = {name: min((run for run in list_ if run[1] <= level), default=None) for name, list_ in runs.items()}
        cell = lambda run: f"{run[0]:.2f} s ({run[2]})" if run else "not reached"
        ratio = f"{best['MuJoCo'][0] / best['variational'][0]:.1f}" if all(best.values()) else ""
        print(f"| {level:.0e} | {cell(best['variational'])} | {cell(best['MuJoCo'])} | {ratio} |")


if __name__ == "__main__":
    main()
