"""Runs P1 by `variational` and its peers in alternation, one thread each, and writes the table of run
time at equal error: `compare.py [--mesh 4 8] [--repeat 3] [--out target/peers/results.json]`. Started by run.sh.

Time is processor time of the stepping alone (the machine may be shared; with one thread it equals wall
time on a quiet one), the least of the repeats. Error is |u - u_ref|_M / |u_ref|_M at T, each program
against the semi-discrete equations that it solves: for the same mesh, mass and energy the reference is
one and the same; MFEM's neo-Hookean energy is its own.
"""
import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import ours
from problem import Block, reference

HERE = Path(__file__).resolve().parent
TARGETS = [1e-2, 1e-3, 1e-4, 1e-6]


def plan(n):
    """(program, setting, steps): explicit schemes from just below their limit of stability on."""
    limit = 240 * n  # steps that Störmer-Verlet needs to be stable
    runs = []
    for factor in [0.99, 1.1, 2.0]:
        runs.append(("variational", "stormer-verlet", round(factor * limit)))
    for factor in [0.445, 0.5]:
        runs.append(("variational", "stormer-verlet filtered", round(factor * limit)))
    for factor in [0.4, 0.45, 0.5, 0.6, 0.75]:
        runs.append(("variational", "blanes-moan-4", round(factor * limit)))
    for factor in [0.3, 0.5]:
        runs.append(("variational", "blanes-moan-6", round(factor * limit)))
    for steps in [100, 200]:
        runs.append(("variational", "implicit-midpoint", steps))
    for factor in [1.05, 1.75, 17.5]:
        runs.append(("mujoco", "Euler", round(factor * limit)))
    for factor in [1.05, 1.2]:
        runs.append(("mujoco", "Euler-staggered", round(factor * limit)))
    for factor in [0.73, 0.78, 1.1, 1.4]:
        runs.append(("mujoco", "RK4", round(factor * limit)))
    runs.append(("mujoco", "discrete", 100))
    return runs


def peer(script, *arguments):
    """Displacements and the JSON that a peer's script prints."""
    with tempfile.NamedTemporaryFile(suffix=".npy") as out:
        command = [sys.executable, HERE / script, *map(str, arguments), out.name]
        done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
        if done.returncode != 0:
            raise ours.Failed(done.stderr.strip()[-300:])
        return np.load(out.name), json.loads(done.stdout.strip().splitlines()[-1])


