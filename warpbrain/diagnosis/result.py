"""The result of a diagnosis as plain data, and its sentences, made from the numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools
from warpbrain.cases.case import Case
from warpbrain.diagnosis.locating import FittedSource, ScoreMap, Traits
from warpbrain.diagnosis.onset import Onset
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import percent
from warpbrain.inference.decide import UNKNOWN
from warpbrain.inference.predict import Prediction
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.sizes import size_in_words
from warpbrain.physics.words import length, measured, number, place
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import SENTENCES
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.weighted_set import WeightedSet
from warpbrain.worlds.verdict import Ranked, Verdict, Words, clause, grounds, verdict_in_words

#: Sets of causes: without any, and with all that is named.
REFITTED, EXPLAINED = "refitted", "explained"


@dataclass(frozen=True, eq=False)
class Confusion:
    """Confusion of mechanisms with other causes."""

    #: By mechanism, the part of its detectable effect that the best place of each other cause explains.
    rows: dict[str, dict[str, float]]

    @property
    def largest(self) -> list[tuple[float, str, str]]:
        """The four largest of these parts, each with the mechanism and what imitates it."""
        parts = [(part, kind, other) for kind, row in self.rows.items() for other, part in row.items()]
        return sorted(parts, reverse=True)[:4]


@dataclass(frozen=True)
class Fit:
    """How well hypotheses agree with recorded displacements: root mean squares of 3-D distances [m], all points."""

    #: Of the case as declared, after its tissue was refitted, and with what was named; the last is None if nothing is.
    declared: tuple[float, float]
    refitted: tuple[float, float]
    explained: tuple[float, float] | None
    #: Part of the refitted case's held-out error that is removed, and its 95 % interval.
    improvement: tuple[float, float, float] | None
    placebo_p: float | None  # p-value of the held-out error among random patterns
    placebo: tuple[float, float] | None  # quantiles of 5 and 95 % of the held-out errors with these
    ceiling: float | None  # held-out error with any smooth force
    #: RMSE at the recordings with role `check`: declared, refitted, explained; see `warpbrain.diagnosis.checking`.
    check: tuple[float, ...] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Diagnosis(Verdict):
    """A diagnosis of a body; what it has in common with others: `warpbrain.worlds.verdict.Verdict`.

    Attributes
    ----------
    map : ScoreMap
    when : Onset or None
        When the best explanation set in; None with one recorded time, or if nothing physical is missing.
    search : HypothesisSearch
        Of the sets of causes, with its base.
    weighted_sets : dict of str to WeightedSet
        ``"refitted"`` without physics that is missing, ``"explained"`` with all that is named.
    held_out : dict of str to Prediction
        Their predictions of held-out points.
    confusion : Confusion
    fit : Fit
    unknown : Traits or None
        Of a force that no mechanism explains: alone, or in addition to what is named.
    """

    map: ScoreMap
    when: Onset | None
    search: HypothesisSearch
    weighted_sets: Mapping[str, WeightedSet]
    held_out: Mapping[str, Prediction]
    confusion: Confusion
    fit: Fit
    unknown: Traits | None = None

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
        for point in np.flatnonzero(self.best.marginal.gross).tolist():
            rows[self.base.points[point]] = True
        return rows

    @cached_property
    def sentence(self) -> str:
        """The verdict for people: whole sentences, in millimetres, pascals, percent and degrees."""
        return sentence_of(self)


def sentence_of(diagnosis: Diagnosis) -> str:
    """The verdict for people: whole sentences, in millimetres, pascals, percent and degrees."""
    fit, ranking, named = diagnosis.fit, diagnosis.ranking, diagnosis.named
    chances = {ranked.kind: ranked.probability for ranked in ranking}
    least = belief("checks.perhaps")
    likely = [ranked for ranked in ranking if ranked.kind != UNKNOWN and ranked.probability > least][:2]
    errors = None if fit.explained is None else (length(fit.explained[1]), length(fit.refitted[1]))
    extent = 0.0 if diagnosis.unknown is None else float(np.ptp(diagnosis.case.mesh.points, axis=0).max())
    resists = diagnosis.unknown is not None and diagnosis.unknown.resistance
    words = Words(
        data="these data",
        nothing="nothing was looked for",
        unnamed="tissue whose resistance changes in time" if resists else "a force without a name",
        named=[effect_sentence(ranked, diagnosis.case.gravity_axis) for ranked in named],
        grounds=grounds([ranked.probability for ranked in named], "points", errors),
        members=[(_member(diagnosis, kind), chances.get(kind, 0.0)) for kind in diagnosis.group if kind != UNKNOWN],
        perhaps=[clause(sentence_of_kind(ranked.kind)) for ranked in likely],
        only_physics=all(ranked.physics for ranked in likely),
        rest="" if diagnosis.unknown is None else traits_in_words(diagnosis.unknown, extent),
    )
    return verdict_in_words(diagnosis, words)


def effect_sentence(ranked: Ranked, gravity_axis: tuple[float, float, float] | None = None) -> str:
    """What a mechanism is, how large it was found to be, and where."""
    return f"{_sized(ranked, gravity_axis)}{_where(ranked)}"


def _sized(ranked: Ranked, gravity_axis: tuple[float, float, float] | None) -> str:
    """What a mechanism is, and how large it was found to be."""
    sizes = "; ".join(size_in_words(ranked.kind, ranked.values, gravity_axis))
    return f"{sentence_of_kind(ranked.kind).rstrip('.')}{f': {sizes}' if sizes else ''}."


def _member(diagnosis: Diagnosis, kind: str) -> str:
    """What a member of a group is and, if it was fitted, how large."""
    ranked = next((ranked for ranked in diagnosis.ranking if ranked.kind == kind), None)
    if ranked is None or ranked.rejected_because:
        return sentence_of_kind(kind)
    return _sized(ranked, diagnosis.case.gravity_axis)


def confusion_sentences(confusion: Confusion) -> tuple[str, ...]:
    """Which mechanisms these recordings confuse most easily."""
    most = [f"{kind} for {other} ({percent(part)})" for part, kind, other in confusion.largest]
    return (
        *([f"With these recordings most easily taken for another: {', '.join(most)}."] if most else []),
        "In percent of what is visible of it, at its middling place and the best place of the other.",
    )


def sentence_of_kind(kind: str) -> str:
    """What a kind of cause is, in words."""
    registry = mechanisms()
    if kind in registry:
        return registry[kind].sentence
    return SENTENCES.get(kind, "Something acts that is none of the known mechanisms.")


def _where(ranked: Ranked) -> str:
    if ranked.centre is None:
        return f" Where: {ranked.region}." if ranked.region else ""
    # to whole millimetres where its size is not known
    radius = f", within {number(1e3 * ranked.radius, 1)} mm" if ranked.radius else ""
    surface = f", on the {ranked.region}" if ranked.region else ""
    return f" It lies about {place(ranked.centre, 10.0 * (ranked.radius or 1.0))}{radius}{surface}."


def traits_in_words(unknown: Traits, extent: float) -> str:
    """What is known of an unknown force in a body of an extent [m], to follow a sentence."""
    if unknown.resistance:
        return (
            " The same loads move tissue further at one time than at another, as they do where stress relaxes or "
            "tissue is damaged or heals: no force need act."
        )
    size, sd = unknown.size
    where = f"about {place(unknown.centre, extent)}"
    fitted = "" if unknown.source is None else f" {_source_in_words(unknown.source, extent)}"
    told = abs(unknown.surface_nats) > belief("checks.surface_told")
    depth = ("on the surface" if unknown.surface_nats > 0.0 else "below the surface") if told else ""
    if fitted and not unknown.outside:
        return f"{fitted} It acts {depth}." if depth else fitted
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
    return f" {sentence}{', and ' if depth else ''}{depth}.{fitted}"


def _source_in_words(source: FittedSource, extent: float) -> str:
    """What a source that was fitted is, and how well it predicts."""
    size = float(np.linalg.norm(source.force))
    sd = float(np.linalg.norm(source.force / max(size, 1e-300) * source.force_sd))
    kind = "a stress" if source.is_stress else "a force that runs around an axis" if source.turns else "a force"
    net = "" if source.is_stress or source.turns else f" of {measured(size, sd, 'N')}"
    near = f"about {place(source.centre, extent)}, within {number(1e3 * source.length)} mm"
    where = "throughout the body" if source.length > extent else near
    return (
        f"Fitted as {kind}{net} {where}, it leaves {length(source.error)} at points that were not fitted, "
        f"{length(source.without)} without it."
    )


def assumptions_of(case: Case, base: Base, best: WeightedSet) -> tuple[str, ...]:
    """The assumptions of a diagnosis."""
    sensors = base.at.sensors
    assumptions = [*case.assumptions]
    assumptions.append(
        f"{len(sensors)} numbers were recorded; their noise is {best.marginal.scale:.2f} times what was declared or "
        "found, of which neighbours have a part in common."
    )
    parameters, state = base.states.parameters, base.state if best.refit is None else best.refit.state
    laws = zip(parameters.tissues, parameters.laws(state.hypothesis.theta), strict=True)
    moduli = " and ".join(f"{law.shear_modulus:.4g} Pa of {tissue}" for tissue, law in laws)
    assumptions.append(f"Tissue was fitted, too: shear modulus {moduli}.")
    gross = [int(sensors.groups[base.points[k][0]]) for k in np.flatnonzero(best.marginal.gross).tolist()]
    if gross:
        acting = " and ".join(best.mechanisms)
        assumptions.append(
            f"{len(gross)} points contradict all that surrounds them{f', with {acting},' if acting else ''} and are "
            f"taken for gross errors: {sorted(gross)}."
        )
    assumptions.append(f"Allowed to explain residuals first: {', '.join(base.nuisances.families)}.")
    return tuple(assumptions)
