"""A state beside a known one: on its branch, wherever the search for it begins, or none."""

from dataclasses import replace

import numpy as np
import pytest
from metamorphic.drawn import drawn_case

from warpbrain.errors import SolveError
from warpbrain.estimation.parameters import declared
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.worlds.body.states import Hypothesis, SolvedState, States


@pytest.fixture(scope="module")
def states() -> States:
    """A soft block on a table, 7 x 5 x 8 cm."""
    case = drawn_case(41014, cells=(3, 3))
    return States(replace(case, mechanisms=(), boundaries=case.boundaries[:1]), "cpu")


def hanging(states: States, times: float, direction: tuple[float, float, float] = (0.31, -0.68, -0.66)) -> Hypothesis:
    """Under so many times its weight, which draws it sideways."""
    weight = Gravity(direction=direction, density=1000.0 * times)
    theta = declared(states.case, states.parameters)
    return Hypothesis(theta, np.zeros(states.modes.shape[1]), (weight,))


@pytest.fixture(scope="module")
def known(states: States) -> SolvedState:
    return states.solve(hanging(states, 0.8))


@pytest.mark.parametrize("begun", ["at rest", "beyond", "beside"])
def test_it_is_the_same_wherever_the_search_begins(states: States, known: SolvedState, begun: str) -> None:
    u, rng = known.u, np.random.default_rng(1)
    start = {"at rest": np.zeros_like(u), "beyond": 1.5 * u, "beside": u + 2e-3 * rng.normal(size=u.shape)}[begun]
    expected = states.solve(hanging(states, 1.0), u)
    found = states.solve(hanging(states, 1.0), start, known=u)
    assert np.abs(found.u - expected.u).max() < 1e-4 * np.abs(expected.u).max()


def test_where_its_branch_ends_there_is_none(states: States) -> None:
    """Pressed onto the table it gives way sideways under some multiple of its weight."""
    down = (0.0, 0.0, -1.0)
    standing = states.solve(hanging(states, 0.5, down))
    with pytest.raises(SolveError, match="no equilibrium found beyond"):
        states.solve(hanging(states, 30.0, down), standing.u, known=standing.u)


def test_rounding_does_not_decide_whether_there_is_one(states: States, known: SolvedState) -> None:
    """Trials of a fit are far away and bold: found or not, and where, must not hang on the last bits of a start."""
    rng, size = np.random.default_rng(2), float(np.abs(known.u).max())
    free = ~known.system.model.constrained
    for times in np.linspace(-6.0, 14.0, 21).tolist():
        direction = rng.normal(size=3)
        x, y, z = (direction / np.linalg.norm(direction)).tolist()
        start, found = 1.5 * known.u, []
        for moved in (0.0, 1e-7 * size):
            near = start + moved * free * rng.normal(size=start.shape)
            try:
                found.append(states.solve(hanging(states, times, (x, y, z)), near, known=known.u).u)
            except SolveError:
                found.append(np.full_like(start, np.nan))
        np.testing.assert_allclose(found[0], found[1], atol=1e-3 * size, equal_nan=True)
