"""What cannot be told apart, what is too small to be seen, and what to measure next.

A mechanism `m` with its effect `g` on the sensors is told from `m'` by the expected log Bayes factor over the best
imitation that `m'` can make, its place and size free:

    D = 1/2 ( |g|^2 - max |P_m' g|^2 )        in the metric S^-1, noise and nuisances taken off
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation, Stack

Floats = NDArray[np.float64]

#: Two mechanisms with less than this between them are of one group.
ALIKE = 3.0
#: Detectability at which an effect is found nearly always.
SEEN = 5.0


@dataclass(frozen=True, eq=False)
class Gram:
    """Inner products of effects in the metric of noise and nuisances.

    Attributes
    ----------
    explanation : Explanation
    stack : Stack
    kappa : float
    """

    explanation: Explanation
    stack: Stack
    kappa: float

    def left(self, number: int) -> tuple[Floats, Floats]:
        """Columns of an effect, whitened, and `S^-1` of them (its mean first)."""
        own = self.stack.columns[:, self.stack.first[number] : self.stack.first[number + 1]]
        return own, self.explanation.precision_times(own, self.kappa)

    def apart(self, effect: Floats, others: NDArray[np.int64]) -> float:
        """`D` of an effect (n,), whitened, from the best imitation by any of other effects."""
        left = self.explanation.precision_times(effect[:, None], self.kappa)[:, 0]
        whole = float(effect @ left)
        best = 0.0
        for number in others.tolist():
            own, own_left = self.left(number)
            # imitations may have any size: the mean is a direction like the others
            used = own if own[:, 0].any() else own[:, 1:]
            used_left = own_left if own[:, 0].any() else own_left[:, 1:]
            M = used.T @ used_left
            b = used.T @ left
            M += 1e-10 * max(float(np.trace(M)), 1e-300) * np.eye(len(M))
            best = max(best, float(b @ np.linalg.solve(M, b)))
        return 0.5 * max(whole - best, 0.0)


def groups_of(kinds: tuple[str, ...], apart: Floats, limit: float = ALIKE) -> list[tuple[str, ...]]:
    """Kinds in groups: linked if either imitates the other so well that less than a limit is between them."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    linked = np.minimum(apart, apart.T) < limit
    count, labels = connected_components(csr_matrix(linked), directed=False)
    return [tuple(kind for kind, own in zip(kinds, labels, strict=True) if own == number) for number in range(count)]
