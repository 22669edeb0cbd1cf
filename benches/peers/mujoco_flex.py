"""P1 by MuJoCo's flex: `mujoco_flex.py n integrator steps out.npy` writes the displacements at T and
prints the seconds of stepping as JSON.

Of its settings, those that serve MuJoCo best: collision and the constraint solver off, sparse
matrices, all steps in one call of the C library. Its nodes get the lumped mass of P1 in place of the
uniform mass of `flexcomp`; then its elastic force equals St. Venant-Kirchhoff's on linear tetrahedra
to round-off (`--check`), and all programs solve the same equations of motion.
`euler-staggered` is its Euler integrator started half a step back in velocity: a caller's trick,
by which the positions become those of leapfrog, second order.
"""
import json
import sys
import time

import mujoco
import numpy as np

from problem import DENSITY, POISSON, SIZE, YOUNG, Block


def model(block, integrator, steps):
    words = lambda array: " ".join(f"{value:.17g}" for value in array.ravel())
    spec = f"""<mujoco>
      <option gravity="0 -9.81 0" jacobian="sparse" integrator="{integrator}" timestep="{1 / steps:.17g}">
        <flag contact="disable" constraint="disable" sensor="disable"/>
      </option>
      <size memory="4G"/>
      <worldbody>
        <flexcomp name="block" type="direct" dim="3" radius="1e-4" mass="{DENSITY * SIZE.prod()}"
            point="{words(block.points)}" element="{words(block.tets)}">
          <contact contype="0" conaffinity="0" selfcollide="none"/>
          <edge equality="false"/>
          <elasticity young="{YOUNG}" poisson="{POISSON}" damping="0"/>
          <pin id="{words(block.fixed)}"/>
        </flexcomp>
      </worldbody>
    </mujoco>"""
    built = mujoco.MjModel.from_xml_string(spec)
    bodies = built.flex_vertbodyid[block.free]
    built.body_mass[bodies] = block.mass[block.free]
    data = mujoco.MjData(built)
    mujoco.mj_setConst(built, data)
    mujoco.mj_resetData(built, data)
    dofs = built.body_dofadr[bodies][:, None] + np.arange(3)
    return built, data, dofs


def run(n, integrator, steps):
    block = Block(n)
    built, data, dofs = model(block, integrator.removesuffix("-staggered"), steps)
    if integrator.endswith("-staggered"):
        mujoco.mj_forward(built, data)
        data.qvel[:] = -0.5 / steps * data.qacc
    cpu, wall = time.process_time(), time.perf_counter()
    mujoco.mj_step(built, data, steps)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    u = np.zeros(block.points.shape)
    u[block.free] = data.qpos[dofs]
    if abs(data.time - 1.0) > 1e-6:  # MuJoCo resets a run that blows up
        u[:] = np.nan
    return u, cpu, wall


def check(n=2):
    """The largest difference of MuJoCo's elastic force from ours, over the largest force."""
    block = Block(n)
    built, data, dofs = model(block, "Euler", 1000)
    u = np.zeros(block.points.shape)
    u[block.free] = 0.1 * np.sin(3 * block.points[block.free])
    data.qpos[dofs] = u[block.free]
    mujoco.mj_forward(built, data)
    ours = -block.elastic_gradient(u, "st-venant-kirchhoff")[block.free]
    return np.abs(data.qfrc_passive[dofs] - ours).max() / np.abs(ours).max()


if __name__ == "__main__":
    if sys.argv[1] == "--check":
        print(json.dumps({"version": mujoco.__version__, "force_difference": check()}))
    else:
        u, cpu, wall = run(int(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
        np.save(sys.argv[4], u)
        print(json.dumps({"cpu": cpu, "wall": wall}))
