"""What a diagnosis found, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.locating import ScoreMap
from warpbrain.diagnosis.onset import Onset
from warpbrain.diagnosis.traits import Traits
from warpbrain.inference import Kind
from warpbrain.inference.confirm import Confirmation
from warpbrain.inference.decide import Decision
from warpbrain.inference.predict import Prediction
from warpbrain.physics.values import Smallest, Value
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.weighted_set import WeightedSet

Floats = NDArray[np.float64]

#: Of sets of causes: none, and all that is named.
REFITTED, EXPLAINED = "refitted", "explained"


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
    """What could be taken for each mechanism.

    Attributes
    ----------
    rows : dict of str to dict of str to float
        By mechanism, the part of its visible effect that the best place of each other cause imitates.
    """

    rows: dict[str, dict[str, float]]


@dataclass(frozen=True)
class Combination:
    """A set of causes.

    Attributes
    ----------
    causes : tuple of str
    kinds : tuple of Kind
        Of each.
    log_evidence, log_prior : float
    probability : float
    fitted : bool
        Whether it was fitted without linearising.
    gross_errors : int
        Points that are rather gross errors than not beside it.
    """

    causes: tuple[str, ...]
    kinds: tuple[Kind, ...]
    log_evidence: float
    log_prior: float
    probability: float
    fitted: bool
    gross_errors: int


@dataclass(frozen=True)
class Fit:
    """How well hypotheses agree with recorded displacements: root mean squares of 3-D distances [m], all points.

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
    decision : Decision
        After the checks; `by_posterior` before them.
    doubts : tuple of str
        Checks that failed, in words.
    p_value : float
        Of nothing missing.
    p_left : float or None
        Of nothing being left beside what is named; None where nothing is.
    named : tuple of Ranked
        What is named, the most probable first: as it is in the fit with all of it.
    ranking : tuple of Ranked
    rejected : dict of str to str
        Kinds that were not tried, and why.
    combinations : tuple of Combination
        Sets of causes, the most probable first.
    map : ScoreMap
    when : Onset or None
        When what explains the mismatch best set in; None with one time, or where nothing physical is missing.
    search : HypothesisSearch
        Of the sets of causes, with its base.
    weighted_sets : dict of str to WeightedSet
        ``"refitted"`` without any cause, ``"explained"`` with all that is named.
    held_out : dict of str to Prediction
        What each of these predicts of points that it was not given.
    explained : Case or None
        The case with what was named, ready to run.
    smallest : dict of str to Smallest
    confusion : Confusion
    next_measurement : tuple of Measurement
    fit : Fit
    confirmations : tuple of Confirmation
        Of each mechanism of the best set.
    assumptions, remarks : tuple of str
    seconds : dict of str to float
    unknown : Traits or None
        Of a force that no mechanism explains: alone, or beside what is named.
    """

    case: Case
    decision: Decision
    by_posterior: Decision
    doubts: tuple[str, ...]
    p_value: float
    p_left: float | None
    named: tuple[Ranked, ...]
    ranking: tuple[Ranked, ...]
    rejected: Mapping[str, str]
    combinations: tuple[Combination, ...]
    map: ScoreMap
    when: Onset | None
    search: HypothesisSearch
    weighted_sets: Mapping[str, WeightedSet]
    held_out: Mapping[str, Prediction]
    explained: Case | None
    smallest: Mapping[str, Smallest]
    confusion: Confusion
    next_measurement: tuple[Measurement, ...]
    fit: Fit
    confirmations: tuple[Confirmation, ...]
    assumptions: tuple[str, ...]
    remarks: tuple[str, ...]
    seconds: Mapping[str, float] = field(default_factory=dict)
    unknown: Traits | None = None

    @property
    def verdict(self) -> str:
        """One of `warpbrain.inference.decide.VERDICTS`."""
        return self.decision.verdict

    @property
    def group(self) -> tuple[str, ...]:
        """Causes that are not told apart; perhaps, where nothing can be said."""
        return () if self.named else self.decision.causes

    @property
    def base(self) -> Base:
        """The state that all is linear about."""
        return self.search.base

    @property
    def best(self) -> WeightedSet:
        """The set that is spoken of."""
        return self.weighted_sets.get(EXPLAINED, self.weighted_sets[REFITTED])

    @property
    def gross(self) -> NDArray[np.bool_]:
        """Rows (n,) of points that are gross errors beside that set."""
        rows = np.zeros(len(self.base.residual), dtype=bool)
        for number in np.flatnonzero(self.best.marginal.gross).tolist():
            rows[self.base.points[number]] = True
        return rows

    @cached_property
    def sentence(self) -> str:
        """The verdict for people: whole sentences, in millimetres, pascals, percent and degrees."""
        from warpbrain.diagnosis.sentences import sentence_of

        return sentence_of(self)
