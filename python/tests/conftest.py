"""Small scenes for all tests."""

from __future__ import annotations

import os
import pathlib
import signal
import shutil
from typing import Any

import pytest
import variational_sim as vs

ROOT = pathlib.Path(__file__).parents[2]

RUBBER = dict(law="neo-hookean", young=1e6, poisson=0.3, density=1000.0)


def beam_keys(**keys: Any) -> dict[str, Any]:
    """A rubber beam that bends under its weight, with a probe at its tip."""
    box = dict(size=[1.0, 0.2, 0.2], cells=[5, 1, 1], element="tet4")
    tree: dict[str, Any] = dict(
        gravity=[0.0, -9.81, 0.0],
        time=dict(end=0.1, step=1e-3, scheme="stormer-verlet"),
        body=[dict(name="beam", box=box, material=RUBBER)],
        fix=[dict(body="beam", region="x-min")],
        probe=[dict(name="tip", body="beam", point=[1.0, 0.2, 0.2])],
    )
    return {**tree, **keys}


def free_cube(scheme: str = "energy-momentum", **keys: Any) -> dict[str, Any]:
    """A free rubber cube just above z = 0 that moves down."""
    box = dict(size=[0.1, 0.1, 0.1], cells=[2, 2, 2], origin=[0.0, 0.0, 0.002])
    body = dict(name="cube", box=box, material=RUBBER, velocity=[0.0, 0.0, -0.5])
    tree: dict[str, Any] = dict(time=dict(end=0.02, step=2e-4, scheme=scheme), body=[body])
    return {**tree, **keys}


@pytest.fixture
def beam() -> vs.Scene:
    return vs.Scene(beam_keys())


@pytest.fixture(scope="session")
def program() -> str:
    """The program that cargo built."""
    found = os.environ.get("VARIATIONAL_PROGRAM") or shutil.which("variational", path=str(ROOT / "target" / "release"))
    if found is None:
        pytest.skip("VARIATIONAL_PROGRAM does not name cargo's program")
    return found


@pytest.fixture(autouse=True, scope="session")
def interrupts() -> None:
    """Python ignores SIGINT where a shell starts it in the background; the tests of Ctrl-C need it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
