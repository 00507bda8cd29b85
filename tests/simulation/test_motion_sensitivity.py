"""Derivatives of motions, forward in time, against motions beside them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bodies import sensitivities
from mechanism_numbers import numbers_of, scales_of, with_numbers
from numpy.typing import NDArray
from shapes import cube
from verification_rows import Row

from warpbrain.errors import InputError
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.drainage import Drainage
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.traction import Traction
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import Damping, Material, Model, with_mechanisms
from warpbrain.simulation.motion_sensitivity import MotionSensitivity, follow
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]
MU = 1000.0
BRANCHES = Viscoelasticity(moduli=(2.0, 0.5), times=(0.05, 2.0))
SLOW = Viscoelasticity(moduli=(2.0, 0.5), times=(2.0, 30.0))
#: Fluid with all that it can have, whose pressure spreads over the block within 0.1 s.
FLUID = Drainage(
    permeability=1e-3,
    storage=1e-5,
    drained="wall",
    pressure=30.0,
    exchange=1e-3,
    capillary_pressure=80.0,
    ramp=[(0.0, 0.5), (0.1, 1.0)],
)
#: One whose pressure spreads over it within some seconds.
SLOW_FLUID = replace(FLUID, permeability=1e-4, storage=1e-4, exchange=1e-4, ramp=[(0.0, 0.5), (3.0, 1.0)])
LOADS: tuple[Mechanism, ...] = (
    Pressure(nodes="wall", value=80.0, ramp=[(0.0, 0.0), (0.2, 1.0)]),
    Swelling(amount=0.1, ramp=[(0.0, 0.0), (0.3, 1.0)]),
    # off the top: on it, a small move off it would change nothing
    Traction(centre=(0.5, 0.5, 1.1), value=(60.0, 0.0, -100.0), radius=0.8, ramp=[(0.0, 0.2), (0.1, 1.0)]),
)


def block(elements: str = "tet4") -> Model:
    """A block on a table, a part of whose top is moved sideways as time goes on."""
    mesh = cube(2)
    x, z = mesh.points[:, 0], mesh.points[:, 2]
    grip = (z > 1.0 - 1e-9) & (x < 1e-9)
    mesh = replace(mesh, node_sets={"wall": x > 1.0 - 1e-9})
    constrained = np.repeat(((z < 1e-9) | grip)[:, None], 3, axis=1)
    prescribed = np.where(grip[:, None], [0.05, 0.0, 0.02], 0.0)
    material = {1: Material(NeoHookean(MU), 0.4)}
    return Model(mesh, material, 100.0, constrained, prescribed, damping=Damping(0.002, 0.1), elements=elements)


def by_numbers(plain: Model, acting: tuple[Mechanism, ...]) -> tuple[Callable[[Floats], Model], Floats, Floats]:
    """Models by numbers of mechanisms and, last, the logarithm of the shear modulus."""
    numbers = numbers_of(acting)

    def models(theta: Floats) -> Model:
        material = replace(plain.materials[1], law=NeoHookean(MU * float(np.exp(theta[-1]))))
        return with_mechanisms(replace(plain, materials={1: material}), with_numbers(acting, theta[:-1]))

    return models, np.append(numbers, 0.0), np.append(scales_of(acting), 1.0)


def simulator_of(model: Model, newton: int, h: float, device: str = "cpu") -> Simulator:
    system = System(model, device)
    # two unknown fields leave more rounding than one
    return Simulator(system, time_step=h, tolerance=1e-11 if system.coupled else 1e-14, newton=newton)


def ends(model: Model, newton: int, h: float, steps: int, device: str) -> Floats:
    """Displacements after half of the steps and after all, shape (2, n, 3)."""
    simulator = simulator_of(model, newton, h, device)
    found = []
    for step in range(1, steps + 1):
        simulator.prescribe(model.prescribed_at(simulator.time + h, step / steps))
        simulator.step()
        if step in (steps // 2, steps):
            found.append(simulator.system.u.numpy().copy())
    return np.array(found)


def relative(found: Floats, expected: Floats) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.slow(1)
@pytest.mark.parametrize(
    ("newton", "h", "elements", "acting", "steps"),
    [
        (1, 0.02, "tet4", (BRANCHES, *LOADS), 4),
        (6, 0.02, "tet4", (BRANCHES, *LOADS[:2]), 4),
        (8, 1.0, "tet4", (SLOW,), 4),
        pytest.param(6, 0.02, "tet4-averaged", (BRANCHES,), 4, marks=pytest.mark.slow(3)),
        # steps of two fields are dear
        pytest.param(1, 0.02, "tet4", (FLUID, BRANCHES), 4, marks=pytest.mark.slow(3)),
        pytest.param(5, 0.02, "tet4-averaged", (FLUID,), 2, marks=pytest.mark.slow(4)),
        pytest.param(5, 1.0, "tet4", (SLOW_FLUID,), 2, marks=pytest.mark.slow(4)),
    ],
)
def test_against_motions_beside(
    newton: int, h: float, elements: str, acting: tuple[Mechanism, ...], steps: int, device: str, verify: Row
) -> None:
    """The linearised step, the implicit one, and steps so long that inertia is nothing."""
    models, theta, scales = by_numbers(block(elements), acting)
    simulator = simulator_of(models(theta), newton, h, device)
    found = follow(simulator, models, theta, [steps // 2 * h, steps * h], scales)
    expected = ends(models(theta), newton, h, steps, device)
    np.testing.assert_allclose(simulator.system.u.numpy(), expected[-1], atol=1e-10)
    for k in range(len(theta)):
        total = np.zeros(())
        for distance, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
            beside = theta.copy()
            beside[k] += 2e-3 * scales[k] * distance
            total = total + weight * ends(models(beside), newton, h, steps, device)
        total = total / (12.0 * 2e-3 * scales[k])
        for at in range(2):
            claim = f"derivatives of {'linearised' if newton == 1 else 'implicit'} motions, viscosity and flow included"
            verify(claim, "differences of motions", relative(found[at, k], total[at]), 1e-6)


@pytest.mark.slow(4)
def test_over_minutes_they_are_those_of_equilibria_in_a_row(device: str, verify: Row) -> None:
    """Without inertia, by another solver: Newton's method with a line search, a step of fluid and stress at a time."""
    still = block()
    still = replace(still, prescribed=np.zeros_like(still.prescribed), density=1e-6, damping=Damping(0.0, 0.0))
    models, theta, scales = by_numbers(still, (SLOW_FLUID, SLOW, Pressure(nodes="wall", value=80.0)))
    times = [2.0, 4.0]
    found = follow(simulator_of(models(theta), 5, 2.0, device), models, theta, times, scales)[-1]
    system = System(models(theta), device)
    options = EquilibriumOptions(tolerance=1e-12, cg_tolerance=1e-3)
    # along one direction that has all of them in it
    direction = scales * np.random.default_rng(0).normal(size=len(theta))
    total = np.zeros(())
    for distance, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
        system.set_model(models(theta + 1e-3 * distance * direction))
        *_, last = follow_slowly(system, times, options)
        total = total + weight * last.state.u / 12e-3
    error = relative(np.tensordot(direction, found, 1), total)
    claim = "derivatives of motions without inertia, flow and viscosity"
    verify(claim, "differences of equilibria in a row, by another solver", error, 1e-6)


