"""Scenes from text, files, dicts and arrays; their problems; pickling."""

from __future__ import annotations

import copy
import pathlib
import pickle
from typing import Any

import numpy as np
import pytest
import variational_sim as vs
from conftest import ROOT, RUBBER, beam_keys

CELLS = [[0, 1, 2, 3]]
POINTS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def test_a_dict_keywords_text_and_a_file_are_one_scene(tmp_path: pathlib.Path) -> None:
    keys = beam_keys()
    scene = vs.Scene(keys)
    assert vs.Scene(**keys) == scene
    assert vs.Scene(scene.to_toml()) == scene
    path = tmp_path / "beam.toml"
    path.write_text(scene.to_toml())
    assert vs.Scene(path) == scene and vs.Scene(path).name == "beam"
    assert vs.Scene(str(path), time=dict(end=0.2, step=1e-3, scheme="gauss")).to_dict()["time"]["end"] == 0.2


def test_set_changes_one_value(beam: vs.Scene) -> None:
    softer = beam.set({"body[0].material.young": np.float64(2e5), "time.scheme": "gauss"})
    assert softer.to_dict()["body"][0]["material"]["young"] == 2e5
    assert softer.to_dict()["time"]["scheme"] == "gauss"
    assert beam.to_dict()["body"][0]["material"]["young"] == 1e6
    with pytest.raises(vs.SceneError, match="material.yuong"):
        beam.set({"body[0].material.yuong": 1.0})


def test_all_problems_come_at_once_with_their_keys() -> None:
    keys = beam_keys(fix=[dict(body="bean", region="x-min")], gravity=[0.0, 1.0])
    keys["body"][0]["material"] = {**RUBBER, "density": -5.0}
    keys["time"]["stepp"] = 3
    with pytest.raises(vs.SceneError) as caught:
        vs.Scene(keys)
    found = {problem.key for problem in caught.value.problems}
    assert found == {"gravity", "time.stepp", "body[0].material", "fix[0].body"}
    assert all(problem.line is None for problem in caught.value.problems)
    assert isinstance(caught.value, ValueError)
    again = pickle.loads(pickle.dumps(caught.value))
    assert again.problems == caught.value.problems and str(again) == str(caught.value)


# Each change of the good scene, and words that the problem has; the cases of tests/commands/bad_input.rs.
WRONG: list[tuple[dict[str, Any], str, str]] = [
    ({"time": {"end": 0.1, "step": 0.01, "scheme": "stormer-verlet", "steps": 3}}, "time.steps", "unknown key"),
    ({"time": {"step": 0.01, "scheme": "stormer-verlet"}}, "time.end", "missing key `end`"),
    ({"time": {"end": 0.1, "step": "short", "scheme": "stormer-verlet"}}, "time.step", "string"),
    ({"time": {"end": 0.1, "step": -0.01, "scheme": "stormer-verlet"}}, "time.step", "-0.01"),
    ({"time": {"end": 0.1, "step": 0.01, "scheme": "magic"}}, "time.scheme", "implicit-midpoint"),
    ({"time": {"end": float("nan"), "step": 0.01, "scheme": "stormer-verlet"}}, "time.end", "NaN"),
    ({"gravity": [float("inf"), 0.0, 0.0]}, "gravity", "inf"),
    ({"body": []}, "body", "at least one"),
    ({"fix": [{"body": "bean", "region": "x-min"}]}, "fix[0].body", "beam"),
    ({"fix": [{"body": "beam", "region": "clmap"}]}, "fix[0].region", "x-min"),
    ({"probe": [{"name": "a", "body": "beam", "node": 10**6}]}, "probe[0].node", ""),
]


