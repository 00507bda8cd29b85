"""What a diagnosis of a specimen found, as typed objects that the report is written from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.inference.causes import Kind
from warpbrain.inference.decide import Confirmation, Decision
from warpbrain.physics.words import Measurement, Smallest, Value
from warpbrain.shown import Shown
from warpbrain.worlds.specimen.protocol import Protocol


@dataclass(frozen=True)
class Ranked:
    """One cause.

    Attributes
    ----------
    name, sentence : str
    kind : Kind
    log_evidence : float
        Of the cause alone against nothing.
    probability : float
        That it acts, whatever else does.
    detectability : float or None
        `d` of the effect, fitted alone: its length in standard deviations of noise and nuisances.
    change : float or None
        Of the held-out error of all rows [Pa] with it alone; negative is better. None where it was not fitted.
    values : tuple of Value
    region : str
    """

    name: str
    sentence: str
    kind: Kind
    log_evidence: float
    probability: float
    detectability: float | None
    change: float | None
    values: tuple[Value, ...]
    region: str


@dataclass(frozen=True)
class Combination:
    """A set of causes, its log evidence against nothing and its probability; whether it was fitted."""

    causes: tuple[str, ...]
    log_evidence: float
    probability: float
    fitted: bool


@dataclass(frozen=True)
class Segment:
    """Where in the tests a cause shows most: "loading", "unloading" or "hold", from strain to strain, time to time."""

    test: str
    mode: str
    segment: str
    strain: tuple[float, float]
    time: tuple[float, float] | None


@dataclass(frozen=True)
class Score:
    """Root mean square errors over all recorded rows [Pa]: of tests that were fitted, of these held out in turn (None
    where nothing was fitted at all), and of each test with role `check`."""

    fitted: float
    heldout: float | None
    check: dict[str, float]


@dataclass(frozen=True, eq=False)
class SpecimenDiagnosis(Shown):
    """All of it.

    Attributes
    ----------
    case : Case
    protocol : Protocol
        All recorded rows.
    decision : Decision
        After the checks; `by_posterior` before them.
    doubts : tuple of str
        Checks that failed, in words.
    p_value, p_left : float
        That nothing is missing, and that nothing is left of the best set of causes; predictive.
    named, ranking : tuple of Ranked
        What is named with the values of the best set.
    rejected : dict of str to str
        Causes that were not looked for, and why.
    combinations : tuple of Combination
    assumed : tuple of str
        Causes of the fit that is "explained".
    where : Segment or None
    next_measurement : tuple of Measurement
    smallest : dict of str to Smallest
    scores : dict of str to Score
        ``"declared"``, ``"refitted"`` and, if something is missing, ``"explained"``.
    stresses : dict of str to (n,) array
        Of the same, at all rows [Pa]; and ``"heldout refitted"``, ``"heldout explained"``.
    improvement : (part, low, high) or None
        Of the refitted case's held-out error that is gone.
    confirmations : tuple of Confirmation
        Of each mechanism of that fit.
    explained : Case or None
    assumptions, remarks : tuple of str
    by_test : bool
        Whether whole tests were held out.
    seconds : dict of str to float
    """

    case: Case
    protocol: Protocol
    decision: Decision
    by_posterior: Decision
    doubts: tuple[str, ...]
    p_value: float
    p_left: float | None
    named: tuple[Ranked, ...]
    ranking: tuple[Ranked, ...]
    rejected: Mapping[str, str]
    combinations: tuple[Combination, ...]
    assumed: tuple[str, ...]
    where: Segment | None
    next_measurement: tuple[Measurement, ...]
    smallest: Mapping[str, Smallest]
    scores: Mapping[str, Score]
    stresses: Mapping[str, Floats]
    improvement: tuple[float, float, float] | None
    confirmations: tuple[Confirmation, ...]
    explained: Case | None
    assumptions: tuple[str, ...]
    remarks: tuple[str, ...]
    by_test: bool
    seconds: Mapping[str, float]

    @property
    def verdict(self) -> str:
        """One of `warpbrain.inference.decide.VERDICTS`."""
        return self.decision.verdict

    @property
    def group(self) -> tuple[str, ...]:
        """Causes that are not told apart, in place of a name; perhaps left, beside names."""
        return () if self.named else self.decision.causes

    @cached_property
    def sentence(self) -> str:
        """The verdict for people."""
        from warpbrain.worlds.specimen.sentences import sentence_of

        return sentence_of(self)
