"""How a body swings about its rest: against its eigenmodes, and of series that are known."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import model_of
from material_point import LAWS
from scipy.sparse import diags
from scipy.sparse.linalg import eigsh
from shapes import box

from warpbrain.errors import InputError
from warpbrain.physics.load import NodalForce
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Damping, Material, Model
from warpbrain.simulation.relaxation import RelaxationOptions, relax_to_rest
from warpbrain.simulation.swing import Momentum, swing_of
from warpbrain.simulation.system import System

BRAIN = Material(LAWS["neo-hookean"])


def cantilever(mass: float = 0.0, damping: float = 1e-3) -> Model:
    """4 x 4 x 12 cm, clamped at its lower end and pushed to the side at the other, on which a mass lies."""
    mesh = box((2, 2, 6), (0.04, 0.04, 0.12))
    mesh = replace(mesh, node_sets={"top": mesh.points[:, 2] > 0.12 - 1e-9})
    push = NodalForce(nodes="top", total=(0.002, 0.0, 0.0), mass=mass)
    constrained = np.repeat(mesh.points[:, 2:] < 1e-12, 3, axis=1)
    return model_of(mesh, BRAIN, constrained=constrained, loads=[push], damping=Damping(stiffness=damping))


def modes(model: Model) -> np.ndarray:
    """Angular frequencies [1/s] of the first modes about the state at rest, without damping."""
    system = System(model, "cpu")
    system.u.assign(EquilibriumSolver(system, EquilibriumOptions(tolerance=1e-10)).solve().u)
    free = ~model.constrained.ravel()
    K = system.stiffness().tocsr()[free][:, free].tocsc()
    M = diags(np.repeat(model.node_masses, 3)[free]).tocsc()
    return np.sqrt(np.sort(eigsh(K, 2, M, sigma=0.0, return_eigenvectors=False)))


@pytest.mark.slow(3)
@pytest.mark.parametrize("mass", [0.0, 0.2])
@pytest.mark.parametrize("step", [8e-3, 3e-2])
def test_a_motion_to_rest_swings_as_the_first_mode_does(mass: float, step: float, device: str) -> None:
    """Frequency and damping are of the body: longer steps, which damp it more, say the same."""
    model = cantilever(mass)
    slowest = modes(model)[0]
    found = relax_to_rest(System(model, device), RelaxationOptions(time_step=step, swing=True))
    assert found.swing is not None
    assert 2.0 * np.pi * found.swing.frequency == pytest.approx(slowest, rel=2e-3)
    assert found.swing.damping == pytest.approx(0.5e-3 * slowest, rel=0.02)
    # to first order steps of backward Euler damp as `K` does
    assert found.swing.damping_in_steps == pytest.approx(0.5 * (1e-3 + step) * slowest, rel=0.05)
    expected = relax_to_rest(System(model, device), RelaxationOptions(tolerance=1e-9))
    assert expected.swing is None and len(expected.history) < len(found.history)
    assert np.abs(found.u - expected.u).max() <= 1e-6 * np.abs(expected.u).max()
    # long enough to be seen
    lasted = sum(one.time_step == step for one in found.history) * step
    assert 3.0 < lasted * found.swing.frequency < 9.0


def test_a_body_that_is_damped_well_does_not_swing(device: str) -> None:
    model = cantilever(damping=0.5)
    assert 0.25 * modes(model)[0] > 1.0
    found = relax_to_rest(System(model, device), RelaxationOptions(time_step=5e-3, swing=True))
    plain = relax_to_rest(System(model, device))
    assert found.swing is None
    assert np.abs(found.u - plain.u).max() <= 1e-6 * np.abs(plain.u).max()


def test_a_mass_is_shared_by_the_nodes_and_weighs_nothing() -> None:
    bare, carried = cantilever(), cantilever(0.3)
    top = bare.mesh.node_sets["top"]
    np.testing.assert_allclose(carried.node_masses - bare.node_masses, 0.3 * top / top.sum(), atol=1e-15)
    np.testing.assert_array_equal(carried.external_forces(), bare.external_forces())
    with pytest.raises(InputError, match="mass = -1"):
        NodalForce(nodes="top", total=(0.0, 0.0, 0.0), mass=-1.0)


def stepped(poles: list[complex], amplitudes: list[complex], step: float, count: int) -> np.ndarray:
    """A series of backward Euler with these poles [1/s]."""
    z = 1.0 / (1.0 - step * np.array(poles))
    return np.real(np.array(amplitudes) @ z[:, None] ** np.arange(count))


@pytest.mark.parametrize("count", [60, 400, 5000])
def test_the_larger_of_two_swings_beside_what_creeps(count: int) -> None:
    w, damping = 44.0, 0.05
    first = w * complex(-damping, np.sqrt(1.0 - damping**2))
    poles = [first, 5.0 * first, complex(-1.3)]
    found = swing_of(stepped(poles, [1.0, 0.2j, 0.1], 4e-3, count), 4e-3)
    assert found is not None
    assert found.frequency == pytest.approx(w / (2.0 * np.pi), rel=1e-6)
    assert found.damping == pytest.approx(damping, rel=1e-6)
    assert found.damping_in_steps > 1.5 * damping


@pytest.mark.parametrize(
    "series", [[], [1.0], [1.0, 0.5, 0.25], np.zeros(50), 0.9 ** np.arange(200), (-0.9) ** np.arange(200)]
)
def test_nothing_that_swings(series) -> None:
    assert swing_of(np.array(series, dtype=float), 1e-3) is None


def test_a_step_of_another_length_begins_anew() -> None:
    momentum = Momentum(np.ones(1))
    assert not momentum.was_seen
    for step, count in ((1e-2, 3), (5e-3, 80)):
        for value in stepped([complex(-4.0, 30.0)], [1.0], step, count):
            momentum.note(np.array([[value, 0.0, 0.0]]), step)
    found = momentum.swing()
    assert found is not None and found.time_step == 5e-3
    assert found.frequency == pytest.approx(np.hypot(4.0, 30.0) / (2.0 * np.pi), rel=1e-6)
