"""Kernels of a volume ratio that quadratic tetrahedra share at their corners; see `warpbrain.simulation.mixed`.

A patch is the elements of one tissue around one corner a. With its shape function `L_a` and quadrature points of weight
`w` (`warpbrain.kernels.ten_nodes`), its volume is `M_a = sum w L_a J`, and the derivative of that by the displacement
of node b is `g_ab = sum w L_a cof(F) grad N_b`. An energy `E(M_a)` of each patch has

    f_b  = sum w p cof(F) grad N_b,                      p = sum_a L_a p_a,   p_a = dE/dM_a
    K_bc = sum w p [F (grad N_c x grad N_b)]_x  +  sum_a c_a g_ab (x) g_ac,   c_a = d2E/dM_a2

where `[v]_x` is the matrix of `v x`, from the derivative of the cofactor. The last sum couples every two nodes of a
patch. It is not assembled: of it there are diagonal blocks, for preconditioners, and products with vectors.
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.invariants import cofactor
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision
from warpbrain.kernels.ten_nodes import FAR, NEAR, POINTS, UNROLL, add_forces, gradient_at, shape_gradient


@wp.func
def _weight(corner: int, point: int, w: Any):
    """`w L_a` of a corner at a quadrature point."""
    if corner == point:
        return type(w)(NEAR) * w
    return type(w)(FAR) * w


@wp.func
def _pressure_at(p: wp.array[Any], patches: wp.array2d[int], e: int, point: int, w: Any):
    """`w p` at a quadrature point."""
    pressure = w - w
    for a in range(4):
        pressure += _weight(a, point, w) * p[patches[e, a]]
    return pressure


@cache
def nodal_volume_kernels(precision: Precision) -> KernelSet:
    """Make (once) the kernels of a precision."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"nodal_volume_{precision.name}", unroll=UNROLL)
    share = wp.constant(scalar(1.0 / POINTS))
    vec4 = wp.types.vector(4, scalar)

    @kernels.add
    def moments(
        nodes: wp.array2d[int],
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array2d[scalar],
    ):
        """``(nodes, inverse_edges, volume, u) -> moments``, what an element adds to `M_a` of its corners."""
        e = wp.tid()
        element_moments = vec4()
        for point in range(POINTS):
            J = wp.determinant(gradient_at(u, nodes, e, point, inverse_edges[e]))
            for a in range(4):
                element_moments[a] += _weight(a, point, share * volume[e]) * J
        for a in range(4):
            out[e, a] = element_moments[a]

    @kernels.add
    def pressures(
        first: wp.array[int],
        corners: wp.array[int],
        moments: wp.array2d[scalar],
        volumes: wp.array[scalar],
        moduli: wp.array[scalar],
        logarithmic: wp.array[int],
        ratio: wp.array[scalar],
        p: wp.array[scalar],
        c: wp.array[scalar],
    ):
        """``(first, corners, moments, volumes, moduli, logarithmic) -> ratio, p, c``, one thread for a patch."""
        a = wp.tid()
        sum = scalar(0.0)
        for k in range(first[a], first[a + 1]):
            sum += moments[corners[k] // 4, corners[k] % 4]
        theta = sum / volumes[a]
        one = scalar(1.0)
        slope = theta - one
        curvature = one
        if logarithmic[a] == 1:
            slope = wp.log(theta) / theta
            curvature = (one - wp.log(theta)) / (theta * theta)
        ratio[a] = theta
        p[a] = moduli[a] * slope
        c[a] = moduli[a] * curvature / volumes[a]

    @kernels.add
    def forces(
        nodes: wp.array2d[int],
        patches: wp.array2d[int],
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        p: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array2d[vec3],
    ):
        """``(nodes, patches, inverse_edges, volume, p, u) -> forces``, one thread for an element."""
        e = wp.tid()
        G = inverse_edges[e]
        for point in range(POINTS):
            cof = cofactor(gradient_at(u, nodes, e, point, G))
            add_forces(_pressure_at(p, patches, e, point, share * volume[e]) * cof, point, G, out, e)

    @kernels.add
    def tangents(
        nodes: wp.array2d[int],
        patches: wp.array2d[int],
        inverse_edges: wp.array[mat33],
        volume: wp.array[scalar],
        p: wp.array[scalar],
        u: wp.array[vec3],
        out: wp.array2d[vec3],
        blocks: wp.array2d[mat33],
        of_elements: wp.array2d[vec3],
    ):
        """The same with blocks, and the parts of an element of `g_ab`."""
        e = wp.tid()
        G = inverse_edges[e]
        w = share * volume[e]
        for point in range(POINTS):
            F = gradient_at(u, nodes, e, point, G)
            cof = cofactor(F)
            wp_at = _pressure_at(p, patches, e, point, w)
            for b in range(10):
                g = shape_gradient(b, point, G)
                normal = cof * g
                f = wp_at * normal
                if point > 0:
                    f += out[e, b]
                out[e, b] = f
                for a in range(4):
                    part = _weight(a, point, w) * normal
                    if point > 0:
                        part += of_elements[e, 10 * a + b]
                    of_elements[e, 10 * a + b] = part
                for c in range(b, 10):
                    K = wp_at * wp.skew(F * wp.cross(shape_gradient(c, point, G), g))
                    block = b * (19 - b) // 2 + c
                    if point > 0:
                        K += blocks[e, block]
                    blocks[e, block] = K

    @kernels.add
    def gather(first: wp.array[int], parts: wp.array[int], of_elements: wp.array[vec3], g: wp.array[vec3]):
        """``(first, parts, of_elements) -> g``, one thread for a node of a patch."""
        k = wp.tid()
        total = vec3()
        for part in range(first[k], first[k + 1]):
            total += of_elements[parts[part]]
        g[k] = total

    @kernels.add
    def diagonal(
        first: wp.array[int],
        entries: wp.array[int],
        patches: wp.array[int],
        c: wp.array[scalar],
        g: wp.array[vec3],
        by_node: wp.array[vec3],
        blocks: wp.array2d[mat33],
    ):
        """``(first, entries, patches, c, g) -> g in the order of nodes, blocks``, one thread for a node."""
        b = wp.tid()
        total = mat33()
        for k in range(first[b], first[b + 1]):
            g_ab = g[entries[k]]
            # every product with a vector reads this, one after the other
            by_node[k] = g_ab
            total += wp.outer(c[patches[k]] * g_ab, g_ab)
        blocks[b, 0] = total

    @kernels.add
    def taken_up(
        first: wp.array[int],
        nodes: wp.array[int],
        c: wp.array[scalar],
        g: wp.array[vec3],
        columns: wp.array[vec3],
        x: wp.array[vec3],
        change: wp.array[scalar],
    ):
        """``(first, nodes, c, g, columns, x) -> change of p_a``, one thread for a patch."""
        a = wp.tid()
        total = scalar(0.0)
        for k in range(first[a], first[a + 1]):
            b = nodes[k]
            total += wp.dot(g[k], wp.cw_mul(columns[b], x[b]))
        change[a] = c[a] * total

    @kernels.add
    def push(
        first: wp.array[int],
        patches: wp.array[int],
        by_node: wp.array[vec3],
        change: wp.array[scalar],
        diagonal_blocks: wp.array2d[mat33],
        columns: wp.array[vec3],
        rows: wp.array[vec3],
        x: wp.array[vec3],
        factor: scalar,
        scale: wp.array[scalar],
        y: wp.array[vec3],
    ):
        """``(first, patches, g in the order of nodes, change, diagonal, columns, rows, x, factor, scale) -> y``, one
        thread for a node: without the diagonal blocks, added to `y`."""
        b = wp.tid()
        force = -(diagonal_blocks[b, 0] * wp.cw_mul(columns[b], x[b]))
        for k in range(first[b], first[b + 1]):
            force += change[patches[k]] * by_node[k]
        y[b] += factor * scale[0] * wp.cw_mul(rows[b], force)

    return kernels