def test_what_has_relaxed_is_the_equilibrium(device: str) -> None:
    """After long steps derivatives are those of the equilibrium, and viscosity has none."""
    acting = (Viscoelasticity(moduli=(1.0,), times=(0.1,)), Pressure(nodes="wall", value=80.0))
    models, theta, scales = by_numbers(block(), acting)
    found = follow(simulator_of(models(theta), 8, 25.0, device), models, theta, [50.0, 300.0], scales)[-1]
    system = System(models(theta), device)
    expected = sensitivities(system, solve_equilibrium(system), models, theta, scales).u
    for k in (2, 3):
        assert relative(found[k], expected[k]) < 1e-5
    assert np.abs(found[:2]).max() < 1e-5 * np.abs(found[3]).max()


def test_a_motion_can_be_joined_later(device: str) -> None:
    """What is remembered then is not forgotten, and the motion itself goes on as it would have."""
    models, theta, scales = by_numbers(block(), (BRANCHES,))
    alone, joined = (simulator_of(models(theta), 1, 0.02, device) for _ in range(2))
    for simulator in (alone, joined):
        simulator.prescribe(simulator.system.model.prescribed)
        for _ in range(2):
            simulator.step()
    derivatives = MotionSensitivity(joined, models, theta, scales)
    for _ in range(3):
        alone.step()
        derivatives.step()
    np.testing.assert_allclose(joined.system.u.numpy(), alone.system.u.numpy(), atol=1e-14)
    assert np.abs(derivatives.u[:, ~joined.system.model.constrained]).max() > 0.0
    assert not derivatives.u[:, joined.system.model.constrained].any()


@pytest.mark.parametrize("times", [[], [0.0], [0.2, 0.1]])
def test_times_that_do_not_increase(times: list[float]) -> None:
    models, theta, _ = by_numbers(block(), (BRANCHES,))
    with pytest.raises(InputError, match="expected times that increase"):
        follow(simulator_of(models(theta), 1, 0.02), models, theta, times)
