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

(`warpbrain.kernels.pore`; `N` stabilises pairs of linear displacement and linear pressure as in White and Borja, CMAME
197, 2008). So a step has a potential, and its forces are the slope of it. In an equilibrium the flow is steady: the
pressure is that of the drained faces where nothing is exchanged, and the skeleton carries the load alone.

The ramp, and the share of a load step, multiply both pressures, `pressure` and `capillary_pressure`.

A step shorter than `d^2 / (6 c)`, `d` the size of the elements at a drained face and `c = k (K + 4/3 mu)`, cannot
follow the pressure there, which overshoots (Vermeer and Verruijt 1981).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from warpbrain.arrays import Bools, Floats
from warpbrain.kernels.pore import pore_kernels
from warpbrain.mesh import TetMesh
from warpbrain.physics.expectation import Expectation
from warpbrain.physics.mechanism import Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation
from warpbrain.physics.regions import elements_of
from warpbrain.physics.term import Body, Coupling, Term

#: Relative change of a steady pressure that is worth another solve.
_STEADY = 1e-7
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
        "Node set on whose faces the fluid is free to leave; the whole surface if empty.", default="", kind="node set"
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
    elements: str = parameter("Element set that has pores; all if empty.", default="", kind="element set")
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
        nodes = np.zeros(len(mesh.points), dtype=bool)
        nodes[faces] = True
        porous = np.zeros(len(mesh.points), dtype=bool)
        porous[mesh.tetrahedra[elements_of(mesh, self.elements)]] = True
        return nodes & porous

    def bind(self, body: Body) -> "DrainageTerm":
        return DrainageTerm(body, self)


