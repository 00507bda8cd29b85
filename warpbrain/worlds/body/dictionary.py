"""Candidates: proposals of every mechanism of the registry that the data of a case can show, and their effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Ints
from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case
from warpbrain.errors import InputError, SolveError
from warpbrain.inference.beliefs import belief
from warpbrain.mesh import TetMesh, face_vectors, nodes_of
from warpbrain.mesh.quality import extent
from warpbrain.physics.composition import CompositionError, require_composable
from warpbrain.physics.load import Load
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.proposal import NotTestableError, Patch, Proposal, Situation
from warpbrain.threads import beside, in_threads
from warpbrain.worlds.body.effects import Effect, Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sensors import spread_points
from warpbrain.worlds.body.states import SolvedState
from warpbrain.worlds.body.surfaces import (
    connected_parts,
    free_surfaces,
    named_triangles,
    unused_edges,
    with_free_surfaces,
)
from warpbrain.worlds.body.time_courses import over_time

#: About how many sites a scan has in the tissue, and on its surface.
_VOLUME_SITES, _SURFACE_SITES = 350, 480
#: Radii of parts of a held set that may let go, and the distance between their centres, over the radius of the body:
#: 10 to 53 mm, and 14 mm, of a brain.
RADII, BETWEEN = (0.154, 0.231, 0.354, 0.538, 0.815), 0.215


@dataclass(frozen=True, eq=False)
class Dictionary:
    """Proposals by kind."""

    situation: Situation
    proposals: dict[str, tuple[Proposal, ...]]
    rejected: dict[str, str]  # kinds that are not tried, and why


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
    # farthest-point samples a spacing apart fill about 0.7 of its cube each, and 0.85 of its square on a surface
    spacing = (mesh.volume / (0.7 * _VOLUME_SITES)) ** (1.0 / 3.0)
    between = (area / (0.85 * _SURFACE_SITES)) ** 0.5
    middles = [mesh.points[part].mean(axis=1) for part in parts]
    # for each surface: a site on the other side of a thin mantle is near, but on another surface
    sites = [np.zeros((0, 3)), *(points[spread_points(points, between)] for points in middles)]
    return Situation(
        mesh=mesh,
        gravity_axis=case.gravity_axis,
        density=case.density,
        poisson=case.poisson,
        assumed=frozenset(mechanism.kind for mechanism in case.mechanisms),
        laws=frozenset(tissue.model for tissue in case.tissues.values()),
        held=held,
        free=free,
        instants=instants,
        volume_sites=mesh.centres[spread_points(mesh.centres, spacing)],
        surface_sites=np.concatenate(sites),
        spacing=spacing,
        stiffness=_stiffness(case),
        named=named_triangles(case, free),
        unused=unused_edges(case),
    )


def _stiffness(case: Case) -> float:
    """How many times stiffer than brain a body is by what is declared of its stiffest tissue, 1 at least."""
    moduli = [tissue.law.shear_modulus for tissue in case.tissues.values() if tissue.law is not None]
    return max([1.0, *(modulus / belief("loads.brain") for modulus in moduli)])


def _patches(mesh: TetMesh, nodes: str) -> list[Patch]:
    """A held node set, and discs of it about each centre with each radius."""
    on_surface = nodes_of(mesh.boundary, len(mesh.points))
    held = mesh.node_sets[nodes] & on_surface
    where = mesh.points[held]
    size = extent(where) / 2.0
    centres = where[spread_points(where, BETWEEN * mesh.radius)]
    parts = [Patch.disc(mesh, nodes, held, centre, r * mesh.radius) for centre in centres for r in RADII]
    return [Patch(nodes, nodes, held, held, where.mean(axis=0), size), *(part for part in parts if part is not None)]


def dictionary_of(
    case: Case, kinds: Sequence[str] | None = None, instants: int = 1, times: Sequence[float] = ()
) -> Dictionary:
    """Proposals of all kinds, or of some.

    `instants`: see `Situation`. `times`: of states that are looked at [s]: with several, what may change from one to
    the next is proposed with a course, too. `InputError` if there is no such kind.
    """
    registry = mechanisms()
    requested = list(registry) if kinds is None else list(kinds)
    for kind in requested:
        if kind not in registry:
            raise InputError(f"candidates: no mechanism '{kind}': expected all, or some of {', '.join(registry)}")
    situation = situation_of(case, instants)
    proposals: dict[str, tuple[Proposal, ...]] = {}
    rejected: dict[str, str] = {}
    for kind in requested:
        try:
            proposed = over_time(registry[kind].proposals(situation), times)
            proposals[kind] = _composable(case, situation.mesh, proposed)
        except NotTestableError as error:
            rejected[kind] = f"not testable with these data: {error}"
    return Dictionary(situation, proposals, rejected)


def _composable(case: Case, mesh: TetMesh, proposals: Sequence[Proposal]) -> tuple[Proposal, ...]:
    """Proposals that can be combined with the mechanisms of the case; `NotTestableError` if none can."""
    composable, reason = [], ""
    for proposal in proposals:
        proposed = proposal.make(proposal.mean)
        others = [mechanism for mechanism in case.mechanisms if mechanism.several or mechanism.kind != proposed.kind]
        try:
            require_composable([*others, proposed], mesh)
        except CompositionError as error:
            reason = str(error)
        else:
            composable.append(proposal)
    if reason and not composable:
        raise NotTestableError(reason)
    return tuple(composable)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Effects of all proposals at one state."""

    effects: dict[str, tuple[Effect, ...]]  # of each kind
    rejected: dict[str, str]
    source: Effects  # which made them at a state

    def with_effects(self, kind: str, effects: tuple[Effect, ...]) -> Candidates:
        """With those of one kind more."""
        return replace(self, effects=self.effects | {kind: effects})


