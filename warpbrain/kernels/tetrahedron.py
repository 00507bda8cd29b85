"""What every element kernel of a linear tetrahedron shares: its kinematics and where its results go.

For node `a` of an element of reference volume `V` with shape-function gradient `g_a`, at the deformation gradient
`F = I + sum_a u_a (x) g_a`:

    f_a  = V P g_a                 internal force on the node [N]
    K_ab = V g_a . dP/dF . g_b     tangent block [N/m]

The tangent of a hyperelastic law is symmetric, `K_ba = K_ab^T`: the ten blocks with a <= b are stored, in the order of
`PAIRS`.
"""

from dataclasses import dataclass
from typing import Any, Protocol

import warp as wp

from warpbrain.kernels.module import Precision, compiled_module

#: Local node pairs (a, b) of the ten stored blocks, in storage order.
PAIRS = ((0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3))


@dataclass(frozen=True)
class ElementKernels:
    """The kernels of one law in one precision, each with one thread for an element of a group.

    The last three are device functions, of which kernels of other shapes are made.
    """

    group: Any  # struct of what the next three know of their elements, see `element_kernels`
    forces: Any  # ``(group, u) -> element_forces``
    forces_and_tangents: Any  # the same with ``element_blocks`` as a second output
    energy: Any  # ``(group, u) -> element_energy [J], element_J``
    stress: Any  # ``(elements, F, parameters) -> energy density [Pa], P [Pa]`` for given deformation gradients
    moduli: Any  # ``(elements, F, parameters) -> blocks[e, j, l]`` with ``[i, k]`` = ``dP_ij/dF_kl`` [Pa]
    tangents: Any  # ``(F, G, V, parameters, row) -> V P, K11, K12, K13, K22, K23, K33``
    stress_at: Any  # ``(F, parameters, row) -> P``
    energy_at: Any  # ``(F, parameters, row) -> energy density``


class DeviceLaw(Protocol):
    """What the floors above ask of the device code of a material law (see `warpbrain.physics.laws`)."""

    def __hash__(self) -> int:
        """Kernels are made once for each law."""

    @property
    def key(self) -> str:
        """Unique name of the law and its formulation, a valid identifier."""

    def kernels(self, precision: Precision) -> ElementKernels:
        """Element kernels in a precision, made once."""


@wp.func
def deformation_gradient(u: wp.array[Any], nodes: wp.vec4i, inverse_edges: Any):
    """`F = I + grad u`; formed from displacements so that small strains keep their digits in single precision."""
    u0 = u[nodes[0]]
    edges = wp.matrix_from_cols(u[nodes[1]] - u0, u[nodes[2]] - u0, u[nodes[3]] - u0)
    return edges * inverse_edges + wp.identity(n=3, dtype=inverse_edges.dtype)


@wp.func
def store_forces(VP: Any, inverse_edges: Any, element_forces: wp.array2d[Any], e: int):
    """Store `f_a = V P g_a`: the rows of the inverse edge matrix are `g_1` to `g_3`; the four gradients sum to zero."""
    f1 = VP * inverse_edges[0]
    f2 = VP * inverse_edges[1]
    f3 = VP * inverse_edges[2]
    element_forces[e, 0] = -(f1 + f2 + f3)
    element_forces[e, 1] = f1
    element_forces[e, 2] = f2
    element_forces[e, 3] = f3


@wp.func
def store_blocks(K11: Any, K12: Any, K13: Any, K22: Any, K23: Any, K33: Any, element_blocks: wp.array2d[Any], e: int):
    """Store the ten blocks from the six of nodes 1 to 3: each row and column of blocks sums to zero."""
    K01 = -(K11 + wp.transpose(K12) + wp.transpose(K13))
    K02 = -(K12 + K22 + wp.transpose(K23))
    K03 = -(K13 + K23 + K33)
    element_blocks[e, 0] = -(K01 + K02 + K03)
    element_blocks[e, 1] = K01
    element_blocks[e, 2] = K02
    element_blocks[e, 3] = K03
    element_blocks[e, 4] = K11
    element_blocks[e, 5] = K12
    element_blocks[e, 6] = K13
    element_blocks[e, 7] = K22
    element_blocks[e, 8] = K23
    element_blocks[e, 9] = K33


