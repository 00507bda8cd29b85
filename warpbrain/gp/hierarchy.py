"""Covariance of secant moduli: what studies share, level by level.

With `z = ln mu(l)` of a study of method `m`, anatomy `a`, paper `q`,

    z = ln 1500 Pa + overall + method + anatomy + group + paper + study                     one modulus each
        + [curve shared by all + by anatomy + by paper + of the study](l)                   hyperelastic studies only
        + [asymmetry of the paper + of the study] sgn(l - 1)                                hyperelastic studies only
        + rest

each a Gaussian effect with a variance of its own: a sum of coregionalised kernels whose matrices are "is the same". The
curves have a stationary kernel over stretch. Elastography and linear studies publish a modulus, not a curve, so they
inform the modulus only. Grey and white matter of one paper, or of one new subject, are correlated through all that is
shared: overall, method and paper.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.gp.kernels import KERNELS
from warpbrain.gp.literature.groups import ANATOMIES, METHODS
from warpbrain.gp.observations import Places

Floats = NDArray[np.float64]

#: About which moduli lie [Pa], and how widely (standard deviation of the logarithm): weak, and not learnt.
CENTRE, OVERALL = np.log(1500.0), 3.0

#: Effects and what their standard deviation is thought to be before the data are seen: the median of a log-normal prior
#: whose logarithm has the standard deviation `PRIOR_SPREAD`.
EFFECTS = {
    "method": 0.7,
    "anatomy": 0.5,
    "group": 0.5,
    "paper": 0.7,
    "study, MRE": 0.7,
    "study, linear": 0.7,
    "study, hyperelastic": 0.7,
    "study, abnormal": 1.0,
    "curve": 0.5,
    "curve, anatomy": 0.5,
    "curve, paper": 0.5,
    "curve, study": 0.5,
    "asymmetry, paper": 0.3,
    "asymmetry, study": 0.3,
}
PRIOR_SPREAD = 1.0
#: Standard deviation of what is left of a log modulus, not learnt: a published formula is not its data. Below 3 % the
#: agreement of a formula with a smooth curve says nothing of tissue, and would make the covariance singular.
REST = 0.03
#: Of the length scale of the curves, in stretch.
LENGTH, LENGTH_SPREAD = 0.5, 0.5


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Standard deviations of the effects, and the length scale of the curves.

    Attributes
    ----------
    spread : mapping of str to float
        Keys of `EFFECTS`.
    length_scale : float
    kernel : str
        Of the curves, a key of `warpbrain.gp.kernels.KERNELS`.
    """

    spread: dict[str, float]
    length_scale: float
    kernel: str = "matern52"

    def to_vector(self) -> Floats:
        """Logarithms, the length scale last."""
        return np.log([*(self.spread[name] for name in EFFECTS), self.length_scale])

    @classmethod
    def from_vector(cls, vector: Floats, kernel: str = "matern52") -> Hierarchy:
        """The hierarchy of `to_vector`."""
        values = np.exp(vector).tolist()
        return cls(dict(zip(EFFECTS, values[:-1], strict=True)), values[-1], kernel)

    def covariance(self, a: Places, b: Places) -> Floats:
        """Covariance (n, m) of the moduli at two sets of places, without the rest."""
        total = np.full((len(a.task), len(b.task)), OVERALL**2)
        for name, (matrix, _) in _effects(self, a, b).items():
            total += self.spread[name] ** 2 * matrix
        return total

    def derivatives(self, at: Places) -> tuple[Floats, list[Floats]]:
        """Covariance (n, n) of observations, with the rest, and its derivatives by the vector."""
        total = np.full((len(at.task), len(at.task)), OVERALL**2) + REST**2 * np.eye(len(at.task))
        by: dict[str, Floats] = {}
        by_length = np.zeros_like(total)
        effects = _effects(self, at, at)
        for name in EFFECTS:
            matrix, slope = effects[name]
            variance = self.spread[name] ** 2
            total += variance * matrix
            by[name] = 2.0 * variance * matrix
            if slope is not None:
                by_length += variance * slope
        return total, [*by.values(), by_length]


def prior() -> tuple[Floats, Floats]:
    """Mean and standard deviation of `Hierarchy.to_vector` before the data are seen."""
    mean = np.log([*EFFECTS.values(), LENGTH])
    return mean, np.array([*[PRIOR_SPREAD] * len(EFFECTS), LENGTH_SPREAD])


def _effects(hierarchy: Hierarchy, a: Places, b: Places) -> dict[str, tuple[Floats, Floats | None]]:
    """Matrix (n, m) of each effect for unit variance, and its derivative by the logarithm of the length scale."""
    count = len(ANATOMIES)
    method_a, method_b = a.task // count, b.task // count
    anatomy = _same(a.task % count, b.task % count)
    paper, study = _same(a.source, b.source), _same(a.study, b.study)
    abnormal = (a.task % count == ANATOMIES.index("abnormal")).astype(float)[:, None]
    effects: dict[str, tuple[Floats, Floats | None]] = {
        "method": (_same(method_a, method_b), None),
        "anatomy": (anatomy, None),
        "group": (_same(a.task, b.task), None),
        "paper": (paper, None),
        "study, abnormal": (study * abnormal, None),
    }
    for index, method in enumerate(METHODS):
        effects[f"study, {method}"] = (study * (1.0 - abnormal) * (method_a == index)[:, None], None)
    curved = np.outer(a.curved, b.curved).astype(float)
    distance = np.abs(a.stretch[:, None] - b.stretch[None, :])
    k, dk = (curved * part for part in KERNELS[hierarchy.kernel](distance, hierarchy.length_scale))
    for name, same in (("curve", 1.0), ("curve, anatomy", anatomy), ("curve, paper", paper), ("curve, study", study)):
        effects[name] = (same * k, same * dk)
    sides = curved * np.outer(np.sign(a.stretch - 1.0), np.sign(b.stretch - 1.0))
    effects["asymmetry, paper"] = (paper * sides, None)
    effects["asymmetry, study"] = (study * sides, None)
    return effects


def _same(a: NDArray[np.int64], b: NDArray[np.int64]) -> Floats:
    return (a[:, None] == b[None, :]).astype(float)
