"""Other numbers of mechanisms in a system that is already there."""

import weakref
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import warp as wp
from bodies import forces_at
from shapes import cube

from warpbrain.errors import InputError
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanism import Following, Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.mechanisms.cavity import Cavity
from warpbrain.physics.mechanisms.contact import Contact
from warpbrain.physics.mechanisms.drainage import Drainage
from warpbrain.physics.mechanisms.falx import Falx
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.inclusion import Inclusion
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.residual_stress import ResidualStress
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.physics.term import Term
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.model import ELEMENTS, QUADRATIC, Material, Model, with_mechanisms
from warpbrain.simulation.system import System

FIRST: tuple[Mechanism, ...] = (
    Cavity(elements="other half", pressure=10.0),
    Contact(nodes="below", state="lifting", friction=0.1),
    Drainage(permeability=1e-4, drained="wall", elements="half"),
    Falx(nodes="wall", stiffness=1e4, thickness=0.1),
    Fibres(direction=(1.0, 0.0, 0.0), stiffness=100.0),
    Inclusion(ratio=2.0, elements="half"),
    Pressure(nodes="wall", value=20.0),
    ResidualStress(tension=50.0, direction=(0.0, 0.0, 1.0)),
    Swelling(amount=0.1),
    Viscoelasticity(moduli=(1.0,), times=(0.1,)),
)
SECOND: tuple[Mechanism, ...] = (
    Cavity(elements="other half", pressure=40.0, left=0.3),
    Contact(nodes="below", state="lifting", friction=0.0, penalty=20.0),
    Drainage(
        permeability=3e-4,
        elements="half",
        storage=1e-5,
        drained="wall",
        pressure=20.0,
        exchange=1e-3,
        capillary_pressure=-50.0,
        ramp=[(0.0, 0.5), (0.01, 1.0)],
    ),
    Falx(nodes="wall", stiffness=3e4, thickness=0.2),
    Fibres(direction=(1.0, 1.0, 0.0), stiffness=200.0, exponent=3.0, dispersion=0.1),
    Inclusion(ratio=0.5, elements="half"),
    Pressure(nodes="wall", value=-30.0, ramp=[(0.0, 0.5), (1.0, 0.8)]),
    ResidualStress(tension=-20.0, direction=(0.0, 1.0, 1.0)),
    Swelling(amount=-0.1),
    Viscoelasticity(moduli=(3.0,), times=(0.4,)),
)

#: What makes a mechanism act in a system.
FACES = ("bind", "growth", "stiffness_factor")


def model_of(mechanisms: Sequence[Mechanism], modulus: float = 1000.0, elements: str = "tet4") -> Model:
    mesh = cube(2)
    x, z = mesh.points[:, 0], mesh.points[:, 2]
    half = mesh.points[mesh.tetrahedra].mean(axis=1)[:, 0] > 0.5
    mesh = replace(
        mesh, node_sets={"below": z < 1e-9, "wall": x > 1.0 - 1e-9}, element_sets={"half": half, "other half": ~half}
    )
    constrained = np.repeat((z > 1.0 - 1e-9)[:, None], 3, axis=1)
    plain = Model(mesh, {1: Material(NeoHookean(modulus), 0.4)}, 1000.0, constrained, elements=elements)
    return with_mechanisms(plain, mechanisms)


def at(system: System) -> np.ndarray:
    return 0.03 * np.random.default_rng(0).uniform(-1.0, 1.0, (system.size, 3))


def places_on(elements: str) -> list[int]:
    """Those of the mechanisms that can act on elements."""
    alters = [place for place, m in enumerate(FIRST) if m.quadratic or not isinstance(m, Following)]
    return alters if elements in QUADRATIC else [*range(len(FIRST))]


@pytest.mark.parametrize(
    ("places", "elements"),
    [
        pytest.param(places, elements, id=f"{FIRST[places[0]].kind if len(places) == 1 else 'all'}-{elements}")
        for elements in ELEMENTS
        for places in (*([place] for place in places_on(elements)), places_on(elements))
    ],
)
def test_it_is_as_a_system_made_of_them(places: list[int], elements: str, device: str) -> None:
    first = model_of([FIRST[place] for place in places], 1000.0, elements)
    second = model_of([SECOND[place] for place in places], 700.0, elements)
    second = replace(second, mesh=first.mesh)
    system = System(first, device)
    arrays = [array.ptr for term in system.terms for array in vars(term).values() if isinstance(array, wp.array)]
    system.set_time_step(0.05)
    direction = np.random.default_rng(1).normal(size=(system.size, 3))
    for model in (second, first, second):
        system.set_model(model)
        expected = System(model, device)
        expected.set_time_step(0.05)
        system.forget()
        np.testing.assert_array_equal(forces_at(system, at(system)), forces_at(expected, at(system)))
        along = []
        for each in (system, expected):
            # a pressure of pores is found from where the last one was
            each.forget()
            each.u.assign(at(system))
            each.evaluate_tangents()
            along.append(each.stiffness_times(direction))
        np.testing.assert_array_equal(*along)
    again = [array.ptr for term in system.terms for array in vars(term).values() if isinstance(array, wp.array)]
    assert again == arrays


