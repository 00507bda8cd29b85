"""When the cause of the mismatch set in: from which of the recorded times on it acts.

Place and interval (`warpbrain.worlds.body.time_courses`) are scanned together. Intervals are equally probable
beforehand, and so are the courses within each. A smooth force only approximates what acts, and the base only
approximates the state at each time, so the evidence is overconfident; it is divided by a temperature with which
intervals were right for sudden and growing swellings of a phantom.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import Cause, GaussianModel, Place
from warpbrain.inference.beliefs import belief
from warpbrain.inference.subsets import Blocks
from warpbrain.physics.proposal import Varying
from warpbrain.physics.words import label
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import BodyCauses, unknown_fields
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.parameters import mechanism_numbers
from warpbrain.worlds.body.time_courses import TimeCourse, factor_of_rows, finite_times, time_courses

#: Course of a mechanism that changes in time by itself.
OF_ITS_OWN = "as its own law says, since the load came"
#: Course of one whose size was found as a function of time.
AS_IT_CHANGES = "its size changes with time"


@dataclass(frozen=True)
class SizeOverTime:
    """One parameter of a mechanism at the recorded times."""

    #: Its name, and what it is in words.
    parameter: str
    says: str
    unit: str
    #: Times [s], and the parameter with its standard deviation in `unit`.
    seconds: tuple[float, ...]
    values: tuple[float, ...]
    deviations: tuple[float, ...]


@dataclass(frozen=True)
class Onset:
    """When something set in."""

    #: Interval [s] of onset; 0 is when the load came.
    first: float
    last: float
    probability: float | None  # of that interval; None if it follows from the mechanism
    course: str  # its shape in time, in words; empty if these data do not tell
    intervals: tuple[tuple[float, float, float], ...] = ()  # all intervals that were compared
    sizes: SizeOverTime | None = None  # of what was found with a size that is a function of time


def onset_of(base: Base, cause: Cause | None, in_time: bool, model: GaussianModel, residual: Floats) -> Onset | None:
    """When a cause set in; None where nothing was recorded at several times.

    `cause`: the best explanation, as if it acted all the time; None: an unknown force.
    `in_time`: whether it changes in time under constant loads.
    `model`: of all else that acts.
    `residual` (n,): less what is expected of all else.
    """
    times = np.array(base.states.times)
    if len(times) < 2:
        return None
    if in_time:
        return Onset(0.0, float(times[0]), None, OF_ITS_OWN)
    courses = time_courses(base.states.times)
    per_interval = np.bincount([course.interval for course in courses])
    cause = cause or unknown_fields(base)
    evidence = [
        _log_evidence(cause, factor_of_rows(course, base.at.sensors), model, residual)
        - float(np.log(per_interval[course.interval]))
        for course in courses
    ]
    return _summary([0.0, *finite_times(times).tolist()], courses, np.array(evidence))


def always_there(causes: BodyCauses, name: str) -> Cause:
    """A mechanism without the places at which its size is a function of time."""
    cause = causes.named(name)
    kept = [k for k, effect in enumerate(causes.effects[name]) if effect.proposed.over_time is None]
    shares = None if cause.shares is None else cause.shares[kept] / cause.shares[kept].sum()
    return replace(cause, places=tuple(cause.places[k] for k in kept), shares=shares)


def _log_evidence(cause: Cause, factor: Floats, model: GaussianModel, residual: Floats) -> float:
    """Log Bayes factor of a cause that follows a factor (n,) on each row."""
    places = tuple(
        Place(factor[:, None] * place.columns, None if place.mean is None else factor * place.mean)
        for place in cause.places
    )
    blocks = Blocks(model, residual, [replace(cause, places=places)])
    return float(np.logaddexp.reduce(blocks.log_factors() + blocks.log_weights, axis=None))


def _summary(edges: list[float], courses: list[TimeCourse], evidence: Floats) -> Onset:
    from scipy.special import softmax

    weights = softmax(evidence / belief("checks.onset_temperature"))
    count = len(edges) - 1
    of_interval = np.bincount([course.interval for course in courses], weights, minlength=count)
    # the shortest run of intervals with enough probability
    runs = itertools.combinations(range(count + 1), 2)
    total = np.r_[0.0, np.cumsum(of_interval)]
    enough = [
        (edges[j] - edges[i], i, j) for i, j in runs if total[j] - total[i] >= min(belief("checks.sure"), total[-1])
    ]
    _, i, j = min(enough)
    # a cause that is seen at the last time alone has no course
    of_shape: dict[str, float] = {}
    for course, weight in zip(courses, weights.tolist(), strict=True):
        of_shape[course.shape] = of_shape.get(course.shape, 0.0) + (weight if course.interval < count - 1 else 0.0)
    likeliest = max(of_shape, key=lambda shape: of_shape[shape])
    return Onset(
        edges[i],
        edges[j],
        min(1.0, float(total[j] - total[i])),
        likeliest if of_shape[likeliest] >= belief("checks.sure") else "",
        tuple((a, b, float(p)) for a, b, p in zip(edges[:-1], edges[1:], of_interval, strict=True)),
    )


def size_over_time(effect: Effect, z: Floats, covariance: Floats) -> SizeOverTime | None:
    """The parameter that changes most, to first order; None if the size of an effect is no function of time.

    `z` (k,): its coordinates. `covariance` (k, k): of these.
    """
    varying = effect.proposed.over_time
    if varying is None:
        return None
    numbers = _numbers(varying, effect.coefficients(z))
    # of a vector its length
    spans = {
        name: float(np.ptp(values) / max(np.abs(values).max(), 1e-300))
        for name, (values, _) in numbers.items()
        if not name.endswith(("_x", "_y", "_z"))
    }
    if not spans:
        return None
    name = max(spans, key=lambda parameter: spans[parameter])
    values, unit = numbers[name]
    spread, along = np.linalg.eigh(covariance)
    factor = along * np.sqrt(np.maximum(spread, 0.0))
    shifted = (_numbers(varying, effect.coefficients(z + 0.1 * column))[name][0] for column in factor.T)
    changes = [(moved - values) / 0.1 for moved in shifted]
    says = varying.base.make(varying.base.mean).parameters()[name.removesuffix("_size")].doc
    return SizeOverTime(
        name,
        label(says),
        unit,
        tuple(varying.times.tolist()),
        tuple(values.tolist()),
        tuple(np.linalg.norm(changes, axis=0).tolist()),
    )


def _numbers(varying: Varying, c: Floats) -> dict[str, tuple[Floats, str]]:
    """Parameters over time (m,) with units, by name."""
    by_time = [mechanism_numbers(varying.base.make(varying.at(c, time))) for time in varying.times.tolist()]
    names = [name for name in by_time[0] if name != "share" and all(name in numbers for numbers in by_time)]
    return {name: (np.array([numbers[name][0] for numbers in by_time]), by_time[0][name][1]) for name in names}
