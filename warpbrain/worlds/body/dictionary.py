"""What is looked for: every mechanism of the registry that the data of a case can show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case
from warpbrain.errors import InputError, SolveError
from warpbrain.mesh import TetMesh, face_vectors, nodes_of
from warpbrain.physics.composition import CompositionError, require_composable
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.proposal import NotTestableError, Patch, Proposal, Situation
from warpbrain.threads import in_threads
from warpbrain.worlds.body.effects import Effect, Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sensors import spread_points
from warpbrain.worlds.body.states import SolvedState
from warpbrain.worlds.body.surfaces import connected_parts, free_surfaces, with_free_surfaces

Floats = NDArray[np.float64]

#: About how many sites there are in the tissue, and on its surface: no patch is far from all of them.
_VOLUME_SITES, _SURFACE_SITES = 350, 480
#: Radii [m] of parts of a held set that may let go, and the distance [m] between their centres.
RADII, BETWEEN = (0.010, 0.015, 0.023, 0.035, 0.053), 0.014


@dataclass(frozen=True, eq=False)
class Dictionary:
    """Proposals by kind.

    Attributes
    ----------
    situation : Situation
    proposals : dict of str to tuple of Proposal
    rejected : dict of str to str
        Kinds that are not tried, and why.
    """

    situation: Situation
    proposals: dict[str, tuple[Proposal, ...]]
    rejected: dict[str, str]


def situation_of(case: Case, instants: int = 1) -> Situation:
    """What mechanisms may know of a case."""
    free = free_surfaces(case)
    mesh, _ = with_free_surfaces(case, free).remaining
    faces = mesh.boundary
    fixed = [
        b.nodes for b in case.boundaries if isinstance(b, Fixed) and mesh.node_sets[b.nodes][faces].all(axis=1).any()
    ]
    held = tuple(patch for nodes in fixed for patch in _patches(mesh, nodes))
    parts = [part.faces for part in connected_parts(case)]
    area = sum(float(np.linalg.norm(face_vectors(mesh.points, part), axis=1).sum()) for part in parts)
    # points a spacing apart have about 0.7 of its cube each, and 0.85 of its square
    spacing = (mesh.volume / (0.7 * _VOLUME_SITES)) ** (1.0 / 3.0)
    between = (area / (0.85 * _SURFACE_SITES)) ** 0.5
    middles = [mesh.points[part].mean(axis=1) for part in parts]
    # on each surface: a near point of another one, such as the other side of a thin mantle, does not stand for it
    sites = [np.zeros((0, 3)), *(own[spread_points(own, between)] for own in middles)]
    return Situation(
        mesh,
        case.gravity_axis,
        case.density,
        case.poisson,
        frozenset(mechanism.kind for mechanism in case.mechanisms),
        frozenset(tissue.model for tissue in case.tissues.values()),
        held,
        free,
        instants,
        mesh.centres[spread_points(mesh.centres, spacing)],
        np.concatenate(sites),
        spacing,
    )


def _patches(mesh: TetMesh, nodes: str) -> list[Patch]:
    """A held node set, and round parts of it: each centre with each radius, however many nodes that is."""
    on_surface = nodes_of(mesh.boundary, len(mesh.points))
    held = mesh.node_sets[nodes] & on_surface
    where = mesh.points[held]
    size = float(np.linalg.norm(np.ptp(where, axis=0))) / 2.0
    parts = [patch_of(mesh, nodes, held, centre, r) for centre in where[spread_points(where, BETWEEN)] for r in RADII]
    return [Patch(nodes, nodes, held, held, where.mean(axis=0), size), *(part for part in parts if part is not None)]


def patch_of(mesh: TetMesh, nodes: str, held: NDArray[np.bool_], centre: Floats, radius: float) -> Patch | None:
    """What of a held set is within a radius [m] of a point; None without a face, since that has no wall."""
    members = held & (np.linalg.norm(mesh.points - centre, axis=1) <= radius)
    if not members[mesh.boundary].all(axis=1).any():
        return None
    x, y, z = 1000.0 * centre
    return Patch(f"{nodes}-{1000.0 * radius:.0f}-near-{x:.0f}-{y:.0f}-{z:.0f}", nodes, members, held, centre, radius)


def dictionary_of(case: Case, kinds: Sequence[str] | None = None, instants: int = 1) -> Dictionary:
    """Proposals of all kinds, or of some.

    Raises
    ------
    InputError
        If there is no such kind.
    """
    known = mechanisms()
    asked = list(known) if kinds is None else list(kinds)
    for kind in asked:
        if kind not in known:
            raise InputError(f"candidates: no mechanism '{kind}': expected all, or some of {', '.join(known)}")
    situation = situation_of(case, instants)
    proposals: dict[str, tuple[Proposal, ...]] = {}
    rejected: dict[str, str] = {}
    for kind in asked:
        try:
            proposals[kind] = _composable(case, situation.mesh, known[kind].proposals(situation))
        except NotTestableError as error:
            rejected[kind] = f"not testable with these data: {error}"
    return Dictionary(situation, proposals, rejected)


def _composable(case: Case, mesh: TetMesh, proposals: Sequence[Proposal]) -> tuple[Proposal, ...]:
    """Those proposals that have a meaning together with what the case assumes; `NotTestableError` if none has."""
    found, refused = [], ""
    for proposal in proposals:
        made = proposal.make(proposal.mean)
        kept = [own for own in case.mechanisms if own.several or own.kind != made.kind]
        try:
            require_composable([*kept, made], mesh)
        except CompositionError as error:
            refused = str(error)
        else:
            found.append(proposal)
    if refused and not found:
        raise NotTestableError(refused)
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Effects of all proposals at one state.

    Attributes
    ----------
    kinds : tuple of str
    effects : tuple of Effect
    of_kind : dict of str to int array
        Numbers of the effects of each kind.
    alternatives : frozenset of str
        Kinds that are no physics.
    rejected : dict of str to str
    makes : Effects or None
        Which makes those of smooth ones at the same state; None if effects did not come from a state.
    """

    kinds: tuple[str, ...]
    effects: tuple[Effect, ...]
    of_kind: dict[str, NDArray[np.int64]]
    alternatives: frozenset[str]
    rejected: dict[str, str]
    makes: Effects | None = None

    def changes_in_time(self, kind: str) -> bool:
        """Whether what a kind does changes while loads do not."""
        proposal = self.effects[self.of_kind[kind][0]].proposal
        return proposal is not None and proposal.changes_in_time


