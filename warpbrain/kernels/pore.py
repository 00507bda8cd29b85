"""Kernels of a fluid in the pores of linear tetrahedra: its pressure at the nodes, linear in each element.

In an element of reference volume `V` with the gradients `g_a` of its shape functions, at `F` with `J = det F`:

    b_a = V/4 (J - 1)                              fluid that the deformation takes up [m3]
    H_ab = V k/J (cof F g_a) . (cof F g_b)         flow, Darcy's law in the deformed body [m3/(Pa s)]
    M_ab = V (1 + delta_ab)/20                     storage and exchange
    N_ab = V/(2 mu) ((1 + delta_ab)/20 - 1/16)     stabilisation

Numbers of a step are in an array: the pressure at drained nodes [Pa], the source of each volume [1, or 1/s of a steady
flow], and 1 or 0, whether a step or a steady flow.

`J C^-1 = cof F^T cof F / J`. `N` is what White and Borja (2008) add to the rate of storage: the product of what of two
pressures is not constant in an element (Dohrmann and Bochev 2004). It is zero for a uniform pressure, so no fluid is
lost, and zero in a steady flow, which has no rate.
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.invariants import cofactor
from warpbrain.kernels.module import KernelSet
from warpbrain.kernels.precision import Precision
from warpbrain.kernels.tetrahedron import PAIRS, deformation_gradient, store_blocks, store_forces

#: Place of the entry (a, b) of an element among its ten.
PLACES = tuple(PAIRS.index((min(a, b), max(a, b))) for a in range(4) for b in range(4))


@cache
def pore_kernels(precision: Precision) -> tuple[Any, KernelSet]:
    """Make (once) what the kernels of a precision know, and these."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"pore_{precision.name}")
    vec16i = wp.types.vector(length=16, dtype=int)
    places = wp.constant(vec16i(*PLACES))

    @wp.struct
    class Pores:
        # of each element, and its place among all
        elements: wp.array[int]
        nodes: wp.array[wp.vec4i]
        inverse_edges: wp.array[mat33]
        volume: wp.array[scalar]
        softness: wp.array[scalar]
        taken: wp.array[scalar]
        # of each node, and elements around it
        corner_first: wp.array[int]
        corners: wp.array[int]
        closed: wp.array[scalar]
        lumped: wp.array[scalar]
        held: wp.array[scalar]
        beyond: wp.array[scalar]
        # sparse rows over the nodes, and which parts of elements each entry is the sum of
        rows: wp.array[int]
        offsets: wp.array[int]
        columns: wp.array[int]
        first: wp.array[int]
        contributions: wp.array[int]
        own: wp.array[vec3]
        others: wp.array[vec3]
        # of the step
        numbers: wp.array[scalar]
        scale: wp.array[scalar]

    @wp.func
    def shape_gradient(G: mat33, a: int):
        g = -(G[0] + G[1] + G[2])
        if a > 0:
            g = G[a - 1]
        return g

    @kernels.add
    def compliance(
        pores: Pores, mass: scalar, stabilisation: scalar, flow: scalar, u: wp.array[vec3], out: wp.array2d[scalar]
    ):
        """One thread for an element: the ten entries of its part of `S M + N + h (H + k_c M)`."""
        t = wp.tid()
        e = pores.elements[t]
        G = pores.inverse_edges[e]
        F = deformation_gradient(u, pores.nodes[e], G)
        cof = cofactor(F)
        J = wp.dot(F[0], cof[0])
        V = pores.volume[t]
        k = flow * V / J
        even = V / scalar(20.0) * (mass + stabilisation * pores.softness[t])
        less = V / scalar(16.0) * stabilisation * pores.softness[t]
        for a in range(4):
            ga = cof * shape_gradient(G, a)
            for b in range(a, 4):
                entry = even - less + k * wp.dot(ga, cof * shape_gradient(G, b))
                if a == b:
                    entry += even
                out[t, places[4 * a + b]] = entry

    @kernels.add
    def gather_compliance(pores: Pores, entries: wp.array2d[scalar], values: wp.array[scalar]):
        """One thread for an entry of the sparse matrix of all nodes; rows and columns of drained nodes are those of the
        identity."""
        k = wp.tid()
        i = pores.rows[k]
        j = pores.columns[k]
        total = scalar(0.0)
        for c in range(pores.first[k], pores.first[k + 1]):
            which = pores.contributions[c]
            total += entries[which // 16, places[which % 16]]
        total *= pores.closed[i] * pores.closed[j]
        if i == j:
            total += scalar(1.0) - pores.closed[i]
        values[k] = total

    @kernels.add
    def volumes(pores: Pores, u: wp.array[vec3]):
        """One thread for an element: `b_a`, the same for each of its nodes."""
        t = wp.tid()
        e = pores.elements[t]
        F = deformation_gradient(u, pores.nodes[e], pores.inverse_edges[e])
        # det(I + D) - 1 from the invariants of D: small changes keep their digits in single precision
        D = F - wp.identity(n=3, dtype=scalar)
        tr = wp.trace(D)
        second = scalar(0.5) * (tr * tr - wp.ddot(D, wp.transpose(D)))
        pores.taken[t] = pores.volume[t] / scalar(4.0) * (tr + second + wp.determinant(D))

    @kernels.add
    def content(pores: Pores, entries: wp.array2d[scalar]):
        """One thread for a node: the fluid `b + (S M + N) p` around it is what it holds now."""
        i = wp.tid()
        total = scalar(0.0)
        for c in range(pores.corner_first[i], pores.corner_first[i + 1]):
            t = pores.corners[c] // 4
            a = pores.corners[c] % 4
            near = pores.nodes[pores.elements[t]]
            total += pores.taken[t]
            for b in range(4):
                total += entries[t, places[4 * a + b]] * (pores.beyond[near[b]] + pores.numbers[0] * pores.scale[0])
        pores.held[i] = total

    @kernels.add
    def supply(pores: Pores, out: wp.array[scalar]):
        """One thread for a node: right-hand side of the pressure beyond that of the drained nodes."""
        i = wp.tid()
        total = scalar(0.0)
        for c in range(pores.corner_first[i], pores.corner_first[i + 1]):
            total += pores.taken[pores.corners[c] // 4]
        source = pores.numbers[1] * pores.scale[0] * pores.lumped[i]
        out[i] = pores.closed[i] * (pores.numbers[2] * (pores.held[i] - total) + source)

    @wp.func
    def mean_pressure(pores: Pores, e: int):
        total = scalar(0.0)
        for a in range(4):
            total += pores.beyond[pores.nodes[e][a]]
        return pores.numbers[0] * pores.scale[0] + total / scalar(4.0)

    @kernels.add
    def forces(pores: Pores, u: wp.array[vec3], element_forces: wp.array2d[vec3]):
        """One thread for an element: forces of the pressure."""
        t = wp.tid()
        e = pores.elements[t]
        G = pores.inverse_edges[e]
        p = mean_pressure(pores, e)
        F = deformation_gradient(u, pores.nodes[e], G)
        store_forces(-p * pores.volume[t] * cofactor(F), G, element_forces, t)

    @wp.func
    def second_derivative(c: vec3, d: vec3):
        """`g . d(cof F)/dF . h`, times `J`, from `cof F g` and `cof F h`."""
        return wp.outer(c, d) - wp.outer(d, c)

    @kernels.add
    def tangents(
        pores: Pores,
        u: wp.array[vec3],
        element_forces: wp.array2d[vec3],
        element_blocks: wp.array2d[mat33],
        element_coupling: wp.array2d[vec3],
    ):
        """Forces of the pressure, tangent blocks, and `db/du` of the nodes of an element."""
        t = wp.tid()
        e = pores.elements[t]
        G = pores.inverse_edges[e]
        F = deformation_gradient(u, pores.nodes[e], G)
        cof = cofactor(F)
        J = wp.dot(F[0], cof[0])
        V = pores.volume[t]
        p = mean_pressure(pores, e)
        store_forces(-p * V * cof, G, element_forces, t)
        a, b, c = cof * G[0], cof * G[1], cof * G[2]
        s = -p * V / J
        zero = mat33()
        store_blocks(
            zero,
            s * second_derivative(a, b),
            s * second_derivative(a, c),
            zero,
            s * second_derivative(b, c),
            zero,
            element_blocks,
            t,
        )
        quarter = V / scalar(4.0)
        element_coupling[t, 0] = -quarter * (a + b + c)
        element_coupling[t, 1] = quarter * a
        element_coupling[t, 2] = quarter * b
        element_coupling[t, 3] = quarter * c

    @kernels.add
    def gather_coupling(pores: Pores, element_coupling: wp.array2d[vec3]):
        """One thread for an entry: `db_i/du_j` and `db_j/du_i`, zero for the `b` of drained nodes."""
        k = wp.tid()
        total = vec3()
        total_transposed = vec3()
        for c in range(pores.first[k], pores.first[k + 1]):
            which = pores.contributions[c]
            corner = which % 16
            total += element_coupling[which // 16, corner % 4]
            total_transposed += element_coupling[which // 16, corner // 4]
        pores.own[k] = pores.closed[pores.rows[k]] * total
        pores.others[k] = pores.closed[pores.columns[k]] * total_transposed

    @kernels.add
    def taken_up(pores: Pores, mask: wp.array[vec3], x: wp.array[vec3], out: wp.array[scalar]):
        """One thread for a node: `db/du x`."""
        i = wp.tid()
        total = scalar(0.0)
        for k in range(pores.offsets[i], pores.offsets[i + 1]):
            j = pores.columns[k]
            total += wp.dot(pores.own[k], wp.cw_mul(mask[j], x[j]))
        out[i] = total

    @kernels.add
    def push(pores: Pores, p: wp.array[scalar], factor: scalar, mask: wp.array[vec3], y: wp.array[vec3]):
        """One thread for a node: `y += factor (db/du)^T p`."""
        i = wp.tid()
        total = vec3()
        for k in range(pores.offsets[i], pores.offsets[i + 1]):
            total += p[pores.columns[k]] * pores.others[k]
        y[i] = y[i] + factor * wp.cw_mul(mask[i], total)

    return Pores, kernels
