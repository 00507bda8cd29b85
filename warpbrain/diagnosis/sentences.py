"""A diagnosis in sentences, made from its numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from warpbrain.cases.case import Case
from warpbrain.diagnosis.base import Base
from warpbrain.diagnosis.result import (
    CANNOT_SAY,
    GROUP,
    NAMED,
    NAMED_AND_REST,
    NOT_PHYSICS,
    NOTHING,
    UNKNOWN,
    Confusion,
    Fit,
    Ranked,
)
from warpbrain.diagnosis.traits import Traits
from warpbrain.diagnosis.verdict import Conclusion, Verdict
from warpbrain.diagnosis.words import measured, size_in_words, smallest_in_words
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.worlds.body.not_physics import SENTENCES
from warpbrain.worlds.body.values import Smallest

#: A share of virtual cases below the first is hardly ever, below the second as good as none.
_SELDOM, _RARELY = 0.05, 0.01
#: Log Bayes factor from which surface and depth are told apart.
_TELLING = 3.0


def sentence_of(
    verdict: Conclusion,
    named: Sequence[Ranked],
    ranking: Sequence[Ranked],
    p_value: float,
    smallest: Mapping[str, Smallest],
    fit: Fit,
    gravity_axis: tuple[float, float, float] | None = None,
    unknown: Traits | None = None,
) -> str:
    """The verdict for people: whole sentences, in millimetres, pascals, percent and degrees."""
    if verdict.verdict == NOTHING:
        seen = "; ".join(f"{kind} {smallest_in_words(kind, one)}" for kind, one in smallest.items())
        return (
            f"No missing physics is detected ({_chance(p_value)}). What these data would have shown: "
            f"{seen or 'nothing was looked for'}."
        )
    if verdict.verdict in (NAMED, NAMED_AND_REST):
        each = [effect_sentence(one, gravity_axis) for one in named]
        also = [f"Beside it: {text[0].lower()}{text[1:]}" for text in each[1:]]
        rest = f" {_rest(verdict.rest)}{traits_in_words(unknown)}" if verdict.verdict == NAMED_AND_REST else ""
        return f"{' '.join([each[0], *also])} {_grounds(named, fit)}{rest}"
    if verdict.verdict == GROUP:
        members = [ranked for ranked in ranking if ranked.kind in verdict.kinds]
        said = "; or ".join(f"{_clause(one.kind)} ({_percent(one.probability)})" for one in members)
        return f"Something is missing ({_chance(p_value)}), and these data do not tell which of these it is: {said}."
    if verdict.verdict == UNKNOWN and verdict.kinds:
        nearest = next(_clause(one.kind) for one in ranking if one.kind in verdict.kinds)
        return (
            f"Something is missing ({_chance(p_value)}) that none of the known mechanisms explains alone: a force "
            f"without a name acts, in the place of what comes nearest or beside it. Nearest: {nearest}."
            f"{traits_in_words(unknown)}"
        )
    if verdict.verdict == UNKNOWN:
        return (
            f"Something is missing ({_chance(p_value)}) that none of the known mechanisms explains: a force without a "
            f"name fits better than all of them.{traits_in_words(unknown)}"
        )
    if verdict.verdict == NOT_PHYSICS:
        said = SENTENCES[verdict.kinds[0]]
        return f"It is not physics that is missing ({_chance(p_value)}). {said} That explains the mismatch better."
    assert verdict.verdict == CANNOT_SAY
    why = f": {verdict.why}" if verdict.why else ""
    perhaps = [_clause(one.kind) for one in ranking if one.kind in verdict.kinds and one.physics][:2]
    guess = f" Perhaps: {'; or '.join(perhaps)}." if perhaps else ""
    return f"Something is missing ({_chance(p_value)}), but these data cannot say what{why}.{guess}"


def effect_sentence(ranked: Ranked, gravity_axis: tuple[float, float, float] | None = None) -> str:
    """What a mechanism is, how large it was found to be, and where."""
    sizes = "; ".join(size_in_words(ranked.kind, ranked.values, gravity_axis))
    found = [_said(ranked.kind).rstrip(".")]
    if sizes:
        found.append(f": {sizes}")
    return f"{''.join(found)}.{_where(ranked)}"


def confusion_sentences(confusion: Confusion) -> tuple[str, str]:
    """What virtual cases say: how often each mechanism would be named, and what it would be taken for."""
    rows = confusion.rows
    named = sorted(((rows[kind].get(kind, 0.0), kind) for kind in confusion.named), key=lambda one: (-one[0], one[1]))
    often = [f"{kind} {_percent(share)}" for share, kind in named if share >= _SELDOM]
    seldom = [kind for share, kind in named if share < _SELDOM]
    said = f"With these recordings, of usual size would be named: {', '.join(often) or 'nothing'}"
    if seldom:
        said += f"; hardly ever: {', '.join(seldom)}"
    wrong = [(share, cause, kind) for cause, row in rows.items() for kind, share in row.items() if kind != cause]
    share, cause, kind = max((one for one in wrong if one[2] in confusion.named), default=(0.0, "", ""))
    most = "none is called by a wrong name"
    if share >= _RARELY:
        most = f"at most {_percent(share)} are called by a wrong name ({cause}: {kind})"
    return (
        f"{said}.",
        f"Of {confusion.cases} virtual cases of each, {most}; the linear model's own word, and optimistic.",
    )


def _said(kind: str) -> str:
    known = mechanisms()
    if kind in known:
        return known[kind].sentence
    return SENTENCES.get(kind, "Something acts that is none of the known mechanisms.")


def _clause(kind: str) -> str:
    """The sentence within another one."""
    said = _said(kind)
    return f"{said[0].lower()}{said[1:].rstrip('.')}"


def _where(ranked: Ranked) -> str:
    if ranked.centre is None:
        return f" Where: {ranked.region}." if ranked.region else ""
    x, y, z = 1e3 * ranked.centre
    within = f", within {1e3 * ranked.radius:.0f} mm" if ranked.radius else ""
    return f" It lies about ({x:z.0f}, {y:z.0f}, {z:z.0f}) mm{within}."


def _grounds(named: Sequence[Ranked], fit: Fit) -> str:
    before = 1e3 * fit.refitted[1]
    chances = " and ".join(_percent(one.probability) for one in named)
    probable = f"Its probability is {chances}" if len(named) == 1 else f"Their probabilities are {chances}"
    if fit.explained is None:
        return f"{probable}."
    after = 1e3 * fit.explained[1]
    these = "it" if len(named) == 1 else "them"
    return (
        f"{probable}; points that were held out are predicted to {after:.2f} mm with {these}, to {before:.2f} mm "
        f"without {these}."
    )


def _rest(rest: Verdict | None) -> str:
    """What is said of what names leave."""
    if rest is not None and rest.verdict == GROUP:
        either = "; or ".join(_clause(kind) for kind in rest.kinds)
        return f"Something else is left, and these data do not tell which of these it is: {either}."
    if rest is not None and rest.verdict == NOT_PHYSICS:
        return f"Something else is left, which is no physics: {SENTENCES[rest.kinds[0]]}"
    if rest is not None and rest.verdict == UNKNOWN:
        return "Something else is left, which no known mechanism explains."
    return "Something else is left, which this does not explain."


def _chance(p_value: float) -> str:
    return f"p = {p_value:.2g}"


def _percent(probability: float) -> str:
    if probability > 0.995:
        return "above 99 %"
    return "below 1 %" if probability < 0.005 else f"{100.0 * probability:.0f} %"


def traits_in_words(unknown: Traits | None) -> str:
    """What is known of a force without a name, to follow a sentence; empty if nothing is."""
    if unknown is None:
        return ""
    x, y, z = 1e3 * unknown.centre
    size, sd = unknown.size
    where = f"about ({x:z.0f}, {y:z.0f}, {z:z.0f}) mm"
    if unknown.outside:
        said = f"It is a force from outside, {where}, of {measured(size, sd, 'N')} in all"
    else:
        said = f"It is strongest {where}, and no net force of it is seen ({measured(size, sd, 'N')}): it may act within"
    depth = abs(unknown.surface_nats)
    if depth > _TELLING:
        said += ", and on the surface" if unknown.surface_nats > 0.0 else ", and below the surface"
    return f" {said}."


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
