"""The hierarchical model: studies differ as wholes, not point by point.

The paper's process takes what studies of a group differ by for noise that is independent at every stretch. A hundred
points of five curves then pin the group down as five hundred observations would, and a joint draw is jagged. Here a
study, and the paper it is from, is an effect (`hierarchy`), so the spread of a new study is a spread of whole curves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpbrain.errors import SolveError
from warpbrain.gp.drawing import Anchored, standard_normal
from warpbrain.gp.hierarchy import CENTRE, EFFECTS, Hierarchy, prior
from warpbrain.gp.literature.groups import GROUPS, task_of
from warpbrain.gp.literature.study import Study
from warpbrain.gp.observations import Observations, Places, observations, papers
from warpbrain.gp.secant import log_energy

Floats = NDArray[np.float64]

#: Stretches at which draws are drawn; between them they are the mean given these values.
ANCHORS = np.linspace(0.4, 1.8, 57)


@dataclass(frozen=True, eq=False)
class Hierarchical:
    """The hierarchical model of a set of studies (a `warpbrain.gp.process.Process`).

    Attributes
    ----------
    studies : tuple of Study
    hierarchy : Hierarchy
    variant : str
        Of the literature.
    """

    studies: tuple[Study, ...]
    hierarchy: Hierarchy
    variant: str = "corrected"
    name = "hierarchical"

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups that it has seen studies of."""
        seen = {study.group for study in self.studies}
        return tuple(group for group in GROUPS if group in seen)

    def modulus(self, groups: Sequence[str], stretches: ArrayLike) -> tuple[Floats, Floats]:
        """Mean (groups, n) and covariance (groups * n, groups * n) of the log secant modulus of a new study.

        All groups are measured by one new paper, as in one subject.
        """
        at = _new(groups, np.asarray(stretches, dtype=np.float64))
        mean, covariance = self._predict(at)
        return mean.reshape(len(groups), -1), covariance

    def modulus_of(self, study: Study, stretches: ArrayLike) -> tuple[Floats, Floats]:
        """Mean (n,) and covariance (n, n) of the log secant modulus of a study that it has not seen.

        If it has seen others of the same paper, these count.
        """
        known = papers(self.studies)
        source = known.index(study.paper) if study.paper in known else -1
        return self._predict(_new([study.group], np.asarray(stretches, dtype=np.float64), source))

    def curve(self, group: str, stretches: ArrayLike, k: float = 0.0) -> Floats:
        """The curve `k` standard deviations from the mean, see `Process`."""
        mean, covariance = self.modulus([group], stretches)
        return log_energy(stretches, mean[0] + k * np.sqrt(np.diag(covariance)))

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        """Draw `number` of a seed, see `Process`."""
        l = np.asarray(stretches, dtype=np.float64)
        anchored = self._anchored(tuple(groups))
        mean, cross = self._from_anchors(tuple(groups), l)
        z = mean + cross @ anchored.weights(standard_normal(len(anchored.mean), number, seed))
        return log_energy(l, z.reshape(len(groups), -1))

    def _anchored(self, groups: tuple[str, ...]) -> Anchored:
        if groups not in self._drawn:
            self._drawn[groups] = Anchored(*self._predict(_new(groups, ANCHORS)))
        return self._drawn[groups]

    def _from_anchors(self, groups: tuple[str, ...], stretches: Floats) -> tuple[Floats, Floats]:
        """Mean and covariance with the anchors; the last ones are kept, for many draws at the same stretches."""
        key = groups, stretches.tobytes()
        if key not in self._last:
            self._last.clear()
            self._last[key] = self._predict_with(_new(groups, stretches), _new(groups, ANCHORS))
        return self._last[key]

    @cached_property
    def _drawn(self) -> dict[tuple[str, ...], Anchored]:
        return {}

    @cached_property
    def _last(self) -> dict[tuple[tuple[str, ...], bytes], tuple[Floats, Floats]]:
        return {}

    def _predict(self, at: Places) -> tuple[Floats, Floats]:
        return self._predict_with(at, at)

    def _predict_with(self, at: Places, other: Places) -> tuple[Floats, Floats]:
        """Mean at places (n,) and covariance (n, m) with other places, given the studies."""
        from scipy.linalg import solve_triangular

        seen, L, whitened = self._seen
        k = solve_triangular(L, self.hierarchy.covariance(seen.places, at), lower=True)
        to = k if other is at else solve_triangular(L, self.hierarchy.covariance(seen.places, other), lower=True)
        return CENTRE + k.T @ whitened, self.hierarchy.covariance(at, other) - k.T @ to

    @cached_property
    def _seen(self) -> tuple[Observations, Floats, Floats]:
        """Observations, the factor of their covariance, and what it makes of them."""
        from scipy.linalg import cholesky, solve_triangular

        seen = observations(self.studies)
        L = cholesky(self.hierarchy.derivatives(seen.places)[0], lower=True)
        return seen, L, solve_triangular(L, seen.log_modulus - CENTRE, lower=True)


