"""A diagnosis of a specimen in sentences, made from its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.diagnosis.result import GROUP, NOT_PHYSICS, NOTHING, UNKNOWN, Ranked
from warpbrain.diagnosis.specimen.fitting import SpecimenFit
from warpbrain.diagnosis.specimen.forward import Forward
from warpbrain.diagnosis.specimen.noise import COMMON, INDEPENDENT
from warpbrain.diagnosis.specimen.protocol import Protocol
from warpbrain.diagnosis.specimen.result import Score
from warpbrain.diagnosis.specimen.shape import ELEMENTS
from warpbrain.diagnosis.specimen.stage import Stage
from warpbrain.diagnosis.specimen.verdict import Conclusion
from warpbrain.worlds.body.values import Smallest


def sentence_of(
    said: Conclusion,
    stages: Sequence[Stage],
    named: Sequence[Ranked],
    scores: Mapping[str, Score],
    smallest: Mapping[str, Smallest],
) -> str:
    """The verdict for people."""
    p = f"p = {stages[0].p_value:.2g}"
    if said.verdict == NOTHING:
        seen = "; ".join(f"{kind}: {one.name} {one.size:.2g} {one.unit}".rstrip() for kind, one in smallest.items())
        return (
            f"No missing physics is detected ({p}). The smallest effects that these tests would have shown: "
            f"{seen or 'none of those that were looked for'}."
        )
    sentences = {one.kind: one.sentence for stage in stages for one in _assumptions(stage)}
    if said.named:
        parts = [f"{sentences[one.kind]} ({_values(one)}; probability {one.probability:.2f})" for one in named]
        before, after = scores["refitted"].heldout, scores["explained"].heldout
        rest = f" Something is left{_among(said)}." if "rest" in said.verdict else ""
        return f"{' '.join(parts)} Tests that were held out: {before:.3g} Pa without, {after:.3g} Pa with it.{rest}"
    if said.verdict == NOT_PHYSICS:
        return f"{' '.join(sentences[kind] for kind in said.kinds)} That explains the mismatch better than any physics."
    if said.verdict == GROUP:
        chances = ", ".join(
            f"{one.kind} {one.probability:.2f}" for one in stages[-1].candidates if one.kind in said.group
        )
        return (
            f"Something is missing ({p}), and it is one of: {chances}. These tests do not tell them apart{_why(said)}."
        )
    if said.verdict == UNKNOWN:
        return f"Something is missing ({p}) that none of the mechanisms explains."
    return f"Something is missing ({p}), but these tests do not say what{_among(said)}{_why(said)}."


def _assumptions(stage: Stage):  # type: ignore[no-untyped-def]
    return [one.assumption for one in stage.candidates if one.assumption is not None]


def _values(one: Ranked) -> str:
    return ", ".join(f"{v.name} {v.value:.3g} ± {v.sd:.2g} {v.unit}".rstrip() for v in one.values[:6])


def _among(said: Conclusion) -> str:
    return f", perhaps {' or '.join(said.group)}" if said.group else ""


def _why(said: Conclusion) -> str:
    return f" ({said.why})" if said.why else ""


def assumptions_of(
    case: Case, protocol: Protocol, forward: Forward, fit: SpecimenFit, by_test: bool
) -> tuple[str, ...]:
    """What was taken for granted."""
    assert case.specimen is not None
    found = [*case.assumptions]
    chains = sum(len(chain.tests) > 1 for chain in protocol.chains)
    found.append(f"{len(protocol)} rows of {len(protocol.tests)} tests were compared, as nominal stress.")
    if chains:
        found.append("Tests whose times go on are one history: tissue remembers the earlier ones.")
    found.append(
        f"The noise of a test is {100 * INDEPENDENT:g} % of its largest stress or its roughness, and "
        f"{100 * COMMON:g} % that a stretch of the curve has in common, times {fit.kappa:.2f}, which was found."
    )
    if case.specimen.grips == "glued" and np.any(forward.unit.glued != 1.0):
        low, high = float(forward.unit.glued.min()), float(forward.unit.glued.max())
        found.append(
            f"Stress is that of the homogeneous state times {low:.3g} to {high:.3g}, the factor of glued ends: finite "
            f"elements ({ELEMENTS}) of the law that was arrived at, elastic; memory is taken to have the same factor."
        )
    elif case.specimen.grips == "glued":
        found.append("The state is taken for homogeneous, though the ends are glued.")
    else:
        found.append("Ends slide without friction: the state is homogeneous.")
    found.append(f"Allowed to explain differences first: {', '.join(forward.nuisances(fit.hypothesis).names)}.")
    found.append("Held out: each test in turn." if by_test else "Held out: each quarter of the only test in turn.")
    return tuple(found)
