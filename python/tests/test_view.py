"""Pictures, films and files with geometry, without a display."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
import variational_sim as vs
from conftest import beam_keys

pyvista = pytest.importorskip("pyvista")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> vs.Run:
    scene = vs.Scene(beam_keys(output=dict(fps=50.0, fields=["displacement", "velocity", "von_mises"])))
    return vs.run(scene.named("beam"), tmp_path_factory.mktemp("run"), quiet=True)


def test_pictures_show_the_body(run: vs.Run, beam: vs.Scene, tmp_path: pathlib.Path) -> None:
    vs.picture(run, tmp_path / "a.png", size=(200, 150))
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    first, last = (vs.picture(run, frame=frame, scalars="von_mises", size=(200, 150)) for frame in (0, -1))
    assert first.shape[:2] == (150, 200)
    # The body covers a part of the picture, and has moved and changed its colour.
    assert 0.05 < (last != 255).any(axis=2).mean() < 0.9 and (first != last).any()
    pixels = vs.picture(vs.Simulation(beam, threads=1), size=(200, 150))
    assert pixels.std() > 0
    with pytest.raises(ValueError, match="there are 6 frames"):
        vs.picture(run, frame=6)
    with pytest.raises(ValueError, match="output.fps"):
        vs.picture(vs.run(beam, quiet=True))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_pictures_are_upright(axis: int, tmp_path: pathlib.Path) -> None:
    """A column that stands along gravity is drawn upright."""
    size, gravity = [0.1, 0.1, 0.1], [0.0, 0.0, 0.0]
    size[axis], gravity[axis] = 1.0, -9.81
    box = dict(size=size, cells=[1, 1, 1])
    keys = beam_keys(gravity=gravity, output=dict(fps=50.0), probe=[], fix=[dict(body="beam", region="xyz"[axis] + "-min")])
    keys["body"][0]["box"] = box
    scene = vs.Scene(keys)
    for source in (vs.Simulation(scene, threads=1), vs.run(scene, tmp_path, quiet=True)):
        pixels = vs.picture(source, scalars=None, size=(300, 300))
        # Without the time above and the axes below.
        rows, columns = np.nonzero((pixels[50:230] != 255).any(axis=2))
        assert rows.max() - rows.min() > 3 * (columns.max() - columns.min()) > 0


def test_films_have_all_frames(run: vs.Run, tmp_path: pathlib.Path) -> None:
    iio = pytest.importorskip("imageio.v3")
    pytest.importorskip("imageio_ffmpeg")
    vs.movie(run, tmp_path / "a.mp4", size=(201, 150))
    vs.movie(run.directory, tmp_path / "a.gif", size=(200, 150))
    assert iio.imread(tmp_path / "a.mp4").shape == (6, 150, 200, 3)
    assert len(iio.imread(tmp_path / "a.gif", index=None)) == 6
    with pytest.raises(ValueError, match=".mp4 or .gif"):
        vs.movie(run, tmp_path / "a.avi")


def test_a_view_opens(run: vs.Run, beam: vs.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
    vs.view(run)
    vs.view(vs.Simulation(beam, threads=1))


def test_the_commands_draw(run: vs.Run, program: str, tmp_path: pathlib.Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    environment["VARIATIONAL_PYTHON"] = sys.executable

    def call(*arguments: str | os.PathLike[str]) -> subprocess.CompletedProcess[str]:
        ends = [
            subprocess.run([*start, *arguments], env=environment, capture_output=True, text=True, check=False)
            for start in ([program], [sys.executable, "-m", "variational_sim"])
        ]
        said = [(end.returncode, end.stdout, end.stderr) for end in ends]
        assert said[0] == said[1]
        return ends[0]

    picture = tmp_path / "a.png"
    said = call("picture", run.directory, "--out", picture, "--size", "200x150", "--scalars", "von_mises")
    assert (said.returncode, said.stdout, said.stderr) == (0, f"written to {picture}\n", "")
    assert picture.read_bytes().startswith(b"\x89PNG")
    for arguments, words in [
        (["picture", tmp_path], "report.json"),
        (["picture", run.directory, "--frame", "99"], "there are 6 frames"),
        (["picture", run.directory, "--size", "big"], "WIDTHxHEIGHT"),
        (["movie", run.directory, "--out", "a.avi"], ".mp4 or .gif"),
    ]:
        said = call(*arguments)
        assert said.returncode == 2 and words in said.stderr, said.stderr


def test_vtkhdf_holds_every_frame(run: vs.Run, tmp_path: pathlib.Path) -> None:
    pytest.importorskip("h5py")
    from vtkmodules.vtkIOHDF import vtkHDFReader

    vs.write_vtkhdf(run, tmp_path / "beam.vtkhdf")
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "beam.vtkhdf"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == len(run.frames) == 6
    for number, frame in enumerate(run.frames):
        reader.SetStep(number)
        reader.Update()
        assert reader.GetTimeValue() == frame.t
        found, expected = pyvista.wrap(reader.GetOutput()), frame.to_pyvista()
        np.testing.assert_array_equal(found.points, expected.points)
        np.testing.assert_array_equal(found.cell_connectivity, expected.cell_connectivity)
        np.testing.assert_array_equal(found.point_data["velocity"], expected.point_data["velocity"])
        np.testing.assert_array_equal(found.cell_data["von_mises"], expected.cell_data["von_mises"])


def test_usd_holds_the_mesh_once_and_the_points_by_time(run: vs.Run, tmp_path: pathlib.Path) -> None:
    pxr = pytest.importorskip("pxr.UsdGeom")
    from pxr import Usd

    vs.write_usd(run, tmp_path / "beam.usda", fps=50.0)
    stage = Usd.Stage.Open(str(tmp_path / "beam.usda"))
    mesh = pxr.Mesh(stage.GetPrimAtPath("/bodies"))
    points = mesh.GetPointsAttr()
    assert points.GetNumTimeSamples() == 6 and mesh.GetFaceVertexIndicesAttr().GetNumTimeSamples() == 0
    # The tip of the last sample is that of the history.
    last = np.array(points.Get(5.0))
    assert abs(last[:, 1].min() - (run.history["tip.uy"][-1])) < 0.05
    assert len(mesh.GetFaceVertexCountsAttr().Get()) == 44