def check(script):
    command = [sys.executable, HERE / script, "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.strip().splitlines()[-1])


def our_reference(directory, n, law):
    """Blanes-Moan 6 at a small step, and its distance from twice that step: the evidence."""
    steps = 480 * n
    fine = ours.run(directory, n, law, "blanes-moan-6", steps)[0]
    coarse = ours.run(directory, n, law, "blanes-moan-6", steps // 2)[0]
    return fine, Block(n).error(coarse, fine)


def measure(directory, n, program, setting, steps):
    if program == "variational":
        u, cpu, wall, _ = ours.run(directory, n, "st-venant-kirchhoff", setting, steps)
        return u, cpu, wall
    u, said = peer("mujoco_flex.py", n, setting, steps)
    return u, said["cpu"], said["wall"]


def compare_st_venant_kirchhoff(directory, n, repeat, independent, rows):
    block = Block(n)
    exact, evidence = our_reference(directory, n, "st-venant-kirchhoff")
    print(f"n{n}: reference converged to {evidence:.1e}", flush=True)
    if independent:
        other = reference(n, "st-venant-kirchhoff", 1e-11)[0]
        print(f"n{n}: an independent reference differs by {block.error(other, exact):.1e}", flush=True)
    found = {}
    for turn in range(repeat):
        for key in plan(n):
            if turn > 0 and found[key]["cpu"] > 30:
                continue
            try:
                u, cpu, wall = measure(directory, n, *key)
                error = block.error(u, exact)
            except ours.Failed as failure:
                print("  failed:", key, failure, flush=True)
                error, cpu, wall = float("nan"), 0.0, 0.0
            row = found.setdefault(key, {"cpu": np.inf, "wall": np.inf})
            row.update(error=float(error), cpu=min(row["cpu"], cpu), wall=min(row["wall"], wall))
            print(f"  {turn} {key} error {error:.2e} cpu {cpu:.3f} wall {wall:.3f}", flush=True)
    for (program, setting, steps), row in found.items():
        rows.append({"mesh": f"n{n}", "program": program, "setting": setting, "steps": steps, **row})


def compare_neo_hookean(directory, n, repeat, rows):
    """Implicit midpoint at h = 0.01 s, each at the loosest of its tolerances that keeps its error."""
    block = Block(n)
    exact, evidence = our_reference(directory, n, "neo-hookean")
    print(f"n{n} neo-Hookean: reference converged to {evidence:.1e}", flush=True)
    theirs = peer("mfem_midpoint.py", n, 1600, 1e-8, 1e-6)[0] if n <= 4 else None
    settings = [("mfem", (1e-4, 1e-2)), ("mfem", (1e-2, 1e-2)), ("variational", 1e-5), ("variational", 1e-6)]
    converged = peer("mfem_midpoint.py", n, 100, 1e-9, 1e-6)[0]
    found = {}
    for turn in range(repeat):
        for program, tolerance in settings:
            if program == "mfem":
                u, said = peer("mfem_midpoint.py", n, 100, *tolerance)
                cpu, wall = said["cpu"], said["wall"]
                row = {"of_converged_step": float(block.error(u, converged))}
                if theirs is not None:
                    row["error"] = float(block.error(u, theirs))
            else:
                u, cpu, wall, _ = ours.run(
                    directory, n, "neo-hookean", "implicit-midpoint", 100, tolerance=tolerance
                )
                row = {"error": float(block.error(u, exact))}
            kept = found.setdefault((program, str(tolerance)), {"cpu": np.inf, "wall": np.inf})
            kept.update(row, cpu=min(kept["cpu"], cpu), wall=min(kept["wall"], wall))
            print(f"  {turn} {program} {tolerance} {row} cpu {cpu:.3f} wall {wall:.3f}", flush=True)
    for (program, tolerance), row in found.items():
        rows.append({
            "mesh": f"n{n}", "law": "neo-hookean", "program": program, "setting": "implicit-midpoint",
            "tolerance": tolerance, "steps": 100, **row,
        })


def table(rows):
    """Markdown: for each mesh and error the cheapest setting of each program, and the ratio."""
    lines = ["| mesh | error | variational | MuJoCo | ratio |", "|---|---|---|---|---|"]
    for mesh in dict.fromkeys(row["mesh"] for row in rows):
        for target in TARGETS:
            best = {}
            for program in ["variational", "mujoco"]:
                good = [
                    row for row in rows
                    if row["mesh"] == mesh and row["program"] == program and "law" not in row
                    and "staggered" not in row["setting"] and row["error"] <= target
                ]
                best[program] = min(good, key=lambda row: row["cpu"], default=None)
            say = lambda row: (
                f"{row['cpu']:.3g} s ({row['setting']}, {row['steps']} steps, {row['error']:.1e})" if row else "not reached"
            )
            us, them = best["variational"], best["mujoco"]
            ratio = f"{them['cpu'] / us['cpu']:.1f}" if us and them else "—"
            lines.append(f"| {mesh} | {target:.0e} | {say(us)} | {say(them)} | {ratio} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mesh", type=int, nargs="+", default=[4, 8])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--skip-mfem", action="store_true")
    parser.add_argument("--independent", action="store_true", help="check our reference by scipy's DOP853 (slow)")
    parser.add_argument("--out", type=Path, default=HERE.parents[1] / "target" / "peers" / "results.json")
    options = parser.parse_args()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    versions = {"mujoco": check("mujoco_flex.py"), "mfem": check("mfem_midpoint.py")}
    print(versions, platform.platform(), flush=True)
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        for n in options.mesh:
            compare_st_venant_kirchhoff(Path(scratch), n, options.repeat, options.independent, rows)
            if not options.skip_mfem:
                compare_neo_hookean(Path(scratch), n, options.repeat, rows)
            options.out.write_text(json.dumps({"versions": versions, "rows": rows}, indent=1) + "\n")
    print(table(rows))


if __name__ == "__main__":
    main()