@dataclass(frozen=True)
class Fitted:
    """How the fit of a hierarchy ended.

    Attributes
    ----------
    objective : float
        Negative log of likelihood times prior.
    converged : bool
    message : str
    iterations : int
    condition : float
        Condition number of the covariance of the observations, in the 2-norm.
    """

    objective: float
    converged: bool
    message: str
    iterations: int
    condition: float


def fit_hierarchy(
    seen: Observations, kernel: str = "matern52", first: Hierarchy | None = None, without: Sequence[str] = ()
) -> tuple[Hierarchy, Fitted]:
    """The hierarchy of largest posterior density.

    Parameters
    ----------
    seen : Observations
    kernel : str
        Of the curves.
    first : Hierarchy, optional
        Where to start from; the median of the prior unless given.
    without : sequence of str
        Effects that are left out: their standard deviation is 1e-6, for comparisons.

    Raises
    ------
    SolveError
        If the covariance cannot be factored at the start.
    """
    from scipy.optimize import minimize

    mean, spread = prior()
    start = mean if first is None else first.to_vector()
    fixed = np.array([name in without for name in EFFECTS] + [False])
    start = np.where(fixed, np.log(1e-6), start)

    def objective(vector: Floats) -> tuple[float, Floats]:
        value, gradient = negative_log_likelihood(Hierarchy.from_vector(vector, kernel), seen)
        away = np.where(fixed, 0.0, (vector - mean) / spread)
        gradient = np.where(fixed, 0.0, gradient)
        return value + 0.5 * float(away @ away), gradient + away / spread

    found = minimize(objective, start, jac=True, method="L-BFGS-B", options={"maxiter": 200, "ftol": 1e-9})
    if not np.isfinite(found.fun):
        raise SolveError("the covariance of the studies is not positive definite in double precision")
    hierarchy = Hierarchy.from_vector(found.x, kernel)
    condition = float(np.linalg.cond(hierarchy.derivatives(seen.places)[0]))
    return hierarchy, Fitted(float(found.fun), bool(found.success), str(found.message), int(found.nit), condition)


def negative_log_likelihood(hierarchy: Hierarchy, seen: Observations) -> tuple[float, Floats]:
    """Of observations, with its derivative by `Hierarchy.to_vector`; infinite if the covariance cannot be factored."""
    from scipy.linalg import cho_solve, cholesky

    covariance, slopes = hierarchy.derivatives(seen.places)
    away = seen.log_modulus - CENTRE
    try:
        L = cholesky(covariance, lower=True)
    except np.linalg.LinAlgError:
        return np.inf, np.zeros(len(slopes))
    weights = cho_solve((L, True), away)
    G = 0.5 * (cho_solve((L, True), np.eye(len(away))) - np.outer(weights, weights))
    value = 0.5 * float(away @ weights) + float(np.log(np.diag(L)).sum()) + 0.5 * len(away) * np.log(2.0 * np.pi)
    return value, np.array([float(np.sum(G * slope)) for slope in slopes])


def _new(groups: Sequence[str], stretches: Floats, paper: int = -1) -> Places:
    """Places (groups * n) of one paper, a new one unless it is given, with one new study a group."""
    count = len(groups)
    task = np.array([task_of(group) for group in groups], dtype=np.int64)
    study = -1 - np.arange(count)
    source = np.full(count * len(stretches), paper)
    return Places(np.repeat(study, len(stretches)), source, np.repeat(task, len(stretches)), np.tile(stretches, count))
