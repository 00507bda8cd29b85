"""A case about one state: the response of the sensors to a small force anywhere, and to held nodes that are released.

At an equilibrium `u` with tangent stiffness `K`, a further nodal force `g` moves the free components by `K^-1 g` and
changes the reactions of the held ones by `K_cf K_ff^-1 g_f - g_c`. Of the sensors `H` only

    A = [ (H_u + H_R K_cf) K_ff^-1 ,  -H_R ]

is needed, one right-hand side a sensor; after that each cause costs a product with `A`. Sparse factors of 5,000 nodes
take a fifth of a second, and 100 right-hand sides half of that.
"""

from __future__ import annotations

import copy
import itertools
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.mesh import TetMesh, vertex_normals
from warpbrain.mesh.quality import extent
from warpbrain.physics.mechanism import Mechanism
from warpbrain.simulation.multisecant import toward_equilibrium
from warpbrain.simulation.system import System
from warpbrain.threads import fill_columns, in_threads
from warpbrain.worlds.body.creep import Creep, CreepFactors, Perturbation
from warpbrain.worlds.body.factors import Factors
from warpbrain.worlds.body.held_surface import HeldSurface
from warpbrain.worlds.body.sensors import Sensors

#: Growth by which the derivative of the forces of growing tissue is taken.
_GROWTH = 1e-4
#: Columns that one thread computes at a time at most: of dense forces, of which products with fewer spend most of their
#: time on copies of the compliance, and of sparse ones; few of these are in so many parts.
_TOGETHER, _TOGETHER_SPARSE, _PARTS = 256, 128, 16
#: Part of sparse forces that is not zero above which a dense product is faster.
_DENSE = 0.1


@dataclass(frozen=True, kw_only=True)
class _Grown(Mechanism):
    """Uniform growth of all tissue."""

    relative: float
    kind: ClassVar[str] = "growth"
    sentence: ClassVar[str] = "All tissue is larger."

    def growth(self, mesh: TetMesh, scale: float) -> Floats:
        """See `warpbrain.physics.mechanism.Growing`."""
        return np.full(len(mesh.tetrahedra), scale * self.relative)


@dataclass(frozen=True, eq=False)
class Moment:
    """Rows that are compared with, or counted from, the state of one time."""

    number: int  # of the time; -1 of the only state
    time: float  # of the state [s]; infinite of the only one, the end
    at: Linearisation  # about that state, of these rows
    rows: Ints  # (k,)
    times: Floats  # (k,), of these rows [s]
    sign: float  # -1 if they are counted from it
    creep: CreepFactors


