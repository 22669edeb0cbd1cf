"""Cloth at large steps: run time against the error of its positions, compared with MuJoCo's flex and Newton's VBD.

`looks.py [--skirt] [--cells 40] [--young 1e5] [--end 0.5] [--rate 60] [--binary target/release/variational]`

The sheet of `flag.py` (StVK, no bending stiffness) is held along one edge and dropped from horizontal; with `--skirt`, a
skirt of the same cloth falls from its flare about its waist. All programs use one thread and steps of 1/rate s or the substeps that the table names. The error is the largest distance of a node of the free edge
from a converged run (`stormer-verlet`), over its largest displacement, at `end` and halfway. Newton's VBD has its
own law of membranes (stable neo-Hookean with the same moduli at rest; the sheet stretches by less than 3 %). The time is the
processor's while stepping for the peers, after a first step that compiles kernels, and of the whole program for ours.
"""
import time

import numpy as np
from flag import DENSITY, G, POISSON, THICKNESS, mujoco_model, options, run_scene
from skirt import Skirt


def run_ours(arguments, cloth, scheme, count):
    """Runs the cloth with a probe per node of the free edge, and rows at half time and at the end."""
    probes = "".join(
        f'[[probe]]\nname = "p{j}"\nbody = "flag"\npoint = {point!r}\n'
        for j, point in enumerate(cloth.points[cloth.edge].tolist())
    )
    keys = f"end = {arguments.end!r}\nstep = {arguments.end / count!r}\n{scheme}"
    output = f"[output]\nhistory = {count // 2}\n"
    seconds, rows = run_scene(arguments.binary, cloth.scene(keys, output + probes))
    if rows is None:
        return seconds, None
    edge = [[rows[f"p{j}u{axis}"][1:] for axis in "xyz"] for j in range(len(cloth.edge))]
    return seconds, np.array(edge).transpose(2, 0, 1)


def halves(count, advance, edge):
    """Calls `advance` for both halves of the steps; returns its processor time and the displacements of the free edge."""
    seconds, found = 0.0, []
    for half in range(2):
        start = time.process_time()
        advance(count // 2)
        seconds += time.process_time() - start
        found.append(edge())
    return seconds, np.array(found)


def run_mujoco(arguments, cloth, integrator, count):
    mujoco, model, data, dofs = mujoco_model(cloth, arguments.young, integrator, arguments.end / count)
    free_edge = np.flatnonzero(np.isin(cloth.free, cloth.edge))
    return halves(count, lambda steps: mujoco.mj_step(model, data, steps), lambda: data.qpos[dofs][free_edge].copy())


def run_newton(arguments, cloth, iterations, count):
    import newton
    import warp as wp

    builder = newton.ModelBuilder()
    builder.add_cloth_mesh(
        pos=wp.vec3(0.0), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(0.0),
        vertices=[wp.vec3(*point) for point in cloth.points], indices=cloth.triangles.ravel().tolist(), density=DENSITY,
        tri_ke=cloth.mu * THICKNESS, tri_ka=cloth.lam * THICKNESS, tri_kd=0.0, edge_ke=0.0, edge_kd=0.0, tri_drag=0.0,
        tri_lift=0.0, particle_radius=1e-4,
    )
    for node in cloth.fixed:
        builder.particle_mass[node] = 0.0
    builder.color()
    model = builder.finalize(device="cpu")
    model.set_gravity((0.0, 0.0, -G))
    solver = newton.solvers.SolverVBD(model, iterations=iterations, particle_enable_self_contact=False)
    states, control = [model.state(), model.state()], model.control()
    step = arguments.end / count

    def advance(steps):
        for _ in range(steps):
            states[0].clear_forces()
            solver.step(states[0], states[1], control, None, step)
            states.reverse()

    # Compile the kernels, then return to the start.
    first = [array.numpy().copy() for array in (states[0].particle_q, states[0].particle_qd)]
    advance(2)
    for state in states:
        state.particle_q.assign(first[0])
        state.particle_qd.assign(first[1])
    solver = newton.solvers.SolverVBD(model, iterations=iterations, particle_enable_self_contact=False)
    return halves(count, advance, lambda: states[0].particle_q.numpy()[cloth.edge] - cloth.points[cloth.edge])


def main():
    skirt = ("--skirt", dict(action="store_true", help="the skirt instead of the sheet"))
    arguments, cloth = options(__doc__, 40, 0.5, [("--rate", dict(type=int, default=60)), skirt])
    if arguments.skirt:
        cloth = Skirt(arguments.young)
    count = 2 * max(1, round(arguments.end * arguments.rate / 2))
    speed = (arguments.young * THICKNESS / DENSITY / (1 - POISSON**2)) ** 0.5
    fine = 2 * int(np.ceil(arguments.end * speed / cloth.shortest / 0.15))
    stable = 2 * int(np.ceil(arguments.end * speed / cloth.shortest / 0.7))
    _, exact = run_ours(arguments, cloth, 'scheme = "stormer-verlet"', fine)
    largest = np.linalg.norm(exact, axis=2).max()

    print("| program | scheme | step, s | processor s | s per step | error at half time | at the end |\n|---|---|--:|--:|--:|--:|--:|")

    def enter(program, scheme, count, run):
        seconds, edge = run
        error = [float("nan")] * 2 if edge is None else np.linalg.norm(edge - exact, axis=2).max(axis=1) / largest
        print(f"| {program} | {scheme} | {arguments.end / count:.2e} | {seconds:.2f} | {seconds / count:.4f} "
              f"| {100 * error[0]:.1f} % | {100 * error[1]:.1f} % |", flush=True)

    for solves in (2, 8, 32):
        scheme = f'scheme = "truncated-euler"\nsolves = {solves}'
        enter("variational", f"`truncated-euler`, {solves} solves", count, run_ours(arguments, cloth, scheme, count))
    for name in ("backward-euler", "energy-momentum"):
        enter("variational", f"`{name}`", count, run_ours(arguments, cloth, f'scheme = "{name}"', count))
    enter("variational", "`stormer-verlet`", stable, run_ours(arguments, cloth, 'scheme = "stormer-verlet"', stable))
    for iterations, parts in ((10, 1), (30, 1), (100, 1), (10, 10), (10, 30)):
        enter("Newton", f"VBD, {iterations} iterations", count * parts, run_newton(arguments, cloth, iterations, count * parts))
    for parts in (1, 4, 16):
        enter("MuJoCo", "`discrete`", count * parts, run_mujoco(arguments, cloth, "discrete", count * parts))


if __name__ == "__main__":
    main()
