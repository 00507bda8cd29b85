"""Posterior of an unknown force: its resultant, its place, and whether it acts on the surface.

The force is that of independent Gaussian patches all over the body. With `E c` linear functionals of their
coefficients `c ~ N(0, s^2 I)`, `A` the response of the sensors to these and `S` the covariance of noise and nuisances

    mean = s^2 E A^T (S + s^2 A A^T)^-1 r,     covariance = s^2 E E^T - s^4 E A^T (S + s^2 A A^T)^-1 A E^T.

A net force that is not zero is external: growth and stress within the body have none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.mesh import nodes_of
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.unknown import force_patches


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

    Parameters
    ----------
    at : Linearisation
    model : GaussianModel
        Of noise and nuisances.
    residual : (n,) array
    noise : float
        Typical noise of displacements [m].
    length : float
        Of patches [m].
    centre : (3,) array
        About which moments are taken [m].
    """
    from scipy.special import chdtri

    sites, answers = force_patches(at, length)
    # patches on held nodes have no effect
    moving = np.linalg.norm(answers, axis=(0, 2)) > 1e-3 * np.linalg.norm(answers, axis=(0, 2)).max()
    sites, answers = sites[moving], answers[:, moving]
    A = answers.reshape(len(answers), -1)
    rows = at.sensors.is_displacement
    unit = 1.0 / np.sqrt(np.mean(np.sum(A[rows] ** 2, axis=1)))
    scales = noise * unit * beliefs("unknown.sizes")
    # the scale of the greatest likelihood
    scale = float(scales[int(np.argmax([model.with_columns(s * A).log_density(residual) for s in scales.tolist()]))])
    functionals = scale * np.concatenate([_summed(sites), _turned(sites - centre)])
    coefficients, spread = model.with_columns(scale * A).coefficients(residual)
    of_patches = slice(len(coefficients) - A.shape[1], None)
    mean = functionals @ coefficients[of_patches]
    covariance = functionals @ spread[of_patches, of_patches] @ functionals.T
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))

    def significant(part: slice) -> bool:
        square = float(mean[part] @ np.linalg.solve(covariance[part, part], mean[part]))
        return square > float(chdtri(3, 1.0 - belief("checks.sure")))

    return Traits(
        mean[:3],
        sd[:3],
        mean[3:],
        sd[3:],
        significant(slice(0, 3)),
        significant(slice(3, 6)),
        _surface_nats(at, sites, answers, model, scale, residual, length),
        centre,
    )


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
