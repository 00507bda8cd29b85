"""Effects inside tissue: regional swelling, and an inclusion that is softer or stiffer than what is around it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from concealed.body import Body, Floats
from concealed.effect import Effect, bell


@dataclass(frozen=True, kw_only=True)
class Swelling(Effect):
    """Tissue around a centre takes up water: it would grow in volume by `strength` there if it were free.

    Parameters
    ----------
    centre : (x, y, z)
        [m]
    radius : float
        Where it has fallen to 1/e [m].
    """

    kind: ClassVar[str] = "swelling"
    unit: ClassVar[str] = "1"
    limit: ClassVar[float] = 0.30

    centre: tuple[float, float, float]
    radius: float

    def growth(self, body: Body) -> Floats:
        return self.strength * bell(body.centroids, self.centre, self.radius)


@dataclass(frozen=True, kw_only=True)
class Inclusion(Effect):
    """A ball whose stiffness differs by a factor ``exp(strength)`` in its middle.

    Parameters
    ----------
    centre : (x, y, z)
        [m]
    radius : float
        Where the logarithm has fallen to 1/e [m].
    """

    kind: ClassVar[str] = "inclusion"
    unit: ClassVar[str] = "natural logarithm of a factor"
    limit: ClassVar[float] = 1.5

    centre: tuple[float, float, float]
    radius: float

    def log_stiffness(self, body: Body) -> Floats:
        return self.strength * bell(body.centroids, self.centre, self.radius)
