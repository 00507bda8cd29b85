"""A diagnosis of a specimen in sentences, made from its typed result."""

from __future__ import annotations

import numpy as np

from warpbrain.inference.beliefs import belief
from warpbrain.inference.decide import GROUP, NAMED, NAMED_AND_REST, NOT_PHYSICS, NOTHING, UNKNOWN
from warpbrain.inference.probability import percent
from warpbrain.physics.sizes import size_in_words, smallest_in_words
from warpbrain.worlds.specimen.fit import Fit
from warpbrain.worlds.specimen.glued_ends import ELEMENTS
from warpbrain.worlds.specimen.protocol import Protocol
from warpbrain.worlds.specimen.result import Ranked, SpecimenDiagnosis

#: Of a cause no more numbers are said in a sentence.
_VALUES = 6


def sentence_of(found: SpecimenDiagnosis) -> str:
    """The verdict for people."""
    doubts = f" {' '.join(found.doubts)}" if found.doubts else ""
    p = f"p = {found.p_value:.2g}"
    if found.verdict == NOTHING:
        seen = "; ".join(f"{name} {smallest_in_words(name, one)}" for name, one in found.smallest.items())
        return (
            f"No missing physics is detected ({p}). What these tests would have shown: "
            f"{seen or 'none of those that were looked for'}."
        )
    sentences = {one.name: one.sentence for one in found.ranking}
    if found.verdict in (NAMED, NAMED_AND_REST):
        parts = [f"{one.sentence} ({_size(one)}; probability {percent(one.probability)})" for one in found.named]
        rest = " Something else is left." if found.verdict == NAMED_AND_REST else ""
        return f"{' '.join(parts)}{_held_out(found)}{rest}{doubts}"
    if found.verdict == NOT_PHYSICS:
        return f"{' '.join(sentences[name] for name in found.decision.causes)} That explains the mismatch best.{doubts}"
    if found.verdict == GROUP:
        known = {one.name: one.probability for one in found.ranking}
        names = ", ".join(f"{name} ({percent(known[name])})" for name in found.decision.causes if name != UNKNOWN)
        other = ", or what has no name" if UNKNOWN in found.decision.causes else ""
        return f"Something is missing ({p}): {names}{other}. These tests do not tell which.{doubts}"
    if found.verdict == UNKNOWN:
        return f"Something is missing ({p}) that none of the mechanisms explains.{doubts}"
    perhaps = f", perhaps {' or '.join(found.decision.causes)}" if found.decision.causes else ""
    return f"Something is missing ({p}), but these tests do not say what{perhaps}.{doubts}"


def _held_out(found: SpecimenDiagnosis) -> str:
    before, after = (found.scores[name].heldout or 0.0 for name in ("refitted", "explained"))
    return f" Tests that were held out: {before:.3g} Pa without, {after:.3g} Pa with it."


def _size(one: Ranked) -> str:
    sizes = size_in_words(one.name, one.values)[:_VALUES]
    return "; ".join([*sizes, one.region] if one.region else sizes)


def assumptions_of(fit: Fit, protocol: Protocol, by_test: bool) -> tuple[str, ...]:
    """What was taken for granted."""
    case, thinned, glued = fit.forward.case, fit.forward.protocol, fit.forward.declared.glued
    assert case.specimen is not None
    found = [*case.assumptions]
    found.append(
        f"Errors are of all {len(protocol)} recorded rows of {len(protocol.tests)} tests, as nominal stress; "
        f"probabilities are of {len(thinned)} of them."
    )
    if any(len(chain.tests) > 1 for chain in protocol.chains):
        found.append("Tests whose times go on are one history: tissue remembers the earlier ones.")
    found.append(
        f"The noise of a test is {100 * belief('specimen.reading'):g} % of its largest stress or its roughness, and "
        f"{100 * belief('specimen.shared'):g} % that a stretch of the curve has in common, times {fit.scale:.2f}, as "
        "was found."
    )
    if np.any(glued != 1.0):
        found.append(
            f"Stress is that of the homogeneous state times {glued.min():.3g} to {glued.max():.3g}, the factor of "
            f"glued ends: finite elements ({ELEMENTS}) of the law that was arrived at, elastic; memory is taken "
            "to have the same factor."
        )
    elif case.specimen.grips == "glued":
        found.append("The state is taken for homogeneous, though the ends are glued.")
    else:
        found.append("Ends slide without friction: the state is homogeneous.")
    found.append(f"Allowed to explain differences first: {', '.join(fit.forward.nuisances.names)}.")
    found.append("Held out: each test in turn." if by_test else "Held out: each quarter of the only test in turn.")
    return tuple(found)
