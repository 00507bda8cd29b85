"""A case about one state: what a small force anywhere does to what was recorded.

At an equilibrium `u` with tangent stiffness `K`, a nodal force `g` beside the loads moves the free components by
`K^-1 g` and changes the reactions of the held ones by `K_cf K_ff^-1 g_f - g_c`. Of the sensors `H` only

    A = [ (H_u + H_R K_cf) K_ff^-1 ,  -H_R ]

is needed, one right-hand side a sensor; whatever is looked for costs a product with `A` after that. SciPy's LU has
the factors of 5,000 nodes in a second, and 100 right-hand sides in another; block conjugate gradients take ten times
as long for as many as there are sensors.
"""

from __future__ import annotations

import copy
import itertools
import threading
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from warpbrain.mesh import TetMesh, vertex_normals
from warpbrain.physics.mechanism import Mechanism
from warpbrain.simulation.chord import toward_equilibrium
from warpbrain.simulation.system import System
from warpbrain.threads import fill_columns, in_threads
from warpbrain.worlds.body.factors import Factors
from warpbrain.worlds.body.releasing import HeldSurface
from warpbrain.worlds.body.sensors import Sensors

Floats = NDArray[np.float64]

#: Growth by which the derivative of the forces of growing tissue is taken.
_GROWTH = 1e-4
#: Patches whose answers one thread makes, and sparse columns of forces: of some mechanisms no node is without any.
_TOGETHER, _TOGETHER_SPARSE = 64, 8


@dataclass(frozen=True, kw_only=True)
class _Grown(Mechanism):
    """Tissue that is larger everywhere."""

    relative: float
    kind: ClassVar[str] = "growth"
    sentence: ClassVar[str] = "All tissue is larger."

    def growth(self, mesh: TetMesh, scale: float) -> Floats:
        """See `warpbrain.physics.mechanism.Growing`."""
        return np.full(len(mesh.tetrahedra), scale * self.relative)