@wp.func
def _gradient(u: wp.array[Any], nodes: wp.array[wp.vec4i], e: int, point: int, G: Any):
    return deformation_gradient(u, nodes[e], G)


@wp.func
def _directions(G: Any):
    return G


@wp.func
def _forces(VP: Any, point: int, G: Any, element_forces: wp.array2d[Any], e: int):
    store_forces(VP, G, element_forces, e)


@wp.func
def _blocks(
    K11: Any, K12: Any, K13: Any, K22: Any, K23: Any, K33: Any, point: int, G: Any, out: wp.array2d[Any], e: int
):
    store_blocks(K11, K12, K13, K22, K23, K33, out, e)


@dataclass(frozen=True)
class Stencil:
    """How kernels see elements of one shape: at each quadrature point as a linear tetrahedron.

    The rows of `G` are the gradients of the barycentric coordinates 1 to 3; `forces` and `blocks` store what a point
    adds.
    """

    suffix: str  # of the names of compiled modules
    points: int  # quadrature points, of equal weights
    nodes: Any  # type of the array of nodes
    gradient: Any  # ``(u, nodes, e, point, G) -> F``
    directions: Any  # ``(G) -> D``: the rows `d_j` of the six `w d_j . dP/dF . d_k`, j <= k, that `blocks` takes
    forces: Any  # ``(w P, point, G, element_forces, row)``
    blocks: Any  # ``(six blocks, point, G, element_blocks, row)``
    unroll: int | None = None  # see `warpbrain.kernels.module.compiled_module`


#: Linear tetrahedra.
FOUR_NODES = Stencil("", 1, wp.array[wp.vec4i], _gradient, _directions, _forces, _blocks)


def element_kernels(
    key: str,
    stress_of: Any,
    energy_of: Any,
    tangents_of: Any,
    precision: Precision,
    stencil: Stencil,
    of_term: bool = False,
) -> tuple[Any, Any, Any, Any]:
    """Make the kernels that every law has alike: `group`, forces, forces and tangents, and energy of `ElementKernels`.

    `key` is the name of the law; `stress_of`, `energy_of` and `tangents_of` are as there. Volumes, parameters and
    results have a row for each element of the mesh; those `of_term`, of an energy that is added to some elements, one
    for each of these, and all of it is times `scale`.
    """
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"{key}_{precision.name}{stencil.suffix}", stencil.unroll)
    nodes_type, points, share = stencil.nodes, stencil.points, wp.constant(scalar(1.0 / stencil.points))
    gradient_at, directions_of = stencil.gradient, stencil.directions
    add_forces, add_blocks = stencil.forces, stencil.blocks

    @wp.struct
    class Group:
        elements: wp.array[int]
        nodes: nodes_type
        inverse_edges: wp.array[mat33]
        volume: wp.array[scalar]
        parameters: wp.array2d[scalar]
        scale: wp.array[scalar]

    @wp.func
    def weight_of(group: Group, row: int):
        """Volume of a quadrature point."""
        weight = share * group.volume[row]
        if wp.static(of_term):
            weight = group.scale[0] * weight
        return weight

    @wp.kernel(module=module)
    def forces(start: int, group: Group, u: wp.array[vec3], element_forces: wp.array2d[vec3]):
        t = start + wp.tid()
        e = group.elements[t]
        row = wp.where(wp.static(of_term), t, e)
        G = group.inverse_edges[e]
        for point in range(points):
            F = gradient_at(u, group.nodes, e, point, G)
            P = stress_of(F, group.parameters, row)
            add_forces(weight_of(group, row) * P, point, G, element_forces, row)

    @wp.kernel(module=module)
    def forces_and_tangents(
        start: int, group: Group, u: wp.array[vec3], element_forces: wp.array2d[vec3], element_blocks: wp.array2d[mat33]
    ):
        t = start + wp.tid()
        e = group.elements[t]
        row = wp.where(wp.static(of_term), t, e)
        G = group.inverse_edges[e]
        D = directions_of(G)
        for point in range(points):
            F = gradient_at(u, group.nodes, e, point, G)
            VP, K11, K12, K13, K22, K23, K33 = tangents_of(F, D, weight_of(group, row), group.parameters, row)
            add_forces(VP, point, G, element_forces, row)
            add_blocks(K11, K12, K13, K22, K23, K33, point, G, element_blocks, row)

    @wp.kernel(module=module)
    def energy(
        start: int,
        group: Group,
        u: wp.array[vec3],
        element_energy: wp.array[scalar],
        element_J: wp.array[scalar],
    ):
        t = start + wp.tid()
        e = group.elements[t]
        row = wp.where(wp.static(of_term), t, e)
        stored = scalar(0.0)
        smallest = scalar(0.0)
        for point in range(points):
            F = gradient_at(u, group.nodes, e, point, group.inverse_edges[e])
            J = wp.determinant(F)
            # so that a J that is no number counts as smallest
            if point == 0 or not (smallest <= J):
                smallest = J
            # an inverted element has no energy: the caller rejects the state by its J
            if J > scalar(0.0):  # noqa: SIM300  (a scalar of the device, not a constant)
                stored += weight_of(group, row) * energy_of(F, group.parameters, row)
        element_energy[row] = stored
        element_J[row] = smallest

    return Group, forces, forces_and_tangents, energy


