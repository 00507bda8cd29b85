"""The result of a diagnosis as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.cases.case import Case
from warpbrain.diagnosis.locating import ScoreMap, Traits
from warpbrain.diagnosis.onset import Onset
from warpbrain.inference import Kind
from warpbrain.inference.decide import Confirmation, Decision
from warpbrain.inference.predict import Prediction
from warpbrain.physics.words import Measurement, Smallest, Value
from warpbrain.shown import Shown
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.weighted_set import WeightedSet

#: Sets of causes: without any, and with all that is named.
REFITTED, EXPLAINED = "refitted", "explained"


@dataclass(frozen=True, eq=False)
class Ranked:
    """A cause with its probability, size and place.

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
        Length of its fitted effect in standard deviations of noise and nuisances.
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


@dataclass(frozen=True, eq=False)
class Confusion:
    """Confusion of mechanisms with other causes.

    Attributes
    ----------
    rows : dict of str to dict of str to float
        By mechanism, the part of its detectable effect that the best place of each other cause explains.
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
        Points that are more probably gross errors than not under it.
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
        Part of the refitted case's held-out error that is removed, and its 95 % interval.
    placebo_p : float or None
        p-value of the held-out error among random patterns.
    placebo : (low, high) or None
        Quantiles of 5 and 95 % of the held-out errors with these.
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
class Diagnosis(Shown):
    """A diagnosis of a body.

    Attributes
    ----------
    case : Case
    decision : Decision
        After the checks; `by_posterior` before them.
    doubts : tuple of str
        Checks that failed, in words.
    p_value : float
        Of the hypothesis that nothing is missing.
    p_left : float or None
        Of the hypothesis that nothing else is missing; None if nothing is named.
    named : tuple of Ranked
        What is named, the most probable first, as it is in the joint fit.
    ranking : tuple of Ranked
    rejected : dict of str to str
        Kinds that were not tried, and why.
    combinations : tuple of Combination
        Sets of causes, the most probable first.
    map : ScoreMap
    when : Onset or None
        When the best explanation set in; None with one recorded time, or if nothing physical is missing.
    search : HypothesisSearch
        Of the sets of causes, with its base.
    weighted_sets : dict of str to WeightedSet
        ``"refitted"`` without any cause, ``"explained"`` with all that is named.
    held_out : dict of str to Prediction
        Their predictions of held-out points.
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
        Of a force that no mechanism explains: alone, or in addition to what is named.
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
        """Causes that the data do not discriminate; possible ones if nothing can be said."""
        return () if self.named else self.decision.causes

    @property
    def base(self) -> Base:
        """The base, about which all is linear."""
        return self.search.base

    @property
    def best(self) -> WeightedSet:
        """The set that the verdict is about."""
        return self.weighted_sets.get(EXPLAINED, self.weighted_sets[REFITTED])

    @property
    def gross(self) -> Bools:
        """Rows (n,) of points that are gross errors under that set."""
        rows = np.zeros(len(self.base.residual), dtype=bool)
        for number in np.flatnonzero(self.best.marginal.gross).tolist():
            rows[self.base.points[number]] = True
        return rows

    @cached_property
    def sentence(self) -> str:
        """The verdict for people: whole sentences, in millimetres, pascals, percent and degrees."""
        from warpbrain.diagnosis.sentences import sentence_of

        return sentence_of(self)