class Linearisation:
    """A state of a system, and how the sensors answer to forces there.

    Parameters
    ----------
    system : System
    u, reactions : (N, 3) array
        An equilibrium of it [m], [N].
    sensors : Sensors
        At that state.
    """

    def __init__(self, system: System, u: Floats, reactions: Floats, sensors: Sensors) -> None:
        self.system = system
        self.u = u
        self.reactions = reactions
        self.sensors = sensors
        # held surfaces of the state, and what its sensors record of each
        self._surfaces: dict[bytes, HeldSurface] = {}
        self._of_surfaces: dict[bytes, Floats] = {}
        # threads ask for patches of one surface
        self._making = threading.Lock()
        # forces that were answered one by one so far
        self._answered = 0
        self._factorise()

    def _factorise(self) -> None:
        system = self.system
        system.u.assign(self.u)
        K = system.stiffness().tocsr()
        skew = system.skew_stiffness()
        # without it what 1.5 kPa on the wall of a cavity do beside each other is an eighth off
        K = K if skew is None else (K + skew).tocsr()
        free = ~system.model.constrained.ravel()
        #: `K` [N/m] on every component, SciPy CSR (3 N, 3 N).
        self.stiffness: Any = K
        self._free, self._held_free = free, K[~free][:, free]
        # factors on a GPU are Cholesky's
        self._factors = Factors(K[free][:, free], system.device if skew is None else None, symmetric=skew is None)

    def with_sensors(self, sensors: Sensors) -> Linearisation:
        """The same state with other sensors; nothing is factorised again."""
        other = copy.copy(self)
        other.sensors = sensors
        other._of_surfaces, other._answered = {}, 0
        for made in ("compliance", "_rows"):
            other.__dict__.pop(made, None)
        return other

    @cached_property
    def compliance(self) -> Floats:
        """`A` (n, 3 N): made when it is needed, since few forces are answered sooner without it."""
        rows, which = self._rows
        return np.asarray(rows[which])

    @cached_property
    def _rows(self) -> tuple[Floats, NDArray[np.intp]]:
        """Rows of `A` that differ, and which of them (n,) is whose: what was recorded at several times is one row."""
        free, sensors = self._free, self.sensors
        by_R = sensors.by_reactions[:, ~free]
        moved = (sensors.by_displacement[:, free] + by_R @ self._held_free).tocsr()
        held = -np.asarray(by_R.todense())
        rng = np.random.default_rng(0)
        mark = moved @ rng.normal(size=moved.shape[1]) + held @ rng.normal(size=held.shape[1])
        _, different, which = np.unique(mark, return_index=True, return_inverse=True)
        # by columns: products with sparse forces then need no copy of it
        A = np.empty((len(different), len(free)), order="F")
        A[:, free] = self._factors.solve(moved[different].T, transposed=True).T
        A[:, ~free] = held[different]
        return A, which.ravel()

    def released(self, patch: NDArray[np.bool_], held: NDArray[np.bool_], lifts: bool) -> Floats:
        """What is recorded where held nodes let go, to first order: (n,).

        They slide along the surface; where the skull pulls at them they also leave it, if they can.

        Parameters
        ----------
        patch : (N,) bool array
        held : (N,) bool array
            The surface that the patch is a part of, all of whose components are held.
        lifts : bool

        Raises
        ------
        SolveError
            If too little holds the body without the patch.
        """
        key = held.tobytes()
        with self._making:
            surface = self._surface(key, held)
        moved = surface.moved(patch, lifts)
        loose = np.flatnonzero(moved)
        return np.asarray(self._of_surfaces[key][:, loose] @ moved[loose])

    def _surface(self, key: bytes, held: NDArray[np.bool_]) -> HeldSurface:
        """A held surface, and what the sensors record of it: made once."""
        if key not in self._surfaces:
            mesh = self.system.model.mesh
            self._surfaces[key] = HeldSurface(
                self.stiffness,
                self._free,
                self._factors,
                held,
                vertex_normals(mesh),
                self.reactions,
                float(np.linalg.norm(np.ptp(mesh.points, axis=0))),
            )
        if key not in self._of_surfaces:
            sensors = self.sensors
            answers = self._surfaces[key].answers(
                self.stiffness, self._free, self.compliance, sensors.by_displacement, sensors.by_reactions
            )
            # by columns: of each patch a few are asked for
            self._of_surfaces[key] = np.asfortranarray(answers)
        return self._surfaces[key]

    def answers(self, forces: Floats) -> Floats:
        """What nodal forces (..., N, 3) [N] change of what is recorded: (n, ...)."""
        flat = np.asarray(forces).reshape(-1, len(self._free))
        return self._answers(flat.T).reshape(len(self.sensors), *np.shape(forces)[:-2])

    def answers_of_patches(self, weights: Floats) -> Floats:
        """What forces of 1 N in each direction, spread over nodes with weights (N, s), change: (n, s, 3)."""
        rows, which = self._rows
        found = np.empty((3, weights.shape[1], len(rows)))

        def fill(part: tuple[int, int]) -> None:
            axis, first = part
            some = slice(first, first + _TOGETHER)
            found[axis, some] = (rows[:, axis::3] @ weights[:, some]).T

        in_threads(fill, list(itertools.product(range(3), range(0, weights.shape[1], _TOGETHER))))
        return np.asarray(found.transpose(2, 1, 0)[which])

    def answers_of_columns(self, forces: Any) -> Floats:
        """The same of forces that act here and there, SciPy CSC (3 N, k): (n, k)."""
        return self._answers(forces)

    def _answers(self, forces: Any) -> Floats:
        """What forces (3 N, k) change: by the compliance, or by equilibria until these are as many as it takes."""
        from scipy.sparse import issparse

        count = forces.shape[1]
        self._answered += count
        if "_rows" in self.__dict__ or self._answered >= len(self.sensors):
            rows, which = self._rows
            found = np.empty((len(rows), count))
            together = _TOGETHER_SPARSE if issparse(forces) else _TOGETHER
            fill_columns(found, lambda some: rows @ forces[:, some], together)
            return found[which]
        forces = forces.toarray() if issparse(forces) else forces
        du = self.displacements(forces)
        dR = np.where(self._free[:, None], 0.0, self.stiffness @ du - forces)
        return np.asarray(self.sensors.by_displacement @ du + self.sensors.by_reactions @ dR)

    def displacements(self, forces: Floats) -> Floats:
        """Of all components (3 N, k) [m] under nodal forces (3 N, k) [N]."""
        du = np.zeros(forces.shape)
        du[self._free] = self._factors.solve(forces[self._free])
        return du

    def toward_equilibrium(self, system: System, external: Floats, start: Floats, tolerance: float) -> Floats:
        """A displacement (N, 3) [m] nearer to an equilibrium of a system that is held at the same nodes.

        See `warpbrain.simulation.chord`; the start itself where other nodes are held.
        """
        if not np.array_equal(system.model.constrained.ravel(), ~self._free):
            return start
        solve = self.displacements
        return toward_equilibrium(system, external, start, lambda r: solve(r.reshape(-1, 1)).reshape(-1, 3), tolerance)

    def answers_of_elements(self, element_forces: Floats, weights: Any) -> Floats:
        """What internal forces of elements (m, 4, 3) [N], times weights (m, k), change: (n, k).

        Weights are an array, or SciPy CSC where most of them are zero.
        """
        from scipy.sparse import csr_matrix

        nodes = self.system.tetrahedra
        elements = len(nodes)
        rows = (3 * nodes[:, :, None] + np.arange(3)).ravel()
        columns = np.repeat(np.arange(elements), 12)
        gather: Any = csr_matrix((element_forces.ravel(), (rows, columns)), (len(self._free), elements))
        return -self._answers(gather @ weights)

    @cached_property
    def element_forces(self) -> Floats:
        """Internal forces (m, 4, 3) [N] of the elements that go with their moduli: of laws, fibres and viscosity."""
        return _element_forces(self.system, self.u, of_moduli=True)

    @cached_property
    def growth_forces(self) -> Floats:
        """Their derivative (m, 4, 3) [N] by a relative growth of volume of each element."""
        from dataclasses import replace

        sides = []
        for amount in (-_GROWTH, _GROWTH):
            model = self.system.model
            grown = replace(model, mechanisms=(*model.mechanisms, _Grown(relative=amount)))
            beside = System(grown, str(self.system.device), self.system.precision.name)
            beside.remember_as(self.system)
            sides.append(_element_forces(beside, self.u))
        return (sides[1] - sides[0]) / (2.0 * _GROWTH)

    def internal_forces(self, system: System | None = None) -> Floats:
        """Internal forces (N, 3) [N] at the state, of this system or of another with the same nodes."""
        asked = self.system if system is None else system
        asked.u.assign(self.u)
        asked.evaluate_forces()
        asked.gather_forces()
        return np.asarray(asked.internal.numpy().astype(np.float64))


def _element_forces(system: System, u: Floats, of_moduli: bool = False) -> Floats:
    """Internal forces (m, 4, 3) [N] of the tissue of a system at a displacement; of its moduli alone, if asked."""
    system.u.assign(u)
    system.evaluate_forces()
    found = system.element_forces.numpy().astype(np.float64)
    for term in system.terms:
        if term.elements is not None and (term.of_moduli or not of_moduli):
            found[term.elements] += term.forces.numpy()
    return np.asarray(found)
