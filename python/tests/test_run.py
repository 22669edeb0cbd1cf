"""Runs: the files of the command line, resuming, results, Ctrl-C, other processes."""

from __future__ import annotations

import io
import json
import logging
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import sysconfig
import threading
import time
import types
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest
import variational_sim as vs
from conftest import beam_keys

OUTPUT = dict(fps=50.0)


def content(directory: pathlib.Path) -> dict[str, Any]:
    """The files of a run without provenance and clock times."""
    found: dict[str, Any] = {}
    for path in sorted(directory.iterdir()):
        if path.name == "report.json":
            report = json.loads(path.read_text())
            del report["provenance"]
            found[path.name] = {key: value for key, value in report.items() if not key.endswith("_seconds")}
        elif path.suffix not in (".lock", ".vck"):
            found[path.name] = path.read_bytes()
    return found


def test_a_run_is_that_of_the_program(program: str, tmp_path: pathlib.Path) -> None:
    path = tmp_path / "beam.toml"
    path.write_text(vs.Scene(beam_keys(output=OUTPUT)).to_toml())
    module = [sys.executable, "-m", "variational_sim"]
    script = [os.path.join(sysconfig.get_path("scripts"), "variational")]
    for command, out in [([program], "a"), (module, "b"), (script, "d")]:
        subprocess.run([*command, "run", path, "--out", tmp_path / out, "--quiet"], check=True)
    vs.run(vs.Scene(path), tmp_path / "c", quiet=True)
    assert content(tmp_path / "a") == content(tmp_path / "b") == content(tmp_path / "c") == content(tmp_path / "d")
    assert {"history.csv", "report.json", "beam.pvd"} <= set(content(tmp_path / "a"))
    # Messages and exit codes are also those of the program.
    for arguments in (["schema"], ["--help"], ["run", "no-such.toml"], ["nonsense"], ["info", path]):
        said = [
            subprocess.run([*command, *arguments], capture_output=True, text=True, check=False)
            for command in ([program], module, script)
        ]
        assert len({(end.returncode, end.stdout, end.stderr) for end in said}) == 1


def test_the_bits_are_those_of_the_program_on_any_threads(program: str, tmp_path: pathlib.Path) -> None:
    pytest.importorskip("pyvista")
    output = dict(interval=1.0, precision="f64", fields=["displacement", "velocity"])
    scene = vs.Scene(beam_keys(time=dict(end=1.0, step=1e-3, scheme="stormer-verlet"), output=output))
    (tmp_path / "beam.toml").write_text(scene.to_toml())
    simulation = vs.Simulation(scene, threads=2)
    simulation.step(500)
    simulation = pickle.loads(pickle.dumps(simulation))
    simulation.step(500)
    body = simulation["beam"]
    for threads in (1, 2, 8):
        out = tmp_path / f"out-{threads}"
        command = [program, "run", tmp_path / "beam.toml", "--out", out, "--threads", str(threads), "--quiet"]
        subprocess.run(command, check=True)
        end = vs.load(out).frames[-1].to_pyvista(warp=False)
        np.testing.assert_array_equal(end.point_data["displacement"], body.u)
        np.testing.assert_array_equal(end.point_data["velocity"], body.v)


def test_results_are_arrays_and_attributes(tmp_path: pathlib.Path) -> None:
    scene = vs.Scene(beam_keys(output=OUTPUT)).named("bar")
    run = vs.run(scene, tmp_path, quiet=True)
    simulation = vs.Simulation(scene, threads=1)
    simulation.run()
    tip = simulation.observe().probes["tip"]
    assert run.report.outcome == "done" and run.report.steps == 100
    assert abs(run.report.energy.relative_drift) < 1e-2 and "energy" in run.report
    assert "energy" in dir(run.report) and run.report["name"] == "bar"
    assert run.history["tip.uy"][-1] == tip.displacement[1]
    assert len(run.history["t"]) == 101 and run.history["t"][-1] == pytest.approx(0.1)
    assert [frame.t for frame in run.frames] == pytest.approx([0.0, 0.02, 0.04, 0.06, 0.08, 0.1])
    with pytest.raises(KeyError, match="there are: "):
        run.history["nothing"]
    with pytest.raises(AttributeError, match="it has: "):
        run.report.nothing
    assert "<table>" in run._repr_html_()
    again = vs.load(tmp_path)
    assert again.report == run.report and repr(again) == repr(run)
    with pytest.raises(vs.OutputError, match="report.json"):
        vs.load(tmp_path / "nothing")