def candidates_at(
    dictionary: Dictionary,
    effects: Effects,
    alternatives: dict[str, Effect],
    on_kind: Callable[[str], None] = lambda _kind: None,
) -> Candidates:
    """The effects of a dictionary at one state, and of what is no physics.

    Kinds that cannot be simulated are rejected with a reason.
    """
    rejected = dict(dictionary.rejected)
    switches = {
        kind: [proposal for proposal in proposals if proposal.is_there_or_not]
        for kind, proposals in dictionary.proposals.items()
    }

    def switched() -> dict[str, list[Effect | InputError | SolveError]]:
        return {kind: switch_effects(effects, proposals) for kind, proposals in switches.items()}

    # states and dense solutions of their own; on a GPU what one thread captures would be launched by the other
    results = beside(switched) if effects.at.system.device.is_cpu else switched
    found: dict[str, list[Effect]] = {}
    for kind, proposals in dictionary.proposals.items():
        on_kind(kind)
        smooth = [proposal for proposal in proposals if not proposal.is_there_or_not]
        try:
            found[kind] = effects.of(smooth)
        except SolveError as error:
            found[kind] = []
            rejected[kind] = f"{smooth[0].region}: cannot be simulated here: {error}"
    by_kind: dict[str, tuple[Effect, ...]] = {}
    for kind, of_switches in results().items():
        of_this_kind = found[kind]
        for proposal, result in zip(switches[kind], of_switches, strict=True):
            if isinstance(result, Effect):
                of_this_kind.append(result)
            else:
                rejected[kind] = f"{proposal.region}: cannot be simulated here: {result}"
        # what is there all the time changes nothing between two states
        of_this_kind = [e for e in of_this_kind if e.columns.any() or e.mean.any()] or of_this_kind
        within = [effect for effect in of_this_kind if is_linear(effect, effects.at)]
        if of_this_kind and not within:
            rejected[kind] = "its effect is not linear here: its usual size would move the body by more than its own"
        if within:
            by_kind[kind] = tuple(within)
            rejected.pop(kind, None)
    return Candidates(by_kind | {name: (effect,) for name, effect in alternatives.items()}, rejected, effects)


