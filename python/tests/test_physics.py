"""Own physics: potentials, forces, laws as formulas, motions; and their exceptions."""

from __future__ import annotations

import math
import pickle
import time
from typing import Any

import numpy as np
import pytest
import variational_sim as vs
from conftest import RUBBER, beam_keys, free_cube

FLOOR = 2e4


class Floor:
    """V = k/3 |z|³ of each node below z = 0; twice differentiable."""

    name = "floor"

    def __init__(self, count: int = 27) -> None:
        self.nodes = np.arange(count)[:, None]
        self.calls = 0

    def energy(self, x: Any) -> Any:
        return 1e4 * FLOOR / 3 * np.minimum(x[:, 0, 2], 0.0) ** 2 * -np.minimum(x[:, 0, 2], 0.0)

    def gradient(self, x: Any) -> Any:
        self.calls += 1
        out = np.zeros_like(x)
        out[:, 0, 2] = -1e4 * FLOOR * np.minimum(x[:, 0, 2], 0.0) ** 2
        return out


class FloorWithHessian(Floor):
    def hessian(self, x: Any) -> Any:
        out = np.zeros((len(x), 1, 3, 1, 3))
        out[:, 0, 2, 0, 2] = -2e4 * FLOOR * np.minimum(x[:, 0, 2], 0.0)
        return out


@pytest.mark.parametrize("floor", [Floor(), FloorWithHessian()])
def test_a_floor_closes_the_energy_balance(floor: Floor) -> None:
    scene = vs.Scene(free_cube(solver=dict(tolerance=1e-14)))
    simulation = vs.Simulation(scene, threads=2, potentials={"cube": floor})
    start, most = simulation.observe(), 0.0
    for _ in simulation.every(simulation.h):
        seen = simulation.observe()
        most = max(most, seen.load)
        assert abs(seen.total - start.total) < 1e-12 * start.total
    assert most > 0.1 * start.total
    assert simulation["cube"].v[:, 2].mean() > 0.0


def test_a_potential_is_called_once_per_evaluation() -> None:
    keys = free_cube("stormer-verlet")
    keys["body"][0]["box"]["cells"] = [10, 10, 10]
    floor = Floor(1331)
    simulation = vs.Simulation(vs.Scene(keys), threads=2, potentials={"cube": floor})
    before, work = floor.calls, simulation.work()
    simulation.step(20)
    after = simulation.work()
    evaluations = max(after[key] - work[key] for key in work if "gradient" in key or "force" in key)
    assert 0 < floor.calls - before <= evaluations


def test_a_force_is_booked_and_does_the_work_that_it_should() -> None:
    def drag(x: Any, v: Any, t: float) -> Any:
        return -0.5 * v

    def push(x: Any, v: Any, t: float) -> Any:
        out = np.zeros_like(x)
        out[:, 0] = math.sin(t)
        return out

    scene = vs.Scene(free_cube("stormer-verlet"))
    pushed, dragged = (vs.Simulation(scene, threads=1, forces={"cube": force}) for force in (push, [drag, push]))
    pushed.run()
    dragged.run()
    # ṗ_x = Σ sin t, and with drag less
    expected = 27 * (1 - math.cos(pushed.t))
    assert pushed.observe().momentum[0] == pytest.approx(expected, rel=1e-3)
    assert 0.0 < dragged.observe().momentum[0] < expected
    assert dragged.observe().momentum[2] > pushed.observe().momentum[2]


def test_an_exception_ends_the_step_and_leaves_the_state() -> None:
    class Trouble(Exception):
        pass

    class Breaks(Floor):
        broken = False

        def gradient(self, x: Any) -> Any:
            if self.broken:
                raise Trouble("no more")
            return super().gradient(x)

    for scheme in ("stormer-verlet", "energy-momentum", "implicit-midpoint"):
        floor = Breaks()
        simulation = vs.Simulation(vs.Scene(free_cube(scheme)), threads=2, potentials={"cube": floor})
        simulation.step(5)
        x, v = simulation["cube"].x, simulation["cube"].v
        floor.broken = True
        with pytest.raises(Trouble, match="no more"):
            simulation.step(5)
        assert simulation.steps == 5
        np.testing.assert_array_equal(simulation["cube"].x, x)
        np.testing.assert_array_equal(simulation["cube"].v, v)
        floor.broken = False
        simulation.step(5)
        clean = vs.Simulation(vs.Scene(free_cube(scheme)), threads=1, potentials={"cube": Floor()})
        clean.step(10)
        np.testing.assert_array_equal(simulation["cube"].x, clean["cube"].x)


def test_wrong_terms_are_refused_with_the_reason() -> None:
    scene = vs.Scene(free_cube())

    class Wrong(Floor):
        def gradient(self, x: Any) -> Any:
            return np.zeros(3)

    with pytest.raises(ValueError, match="no deformable body 'cub'"):
        vs.Simulation(scene, potentials={"cub": Floor()})
    with pytest.raises(ValueError, match="nodes 0 to 26"):
        vs.Simulation(scene, potentials={"cube": Floor(100)})
    with pytest.raises(ValueError, match="has no `nodes`"):
        vs.Simulation(scene, potentials={"cube": 3.0})
    with pytest.raises(ValueError, match="f\\(x, v, t\\)"):
        vs.Simulation(scene, forces={"cube": 3.0})
    with pytest.raises(ValueError, match=r"gradient of Wrong: expected an array of shape \[27, 1, 3\]"):
        vs.Simulation(scene, potentials={"cube": Wrong()}).step()


