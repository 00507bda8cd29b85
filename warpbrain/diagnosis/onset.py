"""When something set in: what explains the mismatch, there from one of the recorded times on.

Place and interval (`warpbrain.worlds.body.time_courses`) are scanned together. Each interval is as probable as another
beforehand, and each course within it. A smooth force is only nearly what acts, and the state that all is linear about
only nearly that of each time: the evidence is sharper than it should be, and is divided by a temperature with which
what is said held for sudden and growing swellings of a phantom.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.evidence import log_mean
from warpbrain.diagnosis.screening import UNKNOWN, Screen, log_unknown
from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.time_courses import TimeCourse, time_courses

Floats = NDArray[np.float64]

#: What the interval that is said holds at least.
CREDIBLE = 0.95
#: Temperature of the evidence.
TEMPERATURE = 8.0
#: Most places that are scanned.
_PLACES = 40
#: Of what has a history without anything that sets in later.
OF_ITS_OWN = "as its own law says, since the load came"


@dataclass(frozen=True)
class Onset:
    """When something set in.

    Attributes
    ----------
    first, last : float
        Between which times [s], 0 being when the load came.
    probability : float or None
        Of that; None where it follows from what it is.
    course : str
        How it came, in words; empty if these data do not tell.
    intervals : tuple of (first, last, probability)
        All that were compared.
    """

    first: float
    last: float
    probability: float | None
    course: str
    intervals: tuple[tuple[float, float, float], ...] = ()


def onset_of(kind: str, base: Base, candidates: Candidates, screen: Screen) -> Onset | None:
    """When a kind of mechanism, or the unknown, set in; None where nothing was recorded at several times.

    Parameters
    ----------
    kind : str
        What explains the mismatch best.
    base : Base
    candidates : Candidates
        At the base.
    screen : Screen
        Of the residual there.
    """
    times = np.array(base.states.times)
    if len(times) < 2:
        return None
    effects = [] if kind == UNKNOWN else _best_effects(kind, candidates, screen)
    if any(effect.proposed.changes_in_time for effect in effects):
        return Onset(0.0, float(times[0]), None, OF_ITS_OWN)
    courses = time_courses(base.states.times)
    alike = np.bincount([course.interval for course in courses])
    evidence = [
        _log_evidence(base, effects, course.factor(base.at.sensors.times)) - float(np.log(alike[course.interval]))
        for course in courses
    ]
    return _summary([0.0, *times.tolist()], courses, np.array(evidence))


def _best_effects(kind: str, candidates: Candidates, screen: Screen) -> list[Effect]:
    own = candidates.of_kind[kind]
    order = own[np.argsort(-screen.places[own, 0])][:_PLACES]
    return [candidates.effects[number] for number in order.tolist()]


def _log_evidence(base: Base, effects: list[Effect], factor: Floats) -> float:
    """Log density of the residual with what follows a factor (n,) on each row; without effects: any smooth force."""
    whitened = base.whitened[:, None]
    if not effects:
        loose = [base.explanation.with_more(factor[:, None] * columns) for columns in base.constant_forces]
        return float(log_unknown(loose, whitened)[0])
    scaled = [
        replace(effect, mean=factor * effect.mean, columns=factor[:, None] * effect.columns) for effect in effects
    ]
    found = StackEvidence(base.explanation, base.explanation.stack(scaled)).log_places(whitened)[:, 0]
    return float(log_mean(found))


def _summary(edges: list[float], courses: list[TimeCourse], evidence: Floats) -> Onset:
    from scipy.special import softmax

    weights = softmax(evidence / TEMPERATURE)
    count = len(edges) - 1
    of_interval = np.bincount([course.interval for course in courses], weights, minlength=count)
    # the shortest run of intervals that holds enough
    runs = itertools.combinations(range(count + 1), 2)
    total = np.r_[0.0, np.cumsum(of_interval)]
    enough = [(edges[j] - edges[i], i, j) for i, j in runs if total[j] - total[i] >= min(CREDIBLE, total[-1])]
    _, i, j = min(enough)
    # what begins before the last time alone has no course
    of_shape: dict[str, float] = {}
    for course, weight in zip(courses, weights.tolist(), strict=True):
        of_shape[course.shape] = of_shape.get(course.shape, 0.0) + (weight if course.interval < count - 1 else 0.0)
    likeliest = max(of_shape, key=lambda shape: of_shape[shape])
    return Onset(
        edges[i],
        edges[j],
        min(1.0, float(total[j] - total[i])),
        likeliest if of_shape[likeliest] >= CREDIBLE else "",
        tuple((a, b, float(p)) for a, b, p in zip(edges[:-1], edges[1:], of_interval, strict=True)),
    )
