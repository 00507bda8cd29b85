"""When something set in: what explains the mismatch, there from one of the recorded times on.

Between two recorded times nothing is known of when it began, so what is scanned is the interval: before the first time,
or between two that follow each other. What begins there comes all at once, grows evenly, or nears its full size ever
more slowly,

    f(t) = 1,    (t - t0) / (T - t0),    1 - exp(-3 (t - t0) / (T - t0)),      f = 0 before,

`t0` the beginning of the interval and `T` the last time. Place and interval are scanned together. Each interval is as
probable as another beforehand, and each course within it; at the last time alone they are the same.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.dictionary import Candidates
from warpbrain.diagnosis.effects import Effect
from warpbrain.diagnosis.screening import UNKNOWN, Screen, log_places, log_unknown

Floats = NDArray[np.float64]

#: What the interval that is said holds at least.
CREDIBLE = 0.9
#: Most places that are scanned.
_PLACES = 40
#: Words for the courses, and each from the part of the time that has gone by since the beginning.
_COURSES: dict[str, Callable[[Floats], Floats]] = {
    "all at once": np.ones_like,
    "growing evenly": lambda part: part,
    "growing ever more slowly": lambda part: -np.expm1(-3.0 * part),
}
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
    if any(effect.about is not None or effect.proposed.history is not None for effect in effects):
        return Onset(0.0, float(times[0]), None, OF_ITS_OWN)
    edges = [0.0, *times.tolist()]
    said: list[tuple[int, str]] = []
    evidence: list[float] = []
    for number, begin in enumerate(edges[:-1]):
        courses = list(_COURSES)[:1] if number == len(times) - 1 else list(_COURSES)
        for course in courses:
            part = (base.at.sensors.times - begin) / (times[-1] - begin)
            factor = np.where(part > 0.0, _COURSES[course](part), 0.0)
            said.append((number, course))
            evidence.append(_log_evidence(base, effects, factor) - float(np.log(len(courses))))
    return _summary(edges, said, np.array(evidence))


def _best_effects(kind: str, candidates: Candidates, screen: Screen) -> list[Effect]:
    own = candidates.of_kind[kind]
    order = own[np.argsort(-screen.places[own, 0])][:_PLACES]
    return [candidates.effects[number] for number in order.tolist()]


def _log_evidence(base: Base, effects: list[Effect], factor: Floats) -> float:
    """Log density of the residual with what follows a factor (n,) on each row; without effects: any smooth force."""
    from scipy.special import logsumexp

    whitened = base.whitened[:, None]
    if not effects:
        loose = [base.explanation.with_more(factor[:, None] * columns) for columns in base.smooth_forces]
        return float(log_unknown(loose, whitened)[0])
    scaled = [
        replace(effect, mean=factor * effect.mean, columns=factor[:, None] * effect.columns) for effect in effects
    ]
    found = log_places(base.explanation, base.explanation.stack(scaled), whitened)[:, 0]
    return float(logsumexp(found)) - float(np.log(len(found)))


def _summary(edges: list[float], said: list[tuple[int, str]], evidence: Floats) -> Onset:
    from scipy.special import softmax

    weights = softmax(evidence)
    count = len(edges) - 1
    of_interval = np.bincount([number for number, _ in said], weights, minlength=count)
    # the shortest run of intervals that holds enough
    runs = itertools.combinations(range(count + 1), 2)
    total = np.r_[0.0, np.cumsum(of_interval)]
    enough = [(edges[j] - edges[i], i, j) for i, j in runs if total[j] - total[i] >= min(CREDIBLE, total[-1])]
    _, i, j = min(enough)
    # what begins before the last time alone has no course
    of_course = dict.fromkeys(_COURSES, 0.0)
    for (number, course), weight in zip(said, weights.tolist(), strict=True):
        of_course[course] += weight if number < count - 1 else 0.0
    likeliest = max(of_course, key=lambda course: of_course[course])
    return Onset(
        edges[i],
        edges[j],
        min(1.0, float(total[j] - total[i])),
        likeliest if of_course[likeliest] >= CREDIBLE else "",
        tuple((a, b, float(p)) for a, b, p in zip(edges[:-1], edges[1:], of_interval, strict=True)),
    )