def test_a_run_without_a_directory_leaves_no_files(beam: vs.Scene) -> None:
    run = vs.run(beam, quiet=True)
    directory = run.directory
    assert os.path.exists(directory)
    copied = pickle.loads(pickle.dumps(run))
    expected = run.history["tip.uy"]
    del run
    assert not os.path.exists(directory)
    np.testing.assert_array_equal(copied.history["tip.uy"], expected)


def test_ctrl_c_writes_everything_and_resume_gives_the_same_bits(tmp_path: pathlib.Path) -> None:
    keys = beam_keys(time=dict(end=0.5, step=2e-5, scheme="stormer-verlet"), output=dict(fps=50.0, history=100))
    keys["body"][0]["box"] = dict(size=[1.0, 0.2, 0.2], cells=[20, 4, 4])
    keys["checkpoint"] = dict(interval=0.1)
    scene = vs.Scene(keys)
    heard: list[float] = []

    def progress(t: float, end: float, rate: float) -> None:
        if not heard:
            threading.Timer(0.1, lambda: (heard.append(time.perf_counter()), os.kill(os.getpid(), signal.SIGINT))).start()
            heard.append(0.0)

    with pytest.raises(KeyboardInterrupt):
        vs.run(scene, tmp_path / "a", progress=progress)
    report = json.loads((tmp_path / "a" / "report.json").read_text())
    assert report["outcome"] == "interrupted" and 0 < report["steps"] < 25000
    run = vs.resume(tmp_path / "a", quiet=True)
    assert run.report.outcome == "done"
    vs.run(scene, tmp_path / "b", quiet=True)
    assert content(tmp_path / "a") == content(tmp_path / "b")
    # A finished run is returned as it is.
    assert vs.resume(tmp_path / "a").report == run.report
    with pytest.raises(vs.CheckpointError, match="no checkpoint"):
        vs.resume(tmp_path / "nothing")


def test_a_run_with_arrays_formulas_and_callables_resumes_with_its_scene(tmp_path: pathlib.Path) -> None:
    points = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    body = dict(
        name="a",
        mesh=(points, {"tet4": [[0, 1, 2, 3]]}),
        material=dict(law="formula", energy="mu/2*(I1 - 3 - 2*log(J))", constants=dict(mu=4e3), density=1e3),
    )

    def motion(x: Any, t: float) -> Any:
        if stop and t > 0.05:
            raise RuntimeError("stop")
        return x + [0.0, 0.0, t * t]

    scene = vs.Scene(
        time=dict(end=0.1, step=1e-3, scheme="implicit-midpoint"),
        body=[body],
        fix=[dict(body="a", nodes=[0], motion=motion)],
        checkpoint=dict(interval=0.02),
    )
    stop = True
    with pytest.raises(RuntimeError, match="stop"):
        vs.run(scene, tmp_path / "a", quiet=True)
    stop = False
    vs.resume(tmp_path / "a", scene=scene, quiet=True)
    vs.run(scene, tmp_path / "b", quiet=True)
    assert content(tmp_path / "a")["history.csv"] == content(tmp_path / "b")["history.csv"]


