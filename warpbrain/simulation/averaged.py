"""Tetrahedra that lock less: nodally averaged deformation gradients, stabilised (Puso and Solberg 2006).

    Pi = sum_a V_a (Psi(F_a) - s Psi'(F_a)) + s sum_e V_e Psi'(F_e)

`F_a` is the mean of the deformation gradients of the elements of one tissue around node a, weighted by a quarter of
their volumes, `V_a` that volume. What is taken out little by little has means of its own: with those of what stays it
would hold the wall of a cavity, however little of it is left. `Psi'` is the law with a volumetric modulus of at most
`KEPT` shear moduli, `s` a small part. The first sum alone does not lock, and bends better than linear tetrahedra do,
but has modes that alternate from element to element without energy; the elements' own part gives them some. Energies
are linear in the volumetric modulus, so the first sum is the law with another one, times 1 - s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Ints
from warpbrain.kernels.averaged_gradient import averaged_kernels
from warpbrain.kernels.tetrahedron import ElementKernels
from warpbrain.physics.term import Body, Term
from warpbrain.simulation.model import Material

#: `s`, and the largest volumetric modulus [shear moduli] in `Psi'`.
PART, KEPT = 0.05, 5.0


def own_modulus(material: Material) -> float:
    """Volumetric modulus of `Psi'` [Pa]."""
    return min(material.volumetric_modulus, KEPT * material.law.shear_modulus)


def averaged_modulus(material: Material) -> float:
    """Volumetric modulus [Pa] of the law whose energy, times 1 - s, is `Psi - s Psi'`."""
    return (material.volumetric_modulus - PART * own_modulus(material)) / (1.0 - PART)


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of as many nodes each: nodes (k, s), ascending, and by pairs of element and patch what each has of it."""

    nodes: Ints
    members: Ints  # elements (c,)
    owner: Ints  # patch (c,) of each
    shares: Floats  # volume (c,) [m3] of the element that is the patch's
    gradients: Floats  # `G_b` (k, s, 3) [1/m]: means of the gradients of shape functions

    @classmethod
    def of(cls, body: Body, nodes: Ints, elements: list[Ints]) -> Patches:
        """Of the nodes (k, s) and the elements of each."""
        members = np.concatenate(elements)
        owner = np.repeat(np.arange(len(nodes)), [len(each) for each in elements])
        shares = 0.25 * body.mesh.volumes[members]
        last = body.inverse_edges.numpy().astype(np.float64)[members]
        gradients = np.concatenate([-last.sum(axis=1, keepdims=True), last], axis=1)
        corners = body.tetrahedra[members]
        # where each corner stands among the patch's nodes
        places = np.stack([np.sum(nodes[owner] < corners[:, a, None], axis=1) for a in range(4)], axis=1)
        means = np.zeros((*nodes.shape, 3))
        np.add.at(means, (owner[:, None], places), shares[:, None, None] * gradients)
        volumes = np.bincount(owner, shares, minlength=len(nodes)).astype(np.float64)
        return cls(nodes, members, owner, shares, means / volumes[:, None, None])


