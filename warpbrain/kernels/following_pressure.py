"""Pressure on triangles of three or six nodes, which follows them as they move, turn and bend.

With the deformed surface `x(r, s) = sum_a N_a x_a`, oriented outwards (Bonet and Wood, Nonlinear Continuum Mechanics,
2nd ed., section 8.5),

    f_a  = p int N_a x_r x x_s dr ds
    K_ab = p/2 int (N_b N_a,r - N_a N_b,r) [x_s] + (N_a N_b,s - N_b N_a,s) [x_r] dr ds,    [d] v = d x v

`K_ab` is the symmetric part of `df_a/dx_b`, which on a closed surface is all of it. Integrands are polynomials of
degree 1 or 4: the rules are exact.
"""

from functools import cache
from typing import Any, TypeAlias

import numpy as np
import warp as wp

from warpbrain.arrays import Floats
from warpbrain.kernels.module import Precision, compiled_module
from warpbrain.kernels.ten_nodes import UNROLL


@cache
def triangles_struct(precision: Precision) -> Any:
    """Make (once) what kernels of a precision know of triangles, those of `warpbrain.physics.term.TriangleTerm`."""
    scalar, vec3 = precision.scalar, precision.vec3

    @wp.struct
    class Triangles:
        nodes: wp.array2d[int]
        points: wp.array[vec3]  # of all nodes of the body
        data: wp.array2d[scalar]
        scale: wp.array[scalar]

    return Triangles


@cache
def pressure_kernels(precision: Precision, nodes: int, rule: tuple[tuple[float, ...], ...]) -> tuple[Any, Any, Any]:
    """Make (once) kernels for forces, tangent blocks and energies, with one thread for a triangle of so many nodes.

    `rule` has the barycentric coordinates of points and their weights, which add up to one.
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"pressure_{nodes}_{precision.name}", unroll=UNROLL)
    Triangles: TypeAlias = triangles_struct(precision)
    points, last = len(rule), 2 * nodes - 1
    table = wp.types.matrix((points, nodes), scalar)
    values, along_r, along_s = _shapes(rule, nodes)
    N = wp.constant(table(*values.ravel()))
    Nr = wp.constant(table(*along_r.ravel()))
    Ns = wp.constant(table(*along_s.ravel()))
    w = wp.constant(wp.types.vector(points, scalar)(*(0.5 * np.array(rule)[:, 3])))

    @wp.func
    def place(s: Triangles, u: wp.array[vec3], t: int, q: int, shapes: table):
        """Sum of deformed positions, weighted by row q of a table."""
        x = vec3()
        for a in range(nodes):
            x += shapes[q, a] * (s.points[s.nodes[t, a]] + u[s.nodes[t, a]])
        return x

    @wp.kernel(module=module)
    def forces(s: Triangles, u: wp.array[vec3], out: wp.array2d[vec3]):
        t = wp.tid()
        p = s.data[t, 0] * s.scale[0]
        for a in range(nodes):
            out[t, a] = vec3()
        for q in range(points):
            normal = wp.cross(place(s, u, t, q, Nr), place(s, u, t, q, Ns))
            for a in range(nodes):
                out[t, a] = out[t, a] + (p * w[q] * N[q, a]) * normal

    @wp.kernel(module=module)
    def tangents(s: Triangles, u: wp.array[vec3], out: wp.array2d[mat33]):
        t = wp.tid()
        p = scalar(0.5) * s.data[t, 0] * s.scale[0]
        for block in range(out.shape[1]):
            out[t, block] = mat33()
        for q in range(points):
            x_r = place(s, u, t, q, Nr)
            x_s = place(s, u, t, q, Ns)
            for a in range(nodes):
                for b in range(a, nodes):
                    d = (N[q, b] * Nr[q, a] - N[q, a] * Nr[q, b]) * x_s
                    d += (N[q, a] * Ns[q, b] - N[q, b] * Ns[q, a]) * x_r
                    block = a * (last - a) // 2 + b
                    out[t, block] = out[t, block] + wp.skew(p * w[q] * d)

    @wp.kernel(module=module)
    def energies(s: Triangles, u: wp.array[vec3], out: wp.array[scalar]):
        t = wp.tid()
        enclosed = scalar(0.0)
        for q in range(points):
            normal = wp.cross(place(s, u, t, q, Nr), place(s, u, t, q, Ns))
            enclosed += w[q] * wp.dot(place(s, u, t, q, N), normal)
        out[t] = s.data[t, 0] * s.scale[0] / scalar(3.0) * enclosed

    return forces, tangents, energies


def _shapes(rule: tuple[tuple[float, ...], ...], nodes: int) -> tuple[Floats, Floats, Floats]:
    """Shape functions at each point and their derivatives by `r = L_1` and `s = L_2`.

    Of the corners 0, 1, 2, and of six nodes the middles of 01, 02 and 12.
    """
    L0, L1, L2 = L = np.array(rule)[:, :3].T
    zero, one = np.zeros(len(rule)), np.ones(len(rule))
    if nodes == 3:
        return L.T, np.stack([-one, one, zero], 1), np.stack([-one, zero, one], 1)
    values = [*(L * (2.0 * L - 1.0)), 4.0 * L0 * L1, 4.0 * L0 * L2, 4.0 * L1 * L2]
    along_r = [1.0 - 4.0 * L0, 4.0 * L1 - 1.0, zero, 4.0 * (L0 - L1), -4.0 * L2, 4.0 * L2]
    along_s = [1.0 - 4.0 * L0, zero, 4.0 * L2 - 1.0, -4.0 * L1, 4.0 * (L0 - L2), 4.0 * L1]
    return np.stack(values, 1), np.stack(along_r, 1), np.stack(along_s, 1)
