"""What a mechanism changes of what is recorded, to first order: forces at the present state times compliance."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Following, Growing, Mechanism, Substituting, Weakening
from warpbrain.physics.proposal import Proposal
from warpbrain.physics.term import Term
from warpbrain.simulation.assumed import substituted
from warpbrain.simulation.system import System
from warpbrain.worlds.body.consolidation import Course, consolidation
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.mesh_error import MeshErrors, expected_answer, volume_of
from warpbrain.worlds.body.sensors import Sensors
from warpbrain.worlds.body.sparse_columns import SparseColumns

Floats = NDArray[np.float64]

#: Part of a standard deviation by which a smooth or a fading proposal is differentiated.
_STEP = 1e-3
#: The same of a course.
_STEP_OF_COURSE = 0.05
#: What acts by forces on nodes, and all that a mechanism may act by.
_PUSHING: frozenset[type] = frozenset((Load, Following, Substituting))
_ACTING = _PUSHING | {Weakening, Growing}


class Solved(Protocol):
    """What answers for mechanisms that are solved, not differentiated: `warpbrain.worlds.body.switching.Solving`."""

    def there(self, mechanism: Mechanism) -> Floats:
        """The sensors (n,) of the state with the mechanism, less those without it."""


@dataclass(frozen=True, eq=False)
class Effect:
    """A proposal as columns over the sensors: `mean + columns z`, `z ~ N(0, I)`.

    Attributes
    ----------
    proposal : Proposal or None
        None of what is no physics.
    mean : (n,) array
        Where the coefficients are what is expected beforehand.
    columns : (n, k) array
        Of one standard deviation of each.
    about : callable, or None
        Of a course: from its coefficients (k,) to the columns (n, k) there.
    """

    proposal: Proposal | None
    mean: Floats
    columns: Floats
    about: Callable[[Floats], Floats] | None = None

    @property
    def proposed(self) -> Proposal:
        """The proposal of an effect that is physics."""
        assert self.proposal is not None
        return self.proposal

    def coefficients(self, z: Floats) -> Floats:
        """The proposal's own coefficients."""
        return self.proposed.mean + self.proposed.sd * z

    def away(self, z: Floats) -> Floats:
        """How far (k,) [standard deviations] coefficients are from doing nothing."""
        return np.asarray((self.coefficients(z) - self.proposed.without) / self.proposed.sd)


def width_of(effects: Sequence[Effect]) -> int:
    """How many columns effects have together."""
    return sum(effect.columns.shape[1] for effect in effects)


def column_slices(effects: Sequence[Effect], first: int) -> tuple[slice, ...]:
    """Columns of each effect where those of all stand side by side from the number `first` on."""
    ends = np.cumsum([first, *(effect.columns.shape[1] for effect in effects)]).tolist()
    return tuple(slice(low, high) for low, high in itertools.pairwise(ends))


