"""A term that acts on triangles, from its kernels and what it knows of each triangle."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.kernels.multicore import launch
from warpbrain.physics.term import Body, Term


class TriangleTerm(Term):
    """Forces, tangent blocks and energies of triangles.

    Parameters
    ----------
    body : Body
    triangles : (k, 3) or (k, 6) int array
        Node ids, ascending in each row; of six, those of the corners first.
    points : (n, 3) array
        Reference positions of the body's nodes [m], from any origin.
    data : (k,) or (k, c) array
        Numbers of each triangle.
    kernels : tuple of three wp.Kernel
        ``(nodes, points, data, scale, u) -> forces``, ``-> blocks`` and ``-> energies``; a thread for each triangle.
    ramp : callable
        Factor over time [s].
    """

    def __init__(
        self,
        body: Body,
        triangles: NDArray[np.integer],
        points: NDArray[np.float64],
        data: NDArray[np.float64],
        kernels: tuple[Any, Any, Any],
        ramp: Callable[[float], float],
    ) -> None:
        super().__init__(body, triangles, ramp)
        self._nodes = self.array(self.stencils, wp.vec3i if self.stencils.shape[1] == 3 else int)
        self._points = self.array(points, body.precision.vec3)
        self._data = self.array(data, body.precision.scalar)
        self._energies = wp.zeros(len(data), dtype=body.precision.scalar, device=body.device)
        self._kernels = kernels

    def _launch(self, kernel: Any, u: wp.array, output: wp.array) -> None:
        inputs = [self._nodes, self._points, self._data, self.scale, u, output]
        launch(kernel, len(self.stencils), inputs, self.body.device)

    def evaluate_forces(self, u: wp.array) -> None:
        self._launch(self._kernels[0], u, self.forces)

    def evaluate_tangents(self, u: wp.array) -> None:
        self.evaluate_forces(u)
        self._launch(self._kernels[1], u, self.blocks)

    def energy(self, u: wp.array) -> float:
        self._launch(self._kernels[2], u, self._energies)
        return float(np.sum(self._energies.numpy(), dtype=np.float64))
