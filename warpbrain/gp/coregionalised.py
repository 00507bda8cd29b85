"""The paper's process: twelve groups of log energies that share one curve, with noise at every stretch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats, Ints
from warpbrain.gp.literature.study import GROUPS, Study, dataset, groups_of, log_energy
from warpbrain.gp.process import KERNELS, Draws, standard_normal
from warpbrain.gp.training import Factored, Likelihood, Parameters, Replicates

#: Tasks (n,) and stretches (n,) of places.
_At = tuple[Ints, Floats]
#: Stretches at which draws are drawn; between them they are the mean given these values.
ANCHORS = np.linspace(0.4, 1.8, 141)


@dataclass(frozen=True, eq=False)
class Coregionalised:
    """The coregionalised process of a set of studies (a `warpbrain.gp.process.Process`).

    `jitter` is a variance added to the diagonal of the covariance, `mean_modulus` the shear modulus [Pa] of the
    neo-Hookean energy that is its mean (0 for the paper's mean of zero), `points` how many it learns from of each
    study.
    """

    studies: tuple[Study, ...]
    parameters: Parameters
    variant: str = "as_published"
    kernel: str = "matern32"
    jitter: float = 1e-8
    mean_modulus: float = 0.0
    points: int = 100
    name = "coregionalised"

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups that it has seen studies of."""
        return groups_of(self.studies)

    def log_energy(self, group: str, stretches: ArrayLike) -> tuple[Floats, Floats]:
        """Mean and standard deviation (n,) of `ln(Psi + 1e-4)`, the noise of the group included, as in the paper."""
        l = np.asarray(stretches, dtype=np.float64)
        mean, covariance = self._predict([group], l, l)
        variance = np.diag(covariance) + self.parameters.noise[GROUPS.index(group)]
        return mean, np.sqrt(np.maximum(variance, 0.0))

    def curve(self, group: str, stretches: ArrayLike, k: ArrayLike = 0.0) -> Floats:
        """The curve `k` standard deviations from the mean, see `Process`."""
        mean, spread = self.log_energy(group, stretches)
        return mean + np.multiply.outer(np.asarray(k, dtype=np.float64), spread)

    def draw(self, groups: Sequence[str], stretches: ArrayLike, number: int | tuple[int, ...], seed: int = 0) -> Floats:
        """Draw `number` of a seed, see `Process`.

        The noise of a group is one number a curve: it stands for what studies differ by, and moves a whole curve as the
        paper's `k` does. Independent noise at every stretch would be no function.
        """
        normal = standard_normal(len(groups) * (1 + len(ANCHORS)), number, seed)
        l = np.asarray(stretches, dtype=np.float64)
        latent = self._draws.at(tuple(groups), l, normal[len(groups) :], self._predict)
        noise = np.sqrt(self.parameters.noise[[GROUPS.index(group) for group in groups]])
        return latent + (noise * normal[: len(groups)])[:, None]

    @cached_property
    def _draws(self) -> Draws:
        return Draws(ANCHORS)

    def level_of(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> tuple[float, float]:
        """Mean and standard deviation of the mean log energy over new studies, each at its own stretches.

        The noise of a group is one number a curve, as in `draw`.
        """
        task = np.concatenate([np.full(len(l), study.task) for study, l in zip(studies, stretches, strict=True)])
        at = task, np.concatenate(stretches)
        weights = np.concatenate([np.full(len(l), 1.0 / len(l) / len(studies)) for l in stretches])
        mean, covariance = self._predict_at(at, at)
        noise = sum(self.parameters.noise[study.task] for study in studies) / len(studies) ** 2
        return float(weights @ mean), float(np.sqrt(max(weights @ covariance @ weights, 0.0) + noise))

    def _predict(self, groups: Sequence[str], at: Floats, other: Floats) -> tuple[Floats, Floats]:
        """Mean of the shared curve at (groups * n,) and covariance with other stretches, given the studies."""
        tasks = np.array([GROUPS.index(group) for group in groups], dtype=np.int64)

        def places(stretches: Floats) -> _At:
            return np.repeat(tasks, len(stretches)), np.tile(stretches, len(tasks))

        here = places(at)
        return self._predict_at(here, here if other is at else places(other))

    def _predict_at(self, here: _At, there: _At) -> tuple[Floats, Floats]:
        """The same at any pairs of task and stretch."""
        from scipy.linalg import solve_triangular

        data, factored = self._seen
        k = self._covariance((data.task, data.x), here)
        mean = prior_mean(here[1], self.mean_modulus) + k.T @ factored.weights
        whitened = to = solve_triangular(factored.cholesky, k, lower=True)
        if there is not here:
            to = solve_triangular(factored.cholesky, self._covariance((data.task, data.x), there), lower=True)
        return mean, self._covariance(here, there) - whitened.T @ to

    def _covariance(self, a: _At, b: _At) -> Floats:
        distance = np.abs(a[1][:, None] - b[1][None, :])
        k = KERNELS[self.kernel](distance, self.parameters.length_scale)[0]
        return self.parameters.coregionalisation[np.ix_(a[0], b[0])] * k

    @cached_property
    def _seen(self) -> tuple[Replicates, Factored]:
        data = training_points(self.studies, self.mean_modulus, self.points)
        return data, Likelihood(data, self.kernel, self.jitter).factor(self.parameters)


def training_points(studies: Sequence[Study], mean_modulus: float = 0.0, count: int = 100) -> Replicates:
    """What the process learns from: `count` log energies of each study minus their prior mean, replicates reduced."""
    points = dataset(studies, count)
    away = points.log_energy - prior_mean(points.stretch, mean_modulus)
    return Replicates.of(points.task, points.stretch, away)


def prior_mean(stretches: Floats, modulus: float) -> Floats:
    """Log energy (n,) of a neo-Hookean solid of a shear modulus [Pa], or zero for none."""
    return log_energy(stretches, np.log(modulus)) if modulus else np.zeros_like(stretches)