def test_simulations_with_own_physics_pickle() -> None:
    simulation = vs.Simulation(vs.Scene(free_cube()), threads=1, potentials={"cube": Floor()})
    simulation.step(10)
    again = pickle.loads(pickle.dumps(simulation))
    restored = vs.Simulation.restore(simulation.snapshot(), potentials={"cube": Floor()})
    simulation.step(20)
    for other in (again, restored):
        other.step(20)
        np.testing.assert_array_equal(other["cube"].x, simulation["cube"].x)


LAMBDA, MU = 1e6 * 0.3 / (1.3 * 0.4), 1e6 / 2.6
FORMULA = dict(
    law="formula",
    energy="mu/2*(I1 - 3 - 2*log(J)) + lambda/2*log(J)^2",
    constants={"mu": MU, "lambda": LAMBDA},
    density=1000.0,
)


def test_a_law_as_a_formula_is_the_law() -> None:
    for scheme in ("stormer-verlet", "implicit-midpoint"):
        ends = []
        for material in (RUBBER, FORMULA):
            keys = beam_keys(time=dict(end=0.05, step=1e-3, scheme=scheme), solver=dict(tolerance=1e-14))
            keys["body"][0]["material"] = material
            simulation = vs.Simulation(vs.Scene(keys), threads=1)
            simulation.run()
            ends.append(simulation["beam"].u)
        # Fifty steps amplify the round-off of 1e-14 per evaluation.
        assert abs(ends[0] - ends[1]).max() < 1e-12 * abs(ends[0]).max()
    scene = vs.Scene(keys)
    assert pickle.loads(pickle.dumps(scene)) == scene
    assert scene.set({"body[0].material.constants.mu": 2 * MU}).to_dict()["body"][0]["material"]["constants"]["mu"] == 2 * MU


def test_a_formula_gives_the_stress_and_the_forces_of_the_law() -> None:
    found = []
    for material in (RUBBER, FORMULA):
        keys = beam_keys()
        keys["body"][0]["material"] = material
        body = (simulation := vs.Simulation(vs.Scene(keys), threads=1))["beam"]
        x = body.x
        body.x = x + 0.05 * np.sin(7.0 * x[:, ::-1])
        found.append([body.stress(), body.a, body.stress("energy_density"), simulation.observe().elastic])
    for law, formula in zip(*found):
        np.testing.assert_allclose(formula, law, rtol=0.0, atol=1e-12 * np.max(np.abs(law)))


def test_a_wrong_formula_is_a_problem_with_its_key() -> None:
    for energy, words in [("mu*(I1 - 3", "expected"), ("mu*(I1 - 3)", "stress at rest"), ("nu*I1", "not `nu`")]:
        keys = beam_keys()
        keys["body"][0]["material"] = {**FORMULA, "energy": energy}
        with pytest.raises(vs.SceneError, match=words) as caught:
            vs.Scene(keys).check()
        assert caught.value.problems[0].key.startswith("body[0].material")


@pytest.mark.timing
def test_a_formula_costs_less_than_three_times_the_law() -> None:
    def seconds(material: dict[str, Any]) -> float:
        keys = beam_keys(time=dict(end=1.0, step=1e-4, scheme="stormer-verlet"))
        keys["body"][0] |= dict(material=material, box=dict(size=[1.0, 0.2, 0.2], cells=[20, 8, 8]))
        simulation = vs.Simulation(vs.Scene(keys), threads=1)
        times = []
        for _ in range(5):
            begin = time.process_time()
            simulation.step(50)
            times.append(time.process_time() - begin)
        return min(times)

    assert seconds(FORMULA) < 3.0 * seconds(RUBBER)


class Swing:
    """Swings along z, with a velocity of its own."""

    def __call__(self, x: Any, t: float) -> Any:
        return x + [0.0, 0.0, 0.01 * (1 - math.cos(20.0 * t))]

    def velocity(self, x: Any, t: float) -> Any:
        return np.zeros_like(x) + [0.0, 0.0, 0.2 * math.sin(20.0 * t)]


def differenced(x: Any, t: float) -> Any:
    return x + [0.0, 0.0, 0.01 * (1 - math.cos(20.0 * t))]


@pytest.mark.parametrize("motion, tolerance", [(Swing(), 1e-14), (differenced, 1e-9)])
def test_a_motion_moves_the_support(motion: Any, tolerance: float) -> None:
    keys = beam_keys(gravity=[0.0, 0.0, 0.0])
    formula = beam_keys(gravity=[0.0, 0.0, 0.0])
    # 1 − cos ωt = sin(ωt − π/2) − sin(−π/2)
    formula["fix"][0]["motion"] = dict(kind="sine", amplitude=[0, 0, 0.01], frequency=20.0 / math.tau, phase=-math.pi / 2)
    keys["fix"][0]["motion"] = motion
    ends = []
    for tree in (keys, formula):
        scene = vs.Scene(tree)
        simulation = vs.Simulation(pickle.loads(pickle.dumps(scene)), threads=1)
        simulation.run()
        ends.append((simulation["beam"].x, simulation["beam"].v))
    for a, b in zip(*ends):
        np.testing.assert_allclose(a, b, atol=tolerance * 10)


def test_an_exception_of_a_motion_is_raised() -> None:
    def late(x: Any, t: float) -> Any:
        if t > 0.0105:
            raise ZeroDivisionError("late")
        return x

    keys = beam_keys()
    keys["fix"][0]["motion"] = late
    simulation = vs.Simulation(vs.Scene(keys), threads=1)
    with pytest.raises(ZeroDivisionError, match="late"):
        simulation.run()
    assert simulation.steps in (9, 10) and np.isfinite(simulation["beam"].x).all()
