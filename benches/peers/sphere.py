"""A cloth on a sphere compared with MuJoCo's flex: run time against energy error.

`sphere.py [--cells 20] [--young 1e5] [--end 0.5] [--binary target/release/variational] [--quick]`

The sheet of `flag.py` with 2 cm of air above a fixed sphere of radius 0.3 m falls on it, without friction (MuJoCo's `ipc`
has none), with self-contact in ours and where MuJoCo supports it. One thread; the time is the processor's, MuJoCo's while stepping, ours of the
whole program. The error is the largest |E - E(0)| over 50 samples, over the largest kinetic energy, with E of MuJoCo
computed here (elastic energy, weight, kinetic energy), without the energy in contact forces.
"""
import time

import numpy as np
from flag import DENSITY, G, POISSON, THICKNESS, options, run_scene

RADIUS, HEIGHT, SAMPLES = 0.3, 0.02, 50


def run_ours(arguments, count):
    scene = f"""
gravity = [0.0, 0.0, -{G}]
[time]
end = {arguments.end!r}
step = {arguments.end / count!r}
scheme = "stormer-verlet"
[contact]
[[body]]
name = "cloth"
sheet = {{ size = [1.0, 1.0], cells = [{arguments.cells}, {arguments.cells}], origin = [-0.5, -0.5, {HEIGHT}] }}
material = {{ law = "st-venant-kirchhoff", young = {arguments.young!r}, poisson = {POISSON}, area_density = {DENSITY}, thickness = {THICKNESS}, bending = "none" }}
[[rigid]]
name = "ball"
shape = {{ kind = "sphere", radius = {RADIUS} }}
position = [0.0, 0.0, {-RADIUS}]
fixed = true
[output]
history = {count // SAMPLES}
"""
    seconds, rows = run_scene(arguments.binary, scene)
    if rows is None:
        return seconds, float("nan")
    return seconds, np.abs(rows["total"] - rows["total"][0]).max() / rows["kinetic"].max()


def run_mujoco(arguments, flag, integrator, count, ipc):
    import mujoco

    words = lambda array: " ".join(f"{value:.17g}" for value in array.ravel())
    points = flag.points + np.array([-0.5, -0.5, HEIGHT])
    flags = '<flag ipc="enable"/>' if ipc else ""
    spec = f"""<mujoco>
      <option gravity="0 0 -{G}" jacobian="sparse" integrator="{integrator}" timestep="{arguments.end / count:.17g}">{flags}</option>
      <size memory="4G"/>
      <worldbody>
        <geom type="sphere" size="{RADIUS}" pos="0 0 {-RADIUS}" friction="0 0 0" condim="1"/>
        <flexcomp name="flag" type="direct" dim="2" radius="{0.5 * THICKNESS}" mass="{DENSITY}"
            point="{words(points)}" element="{words(flag.triangles)}">
          <contact selfcollide="auto" condim="1" friction="0 0 0"/>
          <edge equality="false"/>
          <elasticity young="{arguments.young}" poisson="{POISSON}" thickness="{THICKNESS}" elastic2d="stretch" damping="0"/>
        </flexcomp>
      </worldbody>
    </mujoco>"""
    model = mujoco.MjModel.from_xml_string(spec)
    bodies = model.flex_vertbodyid
    model.body_mass[bodies] = flag.mass
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetData(model, data)
    dofs = model.body_dofadr[bodies][:, None] + np.arange(3)
    energies, kinetic, seconds = [flag.energies(points, np.zeros_like(points))[0]], [], 0.0
    per_sample = max(1, count // SAMPLES)
    for _ in range(count // per_sample):
        start = time.process_time()
        mujoco.mj_step(model, data, per_sample)
        seconds += time.process_time() - start
        x, v = points + data.qpos[dofs], data.qvel[dofs]
        energies.append(flag.energies(x, v)[0])
        kinetic.append(0.5 * (flag.mass[:, None] * v * v).sum())
        if seconds > arguments.limit:
            return seconds, float("nan")
    energies = np.array(energies)
    return seconds, np.abs(energies - energies[0]).max() / max(kinetic)


def main():
    limit = ("--limit", dict(type=float, default=300.0, help="processor seconds after which MuJoCo is given up"))
    quick = ("--quick", dict(action="store_true", help="only the longest step of each"))
    arguments, flag = options(__doc__, 20, 0.5, [limit, quick])
    print("| program | scheme | step, s | processor s | energy error |\n|---|---|--:|--:|--:|")

    def enter(program, scheme, count, result):
        seconds, error = result
        print(f"| {program} | {scheme} | {arguments.end / count:.1e} | {seconds:.2f} | {error:.1e} |", flush=True)

    parts = (1,) if arguments.quick else (1, 2, 4)
    for part in parts:
        count = part * 50 * round(arguments.end / 1e-2 * arguments.cells / 40)
        enter("variational", "`stormer-verlet`", count, run_ours(arguments, count))
    for name, integrator, step, ipc in (
        ("`discrete`, `ipc`", "discrete", 5e-3, True),
        ("`discrete`", "discrete", 5e-3, False),
        ("`Euler`", "Euler", 2e-4, False),
    ):
        for part in parts:
            count = part * round(arguments.end / step)
            enter("MuJoCo", name, count, run_mujoco(arguments, flag, integrator, count, ipc))


if __name__ == "__main__":
    main()
