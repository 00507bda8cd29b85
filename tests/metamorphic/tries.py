"""One try: a drawn case and a change of it that changes nothing are computed, and the results compared."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from metamorphic.changes import CHANGES, split
from metamorphic.drawn import displacement, drawn_case
from warpbrain.cases.case import Case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.estimate import estimate
from warpbrain.estimation.options import EstimationOptions
from warpbrain.worlds.options import DiagnosisOptions

#: Largest difference of displacements at `TOLERANCE`, against the largest displacement; of estimates, against the width
#: of their 95 % intervals; of probabilities.
BOUNDS = {"run": 1e-9, "estimate": 1e-4, "diagnose": 1e-3}
#: Of equilibrium. Where rounding decides whether one iteration more is taken, all that the tolerance leaves differs:
#: up to the tolerance itself, against the largest displacement.
TOLERANCE = 1e-10
#: Of a diagnosis: few kinds take few seconds.
_DIAGNOSIS = DiagnosisOptions(candidates=("gravity", "pressure", "swelling"), mesh_error=False)


@dataclass(frozen=True)
class Difference:
    """What a change changed.

    Attributes
    ----------
    seed : int
    change, kind : str
    size : float
        As `BOUNDS` has it.
    told : str
        What is different, if it is no number: the verdict or how it ended.
    margin : float
        Of a diagnosis whose verdict is another one: the gap of probability between the two likeliest sets of causes.
    bound : float
        What `size` may be, if it is not that of `BOUNDS`.
    ended : str
        How the case before the change ended: ``computed``, what was named, or the class of the error.
    """

    seed: int
    change: str
    kind: str
    size: float
    told: str = ""
    margin: float = float("nan")
    bound: float = 0.0
    ended: str = "computed"

    @property
    def wrong(self) -> bool:
        """Whether it is more than may be."""
        return bool(self.told) or not self.size <= (self.bound or BOUNDS[self.kind])


def one_try(seed: int, kind: str, change: str | None = None, tolerance: float = TOLERANCE) -> Difference:
    """Compare a drawn case with a change of it, one drawn too unless it is named; `tolerance` is of a run."""
    rng = np.random.default_rng([seed, 1])
    change = change or list(CHANGES)[rng.integers(len(CHANGES))]
    case = drawn_case(seed, cells=(3, 3) if kind == "diagnose" else (2, 3))
    if kind == "diagnose" and rng.random() < 0.5:
        # what acts is left out
        case = replace(case, mechanisms=(), boundaries=case.boundaries[:1])
    if kind != "run" and rng.random() < 0.3 and CHANGES[change] is not split:
        # of files whose noise is not declared each has its own
        case = replace(case, recordings=tuple(replace(one, sigma=None) for one in case.recordings))
    changed = CHANGES[change](case, rng)
    results = []
    for one in (case, changed.case):
        try:
            results.append(displacement(one, tolerance) if kind == "run" else _RESULTS[kind](one))
        except (InputError, SolveError) as error:
            results.append(f"{type(error).__name__}: {error}")
    before, after = results
    if isinstance(before, str) or isinstance(after, str):
        alike = isinstance(before, str) and isinstance(after, str)
        ended = before.partition(":")[0] if isinstance(before, str) else "computed"
        return Difference(seed, change, kind, 0.0, "" if alike else f"{before}; {after}"[:500], ended=ended)
    if kind == "run":
        size = float(np.abs(changed.back(after) - before).max() / np.abs(before).max())
        return Difference(seed, change, kind, size, bound=BOUNDS["run"] * tolerance / TOLERANCE)
    if kind == "estimate":
        width = before[1][:, 1] - before[1][:, 0]
        return Difference(seed, change, kind, _largest(after[1] - before[1], width[:, None]))
    return _diagnosed(seed, change, before, after)


def _largest(difference: np.ndarray, scale: np.ndarray) -> float:
    return float(np.max(np.abs(difference) / scale))


def _estimated(case: Case) -> tuple[np.ndarray, np.ndarray]:
    posterior = estimate(case, options=EstimationOptions(samples=25, discretisation=None), device="cpu")
    return posterior.theta, np.array([marginal.interval for marginal in posterior.marginals])


def diagnose(case: Case) -> Diagnosis:
    return Diagnosing(case, _DIAGNOSIS, "cpu").run()


def _diagnosed(seed: int, change: str, before: Diagnosis, after: Diagnosis) -> Difference:
    chances = [{one.kind: one.probability for one in found.ranking} for found in (before, after)]
    size = max(abs(chances[0].get(k, 0.0) - chances[1].get(k, 0.0)) for k in chances[0].keys() | chances[1].keys())
    if before.verdict == after.verdict:
        return Difference(seed, change, "diagnose", size, ended=before.verdict)
    first, second = sorted((one.probability for one in before.combinations), reverse=True)[:2]
    told = f"{before.verdict}; {after.verdict}"
    return Difference(seed, change, "diagnose", size, told, first - second, ended=before.verdict)


_RESULTS = {"estimate": _estimated, "diagnose": diagnose}
