"""Effect of mechanisms on what is recorded, to first order: forces at a state times the compliance."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Any, cast

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Following, Growing, Mechanism, Substituting, Weakening
from warpbrain.physics.proposal import Proposal, Varying
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.simulation.model import substituted
from warpbrain.simulation.system import System
from warpbrain.worlds.body.consolidation import Course, bound_term, consolidation
from warpbrain.worlds.body.creep import Perturbation, creep_function
from warpbrain.worlds.body.linearisation import Linearisation, Moment
from warpbrain.worlds.body.sensors import Sensors, row_products
from warpbrain.worlds.body.states import SolvedState, States

#: Part of a standard deviation by which a smooth or a fading proposal is differentiated.
_STEP = 1e-3
#: The same of a course in time.
_STEP_OF_COURSE = 0.05
#: Interfaces of mechanisms that act by nodal forces, and of all mechanisms.
_PUSHING: frozenset[type] = frozenset((Load, Following, Substituting))
_ACTING = _PUSHING | {Weakening, Growing}


def sparse_columns(size: int, columns: Iterable[tuple[int, Floats]]) -> tuple[list[int], Any]:
    """Numbers (k,) of those columns (size,) that are not zero, and these as SciPy CSC (size, k)."""
    from scipy.sparse import csc_matrix

    numbers: list[int] = []
    rows, values = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    for number, column in columns:
        # `flatnonzero` of booleans is eight times as fast as of numbers
        rows.append(np.flatnonzero(column != 0.0))
        values.append(column[rows[-1]])
        numbers += [number] * bool(len(rows[-1]))
    ends = np.unique(np.cumsum([len(each) for each in rows]))
    return numbers, csc_matrix((np.concatenate(values), np.concatenate(rows), ends), (size, len(numbers)))


class SolvedSwitches:
    """What mechanisms without a size, such as contact, change of what is recorded: by an equilibrium with each, kept.

    `state`: the equilibrium without them.
    """

    def __init__(self, states: States, state: SolvedState) -> None:
        self._states, self._state = states, state
        # displacement and reactions with each mechanism at the time of each number
        self._solved: dict[str, list[tuple[Floats, Floats]]] = {}

    def effect_of(self, proposal: Proposal, sensors: Sensors, instant: int) -> Floats:
        """What sensors (n,) record in the state with a mechanism, less that without it, at the time of a number."""
        mechanism, state = proposal.make(proposal.mean), self._state
        key = repr(mechanism)
        if key not in self._solved:
            acting, patches = state.hypothesis.mechanisms, state.hypothesis.patches
            further = () if proposal.patch is None else (proposal.patch,)
            hypothesis = replace(state.hypothesis, mechanisms=(*acting, mechanism), patches=(*patches, *further))
            # the loads act already: one load step, or the state is taken not to exist
            solved = self._states.solve(hypothesis, state.u, iterations=EquilibriumOptions.max_newton)
            self._solved[key] = [(each.u, each.reactions) for each in solved.instants]
        (u, reactions), without = self._solved[key][instant], state.instants[instant]
        return sensors.answer(u - without.u, reactions - without.reactions)


@dataclass(frozen=True, eq=False)
class Effect:
    """A proposal as columns over the sensors: `mean + columns z`, `z ~ N(0, I)`."""

    proposal: Proposal | None  # None of what is no physics
    mean: Floats  # (n,), at the prior mean of the coefficients
    columns: Floats  # (n, k), of one standard deviation of each
    #: Of a course in time: from its coefficients (k,) to the columns (n, k) about them.
    columns_at: Callable[[Floats], Floats] | None = None
    is_solved: bool = False  # of what is there or not: by a state with it, not to first order
    #: Prior standard deviation of its amounts over the usual one, and the values that this may have.
    size: float = 1.0
    sizes: tuple[float, ...] = (1.0,)

    @property
    def proposed(self) -> Proposal:
        """The proposal of an effect that is physics."""
        assert self.proposal is not None
        return self.proposal

    @property
    def is_placed(self) -> bool:
        """Whether it acts in a place, with a size of its own there, and may act at another."""
        return self.proposal is not None and self.proposal.elsewhere is not None and not self.proposal.is_there_or_not

    @property
    def surface(self) -> str:
        """The surface on which it is placed, in words; empty if it is not placed on one."""
        return self.proposed.region if self.is_placed and self.proposed.on_surface else ""

    @property
    def is_release(self) -> bool:
        """Whether nodes that are held are released where it acts."""
        return self.proposal is not None and self.proposal.is_release

    def coefficients(self, z: Floats) -> Floats:
        """The proposal's own coefficients."""
        return self.proposed.mean + self.proposed.sd * z

    def constant_mechanisms(self, z: Floats) -> list[Mechanism]:
        """Mechanisms of coordinates (k,) that are constant in time; none of what changes, or is no physics."""
        if self.proposal is None or self.proposal.over_time is not None or self.proposal.changes_in_time:
            return []
        return list(self.proposal.acting(self.coefficients(z)))

    def scaled(self, factor: float) -> Effect:
        """The same with the prior standard deviations of its amounts times a factor; of what is physics."""
        scales = self.proposed.scales(factor)
        proposal = replace(self.proposed, sd=scales * self.proposed.sd)
        return replace(self, proposal=proposal, columns=scales * self.columns, size=factor * self.size)

    def of_size(self, effect: Effect) -> Effect:
        """The same, which has the usual standard deviations, with the `size` and `sizes` of another effect."""
        return replace(self.scaled(effect.size), sizes=effect.sizes)

    def offset(self, z: Floats) -> Floats:
        """Coefficients less those that have no effect (k,) [standard deviations]."""
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

    `switches`: needed for proposals that are switches.
    `instant`: number of the time of the state.
    `loading`: mechanisms that act beside each proposal by nodal forces. A release is of the reactions to these, too, to
    first order; what they change of other proposals is of second order and left out. `releases`: with which states are
    solved for releases, too, which are to first order otherwise.
    """

    def __init__(
        self,
        at: Linearisation,
        switches: SolvedSwitches | None = None,
        instant: int = -1,
        loading: Sequence[Mechanism] = (),
        releases: SolvedSwitches | None = None,
    ) -> None:
        self.at, self._switches, self._instant = at, switches, instant
        self.loading, self._releases = tuple(loading), releases
        self._internal: Floats | None = None
        # systems of the same state with laws of other kinds, as long as columns are made
        self._of_other_laws: list[System] = []
        model = at.system.model
        acting = [m for m in (*model.loads, *model.mechanisms) if isinstance(m, Mechanism) and not m.several]
        # kinds of which a case has only one: a proposed mechanism replaces them
        self._exclusive = {mechanism.kind: mechanism for mechanism in acting}

    def over(self, at: Linearisation) -> Effects:
        """The same over other sensors at the same state."""
        return Effects(at, self._switches)

    def beside(self, acting: Sequence[Mechanism]) -> Effects:
        """The same beside those mechanisms that act by nodal forces."""
        loading = [mechanism for mechanism in acting if not _faces(mechanism.__class__).isdisjoint(_PUSHING)]
        return Effects(self.at, self._switches, self._instant, loading)

    @property
    def solves_releases(self) -> bool:
        """Whether the effect of a release is that of an equilibrium with it, not to first order."""
        return self._releases is not None

    def solving_releases(self, states: States, state: SolvedState) -> Effects:
        """The same, with an equilibrium solved for each release, from the `state` that these effects are about."""
        solved = SolvedSwitches(states, state)
        return Effects(self.at, self._switches, self._instant, self.loading, solved)

    @cached_property
    def _further_reactions(self) -> Floats | None:
        """Reactions (N, 3) [N] to what acts beside, to first order; None if nothing does."""
        if not self.loading:
            return None
        return self.at.reactions_to(np.sum([self._forces(m, _faces(m.__class__)) for m in self.loading], axis=0))

    def of(
        self, proposals: Sequence[Proposal], present: Mechanism | None = None, columns_alone: bool = False
    ) -> list[Effect]:
        """Columns of each proposal, with what they have in common computed once.

        `present`: mechanism of that kind that acts at the state already. `columns_alone`: means are not asked for; what
        smooth proposals do at their start is taken for nothing.
        """
        bases = [proposal if proposal.over_time is None else proposal.over_time.base for proposal in proposals]
        each_once, by_moment = list({id(base): base for base in bases}.values()), []
        for moment in self.at.moments:
            at = moment.at
            there = at is self.at
            here = self if there else Effects(at, self._switches, moment.number, self.loading, self._releases)
            by_moment.append(here._at_one_time(each_once, present, columns_alone))
        return [
            self._over_time(proposal, [effects[id(base)] for effects in by_moment])
            for proposal, base in zip(proposals, bases, strict=True)
        ]

    def _over_time(self, proposal: Proposal, by_moment: Sequence[Effect]) -> Effect:
        """The effect over all rows: of each state at its time, less at that from which it is counted."""
        varying, effect = proposal.over_time, by_moment[0]
        if varying is None and self.at.is_at_one_time:
            return effect
        perturbation = _perturbation(proposal, effect)

        def total(of: Callable[[Effect, Moment], Floats]) -> Floats:
            effects = iter(by_moment)
            return self.at.summed(lambda moment: of(next(effects), moment), perturbation)

        def columns(e: Effect, moment: Moment) -> Floats:
            return e.columns if varying is None else _expanded(e.columns, varying, moment.times)

        def columns_at(c: Floats) -> Floats:
            return total(lambda e, _: e.columns if e.columns_at is None else e.columns_at(c))

        about = None if effect.columns_at is None else columns_at
        return Effect(proposal, total(lambda e, _: e.mean), total(columns), about, effect.is_solved)

    def _at_one_time(
        self, proposals: Sequence[Proposal], present: Mechanism | None, columns_alone: bool
    ) -> dict[int, Effect]:
        """Effects at one state by the identity of their proposals."""
        flows = _started([proposal for proposal in proposals if proposal.pace is not None])
        courses = {key: consolidation(self.at, cast(Following, flow)) for key, flow in flows.items()}
        fading = _started([proposal for proposal in proposals if proposal.history is not None])
        each_alone = [np.eye(len(fading))]
        instant = dict(zip(fading, self._answers(list(fading.values()), present, each_alone).T, strict=True))
        stencils = [self._stencil(proposal, columns_alone) for proposal in proposals]
        mechanisms = [mechanism for each, _ in stencils for mechanism in each]
        answers = self._answers(mechanisms, present, [weights for _, weights in stencils])
        effects, first = [], 0
        for proposal, (_, weights) in zip(proposals, stencils, strict=True):
            columns = answers[:, first : first + weights.shape[1]]
            first += weights.shape[1]
            if proposal.pace is not None:
                effects.append(_effect_of_course(proposal, courses[repr(proposal.make(proposal.start))]))
            elif proposal.history is not None:
                effects.append(self._fading(proposal, instant[repr(proposal.make(proposal.start))]))
            elif proposal.is_there_or_not:
                effects.append(self._switch(proposal))
            else:
                effects.append(_smooth(proposal, columns))
        return dict(zip(map(id, proposals), effects, strict=True))

    def _fading(self, proposal: Proposal, instant: Floats) -> Effect:
        sensors = self.at.sensors

        def change(c: Floats) -> Floats:
            return instant * faded(proposal, c, sensors)

        axes = _STEP * np.diag(proposal.sd)
        columns = [(change(proposal.mean + axis) - change(proposal.mean - axis)) / (2.0 * _STEP) for axis in axes]
        return Effect(proposal, change(proposal.mean), np.column_stack(columns))

    @staticmethod
    def _stencil(proposal: Proposal, columns_alone: bool) -> tuple[list[Mechanism], Floats]:
        """Mechanisms (s,), and with which weights (s, c) their effects give the answers of `_smooth`.

        Of what is smooth they are differences, taken before an equilibrium is found for any of them.
        """
        if proposal.is_there_or_not or proposal.changes_in_time:
            return [], np.zeros((0, 0))
        axes = np.diag(proposal.sd)
        if proposal.follows == "proportional":
            return [proposal.make(axis) for axis in axes], np.eye(len(axes))
        at_start = [] if columns_alone else [proposal.make(proposal.start)]
        shifted = [proposal.make(proposal.start + sign * _STEP * axis) for axis in axes for sign in (-1.0, 1.0)]
        weights = np.zeros((len(at_start) + len(shifted), 1 + len(axes)))
        weights[: len(at_start), 0] = 1.0
        weights[len(at_start) :, 1:] = np.kron(np.eye(len(axes)), [[-1.0], [1.0]]) / (2.0 * _STEP)
        return [*at_start, *shifted], weights

    def _switch(self, proposal: Proposal) -> Effect:
        """Of what is there or not: by an equilibrium with it, or where held nodes are released to first order."""
        solved = self._releases if proposal.is_release else self._switches
        if solved is not None:
            answer = solved.effect_of(proposal, self.at.sensors, self._instant)
        else:
            assert proposal.is_release, "about a fit switches keep their columns"
            patch, lifts = proposal.released, proposal.make(proposal.mean).lifts
            answer = self.at.released(patch.members, patch.held, lifts, self._further_reactions)
        mean, columns = proposal.mean[0] * answer, proposal.sd[0] * answer[:, None]
        return Effect(proposal, mean, columns, is_solved=solved is not None)

    def _answers(self, mechanisms: Sequence[Mechanism], present: Mechanism | None, weights: Sequence[Floats]) -> Floats:
        """Sums (n, c) of effects of mechanisms, in the place of the case's own one where it has only one of the kind.

        `weights`: of each run of mechanisms (s, c), in their order.
        """
        from scipy.sparse import block_diag, identity

        if not mechanisms:
            return np.zeros((len(self.at.sensors), 0))
        sums = block_diag([each for each in weights if each.size], format="csr")
        total = self._added(mechanisms, present, sums)
        if present is None:
            for kind, replaced in self._exclusive.items():
                of_kind = np.array([float(mechanism.kind == kind) for mechanism in mechanisms])
                if of_kind.any():
                    total -= self._added([replaced], None, identity(1, format="csr")) * (of_kind @ sums)
        return total

    def _added(self, mechanisms: Sequence[Any], present: Mechanism | None, sums: Any) -> Floats:
        """Sums (n, c), with weights (count, c), of the effects of mechanisms in addition to all that act."""
        at, system = self.at, self.at.system
        mesh = system.model.mesh
        present_stiffness = present.stiffness_factor(mesh, 1.0) if isinstance(present, Weakening) else 1.0
        present_volume = 1.0 + present.growth(mesh, 1.0) if isinstance(present, Growing) else 1.0
        each = [(number, m, _faces(m.__class__)) for number, m in enumerate(mechanisms)]
        forces = ((k, self._forces(m, faces).ravel()) for k, m, faces in each if not faces.isdisjoint(_PUSHING))
        stiffness = (
            (k, m.stiffness_factor(mesh, m.factor()) / present_stiffness - 1.0) for k, m, f in each if Weakening in f
        )
        growth = ((k, (1.0 + m.growth(mesh, m.factor())) / present_volume - 1.0) for k, m, f in each if Growing in f)
        total = np.zeros((len(at.sensors), sums.shape[1]))
        self._of_other_laws.clear()
        for columns, size, answers in (
            (forces, 3 * system.size, at.answers_of_columns),
            (stiffness, system.elements, lambda w: at.answers_of_elements(at.element_forces, w)),
            (growth, system.elements, lambda w: at.answers_of_elements(at.growth_forces, w)),
        ):
            numbers, matrix = sparse_columns(size, columns)
            if numbers:
                weighted = (matrix @ sums[numbers]).tocsc()
                some = np.flatnonzero(np.diff(weighted.indptr))
                total[:, some] += answers(weighted[:, some])
        return total

    def _forces(self, mechanism: Any, faces: frozenset[type]) -> Floats:
        """Nodal forces (N, 3) of a mechanism with these faces."""
        if Load in faces:
            forces = mechanism.factor() * mechanism.nodal_forces(self.at.system.model.mesh)
        else:
            forces = np.zeros((self.at.system.size, 3))
        if Following in faces:
            forces -= self._following(mechanism)
        if Substituting in faces:
            forces -= self._substituting(mechanism)
        return forces

    def _following(self, mechanism: Following) -> Floats:
        """Internal forces (N, 3) of a term that the system does not have."""
        system = self.at.system
        term = bound_term(system, mechanism)
        # a term with memory has its instantaneous stress; how that fades follows from its history
        term.set_time_step(0.0 if term.forgets_in is not None else np.inf)
        system.u.assign(self.at.u)
        term.evaluate_forces(system.u)
        forces = np.zeros((system.size, 3))
        np.add.at(forces, term.stencils, term.forces.numpy())
        return forces

    def _substituting(self, mechanism: Substituting) -> Floats:
        """What other laws add to the internal forces (N, 3)."""
        at, system = self.at, self.at.system
        if self._internal is None:
            self._internal = at.internal_forces()
        materials = system.model.materials
        substitutes = substituted(materials, mechanism)
        for other in (system, *self._of_other_laws):
            try:
                other.set_materials(substitutes)
            except InputError:
                continue
            break
        else:
            # a law for which other kernels are launched
            other = System(replace(system.model, materials=substitutes), str(system.device), system.precision.name)
            other.remember_as(system)
            self._of_other_laws.append(other)
        change = at.internal_forces(other) - self._internal
        if other is system:
            system.set_materials(materials)
        return change


def _perturbation(proposal: Proposal, effect: Effect) -> Perturbation:
    """Which quantity a proposal perturbs; `effect`: that at one time."""
    # a course of its own, or a state that was solved for at each time
    if proposal.history is not None or proposal.pace is not None or effect.is_solved:
        return "known"
    return proposal.make(proposal.mean).changes


def _expanded(columns: Floats, varying: Varying, times: Floats) -> Floats:
    """Columns (n, k) of what acts at one time as those of modes, for rows at times (n,)."""
    changing = row_products(columns[:, list(varying.base.varying)], varying.modes_at(times))
    return np.column_stack([columns[:, list(varying.fixed)], changing])


def columns_over_time(at: Linearisation, proposal: Proposal, c: Floats) -> Floats:
    """Columns (n, k) of a proposal that varies, about coefficients (k,) with which it acts."""
    varying = proposal.over_time
    assert varying is not None

    def about(moment: Moment) -> Floats:
        here = varying.at(c, moment.time)
        smooth = replace(varying.base, follows="smooth", start=here, sd=_sd_of(proposal, varying))
        [effect] = Effects(moment.at).of([smooth], varying.base.make(here))
        return _expanded(effect.columns, varying, moment.times)

    return at.summed(about, varying.base.make(varying.base.mean).changes)


def _sd_of(proposal: Proposal, varying: Varying) -> Floats:
    """Standard deviations (k,) of what acts at one time, of a proposal whose own may have been scaled."""
    sd = varying.base.sd.copy()
    fixed = list(varying.fixed)
    sd[fixed] = proposal.sd[: len(fixed)]
    sd[list(varying.base.varying)] = proposal.sd[len(fixed) :].reshape(len(varying.base.varying), -1)[:, 0]
    return sd


def _smooth(proposal: Proposal, answers: Floats) -> Effect:
    """Of what is smooth, or proportional to its coefficients, from answers (n, c) to the sums of `Effects._stencil`."""
    if proposal.follows == "proportional":
        return Effect(proposal, answers @ (proposal.mean / proposal.sd), answers)
    columns = answers[:, 1:]
    offset = (proposal.mean - proposal.start) / proposal.sd
    return Effect(proposal, answers[:, 0] + columns @ offset, columns)


def _started(proposals: Sequence[Proposal]) -> dict[str, Mechanism]:
    """Mechanisms of proposals at their starts, those that are equal once, by their representation."""
    return {repr(mechanism): mechanism for mechanism in (proposal.make(proposal.start) for proposal in proposals)}


@cache
def _faces(kind: Hashable) -> frozenset[type]:
    """Interfaces of a class of mechanisms, cached: `issubclass` of a protocol is slow, and there are thousands."""
    return frozenset(face for face in _ACTING if issubclass(cast(type, kind), face))


def faded(proposal: Proposal, c: Floats, sensors: Sensors) -> Floats:
    """Fraction (n,) of its instantaneous effect that a fading proposal with coefficients (k,) has left at each row.

    Of forces that of the stress which has not relaxed; of displacements, under constant loads, the creep still to come.
    """
    assert proposal.history is not None
    relaxing_modulus = partial(proposal.history, c)
    times, rows = np.unique(sensors.times, return_inverse=True)
    finite, stress = np.isfinite(times), np.zeros(len(times))
    stress[finite] = relaxing_modulus(times[finite])
    displacement = stress.copy()
    # a negative modulus, as differences about none take, has the same to first order and may have no creep function
    if float(relaxing_modulus(np.zeros(1))[0]) > 0.0:
        displacement[finite] = [1.0 - creep_function(relaxing_modulus, time) for time in times[finite].tolist()]
    return np.where(sensors.is_displacement, displacement[rows], stress[rows])


def _effect_of_course(proposal: Proposal, course: Course) -> Effect:
    pace = proposal.pace
    assert pace is not None

    def columns_at(c: Floats) -> Floats:
        # wide against rounding, narrow against the range over which a course changes
        steps = [_STEP_OF_COURSE * axis for axis in np.diag(proposal.sd)]
        columns = [(course.at(pace(c + step)) - course.at(pace(c - step))) / (2.0 * _STEP_OF_COURSE) for step in steps]
        return np.column_stack(columns)

    return Effect(proposal, course.at(pace(proposal.mean)), columns_at(proposal.mean), columns_at)
