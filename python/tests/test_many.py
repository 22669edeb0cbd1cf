"""Many runs: executors, sweeps that are killed, random scenes, memory."""

from __future__ import annotations

import ctypes
import json
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest
import variational_sim as vs
from conftest import beam_keys

YOUNG = [1e5, 3e5, 1e6]


def lowest(scene: vs.Scene, young: float) -> float:
    return float(vs.run(scene.set({"body[0].material.young": young}), quiet=True, threads=1).history["tip.uy"].min())


@pytest.fixture(scope="module")
def scene() -> vs.Scene:
    return vs.Scene(beam_keys(time=dict(end=0.02, step=1e-3, scheme="stormer-verlet")))


@pytest.fixture(scope="module")
def expected(scene: vs.Scene) -> list[float]:
    return [lowest(scene, young) for young in YOUNG]


def test_joblib(scene: vs.Scene, expected: list[float]) -> None:
    joblib = pytest.importorskip("joblib")
    assert joblib.Parallel(2)(joblib.delayed(lowest)(scene, young) for young in YOUNG) == expected


def test_dask(scene: vs.Scene, expected: list[float], tmp_path: pathlib.Path) -> None:
    distributed = pytest.importorskip("distributed")
    options: dict[str, Any] = dict(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with distributed.LocalCluster(**options, local_directory=str(tmp_path)) as cluster:
        with distributed.Client(cluster) as client:
            assert client.gather(client.map(lowest, [scene] * len(YOUNG), YOUNG)) == expected


def test_submitit(
    scene: vs.Scene, expected: list[float], tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    submitit = pytest.importorskip("submitit")
    # The processes of a job import this file.
    monkeypatch.setenv("PYTHONPATH", str(pathlib.Path(__file__).parent))
    executor = submitit.LocalExecutor(folder=tmp_path)
    executor.update_parameters(timeout_min=2)
    jobs = executor.map_array(lowest, [scene] * len(YOUNG), YOUNG)
    assert [job.result() for job in jobs] == expected


def test_ray(scene: vs.Scene, expected: list[float]) -> None:
    ray = pytest.importorskip("ray")
    # Its processes import this file.
    environment = dict(env_vars={"PYTHONPATH": str(pathlib.Path(__file__).parent)})
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, runtime_env=environment)
    try:
        remote = ray.remote(lowest)
        assert ray.get([remote.remote(scene, young) for young in YOUNG]) == expected
    finally:
        ray.shutdown()


def test_a_slurm_array_gives_the_table_of_one_process(program: str, tmp_path: pathlib.Path) -> None:
    """Needs sbatch and a running cluster, which may be slurmctld, slurmd and munged on one machine."""
    if shutil.which("sbatch") is None:
        pytest.skip("sbatch is not there")
    try:
        subprocess.run(["sinfo"], capture_output=True, timeout=10, check=True)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
        pytest.skip("no cluster answers")
    (tmp_path / "scene.toml").write_text(vs.Scene(beam_keys()).to_toml())
    command = [program, "sweep", "scene.toml", "--over", "body.0.material.young=1e4:1e7:log30", "--jobs", "1", "--quiet"]
    subprocess.run([*command, "--out", "whole"], cwd=tmp_path, check=True)
    task = shlex.join([*command, "--out", "array", "--task"]) + " $SLURM_ARRAY_TASK_ID/10"
    subprocess.run(["sbatch", "--wait", "--array=0-9", "--wrap", task], cwd=tmp_path, check=True)
    table = (tmp_path / "whole" / "sweep.csv").read_bytes()
    assert (tmp_path / "array" / "sweep.csv").read_bytes() == table


def test_a_sweep_that_is_killed_again_and_again_ends_with_the_same_bytes(program: str, tmp_path: pathlib.Path) -> None:
    keys = beam_keys(time=dict(end=0.03, step=1e-4, scheme="stormer-verlet"), checkpoint=dict(interval=0.01))
    (tmp_path / "scene.toml").write_text(vs.Scene(keys).to_toml())
    command = [program, "sweep", "scene.toml", "--over", "body.0.material.young=1e4:1e7:log50"]
    # A negative step is refused: 50 points are rows with a reason.
    command += ["--over", "time.step=1e-4,-1.0", "--jobs", "2", "--quiet"]
    subprocess.run([*command, "--out", "whole"], cwd=tmp_path, check=True)
    random, kills = np.random.default_rng(3), 0
    while True:
        sweep = subprocess.Popen([*command, "--out", "killed"], cwd=tmp_path)
        try:
            assert sweep.wait(float(random.uniform(0.1, 0.3)) * (1 + kills)) == 0
            break
        except subprocess.TimeoutExpired:
            sweep.kill()
            sweep.wait()
            kills += 1
    assert kills > 0
    table = (tmp_path / "whole" / "sweep.csv").read_bytes()
    assert (tmp_path / "killed" / "sweep.csv").read_bytes() == table
    lines = table.decode().splitlines()
    assert len(lines) == 101 and sum("must be positive" in line for line in lines) == 50


def test_violent_scenes_end_or_fail_by_name(program: str, tmp_path: pathlib.Path) -> None:
    """The scenes of `variational stress`: each ends, is interrupted at its time limit, or fails with a named error."""
    count = int(os.environ.get("VARIATIONAL_STRESS", "60"))
    subprocess.run([program, "stress", "--count", str(count), "--write", tmp_path, "--quiet"], check=True)
    paths = sorted(tmp_path.glob("*.toml"))
    assert len(paths) == count

    class Late(Exception):
        pass

    def watch(t: float, end: float, rate: float) -> None:
        if time.monotonic() > limit:
            raise Late

    ends = dict(done=0, failed=0, refused=0, late=0)
    for path in paths:
        limit = time.monotonic() + 1.0
        try:
            vs.run(vs.Scene(path), progress=watch, threads=1)
            ends["done"] += 1
        except vs.SceneError as error:
            assert error.problems
            ends["refused"] += 1
        except vs.StepError as error:
            assert str(error)
            ends["failed"] += 1
        except Late:
            ends["late"] += 1
    print(ends)
    assert ends["done"] > count // 3 and ends["refused"] < count // 10


MEMORY = """
import ctypes, json, os, sys
import variational_sim as vs

scene = vs.Scene(json.loads(sys.argv[1]))

def make(count):
    for _ in range(count):
        simulation = vs.Simulation(scene, threads=1)
        simulation.step(2)
        simulation["beam"].x

def resident():
    # glibc keeps up to 6 MB of freed memory, more or less by chance; this returns it to the system.
    ctypes.CDLL(None).malloc_trim(0)
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

def least():
    # Whether the C library still holds the 4 MB of the last simulation varies from one to the next.
    found = []
    for _ in range(8):
        make(25)
        found.append(resident())
    return min(found)

# The first simulations fill what the process keeps.
make(100)
before = least()
make(1000)
print(least() - before)
"""


def test_memory_is_flat_over_a_thousand_simulations() -> None:
    if not os.path.exists("/proc/self/statm") or not hasattr(ctypes.CDLL(None), "malloc_trim"):
        pytest.skip("/proc or malloc_trim is not there")
    # A process of its own: the threads of other tests, which end while this one measures, hold megabytes.
    command = [sys.executable, "-c", MEMORY, json.dumps(beam_keys())]
    growth = int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    # 0.1 MB were measured, because the threads of a simulation have freed their memory when it is dropped. A simulation
    # of this beam holds 4 MB while it steps, and 100 kB otherwise.
    assert growth < 1000 * 1000
