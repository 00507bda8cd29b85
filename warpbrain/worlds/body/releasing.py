"""Held nodes that are released, to first order: each patch of a held surface costs a dense solution of its size.

The free components are eliminated once: with `h` the nodes of a held surface and `f` what is free,

    S = K_hh - K_hf K_ff^-1 K_fh

is the stiffness of the surface. A released patch moves by `-S^-1 R` along the wall, `R` its reactions; nodes that can
lift off also leave the wall where they are under tension, by an active set (Wriggers, Computational Contact Mechanics,
2nd ed., section 5.3.1).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import SolveError
from warpbrain.mesh import tangents
from warpbrain.worlds.body.factors import Factors

#: Changes of the active set at most.
_CHANGES = 20
#: Displacement, relative to the size of the body, above which too little holds it for a linear solution.
_FARTHEST = 0.2


class HeldSurface:
    """A set of held nodes at a state.

    Parameters
    ----------
    stiffness : SciPy CSR (3 N, 3 N)
        `K` [N/m].
    free : (3 N,) bool array
        Components that nothing holds.
    factors : Factors
        Of the free part of `K`.
    members : (N,) bool array
        Nodes, all of whose components are held.
    normals, reactions : (N, 3) array
        Outward, and what the nodes are held with [N].
    size : float
        Of the body [m].
    """

    def __init__(
        self,
        stiffness: Any,
        free: Bools,
        factors: Factors,
        members: Bools,
        normals: Floats,
        reactions: Floats,
        size: float,
    ) -> None:
        self.members = np.flatnonzero(members)
        self._farthest = _FARTHEST * size
        count = len(self.members)
        components = np.repeat(members, 3)
        coupling = stiffness[free][:, components].tocsc()
        condensed = np.asarray(stiffness[components][:, components].todense())
        condensed -= factors.between(stiffness[components][:, free], coupling)
        self._coupling = coupling
        # two tangents and the normal
        tangent_vectors = tangents(normals[self.members])
        self._frames = np.concatenate([tangent_vectors, normals[self.members][:, None]], axis=1)
        rotated = np.einsum("aki,aibj,blj->akbl", self._frames, condensed.reshape(count, 3, count, 3), self._frames)
        self._S = rotated.reshape(3 * count, 3 * count)
        self._R = np.einsum("aki,ai->ak", self._frames, reactions[self.members])
        self._released: dict[tuple[bytes, bool], Floats] = {}

    def answers(
        self, stiffness: Any, free: Bools, compliance: Floats, by_displacement: Any, by_reactions: Any
    ) -> Floats:
        """What sensors (n,) record where each component of `moved` is 1 m: (n, 3 m).

        Parameters
        ----------
        stiffness, free :
            Those that it was made of.
        compliance : (n, 3 N) array
            Of the sensors, see `Linearisation.compliance`.
        by_displacement, by_reactions : SciPy CSR (n, 3 N)
        """
        components = (3 * self.members[:, None] + np.arange(3)).ravel()
        held = by_reactions[:, ~free] @ stiffness[~free][:, components]
        direct = (
            np.asarray((by_displacement[:, components] + held).todense()) - (self._coupling.T @ compliance[:, free].T).T
        )
        return np.asarray(np.einsum("naj,akj->nak", direct.reshape(len(direct), -1, 3), self._frames)).reshape(
            direct.shape
        )

    def moved(self, patch: Bools, lifts: bool) -> Floats:
        """Displacement (3 m,) [m] of its nodes, along two tangents and the normal of each, where a patch lets go.

        Parameters
        ----------
        patch : (N,) bool array
        lifts : bool

        Raises
        ------
        SolveError
            If too little holds the body without the patch.
        """
        members = patch[self.members]
        key = members.tobytes(), lifts
        if key not in self._released:
            self._released[key] = self._release(members, lifts)
        return self._released[key]

    def _release(self, members: Bools, lifts: bool) -> Floats:
        pull = self._R[:, 2]
        off = members & (pull > 0.0) & lifts
        for _ in range(_CHANGES):
            moved = self._displacement(np.column_stack([members, members, off]))
            if not lifts:
                break
            pull = self._R[:, 2] + (self._S[2::3] @ moved)
            changed = members & np.where(off, moved[2::3] < 0.0, pull > 0.0)
            if np.array_equal(changed, off):
                break
            off = changed
        return moved

    def _displacement(self, loose: Bools) -> Floats:
        from scipy.linalg import cho_factor, cho_solve

        numbers = np.flatnonzero(loose.ravel())
        displacement = np.zeros(loose.size)
        try:
            factor = cho_factor(self._S[np.ix_(numbers, numbers)], check_finite=False)
            displacement[numbers] = cho_solve(factor, -self._R.ravel()[numbers], check_finite=False)
        except np.linalg.LinAlgError:
            displacement[numbers] = np.inf
        if not np.abs(displacement).max() < self._farthest:
            raise SolveError(f"letting go of {int(loose[:, 0].sum())} nodes: no equilibrium is near")
        return displacement
