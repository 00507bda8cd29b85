"""Causes of a body: mechanisms at their places, unknown fields, and what is no physics.

The last are nuisances far larger than expected, which compete with mechanisms.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import Cause, GaussianModel, Kind, Place
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.causes import Member
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.dictionary import Candidates
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.nuisances import FIELD, LOADS, Nuisances
from warpbrain.worlds.body.sensors import Sensors, kernel_columns, row_products, spread_points
from warpbrain.worlds.body.time_courses import factor_of_rows, main_courses, modes_of_rows
from warpbrain.worlds.body.unknown import field_proposal

UNKNOWN, RESISTANCE = "unknown", "resistance"
#: What each means, in a sentence.
SENTENCES = {
    "registration": "Recordings and anatomy are registered wrongly.",
    "mesh": "The mesh is too coarse, or not the shape of the anatomy.",
    "stiffness": "Stiffness varies more from place to place than it is known to.",
    "loads": "The known loads are not as large as was said.",
    "segmentation": "A recorded surface, or that of the anatomy, is not where it was found.",
    "forces": "A recorded force is not the one that acted, or has another direction.",
}

#: Places of a cause that are looked at together.
_AT_A_TIME = 64


@dataclass(frozen=True, eq=False)
class BodyCauses:
    """Causes, and the effects of mechanisms at their places."""

    causes: tuple[Cause, ...]
    effects: Mapping[str, tuple[Effect, ...]]  # of each kind, by place

    def named(self, name: str) -> Cause:
        """A cause by its name."""
        return next(cause for cause in self.causes if cause.name == name)

    def effect(self, member: Member) -> Effect | None:
        """The effect of a mechanism, or a source, at a place with a size; None of what acts linearly."""
        cause = self.causes[member.cause]
        effect = self.effects[cause.name][member.place]
        if effect.proposal is None:
            return None
        return replace(effect.scaled(float(cause.sizes[member.size])), sizes=tuple(cause.sizes.tolist()))

    def columns(self, member: Member) -> Floats:
        """Columns (n, k) of one standard deviation."""
        cause = self.causes[member.cause]
        return cause.sizes[member.size] * cause.places[member.place].columns

    def mean(self, member: Member) -> Floats | float:
        """Expected change of each row (n,)."""
        mean = self.causes[member.cause].places[member.place].mean
        return 0.0 if mean is None else mean


def visible(causes: BodyCauses, model: GaussianModel) -> BodyCauses:
    """Those that would change what was recorded beside noise and nuisances, were they as large as is believed.

    A set with a cause that changes nothing is as probable as without it: many of them would share the probability of
    what acts, and tell of nothing. Their sizes are believed, but no verdict depends on them.

    `model`: of the rows without them.
    """
    return replace(causes, causes=tuple(cause for cause in causes.causes if _is_visible(cause, model)))


def _is_visible(cause: Cause, model: GaussianModel) -> bool:
    """Whether one standard deviation of its largest size is seen beside the model, of some places at a time."""
    largest, least = float(np.max(cause.sizes)), belief("checks.invisible")
    for first in range(0, len(cause.places), _AT_A_TIME):
        places = cause.places[first : first + _AT_A_TIME]
        columns = [largest * place.columns for place in places]
        columns += [place.mean[:, None] for place in places if place.mean is not None]
        if (np.linalg.norm(model.standardised(np.concatenate(columns, axis=1)), axis=0) > least).any():
            return True
    return False


def causes_of(base: Base, candidates: Candidates) -> BodyCauses:
    """The causes at a base."""
    sizes, not_physics_sizes = beliefs("causes.sizes"), beliefs("causes.not_physics_sizes")
    unit_sizes = np.ones(len(sizes))
    causes: list[Cause] = []
    for kind, of_kind in candidates.effects.items():
        if kind == UNKNOWN:
            causes.append(_unknown_cause(base, of_kind))
            continue
        places = tuple(
            Place(effect.columns, effect.mean if effect.mean.any() else None, effect.surface) for effect in of_kind
        )
        if of_kind[0].proposal is None:
            causes.append(
                Cause(kind, places, math.log(belief("causes.not_physics")), not_physics_sizes, Kind.NOT_PHYSICS)
            )
            continue
        # a mechanism with an expected size, such as a weight, has that one
        has_mean = any(place.mean is not None for place in places)
        sized, log_prior = unit_sizes if has_mean else sizes, math.log(belief(of_kind[0].proposal.odds))
        causes.append(Cause(kind, places, log_prior, sized, shares=_shares(of_kind)))
    return BodyCauses(tuple(causes), candidates.effects)


def _shares(effects: Sequence[Effect]) -> Floats | None:
    """Probability (p,) of each place of a mechanism; None if all are equally probable.

    A scan has hundreds of places, and neither that all tissue swells nor that something hangs where a case has a node
    set for it is as improbable as any one of these.
    """
    declared = np.array([effect.proposed.declared for effect in effects])
    local = np.array([effect.proposed.centre is not None for effect in effects]) & ~declared
    in_one, on_declared = belief("causes.in_one_place"), belief("causes.on_declared")
    shares = np.ones(len(effects))
    for chosen, others, share in ((local, ~local & ~declared, in_one), (declared, ~declared, on_declared)):
        if chosen.any() and others.any():
            shares[chosen] *= share / shares[chosen].sum()
            shares[others] *= (1.0 - share) / shares[others].sum()
    return None if (shares == 1.0).all() else shares / shares.sum()


def unknown_effects(base: Base) -> tuple[Effect, ...]:
    """Tissue whose resistance changes in time if there are several, unknown fields of every kind, and sources.

    What acts all the time is a load, which fits follow; what sets in or changes acts linearly.
    """
    # setting in at any recorded time, or changing from one to the next as mechanisms may
    times, sensors, noise = base.states.times, base.at.sensors, base.typical_noise
    courses = [factor_of_rows(course, sensors)[:, None] for course in main_courses(times)]
    if len(times) > 1:
        courses.append(modes_of_rows(times, sensors))
    zero = np.zeros(len(sensors))
    effects = [Effect(None, zero, noise * base.resistance)] if base.resistance.size else []
    for field in base.unknown.values():
        for number, course in enumerate(courses):
            if course.any():
                proposal = field_proposal(field, noise) if number == 0 else None
                effects.append(Effect(proposal, zero, noise * row_products(field.columns, course)))
    return (*effects, *base.sources)


def _unknown_cause(base: Base, effects: Sequence[Effect]) -> Cause:
    """Of `unknown_effects`."""
    places = [Place(effect.columns) for effect in effects]
    # fields, and sources of each length, are as probable as others of their kind
    lengths = np.array([effect.proposed.radius if effect.is_placed else 0.0 for effect in effects])
    _, groups, counts = np.unique(lengths, return_inverse=True, return_counts=True)
    counts[0] -= bool(base.resistance.size)
    local = belief("unknown.in_one_place") if len(counts) > 1 else 0.0
    shares = np.where(lengths == 0.0, 1.0 - local, local / max(len(counts) - 1, 1)) / counts[groups]
    if base.resistance.size:
        shares *= 1.0 - belief("unknown.resistance")
        shares[0], places[0] = belief("unknown.resistance"), replace(places[0], label=RESISTANCE)
    sizes = beliefs("unknown.sizes")
    return Cause(UNKNOWN, tuple(places), math.log(belief("causes.unknown")), sizes, Kind.UNKNOWN, shares)


def unknown_fields(base: Base) -> Cause:
    """Unknown fields of every kind, as they would be if they acted all the time."""
    places = tuple(Place(base.typical_noise * field.columns) for field in base.unknown.values())
    return Cause(UNKNOWN, places, math.log(belief("causes.unknown")), beliefs("unknown.sizes"), Kind.UNKNOWN)


def not_physics_at(at: Linearisation, nuisances: Nuisances) -> dict[str, Effect]:
    """Effects by name."""
    sensors, families, larger = at.sensors, nuisances.families, belief("tissue.larger")
    zero = np.zeros(len(sensors))
    columns_by_name = {
        "registration": sensors.rigid
        * np.repeat([belief("registration.wrong_shift") * sensors.radius, belief("registration.wrong_turn")], 3),
        "stiffness": larger * families[FIELD],
        "loads": larger * families[LOADS],
        "mesh": larger * families.get("mesh", zero),
        "segmentation": _off_surfaces(sensors),
        "forces": _wrong_forces(sensors),
    }
    return {name: Effect(None, zero, columns) for name, columns in columns_by_name.items() if columns.any()}


def _wrong_forces(sensors: Sensors) -> Floats:
    """Columns (n, k) of each component of the recorded forces, which may be wrong in size and in direction."""
    rows = np.flatnonzero(~sensors.is_displacement)
    groups = sensors.groups[rows]
    recorded = sensors.computed[rows] + sensors.residual[rows]
    squares = np.bincount(groups, weights=recorded**2, minlength=1)
    columns = np.zeros((len(sensors), len(rows)))
    columns[rows, np.arange(len(rows))] = belief("loads.force") * np.sqrt(squares[groups])
    return columns


def _off_surfaces(sensors: Sensors) -> Floats:
    """Columns (n, k) of recorded surfaces that are off: shifted from place to place, or too far out or in."""
    rows = np.flatnonzero(sensors.of_surfaces)
    places = sensors.positions[rows]
    reach = belief("mesh.surface_alike") * sensors.radius
    weights = kernel_columns(places, places[spread_points(places, reach, 60)], reach)
    coordinates = np.column_stack([sensors.directions[rows], np.ones(len(rows))])
    columns = np.zeros((len(sensors), 4 * weights.shape[1]))
    columns[rows] = belief("mesh.surface_off") * sensors.radius / np.sqrt(2.0) * row_products(weights, coordinates)
    return columns
