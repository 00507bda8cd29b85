"""Pre-processing: a model on a device. Everything that is made once for a mesh; the loops allocate nothing after it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from warp.sparse import BsrMatrix, bsr_zeros

from warpbrain.arrays import Bools, Floats
from warpbrain.errors import InputError, require_kind
from warpbrain.kernels.assembly import assembly_kernels
from warpbrain.kernels.linear import LinearSolver, compact_order, conjugate_gradient, solver_kernels
from warpbrain.kernels.module import begin_loading, find_device, find_precision
from warpbrain.kernels.multicore import launch
from warpbrain.kernels.ten_nodes import quadratic_kernels
from warpbrain.kernels.tetrahedron import DeviceLaw, ElementKernels
from warpbrain.mesh.surface import EDGES
from warpbrain.physics.laws import Law
from warpbrain.physics.laws.device import GrownLaw
from warpbrain.physics.mechanism import Following
from warpbrain.physics.term import T, Term
from warpbrain.simulation.assembly import Assembly
from warpbrain.simulation.averaged import PART, AveragedTerm, averaged_modulus, own_modulus, patches_of
from warpbrain.simulation.coupled import CoupledSolver
from warpbrain.simulation.factors import KeptFactors
from warpbrain.simulation.mixed import NodalVolumeTerm
from warpbrain.simulation.model import Material, Model


def _code(material: Material) -> tuple[type[Law], str, int]:
    """What must stay as it is when a material changes in a system: law, formulation and number of parameters."""
    return type(material.law), material.formulation, len(material.law.parameters())


@dataclass(frozen=True)
class ElementGroup:
    """Elements that share a law and formulation: one launch, whatever their tissues."""

    count: int
    kernels: ElementKernels
    on_device: Any  # the struct of its kernels
    averaged: list[AveragedTerm]


class System:
    """A model pre-processed for a device: arrays, pattern and the sums over elements.

    Parameters
    ----------
    model : Model
    device : str or None
        Warp device; None for Warp's default.
    precision : str
        ``"double"`` or ``"single"``.

    Attributes
    ----------
    u : wp.array of vec3, shape (n,)
        Displacement [m]: what forces, tangents and energy are evaluated at.
    internal, external : wp.array of vec3, shape (n,)
        Internal and external nodal forces [N].
    load : wp.array of vec3, shape (n,)
        Right-hand side of the linear system.
    solution : wp.array of vec3, shape (n,)
        Its solution.
    matrix : BsrMatrix
        The system's matrix, 3 x 3 blocks, pattern fixed.
    free : wp.array of vec3, shape (n,)
        1 for free components, 0 for constrained ones.
    mass : wp.array, shape (n,)
        Lumped masses [kg] of the tissue that is there.
    mesh, node_mesh : TetMesh
        The reference shape, and linear tetrahedra with a corner at every node: it, or its elements cut into eight.
    terms : list of Term
        What else acts with forces that follow the deformation.
    stiffness_factors : (m,) array
        Factor on all moduli of each element.
    remaining_parts : (m,) array
        Part of each element that is left.
    growth_stretches : (m,) array
        Stretch of each element without stress.
    coupling_factor : float
        How many times what unknowns of a term's own do to the stiffness counts in the matrix.
    seconds : float
        Wall time that the pre-processing took [s].
    """

    def __init__(self, model: Model, device: str | None = None, precision: str = "double") -> None:
        require_kind(model, Model, "model", "a Model, as warpbrain.model_of(case) gives")
        start = time.perf_counter()
        self._model = model
        self.device = find_device(device)
        self.precision = find_precision(precision)
        self.mesh, self.node_mesh, self.quadratic = model.mesh, model.node_mesh, model.quadratic
        self.size, self.elements = len(self.node_mesh.points), len(self.mesh.tetrahedra)
        self.constrained: Bools = model.constrained
        self.movable: Bools = np.asarray(~model.constrained.all(axis=1))
        self._kernels = assembly_kernels(self.precision)
        self._averages, self._mixes = (model.elements == kind for kind in ("tet4-averaged", "tet10-mixed"))
        self._place_mesh()
        # of each element; terms ask for them
        self.stiffness_factors, self.remaining_parts = np.ones(self.elements), np.ones(self.elements)
        self.growth_stretches = np.ones(self.elements)
        self._following: list[Term] = [m.bind(self) for m in model.mechanisms if isinstance(m, Following)]
        self.terms = [*self._following]
        self._time_step = math.inf
        self._acting: tuple[float, float] = (1.0, math.inf)
        # of what alters elements, as they are now; None: not known yet
        alters = model.growing or model.weakening or model.emptying or self._averages or self._mixes
        self._scales: tuple[float, ...] | None = None if alters else ()
        #: From a material to the volumetric modulus [Pa] that elements have themselves.
        self._modulus: Callable[[Material], float] = attrgetter("volumetric_modulus")
        if self._averages:
            self._modulus = own_modulus
        elif self._mixes:
            # all of it acts on the volumes at corners
            self._modulus = lambda _material: 0.0
        self.groups = self._group_elements()
        self.terms += [term for group in self.groups for term in group.averaged]
        self._volumes_at_nodes: NodalVolumeTerm | None = None
        if self._mixes:
            logarithmic = {label: m.formulation == "coupled" for label, m in model.materials.items()}
            self._volumes_at_nodes = NodalVolumeTerm(
                self, self._by_element(logarithmic).astype(bool), model.element_kinds
            )
            self.terms.append(self._volumes_at_nodes)
        self._coupled = [term for term in self.terms if term.coupling is not None]
        self._place_pattern()
        self._place_fields()
        self.set_load()
        self.seconds = time.perf_counter() - start

    @property
    def model(self) -> Model:
        """What is assumed; other numbers of it are set by `set_model` alone."""
        return self._model

    # -- pre-processing -------------------------------------------------------------------------------------------

    def _array(self, values: Any, dtype: Any) -> wp.array:
        return wp.array(values, dtype=dtype, device=self.device)

    def _place_mesh(self) -> None:
        p = self.precision
        self.assembly = a = Assembly.of(self.mesh, self.device, p)
        self.tetrahedra, self.shape_gradients = a.tetrahedra, a.shape_gradients
        self.nodes, self.inverse_edges = a.nodes, a.inverse_edges
        self.stencils, self.element_nodes = self.tetrahedra, self.nodes
        if self.quadratic is not None:
            self.stencils = self.quadratic.elements
            self.element_nodes = self._array(self.stencils, int)
        self._volumes = self.mesh.volumes
        self.volume = self._array(self._volumes, p.scalar)
        self.mass = self._array(self.model.node_masses, p.scalar)

    def _place_pattern(self) -> None:
        p = self.precision
        stencils = [self.stencils, *(term.stencils for term in self.terms)]
        pattern = self.assembly.pattern(stencils, self.size)
        self.pairs, self.pair_positions, self.pair_first = pattern.pairs, pattern.positions, pattern.first
        self.contributions, self.block_pairs = pattern.contributions, pattern.block_pairs
        self.corner_first, self.corners = pattern.corner_first, pattern.corners
        self.diagonal = pattern.diagonal
        self.matrix: BsrMatrix = bsr_zeros(self.size, self.size, p.mat33, device=self.device)
        self.matrix.offsets, self.matrix.columns = pattern.offsets, pattern.columns
        self.matrix.values = wp.zeros(len(pattern.columns), dtype=p.mat33, device=self.device)
        self.matrix.nnz = len(pattern.columns)

    def _group_elements(self) -> list[ElementGroup]:
        groups = []
        for (law_type, formulation), materials in self._grouped(self.model).items():
            members = np.flatnonzero(np.isin(self.mesh.tissue, list(materials)))
            law = law_type.device_law(formulation)
            device_law: DeviceLaw = GrownLaw(law) if self.model.growing else law
            linear = self.quadratic is None
            kernels = device_law.kernels(self.precision) if linear else quadratic_kernels(device_law, self.precision)
            averaged = []
            if self._averages:
                labels, kinds = list(materials), self.model.element_kinds
                made = self.once("patches", [np.array(labels), kinds], partial(patches_of, self, labels, kinds))
                averaged = [AveragedTerm(self, patches, kernels) for patches in made]
            group = kernels.group()
            group.elements = self._array(members, int)
            group.nodes, group.inverse_edges, group.volume = self.element_nodes, self.inverse_edges, self.volume
            parameters = self._parameters(law_type, materials, self._modulus)
            group.parameters = self._array(parameters, self.precision.scalar)
            groups.append(ElementGroup(len(members), kernels, group, averaged))
        return groups

    def once(self, kind: str, arrays: Sequence[NDArray[Any]], make: Callable[[], T]) -> T:
        """See `Assembly.once`."""
        return self.assembly.once(kind, arrays, make)

    @staticmethod
    def _grouped(model: Model) -> dict[tuple[type[Law], str], dict[int, Material]]:
        """Materials of the tissues of the mesh by what they are launched with."""
        by_code: dict[tuple[type[Law], str], dict[int, Material]] = {}
        for label in model.mesh.labels:
            material = model.materials[label]
            by_code.setdefault((type(material.law), material.formulation), {})[label] = material
        return by_code

    def _parameters(
        self, law_type: type[Law], materials: Mapping[int, Material], modulus: Callable[[Material], float]
    ) -> Floats:
        """Parameters by element; 1 where it is of no tissue of the group."""
        rows = law_type.parameter_rows([material.law for material in materials.values()])
        # the last column, where something grows, is the growth stretch
        parameters = np.ones((self.elements, 1 + len(rows[0]) + bool(self.model.growing)))
        for (label, material), row in zip(materials.items(), rows, strict=True):
            members = np.flatnonzero(self.mesh.tissue == label)
            parameters[members, : 1 + len(row)] = (modulus(material), *row)
        if self.model.growing:
            parameters[:, -1] = self.growth_stretches
        return parameters

    def set_materials(self, materials: Mapping[int, Material]) -> None:
        """Other parameters of the laws by tissue label, as by `set_model`; `InputError` if a tissue has no material."""
        self.set_model(replace(self.model, materials=dict(materials)))

    def set_model(self, model: Model, made: dict[int, Term] | None = None) -> None:
        """Other values of parameters in the same arrays: nothing is pre-processed again.

        A captured graph sees them. A mechanism's term is made anew from its mechanism and its arrays are copied into
        those that are there; what it remembers stays. Of loads and prescribed displacements nothing is kept here: the
        model is asked for them.

        Parameters
        ----------
        model : Model
            Of the same mesh, with each tissue's law (of Ogden's, with as many terms) and formulation as it is, the
            same mechanisms with other numbers, and any loads and prescribed displacements of the components that are
            constrained already. Sets that a mechanism acts on are pre-processed: others need another system.
        made : dict of int to Term, optional
            Terms of mechanisms by the `id` of these, which the caller keeps. What is not there yet is added, so that
            who goes to and fro between models makes each term once.

        Raises
        ------
        InputError
            If a tissue has another law, formulation or number of parameters, or a mechanism is another one, or
            something that has no parameters is. The system is then as it was.
        """
        before = self.model
        self._require_alike(model)
        # terms ask their body for its moduli
        self._model = model
        made = {} if made is None else made
        others: list[tuple[Term, Term]] = []
        pairs = zip(before.mechanisms, model.mechanisms, strict=True)
        following = [(was, now) for was, now in pairs if isinstance(now, Following)]
        try:
            for term, (was, now) in zip(self._following, following, strict=True):
                if was is now or was == now:
                    continue
                if id(now) not in made:
                    made[id(now)] = now.bind(self)
                if not term.fits(made[id(now)]):
                    raise InputError(f"mechanism {now}: acts on other nodes, or has more numbers, than before")
                others.append((term, made[id(now)]))
        except InputError:
            self._model = before
            raise
        for term, other in others:
            other.set_time_step(self._time_step)
            term.adopt(other)
        if list(before.mechanisms) != list(model.mechanisms):
            self._scales = None if model.growing or model.weakening or model.emptying else self._scales
            self._act()
        self._write_materials()

    def _require_alike(self, model: Model) -> None:
        """Raise `InputError` if a model needs pre-processing of its own."""
        before = self.model
        if not before.mesh.is_as(model.mesh):
            raise InputError("model: another mesh than the one that was pre-processed")
        for name in ("elements", "density", "damping"):
            if getattr(before, name) is not getattr(model, name) and getattr(before, name) != getattr(model, name):
                raise InputError(f"model: another {name} than the one that was pre-processed")
        if before.constrained is not model.constrained and np.any(before.constrained != model.constrained):
            raise InputError("model: other components are constrained than those that were pre-processed")
        for label in model.mesh.labels:
            old, new = before.materials[label], model.materials[label]
            if _code(old) != _code(new):
                raise InputError(
                    f"materials: tissue {label} has {new.law!r}, {new.formulation}: expected other parameters of "
                    f"{old.law!r}, {old.formulation}"
                )
        if len(before.mechanisms) != len(model.mechanisms):
            raise InputError(
                f"mechanisms: found {len(model.mechanisms)}, expected other numbers of those {len(before.mechanisms)} "
                "that were pre-processed"
            )
        for was, now in zip(before.mechanisms, model.mechanisms, strict=True):
            if was != now and not was.differs_in_numbers_only(now):
                raise InputError(f"mechanisms: {now}: expected other numbers of {was}")

    def _write_materials(self) -> None:
        """Let laws and terms have the moduli, factors and growth that elements have now."""
        for group, ((law_type, _), members) in zip(self.groups, self._grouped(self.model).items(), strict=True):
            group.on_device.parameters.assign(self._parameters(law_type, members, self._modulus))
            for term in group.averaged:
                term.set_elements(self._parameters(law_type, members, averaged_modulus), self.stiffness_factors)
        for each in self.terms:
            each.take_moduli()

    def _place_fields(self) -> None:
        p, n = self.precision, self.size
        self.u, self.internal, self.external, self.load, self.solution, self.increment = (
            wp.zeros(n, dtype=p.vec3, device=self.device) for _ in range(6)
        )
        self.coupling_factor = 1.0
        self._stiffness_factor = wp.ones(1, dtype=p.scalar, device=self.device)
        self.free = self._array(1.0 - self.model.constrained, p.vec3)
        self._all_components = self._array(np.ones((n, 3)), p.vec3)
        self._flat_forces = wp.zeros(len(self.corners), dtype=p.vec3, device=self.device)
        self._flat_blocks = wp.zeros(len(self.contributions), dtype=p.mat33, device=self.device)
        corner = block = 0

        def parts(stencils: NDArray[np.integer]) -> tuple[wp.array, wp.array]:
            """The next forces and blocks, for stencils (k, s)."""
            nonlocal corner, block
            count, nodes = stencils.shape
            pairs = nodes * (nodes + 1) // 2
            forces = self._flat_forces[corner : corner + count * nodes].reshape((count, nodes))
            blocks = self._flat_blocks[block : block + count * pairs].reshape((count, pairs))
            corner, block = corner + count * nodes, block + count * pairs
            return forces, blocks

        self.element_forces, self.element_blocks = parts(self.stencils)
        for term in self.terms:
            term.place(*parts(term.stencils))
        self.element_energy, self.element_J = (
            wp.zeros(self.elements, dtype=p.scalar, device=self.device) for _ in range(2)
        )

    # -- sums over elements ---------------------------------------------------------------------------------------

    def _launch(self, kernel: Any, dim: Any, *inputs: Any) -> None:
        launch(kernel, dim, inputs, self.device)

    def evaluate_forces(self) -> None:
        """Element forces at `u`."""
        for g in self.groups:
            self._launch(g.kernels.forces, g.count, g.on_device, self.u, self.element_forces)
        for term in self.terms:
            term.evaluate_forces(self.u)

    def evaluate_tangents(self) -> None:
        """Element forces and tangent blocks at `u`."""
        for g in self.groups:
            outputs = (self.element_forces, self.element_blocks)
            self._launch(g.kernels.forces_and_tangents, g.count, g.on_device, self.u, *outputs)
        for term in self.terms:
            term.evaluate_tangents(self.u)

    @property
    def forces_on_nodes(self) -> tuple[wp.array, wp.array, wp.array]:
        """For `warpbrain.kernels.assembly.force_on`: starts, lists, and the element forces themselves."""
        return self.corner_first, self.corners, self._flat_forces

    def gather_forces(self) -> None:
        """Internal forces from the element forces."""
        self._launch(self._kernels.gather_forces, self.size, *self.forces_on_nodes, self.internal)

    def internal_forces(self) -> Floats:
        """Internal forces (n, 3) [N] at `u`, evaluated anew."""
        self.evaluate_forces()
        self.gather_forces()
        return self.internal.numpy().astype(np.float64)

    def size_of_forces(self) -> float:
        """Norm [N] of what rounding is relative to.

        All forces before they are summed, and moduli, of which forces are differences where little is strained.
        """
        stiffest = float(np.max(self.shear_moduli + np.abs(self.volumetric_moduli)))
        summed = float(np.linalg.norm(self._flat_forces.numpy().astype(np.float64)))
        return summed + stiffest * self.mesh.volume ** (2.0 / 3.0)

    def assemble(self, k: float, m: float, coupling: float | None = None) -> None:
        """`matrix = k K + m M` from the element blocks, constrained rows and columns replaced by the identity.

        What of `K` is not in blocks is added by the linear solver: `k` times too, but what unknowns of a term's own do
        to it `coupling` times, if that is given.
        """
        scalar = self.precision.scalar
        if self._volumes_at_nodes is not None:
            self._stiffness_factor.fill_(k)
        self.coupling_factor = k if coupling is None else coupling
        self._launch(
            self._kernels.gather_matrix, len(self.pairs), self.pairs, self.pair_first, self.contributions,
            self.pair_positions, self._flat_blocks, self.mass, self.free, scalar(k), scalar(m), self.matrix.values,
        )  # fmt: skip

    def stiffness(self) -> Any:
        """`K` [N/m] at `u` on every component, constrained ones included, as a SciPy BSR matrix (3 n, 3 n)."""
        from scipy.sparse import bsr_matrix

        self.evaluate_tangents()
        free, self.free = self.free, self._all_components
        self.assemble(k=1.0, m=0.0)
        self.free = free
        # the values are gathered into the same array again
        values = self.matrix.values.numpy().astype(np.float64)
        K = bsr_matrix((values, self.matrix.columns.numpy(), self.matrix.offsets.numpy()))
        return K if self._volumes_at_nodes is None else K + self._volumes_at_nodes.stiffness()

    def skew_stiffness(self) -> Any:
        """What `stiffness` lacks at `u`: the skew part of terms without a potential, SciPy; None if there is none."""
        u = self.u.numpy().astype(np.float64)
        parts = [part for term in self.terms if not term.conservative and (part := term.skew_stiffness(u)) is not None]
        return sum(parts[1:], start=parts[0]) if parts else None

    @property
    def coupled(self) -> bool:
        """Whether unknowns of a term's own follow the displacement in the coming steps."""
        return any(term.coupled for term in self._coupled)

    def add_coupling(self, x: wp.array, factor: float, y: wp.array) -> None:
        """Add to `y` a factor times what unknowns of a term's own do to `K x`; constrained components are left out."""
        for term in self._coupled:
            term.add_stiffness(x, factor, y, self.free, self.free)

    @property
    def assembled(self) -> bool:
        """Whether all of the stiffness is in blocks, unknowns of a term's own apart."""
        return self._volumes_at_nodes is None

    def _add_beyond_blocks(self, x: wp.array, factor: float, y: wp.array) -> None:
        """Add to `y` a factor times what is not in the matrix of the last `assemble`, but for couplings."""
        assert self._volumes_at_nodes is not None
        self._volumes_at_nodes.add_stiffness(x, factor, y, self.free, self.free, self._stiffness_factor)

    def subtract_constrained_load(
        self, increment: wp.array, k: float, coupling: float | None = None, rows: wp.array = None
    ) -> None:
        """`load -= k K increment` for increments of the constrained components, on the components that are 1 in `rows`:
        the free ones by default.

        What unknowns of a term's own do to it counts `coupling` times, `k` times if absent.
        """
        rows = self.free if rows is None else rows
        for term in self.terms:
            factor = k if term.coupling is None or coupling is None else coupling
            if factor != 0.0:
                term.add_stiffness(increment, -factor, self.load, self._all_components, rows)
        self._launch(
            self._kernels.constrained_load, self.size, self.matrix.offsets, self.matrix.columns, self.block_pairs,
            self.pair_first, self.contributions, self._flat_blocks, increment, rows, self.precision.scalar(k),
            self.load,
        )  # fmt: skip

    def stiffness_times(self, increment: Floats, k: float = 1.0, coupling: float | None = None) -> Floats:
        """`k K increment` [N] on every component, constrained ones included, shape (n, 3).

        What unknowns of a term's own do to it counts `coupling` times, `k` times if absent.
        """
        self.increment.assign(increment)
        self.load.zero_()
        added = None if coupling is None else -coupling
        self.subtract_constrained_load(self.increment, -k, added, self._all_components)
        return self.load.numpy().astype(np.float64)

    def linear_solver(
        self,
        *,
        tolerance: float,
        max_iterations: int,
        watch_curvature: bool = False,
        at_rest: bool = False,
        factors: KeptFactors | None = None,
    ) -> LinearSolver:
        """A solver for ``matrix solution = load``; all are chosen here.

        - Conjugate gradients (`warpbrain.kernels.linear.conjugate_gradient`) for one system after the other.
        - GMRES on the host (`warpbrain.simulation.coupled`) where a term has unknowns of its own: the matrix is
          indefinite.

        Parameters
        ----------
        tolerance : float
            Relative.
        max_iterations : int
        watch_curvature : bool
            Tell an indefinite matrix.
        at_rest : bool
            The matrix is without inertia, so that a coarse space is worth its making.
        factors : KeptFactors, optional
            Of states nearby, for an indefinite matrix.
        """
        kind, mesh = conjugate_gradient(self.device, only_blocks=self.assembled), self.model.node_mesh
        ordered = partial(mesh.made_once, "compact order", partial(compact_order, mesh.points))
        plain = kind(
            self.matrix,
            self.diagonal,
            self.load,
            self.solution,
            self.precision,
            tolerance=tolerance,
            max_iterations=max_iterations,
            watch_curvature=watch_curvature,
            beyond=None if self.assembled else self._add_beyond_blocks,
            nodes=(mesh.points, self.free, ordered) if at_rest else None,
        )
        if self._coupled:
            return CoupledSolver(self, self._coupled, plain, factors or KeptFactors(), tolerance)
        return plain

    def begin_loading_kernels(self) -> Callable[[], None]:
        """Begin to compile what is known to be needed, see `begin_loading`; `load_kernels` does the rest."""
        of_laws = [kernel for g in self.groups for kernel in (g.kernels.forces_and_tangents, g.kernels.stress)]
        others = solver_kernels(self.precision, self.device, only_blocks=self.assembled)
        return begin_loading([*of_laws, *others], self.device)

    def load_kernels(self) -> float:
        """Compile what a run needs, or find it in Warp's cache, at the present state; returns the seconds it took."""
        start = time.perf_counter()
        self.begin_loading_kernels()()
        # in a step, in which a term may need more than in an equilibrium
        for term in self.terms:
            term.set_time_step(1.0)
        self.evaluate_forces()
        self.evaluate_tangents()
        self.gather_forces()
        self.assemble(k=1.0, m=1.0)
        self.load.zero_()
        self.solution.zero_()
        solver = self.linear_solver(tolerance=0.5, max_iterations=1, watch_curvature=True)
        solver.prepare()
        solver.solve()
        self.energy()
        for term in self.terms:
            term.set_time_step(math.inf)
        wp.synchronize_device(self.device)
        return time.perf_counter() - start

    def energy(self) -> tuple[float, float]:
        """Stored energy [J] at `u`, and the smallest `J` of an element (not positive: the energy means nothing).

        Potentials of terms are in it, of those that have one; `J` is that of quadrature points.
        """
        for g in self.groups:
            self._launch(g.kernels.energy, g.count, g.on_device, self.u, self.element_energy, self.element_J)
        stored = float(np.sum(self.element_energy.numpy(), dtype=np.float64))
        stored += sum(term.energy(self.u) for term in self.terms if term.conservative)
        return stored, float(np.min(self.element_J.numpy()))

    def set_load(self, share: float = 1.0, time: float = math.inf) -> None:
        """Let terms act with a share of what they do at a time [s]; by default in full, long after every ramp."""
        self._acting = share, time
        if self._act():
            self._write_materials()

    def _act(self) -> bool:
        """Let everything act as much as was last said; whether the parameters of elements are others now."""
        share, time = self._acting
        for term in self.terms:
            term.set_scale(share * term.factor(time))
        model = self.model
        acting: list[Sequence[Any]] = [model.growing, model.weakening, model.emptying]
        growth, softening, emptying = ([share * mechanism.factor(time) for mechanism in those] for those in acting)
        scales = (*growth, *softening, *emptying)
        if scales == self._scales:
            return False
        self._scales = scales
        self.stiffness_factors, change = np.ones(self.elements), np.ones(self.elements)
        for softer, scale in zip(model.weakening, softening, strict=True):
            self.stiffness_factors *= softer.stiffness_factor(model.mesh, scale)
        if emptying:
            self.remaining_parts = model.remaining_part(emptying)
            self.mass.assign(model.node_masses * model.remaining_share(emptying))
        # a kernel multiplies all that an element does by its volume
        self.volume.assign((PART if self._averages else 1.0) * self.stiffness_factors * self._volumes)
        for larger, scale in zip(model.growing, growth, strict=True):
            change *= 1.0 + larger.growth(model.mesh, scale)
        self.growth_stretches = np.cbrt(change)
        return True

    # -- what terms remember --------------------------------------------------------------------------------------

    def set_time_step(self, h: float) -> None:
        """Tell terms how long the coming steps are [s]; infinite in an equilibrium."""
        self._time_step = h
        for term in self.terms:
            term.set_time_step(h)

    def advance(self) -> None:
        """Let terms keep what they need of a step that ended at `u`."""
        for term in self.terms:
            term.advance(self.u)

    def forget(self) -> None:
        """Let terms forget: the body is at rest in its reference shape, and always was."""
        for term in self.terms:
            term.forget()

    def remembered(self) -> list[tuple[wp.array, ...]]:
        """A copy of what each term remembers."""
        return [term.remembered() for term in self.terms]

    def recall(self, remembered: Sequence[tuple[wp.array, ...]]) -> None:
        """Let terms remember that instead."""
        for term, arrays in zip(self.terms, remembered, strict=True):
            term.recall(arrays)

    def remember_as(self, other: System) -> None:
        """Let terms remember what those of another system of the same mechanisms do, in the same step."""
        self.set_time_step(other._time_step)
        self.recall(other.remembered())

    def forces_without_potential(self, u: Floats) -> Floats | None:
        """Sum of the forces (n, 3) [N] of the terms without a potential at a displacement (n, 3) [m], which the system
        then has; None if all have a potential, and nothing is done.
        """
        terms = [term for term in self.terms if not term.conservative]
        if not terms:
            return None
        self.u.assign(u)
        total = np.zeros((self.size, 3))
        for term in terms:
            term.evaluate_forces(self.u)
            np.add.at(total, term.stencils, term.forces.numpy())
        return total

    @property
    def shear_moduli(self) -> Floats:
        """Shear modulus at rest of each element [Pa], shape (m,)."""
        return self._by_element({label: m.law.shear_modulus for label, m in self.model.materials.items()})

    @property
    def volumetric_moduli(self) -> Floats:
        """`lam` or `K` of each element [Pa], shape (m,)."""
        return self._by_element({label: m.volumetric_modulus for label, m in self.model.materials.items()})

    def _by_element(self, values: Mapping[int, float]) -> Floats:
        by_label = np.array([values[label] for label in self.mesh.labels])
        return np.asarray(by_label[np.searchsorted(self.mesh.labels, self.mesh.tissue)])

    def least_of(self, J: Floats | None = None) -> str:
        """The element with the smallest of volume ratios (m,), those of the last `energy` by default, and where it is,
        for a message.
        """
        mesh, e = self.mesh, int(np.argmin(self.element_J.numpy() if J is None else J))
        x, y, z = 1000.0 * mesh.points[mesh.tetrahedra[e]].mean(axis=0)
        return f"element {e} at ({x:.1f}, {y:.1f}, {z:.1f}) mm, tissue {mesh.tissue[e]}"

    def deformation_gradients(self) -> Floats:
        """`F` of each element at `u`, shape (m, 3, 3), computed on the host in double precision.

        Of quadratic elements that in the middle, which is the mean over the element.
        """
        u = self.u.numpy().astype(np.float64)
        if self.quadratic is not None:
            u = u[self.stencils]
            # gradients in the middle: zero at corners, grad L_c + grad L_d in the middle of edge cd
            corners = np.zeros((self.elements, 4, 3))
            for (c, d), middle in zip(EDGES.tolist(), range(4, 10), strict=True):
                corners[:, c] += u[:, middle]
                corners[:, d] += u[:, middle]
        else:
            corners = u[self.tetrahedra]
        edges = corners[:, 1:] - corners[:, :1]
        return np.eye(3) + edges.transpose(0, 2, 1) @ self.shape_gradients

    def stresses(self) -> Floats:
        """First Piola-Kirchhoff stress of the tissue of each element at `u` [Pa], shape (m, 3, 3).

        What terms add to the law is in it, if it is of the tissue: fibres, tension, viscosity.
        """
        p = self.precision
        F = self._array(self.deformation_gradients(), p.mat33)
        density = wp.zeros(self.elements, dtype=p.scalar, device=self.device)
        P = wp.zeros(self.elements, dtype=p.mat33, device=self.device)
        for g in self.groups:
            of = g.on_device
            self._launch(g.kernels.stress, g.count, of.elements, F, of.parameters, density, P)
        total = P.numpy().astype(np.float64)
        if self._averages:
            total *= PART
            for term in (term for group in self.groups for term in group.averaged):
                # each of the four patches of an element has a quarter of it
                elements, patch, stress = term.stress(self.u)
                np.add.at(total, elements, 0.25 * (1.0 - PART) * stress[patch])
        total *= self.stiffness_factors[:, None, None]
        if self._volumes_at_nodes is not None:
            F = self.deformation_gradients()
            cofactors = np.linalg.det(F)[:, None, None] * np.linalg.inv(F).transpose(0, 2, 1)
            total += self._volumes_at_nodes.pressures(self.u)[:, None, None] * cofactors
        for added in self.terms:
            if added.elements is None:
                continue
            # the mean over the element: `sum_a f_a (x) X_a / V`
            added.evaluate_forces(self.u)
            forces, points = added.forces.numpy().astype(np.float64), self.node_mesh.points[added.stencils]
            away = points - points.mean(axis=1, keepdims=True)
            total[added.elements] += np.einsum("eai,eaj,e->eij", forces, away, 1.0 / self._volumes[added.elements])
        return total
