"""What a diagnosis of a specimen found, as typed objects that the report is written from, and its sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import percent
from warpbrain.inference.causes import Kind
from warpbrain.inference.decide import UNKNOWN
from warpbrain.physics.sizes import size_in_words
from warpbrain.physics.words import Value, pascals
from warpbrain.simulation.specimen import specimen_of
from warpbrain.worlds.specimen.fit import Fit
from warpbrain.worlds.specimen.glued_ends import ELEMENTS
from warpbrain.worlds.specimen.protocol import Protocol
from warpbrain.worlds.verdict import Verdict, Words, clause, grounds, missing_in_words, verdict_in_words

#: Of a cause no more numbers are said in a sentence.
_VALUES = 6


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


@dataclass(frozen=True, kw_only=True, eq=False)
class SpecimenDiagnosis(Verdict[Ranked, Combination]):
    """A diagnosis of a specimen; what it has in common with others: `warpbrain.worlds.verdict.Verdict`.

    Attributes
    ----------
    protocol : Protocol
        All recorded rows.
    assumed : tuple of str
        Causes of the fit that is "explained".
    where : Segment or None
    scores : dict of str to Score
        ``"declared"``, ``"refitted"`` and, if something is missing, ``"explained"``.
    stresses : dict of str to (n,) array
        Of the same, at all rows [Pa]; and ``"heldout refitted"``, ``"heldout explained"``.
    improvement : (part, low, high) or None
        Of the refitted case's held-out error that is gone.
    by_test : bool
        Whether whole tests were held out.
    """

    protocol: Protocol
    assumed: tuple[str, ...]
    where: Segment | None
    scores: Mapping[str, Score]
    stresses: Mapping[str, Floats]
    improvement: tuple[float, float, float] | None
    by_test: bool

    @cached_property
    def sentence(self) -> str:
        """The verdict for people."""
        return sentence_of(self)


def sentence_of(diagnosis: SpecimenDiagnosis) -> str:
    """The verdict for people."""
    named, causes, scores = diagnosis.named, diagnosis.decision.causes, diagnosis.scores
    members = [cause for cause in diagnosis.ranking if cause.name in causes and cause.name != UNKNOWN]
    errors = [pascals(scores[name].heldout or 0.0) for name in ("explained", "refitted") if name in scores]
    words = Words(
        data="these tests",
        nothing="none of those that were looked for",
        unnamed="a smooth change of single tests",
        named=[specimen_effect_sentence(cause) for cause in named],
        grounds=grounds([cause.probability for cause in named], "tests", (errors[0], errors[-1])),
        members=[(cause.sentence, cause.probability) for cause in members],
        perhaps=[f"{clause(cause.sentence)} ({percent(cause.probability)})" for cause in members],
        missing=missing_in_words(sum(each.probability for each in diagnosis.combinations if not each.causes)),
    )
    sentence = verdict_in_words(diagnosis.decision, diagnosis.p_value, diagnosis.smallest, words)
    return " ".join([sentence, *diagnosis.doubts])


def specimen_effect_sentence(cause: Ranked) -> str:
    """What a cause is, how large it was found to be, and in which way it acts."""
    size = "; ".join([*size_in_words(cause.name, cause.values)[:_VALUES], *([cause.region] if cause.region else [])])
    return f"{cause.sentence.rstrip('.')}: {size}." if size else cause.sentence


def assumptions_of(fit: Fit, protocol: Protocol, by_test: bool) -> tuple[str, ...]:
    """What was taken for granted."""
    case, glued = fit.forward.case, fit.forward.factor
    remembering = any(len(chain.tests) > 1 for chain in protocol.chains)
    if np.any(glued != 1.0):
        ends = (
            f"Stress is that of the homogeneous state times {glued.min():.3g} to {glued.max():.3g}, the factor of "
            f"glued ends: finite elements ({ELEMENTS}) of the law that was arrived at, elastic; memory is taken "
            "to have the same factor."
        )
    elif specimen_of(case).grips == "glued":
        ends = "The state is taken for homogeneous, though the ends are glued."
    else:
        ends = "Ends slide without friction: the state is homogeneous."
    return (
        *case.assumptions,
        f"Errors are of all {len(protocol)} recorded rows of {len(protocol.tests)} tests, as nominal stress; "
        f"probabilities are of {len(protocol.thinned)} of them.",
        *(["Tests whose times go on are one history: tissue remembers the earlier ones."] if remembering else []),
        f"The noise of a test is {100 * belief('specimen.reading'):g} % of its largest stress or its roughness, and "
        f"{100 * belief('specimen.shared'):g} % that a stretch of the curve has in common, times {fit.scale:.2f}, as "
        "was found.",
        ends,
        f"Allowed to explain differences first: {', '.join(fit.forward.names)}.",
        "Held out: each test in turn." if by_test else "Held out: each quarter of the only test in turn.",
    )
