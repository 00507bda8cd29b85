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

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.kernels.nodal_volume import nodal_volume_kernels
from warpbrain.physics.term import Body, Term


class NodalVolumeTerm(Term):
    """Forces and blocks of the pressure in each element, and the energy of all patches, on a body of quadratic
    elements.

    How pressures follow the displacement, `sum_a c_a g_ab (x) g_ac`, has its diagonal in blocks, the rest is in none.
    `logarithmic` (m,) says whether `U = (ln J)^2 / 2` in an element (laws of the coupled formulation), or `(J - 1)^2 /
    2`; `kinds` (m,) are `warpbrain.simulation.model.Model.element_kinds`.
    """

    in_full = True

    def __init__(self, body: Body, logarithmic: Bools, kinds: Ints) -> None:
        assert body.quadratic is not None
        super().__init__(body, body.quadratic.elements)
        p, mesh, size = body.precision, body.mesh, len(body.quadratic.points)
        made, self._kernels = nodal_volume_kernels(p)
        count, corners = len(mesh.tetrahedra), self.stencils[:, :4]
        keys, patches = np.unique(corners * (kinds.max() + 1) + kinds[:, None], return_inverse=True)
        patches = patches.reshape(count, 4)
        self._patches, self.count = patches, len(keys)
        self._shares = np.repeat(0.25 * mesh.volumes, 4)
        order = np.argsort(patches.ravel(), kind="stable")
        of_patch = np.zeros(self.count, dtype=bool)
        of_patch[patches] = logarithmic[:, None]
        self._logarithmic = of_patch
        self._volumes, self._moduli = np.ones(self.count), np.zeros(self.count)
        self._on_device = v = made()
        v.nodes, v.patches = self._ints(self.stencils), self._ints(patches)
        v.inverse_edges, v.volume = body.inverse_edges, self.array(mesh.volumes, p.scalar)
        v.first = self._ints(np.searchsorted(patches.ravel()[order], np.arange(self.count + 1)))
        v.corners, v.logarithmic = self._ints(order), self._ints(of_patch)
        v.moments = self.zeros(count, 4)
        v.volumes, v.moduli, v.ratio, v.p, v.c, v.change = (self.zeros(self.count) for _ in range(6))
        # what each element adds to `g_ab`, row by row, by patch and node
        self._of_elements = self.zeros(count, 40, dtype=p.vec3)
        keys = (patches[:, :, None] * size + self.stencils.astype(np.int64)[:, None, :]).ravel()
        parts = np.argsort(keys, kind="stable")
        starts = np.flatnonzero(np.diff(keys[parts], prepend=-1))
        owners, nodes = np.divmod(keys[parts][starts], size)
        entries = np.argsort(nodes, kind="stable")
        v.part_first, v.parts = self._ints(np.r_[starts, len(parts)]), self._ints(parts)
        v.patch_first = self._ints(np.searchsorted(owners, np.arange(self.count + 1)))
        v.node_first = self._ints(np.searchsorted(nodes[entries], np.arange(size + 1)))
        v.patch_nodes, v.entries, v.node_patches = map(self._ints, (nodes, entries, owners[entries]))
        element, place = np.divmod(np.unique(self.stencils, return_index=True)[1], 10)
        v.diagonal = self._ints(55 * element + place * (19 - place) // 2 + place)
        # in the order of patches, and in that of nodes
        v.g, v.by_node = (self.zeros(len(starts), dtype=p.vec3) for _ in range(2))
        self._one = self.array(np.ones(1), p.scalar)

    def _ints(self, values: NDArray[Any]) -> wp.array:
        return self.array(np.ascontiguousarray(values, dtype=np.int32), int)

    def take_moduli(self) -> None:
        def total(values: Floats) -> Floats:
            sums = np.bincount(self._patches.ravel(), self._shares * np.repeat(values, 4), self.count)
            return sums.astype(np.float64)

        # how many times its volume each element has grown
        growth = self.body.growth_stretches**3
        self._volumes = total(growth)
        with np.errstate(divide="ignore"):
            self._moduli = self._volumes / total(growth / (self.body.volumetric_moduli * self.body.stiffness_factors))
        # a captured graph reads these arrays
        self._on_device.volumes.assign(self._volumes)
        self._on_device.moduli.assign(self._moduli)

    def _evaluate(self, u: wp.array) -> int:
        """Find the pressures at a displacement; returns how many elements there are."""
        self.launch(self._kernels.moments, len(self.stencils), self._on_device, u)
        self.launch(self._kernels.pressures, self.count, self._on_device)
        return len(self.stencils)

    def evaluate_forces(self, u: wp.array) -> None:
        self.launch(self._kernels.forces, self._evaluate(u), self._on_device, u, self.forces)

    def evaluate_tangents(self, u: wp.array) -> None:
        v, outputs = self._on_device, (self.forces, self.blocks, self._of_elements)
        self.launch(self._kernels.tangents, self._evaluate(u), v, u, *outputs)
        self.launch(self._kernels.gather, len(v.g), v, self._of_elements.flatten())
        self.launch(self._kernels.diagonal, len(v.diagonal), v, self.blocks.flatten())

    def energy(self, u: wp.array) -> float:
        self._evaluate(u)
        ratio = self._on_device.ratio.numpy().astype(np.float64)
        if not ratio.min() > 0.0:
            return np.inf
        change = np.where(self._logarithmic, np.log(ratio), ratio - 1.0)
        return float(0.5 * np.sum(self._volumes * self._moduli * change**2))

    def pressures(self, u: wp.array) -> Floats:
        """`p` in the middle of each element (m,) [Pa], positive in tension."""
        self._evaluate(u)
        return np.asarray(self._on_device.p.numpy().astype(np.float64)[self._patches].mean(axis=1))

    def add_stiffness(
        self, x: wp.array, factor: float, y: wp.array, columns: wp.array, rows: wp.array, scale: wp.array | None = None
    ) -> None:
        """See `Term.add_stiffness`; `scale` (1,) is one more factor, which a captured graph reads."""
        v, scale = self._on_device, self._one if scale is None else scale
        self.launch(self._kernels.taken_up, self.count, v, columns, x)
        inputs = columns, rows, x, self.body.precision.scalar(factor), scale, y
        self.launch(self._kernels.push, len(v.diagonal), v, *inputs)

    def stiffness(self) -> Any:
        """What is not in blocks, as a SciPy matrix (3 n, 3 n) [N/m]."""
        from scipy.sparse import block_diag, csr_matrix, diags

        v = self._on_device
        g, c = v.by_node.numpy().astype(np.float64), v.c.numpy().astype(np.float64)
        owners, starts = v.node_patches.numpy(), v.node_first.numpy()
        nodes = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        columns = 3 * nodes[:, None] + np.arange(3)
        G = csr_matrix((g.ravel(), (np.repeat(owners, 3), columns.ravel())), (self.count, 3 * (len(starts) - 1)))
        diagonal = np.add.reduceat(c[owners, None, None] * g[:, :, None] * g[:, None, :], starts[:-1])
        return G.T @ diags(c) @ G - block_diag(list(diagonal))
