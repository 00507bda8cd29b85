"""Derivatives of an equilibrium by its laws, against equilibria beside it, and identities that they obey."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bodies import forces_at, sensitivities
from numpy.typing import NDArray
from shapes import box
from verification_rows import Row

from warpbrain.errors import InputError, SolveError
from warpbrain.gp.prior import from_coordinates, to_coordinates
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import FORMULATIONS, Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.load import NodalForce
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver, solve_equilibrium
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.result import result_of
from warpbrain.simulation.sensitivity import SensitivitySolver
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]
LAWS: dict[str, Law] = {
    "neo-hookean": NeoHookean(1000.0),
    "mooney-rivlin": MooneyRivlin(300.0, 200.0),
    "ogden": Ogden((2000.0 / -4.7,), (-4.7,)),
    "ogden, stiff": Ogden((2000.0 / -20.0,), (-20.0,)),
}
SIDE = 0.05
TIGHT = EquilibriumOptions(tolerance=1e-12, cg_tolerance=1e-3)


def body(laws: list[Law], formulation: str, load: str, poisson: float = 0.45) -> Model:
    """A 5 cm cube of one or two tissues, clamped below; it sinks under gravity, is pushed, or its top is moved."""
    mesh = box((3, 3, 3), (SIDE, SIDE, SIDE))
    z = mesh.points[:, 2]
    tissue = 1 + np.arange(len(mesh.tetrahedra)) % len(laws)
    mesh = TetMesh(mesh.points, mesh.tetrahedra, tissue, node_sets={"top": z > SIDE - 1e-9})
    held = z < 1e-9
    prescribed = np.zeros(mesh.points.shape)
    loads = []
    if load == "displaced":
        held = held | mesh.node_sets["top"]
        prescribed[mesh.node_sets["top"]] = (0.005, 0.0, -0.007)
    elif load == "pushed":
        loads = [NodalForce(nodes="top", total=(0.1, 0.0, -0.2))]
    else:
        loads = [Gravity(direction=(1.0, 0.0, -1.0), density=1000.0)]
    materials = {label + 1: Material(law, poisson, formulation) for label, law in enumerate(laws)}
    constrained = np.repeat(held[:, None], 3, axis=1)
    return Model(mesh, materials, 1000.0, constrained, prescribed, loads)


def in_coordinates(model: Model) -> tuple[Callable[[Floats], Model], Floats]:
    """Models by the coordinates of all tissues, and the coordinates they have."""
    each = {label: to_coordinates(material.law) for label, material in model.materials.items()}

    def models(theta: Floats) -> Model:
        found, at = {}, 0
        for label, old in model.materials.items():
            count = len(each[label])
            law = from_coordinates(old.law.name, theta[at : at + count].tolist())
            found[label] = Material(law, old.poisson, old.formulation)
            at += count
        return replace(model, materials=found)

    return models, np.concatenate([each[label] for label in model.materials])


def relative(found: Floats, expected: Floats) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def differences(system: System, models: Callable, theta: Floats, k: int, step: float) -> tuple[Floats, Floats]:
    """`du/dtheta_k` and `dR/dtheta_k` by five-point differences of equilibria."""
    solver = EquilibriumSolver(system, TIGHT)
    u, reactions = 0.0, 0.0
    for distance, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
        beside = theta.copy()
        beside[k] += distance * step
        system.set_model(models(beside))
        found = solver.solve()
        u = u + weight * found.u
        reactions = reactions + weight * result_of(system).reactions
    return u / (12.0 * step), reactions / (12.0 * step)


CLAIM = "by parameters of every law, formulation and kind of load"
BESIDE = "differences of equilibria"


@pytest.mark.slow(1)
@pytest.mark.parametrize(
    ("tissues", "load"),
    [
        *((2, load) for load in ("gravity", "displaced", "pushed")),
        # of one tissue is apart what needs no force
        (1, "displaced"),
        *(pytest.param(1, load, marks=pytest.mark.slow(1)) for load in ("gravity", "pushed")),
    ],
)
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("law", LAWS)
def test_against_equilibria_beside(
    tissues: int, law: str, formulation: str, load: str, device: str, verify: Row
) -> None:
    laws = [LAWS[law], LAWS[law].scaled_to(2500.0)][:tissues]
    model = body(laws, formulation, load)
    models, theta = in_coordinates(model)
    system = System(model, device)
    equilibrium = solve_equilibrium(system, TIGHT)
    found = sensitivities(system, equilibrium, models, theta)
    assert found.u.shape == found.reactions.shape == (len(theta), len(model.mesh.points), 3)
    assert not found.u[:, model.constrained].any() and not found.reactions[:, ~model.constrained].any()
    for k in range(len(theta)):
        du, dR = differences(system, models, theta, k, 2e-3)
        if tissues == 1 and k == 0 and load == "displaced":
            # one modulus and no force: nothing moves, all forces are in proportion
            assert np.abs(found.u[k]).max() <= 1e-9 * np.abs(equilibrium.u).max()
            system.set_model(models(theta))
            assert relative(found.reactions[k], forces_at(system, equilibrium.u) * model.constrained) < 1e-9
        else:
            verify(f"derivatives of displacements {CLAIM}", BESIDE, relative(found.u[k], du), 1e-6)
        verify(f"derivatives of reactions {CLAIM}", BESIDE, relative(found.reactions[k], dR), 1e-6)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_laws_may_differ(formulation: str, device: str) -> None:
    model = body([NeoHookean(800.0), MooneyRivlin(200.0, 300.0), Ogden((-300.0,), (-6.0,))], formulation, "gravity")
    models, theta = in_coordinates(model)
    system = System(model, device)
    found = sensitivities(system, solve_equilibrium(system, TIGHT), models, theta)
    for k in range(len(theta)):
        assert relative(found.u[k], differences(system, models, theta, k, 2e-3)[0]) < 1e-6


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("law", LAWS)
def test_all_moduli_together_move_nothing_where_displacements_do_it_all(law: str, formulation: str) -> None:
    """Forces scale, positions do not: absolute moduli cannot be told from positions."""
    model = body([LAWS[law], LAWS[law].scaled_to(3000.0)], formulation, "displaced")
    models, theta = in_coordinates(model)
    system = System(model, "cpu")
    equilibrium = solve_equilibrium(system, TIGHT)
    found = sensitivities(system, equilibrium, models, theta)
    moduli = [0, len(theta) // 2]
    together = found.u[moduli].sum(axis=0)
    assert np.linalg.norm(together) < 1e-8 * np.linalg.norm(found.u[0])
    assert np.linalg.norm(found.u[0]) > 1e-3 * np.linalg.norm(equilibrium.u)
    assert relative(found.reactions[moduli].sum(axis=0), equilibrium.internal * model.constrained) < 1e-8


def test_under_small_dead_loads_displacement_falls_as_the_modulus_rises(device: str) -> None:
    """Linear elasticity: `u ~ 1 / mu`, so `du/d ln mu = -u`."""
    model = body([NeoHookean(1e9)], "coupled", "gravity")
    models, theta = in_coordinates(model)
    system = System(model, device)
    equilibrium = solve_equilibrium(system, TIGHT)
    assert relative(sensitivities(system, equilibrium, models, theta).u[0], -equilibrium.u) < 1e-5


def test_single_precision_is_what_it_can_be(device: str) -> None:
    model = body([NeoHookean(1000.0), NeoHookean(3000.0)], "coupled", "gravity")
    models, theta = in_coordinates(model)
    exact = System(model, device)
    expected = sensitivities(exact, solve_equilibrium(exact, TIGHT), models, theta)
    single = System(model, device, "single")
    found = sensitivities(single, solve_equilibrium(single), models, theta)
    assert relative(found.u, expected.u) < 2e-3


def test_a_solver_serves_many_states(device: str) -> None:
    """Another state, then the first again: the same bits, and the system left at that state."""
    model = body([LAWS["ogden"]], "coupled", "gravity")
    models, theta = in_coordinates(model)
    system = System(model, device)
    solver = SensitivitySolver(system)
    u = solve_equilibrium(system, TIGHT).u
    first = solver.solve(u, models, theta)
    system.set_model(models(theta + 0.3))
    other = solve_equilibrium(system, TIGHT).u
    assert relative(solver.solve(other, models, theta + 0.3).u, first.u) > 1e-2
    again = solver.solve(u, models, theta)
    np.testing.assert_array_equal(again.u, first.u)
    np.testing.assert_array_equal(system.u.numpy(), u)
    assert system.model.materials[1].law.shear_modulus == pytest.approx(1000.0)


def test_an_unstable_state_has_no_derivative() -> None:
    """A column pressed far beyond its buckling load, kept straight by its symmetry."""
    model = body([NeoHookean(1000.0)], "coupled", "displaced")
    squeezed = model.mesh.points * np.array([0.0, 0.0, -0.65])
    constrained = np.repeat(model.mesh.points[:, 2:] < 1e-9, 3, axis=1)
    model = Model(model.mesh, model.materials, 1000.0, constrained)
    models, theta = in_coordinates(model)
    system = System(model, "cpu")
    with pytest.raises(SolveError, match="unstable"):
        SensitivitySolver(system).solve(squeezed, models, theta)


def test_a_solve_that_does_not_converge_is_an_error() -> None:
    model = body([NeoHookean(1000.0)], "coupled", "gravity")
    models, theta = in_coordinates(model)
    system = System(model, "cpu")
    u = solve_equilibrium(system).u
    with pytest.raises(SolveError, match="did not converge in 3 iterations"):
        SensitivitySolver(system, max_cg=3).solve(u, models, theta)


# -- other parameters in a system that is already there -------------------------------------------------------------


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_system_with_other_materials_is_as_one_made_of_them(formulation: str, device: str) -> None:
    first = body([LAWS["neo-hookean"], LAWS["mooney-rivlin"], LAWS["ogden"]], formulation, "gravity")
    second = body([NeoHookean(500.0), MooneyRivlin(50.0, 400.0), Ogden((70.0,), (9.0,))], formulation, "gravity", 0.4)
    u = 0.002 * np.random.default_rng(0).normal(size=first.mesh.points.shape)
    system = System(first, device)
    system.set_materials(second.materials)
    np.testing.assert_array_equal(forces_at(system, u), forces_at(System(second, device), u))
    system.set_materials(first.materials)
    np.testing.assert_array_equal(forces_at(system, u), forces_at(System(first, device), u))


@pytest.mark.parametrize(
    "material",
    [
        Material(MooneyRivlin(1.0, 1.0)),
        Material(NeoHookean(1.0), formulation="uncoupled"),
    ],
)
def test_another_law_needs_another_system(material: Material) -> None:
    system = System(body([NeoHookean(math.pi)], "coupled", "gravity"), "cpu")
    with pytest.raises(InputError, match=r"tissue 1 has .*expected other parameters of NeoHookean"):
        system.set_materials({1: material})
    with pytest.raises(InputError, match="no material for tissue 1"):
        system.set_materials({})
    assert system.model.materials[1].law.shear_modulus == math.pi


def test_more_terms_need_another_system() -> None:
    system = System(body([Ogden((100.0,), (2.0,))], "coupled", "gravity"), "cpu")
    with pytest.raises(InputError, match="expected other parameters"):
        system.set_materials({1: Material(Ogden((100.0, 50.0), (2.0, 4.0)))})
