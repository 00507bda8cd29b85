"""Kernels of a pressure that patches of tetrahedra share, against volumetric locking.

A patch is a list of elements with weights `w_e`; its volume is `V = sum_e w_e V_e`, and with `v = sum_e w_e V_e J_e`

    Pi = V U(v / V),    f_a = U' dv/dx_a,    K_ab = U''/V dv/dx_a (x) dv/dx_b + U' d2v/(dx_a dx_b)

where an element gives `V_e cof(F_e) g_a` to `dv/dx_a` and `V_e/J_e (c_a (x) c_b - c_b (x) c_a)`, `c = cof(F_e) g`, to the
second derivative (Bonet and Burton 1998 for the patches around nodes; the mean dilatation of Nagtegaal, Parks and Rice
1974 is the same for others). `U = m/2 (ln J)^2` (coupled laws) or `m/2 (J - 1)^2` (uncoupled ones).
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.invariants import cofactor
from warpbrain.kernels.module import compiled_module
from warpbrain.kernels.precision import Precision
from warpbrain.kernels.tetrahedron import deformation_gradient


@dataclass(frozen=True)
class PatchKernels:
    """Each with one thread for a patch.

    Attributes
    ----------
    forces, tangents, energies : wp.Kernel
        ``(first, elements, places, weights, modulus, coupled, nodes, inverse_edges, u, gradients) -> ...``;
        `tangents` wants the gradients and forces that `forces` left behind.
    """

    forces: Any
    tangents: Any
    energies: Any


@cache
def patch_kernels(precision: Precision) -> PatchKernels:
    """Make (once) the kernels of a precision."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"patch_pressure_{precision.name}")

    @wp.func
    def dilation(
        first: wp.array[int],
        elements: wp.array[int],
        weights: wp.array[scalar],
        nodes: wp.array[wp.vec4i],
        inverse_edges: wp.array[mat33],
        u: wp.array[vec3],
        t: int,
    ):
        """Reference volume of a patch and its mean volume ratio."""
        volume = scalar(0.0)
        now = scalar(0.0)
        for k in range(first[t], first[t + 1]):
            e = elements[k]
            volume += weights[k]
            now += weights[k] * wp.determinant(deformation_gradient(u, nodes[e], inverse_edges[e]))
        return volume, now / volume

    @wp.func
    def slopes(J: scalar, m: scalar, coupled: int):
        """`U'` and `U''`."""
        one = scalar(1.0)
        first = m * (J - one)
        second = m
        if coupled == 1:
            log_J = wp.log(J)
            first = m * log_J / J
            second = m * (one - log_J) / (J * J)
        return first, second

    @wp.kernel(module=module)
    def forces(
        first: wp.array[int],
        elements: wp.array[int],
        places: wp.array[wp.vec4i],
        weights: wp.array[scalar],
        modulus: wp.array[scalar],
        coupled: int,
        nodes: wp.array[wp.vec4i],
        inverse_edges: wp.array[mat33],
        u: wp.array[vec3],
        gradients: wp.array2d[vec3],
        out: wp.array2d[vec3],
    ):
        t = wp.tid()
        _volume, J = dilation(first, elements, weights, nodes, inverse_edges, u, t)
        pressure, _stiffness = slopes(J, modulus[t], coupled)
        for a in range(gradients.shape[1]):
            gradients[t, a] = vec3()
        for k in range(first[t], first[t + 1]):
            e = elements[k]
            G = inverse_edges[e]
            cof = weights[k] * cofactor(deformation_gradient(u, nodes[e], G))
            at = places[k]
            c1, c2, c3 = cof * G[0], cof * G[1], cof * G[2]
            gradients[t, at[0]] = gradients[t, at[0]] - (c1 + c2 + c3)
            gradients[t, at[1]] = gradients[t, at[1]] + c1
            gradients[t, at[2]] = gradients[t, at[2]] + c2
            gradients[t, at[3]] = gradients[t, at[3]] + c3
        for a in range(gradients.shape[1]):
            out[t, a] = pressure * gradients[t, a]

    @wp.func
    def position(a: int, b: int, s: int):
        """Of the pair (a, b), a <= b, row by row in an upper triangle of size s."""
        return a * s - a * (a + 1) / 2 + b

    @wp.kernel(module=module)
    def tangents(
        first: wp.array[int],
        elements: wp.array[int],
        places: wp.array[wp.vec4i],
        weights: wp.array[scalar],
        modulus: wp.array[scalar],
        coupled: int,
        nodes: wp.array[wp.vec4i],
        inverse_edges: wp.array[mat33],
        u: wp.array[vec3],
        gradients: wp.array2d[vec3],
        out: wp.array2d[mat33],
    ):
        t = wp.tid()
        volume, J = dilation(first, elements, weights, nodes, inverse_edges, u, t)
        pressure, stiffness = slopes(J, modulus[t], coupled)
        s = gradients.shape[1]
        for a in range(s):
            for b in range(a, s):
                out[t, position(a, b, s)] = stiffness / volume * wp.outer(gradients[t, a], gradients[t, b])
        for k in range(first[t], first[t + 1]):
            e = elements[k]
            G = inverse_edges[e]
            F = deformation_gradient(u, nodes[e], G)
            cof = cofactor(F)
            factor = pressure * weights[k] / wp.dot(F[0], cof[0])
            at = places[k]
            c1, c2, c3 = cof * G[0], cof * G[1], cof * G[2]
            c0 = -(c1 + c2 + c3)
            # d2 det = skew in its two nodes: nothing of a node with itself
            pair = position(at[0], at[1], s)
            out[t, pair] = out[t, pair] + factor * (wp.outer(c0, c1) - wp.outer(c1, c0))
            pair = position(at[0], at[2], s)
            out[t, pair] = out[t, pair] + factor * (wp.outer(c0, c2) - wp.outer(c2, c0))
            pair = position(at[0], at[3], s)
            out[t, pair] = out[t, pair] + factor * (wp.outer(c0, c3) - wp.outer(c3, c0))
            pair = position(at[1], at[2], s)
            out[t, pair] = out[t, pair] + factor * (wp.outer(c1, c2) - wp.outer(c2, c1))
            pair = position(at[1], at[3], s)
            out[t, pair] = out[t, pair] + factor * (wp.outer(c1, c3) - wp.outer(c3, c1))
            pair = position(at[2], at[3], s)
            out[t, pair] = out[t, pair] + factor * (wp.outer(c2, c3) - wp.outer(c3, c2))

    @wp.kernel(module=module)
    def energies(
        first: wp.array[int],
        elements: wp.array[int],
        places: wp.array[wp.vec4i],
        weights: wp.array[scalar],
        modulus: wp.array[scalar],
        coupled: int,
        nodes: wp.array[wp.vec4i],
        inverse_edges: wp.array[mat33],
        u: wp.array[vec3],
        gradients: wp.array2d[vec3],
        out: wp.array[scalar],
        ratio: wp.array[scalar],
    ):
        t = wp.tid()
        volume, J = dilation(first, elements, weights, nodes, inverse_edges, u, t)
        ratio[t] = J
        away = J - scalar(1.0)
        if coupled == 1:
            away = wp.log(wp.max(J, scalar(0.0)))
        out[t] = scalar(0.5) * modulus[t] * volume * away * away

    return PatchKernels(forces, tangents, energies)
