"""What an effect is: something that acts on the truth and that `case.toml` does not declare."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from concealed.body import Body, Bools, Floats
from warpbrain.physics.mechanisms.gravity import Gravity


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Base of all effects: does nothing, each overrides what it changes.

    Parameters
    ----------
    strength : float
        How strong, in `unit`; what the tuning scales.
    """

    kind: ClassVar[str]
    unit: ClassVar[str]
    #: Largest plausible strength, either sign.
    limit: ClassVar[float]
    #: Forces depend on where the surface has gone.
    follows: ClassVar[bool] = False

    strength: float

    def forces(self, body: Body, points: Floats) -> Floats:
        """Nodal forces [N], shape (N, 3), with the nodes of `body.quadratic` at `points` (N, 3) [m]."""
        return np.zeros_like(points)

    def log_stiffness(self, body: Body) -> Floats:
        """Logarithm of the factor on the stiffness of each tetrahedron, shape (m,)."""
        return np.zeros(len(body.mesh.tetrahedra))

    def growth(self, body: Body) -> Floats:
        """Relative growth of volume of each tetrahedron if it were free, shape (m,)."""
        return np.zeros(len(body.mesh.tetrahedra))

    def held(self, body: Body, held: Bools) -> Bools:
        """Held components of the nodes, shape (n, 3)."""
        return held

    def gravity(self, body: Body, gravity: Gravity) -> Gravity:
        """Gravity as it really was."""
        return gravity

    def declared_level(self, level: float) -> float:
        """The level of the fluid that is declared [m], given the true one."""
        return level

    def written(self) -> dict[str, Any]:
        """As plain data, with the unit of the strength."""
        return {"kind": self.kind, "unit": self.unit, **plain(asdict(self))}


def plain(values: dict[str, Any]) -> dict[str, Any]:
    """Values with lists in the place of tuples, as JSON has them."""
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}


def bell(points: Floats, centre: NDArray[np.float64] | tuple[float, ...], radius: float) -> Floats:
    """1 at a centre, falling to 1/e at a radius [m], shape (n,) for points (n, 3)."""
    return np.exp(-((points - np.asarray(centre)) ** 2).sum(axis=1) / radius**2)