def is_linear(effect: Effect, at: Linearisation) -> bool:
    """Whether an effect is finite and, if it is of no load, a standard deviation moves the body by less than its size.

    A larger response is not linear: that of fibres that stiffen exponentially, in a strained state, is in proportion to
    their stiffness and may still be 1e200 m. Of a load a small part may act.
    """
    if effect.proposal is None or isinstance(effect.proposed.make(effect.proposed.mean), Load):
        return bool(np.isfinite(effect.columns).all())
    rows = at.sensors.is_displacement
    # components of a point, and of a vector of coefficients, together: in other axes each is another
    parts = np.minimum(np.abs(effect.columns[rows]) / at.extent, 1.0)
    squares = np.bincount(at.sensors.groups[rows], np.sum(parts**2, axis=1))
    return bool(np.isfinite(effect.columns).all() and squares.max(initial=0.0) < 1.0)


def switch_effects(effects: Effects, proposals: Sequence[Proposal]) -> list[Effect | InputError | SolveError]:
    """Effects of switches, or why there is none.

    Patches that let go have a dense solution each, made in threads, where no equilibrium is solved for them.
    """

    def attempt(proposal: Proposal) -> Effect | InputError | SolveError:
        try:
            return effects.of([proposal])[0]
        except (InputError, SolveError) as error:
            return error

    solves = effects.solves_releases
    released = [proposal for proposal in proposals if proposal.is_release and not solves]
    solved = [proposal for proposal in proposals if solves or not proposal.is_release]
    # the first one condenses the surface, with threads of its own
    results = [*map(attempt, released[:1]), *in_threads(attempt, released[1:]), *map(attempt, solved)]
    by_proposal = dict(zip(map(id, (*released, *solved)), results, strict=True))
    return [by_proposal[id(proposal)] for proposal in proposals]


def candidates_about_fit(
    state: SolvedState, acting: Sequence[Effect], candidates: Candidates, places: Mapping[str, Ints]
) -> Candidates:
    """The effects of a dictionary at the state of a fit, in which some mechanisms act.

    Releases depend on the reactions there: their columns are computed anew at all places, unless nodes are released
    already. Other switches, courses in time and what is no physics keep their columns at the base, as do all at
    improbable places. A kind of which a case has only one is left out if it acts already.

    `candidates`: at the base. `places`: of each kind, numbers of the places whose columns are made anew.
    """
    effects = Effects(state.linearised())
    acting_mechanisms = [effect.proposed.make(effect.proposed.mean) for effect in acting]
    acting_kinds = {mechanism.kind for mechanism in acting_mechanisms if not mechanism.several}
    all_are_held = not any(effect.is_release for effect in acting)
    by_kind: dict[str, tuple[Effect, ...]] = {}
    for kind, at_base in candidates.effects.items():
        if kind in acting_kinds:
            continue
        of_this_kind = list(at_base)
        # of which columns are derivatives at one state
        tried = ((k, of_this_kind[k]) for k in places[kind].tolist())
        smooth = [k for k, e in tried if e.proposal and not e.proposal.is_there_or_not and e.columns_at is None]
        for k, effect in zip(smooth, effects.of([of_this_kind[k].proposed for k in smooth]), strict=True):
            if is_linear(effect, effects.at):
                of_this_kind[k] = effect
        by_kind[kind] = with_releases_of(effects, of_this_kind) if all_are_held else tuple(of_this_kind)
    return replace(candidates, effects=by_kind, source=effects)


def with_releases_of(
    effects: Effects, of_a_kind: Sequence[Effect], numbers: Sequence[int] | None = None
) -> tuple[Effect, ...]:
    """Effects of a kind with the columns of its releases computed by `effects`; unchanged where these cannot be.

    `numbers`: of the effects that are looked at; all unless given.
    """
    among = range(len(of_a_kind)) if numbers is None else numbers
    released = [number for number in among if of_a_kind[number].is_release]
    result = list(of_a_kind)
    for k, effect in zip(released, switch_effects(effects, [result[k].proposed for k in released]), strict=True):
        if isinstance(effect, Effect):
            result[k] = effect
    return tuple(result)
