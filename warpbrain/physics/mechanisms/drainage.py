"""Drainage: fluid in the pores of the tissue carries load until it has flowed away (Biot's consolidation).

The case's own law, with its Poisson ratio, is that of the drained skeleton (`compressibility` says another). The
pressure `p` of the fluid adds to its stress, and the fluid is kept (Biot 1941; Coussy, Poromechanics, 2004):

    P = P_skeleton - p J F^-T
    d/dt (J - 1 + S p) = Div(k J F^-1 F^-T Grad p) + k_c (p_c - p)

`k` is the permeability of the deformed tissue, the same in all directions of space, over the viscosity of the fluid;
`S` its storage, zero where solid and fluid are incompressible; `k_c` lets fluid in or out of the blood, as in oedema or
under mannitol. On drained faces the pressure is given; through all others nothing flows.

Backward Euler in time, with the flow `H` that belongs to the shape at the beginning of a step. The pressure is linear
in each element, and for a given displacement the solution of one symmetric system,

    (S M + N + h (H + k_c M)) p = fluid at the beginning - b(u) + h k_c M p_c,     b(u) = what `J - 1` takes up

So a step has a potential, and its forces are the slope of it. In an equilibrium the flow is steady: the pressure is
that of the drained faces where nothing is exchanged, and the skeleton carries the load alone. In an element of
reference volume `V` with the gradients `g_a` of its shape functions,

    b_a = V/4 (J - 1)                              fluid that the deformation takes up [m3]
    H_ab = V k/J (cof F g_a) . (cof F g_b)         flow, Darcy's law in the deformed body [m3/(Pa s)]
    M_ab = V (1 + delta_ab)/20                     storage and exchange
    N_ab = V/(2 mu) ((1 + delta_ab)/20 - 1/16)     stabilisation

`J C^-1 = cof F^T cof F / J`. `N` is what White and Borja (2008, CMAME 197) add to the rate of storage: the product of
what of two pressures is not constant in an element (Dohrmann and Bochev 2004). It is zero for a uniform pressure, so no
fluid is lost, and zero in a steady flow, which has no rate.

The ramp, and the share of a load step, multiply both pressures, `pressure` and `capillary_pressure`.

A step shorter than `d^2 / (6 c)`, `d` the size of the elements at a drained face and `c = k (K + 4/3 mu)`, cannot
follow the pressure there, which overshoots (Vermeer and Verruijt 1981).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
import warp as wp

from warpbrain.arrays import Bools, Floats
from warpbrain.kernels.invariants import cofactor
from warpbrain.kernels.module import KernelSet, Precision
from warpbrain.kernels.tetrahedron import deformation_gradient, store_blocks
from warpbrain.mesh import TetMesh, nodes_of
from warpbrain.physics.mechanism import Expectation, Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation
from warpbrain.physics.regions import elements_of
from warpbrain.physics.term import Body, Coupling, Term

#: Relative change of a steady pressure that is worth another solve.
_STEADY = 1e-7
#: `M` of an element without its volume.
_MASS = (np.ones((4, 4)) + np.eye(4)) / 20.0
#: Permeabilities that are looked for: so many equally probable ones, at most a factor of 4 apart but for the outermost.
_LOOKED_FOR = 11


@dataclass(frozen=True, kw_only=True)
class Drainage(Mechanism):
    """Fluid in the pores of tissue."""

    permeability: float = parameter(  # `k`
        "Permeability over the viscosity of the fluid.",
        unit="m4/(N s)",
        above=0.0,
        expectation=Expectation.log_normal(3e-13, 30.0),
        typical="1e-14 to 1e-11 measured in brain, up to 1e-10 in models of brain shift",
        source="2.5e-14 human (Franceschini 2006, 2.42e-10 m/s over the weight of water), 4.1e-12 white matter (Cheng "
        "and Bilston 2007), 5.6e-12 (Rey and Sarntinoranont 2018, who cite 1e-16 to 1e-7); 5e-12 grey, 1e-10 white "
        "(Paulsen 1999)",
    )
    storage: float = parameter(  # `S`
        "Fluid that a pressure stores without a change of volume; zero if nothing is compressible.",
        default=0.0,
        unit="1/Pa",
        above=-1e-30,
        # as much as a skeleton of 10 kPa gives way
        size=1e-4,
    )
    drained: str = parameter(
        "Node set on whose faces the fluid may leave.", default="", kind="node set", absent="the whole surface"
    )
    pressure: float = parameter(
        "Pressure of the fluid at drained faces.", default=0.0, unit="Pa", expectation=Expectation.normal(0.0, 500.0)
    )
    exchange: float = parameter(  # `k_c`
        "Fluid that comes out of the blood vessels, for each Pa below the capillary pressure.",
        default=0.0,
        unit="1/(Pa s)",
        above=-1e-30,
        # as much in 100 s
        size=1e-6,
    )
    capillary_pressure: float = parameter(  # `p_c`
        "Pressure at which nothing is exchanged with the blood vessels; lower under mannitol, higher in oedema.",
        default=0.0,
        unit="Pa",
        expectation=Expectation.normal(0.0, 1000.0),
    )
    elements: str = parameter("Element set that has pores.", default="", kind="element set", absent="all tissue")
    kind: ClassVar[str] = "drainage"
    changes_by_itself: ClassVar[bool] = True
    example: ClassVar[str] = "drainage:permeability=1e-9,exchange=1e-6,capillary_pressure=1000"
    absence: ClassVar[str] = "flow of fluid through tissue"
    enters: ClassVar[Enters] = Enters("beside", "W_fluid")
    together: ClassVar[Mapping[str, str]] = {
        "asymmetry": "The law is that of the drained skeleton.",
        "compressibility": "The Poisson ratio is that of the drained skeleton.",
        "falx": "Fluid flows through the membrane.",
        "fibres": "The fibres are part of the skeleton.",
        "gravity": "The load is on skeleton and fluid together; the pressure is that beyond the hydrostatic one.",
        "inclusion": "The skeleton is stiffer; the permeability stays.",
        "pressure": "The load is on skeleton and fluid together; what the fluid has at drained faces is said apart.",
        "residual-stress": "The tension is in the skeleton.",
        "resection": "The wall of what was taken out is surface, and drained where the whole surface is.",
        "swelling": "The skeleton swells, and takes its water through the pores: the fluid sees the whole `F`.",
        "traction": "The load is on skeleton and fluid together.",
        "viscoelasticity": "The skeleton relaxes by itself, and fluid flows.",
    }
    sentence: ClassVar[str] = "Fluid in the tissue carries load at first, and flows away over minutes."
    confused_with: ClassVar[tuple[str, ...]] = ("viscoelasticity", "compressibility", "swelling")
    needs: ClassVar[tuple[str, ...]] = ("two times or more", "a change of volume, or bodies of two sizes")

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """Permeabilities as they are expected, of tissue that drains through its whole surface, or one that is free.

        Without storage and exchange only the product of permeability and time counts: one course serves them all. An
        exchange with the blood is not looked for: what it leaves in the end is a swelling, and said as that.
        """
        situation.require_new(cls.kind)
        if situation.instants < 2:
            raise NotTestableError(f"needs {cls.needs[0]}")
        if "viscoelasticity" in situation.assumed:
            raise NotTestableError("needs tissue that does not relax by itself: the case assumes viscoelasticity")
        expected = cls.parameters()["permeability"].expectation
        assert expected is not None
        # of the largest: its flow is the best known beside what the pores store
        start = math.log(expected.quantile(1.0 - 0.5 / _LOOKED_FOR))
        edges = [expected.quantile(part / _LOOKED_FOR) for part in range(1, _LOOKED_FOR)]
        # the outermost reach as far as their neighbours do
        width = math.log(edges[-1] / edges[-2])

        every = len(situation.mesh.boundary)
        parts = {surface.name: surface.words for surface in situation.free if len(surface.faces) < every}
        return [
            Proposal(
                lambda c, nodes=nodes: cls(permeability=math.exp(float(c[0])), drained=nodes),
                np.array([math.log(expected.quantile((number + 0.5) / _LOOKED_FOR))]),
                np.full(1, width),
                "course",
                np.array([start]),
                pace=lambda c: math.exp(float(c[0]) - start),
                region=f"all tissue, drained through the {words}" if nodes else "all tissue",
            )
            for nodes, words in {"": "", **parts}.items()
            for number in range(_LOOKED_FOR)
        ]

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        if not self.open_nodes(mesh).any() and self.exchange <= 0.0:
            name = f"node set '{self.drained}'" if self.drained else "the surface"
            raise ParameterError("drained", f"{name} holds no face of the tissue with pores: its fluid could not leave")

    def acts_on(self, mesh: TetMesh) -> Bools:
        return np.isin(np.arange(len(mesh.tetrahedra)), elements_of(mesh, self.elements))

    def open_nodes(self, mesh: TetMesh) -> Bools:
        """Nodes (n,) at which the pressure of the fluid is given: of the drained faces of elements with pores."""
        faces = mesh.boundary
        if self.drained:
            faces = faces[mesh.node_sets[self.drained][faces].all(axis=1)]
        porous = mesh.tetrahedra[elements_of(mesh, self.elements)]
        return nodes_of(faces, len(mesh.points)) & nodes_of(porous, len(mesh.points))

    def bind(self, body: Body) -> "DrainageTerm":
        return DrainageTerm(body, self)


class DrainageTerm(Term):
    """`Drainage` with the fluid that it remembers; on the host whatever the device, where its pressure is solved for.

    The pressure is held as that of the drained nodes and what is `beyond` it, zero there. `softness` (k,) is `1/(2 mu)`
    of each element [1/Pa], of the stabilisation; with the factor that its moduli have.
    """

    memory = ("_held", "_shape", "_beyond")

    def __init__(self, body: Body, mechanism: Drainage) -> None:
        elements = elements_of(body.mesh, mechanism.elements)
        super().__init__(body, body.tetrahedra[elements], mechanism.factor)
        self.mechanism, self._elements = mechanism, elements
        size = len(body.mesh.points)
        self._volumes = body.mesh.volumes[elements]
        self._closed = ~mechanism.open_nodes(body.mesh)
        self._lumped = self._at_nodes(0.25 * self._volumes)
        # sparse rows over the nodes, and which parts (a, b) of elements each entry is the sum of
        nodes = self.stencils.astype(np.int64)
        key = (nodes[:, :, None] * size + nodes[:, None, :]).ravel()
        self._parts = np.argsort(key, kind="stable")
        self._starts = np.flatnonzero(np.diff(key[self._parts], prepend=-1))
        self._rows, self._columns = np.divmod(key[self._parts][self._starts], size)
        self._offsets = np.searchsorted(self._rows, np.arange(size + 1))
        self._held, self._beyond = (wp.zeros(size, dtype=wp.float64, device="cpu") for _ in range(2))
        vec3 = body.precision.vec3
        self._shape = self.zeros(size, dtype=vec3)
        self._kernels, self._on_device = _kernels(body.precision), self.array(elements, int)
        self._normals, self._change = self.zeros(len(elements), 4, dtype=vec3), self.zeros(len(elements))
        self._h = np.inf
        #: `db/du` where tangents were evaluated last, and of `A` what solves with it, made where it is needed.
        self._coupling: Any = None
        self._factors: Any = None
        self.take_moduli()

    @property
    def coupling(self) -> Coupling:
        return Coupling(self._compliance, self._yielding, self._coupling, self._held.numpy())

    def _at_nodes(self, amounts: Floats) -> Floats:
        """What each element (k,) adds to each of its nodes, summed there (n,)."""
        sums = np.bincount(self.stencils.ravel(), np.repeat(amounts, 4), minlength=len(self.body.mesh.points))
        return sums.astype(np.float64)

    def _gathered(self, parts: Floats) -> Floats:
        """Parts of elements (k, 4, 4), summed into entries of the sparse rows."""
        return np.add.reduceat(parts.ravel()[self._parts], self._starts)

    def _matrix(self, parts: Floats) -> Any:
        """These as a sparse matrix (n, n); rows and columns of drained nodes are those of the identity."""
        from scipy.sparse import csr_matrix

        i, j = self._rows, self._columns
        values = np.where(self._closed[i] & self._closed[j], self._gathered(parts), 1.0 * (i == j))
        return csr_matrix((values, j, self._offsets), (len(self._lumped),) * 2)

    def _deformed(self, u: wp.array) -> tuple[Floats, Floats]:
        """`cof F g_a` (k, 4, 3) [1/m] and `J - 1` (k,) at a displacement [m]."""
        outputs = self._normals, self._change
        inputs = self._on_device, self.body.nodes, self.body.inverse_edges, u
        self.launch(self._kernels.deform, len(self.stencils), *inputs, *outputs)
        normals, change = (output.numpy().astype(np.float64, copy=False) for output in outputs)
        return normals, change

    def _over_compliance(self, given: Floats) -> Floats:
        """`A^-1` times numbers of the nodes."""
        from scipy.sparse import diags
        from scipy.sparse.linalg import splu

        if self._factors is None:
            A = self._compliance
            # a node outside the pores has no row, and no pressure
            A = (A + diags((A.diagonal() == 0.0).astype(np.float64))).tocsc()
            options = {"SymmetricMode": True}
            self._factors = splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        return np.asarray(self._factors.solve(given))

    def _compliances(self, mass: float, stabilisation: float, flow: float) -> Floats:
        """Parts of elements (k, 4, 4) of `mass M + stabilisation N + flow H`, in the shape at the last advance."""
        normals, change = self._deformed(self._shape)
        soft = stabilisation * self.softness
        flows = flow * self.mechanism.permeability / (1.0 + change)
        mass_, soft, flows, V = (x[:, None, None] for x in (mass + soft, soft, flows, self._volumes))
        return np.asarray(V * (mass_ * _MASS - soft / 16.0 + flows * (normals @ normals.transpose(0, 2, 1))))

    def take_moduli(self) -> None:
        from scipy.sparse import csr_matrix

        body = self.body
        factor, mu, lam = (
            x[self._elements] for x in (body.stiffness_factors, body.shear_moduli, body.volumetric_moduli)
        )
        self.softness = 0.5 / (factor * mu)
        stored = self._gathered(self._compliances(self.mechanism.storage, 1.0, 0.0))
        self._storage = csr_matrix((stored, self._columns, self._offsets), (len(self._lumped),) * 2)
        # the solid gives way to a pressure that varies over a length that is short beside the body: mass over
        # `lam + 2 mu`, element by element
        self._yielding = self._matrix((self._volumes / (factor * (lam + 2.0 * mu)))[:, None, None] * _MASS)
        self._renew()

    def _renew(self) -> None:
        """`A` and the source, for the time step and the shape at the beginning of it."""
        steady, m = not self.coupled, self.mechanism
        exchanged = m.exchange * (m.capillary_pressure - m.pressure)
        self._source = exchanged if steady else self._h * exchanged - m.storage * m.pressure
        mass = m.exchange if steady else m.storage + self._h * m.exchange
        parts = self._compliances(mass, 0.0, 1.0) if steady else self._compliances(mass, 1.0, self._h)
        self._compliance, self._factors = self._matrix(parts), None

    def _solve(self, u: wp.array) -> tuple[Floats, Floats]:
        """Find the pressure at a displacement; returns `cof F g_a` and `J`."""
        normals, change = self._deformed(u)
        self._taken = 0.25 * self._volumes * change
        kept = self._held.numpy() - self._at_nodes(self._taken) if self.coupled else 0.0
        self._supply = self._closed * (kept + self._source * float(self.scale.numpy()[0]) * self._lumped)
        self._beyond.assign(self._over_compliance(self._supply))
        return normals, 1.0 + change

    @property
    def _base(self) -> float:
        """The pressure at drained nodes [Pa]."""
        return self.mechanism.pressure * float(self.scale.numpy()[0])

    def pressures(self) -> Floats:
        """Pressure of the fluid at the nodes (n,) [Pa], at the displacement of the last evaluation.

        Zero where there are no pores.
        """
        return np.where(self._lumped > 0.0, self._base + self._beyond.numpy(), 0.0)

    def nodal_pressures(self) -> dict[str, Floats]:
        return {"fluid_pressure": self.pressures()}

    @property
    def coupled(self) -> bool:
        return bool(np.isfinite(self._h))

    def set_time_step(self, h: float) -> None:
        if h != self._h:
            self._h = h
            self._renew()

    def advance(self, u: wp.array) -> None:
        self._solve(u)
        content = self._storage @ (self._base + self._beyond.numpy())
        self._held.assign(self._at_nodes(self._taken) + content)
        wp.copy(self._shape, u)
        self._renew()

    def forget(self) -> None:
        super().forget()
        self._renew()

    def recall(self, remembered: tuple[wp.array, ...]) -> None:
        super().recall(remembered)
        self._renew()

    def augment(self, u: wp.array) -> bool:
        if self.coupled:
            return False
        # a steady flow is that of the deformed shape
        before = self.pressures()
        wp.copy(self._shape, u)
        self._renew()
        self._solve(u)
        after = self.pressures()
        return bool(np.abs(after - before).max() > _STEADY * np.abs(after).max())

    def evaluate_forces(self, u: wp.array) -> None:
        self._evaluate(u)

    def _evaluate(self, u: wp.array) -> tuple[Floats, Floats, Floats]:
        """Write the forces of the pressure; returns `cof F g_a`, `J`, and the pressure times the volume (k, 1, 1)."""
        normals, J = self._solve(u)
        pV = (self._volumes * (self._base + self._beyond.numpy()[self.stencils].mean(axis=1)))[:, None, None]
        self.forces.assign(-pV * normals)
        return normals, J, pV

    def evaluate_tangents(self, u: wp.array) -> None:
        from scipy.sparse import csr_matrix

        normals, J, pV = self._evaluate(u)
        factors = self.array(-pV.ravel() / J, self.body.precision.scalar)
        self.launch(self._kernels.tangents, len(J), self._normals, factors, self.blocks)
        if not self.coupled:
            return
        # `db_a/du_b` is the same for each of the nodes a
        by_node = (0.25 * self._volumes[:, None, None] * normals).reshape(-1, 3)
        values = np.add.reduceat(by_node[self._parts // 16 * 4 + self._parts % 4], self._starts)
        values[~self._closed[self._rows]] = 0.0
        components = 3 * self._columns[:, None] + np.arange(3)
        shape = (len(self._lumped), 3 * len(self._lumped))
        self._coupling = csr_matrix((values.ravel(), components.ravel(), 3 * self._offsets), shape)

    def add_stiffness(self, x: wp.array, factor: float, y: wp.array, columns: wp.array, rows: wp.array) -> None:
        if not self.coupled:
            return
        change = self._over_compliance(self._coupling @ (columns.numpy() * x.numpy()).ravel())
        pushed = (self._coupling.T @ change).reshape(-1, 3)
        y.assign(y.numpy() + factor * rows.numpy() * pushed)

    def energy(self, u: wp.array) -> float:
        self._solve(u)
        if self.coupled:
            stored = 0.5 * float(self._beyond.numpy() @ self._supply)
        else:
            stored = -float(self._taken @ self._beyond.numpy()[self.stencils].sum(axis=1))
        return stored - 4.0 * self._base * float(self._taken.sum())


@cache
def _kernels(precision: Precision) -> KernelSet:
    """Kernels of what a deformation does to elements, and of tangent blocks, with a thread for an element."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    kernels = KernelSet(f"drainage_{precision.name}")

    @kernels.add
    def deform(
        start: int,
        elements: wp.array[int],
        nodes: wp.array[wp.vec4i],
        inverse_edges: wp.array[mat33],
        u: wp.array[vec3],
        normals: wp.array2d[vec3],
        change: wp.array[scalar],
    ):
        t = start + wp.tid()
        G = inverse_edges[elements[t]]
        F = deformation_gradient(u, nodes[elements[t]], G)
        cof = cofactor(F)
        normals[t, 0] = -(cof * (G[0] + G[1] + G[2]))
        for a in range(3):
            normals[t, a + 1] = cof * G[a]
        # det(I + D) - 1 from the invariants of D: small changes keep their digits in single precision
        D = F - wp.identity(n=3, dtype=scalar)
        tr = wp.trace(D)
        change[t] = tr + scalar(0.5) * (tr * tr - wp.ddot(D, wp.transpose(D))) + wp.determinant(D)

    @kernels.add
    def tangents(start: int, normals: wp.array2d[vec3], factors: wp.array[scalar], blocks: wp.array2d[mat33]):
        """Of `g_a . d(cof F)/dF . g_b`, times `J`: `a b^T - b a^T` with `a = cof F g_a` and `b` alike."""
        t = start + wp.tid()
        a = factors[t] * normals[t, 1]
        b = normals[t, 2]
        c = normals[t, 3]
        bc = factors[t] * wp.skew(wp.cross(c, b))
        store_blocks(mat33(), wp.skew(wp.cross(b, a)), wp.skew(wp.cross(c, a)), mat33(), bc, mat33(), blocks, t)

    return kernels
