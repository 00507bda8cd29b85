"""Which points that were set aside as gross errors are none, once all that may be missing is considered.

A point that no smooth force explains is set aside before anything is looked for; see `gross_errors`. But what acts in
one place moves the point beside it by millimetres and its neighbours by little: the one point that tells most. So each
point that was set aside is asked again, with `e` the probability of a gross error, `q` the wide distribution of one,
and every hypothesis `H` that is looked for,

    odds = (1 - e) sum_H p(H) p(r | H) / (e sum_H p(H) p(r, its noise q | H)),

with half of `p(H)` for nothing missing. A gross error alone is no reason for a mechanism: its neighbours have to agree.
What acts in one place is asked at places of the scan at first. Where that leaves it open, so near to a point that a
step of the scan matters, the best of them are moved between places (`placed`), in numerator and denominator alike.

Two points beside one cause may both have been set aside, and neither has the other for a neighbour then. So where no
point comes back alone, those near each other are asked two at a time: both sound against both gross errors.

What moves points beside a second cause is told by both causes together. So they are asked again beside what is named.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.evidence import Explanation, log_mean
from warpbrain.diagnosis.gross_errors import ASIDE
from warpbrain.diagnosis.placing import placed
from warpbrain.diagnosis.screened import Screened
from warpbrain.diagnosis.screening import Screen, Screening
from warpbrain.diagnosis.single_points import LARGE, OFTEN
from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.threads import in_threads
from warpbrain.worlds.body.dictionary import Candidates

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


#: Logarithm of the odds from which on places between those of the scan may turn them, and how far [nats] behind the
#: best kind they are asked for.
_OPEN, _BEHIND = -8.0, 8.0
#: How far from each other [m] two points are that one local cause moves, at most.
_NEAR = 0.03


def sound_points(base: Base, candidates: Candidates, explanation: Explanation, residual: Floats) -> Bools:
    """Rows (n,) of points that were set aside, and are rather no gross errors.

    Parameters
    ----------
    base : Base
    candidates : Candidates
        At the state in question.
    explanation : Explanation
        Noise and nuisances there, and what is known to act.
    residual : (n,) array
        Of the linear model there, with all nuisances in the middle of their prior.
    """
    sound = np.zeros(len(base.aside), dtype=bool)
    if not base.aside.any():
        return sound
    kappa = explanation.best_kappa(explanation.whitened(residual))
    screening = Screening(explanation, candidates, base.smooth_forces, np.array([kappa]))
    groups = base.at.sensors.groups
    while True:
        points = np.unique(groups[base.aside & ~sound]).tolist()
        for several in ([[point] for point in points], _near_each_other(base, points)):
            each = [np.isin(groups, together) for together in several]
            odds = in_threads(partial(_log_odds, base, screening, residual, kappa), each)
            if odds and max(odds) > 0.0:
                break
        else:
            return sound
        soundest = each[int(np.argmax(odds))]
        sound |= soundest
        screening = screening.with_noise(soundest, 1.0 / ASIDE)


def _near_each_other(base: Base, points: Sequence[int]) -> list[list[int]]:
    """Two points each, of those that have a place."""
    sensors = base.at.sensors
    at = {point: sensors.positions[sensors.groups == point][0] for point in points}
    return [
        [one, other] for one, other in itertools.combinations(points, 2) if np.linalg.norm(at[one] - at[other]) < _NEAR
    ]


def _log_odds(base: Base, screening: Screening, residual: Floats, kappa: float, rows: Bools) -> float:
    """Logarithm of the odds that points, whose rows are set aside in a screening, are no gross errors."""
    sound, gross = (_screened(base, screening.with_noise(rows, n / ASIDE), residual, kappa) for n in (1.0, LARGE))
    before = len(np.unique(base.at.sensors.groups[rows])) * float(np.log1p(-OFTEN) - np.log(OFTEN))

    def log_odds(of_sound: Floats, of_gross: Floats) -> float:
        return before + _log_density(sound.screen, of_sound) - _log_density(gross.screen, of_gross)

    found = log_odds(sound.screen.log_factors[:, 0], gross.screen.log_factors[:, 0])
    return log_odds(_between_places(sound), _between_places(gross)) if _OPEN < found <= 0.0 else found


def _screened(base: Base, screening: Screening, residual: Floats, kappa: float) -> Screened:
    screen = screening.run(screening.explanation.whitened(residual)[:, None])
    return Screened(base, screening.candidates, screening, residual, screen, kappa)


def _log_density(screen: Screen, log_factors: Floats) -> float:
    """Of a residual, where as often nothing is missing as anything of these Bayes factors (kinds,)."""
    return float(screen.none[0] + np.logaddexp(0.0, log_mean(log_factors[:, None])[0]))


def _between_places(screened: Screened) -> Floats:
    """Log Bayes factors (kinds,) with what acts in one place between the places of its scan, where that is better."""
    candidates, explanation, screen = screened.candidates, screened.explanation, screened.screen
    white = explanation.whitened(screened.residual)[:, None]
    found = screen.log_factors[:, 0].copy()
    least = found.max() - _BEHIND
    for k, (kind, own) in enumerate(candidates.of_kind.items()):
        number = screen.best_effect(candidates, kind)
        proposal = candidates.effects[number].proposal
        if proposal is None or proposal.elsewhere is None or found[k] < least:
            continue
        effect = placed(screened, number).effect
        beside = StackEvidence(explanation, explanation.stack([effect]))
        value = beside.log_places(white, np.array([screened.kappa]))[0, 0] - screen.none[0]
        # its prior covers as many places of the scan as its evidence is averaged over
        found[k] = max(found[k], value + effect.proposed.log_covered - np.log(len(own)))
    return found
