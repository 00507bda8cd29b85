"""A diagnosis of a specimen in sentences, made from its typed result."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpbrain.inference.beliefs import belief
from warpbrain.inference.decide import GROUP, NAMED, NAMED_AND_REST, NOT_PHYSICS, NOTHING, UNKNOWN
from warpbrain.inference.probability import percent
from warpbrain.physics.sizes import size_in_words, smallest_in_words
from warpbrain.physics.words import pascals
from warpbrain.simulation.specimen import specimen_of
from warpbrain.worlds.specimen.fit import Fit
from warpbrain.worlds.specimen.glued_ends import ELEMENTS
from warpbrain.worlds.specimen.protocol import Protocol

if TYPE_CHECKING:
    from warpbrain.worlds.specimen.result import Ranked, SpecimenDiagnosis

#: Of a cause no more numbers are said in a sentence.
_VALUES = 6


def sentence_of(diagnosis: SpecimenDiagnosis) -> str:
    """The verdict for people."""
    return " ".join([_verdict(diagnosis), *diagnosis.doubts])


def _verdict(diagnosis: SpecimenDiagnosis) -> str:
    p, causes = f"p = {diagnosis.p_value:.2g}", diagnosis.decision.causes
    if diagnosis.verdict == NOTHING:
        seen = "; ".join(f"{name} {smallest_in_words(name, smallest)}" for name, smallest in diagnosis.smallest.items())
        return (
            f"No missing physics is detected ({p}). What these tests would have shown: "
            f"{seen or 'none of those that were looked for'}."
        )
    if diagnosis.verdict in (NAMED, NAMED_AND_REST):
        rest = " Something else is left, which this does not explain." if diagnosis.verdict == NAMED_AND_REST else ""
        first, *others = map(effect_sentence, diagnosis.named)
        further = [f"Beside it: {sentence[0].lower()}{sentence[1:]}" for sentence in others]
        return f"{' '.join([first, *further])} {_grounds(diagnosis)}{rest}"
    if diagnosis.verdict == NOT_PHYSICS:
        sentences = " ".join(cause.sentence for cause in diagnosis.ranking if cause.name in causes)
        return f"It is not physics that is missing ({p}). {sentences} That explains the mismatch better."
    if diagnosis.verdict == UNKNOWN:
        return (
            f"Something is missing ({p}) that none of the known mechanisms explains: a smooth change of single tests "
            "fits better than all of them."
        )
    members = [cause for cause in diagnosis.ranking if cause.name in causes and cause.name != UNKNOWN]
    which = "; or ".join(f"{_clause(cause)} ({percent(cause.probability)})" for cause in members)
    if diagnosis.verdict == GROUP:
        other = "; or something without a name" if UNKNOWN in causes else ""
        return f"Something is missing ({p}), and these tests do not tell which of these it is: {which}{other}."
    perhaps = f" Perhaps: {which}." if members else ""
    return f"Something is missing ({p}), but these tests cannot say what.{perhaps}"


def effect_sentence(cause: Ranked) -> str:
    """What a cause is, how large it was found to be, and in which way it acts."""
    size = "; ".join([*size_in_words(cause.name, cause.values)[:_VALUES], *([cause.region] if cause.region else [])])
    return f"{cause.sentence.rstrip('.')}: {size}." if size else cause.sentence


def _clause(cause: Ranked) -> str:
    return f"{cause.sentence[0].lower()}{cause.sentence[1:].rstrip('.')}"


def _grounds(diagnosis: SpecimenDiagnosis) -> str:
    before, after = (pascals(diagnosis.scores[name].heldout or 0.0) for name in ("refitted", "explained"))
    chances = " and ".join(percent(cause.probability) for cause in diagnosis.named)
    probable, it = ("Its probability is", "it") if len(diagnosis.named) == 1 else ("Their probabilities are", "them")
    return (
        f"{probable} {chances}; tests that were held out are predicted to {after} with {it}, to {before} without {it}."
    )


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
