"""What these recordings could tell: how large each mechanism must be to be seen, and what could be taken for it.

In coordinates in which noise and nuisances are `N(0, I)` an effect `g` is as visible as it is long, `d = |g|`. Another
cause with columns `G` imitates the part `rho^2 = |P g|^2 / |g|^2` of it, `P` the projection on `G`. A name is expected
once `d^2 (1 - rho^2) / 2` is the log odds that the losses ask for, times the temperature of the evidence.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.result import Confusion
from warpbrain.inference import Cause, GaussianModel, Kind
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import Calibration, calibration
from warpbrain.physics.values import Smallest
from warpbrain.worlds.body.causes import BodyCauses
from warpbrain.worlds.body.parameters import smallest_of

Floats = NDArray[np.float64]


def imitations(causes: BodyCauses, model: GaussianModel) -> Confusion:
    """Which part of each mechanism, at its middling place, the best place of each other cause imitates."""
    bases = {cause.name: [_orthonormal(model, place.columns) for place in cause.places] for cause in causes.causes}
    rows: dict[str, dict[str, float]] = {}
    for cause in causes.causes:
        if cause.kind is not Kind.PHYSICS:
            continue
        place, _ = _middling(cause, model)
        effect = model.standardised(_pattern(cause, place))
        whole = max(float(effect @ effect), 1e-300)
        rows[cause.name] = {
            other: max(float(np.sum((Q.T @ effect) ** 2)) for Q in own) / whole
            for other, own in bases.items()
            if other != cause.name
        }
    return Confusion(rows)


def smallest(causes: BodyCauses, model: GaussianModel, confusion: Confusion) -> dict[str, Smallest]:
    """Of each mechanism, the size that is seen nearly always, and that which is expected to be named."""
    seen, needed = belief("checks.seen"), _log_odds(calibration())
    found = {}
    for name, others in confusion.rows.items():
        cause = causes.named(name)
        place, length = _middling(cause, model)
        alike = max((part for other, part in others.items() if causes.named(other).kind is Kind.PHYSICS), default=0.0)
        named = math.sqrt(2.0 * needed / (1.0 - alike)) if alike < 1.0 - 1e-9 else math.inf
        found[name] = smallest_of(causes.effects[name][place], length, seen, max(seen, named))
    return found


def _log_odds(known: Calibration) -> float:
    """Difference of log evidence from which a name costs less than silence."""
    odds = known.losses["false name"] / known.losses["cannot say"] - 1.0
    return known.temperature * math.log(odds)


def _pattern(cause: Cause, place: int) -> Floats:
    own = cause.places[place]
    return own.columns[:, 0] if own.mean is None else own.mean


def _middling(cause: Cause, model: GaussianModel) -> tuple[int, float]:
    """The place whose effect is as visible as that of half of them, and how visible."""
    patterns = np.column_stack([_pattern(cause, place) for place in range(len(cause.places))])
    lengths = np.linalg.norm(model.standardised(patterns), axis=0)
    middle = int(np.argsort(lengths)[len(lengths) // 2])
    return middle, float(lengths[middle])


def _orthonormal(model: GaussianModel, columns: Floats) -> Floats:
    """Basis (n, k) of what columns reach, standardised."""
    left, sizes, _ = np.linalg.svd(model.standardised(columns), full_matrices=False)
    return np.asarray(left[:, sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300)])
