"""Posterior of an unknown force: its resultant, its place, and whether it acts on the surface.

The force is that of independent Gaussian patches all over the body. With `E c` linear functionals of their
coefficients `c ~ N(0, s^2 I)`, `A` the response of the sensors to these and `S` the covariance of noise and nuisances

    mean = s^2 E A^T (S + s^2 A A^T)^-1 r,     covariance = s^2 E E^T - s^4 E A^T (S + s^2 A A^T)^-1 A E^T.

A net force that is not zero is external: growth and stress within the body have none. But of a stress beside what is
held a part acts on nodes that do not move, and the rest looks like a net force. So stress there is part of `S`, as
large as is likely: a net force is told if such a stress does not explain it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.mesh import nodes_of
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.unknown import force_patches, stress_beside_held


@dataclass(frozen=True, eq=False)
class Traits:
    """Of an unknown force.

    Attributes
    ----------
    force, force_sd : (3,) array
        Net force [N].
    moment, moment_sd : (3,) array
        Net moment about `centre` [N m].
    outside : bool
        Whether there is a net force: it is exerted from outside the body.
    turning : bool
        Whether there is a net moment.
    hidden : bool
        Whether there seems to be a net force, which what holds the body may carry: it cannot be told.
    surface_nats : float
        Log Bayes factor of a force on the surface alone over one within the body alone.
    centre : (3,) array
        Where it is [m].
    """

    force: Floats
    force_sd: Floats
    moment: Floats
    moment_sd: Floats
    outside: bool
    turning: bool
    hidden: bool
    surface_nats: float
    centre: Floats

    @property
    def size(self) -> tuple[float, float]:
        """Of the net force, and its standard deviation [N]."""
        size = float(np.linalg.norm(self.force))
        along = self.force / size if size > 0.0 else np.full(3, 3**-0.5)
        return size, float(np.linalg.norm(along * self.force_sd))


def traits_of(
    at: Linearisation, model: GaussianModel, residual: Floats, noise: float, length: float, centre: Floats
) -> Traits:
    """Traits of what residuals (n,) show beside noise and nuisances.

    `model`: of noise and nuisances. `residual` (n,). `noise`: typical noise of displacements [m]. `length`: of patches
    [m]. `centre` (3,): about which moments are taken [m].
    """
    sites, answers = force_patches(at, length)
    # patches on held nodes have no effect
    moving = np.linalg.norm(answers, axis=(0, 2)) > 1e-3 * np.linalg.norm(answers, axis=(0, 2)).max()
    sites, answers = sites[moving], answers[:, moving]
    A = answers.reshape(len(answers), -1)
    rows = at.sensors.is_displacement
    unit = noise / np.sqrt(np.mean(np.sum(A[rows] ** 2, axis=1)))
    functionals = unit * np.concatenate([_summed(sites), _turned(sites - centre)])
    covariance = model.scale**2 * (model.noise_factor @ model.noise_factor.T) + model.columns @ model.columns.T
    resultant = partial(_Resultant.of, unit * A, functionals, covariance, residual)
    plain, with_hiding = resultant(None), resultant(noise * stress_beside_held(at, length))
    force, moment = slice(0, 3), slice(3, 6)
    sd = np.sqrt(np.maximum(np.diag(with_hiding.covariance), 0.0))
    outside = with_hiding.is_significant(force)
    return Traits(
        with_hiding.mean[force],
        sd[force],
        with_hiding.mean[moment],
        sd[moment],
        outside,
        with_hiding.is_significant(moment),
        plain.is_significant(force) and not outside,
        _surface_nats(at, sites, answers, model, plain.size * unit, residual, length),
        centre,
    )


@dataclass(frozen=True, eq=False)
class _Resultant:
    """Posterior of net force and moment."""

    mean: Floats  # (6,)
    covariance: Floats  # (6, 6)
    size: float  # of the patches, relative to those that move as much as the noise: the likeliest

    @classmethod
    def of(
        cls, patches: Floats, functionals: Floats, covariance: Floats, residual: Floats, hiding: Floats | None
    ) -> _Resultant:
        """Of patches (n, k) beside a covariance (n, n), and beside columns (n, m) that hide it, of any size."""
        from scipy.linalg import cho_factor, cho_solve

        sizes = beliefs("unknown.sizes").tolist()
        of_patches, of_hiding = patches @ patches.T, None if hiding is None else hiding @ hiding.T
        best: tuple[float, float, Any] | None = None
        # metres and newtons have one size
        units = np.sqrt(np.diag(covariance))
        for size, other in itertools.product(sizes, (0.0,) if of_hiding is None else sizes):
            total = covariance + size**2 * of_patches + (0.0 if of_hiding is None else other**2 * of_hiding)
            factor = cho_factor(total / np.outer(units, units))
            log_density = -0.5 * float(residual / units @ cho_solve(factor, residual / units))
            log_density -= float(np.log(np.diag(factor[0])).sum())
            if best is None or log_density > best[0]:
                best = log_density, size, factor
        assert best is not None
        _, size, factor = best
        F = size**2 * functionals @ patches.T / units
        mean = F @ cho_solve(factor, residual / units)
        spread = size**2 * functionals @ functionals.T - F @ cho_solve(factor, F.T)
        return cls(mean, spread, size)

    def is_significant(self, part: slice) -> bool:
        """Whether three of the components are not zero."""
        from scipy.special import chdtri

        square = float(self.mean[part] @ np.linalg.solve(self.covariance[part, part], self.mean[part]))
        return square > float(chdtri(3, 1.0 - belief("checks.sure")))


def _summed(sites: Floats) -> Floats:
    """Net force (3, 3 s) of forces at sites."""
    return np.tile(np.eye(3), len(sites))


def _turned(arms: Floats) -> Floats:
    """Net moment (3, 3 s) of forces at arms (s, 3)."""
    x, y, z = arms.T
    zero = np.zeros_like(x)
    rows = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])
    return np.asarray(rows.transpose(0, 2, 1).reshape(3, -1))


def _surface_nats(
    at: Linearisation,
    sites: Floats,
    answers: Floats,
    model: GaussianModel,
    scale: float,
    residual: Floats,
    length: float,
) -> float:
    """Log Bayes factor of a force near the surface alone over a deeper one with the same mean displacement."""
    from scipy.spatial import cKDTree

    mesh = at.system.model.mesh
    skin = mesh.points[nodes_of(mesh.boundary, len(mesh.points))]
    superficial = cKDTree(skin).query(sites)[0] < 0.5 * length
    if superficial.all() or not superficial.any():
        return 0.0
    whole = float(np.sum(answers**2))
    log_densities = []
    for chosen in (superficial, ~superficial):
        part = answers[:, chosen].reshape(len(answers), -1)
        as_large = scale * (whole / float(np.sum(part**2))) ** 0.5
        log_densities.append(float(model.with_columns(as_large * part).log_density(residual)))
    return log_densities[0] - log_densities[1]
