"""Kernels of a deformation gradient that is the mean over a patch of tetrahedra.

With the mean gradients `G_b = sum_e w_e g_be / sum_e w_e` of the shape function of node b over the elements of a patch,
`F = I + sum_b u_b (x) G_b` is the mean of the elements' own, and a patch of volume V that has the energy `V Psi(F)`
acts like an element of many nodes:

    f_b = V P G_b,    K_bc = V G_b . dP/dF . G_c

Stress and moduli are those of the law's own pointwise kernels (`warpbrain.kernels.tetrahedron.ElementKernels`).
"""

from functools import cache

import warp as wp

from warpbrain.kernels.module import KernelSet, Precision


@cache
def averaged_kernels(precision: Precision) -> KernelSet:
    """Make (once) the kernels of a precision."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"averaged_gradient_{precision.name}")

    @kernels.add
    def gradient(nodes: wp.array2d[int], gradients: wp.array2d[vec3], u: wp.array[vec3], F: wp.array[mat33]):
        """``(nodes, gradients, u) -> F``, one thread for a patch."""
        t = wp.tid()
        mean = wp.identity(n=3, dtype=scalar)
        for b in range(nodes.shape[1]):
            mean += wp.outer(u[nodes[t, b]], gradients[t, b])
        F[t] = mean

    @kernels.add
    def forces(gradients: wp.array2d[vec3], volume: wp.array[scalar], P: wp.array[mat33], out: wp.array2d[vec3]):
        """``(gradients, volume, P) -> forces``, one thread for a node of a patch."""
        t, b = wp.tid()
        out[t, b] = volume[t] * (P[t] * gradients[t, b])

    @kernels.add
    def tangents(
        rows: wp.array[int],
        columns: wp.array[int],
        gradients: wp.array2d[vec3],
        volume: wp.array[scalar],
        moduli: wp.array3d[mat33],
        out: wp.array2d[mat33],
    ):
        """``(rows, columns, gradients, volume, moduli) -> blocks``, one thread for a pair of nodes of a patch."""
        t, pair = wp.tid()
        g = volume[t] * gradients[t, rows[pair]]
        h = gradients[t, columns[pair]]
        K = mat33()
        for j in range(3):
            for k in range(3):
                K += g[j] * h[k] * moduli[t, j, k]
        out[t, pair] = K

    return kernels
