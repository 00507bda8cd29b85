"""The paper's own search: curves of the generative model at steps of its standard deviation, one equilibrium each.

Curve `k` of a tissue lies `k` standard deviations from the mean of its group; `k` takes 17 values from -2 to 2, and for
two tissues all 289 pairs. The best is the one of the least root mean square distance from what was recorded.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.cases.drawn import require_groups
from warpbrain.cases.moments import Moments
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.forward import Forward
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.parameters import Parameters
from warpbrain.estimation.posterior import compared
from warpbrain.gp.process import Process
from warpbrain.gp.sampling import SWEEP, law_of_curve
from warpbrain.recordings.comparison import by_unit

#: Steps of each tissue.
Steps = tuple[float, ...]


@dataclass(frozen=True)
class SweepPoint:
    """One equilibrium of a sweep: `k` of each tissue, and the parameters of the laws of these curves.

    `error` is the root mean square distance at the recordings that are fitted [m] (of forces [N], if only forces were
    recorded); None if there is no equilibrium, for this `reason`.
    """

    k: Steps
    theta: Steps
    error: float | None
    reason: str = ""


@dataclass(frozen=True)
class Sweep:
    """A finished sweep; `unit` of its errors is m or N."""

    parameters: Parameters
    unit: str
    points: tuple[SweepPoint, ...]

    @property
    def best(self) -> SweepPoint:
        """Of the least error; `SolveError` if no point has an equilibrium."""
        solved = [point for point in self.points if point.error is not None]
        if not solved:
            reason = self.points[0].reason if self.points else "it has none"
            raise SolveError(f"the sweep found no equilibrium at any of {len(self.points)} points: {reason}")
        return min(solved, key=lambda point: point.error or 0.0)


def sweep(
    case: Case,
    model: Process,
    values: Sequence[float] = SWEEP,
    known: Mapping[Steps, SweepPoint] | None = None,
    device: str | None = None,
    on_point: Callable[[SweepPoint], None] | None = None,
) -> Sweep:
    """Sweep the curves of a generative model over values of `k`; the case's laws say what kind each tissue has.

    Points of an interrupted sweep that are known by their `k` are not computed again; each new one is told.
    `InputError` if there is nothing to compare with, or a tissue has no group that the model has seen a study of.
    """
    moments = Moments.recorded(case)
    observations = Observations.to_fit(case, moments)
    unit = "m" if any(observation.unit == "m" for observation in observations.recordings) else "N"
    parameters = Parameters.of(case)
    require_groups(case, [label for labels in parameters.labels for label in labels], model)
    curves = [
        {k: law_of_curve(model, group, k, law).law() for k in values}
        for group, law in zip(parameters.groups, parameters.laws_of, strict=True)
    ]
    points = dict(known or {})
    forward: Forward | None = None
    near: Floats | None = None
    # all combinations, each beside the one before it; from the stiffest, where an equilibrium is surest
    falling, order = sorted(values, reverse=True), [Steps()]
    for _ in curves:
        order = [(*head, k) for number, head in enumerate(order) for k in falling[:: -1 if number % 2 else 1]]
    for k in order:
        if k in points:
            continue
        theta = parameters.theta_of([laws[step] for laws, step in zip(curves, k, strict=True)])
        error, reason = None, ""
        try:
            parameters.require_possible(theta)
            forward = forward or Forward(case, theta, device, moments=moments)
            state = forward.solve_from(theta, (near, None))
            if not state.passed_unstable:
                near = state.u
            comparisons = compared(case, state.u, state.reactions, moments)
            errors = by_unit((each.unit, comparisons[each.name].residuals_after) for each in observations.recordings)
            error = errors[unit]
        except (InputError, SolveError) as failure:
            reason = str(failure)
        points[k] = SweepPoint(k, tuple(theta.tolist()), error, reason)
        if on_point is not None:
            on_point(points[k])
    return Sweep(parameters, unit, tuple(points[k] for k in order))
