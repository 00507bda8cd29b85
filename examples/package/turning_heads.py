"""A package beside warpbrain: a head that is turned fast, and points that NumPy has saved."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from warpbrain.mesh import volume_forces
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism, parameter
from warpbrain.physics.potential import Enters
from warpbrain.recordings.recording import TrackedPoints


@dataclass(frozen=True, kw_only=True)
class Turning(Load, Mechanism):
    """Centrifugal force about the axis z through the origin."""

    speed: float = parameter("Angular speed.", unit="rad/s", above=0.0)
    density: float = parameter("Of the tissue.", unit="kg/m3", default=1040.0, above=0.0)
    kind: ClassVar[str] = "turning"
    quadratic: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("load", "f_turning")
    together: ClassVar[Mapping[str, str]] = {}
    sentence: ClassVar[str] = "The head turns about its axis."
    example: ClassVar[str] = "turning:speed=10"
    confused_with: ClassVar[tuple[str, ...]] = ("swelling",)

    def nodal_forces(self, mesh):
        """Forces on the nodes [N]: a force per volume, integrated with the shape functions."""
        outwards = np.array([1.0, 1.0, 0.0])
        return volume_forces(mesh, lambda points: self.density * self.speed**2 * points * outwards)


def read_arrays(path: Path) -> TrackedPoints:
    """Arrays `before` and `after` of a file `.npz` [mm, RAS]."""
    with np.load(path) as arrays:
        if not {"before", "after"} <= set(arrays):
            raise ValueError(f"found arrays {', '.join(arrays)}, expected 'before' and 'after'")
        before, after = arrays["before"] * 1e-3, arrays["after"] * 1e-3
    return TrackedPoints(points=before, displacement=after - before)
