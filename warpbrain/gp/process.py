"""What every trained generative model can be asked, and draws that are functions.

A draw is drawn at anchors; elsewhere it is what follows from its values there.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.gp.literature.study import Study

#: A kernel takes distances and a length scale, and returns values and derivatives by the logarithm of that.
Kernel = Callable[[Floats, float], tuple[Floats, Floats]]


def _matern(root: float, value: Callable[[Any], Any], slope: Callable[[Any], Any]) -> Kernel:
    """Polynomials times `exp(-r)`, `r = root d / length`: of the value and of the derivative."""

    def kernel(distance: Floats, length: float) -> tuple[Floats, Floats]:
        r = root * distance / length
        decay = np.exp(-r)
        return value(r) * decay, slope(r) * decay

    return kernel


def squared_exponential(distance: Floats, length: float) -> tuple[Floats, Floats]:
    """`exp(-r^2 / 2)`, `r = d / length`."""
    r2 = (distance / length) ** 2
    k = np.exp(-0.5 * r2)
    return k, r2 * k


#: Stationary kernels of unit variance over stretch by name; Matern 3/2 is the paper's.
KERNELS: dict[str, Kernel] = {
    "matern12": _matern(1.0, lambda _r: 1.0, lambda r: r),
    "matern32": _matern(math.sqrt(3.0), lambda r: 1.0 + r, lambda r: r * r),
    "matern52": _matern(math.sqrt(5.0), lambda r: 1.0 + r + r * r / 3.0, lambda r: r * r * (1.0 + r) / 3.0),
    "squared-exponential": squared_exponential,
}


#: Added to the diagonal of the covariance of anchors, relative to its mean: they are dense enough for a smooth curve to
#: be singular in double precision. A draw moves by its root, 1e-4 of a standard deviation.
JITTER = 1e-8
#: Of groups, stretches (n,) and other ones (m,): the mean at the former (groups * n,) and the covariance with the
#: latter (groups * n, groups * m).
Moments = Callable[[tuple[str, ...], Floats, Floats], tuple[Floats, Floats]]


class Process(Protocol):
    """A distribution over strain energies of tissue, learnt from published ones.

    Curves are logarithms of energy on the incompressible uniaxial path, `y = ln(Psi + 1e-4)`, `Psi` in Pa. They are
    those of a new study of a group: what is not known of the group and what studies of it differ by are both in them.
    """

    def __hash__(self) -> int:
        """Of which model it is: what is drawn of one is kept."""

    @property
    def name(self) -> str:
        """Of the kind of model, as the command line calls it."""

    @property
    def variant(self) -> str:
        """Of the literature that it learnt from."""

    @property
    def folder(self) -> Path | None:
        """Where it was read from, if it does not ship."""

    @property
    def studies(self) -> tuple[Study, ...]:
        """What it learnt from."""

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups that it has seen studies of."""

    def curve(self, group: str, stretches: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        """Curves `k` standard deviations from the mean (the paper's samples), shape of `k` and `stretches` (..., n)."""

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        """Draw `number` of a seed, joint over groups: curves of shape (groups, n).

        A draw is a function: its value at a stretch does not depend on the other stretches that were asked for. A
        number of several parts, as (7, 1), is another draw: the first that replaces draw 7.
        """


def standard_normal(size: int, number: int | tuple[int, ...], seed: int) -> Floats:
    """Numbers (size,) of draw `number` of a seed: the same however many draws are made, and in whatever order."""
    parts = number if isinstance(number, tuple) else (number,)
    return np.random.default_rng([seed, *parts]).standard_normal(size)


class Draws:
    """Draws of a normal distribution over curves, at anchors (a,) of stretch, with what many draws share."""

    def __init__(self, anchors: Floats) -> None:
        self.anchors = anchors
        self._factors: dict[tuple[str, ...], Floats] = {}
        # of the last stretches alone: many draws are at the same ones
        self._last: dict[tuple[tuple[str, ...], bytes], tuple[Floats, Floats]] = {}

    def at(self, groups: tuple[str, ...], stretches: Floats, normal: Floats, moments: Moments) -> Floats:
        """The draw (groups, n) of independent standard normal numbers (groups * a,), always of the same moments.

        It has the values `L normal` at the anchors, `L L^T` the covariance, and elsewhere the mean given these:
        `c^T (L L^T)^-1 L normal = c^T L^-T normal`.
        """
        from scipy.linalg import cholesky, solve_triangular

        if groups not in self._factors:
            _, covariance = moments(groups, self.anchors, self.anchors)
            diagonal = np.diag(covariance)
            self._factors[groups] = cholesky(covariance + JITTER * diagonal.mean() * np.eye(len(diagonal)), lower=True)
        key = groups, stretches.tobytes()
        if key not in self._last:
            self._last.clear()
            self._last[key] = moments(groups, stretches, self.anchors)
        mean, cross = self._last[key]
        weights = solve_triangular(self._factors[groups], normal, lower=True, trans="T")
        return np.asarray((mean + cross @ weights).reshape(len(groups), -1))