def candidates_at(
    dictionary: Dictionary,
    effects: Effects,
    alternatives: dict[str, Effect],
    on_kind: Callable[[str], None] | None = None,
) -> Candidates:
    """The effects of a dictionary at one state, and of what is no physics.

    What cannot be simulated is rejected and says why.
    """
    found: list[Effect] = []
    of_kind: dict[str, NDArray[np.int64]] = {}
    rejected = dict(dictionary.rejected)
    for kind, proposals in dictionary.proposals.items():
        if on_kind is not None:
            on_kind(kind)
        own: list[Effect] = []
        smooth = [proposal for proposal in proposals if not proposal.is_there_or_not]
        try:
            own.extend(effects.of(smooth))
        except SolveError as error:
            rejected[kind] = f"{smooth[0].region}: cannot be simulated here: {error}"
        switches = [proposal for proposal in proposals if proposal.is_there_or_not]
        for proposal, tried in zip(switches, _tried(effects, switches), strict=True):
            if isinstance(tried, Effect):
                own.append(tried)
            else:
                rejected[kind] = f"{proposal.region}: cannot be simulated here: {tried}"
        if own:
            of_kind[kind] = np.arange(len(found), len(found) + len(own))
            rejected.pop(kind, None)
            found.extend(own)
    for name, effect in alternatives.items():
        of_kind[name] = np.array([len(found)])
        found.append(effect)
    return Candidates(tuple(of_kind), tuple(found), of_kind, frozenset(alternatives), rejected, effects)


def _tried(effects: Effects, proposals: Sequence[Proposal]) -> list[Effect | InputError | SolveError]:
    """Effects of what is there or not, or why there is none; what lets go is a dense solution each, in threads."""

    def attempt(proposal: Proposal) -> Effect | InputError | SolveError:
        try:
            return effects.of([proposal])[0]
        except (InputError, SolveError) as error:
            return error

    solved = [proposal for proposal in proposals if proposal.follows != "release"]
    released = [proposal for proposal in proposals if proposal.follows == "release"]
    # the first makes the surface, with threads of its own
    found = [*map(attempt, released[:1]), *in_threads(attempt, released[1:]), *map(attempt, solved)]
    by_proposal = dict(zip(map(id, (*released, *solved)), found, strict=True))
    return [by_proposal[id(proposal)] for proposal in proposals]


def candidates_about_fit(
    state: SolvedState,
    acting: Sequence[Effect],
    candidates: Candidates,
    places: Mapping[str, NDArray[np.int64]],
) -> Candidates:
    """The effects of a dictionary at another state, in which some act.

    What is solved as a whole or over time keeps the columns that it has at the base, as has what is no physics, and
    what is at places where it is improbable. A kind of which a case has only one is left out where it acts already.

    Parameters
    ----------
    state : SolvedState
    acting : sequence of Effect
    candidates : Candidates
        At the base.
    places : mapping of str to int array
        Of each kind, numbers of the places where it is made anew.
    """
    known = None if candidates.makes is None else candidates.makes.mesh_errors
    effects = Effects(Linearisation(state.system, state.u, state.reactions, state.sensors), mesh_errors=known)
    made = [effect.proposed.make(effect.proposed.mean) for effect in acting]
    there = {mechanism.kind for mechanism in made if not mechanism.several}
    found: list[Effect] = []
    of_kind: dict[str, NDArray[np.int64]] = {}
    for kind, numbers in candidates.of_kind.items():
        if kind in there:
            continue
        own = [candidates.effects[k] for k in numbers.tolist()]
        smooth = [k for k in places[kind].tolist() if _is_smooth(own[k])]
        for k, effect in zip(smooth, effects.of([own[k].proposed for k in smooth]), strict=True):
            own[k] = effect
        of_kind[kind] = np.arange(len(found), len(found) + len(own))
        found.extend(own)
    return replace(candidates, kinds=tuple(of_kind), effects=tuple(found), of_kind=of_kind, makes=effects)


def _is_smooth(effect: Effect) -> bool:
    """Whether it is differentiated at a state: neither solved as a whole nor over time, nor no physics."""
    return effect.proposal is not None and not effect.proposal.is_there_or_not and effect.about is None
