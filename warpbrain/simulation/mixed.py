"""Quadratic tetrahedra with a pressure that is linear and continuous in each tissue: P2-P1, of Taylor and Hood (1973).

With the volumetric part `k U(J)` of a law, `Psi = Psi' + k U(J)`, and the volume of a patch, the elements of one tissue
around a corner a (of one that is taken out little by little, those alone) with its shape function `L_a` as weight,

    Pi = sum_e int_e Psi'(F) dV + sum_a V_a k_a U(theta_a),    theta_a = int L_a J dV / V_a,    V_a = int L_a dV

This is the three-field functional of Simo, Taylor and Pister (1985) with volume ratio and pressure
`p_a = k_a U'(theta_a)` at corners, whose matrix of `L_a L_b` is lumped: so each is known from the displacement, and
what is left is a potential of displacements alone. There is one volume ratio for each corner, where `tet10` has four
for each element: that many lock where elements are irregular and nearly incompressible.

Of laws of the coupled formulation `Psi'` is what is left without `lam`, which resists a change of volume too, as two
thirds of the shear modulus do: at each point, which is no more than a percent stiffer.

Where parts of a tissue are stiffer than others, `1 / k_a` is the mean of `1 / k`: as for one pressure in all of them.
The tangent (`warpbrain.kernels.nodal_volume`) is consistent and symmetric. What couples all nodes of a patch is not
assembled, for with it the matrix would be about eight times as large.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.kernels.nodal_volume import nodal_volume_kernels
from warpbrain.physics.term import Body, Term


class _PatchTerm(Term):
    """Of the material itself."""

    in_full = True

    def _ints(self, values: NDArray[Any]) -> wp.array:
        return self.array(np.ascontiguousarray(values, dtype=np.int32), int)


class NodalVolumeTerm(_PatchTerm):
    """Forces and blocks of the pressure in each element, and the energy of all patches, on a body of quadratic
    elements.

    `logarithmic` (m,) says whether `U = (ln J)^2 / 2` in an element (laws of the coupled formulation), or `(J - 1)^2 /
    2`; `kinds` (m,) are `warpbrain.simulation.model.Model.element_kinds`.
    """

    def __init__(self, body: Body, logarithmic: Bools, kinds: Ints) -> None:
        assert body.quadratic is not None
        super().__init__(body, body.quadratic.elements)
        p, mesh = body.precision, body.mesh
        self._kernels = nodal_volume_kernels(p)
        count, corners = len(mesh.tetrahedra), self.stencils[:, :4]
        keys, patches = np.unique(corners * (kinds.max() + 1) + kinds[:, None], return_inverse=True)
        patches = patches.reshape(count, 4)
        self._patches, self.count = patches, len(keys)
        self._shares = np.repeat(0.25 * mesh.volumes, 4)
        order = np.argsort(patches.ravel(), kind="stable")
        self._first = self._ints(np.searchsorted(patches.ravel()[order], np.arange(self.count + 1)))
        self._corners = self._ints(order)
        self._of_element = self._ints(patches)
        of_patch = np.zeros(self.count, dtype=bool)
        of_patch[patches] = logarithmic[:, None]
        self._logarithmic, self._logarithmic_on_device = of_patch, self._ints(of_patch)
        self._nodes = self._ints(self.stencils)
        self._volume = self.array(mesh.volumes, p.scalar)
        self._volumes, self._moduli = np.ones(self.count), np.zeros(self.count)
        self._volumes_on_device = self.array(self._volumes, p.scalar)
        self._moduli_on_device = self.array(self._moduli, p.scalar)
        self._moments = self.zeros(count, 4)
        self._ratio, self._p = self.zeros(self.count), self.zeros(self.count)
        #: `c_a` and what each element adds to `g_ab`, row by row.
        self.curvature = self.zeros(self.count)
        self.of_elements = self.zeros(count, 40, dtype=p.vec3)

    @property
    def patches(self) -> Ints:
        """The patch at each corner of each element (m, 4)."""
        return self._patches

    def set_elements(self, modulus: Floats, weight: Floats, growth: Floats) -> None:
        """Take what the elements (m,) have: volumetric modulus [Pa] of the law, factor on the energy, and how many
        times its volume each has grown.
        """

        def total(values: Floats) -> Floats:
            sums = np.bincount(self._patches.ravel(), self._shares * np.repeat(values, 4), self.count)
            return sums.astype(np.float64)

        self._volumes = total(growth)
        with np.errstate(divide="ignore"):
            self._moduli = self._volumes / total(growth / (modulus * weight))
        # a captured graph reads these arrays
        self._volumes_on_device.assign(self._volumes)
        self._moduli_on_device.assign(self._moduli)

    def _evaluate(self, u: wp.array) -> tuple[Any, ...]:
        """Find the pressures at a displacement; returns what element kernels take."""
        k, count = self._kernels, len(self.stencils)
        shape = (self.body.inverse_edges, self._volume)
        self.launch(k.moments, count, self._nodes, *shape, u, self._moments)
        self.launch(
            k.pressures, self.count, self._first, self._corners, self._moments, self._volumes_on_device,
            self._moduli_on_device, self._logarithmic_on_device, self._ratio, self._p, self.curvature,
        )  # fmt: skip
        return count, self._nodes, self._of_element, *shape, self._p, u

    def evaluate_forces(self, u: wp.array) -> None:
        self.launch(self._kernels.forces, *self._evaluate(u), self.forces)

    def evaluate_tangents(self, u: wp.array) -> None:
        self.launch(self._kernels.tangents, *self._evaluate(u), self.forces, self.blocks, self.of_elements)

    def energy(self, u: wp.array) -> float:
        self._evaluate(u)
        ratio = self._ratio.numpy().astype(np.float64)
        if not ratio.min() > 0.0:
            return np.inf
        change = np.where(self._logarithmic, np.log(ratio), ratio - 1.0)
        return float(0.5 * np.sum(self._volumes * self._moduli * change**2))

    def pressures(self, u: wp.array) -> Floats:
        """`p` in the middle of each element (m,) [Pa], positive in tension."""
        self._evaluate(u)
        return np.asarray(self._p.numpy().astype(np.float64)[self._patches].mean(axis=1))


class PatchStiffnessTerm(_PatchTerm):
    """`sum_a c_a g_ab (x) g_ac`: how pressures follow the displacement. Its diagonal is in blocks, the rest is not.

    Its tangents are evaluated after those of `volumes`.
    """

    def __init__(self, volumes: NodalVolumeTerm) -> None:
        body = volumes.body
        assert body.quadratic is not None
        size = len(body.quadratic.points)
        super().__init__(body, np.arange(size)[:, None])
        p = body.precision
        self._volumes, self._kernels = volumes, nodal_volume_kernels(p)
        nodes = np.repeat(volumes.stencils.astype(np.int64)[:, None, :], 4, axis=1)
        keys = (volumes.patches[:, :, None] * size + nodes).ravel()
        parts = np.argsort(keys, kind="stable")
        starts = np.flatnonzero(np.r_[True, np.diff(keys[parts]) != 0])
        patches, nodes = np.divmod(keys[parts][starts], size)
        entries = np.argsort(nodes, kind="stable")

        self._part_first, self._parts = self._ints(np.r_[starts, len(parts)]), self._ints(parts)
        self._patch_first = self._ints(np.searchsorted(patches, np.arange(volumes.count + 1)))
        self._node_first = self._ints(np.searchsorted(nodes[entries], np.arange(size + 1)))
        self._nodes, self._entries, self._patches = self._ints(nodes), self._ints(entries), self._ints(patches[entries])
        # in the order of patches, and in that of nodes
        self._g, self._by_node = (self.zeros(len(starts), dtype=p.vec3) for _ in range(2))
        self._change = self.zeros(volumes.count)
        self._one = self.array(np.ones(1), p.scalar)

    def evaluate_forces(self, u: wp.array) -> None:
        self.forces.zero_()

    def evaluate_tangents(self, u: wp.array) -> None:
        self.forces.zero_()
        k, size = self._kernels, len(self.stencils)
        of_elements = self._volumes.of_elements.flatten()
        self.launch(k.gather, len(self._g), self._part_first, self._parts, of_elements, self._g)
        self.launch(
            k.diagonal, size, self._node_first, self._entries, self._patches, self._volumes.curvature, self._g,
            self._by_node, self.blocks,
        )  # fmt: skip

    def add_stiffness(
        self, x: wp.array, factor: float, y: wp.array, columns: wp.array, rows: wp.array, scale: wp.array | None = None
    ) -> None:
        """See `Term.add_stiffness`; `scale` (1,) is one more factor, which a captured graph reads."""
        k, size = self._kernels, len(self.stencils)
        inputs = (self._patch_first, self._nodes, self._volumes.curvature, self._g, columns, x, self._change)
        self.launch(k.taken_up, self._volumes.count, *inputs)
        self.launch(
            k.push, size, self._node_first, self._patches, self._by_node, self._change, self.blocks, columns, rows, x,
            self.body.precision.scalar(factor), self._one if scale is None else scale, y,
        )  # fmt: skip

    def stiffness(self) -> Any:
        """What is not in blocks, as a SciPy matrix (3 n, 3 n) [N/m]."""
        from scipy.sparse import block_diag, csr_matrix, diags

        g = self._by_node.numpy().astype(np.float64)
        columns = 3 * self._nodes.numpy()[self._entries.numpy(), None] + np.arange(3)
        shape = (self._volumes.count, 3 * len(self.stencils))
        G = csr_matrix((g.ravel(), (np.repeat(self._patches.numpy(), 3), columns.ravel())), shape)
        diagonal = block_diag(list(self.blocks.numpy()[:, 0].astype(np.float64)))
        return G.T @ diags(self._volumes.curvature.numpy().astype(np.float64)) @ G - diagonal

    def energy(self, u: wp.array) -> float:
        return 0.0
