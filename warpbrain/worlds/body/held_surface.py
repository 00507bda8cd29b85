"""A held surface at a state, patches of which are released: each costs a dense solution of its size.

The free components are eliminated once: with `h` the nodes of the surface and `f` what is free,

    S = K_hh - K_hf K_ff^-1 K_fh

is its stiffness. A patch moves by `-S^-1 R` along the wall, `R` its reactions; nodes that can lift off also leave the
wall where they are under tension, by an active set (Wriggers, Computational Contact Mechanics, 2nd ed., section 5.3.1).
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.errors import SolveError
from warpbrain.mesh import tangents
from warpbrain.worlds.body.factors import Factors
from warpbrain.worlds.body.sensors import Sensors

#: Changes of the active set at most.
_CHANGES = 20
#: Displacement, relative to the size of the body, above which too little holds it for a linear solution.
_FARTHEST = 0.2


class HeldSurface:
    """A set of held nodes at a state.

    `stiffness`: SciPy CSR (3 N, 3 N) [N/m], whose `free` components (3 N,) have `factors`. `reactions` (N, 3) [N].
    `members` (N,): nodes, all of whose components are held. `normals` (N, 3): outward. `size`: of the body [m].
    """

    def __init__(
        self,
        stiffness: Any,
        free: Bools,
        factors: Factors,
        reactions: Floats,
        members: Bools,
        normals: Floats,
        size: float,
    ) -> None:
        self._stiffness, self._free = stiffness, free
        self.members = np.flatnonzero(members)
        self._farthest = _FARTHEST * size
        count = len(self.members)
        components = np.repeat(members, 3)
        coupling = stiffness[free][:, components].tocsc()
        condensed = np.asarray(stiffness[components][:, components].todense())
        condensed -= factors.solve(coupling, left=stiffness[components][:, free])
        # beside a pressure that follows its surface it is not symmetric, and Cholesky's method reads one half of it,
        # which is another one in other axes
        condensed = 0.5 * (condensed + condensed.T)
        self._coupling = coupling
        # two tangents and the normal
        tangent_vectors = tangents(normals[self.members])
        self._frames = np.concatenate([tangent_vectors, normals[self.members][:, None]], axis=1)
        rotated = np.einsum("aki,aibj,blj->akbl", self._frames, condensed.reshape(count, 3, count, 3), self._frames)
        self._S = rotated.reshape(3 * count, 3 * count)
        self._R = np.einsum("aki,ai->ak", self._frames, reactions[self.members])
        self._released: dict[tuple[bytes, bool], Floats] = {}

    def with_further(self, reactions: Floats) -> HeldSurface:
        """The same with further reactions (N, 3) [N]."""
        other = copy.copy(self)
        other._R = self._R + np.einsum("aki,ai->ak", self._frames, reactions[self.members])
        other._released = {}
        return other

    def answers(self, sensors: Sensors, rows: Floats, which: Ints) -> Floats:
        """What sensors (n,) record where each component of `moved` is 1 m: (n, 3 m).

        `rows`, `which`: distinct ones of their responses to forces (k, 3 N), and the number of its row for each sensor.
        """
        free = self._free
        components = (3 * self.members[:, None] + np.arange(3)).ravel()
        held = sensors.by_reactions[:, ~free] @ self._stiffness[~free][:, components]
        direct = np.asarray((sensors.by_displacement[:, components] + held).todense())
        direct -= (self._coupling.T @ rows.T[free]).T[which]
        along = np.einsum("naj,akj->nak", direct.reshape(len(direct), -1, 3), self._frames)
        return np.asarray(along).reshape(direct.shape)

    def moved(self, patch: Bools, lifts: bool) -> Floats:
        """Displacement (3 m,) [m] of its nodes, along two tangents and the normal of each, where a patch lets go.

        `patch` (N,). `SolveError` if too little holds the body without the patch.
        """
        members = patch[self.members]
        key = members.tobytes(), lifts
        if key not in self._released:
            self._released[key] = self._release(members, lifts)
        return self._released[key]

    def _release(self, members: Bools, lifts: bool) -> Floats:
        """Displacement (3 m,) of the nodes where some (m,) let go, their motion along the wall eliminated first."""
        from scipy.linalg import cho_factor, cho_solve

        count = int(members.sum())
        nodes = 3 * np.flatnonzero(members)
        along, normal = np.sort(np.concatenate([nodes, nodes + 1])), nodes + 2
        coupling, R = self._S[np.ix_(normal, along)], self._R.ravel()
        displacement = np.zeros(len(R))
        try:
            factor = cho_factor(self._S[np.ix_(along, along)], check_finite=False)
            sliding = -cho_solve(factor, R[along], check_finite=False)
            displacement[along] = sliding
            if lifts:
                by_normal = cho_solve(factor, coupling.T, check_finite=False)
                stiffness = self._S[np.ix_(normal, normal)] - coupling @ by_normal
                lifted = self._lifted(stiffness, R[normal] + coupling @ sliding, R[normal] > 0.0)
                displacement[normal], displacement[along] = lifted, sliding - by_normal @ lifted
        except np.linalg.LinAlgError:
            displacement[normal] = np.inf
        if not np.linalg.norm(displacement.reshape(-1, 3), axis=1).max() < self._farthest:
            raise SolveError(f"letting go of {count} nodes: no equilibrium is near")
        return displacement

    @staticmethod
    def _lifted(S: Floats, R: Floats, off: Bools) -> Floats:
        """Displacement (k,) along the normals of nodes that leave the wall where they are under tension.

        `S` (k, k): stiffness of their motion along the normals, that along the wall eliminated. `R` (k,): reactions
        along the normals. `off` (k,): those that are off at first.
        """
        from scipy.linalg import cho_factor, cho_solve

        for _ in range(_CHANGES):
            lifted = np.zeros(len(R))
            if off.any():
                factor = cho_factor(S[np.ix_(off, off)], check_finite=False)
                lifted[off] = -cho_solve(factor, R[off], check_finite=False)
            under_tension = R + S @ lifted > 0.0
            changed = np.where(off, lifted < 0.0, under_tension)
            if np.array_equal(changed, off):
                break
            off = changed
        return lifted
