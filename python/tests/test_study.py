"""Studies: bench, convergence, modes, equilibria, sweeps."""

from __future__ import annotations

import math
import pathlib
import subprocess

import numpy as np
import pytest
import variational_sim as vs
from conftest import beam_keys


def test_bench_compares_schemes(beam: vs.Scene) -> None:
    report = vs.bench(beam.set({"time.end": 0.01}), budget=3.0, schemes=["stormer-verlet", "implicit-midpoint"], quiet=True)
    assert {row.scheme for row in report.rows} == {"stormer-verlet", "implicit-midpoint"}
    assert report.recommendation
    with pytest.raises(vs.StudyError, match="unknown scheme"):
        vs.bench(beam, schemes=["magic"], quiet=True)
    with pytest.raises(ValueError, match="budget"):
        vs.bench(beam, budget=-1.0)


def test_convergence_finds_the_order_of_the_scheme(beam: vs.Scene) -> None:
    report = vs.convergence(beam.set({"time.end": 0.01, "time.step": 5e-4}), space=False, quiet=True)
    [study] = report.studies
    assert study.of == "time" and len(study.levels) == 3
    with pytest.raises(ValueError, match="levels"):
        vs.convergence(beam, levels=1)


def test_modes_of_a_bar_are_known() -> None:
    """A clamped bar vibrates along its length with f = c/4L."""
    keys = beam_keys()
    keys["body"][0] = dict(
        name="beam",
        box=dict(size=[1.0, 0.02, 0.02], cells=[40, 1, 1], element="hex20"),
        material=dict(law="linear", young=1e6, poisson=0.0, density=1000.0),
    )
    keys["probe"] = []
    modes = vs.modes(vs.Scene(keys), 30)
    along = [mode for mode in range(len(modes)) if modes.effective_masses[mode, 0] > 0.5 * modes.effective_masses[:, 0].sum()]
    expected = math.sqrt(1e6 / 1000.0) / 4.0
    assert modes[along[0]] == pytest.approx(expected, rel=1e-3)
    nodes = len(vs.Simulation(vs.Scene(keys), threads=1)["beam"].x)
    shape = modes.shape(along[0], "beam", nodes)
    assert shape.shape == (nodes, 3) and abs(shape[:, 0]).max() > 100 * abs(shape[:, 1]).max()


def test_an_equilibrium_carries_the_weight(beam: vs.Scene) -> None:
    simulation = vs.static(beam.set({"time": {"end": 1.0, "step": 1.0}, "static": {}}), threads=1)
    assert simulation.is_done
    np.testing.assert_allclose(
        simulation["beam"].reactions.sum(axis=0), [0.0, 9.81 * 40.0, 0.0], atol=1e-4
    )


def test_a_sweep_is_that_of_the_program(beam: vs.Scene, program: str, tmp_path: pathlib.Path) -> None:
    values = [1e5, 1e6, -1.0]
    over = {"body[0].material.young": values, "time.step": [1e-3, 5e-4]}
    found = vs.sweep(beam, over, tmp_path / "a", jobs=2)
    assert len(found) == 6 and found.done == 6 and found.failed == 2
    assert "<table>" in found._repr_html_() and len(found.rows) == 6
    assert found.run(0).report.outcome == "done"
    for task in range(3):
        vs.sweep(beam, over, tmp_path / "b", jobs=1, task=(task, 3))
    axes = [f"{key}={','.join(map(repr, values))}" for key, values in over.items()]
    command = [program, "sweep", tmp_path / "a" / "scene.toml", "--out", tmp_path / "c", "--quiet"]
    subprocess.run([*command, "--over", axes[0], "--over", axes[1]], check=True)
    tables = {(tmp_path / name / "sweep.csv").read_bytes() for name in "abc"}
    assert len(tables) == 1


def test_a_sweep_takes_meshes_from_arrays_and_gives_columns(tmp_path: pathlib.Path) -> None:
    points = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    mesh = vs.mesh(points, {"tet4": [[0, 1, 2, 3]], "tri3": [[0, 2, 1]]}, {"floor": [1]})
    keys = beam_keys(gravity=[0.0, 0.0, -9.81], fix=[dict(body="beam", region="floor")])
    keys["body"][0] = dict(name="beam", mesh=mesh, material=keys["body"][0]["material"])
    keys["probe"] = [dict(name="top", body="beam", node=3)]
    scene = vs.Scene(keys)
    values = [1e4, 1e5, -1.0]
    found = vs.sweep(scene, {"body[0].material.young": values}, tmp_path / "a", jobs=1)
    np.testing.assert_array_equal(found["body[0].material.young"], values)
    lowest = found["top.uz.min"]
    assert lowest[0] < lowest[1] < 0.0 and np.isnan(lowest[2])
    alone = vs.run(scene.set({"body[0].material.young": 1e4}), quiet=True)
    assert alone.history["top.uz"].min() == lowest[0]
    assert "young" in found["reason"][2]
    with pytest.raises(KeyError, match="there are: point"):
        found["top"]