class AveragedTerm(Term):
    """Patches of as many nodes each, under the law of some kernels."""

    in_full = True

    def __init__(self, body: Body, patches: Patches, kernels: ElementKernels) -> None:
        super().__init__(body, patches.nodes)
        p, count = body.precision, len(patches.nodes)
        self._law, self._kernels = kernels, averaged_kernels(p)
        self._members, self._owner, self._shares = patches.members, patches.owner, patches.shares
        self._nodes = self.array(self.stencils, int)
        self._gradients = self.array(patches.gradients, p.vec3)
        self._volumes = np.zeros(count)
        self._volume, self._density = self.zeros(count), self.zeros(count)
        self._parameters: wp.array = None
        rows, columns = np.triu_indices(patches.nodes.shape[1])
        self._rows, self._columns = self.array(rows, int), self.array(columns, int)
        self._all = self.array(np.arange(count), int)
        self._F, self._P = self.zeros(count, dtype=p.mat33), self.zeros(count, dtype=p.mat33)
        self._moduli = self.zeros(count, 3, 3, dtype=p.mat33)

    def _sum(self, values: Floats) -> Floats:
        """Sum of `w_e` times values of elements over each patch."""
        sums = np.bincount(self._owner, self._shares * values[self._members], minlength=len(self.stencils))
        return sums.astype(np.float64)

    def set_elements(self, parameters: Floats, weight: Floats) -> None:
        """Take what the elements have: parameters (m, c) of the law, of which each patch takes the mean, and a factor
        (m,) on the energy of each.
        """
        volumes = self._sum(np.ones(len(weight)))
        means = np.stack([self._sum(column) / volumes for column in parameters.T], axis=1)
        if self._parameters is None:
            self._parameters = self.array(means, self.body.precision.scalar)
        else:
            # a captured graph reads this array
            self._parameters.assign(means)
        self._volumes = (1.0 - PART) * self._sum(weight)
        self._volume.assign(self._volumes)

    def shares(self, weight: Floats) -> tuple[Ints, Ints, Floats]:
        """Elements, the patch of each, and its share of that by volumes times weights (m,); an element has several."""
        parts, sums = self._shares * weight[self._members], self._sum(weight)
        return self._members, self._owner, parts / sums[self._owner]

    def stress(self, u: wp.array) -> tuple[Ints, Ints, Floats]:
        """Elements, the patch of each, and the first Piola-Kirchhoff stress of each patch [Pa], (k, 3, 3)."""
        self._stress(u)
        return self._members, self._owner, self._P.numpy().astype(np.float64)

    def _stress(self, u: wp.array) -> None:
        count = len(self.stencils)
        self.launch(self._kernels.gradient, count, self._nodes, self._gradients, u, self._F)
        self.launch(self._law.stress, count, self._all, self._F, self._parameters, self._density, self._P)

    def evaluate_forces(self, u: wp.array) -> None:
        self._stress(u)
        self.launch(self._kernels.forces, self.stencils.shape, self._gradients, self._volume, self._P, self.forces)

    def evaluate_tangents(self, u: wp.array) -> None:
        self.evaluate_forces(u)
        count = len(self.stencils)
        self.launch(self._law.moduli, count, self._all, self._F, self._parameters, self._moduli)
        geometry = (self._rows, self._columns, self._gradients, self._volume)
        self.launch(self._kernels.tangents, (count, len(self._rows)), *geometry, self._moduli, self.blocks)

    def energy(self, u: wp.array) -> float:
        self._stress(u)
        if float(np.linalg.det(self._F.numpy().astype(np.float64)).min()) <= 0.0:
            return np.inf
        return float(self._density.numpy().astype(np.float64) @ self._volumes)


def patches_of(body: Body, labels: Sequence[int], kinds: Ints) -> list[Patches]:
    """Those of some tissues, around each node of elements of one kind each: a family for each number of nodes.

    `kinds` are those of the elements (m,).
    """
    tetrahedra: NDArray[np.integer] = body.tetrahedra
    corner_nodes, corner_kinds = tetrahedra.ravel(), np.repeat(kinds, 4)
    order = np.lexsort((np.arange(len(corner_nodes)), corner_kinds, corner_nodes))
    keys = np.stack([corner_nodes[order], corner_kinds[order]], axis=1)
    starts = np.flatnonzero(np.any(keys[1:] != keys[:-1], axis=1)) + 1
    families: dict[int, list[tuple[Ints, Ints]]] = {}
    for corners in np.split(order, starts):
        elements = corners // 4
        nodes = np.unique(tetrahedra[elements])
        if int(body.mesh.tissue[elements[0]]) in labels:
            families.setdefault(len(nodes), []).append((nodes, elements))
    return [
        Patches.of(body, np.array([nodes for nodes, _ in patches]), [elements for _, elements in patches])
        for _, patches in sorted(families.items())
    ]
