"""Simulations: steps, arrays, snapshots, and the errors of wrong use."""

from __future__ import annotations

import copy
import os
import pickle
import signal
import threading
import time

import numpy as np
import pytest
import variational_sim as vs
from conftest import beam_keys, free_cube

FINE = dict(size=[1.0, 0.2, 0.2], cells=[20, 4, 4], element="tet4")


def heavy(end: float = 20.0) -> vs.Scene:
    """A scene whose run takes many seconds."""
    keys = beam_keys(time=dict(end=end, step=1e-4, scheme="stormer-verlet"))
    keys["body"][0]["box"] = FINE
    return vs.Scene(keys)


def test_bits_do_not_depend_on_threads_or_calls(beam: vs.Scene) -> None:
    scene = beam.set({"time.end": 1.0})
    expected = None
    for threads, calls in [(1, [1000]), (2, [1] * 1000), (8, [7] * 142 + [6])]:
        with vs.Simulation(scene, threads=threads) as simulation:
            for count in calls:
                simulation.step(count)
            assert simulation.is_done and simulation.steps == 1000
            seen = np.concatenate([simulation["beam"].x, simulation["beam"].v])
        expected = seen if expected is None else expected
        np.testing.assert_array_equal(seen, expected)


@pytest.mark.parametrize("scheme", ["stormer-verlet", "implicit-midpoint", "energy-momentum"])
def test_snapshots_and_pickles_continue_with_the_same_bits(beam: vs.Scene, scheme: str) -> None:
    simulation = vs.Simulation(beam.set({"time.scheme": scheme}), threads=1)
    simulation.step(40)
    copies = [
        vs.Simulation.restore(simulation.snapshot(), threads=2),
        pickle.loads(pickle.dumps(simulation)),
        copy.deepcopy(simulation),
    ]
    simulation.step(60)
    for other in copies:
        assert other.steps == 40
        other.step(60)
        np.testing.assert_array_equal(other["beam"].x, simulation["beam"].x)
        np.testing.assert_array_equal(other["beam"].v, simulation["beam"].v)


