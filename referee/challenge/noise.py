"""Covariance of noise, from where and along what is recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Noise:
    """What is known of noise beside its declared size.

    Attributes
    ----------
    square : float
        Mean square of its scale, which nobody declares.
    shared, length : float
        Part of it that neighbours share, in parts of each one's own, and over which distance [m].
    """

    square: float
    shared: float
    length: float


def covariance_of(
    noise: Noise, place: Floats, direction: Floats, kind: NDArray[np.str_], time: Floats, sigma: Floats
) -> Floats:
    """Covariance (rows, rows): each row's own noise, and what neighbours of its kind share at the same time.

    Parameters
    ----------
    noise : Noise
    place, direction, kind, time : arrays
        As in `referee.challenge.neutral.NeutralCase`.
    sigma : (rows,) array
        Declared [m] or [N].
    """
    covariance = noise.square * np.diag(sigma**2)
    for shares in ("displacement", "wall"):
        own = np.flatnonzero(kind == shares)
        apart = np.linalg.norm(place[own][:, None] - place[own][None], axis=2)
        at = np.nan_to_num(time[own], nan=-1.0)
        shared = noise.shared**2 * np.exp(-apart / noise.length) * (at[:, None] == at[None])
        shared *= direction[own] @ direction[own].T
        covariance[np.ix_(own, own)] += noise.square * sigma[own][:, None] * sigma[own][None] * shared
    return covariance
