"""Models of quadratic elements: what midside nodes inherit, and that every way to a state is a way for them too."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import model_of, sensitivities
from shapes import box, distorted

from warpbrain.errors import InputError
from warpbrain.mesh import QuadraticMesh, TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.load import Load, NodalForce
from warpbrain.physics.mechanisms.gravity import STANDARD_GRAVITY, Gravity
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumOptions, solve_equilibrium
from warpbrain.simulation.model import QUADRATIC, Damping, Material, Model, Motion
from warpbrain.simulation.relaxation import relax_to_rest
from warpbrain.simulation.result import result_of
from warpbrain.simulation.system import System

SOFT = Material(NeoHookean(1000.0))
SIDE = 0.05


every_kind = pytest.mark.parametrize("elements", QUADRATIC)


def block(**options: object) -> Model:
    """A 5 cm cube, clamped below; the force on its top pushes it down and aside."""
    mesh = box((2, 2, 2), (SIDE, SIDE, SIDE))
    z = mesh.points[:, 2]
    mesh = TetMesh(mesh.points, mesh.tetrahedra, node_sets={"top": z > SIDE - 1e-9, "below": z < 1e-9})
    given = {
        "constrained": np.repeat((z < 1e-9)[:, None], 3, axis=1),
        "loads": [NodalForce(nodes="top", total=(0.1, 0.0, -0.2))],
        "elements": "tet10",
    }
    return model_of(mesh, SOFT, **(given | options))


def test_midside_nodes_inherit_what_their_ends_have() -> None:
    mesh = block().mesh
    ends = mesh.node_sets["top"] | mesh.node_sets["below"]
    constrained = np.repeat(ends[:, None], 3, axis=1)
    prescribed = np.where(mesh.node_sets["top"][:, None], mesh.points[:, [0]] * [0.0, 0.0, 0.1], 0.0)
    model = block(constrained=constrained, prescribed=prescribed)
    nodes = model.quadratic
    z = nodes.points[:, 2]
    np.testing.assert_array_equal(model.constrained.all(axis=1), (z < 1e-9) | (z > SIDE - 1e-9))
    np.testing.assert_allclose(model.prescribed[z > SIDE - 1e-9, 2], 0.1 * nodes.points[z > SIDE - 1e-9, 0])
    # a model made from another has its constraints
    again = replace(model, density=900.0)
    np.testing.assert_array_equal(again.constrained, model.constrained)
    np.testing.assert_array_equal(again.prescribed, model.prescribed)


def test_what_all_corners_have_all_nodes_have() -> None:
    mesh = box((1, 1, 1))
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    constrained[:, 2] = True
    assert model_of(mesh, SOFT, constrained=constrained, elements="tet10").constrained[:, 2].all()


def test_midside_nodes_move_with_their_ends() -> None:
    mesh = block().mesh
    top = mesh.node_sets["top"]
    left = top & (mesh.points[:, 0] < 0.6 * SIDE)
    motions = [
        Motion(left, np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [0.0, 0, 0.01]])),
        Motion(top & ~left, np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [0.0, 0, 0.02]])),
    ]
    held = np.repeat((top | mesh.node_sets["below"])[:, None], 3, axis=1)
    model = block(constrained=held, motions=motions)
    found = model.prescribed_at(0.5, 1.0)
    nodes = model.quadratic
    above = nodes.node_sets["top"]
    x = nodes.points[above, 0]
    expected = np.where(x < 0.6 * SIDE, 0.005, np.where(x > 0.9 * SIDE, 0.01, 0.0075))
    np.testing.assert_allclose(found[above, 2], expected)
    assert not found[~above].any()


@every_kind
def test_every_way_to_rest_leads_to_one_state(elements: str, device: str) -> None:
    system = System(block(elements=elements), device)
    found = solve_equilibrium(system, EquilibriumOptions(tolerance=1e-10)).u
    reactions = result_of(system).reactions
    np.testing.assert_allclose(reactions.sum(axis=0), [-0.1, 0.0, 0.2], atol=1e-8)
    assert len(reactions) == len(system.mesh.points)
    relaxed = relax_to_rest(System(block(elements=elements), device)).u
    assert np.abs(relaxed - found).max() <= 1e-6 * np.abs(found).max()


@every_kind
def test_motion_without_load_keeps_momentum_and_loses_energy(elements: str, device: str) -> None:
    mesh = distorted(box((2, 2, 2), (SIDE, SIDE, SIDE)), 0.002)
    system = System(model_of(mesh, SOFT, damping=Damping(0.0, 0.0), elements=elements), device)
    simulator = Simulator(system, time_step=0.001, tolerance=1e-12, newton=4)
    v = 0.1 * np.random.default_rng(0).normal(size=(system.size, 3))
    simulator.restore(np.zeros_like(v), v, 0.0)
    mass = system.model.node_masses
    momentum, energy = mass @ v, np.inf
    for _ in range(5):
        simulator.step()
        simulator.check()
        stored = system.energy()[0] + simulator.kinetic_energy()
        assert stored < energy
        energy = stored
    assert np.abs(mass @ simulator.v.numpy() - momentum).max() <= 1e-9 * np.abs(momentum).max()


def test_the_middle_of_a_body_falls_freely(device: str) -> None:
    """Lumped masses and consistent weights differ from node to node, so the body quivers; its middle does not."""
    falling = Gravity(direction=(0.0, 0.0, -1.0), density=1211.5)
    model = block(constrained=None, loads=[falling])
    simulator = Simulator(System(model, device), time_step=0.001, tolerance=1e-12)
    for _ in range(10):
        simulator.step()
    v = model.node_masses @ simulator.v.numpy() / model.mass
    np.testing.assert_allclose(v, [0.0, 0.0, -STANDARD_GRAVITY * 0.01], atol=1e-9)


@every_kind
def test_derivatives_are_those_of_equilibria_beside(elements: str, device: str) -> None:
    plain = block(elements=elements)
    system = System(plain, device)
    options = EquilibriumOptions(tolerance=1e-12, cg_tolerance=1e-3)

    def models(theta: np.ndarray) -> Model:
        return replace(plain, materials={1: Material(NeoHookean(float(np.exp(theta[0]))))})

    theta, h = np.log([1000.0]), 1e-3
    found = sensitivities(system, solve_equilibrium(system, options), models, theta)
    beside = []
    for sign in (1.0, -1.0):
        system.set_model(models(theta + sign * h))
        beside.append(solve_equilibrium(system, options).u)
    expected = (beside[0] - beside[1]) / (2.0 * h)
    assert np.abs(found.u[0] - expected).max() <= 1e-5 * np.abs(expected).max()


@every_kind
def test_a_body_that_swells_freely_is_larger_and_free_of_stress(elements: str, device: str) -> None:
    mesh = block().mesh
    x = mesh.points
    model = block(constrained=x < 1e-9, loads=[], mechanisms=[Swelling(amount=0.1)], elements=elements)
    system = System(model, device)
    u = solve_equilibrium(system).u
    np.testing.assert_allclose(u, (1.1 ** (1.0 / 3.0) - 1.0) * model.quadratic.points, atol=1e-8)
    assert np.abs(system.stresses()).max() <= 1e-4


def test_a_damped_step_is_that_of_the_whole_matrix(device: str) -> None:
    """Of pressures at corners a part is in no matrix: damping counts it as it counts the rest."""
    system = System(block(elements="tet10-mixed"), device)
    h, damping = 0.01, system.model.damping.stiffness
    K = system.stiffness().toarray()
    masses = np.repeat(system.model.node_masses, 3)
    force = system.model.external_forces().ravel()
    free = ~system.model.constrained.ravel()
    v = np.zeros(len(free))
    A = np.diag(masses) + (h * damping + h * h) * K
    v[free] = np.linalg.solve(A[free][:, free], h * force[free])
    simulator = Simulator(system, time_step=h, tolerance=1e-12)
    simulator.step()
    assert np.abs(simulator.v.numpy().ravel() - v).max() <= 1e-9 * np.abs(v).max()


class Unknown(Load):
    """A load that nobody has told of midside nodes."""

    def nodal_forces(self, mesh: TetMesh | QuadraticMesh) -> np.ndarray:
        return np.zeros(mesh.points.shape)


@pytest.mark.parametrize(
    ("acts", "name"),
    [
        ({"loads": [Unknown()]}, "Unknown"),
        ({"mechanisms": [Viscoelasticity(moduli=(1.0,), times=(1.0,))]}, "viscoelasticity"),
    ],
)
def test_what_knows_no_midside_nodes_is_refused(acts: dict, name: str) -> None:
    with pytest.raises(InputError, match=f"{name}: cannot act on elements 'tet10'"):
        block(**acts)
