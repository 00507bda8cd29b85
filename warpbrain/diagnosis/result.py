"""What a diagnosis found, as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.held_out import Predicted
from warpbrain.diagnosis.locating import ScoreMap
from warpbrain.diagnosis.onset import Onset
from warpbrain.diagnosis.refitting import Refit
from warpbrain.diagnosis.traits import Traits
from warpbrain.worlds.body.values import Smallest, Value

Floats = NDArray[np.float64]

#: The seven verdicts.
NOTHING, NAMED, GROUP, NAMED_AND_REST, UNKNOWN, NOT_PHYSICS, CANNOT_SAY = VERDICTS = (
    "nothing missing",
    "named",
    "group",
    "named + rest",
    "unknown",
    "not physics",
    "cannot say",
)
#: Of a virtual case: a group that holds the cause, and one that does not.
WITH_IT, WITHOUT_IT = "group with it", "group without it"

#: Among fits, and among what held-out points are predicted to be: with all that is named.
EXPLAINED = "explained"


@dataclass(frozen=True, eq=False)
class Ranked:
    """One candidate.

    Attributes
    ----------
    kind : str
    physics : bool
        Whether it is a mechanism, not something that is no physics.
    log_evidence : float
        Logarithm, against nothing missing.
    probability : float
        Among all that may be missing.
    detectability : float
        `d` of the effect that was fitted.
    heldout_rmse_change : float or None
        Of held-out points [m] against the refitted case without it; negative is better. None where it was not fitted.
    values : tuple of Value
        Its parameters.
    centre, radius : (3,) array and float, or None
        Where it acts, if somewhere [m].
    region : str
    rejected_because : str
    """

    kind: str
    physics: bool
    log_evidence: float
    probability: float
    detectability: float
    heldout_rmse_change: float | None
    values: tuple[Value, ...]
    centre: Floats | None
    radius: float | None
    region: str
    rejected_because: str = ""


@dataclass(frozen=True)
class Measurement:
    """Something that could be measured next.

    Attributes
    ----------
    what : str
    expected_nats : float
        By which it would tell the two most probable causes apart, expected log Bayes factor.
    """

    what: str
    expected_nats: float


@dataclass(frozen=True, eq=False)
class Confusion:
    """What would be said of virtual cases of the linear model.

    Attributes
    ----------
    cases : int
        Of each cause.
    rows : dict of str to dict of str to float
        By cause, the share of its cases of which each thing is said.
    sizes : tuple of float
        Detectabilities `d`.
    alarm, named : dict of str to tuple of (float or None)
        By mechanism, the share with an alarm, and named rightly, at each of these; None where a mechanism would have
        to be implausibly large.
    """

    cases: int
    rows: dict[str, dict[str, float]]
    sizes: tuple[float, ...]
    alarm: dict[str, tuple[float | None, ...]]
    named: dict[str, tuple[float | None, ...]]

    def needed(self, shares: Mapping[str, Sequence[float | None]], kind: str, part: float) -> float:
        """Detectability from which on a share, `alarm` or `named`, of a mechanism is so large; infinite if never."""
        known = [(d, share) for d, share in zip(self.sizes, shares[kind], strict=True) if share is not None]
        sizes, found = np.array([0.0, *(d for d, _ in known)]), np.array([0.0, *(share for _, share in known)])
        # a larger one is not less visible: what falls with size is the chance of few draws
        below = np.maximum.accumulate(found)
        if below[-1] < part:
            return float("inf")
        above = int(np.argmax(below >= part))
        between = (part - below[above - 1]) / (below[above] - below[above - 1])
        return float(sizes[above - 1] + between * (sizes[above] - sizes[above - 1]))


@dataclass(frozen=True)
class Fit:
    """How well hypotheses agree with the displacements that were recorded [m].

    Attributes
    ----------
    declared, refitted, explained : (rmse, held-out rmse)
        Of the case as declared, after its tissue was refitted, and with what was named; the last is None if nothing is.
    improvement : (part, low, high) or None
        Of the refitted case's held-out error that is gone, with its 95 % interval.
    placebo_p : float or None
        Probability that a pattern that means nothing does as well.
    placebo : (low, high) or None
        Held-out errors between which nine of ten such patterns are.
    ceiling : float or None
        Held-out error with any smooth force.
    check : tuple of float, or None
        RMSE at the recordings with role `check`: declared, refitted, explained; see `warpbrain.diagnosis.checking`.
    """

    declared: tuple[float, float]
    refitted: tuple[float, float]
    explained: tuple[float, float] | None
    improvement: tuple[float, float, float] | None
    placebo_p: float | None
    placebo: tuple[float, float] | None
    ceiling: float | None
    check: tuple[float, ...] | None = None


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All of it.

    Attributes
    ----------
    case : Case
    verdict : str
        One of `VERDICTS`.
    sentence : str
    p_value : float
        Of nothing missing.
    named : tuple of Ranked
        What is named, in the order in which it was found: as it is in the fit with all of it.
    group : tuple of str
        Kinds that cannot be told apart.
    ranking : tuple of Ranked
    rejected : dict of str to str
        Kinds that were not tried, and why.
    map : ScoreMap
    when : Onset or None
        When what explains the mismatch best set in; None with one time, or where nothing physical is missing.
    base : Base
    fits : dict of str to Refit
        By kind; ``"none"`` without any, ``"explained"`` with all that is named.
    held_out : dict of str to Predicted
        What each of these predicts of points that it was not fitted to.
    explained : Case or None
        The case with what was named, ready to run.
    smallest : dict of str to Smallest
    confusion : Confusion or None
    next_measurement : tuple of Measurement
    fit : Fit
    assumptions, remarks : tuple of str
    seconds : dict of str to float
    unknown : Traits or None
        Of a force that no mechanism explains: alone, or beside what is named.
    """

    case: Case
    verdict: str
    sentence: str
    p_value: float
    named: tuple[Ranked, ...]
    group: tuple[str, ...]
    ranking: tuple[Ranked, ...]
    rejected: dict[str, str]
    map: ScoreMap
    when: Onset | None
    base: Base
    fits: dict[str, Refit]
    held_out: dict[str, Predicted]
    explained: Case | None
    smallest: dict[str, Smallest]
    confusion: Confusion | None
    next_measurement: tuple[Measurement, ...]
    fit: Fit
    assumptions: tuple[str, ...]
    remarks: tuple[str, ...]
    seconds: dict[str, float] = field(default_factory=dict)
    unknown: Traits | None = None
