"""How far from a rigid surface something is, smooth enough for Newton's method."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Floats
from warpbrain.kernels.distance_field import distance_kernels
from warpbrain.kernels.precision import Precision
from warpbrain.mesh.surface import feature_normals

#: Nodes of the largest grid; a finer one is made coarser.
LARGEST_GRID = 2_000_000
#: Spacings that the grid goes beyond what it is made for.
_MARGIN = 4


class DistanceField:
    """The smoothed signed distance from a surface, on a device; see `warpbrain.kernels.distance_field`.

    The surface is of points (n, 3) [m] and outward triangles (k, 3); beyond an open rim it goes on as the plane of its
    last triangle. The grid holds it and a region, points (r, 3) [m]. What is smaller than its spacing [m] is smoothed;
    that is larger than asked for where the grid would have more than `LARGEST_GRID` nodes. Smoothing alone shifts the
    surface by `h^2/6` times the sum of its curvatures: `in_place` takes that back, and is less smooth.
    """

    def __init__(
        self,
        points: Floats,
        faces: NDArray[np.integer],
        spacing: float,
        region: Floats,
        in_place: bool,
        device: Any,
        precision: Precision,
    ) -> None:
        self._device, self._precision = device, precision
        used, corners = np.unique(faces, return_inverse=True)
        corners = corners.reshape(-1, 3)
        surface = points[used]
        low = np.minimum(surface.min(axis=0), region.min(axis=0))
        size = np.maximum(surface.max(axis=0), region.max(axis=0)) - low
        self.spacing = max(spacing, float(np.prod(size + 2 * _MARGIN * spacing) / LARGEST_GRID) ** (1.0 / 3.0))
        low = low - _MARGIN * self.spacing
        shape = tuple(int(n) for n in np.ceil(size / self.spacing) + 2 * _MARGIN + 1)
        self.origin = precision.vec3(*low)
        self.coefficients = wp.zeros(shape, dtype=precision.scalar, device=device)
        self._fill, self._evaluate = distance_kernels(precision)
        tree = wp.Mesh(
            points=wp.array(surface, dtype=wp.vec3f, device=device),
            indices=wp.array(corners.ravel(), dtype=int, device=device),
        )
        normals, rim = feature_normals(surface, corners)
        reach = 4.0 * float(np.linalg.norm(np.multiply(shape, self.spacing)))
        inputs = [
            tree.id,
            wp.array(surface, dtype=precision.vec3, device=device),
            wp.array(corners, dtype=wp.vec3i, device=device),
            wp.array(normals, dtype=precision.vec3, device=device),
            wp.array(rim, dtype=wp.bool, device=device),
            self.origin,
            precision.scalar(self.spacing),
            precision.scalar(reach),
            self.coefficients,
        ]
        wp.launch(self._fill, dim=shape, inputs=inputs, device=device)
        # the tree is needed until this is done, and no longer
        wp.synchronize_device(device)
        if in_place:
            self._shift_back()

    def _shift_back(self) -> None:
        """Take from the coefficients what smoothing adds, to second order (quasi-interpolation)."""
        d = self.coefficients.numpy()
        curved = np.zeros_like(d)
        for axis in range(3):
            inner = tuple(slice(1, -1) if a == axis else slice(None) for a in range(3))
            curved[inner] += np.diff(d, 2, axis=axis)
        self.coefficients.assign(d - curved / 6.0)

    def at(self, points: wp.array, distances: wp.array, directions: wp.array) -> None:
        """Write distances [m] and directions away from the surface's inside at points [m]."""
        inputs = [
            points, self.coefficients, self.origin, self._precision.scalar(self.spacing), distances, directions
        ]  # fmt: skip
        wp.launch(self._evaluate, dim=len(points), inputs=inputs, device=self._device)
