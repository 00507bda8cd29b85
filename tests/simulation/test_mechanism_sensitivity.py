"""Derivatives of equilibria by every number of every mechanism, against equilibria beside them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from bodies import sensitivities
from mechanism_numbers import continuous, numbers_of, scales_of, with_numbers
from numpy.typing import NDArray
from shapes import cube, distorted
from verification_rows import Row

from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean, Ogden
from warpbrain.physics.load import NodalForce
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import contact, mechanisms
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Material, Model, with_mechanisms
from warpbrain.simulation.sensitivity import SensitivitySolver
from warpbrain.simulation.system import System

Floats = NDArray[np.float64]

#: One of each kind or more, by name; the kind is the first word.
EXAMPLES: dict[str, dict] = {
    "asymmetry": {"exponent": -6.0},
    "cavity": {"elements": "half", "pressure": 100.0, "left": 0.2},
    "compressibility": {"poisson": 0.48},
    "contact fixed": {"nodes": "below", "state": "fixed"},
    "contact sliding": {"nodes": "below", "state": "sliding", "friction": 0.0},
    "contact lifting": {"nodes": "below", "state": "lifting", "friction": 0.2},
    "drainage": {
        "permeability": 1e-9,
        "storage": 1e-5,
        "pressure": 100.0,
        "exchange": 1e-8,
        "capillary_pressure": 400.0,
        "drained": "wall",
    },
    "falx": {"nodes": "wall", "stiffness": 3e3, "thickness": 0.1},
    "fibres": {"direction": (1.0, 2.0, 0.5), "stiffness": 500.0, "exponent": 30.0, "dispersion": 0.0},
    "gravity": {"direction": (1.0, 0.3, -2.0), "density": 100.0, "csf_level": 0.77},
    "inclusion": {"ratio": 3.0, "centre": (0.5, 0.4, 0.5), "radius": 0.3},
    "inclusion set": {"ratio": 0.5, "elements": "half"},
    "pressure": {"nodes": "wall", "value": 100.0},
    "residual-stress": {"tension": 200.0, "direction": (0.0, 1.0, 1.0), "elements": "half"},
    "swelling": {"amount": 0.2, "centre": (0.5, 0.5, 0.5), "radius": 0.4},
    "swelling everywhere": {"amount": 0.0},
    "traction": {"centre": (0.5, 0.45, 1.0), "value": (100.0, 0.0, -300.0), "radius": 0.6},
    "viscoelasticity": {"moduli": (2.0, 0.5), "times": (0.3, 4.0)},
}
TIGHT = EquilibriumOptions(tolerance=1e-13, cg_tolerance=1e-3, max_augmentations=60)
#: Where the skull's spline rounds more than laws do.
TOUCHING = replace(TIGHT, tolerance=3e-12)
#: Those whose effect is taken on the other element too.
AVERAGED = ("cavity", "drainage", "falx", "pressure", "swelling", "traction")


def test_every_mechanism_has_an_example() -> None:
    with_numbers_of_their_own = set(mechanisms()) - {"resection"}
    assert {name.split()[0] for name in EXAMPLES} == with_numbers_of_their_own


def example(name: str) -> Mechanism:
    return mechanisms()[name.split()[0]](**EXAMPLES[name])


def solver_of(system: System) -> EquilibriumSolver:
    touches = any(mechanism.kind == "contact" for mechanism in system.model.mechanisms)
    return EquilibriumSolver(system, TOUCHING if touches else TIGHT)


def body(elements: str = "tet4", held: str = "below") -> Model:
    """A block of two tissues, pushed at its top, and held below, or above where it stands on a table."""
    mesh: TetMesh = distorted(cube(2), 0.0, tissues=2)
    inside = np.all((mesh.points > 1e-9) & (mesh.points < 1.0 - 1e-9), axis=1)
    points = mesh.points + 0.05 * inside[:, None]
    x, z = points[:, 0], points[:, 2]
    sets = {"below": z < 1e-9, "above": z > 1.0 - 1e-9, "wall": x > 1.0 - 1e-9}
    half = points[mesh.tetrahedra].mean(axis=1)[:, 0] > 0.5
    mesh = replace(mesh, points=points, node_sets=sets, element_sets={"half": half})
    materials = {1: Material(NeoHookean(1000.0)), 2: Material(Ogden((-500.0,), (-4.7,)), 0.4, "uncoupled")}
    constrained = np.repeat(sets[held][:, None], 3, axis=1)
    prescribed = np.where(constrained, [0.02, 0.01, -0.06], 0.0) if held == "above" else None
    loads = [] if held == "above" else [NodalForce(nodes="above", total=(20.0, 0.0, -60.0))]
    return Model(mesh, materials, 100.0, constrained, prescribed, loads, elements=elements)


def body_for(name: str, elements: str = "tet4") -> Model:
    return body(elements, "above" if name.startswith("contact") else "below")


def relative(found: Floats, expected: Floats) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def differences(system: System, models: Callable, theta: Floats, k: int, step: float) -> tuple[Floats, Floats]:
    """Derivatives of displacement and reactions by five-point differences of equilibria."""
    solver = solver_of(system)
    u, reactions = np.zeros(()), np.zeros(())
    for distance, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
        beside = theta.copy()
        beside[k] += distance * step
        system.set_model(models(beside))
        found = solver.solve()
        u = u + weight * found.u
        reactions = reactions + weight * (found.internal - system.model.external_forces()) * system.model.constrained
    return u / (12.0 * step), reactions / (12.0 * step)


BESIDE = "differences of equilibria"


def check(
    verify: Row, by: str, system: System, models: Callable, theta: Floats, scales: Floats, step: float = 2e-3
) -> None:
    system.set_model(models(theta))
    equilibrium = solver_of(system).solve()
    found = sensitivities(system, equilibrium, models, theta, scales)
    np.testing.assert_array_equal(system.u.numpy(), equilibrium.u)
    for k in range(len(theta)):
        du, dR = differences(system, models, theta, k, step * scales[k])
        if np.abs(du).max() * scales[k] < 1e-9 * np.abs(equilibrium.u).max():
            # what has no effect in equilibrium (viscosity) has no derivative but zero
            assert np.abs(found.u[k]).max() * scales[k] < 1e-9 * np.abs(equilibrium.u).max()
            continue
        verify(f"derivatives of displacements {by}", BESIDE, relative(found.u[k], du), 1e-6)
        verify(f"derivatives of reactions {by}", BESIDE, relative(found.reactions[k], dR), 1e-6)


def check_alone(name: str, elements: str, device: str, monkeypatch: pytest.MonkeyPatch, verify: Row) -> None:
    # constraints are met as well as derivatives are to be compared
    monkeypatch.setattr(contact, "_NEAR", 1e-13)
    monkeypatch.setattr(contact, "_STUCK", 1e-13)
    plain, mechanism = body_for(name, elements), example(name)

    def models(theta: Floats) -> Model:
        return with_mechanisms(plain, with_numbers([mechanism], theta))

    theta = numbers_of([mechanism])
    by = f"by every number of every mechanism, {elements}"
    check(verify, by, System(models(theta), device), models, theta, scales_of([mechanism]))


@pytest.mark.parametrize("name", EXAMPLES)
def test_alone(name: str, device: str, monkeypatch: pytest.MonkeyPatch, verify: Row) -> None:
    check_alone(name, "tet4", device, monkeypatch, verify)


@pytest.mark.slow(1)
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow(4)] if name == "drainage" else []) for name in AVERAGED]
)
def test_alone_on_elements_that_do_not_lock(
    name: str, device: str, monkeypatch: pytest.MonkeyPatch, verify: Row
) -> None:
    check_alone(name, "tet4-averaged", device, monkeypatch, verify)


def with_tissues(plain: Model, acting: list[Mechanism]) -> tuple[Callable[[Floats], Model], Floats, Floats]:
    """Models by numbers of mechanisms, then logarithms of the shear moduli; these parameters, and their scales."""
    numbers = numbers_of(acting)

    def models(theta: Floats) -> Model:
        factors = np.exp(theta[len(numbers) :])
        materials = {
            label: replace(m, law=m.law.scaled_to(float(factors[label - 1]) * m.law.shear_modulus))
            for label, m in plain.materials.items()
        }
        return with_mechanisms(replace(plain, materials=materials), with_numbers(acting, theta[: len(numbers)]))

    count = len(plain.materials)
    return models, np.append(numbers, np.zeros(count)), np.append(scales_of(acting), np.ones(count))


HELD = ("pressure", "swelling", "traction", "inclusion set", "compressibility")
ON_A_TABLE = ("contact lifting", "falx", "asymmetry")
#: What the tissue is made of: fibres and a tension see the growth, and fibres the factor on moduli.
MADE_OF = ("inclusion", "fibres", "residual-stress", "swelling")


@pytest.mark.slow(1)
@pytest.mark.parametrize(
    ("names", "elements"),
    [
        (HELD, "tet4"),
        # each of them alone: test_alone_on_elements_that_do_not_lock
        pytest.param(HELD, "tet4-averaged", marks=pytest.mark.slow(2)),
        (ON_A_TABLE, "tet4"),
        *((MADE_OF, elements) for elements in ("tet4", "tet4-averaged", "tet10")),
    ],
)
def test_together_and_with_tissues(
    names: tuple[str, ...], elements: str, device: str, monkeypatch: pytest.MonkeyPatch, verify: Row
) -> None:
    monkeypatch.setattr(contact, "_NEAR", 1e-12)
    acting = [example(name) for name in names]
    models, theta, scales = with_tissues(body_for(names[0], elements), acting)
    system = System(models(theta), device)
    equilibrium = solver_of(system).solve()
    found = sensitivities(system, equilibrium, models, theta, scales)
    # one difference of equilibria along a direction that has all of them in it
    direction = scales * np.random.default_rng(0).normal(size=len(theta))
    solver, du, dR = solver_of(system), np.zeros(()), np.zeros(())
    for distance, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
        system.set_model(models(theta + 1e-3 * distance * direction))
        state = solver.solve()
        du = du + weight * state.u / 12e-3
        dR = dR + weight * (state.internal - system.model.external_forces()) * system.model.constrained / 12e-3
    error = max(
        relative(np.tensordot(direction, found.u, 1), du), relative(np.tensordot(direction, found.reactions, 1), dR)
    )
    verify("derivatives of equilibria by several mechanisms and tissues together", BESIDE, error, 1e-6)


def test_what_is_prescribed_can_depend_on_a_parameter(device: str, verify: Row) -> None:
    plain = body(held="above")
    plain = replace(plain, constrained=plain.constrained | plain.mesh.node_sets["below"][:, None])

    def models(theta: Floats) -> Model:
        return replace(plain, prescribed=theta[0] * plain.prescribed)

    check(verify, "by what is prescribed", System(plain, device), models, np.array([1.0]), np.array([1.0]))


def test_single_precision_is_what_it_can_be(device: str) -> None:
    acting = [example(name) for name in ("pressure", "swelling everywhere")]
    models, theta, scales = with_tissues(body(), acting)
    exact, single = System(models(theta), device), System(models(theta), device, "single")
    expected = sensitivities(exact, EquilibriumSolver(exact).solve(), models, theta, scales)
    found = sensitivities(single, EquilibriumSolver(single).solve(), models, theta, scales)
    for k in range(len(theta)):
        assert relative(found.u[k], expected.u[k]) < 1e-2


def test_a_state_is_left_as_it_was(device: str) -> None:
    """Displacement, parameters and memory; and a solver that is used again finds the same bits."""
    acting = [example("contact lifting")]
    models, theta, scales = with_tissues(body_for("contact lifting"), acting)
    system = System(models(theta), device)
    state = EquilibriumSolver(system).solve()
    remembered = [array.numpy().copy() for own in system.remembered() for array in own]
    solver = SensitivitySolver(system)
    first = solver.solve(state.u, models, theta, scales)
    assert system.model.mechanisms == models(theta).mechanisms
    for array, before in zip([a for own in system.remembered() for a in own], remembered, strict=True):
        np.testing.assert_array_equal(array.numpy(), before)
    np.testing.assert_array_equal(solver.solve(state.u, models, theta, scales).u, first.u)


def test_places_have_names() -> None:
    names = [place.name for place in continuous(example("swelling"))]
    assert names == [f"swelling {name}" for name in ("amount", "centre x", "centre y", "centre z", "radius")]


def test_contact_that_has_lifted_off_in_part(device: str, monkeypatch: pytest.MonkeyPatch, verify: Row) -> None:
    monkeypatch.setattr(contact, "_NEAR", 1e-12)
    plain = body(held="above")
    tilt = np.array([0.02, 0.01, -0.08]) + 0.2 * plain.mesh.points[:, :1] * [0.0, 0.0, 1.0]
    plain = replace(plain, prescribed=np.where(plain.constrained, tilt, 0.0))
    models, theta, scales = with_tissues(plain, [example("contact lifting"), mechanisms()["swelling"](amount=0.05)])
    system = System(models(theta), device)
    solver_of(system).solve()
    pressing = system.terms[0].pressing()
    assert 0 < np.count_nonzero(pressing) < len(pressing)
    check(verify, "by contact in part lifted off, with swelling and tissues", system, models, theta, scales)
