"""What every kernel of a ten-node tetrahedron shares: shape functions, kinematics and where its results go.

With barycentric coordinates `L_c`, whose gradients are constant on an element with straight sides, the gradients of the
shape functions are `(4 L_c - 1) grad L_c` at corner c and `4 (L_c grad L_d + L_d grad L_c)` in the middle of edge cd. A
quadrature point of weight w is what a linear tetrahedron is (`warpbrain.kernels.tetrahedron`), with ten gradients:

    F = I + sum_a u_a (x) g_a,    f_a = w P g_a,    K_ab = w g_a . dP/dF . g_b

There are four points, exact for polynomials of degree 2 (Stroud 1971). That integrates the stiffness of a body at rest
exactly, keeps the order of the element for any law (Ciarlet 1978, theorem 4.1.6), and asks for a volume ratio at four
points only, where more would lock sooner near incompressibility.
"""

from dataclasses import replace
from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import Precision
from warpbrain.kernels.tetrahedron import DeviceLaw, ElementKernels, Stencil, element_kernels

#: Quadrature points of an element; their barycentric coordinates are `NEAR` at one corner and `FAR` at the others.
POINTS = 4
NEAR, FAR = 0.5854101966249685, 0.1381966011250105
#: Longest loop to unroll: pairs of ten nodes at four points would be compiled 220 times over.
UNROLL = 3


@wp.func
def coordinate(c: int, point: int, like: Any):
    """`L_c` at a quadrature point."""
    if c == point:
        return type(like)(NEAR)
    return type(like)(FAR)


@wp.func
def _slope(c: int, G: Any):
    """`grad L_c`; the rows of `G` are those of corners 1 to 3."""
    if c == 0:
        return -(G[0] + G[1] + G[2])
    return G[c - 1]


@wp.func
def _edge_gradient(c: int, d: int, point: int, G: Any):
    one = G.dtype(1.0)
    return G.dtype(4.0) * (coordinate(c, point, one) * _slope(d, G) + coordinate(d, point, one) * _slope(c, G))


@wp.func
def shape_gradient(a: int, point: int, G: Any):
    """Gradient of the shape function of node a at a quadrature point."""
    one = G.dtype(1.0)
    if a < 4:
        return (G.dtype(4.0) * coordinate(a, point, one) - one) * _slope(a, G)
    # edges 01, 02, 03, 12, 13, 23
    if a < 7:
        return _edge_gradient(0, a - 3, point, G)
    if a < 9:
        return _edge_gradient(1, a - 5, point, G)
    return _edge_gradient(2, 3, point, G)


@wp.func
def gradient_at(u: wp.array[Any], nodes: wp.array2d[int], e: int, point: int, G: Any):
    """Deformation gradient at a quadrature point of an element."""
    F = wp.identity(n=3, dtype=G.dtype)
    for a in range(10):
        F += wp.outer(u[nodes[e, a]], shape_gradient(a, point, G))
    return F


@wp.func
def add_forces(VP: Any, point: int, G: Any, element_forces: wp.array2d[Any], t: int):
    """Add a point's share of the forces of row `t`; the first point sets them. `VP` is `w P`."""
    for a in range(10):
        f = VP * shape_gradient(a, point, G)
        if point > 0:
            f += element_forces[t, a]
        element_forces[t, a] = f


@wp.func
def add_blocks(
    A00: Any, A01: Any, A02: Any, A11: Any, A12: Any, A22: Any, point: int, G: Any, out: wp.array2d[Any], t: int
):
    """Add a point's share of the 55 blocks of row `t`; `Ajk` is `w e_j . dP/dF . e_k`."""
    A10 = wp.transpose(A01)
    A20 = wp.transpose(A02)
    A21 = wp.transpose(A12)
    for a in range(10):
        g = shape_gradient(a, point, G)
        K0 = g[0] * A00 + g[1] * A10 + g[2] * A20
        K1 = g[0] * A01 + g[1] * A11 + g[2] * A21
        K2 = g[0] * A02 + g[1] * A12 + g[2] * A22
        for b in range(a, 10):
            h = shape_gradient(b, point, G)
            block = a * (19 - a) // 2 + b
            K = h[0] * K0 + h[1] * K1 + h[2] * K2
            if point > 0:
                K += out[t, block]
            out[t, block] = K


@wp.func
def _axes(G: Any):
    return wp.identity(n=3, dtype=G.dtype)


#: Tetrahedra of ten nodes.
TEN_NODES = Stencil("_quadratic", POINTS, wp.array2d[int], gradient_at, _axes, add_forces, add_blocks, UNROLL)


@cache
def quadratic_kernels(law: DeviceLaw, precision: Precision) -> ElementKernels:
    """Make (once) the element kernels of a law for elements of ten nodes, (m, 10) arrays of int.

    ``energy`` also gives the smallest `J` of an element's quadrature points.
    """
    linear = law.kernels(precision)
    functions = linear.stress_at, linear.energy_at, linear.tangents
    group, forces, tangents, energy = element_kernels(law.key, *functions, precision, TEN_NODES)
    return replace(linear, group=group, forces=forces, forces_and_tangents=tangents, energy=energy)
