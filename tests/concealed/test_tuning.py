"""The search for strengths, on walls that answer by a formula."""

import numpy as np
import pytest

from concealed.tuning import LEVELS, Unreachable, first_guess, tune
from warpbrain.errors import SolveError

WANTED = (1.4e-3, 5.9e-3)


def walls(strength: float, level: float) -> tuple[float, float]:
    """Both walls move with both: a stiffening push, and a weight that fades as less is drained."""
    if strength > 900.0:
        raise SolveError("collapsed")
    sinks = 4e-3 * max(0.16 - level, 0.0) / 0.06
    push = 1e-2 * np.tanh(strength / 600.0)
    return float(np.hypot(sinks, 0.08 * push + 5e-4)), float(np.hypot(0.2 * sinks, push))


def test_both_walls_are_brought_where_they_should_be():
    guess = first_guess(walls, 1000.0, WANTED)
    found = tune(walls, 1000.0, WANTED, guess, close=1e-4)
    assert found.miss < 1e-4
    np.testing.assert_allclose(walls(found.strength, found.level), WANTED, rtol=2e-4)
    again = tune(walls, 1000.0, WANTED, 1.1 * found.strength, found.level, found.slopes, close=1e-3)
    assert again.miss < 1e-3


def test_what_is_too_weak_or_moves_the_ventricles_too_far_is_given_up():
    with pytest.raises(Unreachable):
        first_guess(walls, 100.0, WANTED)
    with pytest.raises(Unreachable):
        first_guess(walls, 1000.0, (0.5e-3, 5.9e-3))


def test_collapse_ends_a_search():
    with pytest.raises(Unreachable):
        tune(walls, 2000.0, WANTED, 1500.0)


def test_levels_stay_between_full_and_deeply_drained():
    seen = []

    def noted(strength, level):
        seen.append(level)
        return walls(strength, level)

    tune(noted, 1000.0, (3e-2, 5.9e-3), 400.0)
    assert min(seen) >= LEVELS[0] - 1e-12 and max(seen) <= LEVELS[1] + 1e-12