def test_errors_of_runs_have_names(beam: vs.Scene, tmp_path: pathlib.Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(vs.OutputError):
        vs.run(beam, tmp_path / "file" / "out", quiet=True)
    with pytest.raises(vs.SceneError, match="names of files"):
        vs.run(beam.named("a/b"), tmp_path / "a", quiet=True)
    with pytest.raises(vs.StepError):
        # Without this guard the run would go back and halve its step.
        unstable = beam.set({"time.step": 0.05, "time.end": 50.0, "guard": {"action": "warn"}})
        vs.run(unstable, tmp_path / "b", quiet=True)
    assert json.loads((tmp_path / "b" / "report.json").read_text())["outcome"] != "done"

    def wrong(t: float, end: float, rate: float) -> None:
        raise LookupError("progress")

    with pytest.raises(LookupError, match="progress"):
        vs.run(beam.set({"time.end": 100.0}), tmp_path / "c", progress=wrong)


def test_notes_go_to_logging(beam: vs.Scene, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="variational"):
        vs.run(beam.set({"time.scheme": "auto"}), quiet=True)
    assert any("stormer-verlet" in record.message or "auto" in record.message for record in caplog.records)


def test_a_bar_of_tqdm_follows_the_run(beam: vs.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    class Bar:
        def __init__(self, total: float, **options: Any) -> None:
            self.n, self.total, self.is_open = 0.0, total, True
            bars.append(self)

        def update(self, more: float) -> None:
            self.n += more

        def close(self) -> None:
            self.is_open = False

    bars: list[Bar] = []
    module: Any = types.ModuleType("tqdm.auto")
    module.tqdm = Bar
    monkeypatch.setitem(sys.modules, "tqdm.auto", module)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    scene = beam.set({"time.end": 5.0})
    vs.run(scene)
    assert not bars, "nobody looks at a pipe"
    # A notebook.
    monkeypatch.setitem(sys.modules, "ipykernel", types.ModuleType("ipykernel"))
    vs.run(scene, quiet=True)
    assert not bars
    vs.run(scene)
    [bar] = bars
    assert bar.total == 5.0 and 0.0 < bar.n <= 5.0 and not bar.is_open


def lowest(scene: vs.Scene, young: float) -> float:
    return float(vs.run(scene.set({"body[0].material.young": young}), quiet=True, threads=1).history["tip.uy"].min())


def test_other_processes_run_scenes(beam: vs.Scene) -> None:
    values = [1e5, 1e6]
    expected = [lowest(beam, young) for young in values]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert list(pool.map(lowest, [beam, beam], values)) == expected


@pytest.mark.timing
@pytest.mark.parametrize("scheme, step", [("stormer-verlet", 2e-5), ("implicit-midpoint", 1e-3), ("auto", None)])
def test_ctrl_c_returns_within_a_fifth_of_a_second(scheme: str, step: float | None, tmp_path: pathlib.Path) -> None:
    keys = beam_keys(time=dict(end=100.0, step=step, scheme=scheme), output=OUTPUT)
    keys["body"][0]["box"] = dict(size=[1.0, 0.2, 0.2], cells=[20, 4, 4])
    sent: list[float] = []

    def interrupt() -> None:
        # The processor's time, which other programs on the machine do not change.
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(1.0, interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        vs.run(vs.Scene(keys), tmp_path, quiet=True, threads=1)
    assert time.process_time() - sent[0] < 0.2


@pytest.mark.timing
def test_two_threads_step_at_the_same_time(beam: vs.Scene) -> None:
    if (os.cpu_count() or 1) < 2 or os.getloadavg()[0] > 0.8:
        pytest.skip("the machine has no two free cores")
    keys = beam_keys(time=dict(end=10.0, step=1e-4, scheme="stormer-verlet"))
    keys["body"][0]["box"] = dict(size=[1.0, 0.2, 0.2], cells=[20, 4, 4])
    simulations = [vs.Simulation(vs.Scene(keys), threads=1) for _ in range(2)]
    begin = time.perf_counter()
    simulations[0].step(5000)
    one = time.perf_counter() - begin
    workers = [threading.Thread(target=simulation.step, args=(5000,)) for simulation in simulations]
    begin = time.perf_counter()
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert time.perf_counter() - begin < 1.2 * one


@pytest.mark.timing
def test_a_call_costs_less_than_fifty_microseconds(beam: vs.Scene) -> None:
    def seconds(calls: int, each: int) -> float:
        simulation = vs.Simulation(beam.set({"time.end": 10.0}), threads=1)
        begin = time.process_time()
        for _ in range(calls):
            simulation.step(each)
        return time.process_time() - begin

    single = min(seconds(2000, 1) for _ in range(3))
    joined = min(seconds(1, 2000) for _ in range(3))
    assert (single - joined) / 2000 < 50e-6
