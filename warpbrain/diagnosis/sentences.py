"""A diagnosis in sentences, made from its numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warpbrain.cases.case import Case
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
from warpbrain.physics.words import length, measured, number, place
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.not_physics import SENTENCES
from warpbrain.worlds.body.weighted_set import WeightedSet

if TYPE_CHECKING:
    from warpbrain.diagnosis.result import Confusion, Diagnosis, Fit, Ranked


def sentence_of(diagnosis: Diagnosis) -> str:
    """The verdict for people: whole sentences, in millimetres, pascals, percent and degrees."""
    doubts = f" {' '.join(diagnosis.doubts)}" if diagnosis.doubts else ""
    return f"{_SENTENCES[diagnosis.verdict](diagnosis)}{doubts}"


def _nothing(diagnosis: Diagnosis) -> str:
    detectable = "; ".join(
        f"{kind} {smallest_in_words(kind, smallest)}" for kind, smallest in diagnosis.smallest.items()
    )
    return (
        f"No missing physics is detected ({_chance(diagnosis)}). What these data would have shown: "
        f"{detectable or 'nothing was looked for'}."
    )


def _named(diagnosis: Diagnosis) -> str:
    sentences = [effect_sentence(ranked, diagnosis.case.gravity_axis) for ranked in diagnosis.named]
    further = [f"Beside it: {sentence[0].lower()}{sentence[1:]}" for sentence in sentences[1:]]
    text = f"{' '.join([sentences[0], *further])} {_grounds(diagnosis.named, diagnosis.fit)}"
    if diagnosis.verdict == NAMED:
        return text
    return f"{text} Something else is left, which this does not explain.{_traits(diagnosis)}"


def _group(diagnosis: Diagnosis) -> str:
    chances = {ranked.kind: ranked.probability for ranked in diagnosis.ranking}
    members = [kind for kind in diagnosis.group if kind != UNKNOWN]
    which = "; or ".join(f"{_clause(kind)} ({percent(chances.get(kind, 0.0))})" for kind in members)
    other = "; or something without a name" if UNKNOWN in diagnosis.group else ""
    missing = f"Something is missing ({_chance(diagnosis)})"
    return f"{missing}, and these data do not tell which of these it is: {which}{other}."


def _unknown(diagnosis: Diagnosis) -> str:
    return (
        f"Something is missing ({_chance(diagnosis)}) that none of the known mechanisms explains: a force without a "
        f"name fits better than all of them.{_traits(diagnosis)}"
    )


def _not_physics(diagnosis: Diagnosis) -> str:
    sentence = SENTENCES[diagnosis.decision.causes[0]]
    return f"It is not physics that is missing ({_chance(diagnosis)}). {sentence} That explains the mismatch better."


def _cannot_say(diagnosis: Diagnosis) -> str:
    likely = [
        ranked
        for ranked in diagnosis.ranking
        if ranked.kind != UNKNOWN and ranked.probability > belief("checks.perhaps")
    ][:2]
    perhaps = f" Perhaps: {'; or '.join(_clause(ranked.kind) for ranked in likely)}." if likely else ""
    missing = "Something is missing" if all(ranked.physics for ranked in likely) else "Something is wrong or missing"
    return f"{missing} ({_chance(diagnosis)}), but these data cannot say what.{perhaps}"


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
    parts = [sentence_of_kind(ranked.kind).rstrip(".")]
    if sizes:
        parts.append(f": {sizes}")
    return f"{''.join(parts)}.{_where(ranked)}"


def confusion_sentences(confusion: Confusion) -> tuple[str, ...]:
    """Which mechanisms these recordings confuse most easily."""
    pairs = [(part, kind, other) for kind, row in confusion.rows.items() for other, part in row.items()]
    pairs_in_words = [f"{kind} for {other} ({percent(part)})" for part, kind, other in sorted(pairs, reverse=True)[:4]]
    sentence = (
        f"With these recordings most easily taken for another: {', '.join(pairs_in_words)}." if pairs_in_words else ""
    )
    return (
        *([sentence] if sentence else []),
        "In percent of what is visible of it, at its middling place and the best place of the other.",
    )


def sentence_of_kind(kind: str) -> str:
    """What a kind of cause is, in words."""
    registry = mechanisms()
    if kind in registry:
        return registry[kind].sentence
    return SENTENCES.get(kind, "Something acts that is none of the known mechanisms.")


def _clause(kind: str) -> str:
    """The sentence of a kind as a clause."""
    sentence = sentence_of_kind(kind)
    return f"{sentence[0].lower()}{sentence[1:].rstrip('.')}"


def _where(ranked: Ranked) -> str:
    if ranked.centre is None:
        return f" Where: {ranked.region}." if ranked.region else ""
    # to whole millimetres where its size is not known
    radius = f", within {number(1e3 * ranked.radius, 1)} mm" if ranked.radius else ""
    surface = f", on the {ranked.region}" if ranked.region else ""
    return f" It lies about {place(ranked.centre, 10.0 * (ranked.radius or 1.0))}{radius}{surface}."


def _grounds(named: Sequence[Ranked], fit: Fit) -> str:
    before = length(fit.refitted[1])
    chances = " and ".join(percent(ranked.probability) for ranked in named)
    probable = f"Its probability is {chances}" if len(named) == 1 else f"Their probabilities are {chances}"
    if fit.explained is None:
        return f"{probable}."
    after = length(fit.explained[1])
    these = "it" if len(named) == 1 else "them"
    return f"{probable}; points that were held out are predicted to {after} with {these}, to {before} without {these}."


def _chance(diagnosis: Diagnosis) -> str:
    return f"p = {diagnosis.p_value:.2g}"


def _traits(diagnosis: Diagnosis) -> str:
    """What is known of an unknown force, to follow a sentence; empty if nothing is."""
    if diagnosis.unknown is None:
        return ""
    return traits_in_words(diagnosis.unknown, float(np.ptp(diagnosis.case.mesh.points, axis=0).max()))


def traits_in_words(unknown: Traits, extent: float) -> str:
    """What is known of an unknown force in a body of an extent [m], to follow a sentence."""
    size, sd = unknown.size
    where = f"about {place(unknown.centre, extent)}"
    if unknown.outside:
        sentence = f"It is a force from outside, {where}, of {measured(size, sd, 'N')} in all"
    elif unknown.hidden:
        sentence = (
            f"It is strongest {where}, so near to what is held that the reactions there may carry it: whether it has a "
            "net force cannot be told"
        )
    else:
        sentence = (
            f"It is strongest {where}, and no net force of it is seen ({measured(size, sd, 'N')}): it may act within"
        )
    depth = abs(unknown.surface_nats)
    if depth > belief("checks.surface_told"):
        sentence += ", and on the surface" if unknown.surface_nats > 0.0 else ", and below the surface"
    return f" {sentence}."


def assumptions_of(case: Case, base: Base, best: WeightedSet) -> tuple[str, ...]:
    """The assumptions of a diagnosis."""
    sensors = base.at.sensors
    assumptions = [*case.assumptions]
    assumptions.append(
        f"{len(sensors)} numbers were recorded; their noise is {best.marginal.scale:.2f} times what was declared or "
        "found, of which neighbours have a part in common."
    )
    gross = [int(sensors.groups[base.points[k][0]]) for k in np.flatnonzero(best.marginal.gross).tolist()]
    if gross:
        acting = " and ".join(best.mechanisms)
        assumptions.append(
            f"{len(gross)} points contradict all that surrounds them{f', with {acting},' if acting else ''} and are "
            f"taken for gross errors: {sorted(gross)}."
        )
    assumptions.append(f"Allowed to explain residuals first: {', '.join(base.nuisances.families)}.")
    return tuple(assumptions)