def test_a_snapshot_holds_the_mesh_and_knows_damage() -> None:
    points, cells = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], {"tet4": [[0, 1, 2, 3]]}
    material = dict(law="neo-hookean", young=1e6, poisson=0.3, density=1e3)
    body = dict(name="a", mesh=(points, cells, {"all/of it": [0]}), material=material)
    simulation = vs.Simulation(vs.Scene(time=dict(end=1.0, step=1e-3, scheme="gauss"), body=[body]), threads=1)
    simulation["a"].v = np.outer(np.arange(4.0), [0.0, 0.0, 1.0])
    simulation.step(3)
    data = simulation.snapshot()
    again = vs.Simulation.restore(data, threads=1)
    np.testing.assert_array_equal(again["a"].x, simulation["a"].x)
    assert again["a"].mesh.regions == {"all/of it": [0]}
    for damaged in (b"", b"not a snapshot", data[: len(data) // 2]):
        with pytest.raises(vs.CheckpointError):
            vs.Simulation.restore(damaged)


def test_arrays_are_snapshots_that_own_their_memory(beam: vs.Scene) -> None:
    simulation = vs.Simulation(beam, threads=1)
    body = simulation["beam"]
    x = body.x
    before = x.copy()
    assert x.dtype == np.float64 and x.flags.c_contiguous and x.flags.writeable and x.shape == (24, 3)
    simulation.step(10)
    np.testing.assert_array_equal(x, before)
    assert not np.array_equal(body.x, before)
    for name in ("v", "a", "u", "reactions", "external_forces"):
        assert getattr(body, name).shape == (24, 3)
    assert body.stress().shape == (30, 3, 3) and body.stress("von_mises").shape == (30,)
    np.testing.assert_array_equal(body.stress("cauchy"), body.stress())
    # The sum of the forces of the supports and of gravity changes the momentum.
    mass = 1000.0 * 0.04
    np.testing.assert_allclose(body.external_forces.sum(axis=0), [0.0, -9.81 * mass, 0.0], atol=1e-9)


def test_arrays_can_be_read_into_memory_of_the_caller(beam: vs.Scene) -> None:
    simulations = [vs.Simulation(beam.set({"gravity": [0.0, g, 0.0]}), threads=1) for g in (-1.0, -2.0)]
    batch = np.zeros((2, 24, 3))
    for simulation, part in zip(simulations, batch):
        simulation.step(10)
        assert simulation["beam"].read("x", out=part) is part
    for simulation, part in zip(simulations, batch):
        np.testing.assert_array_equal(part, simulation["beam"].x)
        np.testing.assert_array_equal(simulation["beam"].read("v"), simulation["beam"].v)
    wrong: list[object] = [batch, np.zeros((24, 3), np.float32), [[0.0] * 3] * 24]
    for out in wrong:
        with pytest.raises(ValueError, match=r"out: expected an array of float64 and shape \(24, 3\)"):
            simulations[0]["beam"].read("x", out=out)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="use x, v, u"):
        simulations[0]["beam"].read("y")


def test_assignment_is_checked_and_booked(beam: vs.Scene) -> None:
    simulation = vs.Simulation(beam, threads=1)
    body = simulation["beam"]
    simulation.step(20)
    kinetic, before = simulation.observe().kinetic, simulation.ledger()["force"]
    body.v = 0.0 * body.v
    assert simulation.observe().kinetic == 0.0
    simulation.step()
    assert simulation.ledger()["force"] - before == pytest.approx(-kinetic, rel=1e-10)
    x = body.x
    free = x[:, 0] > 0.0
    moved = x + 0.01 * free[:, None]
    body.x = moved.tolist()
    np.testing.assert_allclose(body.x, moved, atol=1e-15)
    for wrong, words in [
        (x[:-1], "shape"),
        (x[:, :2], "shape"),
        (x.ravel(), "shape"),
        (np.full_like(x, np.nan), "finite"),
        (x.astype(complex), "dtype"),
        (x.astype(str), "dtype"),
    ]:
        with pytest.raises(ValueError, match=words):
            body.x = wrong
        with pytest.raises(ValueError, match="^v: "):
            body.v = wrong
    np.testing.assert_allclose(body.x, moved, atol=1e-15)


@pytest.mark.parametrize("scheme", ["stormer-verlet", "implicit-midpoint", "energy-momentum"])
def test_the_ledger_explains_the_change_of_energy(scheme: str) -> None:
    keys = beam_keys(time=dict(end=0.1, step=1e-3, scheme=scheme), output=dict(ledger=True))
    simulation = vs.Simulation(vs.Scene(keys), threads=1)
    start, most = simulation.observe().total, 0.0
    for step in range(30):
        if step == 10:
            simulation["beam"].v = 2.0 * simulation["beam"].v
        simulation.step()
        seen = simulation.observe()
        most = max(most, seen.kinetic)
        assert abs(seen.total - start - sum(simulation.ledger().values())) < 1e-10 * most
    assert simulation.ledger()["force"] > 0.0
    assert not any(vs.Simulation.restore(simulation.snapshot()).ledger().values())


def test_matrices_are_those_of_the_system(beam: vs.Scene) -> None:
    pytest.importorskip("scipy")
    simulation = vs.Simulation(beam, threads=1)
    mass, stiffness, residual, free = simulation.matrices()
    assert mass.shape == stiffness.shape == (len(residual),) * 2 == (60, 60)
    assert abs(stiffness - stiffness.T).max() == 0.0
    # M ẍ = f − ∂V/∂x
    a = simulation["beam"].a[free[:, 1], free[:, 2]]
    np.testing.assert_allclose(mass @ a, residual, atol=1e-9 * abs(residual).max())
    # K is the derivative of the residual
    body, direction = simulation["beam"], np.zeros((24, 3))
    direction[free[:, 1], free[:, 2]] = np.sin(np.arange(60.0))
    x = body.x
    body.x = x + 1e-6 * direction
    ahead = simulation.matrices()[2]
    body.x = x - 1e-6 * direction
    behind = simulation.matrices()[2]
    expected = stiffness @ np.sin(np.arange(60.0))
    np.testing.assert_allclose((behind - ahead) / 2e-6, expected, rtol=1e-5, atol=1e-5 * abs(expected).max())


def test_every_yields_at_multiples(beam: vs.Scene) -> None:
    simulation = vs.Simulation(beam.set({"time.end": 0.01}), threads=1)
    assert [round(t, 6) for t in simulation.every(0.004)] == [0.004, 0.008, 0.01]
    seen: list[float] = []
    simulation = vs.Simulation(beam.set({"time.end": 0.003}), threads=1)
    simulation.run(lambda simulation: seen.append(simulation.t))
    assert [round(t, 6) for t in seen] == [0.001, 0.002, 0.003]
    with pytest.raises(ValueError, match="ends after 0 more steps"):
        simulation.step()


def test_observations_name_the_probes(beam: vs.Scene) -> None:
    simulation = vs.Simulation(beam, threads=1)
    simulation.step(50)
    seen = simulation.observe()
    assert seen.t == simulation.t == 0.05
    assert abs(seen.total - seen.kinetic - seen.elastic - seen.gravity) < 1e-12
    np.testing.assert_array_equal(seen.probes["tip"].displacement, seen.probes["tip"].position - [1.0, 0.2, 0.2])
    assert seen.probes["tip"].position[1] < 0.2
    assert simulation.work()
    assert "kinetic" in simulation._repr_html_() and "step 50 of 100" in repr(simulation)


def test_a_failed_step_leaves_the_state_and_names_the_element() -> None:
    scene = vs.Scene(free_cube("stormer-verlet", time=dict(end=10.0, step=0.05, scheme="stormer-verlet")))
    simulation = vs.Simulation(scene, threads=1)
    simulation["cube"].v = 200.0 * np.sin(np.arange(81.0)).reshape(27, 3)
    before = None
    with pytest.raises(vs.StepError) as caught:
        while True:
            before = simulation["cube"].x
            simulation.step()
    np.testing.assert_array_equal(simulation["cube"].x, before)
    error = caught.value
    assert isinstance(error, ArithmeticError)
    assert error.h is not None and error.step is not None
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
    assert pickle.loads(pickle.dumps(error)).step == error.step


def test_ctrl_c_ends_between_steps() -> None:
    simulation = vs.Simulation(heavy(), threads=1)
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        simulation.step(simulation.step_count)
    assert 0 < simulation.steps < simulation.step_count
    other = vs.Simulation(simulation.scene, threads=2)
    other.step(simulation.steps)
    np.testing.assert_array_equal(other["beam"].x, simulation["beam"].x)


def test_a_second_thread_gets_an_error_and_does_not_wait() -> None:
    simulation = vs.Simulation(heavy(), threads=1)
    worker = threading.Thread(target=lambda: simulation.step(2000))
    worker.start()
    found = 0
    while worker.is_alive():
        try:
            simulation.t
        except vs.BusyError:
            found += 1
        time.sleep(0.005)
    worker.join()
    assert found > 0 and simulation.steps == 2000


def test_closed_and_unknown(beam: vs.Scene) -> None:
    with vs.Simulation(beam, threads=1) as simulation:
        body = simulation["beam"]
        with pytest.raises(KeyError, match="there are: beam"):
            simulation["bean"]
        with pytest.raises(ValueError, match="von_mises"):
            body.stress("heat")
    for use in (lambda: simulation.step(), lambda: body.x, lambda: simulation.close()):
        with pytest.raises(vs.ClosedError):
            use()
    with pytest.raises(ValueError, match="threads"):
        vs.Simulation(beam, threads=0)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_child_gets_an_error_and_can_make_its_own(beam: vs.Scene) -> None:
    simulation = vs.Simulation(beam, threads=2)
    child = os.fork()
    if child == 0:
        code = 1
        try:
            simulation.step()
        except vs.ForkError:
            del simulation
            own = vs.Simulation(beam, threads=2)
            own.step()
            code = 0
        os._exit(code)
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            assert os.waitstatus_to_exitcode(status) == 0
            break
        time.sleep(0.01)
    else:
        os.kill(child, signal.SIGKILL)
        pytest.fail("the child hangs")
    simulation.step()
