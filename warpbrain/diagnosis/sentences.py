"""A diagnosis in sentences, made from its numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.diagnosis.result import Confusion, Diagnosis, Fit, Ranked
from warpbrain.diagnosis.traits import Traits
from warpbrain.inference.beliefs import belief
from warpbrain.inference.decide import (
    CANNOT_SAY,
    GROUP,
    NAMED,
    NAMED_AND_REST,
    NOT_PHYSICS,
    NOTHING,
    UNKNOWN,
)
from warpbrain.inference.probability import percent
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.sizes import size_in_words, smallest_in_words
from warpbrain.physics.words import measured
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.not_physics import SENTENCES
from warpbrain.worlds.body.weighted_set import WeightedSet


def sentence_of(found: Diagnosis) -> str:
    """The verdict for people: whole sentences, in millimetres, pascals, percent and degrees."""
    doubts = f" {' '.join(found.doubts)}" if found.doubts else ""
    return f"{_SENTENCES[found.verdict](found)}{doubts}"


def _nothing(found: Diagnosis) -> str:
    seen = "; ".join(f"{kind} {smallest_in_words(kind, one)}" for kind, one in found.smallest.items())
    return (
        f"No missing physics is detected ({_chance(found)}). What these data would have shown: "
        f"{seen or 'nothing was looked for'}."
    )


def _named(found: Diagnosis) -> str:
    each = [effect_sentence(one, found.case.gravity_axis) for one in found.named]
    also = [f"Beside it: {text[0].lower()}{text[1:]}" for text in each[1:]]
    said = f"{' '.join([each[0], *also])} {_grounds(found.named, found.fit)}"
    if found.verdict == NAMED:
        return said
    return f"{said} Something else is left, which this does not explain.{traits_in_words(found.unknown)}"


def _group(found: Diagnosis) -> str:
    chances = {one.kind: one.probability for one in found.ranking}
    members = [kind for kind in found.group if kind != UNKNOWN]
    said = "; or ".join(f"{_clause(kind)} ({percent(chances.get(kind, 0.0))})" for kind in members)
    other = "; or something without a name" if UNKNOWN in found.group else ""
    return f"Something is missing ({_chance(found)}), and these data do not tell which of these it is: {said}{other}."


def _unknown(found: Diagnosis) -> str:
    return (
        f"Something is missing ({_chance(found)}) that none of the known mechanisms explains: a force without a "
        f"name fits better than all of them.{traits_in_words(found.unknown)}"
    )


def _not_physics(found: Diagnosis) -> str:
    said = SENTENCES[found.decision.causes[0]]
    return f"It is not physics that is missing ({_chance(found)}). {said} That explains the mismatch better."


def _cannot_say(found: Diagnosis) -> str:
    likely = [one for one in found.ranking if one.physics and one.probability > belief("checks.perhaps")][:2]
    perhaps = f" Perhaps: {'; or '.join(_clause(one.kind) for one in likely)}." if likely else ""
    return f"Something is missing ({_chance(found)}), but these data cannot say what.{perhaps}"


_SENTENCES: dict[str, Callable[[Diagnosis], str]] = {
    NOTHING: _nothing,
    NAMED: _named,
    NAMED_AND_REST: _named,
    GROUP: _group,
    UNKNOWN: _unknown,
    NOT_PHYSICS: _not_physics,
    CANNOT_SAY: _cannot_say,
}


def effect_sentence(ranked: Ranked, gravity_axis: tuple[float, float, float] | None = None) -> str:
    """What a mechanism is, how large it was found to be, and where."""
    sizes = "; ".join(size_in_words(ranked.kind, ranked.values, gravity_axis))
    found = [_said(ranked.kind).rstrip(".")]
    if sizes:
        found.append(f": {sizes}")
    return f"{''.join(found)}.{_where(ranked)}"


def confusion_sentences(confusion: Confusion) -> tuple[str, ...]:
    """What could be taken for what."""
    pairs = [(part, kind, other) for kind, row in confusion.rows.items() for other, part in row.items()]
    alike = [f"{kind} for {other} ({percent(part)})" for part, kind, other in sorted(pairs, reverse=True)[:4]]
    said = f"With these recordings most easily taken for another: {', '.join(alike)}." if alike else ""
    return (
        *([said] if said else []),
        "In percent of what is visible of it, at its middling place and the best place of the other.",
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
    chances = " and ".join(percent(one.probability) for one in named)
    probable = f"Its probability is {chances}" if len(named) == 1 else f"Their probabilities are {chances}"
    if fit.explained is None:
        return f"{probable}."
    after = 1e3 * fit.explained[1]
    these = "it" if len(named) == 1 else "them"
    return (
        f"{probable}; points that were held out are predicted to {after:.2f} mm with {these}, to {before:.2f} mm "
        f"without {these}."
    )


def _chance(found: Diagnosis) -> str:
    return f"p = {found.p_value:.2g}"


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
    if depth > belief("checks.surface_told"):
        said += ", and on the surface" if unknown.surface_nats > 0.0 else ", and below the surface"
    return f" {said}."


def assumptions_of(case: Case, base: Base, best: WeightedSet) -> tuple[str, ...]:
    """What was taken for granted."""
    sensors = base.at.sensors
    found = [*case.assumptions]
    found.append(
        f"{len(sensors)} numbers were recorded; their noise is {best.marginal.scale:.2f} times what was declared or "
        "found, of which neighbours have a part in common."
    )
    gross = [int(sensors.groups[base.points[k][0]]) for k in np.flatnonzero(best.marginal.gross).tolist()]
    if gross:
        beside = " and ".join(best.mechanisms)
        found.append(
            f"{len(gross)} points contradict all that surrounds them{f', with {beside},' if beside else ''} and are "
            f"taken for gross errors: {sorted(gross)}."
        )
    families = ", ".join(family.name for family in base.nuisances.families)
    found.append(f"Allowed to explain residuals first: {families}.")
    return tuple(found)
