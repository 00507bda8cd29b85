"""Detectability of mechanisms with these recordings, and their confusion with other causes.

In coordinates in which noise and nuisances are `N(0, I)` the length of an effect `g` is its detectability, `d = |g|`.
Another cause with columns `G` explains the part `rho^2 = |P g|^2 / |g|^2` of it, `P` the projection on `G`. A mechanism
is expected to be named if `d^2 (1 - rho^2) / 2` is the log odds that the losses require, times the temperature.
"""

from __future__ import annotations

import math

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.diagnosis.result import Confusion
from warpbrain.inference import Cause, GaussianModel, Kind
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import Calibration, calibration
from warpbrain.physics.words import Smallest
from warpbrain.worlds.body.causes import BodyCauses
from warpbrain.worlds.body.parameters import smallest_of


def imitations(causes: BodyCauses, model: GaussianModel) -> Confusion:
    """Part of each mechanism, at its median detectability, that the best place of each other cause explains."""
    bases = {cause.name: [_orthonormal(model, place.columns) for place in cause.places] for cause in causes.causes}
    rows: dict[str, dict[str, float]] = {}
    for cause in causes.causes:
        if cause.kind is not Kind.PHYSICS:
            continue
        place, _ = _median_place(causes, cause, model)
        effect = model.standardised(_pattern(cause, place))
        square = max(float(effect @ effect), 1e-300)
        rows[cause.name] = {
            other: max(float(np.sum((Q.T @ effect) ** 2)) for Q in place_bases) / square
            for other, place_bases in bases.items()
            if other != cause.name
        }
    return Confusion(rows)


def smallest(causes: BodyCauses, model: GaussianModel, confusion: Confusion) -> dict[str, Smallest]:
    """Of each mechanism, the size that is detected nearly always, and that which is expected to be named."""
    seen, needed = belief("checks.seen"), _log_odds(calibration())
    sizes = {}
    for name, others in confusion.rows.items():
        cause = causes.named(name)
        place, length = _median_place(causes, cause, model)
        imitated = max(
            (part for other, part in others.items() if causes.named(other).kind is Kind.PHYSICS), default=0.0
        )
        named = math.sqrt(2.0 * needed / (1.0 - imitated)) if imitated < 1.0 - 1e-9 else math.inf
        sizes[name] = smallest_of(causes.effects[name][place], length, seen, max(seen, named))
    return sizes


def _log_odds(calibrated: Calibration) -> float:
    """Difference of log evidence from which a name has a lower expected loss than no name."""
    odds = calibrated.losses["false name"] / calibrated.losses["cannot say"] - 1.0
    return calibrated.temperature * math.log(odds)


def _pattern(cause: Cause, place: int) -> Floats:
    chosen = cause.places[place]
    return chosen.columns[:, 0] if chosen.mean is None else chosen.mean


def _median_place(causes: BodyCauses, cause: Cause, model: GaussianModel) -> tuple[int, float]:
    """The place of median detectability, and its detectability; of a size that does not change, if it has any."""
    effects = causes.effects[cause.name]
    always = [k for k, effect in enumerate(effects) if effect.proposed.over_time is None]
    numbers = always or list(range(len(effects)))
    patterns = np.column_stack([_pattern(cause, place) for place in numbers])
    lengths = np.linalg.norm(model.standardised(patterns), axis=0)
    middle = int(np.argsort(lengths)[len(lengths) // 2])
    return numbers[middle], float(lengths[middle])


def _orthonormal(model: GaussianModel, columns: Floats) -> Floats:
    """Orthonormal basis (n, k) of the span of columns, standardised."""
    vectors, sizes, _ = np.linalg.svd(model.standardised(columns), full_matrices=False)
    return np.asarray(vectors[:, sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300)])