class Linearisation:
    """A state of a system, and the response of the sensors to forces there.

    `u`, `reactions` (N, 3): an equilibrium of it [m], [N]. `sensors`: at that state.
    """

    def __init__(self, system: System, u: Floats, reactions: Floats, sensors: Sensors) -> None:
        self.system = system
        self.u = u
        self.reactions = reactions
        self.sensors = sensors
        # held surfaces of the state, and the responses of its sensors to each
        self._surfaces: dict[bytes, HeldSurface] = {}
        self._surface_responses: dict[bytes, Floats] = {}
        # patches of one surface are computed in several threads
        self._surface_lock = threading.Lock()
        # forces whose response was computed by an equilibrium each so far
        self._equilibria = 0
        # time, linear model and share of the end of each state, where several count
        self._states: tuple[tuple[float, Linearisation, float], ...] = ()
        # where the state is the end of a course, which was followed to it
        self._creep: Creep | None = None
        system.u.assign(u)
        S, skew = system.stiffness().tocsr(), system.skew_stiffness()
        free = ~system.model.constrained.ravel()
        #: `K` [N/m] on every component, SciPy CSR (3 N, 3 N). Without its skew part the response to 1.5 kPa on the wall
        #: of a cavity is an eighth off.
        self.stiffness: Any = S if skew is None else (S + skew).tocsr()
        #: Components (3 N,) that nothing holds.
        self.free: Bools = free
        self._held_free = self.stiffness[~free][:, free]
        self.factors = Factors(S[free][:, free], system.device, None if skew is None else skew.tocsr()[free][:, free])

    def in_time(self, states: Sequence[tuple[float, Linearisation, float]]) -> Linearisation:
        """The same, where rows are of states at several times or are counted from one.

        `states`: of each time [s] that time, the linear model about its state, and the part of the last state that it
        is.
        """
        return self._with(_states=tuple(states))

    def after(self, creep: Creep) -> Linearisation:
        """The same where the state is the end of a course over time, on which rows were recorded."""
        return self._with(_creep=creep)

    def _with(self, **changed: Any) -> Linearisation:
        other = copy.copy(self)
        other.__dict__.update(changed)
        other.__dict__.pop("_moments", None)
        return other

    @property
    def moments(self) -> tuple[Moment, ...]:
        """By the time of the state; one where all rows are of one state, counted from rest."""
        sensors = self.sensors
        # not kept: a model that knows itself would keep its factors
        every, factors = np.arange(len(sensors)), CreepFactors.none(len(sensors))
        return self._moments or (Moment(-1, math.inf, self, every, sensors.times, 1.0, factors),)

    @property
    def is_at_one_time(self) -> bool:
        """Whether all rows are of one state, without creep."""
        return not self._moments

    @cached_property
    def _moments(self) -> tuple[Moment, ...]:
        """Where there are several states, or it was followed over time; else none."""
        sensors, moments = self.sensors, []
        if self._creep is not None and not self._states:
            factors, every = self._creep_factors(sensors.after), np.arange(len(sensors))
            return (Moment(-1, math.inf, self._with(_creep=None), every, sensors.times, 1.0, factors),)
        for number, (time, about, share) in enumerate(self._states):
            last = number == len(self._states) - 1
            for sign, of_rows in ((1.0, sensors.after), (-1.0, sensors.before)):
                rows = np.flatnonzero((of_rows == number) | (last and sign > 0.0 and of_rows < 0))
                if len(rows):
                    model = about.with_sensors(replace(sensors.of_rows(rows, time), share=share))
                    times = np.full(len(rows), time)
                    single = model._with(_states=(), _creep=None)
                    factors = CreepFactors(*(each[rows] for each in self._creep_factors(of_rows)))
                    moments.append(Moment(number, time, single, rows, times, sign, factors))
        return tuple(moments)

    def _creep_factors(self, numbers: Ints) -> CreepFactors:
        """Of all rows at times of these numbers (n,)."""
        if self._creep is None:
            return CreepFactors.none(len(numbers))
        return self._creep.factors(numbers, self.sensors.is_displacement)

    def summed(self, answer: Callable[[Moment], Floats], perturbation: Perturbation) -> Floats:
        """Response of each row (n, ...) to a perturbation: at its time, less at that from which it is counted.

        `answer`: from the state of one time to the response of the rows of that.
        """
        answers = [(moment, answer(moment)) for moment in self.moments]
        total = np.zeros((len(self.sensors), *answers[0][1].shape[1:]))
        for moment, of_rows in answers:
            factors = moment.sign * moment.creep.of(perturbation)
            total[moment.rows] += factors.reshape(-1, *[1] * (of_rows.ndim - 1)) * of_rows
        return total

    def with_sensors(self, sensors: Sensors) -> Linearisation:
        """The same state with other sensors, without factorising again."""
        other = self._with(sensors=sensors, _surface_responses={}, _equilibria=0)
        other.__dict__.pop("_rows", None)
        return other

    @cached_property
    def extent(self) -> float:
        """Of the body [m]; see `warpbrain.mesh.quality`."""
        return extent(self.system.model.mesh.points)

    @cached_property
    def _rows(self) -> tuple[Floats, NDArray[np.intp]]:
        """Distinct rows of `A`, and the number of its row for each sensor (n,): several times share one row.

        Made when they are needed: for few forces equilibria are cheaper.
        """
        free, sensors = self.free, self.sensors
        by_R = sensors.by_reactions[:, ~free]
        moved = (sensors.by_displacement[:, free] + by_R @ self._held_free).tocsr()
        held = -np.asarray(by_R.todense())
        rng = np.random.default_rng(0)
        mark = moved @ rng.normal(size=moved.shape[1]) + held @ rng.normal(size=held.shape[1])
        _, different, which = np.unique(mark, return_index=True, return_inverse=True)
        # Fortran order: products with sparse forces then need no copy
        A = np.empty((len(different), len(free)), order="F")
        A[:, free] = self.factors.solve(moved[different].T, transposed=True).T
        A[:, ~free] = held[different]
        return A, which.ravel()

    def released(self, patch: Bools, held: Bools, lifts: bool, further: Floats | None = None) -> Floats:
        """Change (n,) of what is recorded if held nodes are released, to first order.

        They slide along the surface; where they are under tension they also leave it, if they can.

        `patch` (N,). `held` (N,): the surface that the patch is a part of, all of whose components are held. `further`
        (N, 3): reactions [N] beside those of the state, as of `reactions_to`. `SolveError` if too little holds the body
        without the patch.
        """
        with self._surface_lock:
            surface, responses = self._surface(held)
        moved = (surface if further is None else surface.with_further(further)).moved(patch, lifts)
        loose = np.flatnonzero(moved)
        return np.asarray(responses[:, loose] @ moved[loose])

    def _surface(self, held: Bools) -> tuple[HeldSurface, Floats]:
        """A held surface, and the responses (n, 3 m) of the sensors to it, made once."""
        key = held.tobytes()
        if key not in self._surfaces:
            normals = vertex_normals(self.system.model.mesh)
            self._surfaces[key] = HeldSurface(
                self.stiffness, self.free, self.factors, self.reactions, held, normals, self.extent
            )
        if key not in self._surface_responses:
            # Fortran order: of each patch a few columns are used
            self._surface_responses[key] = np.asfortranarray(self._surfaces[key].answers(self.sensors, *self._rows))
        return self._surfaces[key], self._surface_responses[key]

    def answers(self, forces: Floats) -> Floats:
        """Response (n, ...) of the sensors to nodal forces (..., N, 3) [N]."""
        flat = np.asarray(forces).reshape(-1, len(self.free))
        return self.answers_of_columns(flat.T).reshape(len(self.sensors), *np.shape(forces)[:-2])

    def answers_of_patches(self, weights: Floats, directions: Sequence[int] = (0, 1, 2)) -> Floats:
        """Response (n, s, d) to forces of 1 N in each of d directions, spread over nodes with weights (N, s)."""
        rows, which = self._rows
        answers = np.empty((len(directions), weights.shape[1], len(rows)))
        together = _dense_together(weights.shape[1])

        def fill(task: tuple[int, int]) -> None:
            number, first = task
            columns = slice(first, first + together)
            answers[number, columns] = (rows[:, directions[number] :: 3] @ weights[:, columns]).T

        in_threads(fill, list(itertools.product(range(len(directions)), range(0, weights.shape[1], together))))
        return np.asarray(answers.transpose(2, 1, 0)[which])

    def answers_of_columns(self, forces: Any) -> Floats:
        """Response (n, k) to forces (3 N, k), an array or SciPy CSC.

        By equilibria until these are as many as the compliance takes, then by that.
        """
        from scipy.sparse import issparse

        count = forces.shape[1]
        if self._are_by_compliance(count):
            rows, which = self._rows
            answers = np.empty((len(rows), count))
            if issparse(forces) and forces.nnz > _DENSE * np.prod(forces.shape):
                forces = forces.toarray()
            together = min(_TOGETHER_SPARSE, 1 + count // _PARTS) if issparse(forces) else _dense_together(count)
            fill_columns(answers, lambda columns: rows @ forces[:, columns], together)
            return answers[which]
        return self._by_equilibria(forces.toarray() if issparse(forces) else forces)

    def _by_equilibria(self, forces: Floats) -> Floats:
        """Response (n, k) to forces (3 N, k), without the compliance."""
        du = self.displacements(forces)
        answers = np.asarray(self.sensors.by_displacement @ du)
        if self.sensors.by_reactions.nnz:
            answers += self.sensors.by_reactions @ self._reactions_at(du, forces)
        return answers

    def _are_by_compliance(self, count: int) -> bool:
        """Whether responses to so many further forces are by the compliance."""
        self._equilibria += count
        return "_rows" in self.__dict__ or self._equilibria >= len(self.sensors)

    def reactions_to(self, forces: Floats) -> Floats:
        """Reactions (N, 3) [N] to further nodal forces (N, 3) [N], to first order."""
        flat = forces.reshape(-1, 1)
        return self._reactions_at(self.displacements(flat), flat).reshape(forces.shape)

    def _reactions_at(self, du: Floats, forces: Floats) -> Floats:
        """Change of reactions (3 N, k) [N] with displacements (3 N, k) [m] under forces (3 N, k) [N]; 0 where free."""
        return np.where(self.free[:, None], 0.0, self.stiffness @ du - forces)

    def displacements(self, forces: Floats) -> Floats:
        """Of all components (3 N, k) [m] under nodal forces (3 N, k) [N]."""
        du = np.zeros(forces.shape)
        du[self.free] = self.factors.solve(forces[self.free])
        return du

    def toward_equilibrium(self, system: System, external: Floats, start: Floats, tolerance: float) -> Floats:
        """A displacement (N, 3) [m] nearer to an equilibrium of a system that is held at the same nodes.

        See `warpbrain.simulation.multisecant`; the start itself where other nodes are held.
        """
        if not np.array_equal(system.model.constrained.ravel(), ~self.free):
            return start
        solve = self.displacements
        return toward_equilibrium(system, external, start, lambda r: solve(r.reshape(-1, 1)).reshape(-1, 3), tolerance)

    def answers_of_elements(self, element_forces: Any, weights: Any) -> Floats:
        """Response (n, k) to internal forces of elements [N], SciPy sparse (3 N, m), times weights (m, k).

        Weights are an array, or SciPy CSC where most of them are zero.
        """
        return -self.answers_of_columns(element_forces @ weights)

    def answers_of_components(self, element_forces: Floats, weights: Floats) -> Floats:
        """Response (n, c, k) to components (c, m, 4, 3) of internal forces [N] on corners times weights (m, k) each."""
        elements, count = np.arange(len(weights)), weights.shape[1]
        shape = self.system.size, len(elements)
        components = [gathered(self.system.tetrahedra, each, elements, shape) for each in element_forces]
        if not self._are_by_compliance(len(components) * count):
            columns = [self._by_equilibria(-(component @ weights)) for component in components]
            return np.stack(columns, axis=1)
        rows, which = self._rows
        answers = np.empty((len(rows), len(components), count))
        together = max(_TOGETHER // len(components), 1)

        def fill(first: int) -> None:
            some = slice(first, first + together)
            forces = np.concatenate([component @ weights[:, some] for component in components], axis=1)
            answers[:, :, some] = -(rows @ forces).reshape(len(rows), len(components), -1)

        in_threads(fill, range(0, count, together))
        return answers[which]

    @cached_property
    def element_forces(self) -> Any:
        """Internal forces [N], SciPy CSR (3 N, m), of elements in proportion to moduli: of laws, fibres, viscosity."""
        return _element_forces(self.system, self.u, self.system.stiffness_factors, of_moduli=True)

    @cached_property
    def growth_forces(self) -> Any:
        """Their derivative, SciPy CSR (3 N, m), by a relative growth of volume of each element."""
        sides = []
        for amount in (-_GROWTH, _GROWTH):
            model = self.system.model
            grown = replace(model, mechanisms=(*model.mechanisms, _Grown(relative=amount)))
            grown_system = System(grown, str(self.system.device), self.system.precision.name)
            grown_system.remember_as(self.system)
            # laws of averaged elements have the mean growth of these
            sides.append(_element_forces(grown_system, self.u, np.ones(grown_system.elements)))
        return (sides[1] - sides[0]) / (2.0 * _GROWTH)

    def internal_forces(self, system: System | None = None) -> Floats:
        """Internal forces (N, 3) [N] at the state, of this system or of another with the same nodes."""
        other = self.system if system is None else system
        other.u.assign(self.u)
        return other.internal_forces()


def _dense_together(count: int) -> int:
    """How many of so many columns of dense forces are computed at a time: no more than half of them, for two threads.

    The same for any number of threads: bits of a product may depend on it.
    """
    parts = max(-(-count // _TOGETHER), 2)
    return max(-(-count // parts), 1)


def _element_forces(system: System, u: Floats, weights: Floats, of_moduli: bool = False) -> Any:
    """Internal forces [N], SciPy CSR (3 N, m), of the tissue of a system; `of_moduli`: those in proportion to moduli.

    Of averaged elements the forces of a patch are shared by its elements, by their volumes there times `weights` (m,).
    """
    system.u.assign(u)
    system.evaluate_forces()
    forces = system.element_forces.numpy().astype(np.float64)
    for term in system.terms:
        if term.elements is not None and (term.of_moduli or not of_moduli):
            forces[term.elements] += term.forces.numpy()
    shape = system.size, system.elements
    total = gathered(system.tetrahedra, forces, np.arange(system.elements), shape)
    for averaged in (term for group in system.groups for term in group.averaged):
        elements, patches, shares = averaged.shares(weights)
        patch_forces = averaged.forces.numpy().astype(np.float64)
        of_patches = shares[:, None, None] * patch_forces[patches]
        total = total + gathered(averaged.stencils[patches], of_patches, elements, shape)
    return total.tocsr()


def gathered(nodes: NDArray[np.integer], forces: Floats, elements: NDArray[np.integer], shape: tuple[int, int]) -> Any:
    """Forces (k, s, 3) on nodes (k, s) of elements (k,) as SciPy CSR (3 N, m); `shape`: N and m."""
    from scipy.sparse import csr_matrix

    rows = (3 * nodes[:, :, None] + np.arange(3)).ravel()
    columns = np.repeat(elements, 3 * nodes.shape[1])
    return csr_matrix((forces.ravel(), (rows, columns)), (3 * shape[0], shape[1]))
