"""What can be said of a force that no mechanism of the dictionary explains, from its posterior.

The force is that of Gaussian patches all over the body, independent of each other. With `E` what is asked of their
coefficients `c ~ N(0, s^2 I)`, `A` what they do to the sensors and `S` the covariance of noise and nuisances

    mean = s^2 E A^T (S + s^2 A A^T)^-1 r,     covariance = s^2 E E^T - s^4 E A^T (S + s^2 A A^T)^-1 A E^T.

A net force that is not zero comes from outside: what acts within the body, swollen or stressed, has none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.evidence import Explanation
from warpbrain.diagnosis.flexible import SCALES
from warpbrain.mesh import nodes_of
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.unknown import force_patches

Floats = NDArray[np.float64]

#: Probability above which a net force or moment is taken to be there.
_SURE = 0.95


@dataclass(frozen=True, eq=False)
class Traits:
    """Of a force without a name.

    Attributes
    ----------
    force, force_sd : (3,) array
        Net force [N].
    moment, moment_sd : (3,) array
        Net moment about `centre` [N m].
    outside : bool
        Whether a net force is there: something outside the body exerts it.
    turning : bool
        Whether a net moment is there.
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
    at: Linearisation,
    explanation: Explanation,
    residual: Floats,
    kappa: float,
    noise: float,
    length: float,
    centre: Floats,
) -> Traits:
    """Traits of what residuals (n,) show beside noise and nuisances.

    Parameters
    ----------
    at : Linearisation
    explanation : Explanation
        Noise and nuisances.
    residual : (n,) array
    kappa : float
        Factor on the noise.
    noise : float
        Typical noise of displacements [m].
    length : float
        Of patches [m].
    centre : (3,) array
        About which moments are taken [m].
    """
    from scipy.special import chdtri

    sites, answers = force_patches(at, length)
    # patches that fall on what is held do nothing, and nothing is known of them
    moving = np.linalg.norm(answers, axis=(0, 2)) > 1e-3 * np.linalg.norm(answers, axis=(0, 2)).max()
    sites, answers = sites[moving], answers[:, moving]
    A = answers.reshape(len(answers), -1)
    rows = at.sensors.is_displacement
    each = 1.0 / np.sqrt(np.mean(np.sum(A[rows] ** 2, axis=1)))
    U = explanation.nuisances
    S = kappa**2 * explanation.factor @ explanation.factor.T + U @ U.T
    # the size that suits best
    s = each * noise * SCALES[int(np.argmax([_log_density(S, scale * noise * each * A, residual) for scale in SCALES]))]
    columns = s * A
    asked = np.concatenate([_summed(sites), _turned(sites - centre)])
    weights = np.linalg.solve(S + columns @ columns.T, np.column_stack([residual, columns]))
    mean = s * asked @ (columns.T @ weights[:, 0])
    covariance = s**2 * (asked @ asked.T - asked @ (columns.T @ weights[:, 1:]) @ asked.T)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))

    def there(own: slice) -> bool:
        square = float(mean[own] @ np.linalg.solve(covariance[own, own], mean[own]))
        return square > float(chdtri(3, 1.0 - _SURE))

    return Traits(
        mean[:3],
        sd[:3],
        mean[3:],
        sd[3:],
        there(slice(0, 3)),
        there(slice(3, 6)),
        _surface_nats(at, sites, answers, S, s, residual, length),
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


def _log_density(S: Floats, columns: Floats, residual: Floats) -> float:
    L = np.linalg.cholesky(S + columns @ columns.T)
    left = np.linalg.solve(L, residual)
    return -0.5 * float(left @ left) - float(np.log(np.diag(L)).sum())


def _surface_nats(
    at: Linearisation, sites: Floats, answers: Floats, S: Floats, s: float, residual: Floats, length: float
) -> float:
    """Of a force of the same mean displacement near the surface alone, over one that is deeper."""
    from scipy.spatial import cKDTree

    mesh = at.system.model.mesh
    skin = mesh.points[nodes_of(mesh.boundary, len(mesh.points))]
    near = cKDTree(skin).query(sites)[0] < 0.5 * length
    if near.all() or not near.any():
        return 0.0
    whole = float(np.sum(answers**2))
    found = []
    for own in (near, ~near):
        part = answers[:, own].reshape(len(answers), -1)
        found.append(_log_density(S, s * (whole / float(np.sum(part**2))) ** 0.5 * part, residual))
    return found[0] - found[1]