class DrainageTerm(Term):
    """`Drainage` on a device, with the fluid that it remembers.

    The pressure is held as that of the drained nodes and what is `beyond` it, zero there. `softness` (k,) is `1/(2 mu)`
    of each element [1/Pa], of the stabilisation; with the factor that its moduli have.
    """

    memory = ("_held", "_shape", "_beyond")
    lasting = ("coupling", "_pores")
    coupling: Coupling

    def __init__(self, body: Body, mechanism: Drainage) -> None:
        elements = elements_of(body.mesh, mechanism.elements)
        super().__init__(body, body.tetrahedra[elements], mechanism.factor)
        self.mechanism = mechanism
        made, self._kernels = pore_kernels(body.precision)
        scalar, vec3 = body.precision.scalar, body.precision.vec3
        size, count = len(body.mesh.points), len(elements)
        volumes = body.mesh.volumes[elements]
        self._elements = self.array(elements, int)
        self._volume = self.array(volumes, scalar)
        self._numbers = self.array(np.zeros(3), scalar)
        self._closed = self.array(~mechanism.open_nodes(body.mesh), scalar)
        lumped = np.bincount(self.stencils.ravel(), np.repeat(0.25 * volumes, 4), minlength=size)
        self._lumped = self.array(lumped, scalar)
        self._place_rows(size)
        self.softness, self._storage, self._entries = self.zeros(count), self.zeros(count, 10), self.zeros(count, 10)
        self._element_coupling = self.zeros(count, 4, dtype=vec3)
        self._taken, self._held, self._change = self.zeros(count), self.zeros(size), self.zeros(size)
        self._supply, self._beyond = self.zeros(size), self.zeros(size)
        self._shape = self.zeros(size, dtype=vec3)
        compliance, yielding = (self.zeros(len(self._rows)) for _ in range(2))
        own, others = (self.zeros(len(self._rows), dtype=vec3) for _ in range(2))
        self.coupling = Coupling(self._offsets, self._columns, compliance, yielding, own, self._held)
        self._h = np.inf
        # of `A`, made where they are needed
        self._factors: Any = None
        self._pores = made()
        self._pores.nodes, self._pores.inverse_edges = body.nodes, body.inverse_edges
        self._pores.softness, self._pores.scale = self.softness, self.scale
        self._pores.own, self._pores.others = own, others
        for name in (
            *("elements", "volume", "taken", "corner_first", "corners", "closed", "lumped", "held", "beyond"),
            *("rows", "offsets", "columns", "first", "contributions", "numbers"),
        ):
            setattr(self._pores, name, getattr(self, f"_{name}"))
        self.take_moduli()

    def _place_rows(self, size: int) -> None:
        """Sparse rows over the nodes, and who contributes to each entry: `16 e + 4 a + b` for node pairs (a, b)."""
        nodes = self.stencils.astype(np.int64)
        key = (nodes[:, :, None] * size + nodes[:, None, :]).ravel()
        contributions = np.argsort(key, kind="stable")
        key = key[contributions]
        first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
        rows, columns = np.divmod(key[first], size)
        self._rows, self._columns = self.array(rows, int), self.array(columns, int)
        self._offsets = self.array(np.searchsorted(rows, np.arange(size + 1)), int)
        self._first = self.array(np.r_[first, len(key)], int)
        self._contributions = self.array(contributions, int)
        corners = np.argsort(nodes.ravel(), kind="stable")
        self._corner_first = self.array(np.searchsorted(nodes.ravel()[corners], np.arange(size + 1)), int)
        self._corners = self.array(corners, int)

    # -- the pressure's system ------------------------------------------------------------------------------------

    def _over_compliance(self, given: wp.array) -> Floats:
        """`A^-1` times numbers of the nodes, on the host: fewer than a third of those of a displacement."""
        from scipy.sparse import csr_matrix, diags
        from scipy.sparse.linalg import splu

        if self._factors is None:
            c, size = self.coupling, len(self._held)
            A = csr_matrix(
                (c.compliance.numpy().astype(np.float64), c.columns.numpy(), c.offsets.numpy()), (size, size)
            )
            # a node outside the pores has no row, and no pressure
            A = (A + diags((A.diagonal() == 0.0).astype(np.float64))).tocsc()
            options = {"SymmetricMode": True}
            self._factors = splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        return np.asarray(self._factors.solve(given.numpy().astype(np.float64)))

    def _element_compliance(self, mass: float, stabilisation: float, flow: float, out: wp.array) -> None:
        scalar = self.body.precision.scalar
        self.launch(
            self._kernels.compliance, len(self.stencils), self._pores, scalar(mass), scalar(stabilisation),
            scalar(flow * self.mechanism.permeability), self._shape, out,
        )  # fmt: skip

    def take_moduli(self) -> None:
        body, elements = self.body, self._elements.numpy()
        self.softness.assign(0.5 / (body.stiffness_factors * body.shear_moduli)[elements])
        self._element_compliance(self.mechanism.storage, 1.0, 0.0, self._storage)
        # the solid gives way to a pressure that varies over a length that is short beside the body: mass over
        # `lam + 2 mu`, element by element
        modulus = (body.stiffness_factors * (body.volumetric_moduli + 2.0 * body.shear_moduli))[elements]
        pairs = [2.0 if a == b else 1.0 for a in range(4) for b in range(a, 4)]
        self._entries.assign(np.outer(self._volume.numpy().astype(np.float64) / (20.0 * modulus), pairs))
        self._gather(self.coupling.yielding)
        self._renew()

    def _renew(self) -> None:
        """`A` and the numbers, for the time step and the shape at the beginning of it."""
        steady, m = not self.coupled, self.mechanism
        exchanged = m.exchange * (m.capillary_pressure - m.pressure)
        source = exchanged if steady else self._h * exchanged - m.storage * m.pressure
        self._numbers.assign([m.pressure, source, 0.0 if steady else 1.0])
        mass = m.exchange if steady else m.storage + self._h * m.exchange
        self._element_compliance(mass, 0.0 if steady else 1.0, 1.0 if steady else self._h, self._entries)
        self._gather(self.coupling.compliance)
        self._factors = None

    def _gather(self, out: wp.array) -> None:
        """Sum entries of elements into sparse rows."""
        self.launch(self._kernels.gather_compliance, len(self._rows), self._pores, self._entries, out)

    def _solve(self, u: wp.array) -> None:
        """The pressure at a displacement."""
        self.launch(self._kernels.volumes, len(self.stencils), self._pores, u)
        self.launch(self._kernels.supply, len(self._held), self._pores, self._supply)
        self._beyond.assign(self._over_compliance(self._supply))

    def pressures(self) -> Floats:
        """Pressure of the fluid at the nodes (n,) [Pa], at the displacement of the last evaluation.

        Zero where there are no pores.
        """
        base = self.mechanism.pressure * float(self.scale.numpy()[0])
        total = base + self._beyond.numpy().astype(np.float64)
        return np.where(self._lumped.numpy() > 0.0, total, 0.0)

    def nodal_pressures(self) -> dict[str, Floats]:
        return {"fluid_pressure": self.pressures()}

    # -- memory ---------------------------------------------------------------------------------------------------

    @property
    def coupled(self) -> bool:
        return bool(np.isfinite(self._h))

    def set_time_step(self, h: float) -> None:
        if h != self._h:
            self._h = h
            self._renew()

    def advance(self, u: wp.array) -> None:
        self._solve(u)
        self.launch(self._kernels.content, len(self._held), self._pores, self._storage)
        wp.copy(self._shape, u)
        self._renew()

    def forget(self) -> None:
        self._held.zero_()
        self._shape.zero_()
        self._beyond.zero_()
        self._renew()

    def recall(self, remembered: tuple[wp.array, ...]) -> None:
        super().recall(remembered)
        self._renew()

    def adopt(self, other: Term) -> None:
        # with the other's time step too, but for the shape that this one remembers
        super().adopt(other)
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

    # -- forces ---------------------------------------------------------------------------------------------------

    def evaluate_forces(self, u: wp.array) -> None:
        self._solve(u)
        self.launch(self._kernels.forces, len(self.stencils), self._pores, u, self.forces)

    def evaluate_tangents(self, u: wp.array) -> None:
        self._solve(u)
        outputs = (self.forces, self.blocks, self._element_coupling)
        self.launch(self._kernels.tangents, len(self.stencils), self._pores, u, *outputs)
        self.launch(self._kernels.gather_coupling, len(self._rows), self._pores, self._element_coupling)

    def add_stiffness(self, x: wp.array, factor: float, y: wp.array, columns: wp.array, rows: wp.array) -> None:
        if not self.coupled:
            return
        self.launch(self._kernels.taken_up, len(self._held), self._pores, columns, x, self._change)
        self._change.assign(self._over_compliance(self._change))
        number = self.body.precision.scalar(factor)
        self.launch(self._kernels.push, len(self._held), self._pores, self._change, number, rows, y)

    def energy(self, u: wp.array) -> float:
        self._solve(u)
        beyond, taken = self._beyond.numpy().astype(np.float64), self._taken.numpy().astype(np.float64)
        base = self.mechanism.pressure * float(self.scale.numpy()[0])
        if self.coupled:
            stored = 0.5 * float(beyond @ self._supply.numpy().astype(np.float64))
        else:
            stored = -float(taken @ beyond[self.stencils].sum(axis=1))
        return stored - 4.0 * base * float(taken.sum())