def test_every_mechanism_that_acts_in_a_system_is_here() -> None:
    acting = {kind for kind, m in mechanisms().items() if any(hasattr(m, face) for face in FACES)}
    assert {mechanism.kind for mechanism in FIRST} == {mechanism.kind for mechanism in SECOND} == acting


@pytest.mark.parametrize("mechanism", [m for m in FIRST if isinstance(m, Following)], ids=lambda m: m.kind)
def test_a_term_that_remembers_says_what(mechanism: Following) -> None:
    system = System(model_of(()), "cpu")
    term = mechanism.bind(system)
    changes = any(getattr(type(term), name) is not getattr(Term, name) for name in ("advance", "forget", "augment"))
    assert bool(term.memory) == changes


@pytest.mark.parametrize("mechanism", [m for m in FIRST if isinstance(m, Following)], ids=lambda m: m.kind)
def test_a_system_that_nothing_uses_is_gone_at_once(mechanism: Following) -> None:
    system = System(model_of((mechanism,)), "cpu")
    system.evaluate_forces()
    gone = weakref.ref(system)
    del system
    assert gone() is None


def test_a_captured_step_follows(device: str) -> None:
    first, second = model_of(FIRST), replace(model_of(SECOND, 700.0), mesh=model_of(FIRST).mesh)
    second = replace(second, mesh=first.mesh, loads=[Gravity(direction=(1.0, 0.0, 0.0), density=100.0)])
    found = []
    for captured in (False, True):
        system = System(first, device)
        simulator = Simulator(system, time_step=1e-3, tolerance=1e-12)
        if captured:
            simulator.capture()
        simulator.step()
        system.set_model(second)
        for _ in range(3):
            simulator.step()
        found.append(system.u.numpy().copy())
    assert np.abs(found[0]).max() > 0.0
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-12 * np.abs(found[0]).max())


@pytest.mark.parametrize("kind", ["drainage", "viscoelasticity"])
def test_what_a_term_remembers_stays(kind: str, device: str) -> None:
    [place] = [place for place, mechanism in enumerate(FIRST) if mechanism.kind == kind]
    first = model_of(FIRST[place : place + 1])
    system = System(first, device)
    system.set_time_step(0.05)
    system.u.assign(at(system))
    system.advance()
    [remembered] = [[array.numpy().copy() for array in own] for own in system.remembered()]
    system.set_model(replace(model_of(SECOND[place : place + 1]), mesh=first.mesh))
    for array, before in zip(system.remembered()[0], remembered, strict=True):
        np.testing.assert_array_equal(array.numpy(), before)
    assert all(np.abs(before).max() > 0.0 for before in remembered)


@pytest.mark.parametrize(
    ("others", "message"),
    [
        ((Swelling(amount=0.1),), "expected other numbers of Contact"),
        ((Contact(nodes="below", state="sliding"),), "expected other numbers of Contact"),
        ((Contact(nodes="wall", state="lifting"),), "expected other numbers of Contact"),
        ((), "found 0, expected other numbers of those 1"),
    ],
)
def test_what_needs_another_system(others: tuple[Mechanism, ...], message: str) -> None:
    first = model_of(FIRST[1:2])
    system = System(first, "cpu")
    with pytest.raises(InputError, match=message):
        system.set_model(replace(first, mechanisms=others))
    assert system.model is first


def test_another_body_needs_another_system() -> None:
    first = model_of(FIRST[1:2])
    system = System(first, "cpu")
    with pytest.raises(InputError, match="another mesh"):
        system.set_model(model_of(FIRST[1:2]))
    with pytest.raises(InputError, match="another density"):
        system.set_model(replace(first, density=900.0))
    with pytest.raises(InputError, match="other components are constrained"):
        system.set_model(replace(first, constrained=np.zeros_like(first.constrained)))
