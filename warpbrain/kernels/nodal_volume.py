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
from warpbrain.kernels.module import KernelSet, Precision
from warpbrain.kernels.ten_nodes import POINTS, UNROLL, add_forces, coordinate, gradient_at, shape_gradient


@wp.func
def _weight(corner: int, point: int, w: Any):
    """`w L_a` of a corner at a quadrature point."""
    return coordinate(corner, point, w) * w


@wp.func
def _pressure_at(p: wp.array[Any], patches: wp.array2d[int], e: int, point: int, w: Any):
    """`w p` at a quadrature point."""
    pressure = w - w
    for a in range(4):
        pressure += _weight(a, point, w) * p[patches[e, a]]
    return pressure


@cache
def nodal_volume_kernels(precision: Precision) -> tuple[Any, KernelSet]:
    """Make (once) what the kernels of a precision know of elements and patches, and the kernels."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"nodal_volume_{precision.name}", unroll=UNROLL)
    share = wp.constant(scalar(1.0 / POINTS))
    vec4 = wp.types.vector(4, scalar)

    @wp.struct
    class Volumes:
        # of each element: its nodes, and the patch at each corner
        nodes: wp.array2d[int]
        patches: wp.array2d[int]
        inverse_edges: wp.array[mat33]
        volume: wp.array[scalar]
        moments: wp.array2d[scalar]
        # of each patch, and the corners of elements in it
        first: wp.array[int]
        corners: wp.array[int]
        volumes: wp.array[scalar]
        moduli: wp.array[scalar]
        logarithmic: wp.array[int]
        ratio: wp.array[scalar]
        p: wp.array[scalar]
        c: wp.array[scalar]
        # `g` has a row for each node of each patch, the sum of some parts of elements; `by_node` is in that of nodes
        part_first: wp.array[int]
        parts: wp.array[int]
        g: wp.array[vec3]
        by_node: wp.array[vec3]
        # of each patch: its nodes, and how much its pressure changes
        patch_first: wp.array[int]
        patch_nodes: wp.array[int]
        change: wp.array[scalar]
        # of each node: its rows of `g`, the patch of each, and which block of an element has its diagonal one
        node_first: wp.array[int]
        entries: wp.array[int]
        node_patches: wp.array[int]
        diagonal: wp.array[int]

    @kernels.add
    def moments(v: Volumes, u: wp.array[vec3]):
        """One thread for an element: what it adds to `M_a` of its corners."""
        e = wp.tid()
        element_moments = vec4()
        for point in range(POINTS):
            J = wp.determinant(gradient_at(u, v.nodes, e, point, v.inverse_edges[e]))
            for a in range(4):
                element_moments[a] += _weight(a, point, share * v.volume[e]) * J
        for a in range(4):
            v.moments[e, a] = element_moments[a]

    @kernels.add
    def pressures(v: Volumes):
        """One thread for a patch: its ratio of volumes, `p_a` and `c_a`."""
        a = wp.tid()
        sum = scalar(0.0)
        for k in range(v.first[a], v.first[a + 1]):
            sum += v.moments[v.corners[k] // 4, v.corners[k] % 4]
        theta = sum / v.volumes[a]
        one = scalar(1.0)
        slope = theta - one
        curvature = one
        if v.logarithmic[a] == 1:
            slope = wp.log(theta) / theta
            curvature = (one - wp.log(theta)) / (theta * theta)
        v.ratio[a] = theta
        v.p[a] = v.moduli[a] * slope
        v.c[a] = v.moduli[a] * curvature / v.volumes[a]

    @kernels.add
    def forces(v: Volumes, u: wp.array[vec3], out: wp.array2d[vec3]):
        """One thread for an element: its forces."""
        e = wp.tid()
        G = v.inverse_edges[e]
        for point in range(POINTS):
            cof = cofactor(gradient_at(u, v.nodes, e, point, G))
            add_forces(_pressure_at(v.p, v.patches, e, point, share * v.volume[e]) * cof, point, G, out, e)

    @kernels.add
    def tangents(
        v: Volumes,
        u: wp.array[vec3],
        out: wp.array2d[vec3],
        blocks: wp.array2d[mat33],
        of_elements: wp.array2d[vec3],
    ):
        """The same with blocks, and the parts of an element of `g_ab`."""
        e = wp.tid()
        G = v.inverse_edges[e]
        w = share * v.volume[e]
        for point in range(POINTS):
            F = gradient_at(u, v.nodes, e, point, G)
            cof = cofactor(F)
            wp_at = _pressure_at(v.p, v.patches, e, point, w)
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
    def gather(v: Volumes, of_elements: wp.array[vec3]):
        """One thread for a node of a patch: `g_ab`."""
        row = wp.tid()
        total = vec3()
        for part in range(v.part_first[row], v.part_first[row + 1]):
            total += of_elements[v.parts[part]]
        v.g[row] = total

    @kernels.add
    def diagonal(v: Volumes, blocks: wp.array[mat33]):
        """One thread for a node: its rows of `g` one after the other, and its diagonal block, added to an element's."""
        b = wp.tid()
        total = blocks[v.diagonal[b]]
        for i in range(v.node_first[b], v.node_first[b + 1]):
            g_ab = v.g[v.entries[i]]
            # every product with a vector reads this, one after the other
            v.by_node[i] = g_ab
            total += wp.outer(v.c[v.node_patches[i]] * g_ab, g_ab)
        blocks[v.diagonal[b]] = total

    @kernels.add
    def taken_up(v: Volumes, columns: wp.array[vec3], x: wp.array[vec3]):
        """One thread for a patch: the change of `p_a`."""
        a = wp.tid()
        total = scalar(0.0)
        for i in range(v.patch_first[a], v.patch_first[a + 1]):
            b = v.patch_nodes[i]
            total += wp.dot(v.g[i], wp.cw_mul(columns[b], x[b]))
        v.change[a] = v.c[a] * total

    @kernels.add
    def push(
        v: Volumes,
        columns: wp.array[vec3],
        rows: wp.array[vec3],
        x: wp.array[vec3],
        factor: scalar,
        scale: wp.array[scalar],
        y: wp.array[vec3],
    ):
        """One thread for a node: what that does to it without its diagonal block, added to `y`."""
        b = wp.tid()
        own = wp.cw_mul(columns[b], x[b])
        force = vec3()
        for i in range(v.node_first[b], v.node_first[b + 1]):
            a = v.node_patches[i]
            force += (v.change[a] - v.c[a] * wp.dot(v.by_node[i], own)) * v.by_node[i]
        y[b] += factor * scale[0] * wp.cw_mul(rows[b], force)

    return Volumes, kernels