class Effects:
    """Makes the columns of proposals at one state.

    Parameters
    ----------
    at : Linearisation
    solved : Solved, optional
        Asked for proposals that are switches.
    mesh_errors : MeshErrors, optional
        Of the state: what is less compressible locks more, and that is part of what it changes.
    """

    def __init__(self, at: Linearisation, solved: Solved | None = None, mesh_errors: MeshErrors | None = None) -> None:
        self.at = at
        self.mesh_errors = mesh_errors
        self._given = solved
        self._internal: Floats | None = None
        model = at.system.model
        acting = [m for m in (*model.loads, *model.mechanisms) if isinstance(m, Mechanism) and not m.several]
        # of these a case has only one: what is proposed takes their place
        self._own = {mechanism.kind: mechanism for mechanism in acting}

    @property
    def _solved(self) -> Solved:
        assert self._given is not None, "switches keep their columns"
        return self._given

    def of(self, proposals: Sequence[Proposal], present: Mechanism | None = None) -> list[Effect]:
        """Columns of each proposal, in one pass over what they have in common.

        Parameters
        ----------
        proposals : sequence of Proposal
        present : Mechanism, optional
            What of them acts at the state already.
        """
        courses = self._courses([proposal for proposal in proposals if proposal.pace is not None])
        fading = self._at_once([proposal for proposal in proposals if proposal.history is not None], present)
        points = [self._points(proposal) for proposal in proposals]
        answers = self._answers([mechanism for own in points for mechanism in own], present)
        found, next_one = [], 0
        for proposal, own in zip(proposals, points, strict=True):
            columns = answers[:, next_one : next_one + len(own)]
            next_one += len(own)
            if proposal.pace is not None:
                found.append(_effect_of_course(proposal, courses[repr(proposal.make(proposal.start))]))
            elif proposal.history is not None:
                found.append(self._fading(proposal, fading[repr(proposal.make(proposal.start))]))
            else:
                found.append(self._effect(proposal, columns))
        return found

    def _courses(self, proposals: Sequence[Proposal]) -> dict[str, Course]:
        """Courses that proposals share, by what flows."""
        makes = {repr(made): made for made in (proposal.make(proposal.start) for proposal in proposals)}
        return {key: consolidation(self.at, self._bound(cast(Following, made))) for key, made in makes.items()}

    def _at_once(self, proposals: Sequence[Proposal], present: Mechanism | None) -> dict[str, Floats]:
        """What fading proposals change (n,) at once at their starts, by what is there."""
        makes = {repr(made): made for made in (proposal.make(proposal.start) for proposal in proposals)}
        answers = self._answers(list(makes.values()), present)
        return dict(zip(makes, answers.T, strict=True))

    def _fading(self, proposal: Proposal, at_once: Floats) -> Effect:
        sensors = self.at.sensors

        def left(c: Floats) -> Floats:
            return at_once * faded(parts_of(proposal, c, sensors), sensors.is_displacement)

        axes = _STEP * np.diag(proposal.sd)
        columns = [(left(proposal.mean + axis) - left(proposal.mean - axis)) / (2.0 * _STEP) for axis in axes]
        return Effect(proposal, left(proposal.mean), np.column_stack(columns))

    @staticmethod
    def _points(proposal: Proposal) -> list[Mechanism]:
        """Mechanisms whose answers make the columns."""
        if proposal.is_there_or_not or proposal.changes_in_time:
            return []
        axes = np.diag(proposal.sd)
        if proposal.follows == "proportional":
            return [proposal.make(axis) for axis in axes]
        beside = [proposal.make(proposal.start + sign * _STEP * axis) for axis in axes for sign in (-1.0, 1.0)]
        return [proposal.make(proposal.start), *beside]

    def _effect(self, proposal: Proposal, answers: Floats) -> Effect:
        if proposal.is_there_or_not:
            if proposal.follows == "release":
                patch = proposal.released
                answer = self.at.released(patch.members, patch.held, proposal.make(proposal.mean).lifts)
            else:
                answer = self._solved.there(proposal.make(proposal.mean))
            return Effect(proposal, proposal.mean[0] * answer, proposal.sd[0] * answer[:, None])
        if proposal.follows == "proportional":
            return Effect(proposal, answers @ (proposal.mean / proposal.sd), answers)
        columns = (answers[:, 2::2] - answers[:, 1::2]) / (2.0 * _STEP)
        away = (proposal.mean - proposal.start) / proposal.sd
        return Effect(proposal, answers[:, 0] + columns @ away, columns)

    def _answers(self, mechanisms: Sequence[Mechanism], present: Mechanism | None) -> Floats:
        """What each mechanism changes at the present state, (n, count), in the place of the case's own of its kind."""
        total = self._added(mechanisms, present)
        if present is None:
            for kind, own in self._own.items():
                same = [mechanism.kind == kind for mechanism in mechanisms]
                if any(same):
                    total[:, same] -= self._added([own], None)
        return total

    def _added(self, mechanisms: Sequence[Any], present: Mechanism | None) -> Floats:
        """What each mechanism changes beside all that acts, (n, count)."""
        at, system = self.at, self.at.system
        mesh = system.model.mesh
        stiff = present.stiffness_factor(mesh, 1.0) if isinstance(present, Weakening) else 1.0
        large = 1.0 + present.growth(mesh, 1.0) if isinstance(present, Growing) else 1.0
        pushed = SparseColumns(3 * system.size)
        stiffer, larger = SparseColumns(system.elements), SparseColumns(system.elements)
        for number, mechanism in enumerate(mechanisms):
            factor, faces = mechanism.factor(), _faces(mechanism.__class__)
            if not faces.isdisjoint(_PUSHING):
                pushed.add(number, self._forces(mechanism, faces).ravel())
            if Weakening in faces:
                stiffer.add(number, mechanism.stiffness_factor(mesh, factor) / stiff - 1.0)
            if Growing in faces:
                larger.add(number, (1.0 + mechanism.growth(mesh, factor)) / large - 1.0)
        total = np.zeros((len(at.sensors), len(mechanisms)))
        if pushed.numbers:
            total[:, pushed.numbers] += at.answers_of_columns(pushed.matrix())
        for weights, own in ((stiffer, "element_forces"), (larger, "growth_forces")):
            if weights.numbers:
                total[:, weights.numbers] += at.answers_of_elements(getattr(at, own), weights.matrix())
        if self.mesh_errors is not None and (volumes := self._volumes(mechanisms)).any():
            total += expected_answer(at.sensors, self.mesh_errors.by_volume)[:, None] * volumes
        return total

    def _volumes(self, mechanisms: Sequence[Any]) -> Floats:
        """By how much `volume_of` the tissue is larger with each mechanism (count,)."""
        own = self.at.system.model.materials
        return np.array(
            [
                volume_of(substituted(own, mechanism)) - volume_of(own)
                if Substituting in _faces(mechanism.__class__)
                else 0.0
                for mechanism in mechanisms
            ]
        )

    def _forces(self, mechanism: Any, faces: frozenset[type]) -> Floats:
        """Nodal forces (N, 3) of a mechanism with these faces."""
        if Load in faces:
            found = mechanism.factor() * mechanism.nodal_forces(self.at.system.model.mesh)
        else:
            found = np.zeros((self.at.system.size, 3))
        if Following in faces:
            found -= self._following(mechanism)
        if Substituting in faces:
            found -= self._substituting(mechanism)
        return found

    def _following(self, mechanism: Following) -> Floats:
        """Internal forces (N, 3) of a term that is not there."""
        system = self.at.system
        term = self._bound(mechanism)
        # what remembers answers as if the state had come at once: what is left of that, its history says
        term.set_time_step(0.0 if term.forgets_in is not None else np.inf)
        system.u.assign(self.at.u)
        term.evaluate_forces(system.u)
        found = np.zeros((system.size, 3))
        np.add.at(found, term.stencils, term.forces.numpy())
        return found

    def _bound(self, mechanism: Following) -> Term:
        """A term that is not there, with arrays of its own, as large as it is in the end."""
        import warp as wp

        system = self.at.system
        term = mechanism.bind(system)
        count, nodes = term.stencils.shape
        p, device = system.precision, system.device
        blocks = wp.zeros((count, nodes * (nodes + 1) // 2), dtype=p.mat33, device=device)
        term.place(wp.zeros((count, nodes), dtype=p.vec3, device=device), blocks)
        term.set_scale(term.factor(np.inf))
        return term

    def _substituting(self, mechanism: Substituting) -> Floats:
        """What other laws add to the internal forces (N, 3)."""
        at, system = self.at, self.at.system
        if self._internal is None:
            self._internal = at.internal_forces()
        own = system.model.materials
        other = substituted(own, mechanism)
        try:
            system.set_materials(other)
        except InputError:
            # a law that is launched in another way
            beside = System(replace(system.model, materials=other), str(system.device), system.precision.name)
            beside.remember_as(system)
            return at.internal_forces(beside) - self._internal
        found = at.internal_forces() - self._internal
        system.set_materials(own)
        return found


@cache
def _faces(kind: Hashable) -> frozenset[type]:
    """What mechanisms of a class act by: asked of thousands, and a protocol is slow to answer."""
    return frozenset(face for face in _ACTING if issubclass(cast(type, kind), face))


def faded(parts: Floats, is_displacement: NDArray[np.bool_]) -> Floats:
    """How many times what a fading proposal does at once is seen, where that many times are there.

    What is so many times stiffer resists as much more, and moves as much less.
    """
    return np.asarray(np.where(is_displacement, parts / (1.0 + np.maximum(parts, 0.0)), parts))


def parts_of(proposal: Proposal, c: Floats, sensors: Sensors) -> Floats:
    """How many times what a fading proposal does at once is there (n,) when each number was recorded."""
    assert proposal.history is not None
    times, rows = np.unique(sensors.times, return_inverse=True)
    parts = [proposal.history(c, time) if np.isfinite(time) else 0.0 for time in times.tolist()]
    return np.array(parts)[rows]


def _effect_of_course(proposal: Proposal, course: Course) -> Effect:
    pace = proposal.pace
    assert pace is not None

    def about(c: Floats) -> Floats:
        # wide enough that rounding does not matter, narrow beside what a course changes over
        steps = [_STEP_OF_COURSE * axis for axis in np.diag(proposal.sd)]
        ends = [(course.at(pace(c + step)) - course.at(pace(c - step))) / (2.0 * _STEP_OF_COURSE) for step in steps]
        return np.column_stack(ends)

    return Effect(proposal, course.at(pace(proposal.mean)), about(proposal.mean), about)
