"""Tetrahedra that do not lock: the pressure of nearly incompressible tissue is that of patches around the nodes.

Each element keeps its law with a volumetric modulus of at most `KEPT` shear moduli; what is above that acts on the mean
volume ratio of the elements of one tissue around each node, a quarter of each (average nodal pressure, Bonet and Burton
1998). What the elements keep is the stabilisation of Puso and Solberg (2006): without it there are modes of pressure that
alternate from element to element.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.kernels.patch_pressure import patch_kernels
from warpbrain.physics.term import Body, Term

Ints = NDArray[np.int64]

#: Volumetric modulus that an element keeps for itself [shear moduli].
KEPT = 2.0


class PatchTerm(Term):
    """Patches of as many nodes each.

    Parameters
    ----------
    body : Body
    stencils : (k, s) int array
        Nodes of each patch, ascending.
    elements : list of k int arrays
        Elements of each patch.
    modulus : (k,) array
        `m` [Pa].
    coupled : bool
        Whether `U` is that of a coupled law.
    """

    def __init__(
        self, body: Body, stencils: Ints, elements: list[Ints], modulus: NDArray[np.float64], coupled: bool
    ) -> None:
        super().__init__(body, stencils)
        scalar, device = body.precision.scalar, body.device
        members = np.concatenate(elements)
        counts = np.array([len(own) for own in elements])
        first = np.r_[0, np.cumsum(counts)]
        owner = np.repeat(np.arange(len(elements)), counts)
        corners = body.tetrahedra[members]
        # where each corner stands among the patch's nodes
        places = np.stack([np.sum(stencils[owner] < corners[:, a, None], axis=1) for a in range(4)], axis=1)
        self._first, self._elements = self.array(first, int), self.array(members, int)
        self._places = self.array(places, wp.vec4i)
        self._weights = self.array(0.25 * body.mesh.volumes[members], scalar)
        self._modulus = self.array(modulus, scalar)
        self._coupled = int(coupled)
        self._gradients = wp.zeros(stencils.shape, dtype=body.precision.vec3, device=device)
        self._energies = wp.zeros(len(stencils), dtype=scalar, device=device)
        self._ratio = wp.ones(len(stencils), dtype=scalar, device=device)
        self._kernels = patch_kernels(body.precision)

    def set_scale(self, scale: float) -> None:
        # a material is there, however little of the load is
        super().set_scale(1.0)

    def _launch(self, kernel: Any, u: wp.array, *outputs: wp.array) -> None:
        body = self.body
        inputs = [self._first, self._elements, self._places, self._weights, self._modulus, self._coupled]
        inputs += [body.nodes, body.inverse_edges, u, self._gradients, *outputs]
        wp.launch(kernel, dim=len(self.stencils), inputs=inputs, device=body.device)

    def evaluate_forces(self, u: wp.array) -> None:
        self._launch(self._kernels.forces, u, self.forces)

    def evaluate_tangents(self, u: wp.array) -> None:
        self._launch(self._kernels.forces, u, self.forces)
        self._launch(self._kernels.tangents, u, self.blocks)

    def energy(self, u: wp.array) -> float:
        self._launch(self._kernels.energies, u, self._energies, self._ratio)
        return float(np.sum(self._energies.numpy(), dtype=np.float64))


def node_patches(tetrahedra: NDArray[np.integer], tissue: NDArray[np.integer]) -> Iterator[tuple[int, Ints, Ints]]:
    """Label, elements and nodes of every patch: the elements of one tissue around each node."""
    corner_nodes = tetrahedra.ravel()
    order = np.lexsort((np.arange(len(corner_nodes)), np.repeat(tissue, 4), corner_nodes))
    keys = np.stack([corner_nodes[order], np.repeat(tissue, 4)[order]], axis=1)
    starts = np.flatnonzero(np.r_[True, np.any(keys[1:] != keys[:-1], axis=1)])
    for start, end in zip(starts, np.r_[starts[1:], len(order)], strict=True):
        elements = order[start:end] // 4
        yield int(keys[start, 1]), elements, np.unique(tetrahedra[elements])


def patch_terms(body: Body, modulus: dict[int, float], coupled: dict[int, bool]) -> list[Term]:
    """The terms of all patches: one for each number of nodes and each kind of law.

    Parameters
    ----------
    body : Body
    modulus : dict of int to float
        `m` [Pa] of each tissue label.
    coupled : dict of int to bool
    """
    families: dict[tuple[int, bool], list[tuple[float, Ints, Ints]]] = {}
    for label, elements, nodes in node_patches(body.tetrahedra, body.mesh.tissue):
        if modulus[label] > 0.0:
            families.setdefault((len(nodes), coupled[label]), []).append((modulus[label], elements, nodes))
    terms: list[Term] = []
    for (_, kind), patches in sorted(families.items()):
        stencils = np.array([nodes for _, _, nodes in patches])
        terms.append(PatchTerm(body, stencils, [e for _, e, _ in patches], np.array([m for m, _, _ in patches]), kind))
    return terms
