"""A diagnosis in sentences, made from its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from warpbrain.cases.case import Case
from warpbrain.diagnosis.alternatives import SENTENCES
from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.result import (
    CANNOT_SAY,
    GROUP,
    NAMED,
    NAMED_AND_REST,
    NOT_PHYSICS,
    NOTHING,
    UNKNOWN,
    Fit,
    Ranked,
    Smallest,
)
from warpbrain.diagnosis.verdict import Verdict
from warpbrain.physics.mechanisms import mechanisms


def sentence_of(
    verdict: Verdict, ranking: Sequence[Ranked], p_value: float, smallest: Mapping[str, Smallest], fit: Fit
) -> str:
    """The verdict for people."""
    best = ranking[0]
    if verdict.verdict == NOTHING:
        seen = "; ".join(f"{kind} {_size(one)}" for kind, one in smallest.items() if one.unit != "of being there")
        return (
            f"No missing physics is detected (p = {p_value:.2g}). The smallest effects that these data would have "
            f"shown are {seen or 'none of those that were looked for'}."
        )
    if verdict.verdict in (NAMED, NAMED_AND_REST):
        said = mechanisms()[best.kind].sentence
        rest = " Something else is left, which these words do not explain." if verdict.verdict == NAMED_AND_REST else ""
        return (
            f"{said} {_values(best)}{_where(best)} Probability {best.probability:.2f}; points that were held out: "
            f"{1e3 * fit.refitted[1]:.2f} mm without it, "
            f"{1e3 * (fit.explained[1] if fit.explained else fit.refitted[1]):.2f} mm with it.{rest}"
        )
    if verdict.verdict == GROUP:
        chances = ", ".join(f"{r.kind} {r.probability:.2f}" for r in ranking if r.kind in verdict.kinds)
        return (
            f"Something is missing (p = {p_value:.2g}), and it is one of: {chances}. These data do not tell them apart."
        )
    if verdict.verdict == UNKNOWN:
        return (
            f"Something is missing (p = {p_value:.2g}) that none of the mechanisms explains: a force without a name "
            "fits better than all of them."
        )
    if verdict.verdict == NOT_PHYSICS:
        return f"{SENTENCES[verdict.kinds[0]]} That explains the mismatch better than any physics does."
    assert verdict.verdict == CANNOT_SAY
    why = f" ({verdict.why})" if verdict.why else ""
    return f"Something is missing (p = {p_value:.2g}), but these data do not say what{why}."


def _size(smallest: Smallest) -> str:
    return f"{smallest.size:.2g} {smallest.unit}".rstrip()


def _values(ranked: Ranked) -> str:
    if not ranked.values:
        return ""
    shown = [value for value in ranked.values if not value.name.startswith(("direction", "imaged"))][:4]
    return ", ".join(f"{v.name} {v.value:.3g} ± {v.sd:.2g} {v.unit}".rstrip() for v in shown) + "."


def _where(ranked: Ranked) -> str:
    if ranked.centre is None:
        return f" In: {ranked.region}." if ranked.region else ""
    x, y, z = 1e3 * ranked.centre
    return f" About ({x:.0f}, {y:.0f}, {z:.0f}) mm, within {1e3 * (ranked.radius or 0.0):.0f} mm."


def assumptions_of(case: Case, base: Base, kappa: float) -> tuple[str, ...]:
    """What was taken for granted."""
    sensors = base.at.sensors
    aside = sorted({int(group) for group in sensors.groups[base.aside]})
    found = [*case.assumptions]
    found.append(
        f"{len(sensors)} numbers were recorded; their noise is {kappa:.2f} times what was declared or found, of which "
        "neighbours have a part in common."
    )
    if aside:
        found.append(f"{len(aside)} points contradict all that surrounds them and were set aside: {aside}.")
    families = ", ".join(family.name for family in base.nuisances.families)
    found.append(f"Allowed to explain residuals first: {families}.")
    return tuple(found)