@pytest.mark.parametrize("changes, key, words", WRONG)
def test_wrong_scenes_name_key_and_way_out(changes: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(vs.SceneError) as caught:
        vs.Scene(beam_keys(**changes)).check()
    problems = caught.value.problems
    assert any(problem.key.startswith(key) and words in problem.message for problem in problems), problems


def test_a_text_has_lines_and_a_missing_file_is_an_error(tmp_path: pathlib.Path) -> None:
    text = vs.Scene(beam_keys()).to_toml().replace("density", "densty")
    with pytest.raises(vs.SceneError) as caught:
        vs.Scene(text)
    assert caught.value.problems[0].line is not None
    with pytest.raises(vs.OutputError, match="no-such.toml"):
        vs.Scene(tmp_path / "no-such.toml")
    with pytest.raises(TypeError, match="numbers, strings"):
        vs.Scene(time=object())  # type: ignore[arg-type]


def test_meshes_from_arrays_and_from_other_libraries() -> None:
    class Block:
        type, data = "tetra", np.array(CELLS)

    class Meshio:
        points, cells, cell_sets = np.array(POINTS), [Block()], {"all": [np.array([0])]}

    for given in [
        vs.mesh(POINTS, {"tet4": CELLS}, {"all": [0]}),
        (POINTS, {"tet4": CELLS}, {"all": [0]}),
        Meshio(),
    ]:
        body = dict(name="tet", mesh=given, material=[{**RUBBER, "region": "all"}])
        scene = vs.Scene(time=dict(end=0.1, step=1e-3, scheme="gauss"), body=[body])
        for copied in (scene, pickle.loads(pickle.dumps(scene)), copy.deepcopy(scene), scene.set({"title": "a"})):
            simulation = vs.Simulation(copied, threads=1)
            np.testing.assert_array_equal(simulation["tet"].x, POINTS)
            assert simulation["tet"].mesh.regions == {"all": [0]}


def test_a_mesh_is_written_and_read_with_the_same_numbers(tmp_path: pathlib.Path) -> None:
    points = [[0.1, 0.0, 1e-17], [1.0 / 3.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.7]]
    made = vs.mesh(points, {"tet4": CELLS, "tri3": [[0, 2, 1]]}, {"all": [0], 'a "side" & more': [1]})
    assert repr(made) == "<Mesh: 4 points, 1 tet4, 1 tri3; all, a \"side\" & more>"
    vs.write_mesh(made, tmp_path / "a.vtu")
    scene = vs.Scene(time=dict(end=0.1, step=1e-3, scheme="gauss"), body=[dict(name="a", mesh=str(tmp_path / "a.vtu"), material=RUBBER)])
    read = vs.Simulation(scene, threads=1)["a"].mesh
    np.testing.assert_array_equal(read.points, points)
    assert read.regions == made.regions
    assert [(kind, nodes.tolist()) for kind, nodes in read.blocks] == [(kind, nodes.tolist()) for kind, nodes in made.blocks]
    with pytest.raises(ValueError, match="written as .vtu"):
        vs.write_mesh(made, tmp_path / "a.msh")


def test_a_pyvista_grid_is_a_mesh() -> None:
    pv = pytest.importorskip("pyvista")
    grid = pv.UnstructuredGrid({10: np.array(CELLS)}, np.array(POINTS))
    scene = vs.Scene(time=dict(end=0.1, step=1e-3, scheme="gauss"), body=[dict(name="a", mesh=grid, material=RUBBER)])
    simulation = vs.Simulation(scene, threads=1)
    np.testing.assert_array_equal(simulation["a"].to_pyvista().points, POINTS)


def test_wrong_meshes_are_refused() -> None:
    for cells, words in [
        ({"tet4": [[0, 2, 1, 3]]}, "inverted"),
        ({"tet4": [[0, 1, 2, 9]]}, "9"),
        ({"tet5": CELLS}, "unknown kind"),
        ({"tet4": [[0, 1, 2]]}, "4 nodes"),
    ]:
        with pytest.raises(ValueError, match=words):
            vs.mesh(POINTS, cells)
    with pytest.raises(ValueError, match="shape"):
        vs.mesh([1.0, 2.0], {"tet4": CELLS})
    with pytest.raises(TypeError, match="pyvista"):
        vs.Scene(beam_keys(body=[dict(name="a", mesh=object(), material=RUBBER)]))


def test_scenes_pickle(beam: vs.Scene) -> None:
    assert pickle.loads(pickle.dumps(beam)) == beam
    assert "beam" in beam._repr_html_() and "beam" in repr(beam)


def test_every_scene_of_the_repository_is_a_scene() -> None:
    for path in sorted((ROOT / "scenes").glob("*.toml")):
        scene = vs.Scene(path)
        assert vs.Scene(scene.to_toml()) == scene, path