def of_elastic_part(stress: Any, energy: Any, tangents: Any, precision: Precision) -> tuple[Any, Any, Any]:
    """Device functions, as those of `ElementKernels`, of tissue that has grown or shrunk by itself.

    With `F = F_e F_g`, `F_g = s I` (Rodriguez et al. 1994), only `F_e = F/s` is elastic, and the energy is that of the
    grown volume, `Psi_g(F) = s^3 Psi(F/s)`. So `P = s^2 P_e` and `dP/dF = s dP_e/dF_e`. `s` is the last parameter.
    """
    scalar, mat33 = precision.scalar, precision.mat33

    @wp.func
    def stress_of(F: mat33, parameters: wp.array2d[scalar], e: int):
        s = parameters[e, parameters.shape[1] - 1]
        return s * s * stress(F / s, parameters, e)

    @wp.func
    def energy_of(F: mat33, parameters: wp.array2d[scalar], e: int):
        s = parameters[e, parameters.shape[1] - 1]
        return s * s * s * energy(F / s, parameters, e)

    @wp.func
    def tangents_of(F: mat33, G: mat33, V: scalar, parameters: wp.array2d[scalar], e: int):
        s = parameters[e, parameters.shape[1] - 1]
        VP, K11, K12, K13, K22, K23, K33 = tangents(F / s, G, s * V, parameters, e)
        return s * VP, K11, K12, K13, K22, K23, K33

    return stress_of, energy_of, tangents_of


def law_kernels(key: str, stress_of: Any, energy_of: Any, tangents_of: Any, precision: Precision) -> ElementKernels:
    """The kernels of a law on linear tetrahedra, and those at given `F`."""
    scalar, mat33 = precision.scalar, precision.mat33
    pointwise = compiled_module(f"{key}_{precision.name}_pointwise")

    @wp.kernel(module=pointwise)
    def stress(
        elements: wp.array[int],
        F: wp.array[mat33],
        parameters: wp.array2d[scalar],
        density: wp.array[scalar],
        P: wp.array[mat33],
    ):
        e = elements[wp.tid()]
        density[e] = energy_of(F[e], parameters, e)
        P[e] = stress_of(F[e], parameters, e)

    @wp.kernel(module=pointwise)
    def moduli(elements: wp.array[int], F: wp.array[mat33], parameters: wp.array2d[scalar], blocks: wp.array3d[mat33]):
        e = elements[wp.tid()]
        axes = wp.identity(n=3, dtype=scalar)
        _, A00, A01, A02, A11, A12, A22 = tangents_of(F[e], axes, scalar(1.0), parameters, e)
        blocks[e, 0, 0] = A00
        blocks[e, 0, 1] = A01
        blocks[e, 0, 2] = A02
        blocks[e, 1, 0] = wp.transpose(A01)
        blocks[e, 1, 1] = A11
        blocks[e, 1, 2] = A12
        blocks[e, 2, 0] = wp.transpose(A02)
        blocks[e, 2, 1] = wp.transpose(A12)
        blocks[e, 2, 2] = A22

    of_elements = element_kernels(key, stress_of, energy_of, tangents_of, precision, FOUR_NODES)
    return ElementKernels(*of_elements, stress, moduli, tangents_of, stress_of, energy_of)
