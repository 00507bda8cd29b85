"""What is not known of an effect between neighbours of its scan: a level, a radius, a time of relaxation.

A scan has a few values of such a number, and an amount that is fitted at one of them is sure for that value only.
Between two neighbours the number may be anywhere: uniform in one step, of a standard deviation of the step / sqrt(12).
A number that coefficients set is fitted, and nothing is left open about it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.parameters import numbers_of

Floats = NDArray[np.float64]


def between_neighbours(candidates: Candidates, kind: str, number: int, z: Floats) -> Floats:
    """Columns (n, k) of one standard deviation of each number that the scan of a kind has about one effect.

    Parameters
    ----------
    candidates : Candidates
    kind : str
    number : int
        Of the effect.
    z : (k,) array
        Its coefficients.
    """
    effects = candidates.effects
    one = effects[number].proposed
    alike = [k for k in candidates.of_kind[kind].tolist() if _same_place(effects[k].proposed.centre, one.centre)]
    alike = [k for k in alike if effects[k].proposed.region == one.region and effects[k].columns.shape[1] == len(z)]
    numbers = {k: _numbers(effects[k], 0.0 * z) for k in alike}
    fitted = set().union(*(_differ(_numbers(effects[number], 0.1 * axis), numbers[number]) for axis in np.eye(len(z))))
    found = []
    for name, value in numbers[number].items():
        if name in fitted:
            continue
        # all other numbers alike
        own = [k for k in alike if name in numbers[k] and _differ(numbers[k], numbers[number]) <= {name}]
        own = sorted({numbers[k][name]: k for k in own}.items())
        at = [other for other, _ in own].index(value)
        low, high = own[max(at - 1, 0)][1], own[min(at + 1, len(own) - 1)][1]
        if low != high:
            steps = (number not in (low, high)) + 1
            answers = [effects[k].mean + effects[k].columns @ z for k in (low, high)]
            found.append((answers[1] - answers[0]) / (steps * np.sqrt(12.0)))
    return np.array(found).reshape(len(found), len(effects[number].mean)).T


def _numbers(effect: Effect, z: Floats) -> dict[str, float]:
    return {name: value for name, (value, _) in numbers_of(effect, z).items()}


def _same_place(first: Floats | None, second: Floats | None) -> bool:
    if first is None or second is None:
        return first is second
    return bool(np.array_equal(first, second))


def _differ(first: dict[str, float], second: dict[str, float]) -> set[str]:
    return {name for name in first.keys() | second.keys() if first.get(name) != second.get(name)}
