"""Linear systems of quadratic tetrahedra: conjugate gradients, with the linear ones below them solved exactly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix, diags, eye, kron
from scipy.sparse.linalg import splu

from referee.body import Body

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Steps of the smoother, a Chebyshev polynomial, and the part of the spectrum that it is for.
_STEPS, _PART = 3, 8.0
_MOST = 600


class NotSolved(Exception):
    """Conjugate gradients did not converge."""


class Coarse:
    """The factorised matrix of the corners, which stays good enough while a body deforms."""

    def __init__(self, body: Body, matrix: bsr_matrix, held: Bools) -> None:
        count, k = len(body.mesh.points), len(body.edges)
        rows = np.concatenate([np.arange(count), np.repeat(count + np.arange(k), 2)])
        columns = np.concatenate([np.arange(count), body.edges.ravel()])
        weights = np.concatenate([np.ones(count), np.full(2 * k, 0.5)])
        nodes = csr_matrix((weights, (rows, columns)), shape=(count + k, count))
        free = ~held.ravel()
        up = diags(free.astype(float)) @ kron(nodes, eye(3), format="csr")
        self._up = up[:, np.flatnonzero(free[: 3 * count])].tocsr()
        self._down = self._up.T.tocsr()
        below = (self._down @ (matrix.tocsr() @ self._up)).tocsc()
        options = {"SymmetricMode": True}
        self._factors = splu(below, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)

    def __call__(self, r: Floats) -> Floats:
        return self._up @ self._factors.solve(self._down @ r)


class Linear:
    """A matrix with what is held left out, ready to be solved with.

    Parameters
    ----------
    matrix : (3 n, 3 n) block matrix
    held : (n, 3) bool array
    coarse : Coarse

    Attributes
    ----------
    whole : (3 n, 3 n) block matrix
        With what is held.
    held : (n, 3) bool array
    coarse : Coarse
    """

    def __init__(self, matrix: bsr_matrix, held: Bools, coarse: Coarse) -> None:
        self.whole, self.held, self.coarse = matrix, held, coarse
        self._free = (~held.ravel()).astype(float)
        n = len(held)
        rows = np.repeat(np.arange(n), np.diff(matrix.indptr))
        blocks = matrix.data[matrix.indices == rows].copy()
        free = self._free.reshape(n, 3)
        blocks *= free[:, :, None] * free[:, None, :]
        blocks += (1.0 - free)[:, :, None] * np.eye(3)
        self._inverse = np.linalg.inv(blocks)
        self._largest = self._power()

    def _times(self, x: Floats) -> Floats:
        return self._free * (self.whole @ x)

    def _jacobi(self, r: Floats) -> Floats:
        return self._free * (self._inverse @ r.reshape(-1, 3, 1)).ravel()

    def _power(self) -> float:
        x = np.random.default_rng(0).normal(size=len(self._free)) * self._free
        size = 1.0
        for _ in range(8):
            x = self._jacobi(self._times(x / np.linalg.norm(x)))
            size = float(np.linalg.norm(x))
        return 1.1 * size

    def _smooth(self, r: Floats) -> Floats:
        """Chebyshev's polynomial of the matrix, applied to a residual (Saad, Iterative Methods, algorithm 12.1)."""
        high, low = self._largest, self._largest / _PART
        middle, half = 0.5 * (high + low), 0.5 * (high - low)
        ratio = middle / half
        rho = 1.0 / ratio
        step = self._jacobi(r) / middle
        x = step.copy()
        for _ in range(_STEPS - 1):
            fresh = 1.0 / (2.0 * ratio - rho)
            step = fresh * rho * step + 2.0 * fresh / half * self._jacobi(r - self._times(x))
            x += step
            rho = fresh
        return x

    def _precondition(self, r: Floats) -> Floats:
        x = self._smooth(r)
        x = x + self.coarse(r - self._times(x))
        return x + self._smooth(r - self._times(x))

    def solve(self, right: Floats, close: float) -> Floats:
        """Solution (3 n,) to a relative residual; `NotSolved` if none is reached or the matrix is not positive."""
        r = self._free * right
        x = np.zeros_like(r)
        target = close * np.linalg.norm(r)
        if target == 0.0:
            return x
        z = self._precondition(r)
        p, rz = z, r @ z
        for _ in range(_MOST):
            q = self._times(p)
            curvature = p @ q
            if curvature <= 0.0:
                raise NotSolved("the tangent is not positive definite")
            x = x + rz / curvature * p
            r = r - rz / curvature * q
            if np.linalg.norm(r) <= target:
                return x
            z = self._precondition(r)
            rz, old = r @ z, rz
            p = z + rz / old * p
        raise NotSolved(f"no convergence in {_MOST} steps")
