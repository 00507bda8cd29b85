"""Where a state may be, from states nearby that are known: the nearest one, and what is linear between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpbrain.arrays import Floats

#: What a part of a difference between states costs beside what it does not explain: none is stretched far.
_STRETCH = 0.01


def extrapolated(values: Sequence[tuple[Floats, Floats]], at: Floats) -> Floats:
    """What is expected of a function of numbers (k,) at some of them, from its values (...) at one or more others.

    Of the nearest value, and as much of the differences of others to it as makes up for the distance. It is only where
    to begin: nothing that is found depends on it.
    """
    distances = [float(np.linalg.norm(at - numbers)) for numbers, _ in values]
    order = np.argsort(distances, kind="stable").tolist()
    nearest, value = values[order[0]]
    away = at - nearest
    size = float(np.linalg.norm(away))
    others = [values[number] for number in order[1:]]
    if size == 0.0 or not others:
        return value
    between = np.column_stack([numbers - nearest for numbers, _ in others]) / size
    # by least squares: normal equations are singular where some states are many times as far away as the nearest one
    stretch = np.sqrt(_STRETCH) * np.eye(len(others))
    target = np.append(away / size, np.zeros(len(others)))
    shares = np.linalg.lstsq(np.vstack([between, stretch]), target)[0]
    expected = value.copy()
    for share, (_, other) in zip(shares.tolist(), others, strict=True):
        expected += share * (other - value)
    return expected
