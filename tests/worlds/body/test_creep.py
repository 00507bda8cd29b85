"""Responses of bodies that creep at the time when something was recorded."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from slow_block import CAUSES, write_slow

from warpbrain.arrays import Floats
from warpbrain.estimation.parameters import declared
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.compressibility import Compressibility
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.creep import creep_function
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.nuisances import field_columns, tissue_columns
from warpbrain.worlds.body.states import Hypothesis, SolvedState, States

_RELAXES = Viscoelasticity(moduli=(1.0,), times=(100.0,))


@pytest.mark.parametrize("modulus", [0.1, 1.0, 8.0])
@pytest.mark.parametrize("time", [0.5, 10.0, 200.0])
def test_a_body_of_one_branch_creeps_as_in_closed_form(modulus: float, time: float) -> None:
    """Zener's solid: it is retarded in `(1 + beta) tau`."""
    tau = 10.0
    expected = 1.0 - modulus / (1.0 + modulus) * np.exp(-time / ((1.0 + modulus) * tau))
    assert creep_function(lambda t: modulus * np.exp(-t / tau), time) == pytest.approx(expected, rel=5e-3)


@pytest.fixture(scope="module")
def sinking(tmp_path_factory: pytest.TempPathFactory) -> tuple[States, SolvedState]:
    """A block whose stress relaxes under its weight."""
    case = write_slow(tmp_path_factory.mktemp("sinking") / "case", CAUSES["viscoelasticity"])
    held = tuple(boundary for boundary in case.boundaries if boundary.kind == "fixed")
    states = States(replace(case, poisson=0.45, boundaries=held), "cpu")
    return states, states.solve(_hypothesis(states, _weight(1000.0), _RELAXES))


def _weight(density: float) -> Gravity:
    return Gravity(density=density, direction=(0.3, 0.0, -1.0))


def _hypothesis(states: States, *acting: Mechanism) -> Hypothesis:
    return Hypothesis(declared(states.case, states.parameters), np.zeros(states.modes.shape[1]), acting)


def _of(proposal: Proposal) -> Callable[[Linearisation, States], Floats]:
    return lambda at, _: Effects(at).of([proposal], proposal.make(proposal.mean), columns_alone=True)[0].columns[:, 0]


def _tissue(at: Linearisation, states: States) -> Floats:
    theta = declared(states.case, states.parameters)
    prior: Any = SimpleNamespace(factor=np.eye(len(theta)))
    return tissue_columns(at, states, theta, prior)[:, 0]


_DENSER = Proposal.of_one(_weight, 1000.0, 100.0, "smooth", 1000.0)
_SWELLS = Proposal.of_one(lambda amount: Swelling(amount=amount), 0.0, 1.0, "smooth")
_VOLUME = Compressibility.about_law(0.45, 1.0)


@pytest.mark.slow(8)
@pytest.mark.parametrize(
    ("columns", "changed", "step"),
    [
        (_of(_DENSER), lambda h: replace(h, mechanisms=(_weight(1010.0), _RELAXES)), 0.1),
        (_of(_SWELLS), lambda h: replace(h, mechanisms=(*h.mechanisms, Swelling(amount=0.1))), 0.1),
        (_of(_VOLUME), lambda h: replace(h, mechanisms=(*h.mechanisms, _VOLUME.make(_VOLUME.mean + 0.01))), 0.01),
        (_tissue, lambda h: replace(h, theta=h.theta + 0.02), 0.02),
        (
            lambda at, states: field_columns(at, states)[:, 1],
            lambda h: replace(h, field=0.1 * np.eye(len(h.field))[1]),
            0.1,
        ),
    ],
    ids=["weight", "swelling", "volume", "tissue", "stiffness field"],
)
def test_at_every_time_columns_are_about_the_differences_of_states(
    sinking: tuple[States, SolvedState],
    columns: Callable[[Linearisation, States], Floats],
    changed: Callable[[Hypothesis], Hypothesis],
    step: float,
) -> None:
    """Of a block whose displacement at 5 s is 0.63 of that at 300 s, by which those of the end are too large."""
    states, state = sinking
    linear = columns(state.linearised(), states)
    true = (states.solve(changed(state.hypothesis)).sensors.computed - state.sensors.computed) / step
    for time in states.times:
        rows = state.sensors.times == time
        assert np.linalg.norm(linear[rows] - true[rows]) < 0.2 * np.linalg.norm(true[rows])


@pytest.mark.slow(3)
@pytest.mark.parametrize("number", [0, 1], ids=["modulus", "time"])
def test_so_are_those_of_what_relaxes(sinking: tuple[States, SolvedState], number: int) -> None:
    states, state = sinking
    any_case: Any = SimpleNamespace(require_new=lambda _kind: None, instants=3)
    of_one_branch = next(p for p in Viscoelasticity.proposals(any_case) if len(p.mean) == 2)
    mean = np.array([1.0, np.log(100.0)])
    proposal = replace(of_one_branch, mean=mean)
    [effect] = Effects(state.linearised()).of([proposal], proposal.make(mean), columns_alone=True)
    shifted = proposal.make(mean + 0.05 * proposal.sd * np.eye(2)[number])
    other = states.solve(_hypothesis(states, _weight(1000.0), shifted))
    true = (other.sensors.computed - state.sensors.computed) / 0.05
    for time in states.times:
        rows = state.sensors.times == time
        assert np.linalg.norm(effect.columns[rows, number] - true[rows]) < 0.2 * np.linalg.norm(true[rows])
