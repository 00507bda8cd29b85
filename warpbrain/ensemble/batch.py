"""A batch: as many samples as there are slots, stepped together on one device. Nothing is allocated in its loop.

A pass does three things in one graph, each for a list of slots of its own:

1. for those that begin a step: matrix, right-hand side and preconditioner at their present state;
2. for those whose linear solve has not ended, these and older ones: conjugate gradients, until few have not ended;
3. for those that have ended, and any that are marked: velocity, displacement, and then element forces, tangents, `J`
   and the balance of forces, from which the floor above decides what each of them does next.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats, Int32s
from warpbrain.ensemble.sample import Sample
from warpbrain.errors import InputError
from warpbrain.kernels.batched.cluster import fitting_parts
from warpbrain.kernels.batched.elements import batched_element_kernels
from warpbrain.kernels.batched.layout import TANGENT, samples_struct, stages
from warpbrain.kernels.batched.linear import BatchedConjugateGradient
from warpbrain.kernels.batched.motion import batched_motion_kernels
from warpbrain.kernels.batched.parts import Parts, Pattern
from warpbrain.kernels.batched.patch_assembly import PatchAssembly
from warpbrain.kernels.batched.solve_kernels import batched_solve_kernels
from warpbrain.kernels.persistent import shared_memory
from warpbrain.physics.laws import Law
from warpbrain.simulation.dynamics import finest_tolerance
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System


def code_of(material: Material) -> tuple[type[Law], str]:
    """What decides which kernels compute a material."""
    return type(material.law), material.formulation


class BatchGroup:
    """Elements that share a law and formulation: the tissues with some `labels`, whose parameters slots have.

    `samples` are the materials of all that may ever be placed, by their numbers.
    """

    def __init__(
        self, system: System, labels: list[int], samples: Mapping[int, Mapping[int, Material]], slots: int
    ) -> None:
        everyone = [materials[label] for materials in samples.values() for label in labels]
        law_type, formulation = code_of(everyone[0])
        # all at once: laws with fewer terms than another get terms of no weight
        laws = law_type.parameter_rows([material.law for material in everyone])
        table = np.array([(m.volumetric_modulus, *row) for m, row in zip(everyone, laws, strict=True)])
        table = table.reshape(len(samples), len(labels), -1)
        self._of_samples = dict(zip(samples, table, strict=True))
        # (tissues, slots, parameters); slots that never hold a sample hold the parameters of one, not zeros that a law
        # may divide by
        self._rows = np.repeat(table[0][:, None], slots, axis=1)
        tissue = system.model.mesh.tissue
        # elements, and which tissue of the group each is of
        self.members = np.flatnonzero(np.isin(tissue, labels))
        self.tissues = np.searchsorted(labels, tissue[self.members])
        self.law = law_type.device_law(formulation)
        made, self.kernels = batched_element_kernels(self.law, system.precision)
        array, flat = partial(wp.array, device=system.device), self._rows.reshape(-1, self._rows.shape[2])
        # the same for its kernels, with parameters, and these in double precision
        self.on_device, self.exact = made(), array(flat, dtype=wp.float64)
        self.on_device.elements, self.on_device.tissue = array(self.members, dtype=int), array(self.tissues, dtype=int)
        self.on_device.parameters = array(flat, dtype=system.precision.scalar)

    def place(self, numbers: Mapping[int, int]) -> None:
        """Put the parameters of samples, by their numbers, into slots."""
        for slot, number in numbers.items():
            self._rows[:, slot] = self._of_samples[number]
        for parameters in (self.on_device.parameters, self.exact):
            parameters.assign(self._rows.reshape(-1, self._rows.shape[2]))


def groups_of(system: System, samples: Sequence[Sample], slots: int) -> list[BatchGroup]:
    """Groups of the laws of samples; `InputError` if they are not all of the same laws."""
    by_number = {sample.number: sample.materials for sample in samples if sample.materials is not None}
    first = next(iter(by_number.values()))
    for number, materials in by_number.items():
        for label, material in materials.items():
            if label not in first or code_of(material) != code_of(first[label]):
                raise InputError(
                    f"sample {number}: tissue {label}: {material.law.name} ({material.formulation}): all samples "
                    "of an ensemble have the same laws, with parameters of their own"
                )
    labels: dict[tuple[type[Law], str], list[int]] = {}
    for label in sorted(first):
        labels.setdefault(code_of(first[label]), []).append(label)
    return [BatchGroup(system, alike, by_number, slots) for alike in labels.values()]


def pattern_of(system: System) -> Pattern:
    """The pattern of the matrix of a system, of which one block of a pair of nodes is stored."""
    positions, matrix = system.pair_positions.numpy(), system.matrix
    pairs = np.empty(matrix.nnz, dtype=np.int32)
    pairs[positions[:, 0]] = pairs[positions[:, 1]] = np.arange(len(positions))
    columns, active = matrix.columns.numpy()[: matrix.nnz], np.any(system.free.numpy() != 0.0, axis=1)
    return Pattern(matrix.offsets.numpy(), columns, pairs, system.model.mesh.points, active)


def parts_of_clusters(system: System) -> Parts | None:
    """Who has which part of a matrix of a system where clusters of its device solve; None if they do not."""
    real = system.precision.numpy.itemsize
    return system.once("clusters", [system.constrained], lambda: fitting_parts(pattern_of(system), real, system.device))


#: Iterations of a linear solve.
_MAX_CG = 2000

#: Bytes of results that leave a device at a time.
_STAGED = 1 << 25


@dataclass(frozen=True)
class States:
    """What is known of the state of each slot after a pass; arrays over all slots."""

    ready: Bools  # the state is new: the others are still being solved for, or empty
    min_J: Floats
    unbalanced: Floats  # norm of what is out of balance on the free components [N]
    internal: Floats  # norm of the internal forces [N]
    cg_iterations: Int32s
    cg_residual: Floats  # of the linear solve that led to the state
    cg_goal: Floats


class ResultRoom:
    """Room for fields (n, 3) of so many samples: memory of the host that is written to while the device works.

    The first time that a page of new memory is written to, the system looks for one and clears it: for the fields of
    some hundred samples that takes as long as a step of all of them.
    """

    def __init__(self, nodes: int, samples: int) -> None:
        self._nodes, self._samples = nodes, samples
        self._ready = np.empty((0, nodes, 3))

    def prepare(self) -> None:
        """Make room ready if there is none."""
        if not len(self._ready):
            # unlike `zeros`, which waits until it is written to
            self._ready = np.full((self._samples, self._nodes, 3), 0.0)

    def take(self, count: int) -> Floats:
        """An array (count, n, 3) of any numbers, ready or not."""
        if count > len(self._ready):
            return np.empty((count, self._nodes, 3))
        taken, self._ready = self._ready[:count], self._ready[count:]
        return taken


class Batch:
    """Slots on a device for samples, which share the mesh, pattern and masses of a system, and not its fields.

    Linear solves have a relative tolerance, never finer than what the precision allows. A pass ends when the
    part `linger` of those that it began with, or less, has not ended. Prescribed displacements are sums of `shapes`
    (shapes, n, 3) [m]. Steps may all be `even`, of one length.
    """

    def __init__(
        self,
        system: System,
        samples: Sequence[Sample],
        slots: int,
        *,
        tolerance: float,
        shapes: Floats | None = None,
        linger: float = 0.0,
        even: bool = False,
    ) -> None:
        self.system, self.slots = system, slots
        self._linger = linger
        self._device, self._precision = system.device, system.precision
        self._groups = groups_of(system, samples, slots)
        self._kernels = batched_motion_kernels(system.precision)
        _, self._sums_kernels = batched_solve_kernels(system.precision)
        self.shapes = np.zeros((0, system.size, 3)) if shapes is None else shapes
        model, p, n, m, b = system.model, system.precision, system.size, system.elements, slots
        self._samples = s = samples_struct(p)()
        for name in (
            *("nodes", "inverse_edges", "volume", "mass", "free"),
            *("corner_first", "corners", "pairs", "pair_first", "contributions"),
        ):
            setattr(s, name, getattr(system, name))
        s.u, s.u_start = (self._zeros(n, 3, b, dtype=wp.float64) for _ in range(2))
        for name in ("v", "v_start", "dv", "prescribed", "internal"):
            setattr(s, name, self._zeros(n, 3, b))
        s.element_forces, s.element_J = self._zeros(4 * m, 3, b), self._zeros(m, b)
        # slots, and how many of them are in the list
        self._all = self._array(np.arange(b), int), self._array([b], int)
        self._fresh = self._zeros(b, dtype=int), self._zeros(1, dtype=int)
        self._ready = self._zeros(b, dtype=int)
        # what a pass is told of lists and flags: two lists, two rows of flags, three counts
        self._lists = lists = self._zeros(4 * b + 3, dtype=int)
        self._start = lists[:b], lists[4 * b : 4 * b + 1]
        self._solve = lists[b : 2 * b], lists[4 * b + 1 : 4 * b + 2]
        self._marked, self._stepping = lists[2 * b : 3 * b], lists[3 * b : 4 * b]
        self._linger_count = lists[4 * b + 2 :]
        self._unsolved = np.zeros(b, dtype=bool)
        # of the step that each slot begins next: `h` [s]; factors of loads and amounts of shapes at its end
        self.time_step = np.ones(b)
        self.load_factors = np.zeros((len(model.loads), b))
        self.amounts = np.zeros((len(self.shapes), b))
        # no load is one load of nothing: a launch takes no array without rows
        forces = [load.nodal_forces(model.mesh) for load in model.loads] or [np.zeros((n, 3))]
        s.loads = self._array(np.array(forces), p.vec3)
        # and of numbers
        self._numbers = numbers = self._zeros(3 + len(forces) + max(1, len(self.shapes)), b)
        s.h, s.k, s.m = numbers[0], numbers[1], numbers[2]
        s.factors, s.amounts = numbers[3 : 3 + len(forces)], numbers[3 + len(forces) :]
        s.external = self._array(model.external_forces(), p.vec3)
        if len(self.shapes):
            s.shapes = self._array(self.shapes, p.vec3)
        self._chunks, self._stages = stages(n)
        s.shares, self._sums = self._zeros(2, self._chunks, b), self._zeros(2, self._stages, b)
        # and what it tells: two norms, the smallest `J`, and whether these are new
        self._summary = self._zeros(4, b)
        self._totals, self._min_J = self._summary[:2], self._summary[2:3]
        self._host_copies = [self._on_host(values) for values in (self._lists, self._numbers, self._summary)]
        self._J_share = int(np.ceil(np.sqrt(m)))
        self._least_J = self._zeros(-(-m // self._J_share), b)
        parts = parts_of_clusters(system)
        # on the chip sums are in double precision, and tangents are before they are added up
        roundings = 20.0 if parts is None else 8.0
        self._cg = BatchedConjugateGradient(
            pattern_of(system), system.free, s.v, s.dv, p,
            tolerance=finest_tolerance(tolerance, p, roundings), max_iterations=_MAX_CG, parts=parts,
        )  # fmt: skip
        s.values, s.b, s.solving = self._cg.values, self._cg.right_hand_side, self._cg.solving
        # matrices are made of elements where they are solved for, or of tangents in memory
        self._patches = None
        if self._cg.side_by_side:
            self._patches = PatchAssembly(
                [(group.law, group.members, group.tissues, group.exact) for group in self._groups],
                model.mesh.points, system.tetrahedra, system.shape_gradients, model.mesh.volumes, system.pairs.numpy(),
                system.free.numpy() != 0.0, system.mass, s.u, s.values, p, shared_memory(self._device),
            )  # fmt: skip
        s.tangents = self._zeros(0 if self._patches else m, TANGENT, b)
        self._every = self._array(np.arange(n), int)
        self.held = np.flatnonzero(np.any(model.constrained, axis=1))
        self._held = self._array(self.held, int)
        self._collected = self._zeros(n * min(b, max(1, _STAGED // (n * 3 * 8))), dtype=wp.vec3d)
        self._staging = self._on_host(self._collected)
        self._room = ResultRoom(n, b)
        self._ahead = even and self._patches is not None
        self._graph: Any = None
        self._graph_ahead: Any = None
        self._states_copied = wp.Event(self._device) if self._device.is_cuda else None

    def _array(self, values: Any, dtype: Any) -> wp.array:
        return wp.array(values, dtype=dtype, device=self._device)

    def _zeros(self, *shape: int, dtype: Any = None) -> wp.array:
        return wp.zeros(shape, dtype=dtype or self._precision.scalar, device=self._device)

    def _on_host(self, values: wp.array) -> wp.array:
        """As much memory of the host that the device reads and writes by itself; the same on a CPU."""
        return wp.zeros(values.shape, dtype=values.dtype, device="cpu", pinned=True) if self._device.is_cuda else values

    # -- samples in slots -----------------------------------------------------------------------------------------

    def place(self, numbers: Mapping[int, int]) -> None:
        """Put samples, by their numbers, into slots: at rest, to be evaluated in the next pass."""
        if not numbers:
            return
        for group in self._groups:
            group.place(numbers)
        slots = self._array(list(numbers), int)
        self._launch(self._kernels.reset, (self.system.size, len(numbers)), slots, self._samples)

    def restore(self, slots: Sequence[int]) -> None:
        """Back to the state before the last step, to be evaluated in the next pass."""
        if not len(slots):
            return
        self._launch(self._kernels.restore, (self.system.size, len(slots)), self._array(slots, int), self._samples)

    def displacements(self, slots: Sequence[int]) -> Floats:
        """`u` of some slots [m], shape (slots, n, 3)."""
        return self._collect(self._samples.u, slots, self._every, self._room.take(len(slots)))

    def held_forces(self, slots: Sequence[int]) -> Floats:
        """Internal forces of some slots [N] on the nodes `held`, shape (slots, held, 3)."""
        return self._collect(self._samples.internal, slots, self._held, np.empty((len(slots), len(self.held), 3)))

    def _collect(self, values: wp.array, slots: Sequence[int], nodes: wp.array, collected: Floats) -> Floats:
        """Vectors of some slots at some nodes, in an array for them."""
        some = self._staging.size // max(1, len(nodes))
        for first in range(0, len(slots) if len(nodes) else 0, some):
            listed = self._array(slots[first : first + some], int)
            count = len(listed) * len(nodes)
            self._launch(self._kernels.collect, (len(listed), len(nodes)), listed, nodes, values, self._collected)
            wp.copy(self._staging, self._collected, count=count)
            wp.synchronize_device(self._device)
            collected[first : first + some] = self._staging.numpy()[:count].reshape(len(listed), -1, 3)
        return collected

    def element_J(self, slot: int) -> Floats:
        """Volume ratio of each element of a slot, shape (m,)."""
        return self._samples.element_J[:, slot].contiguous().numpy().astype(np.float64)

    # -- a pass ---------------------------------------------------------------------------------------------------

    def advance(self, start: NDArray[np.intp], marked: NDArray[np.intp], *, on: bool = True) -> States:
        """One pass: slots `start` begin a step from an evaluated state, the states of `marked` are to be evaluated, and
        it may go `on` from there."""
        if self._graph is None:
            self._capture()
        self._unsolved[start] = True
        stepping = np.flatnonzero(self._unsolved)
        flat, numbers, summary = (copy.numpy() for copy in self._host_copies)
        lists = flat[: 4 * self.slots].reshape(4, self.slots)
        lists[2:] = 0
        lists[0, : len(start)], lists[1, : len(stepping)] = start, stepping
        lists[2, marked] = lists[3, stepping] = 1
        flat[4 * self.slots :] = len(start), len(stepping), int(self._linger * len(stepping))
        h, damping = self.time_step, self.system.model.damping
        numbers[:3] = h, h * damping.stiffness + h * h, 1.0 + h * damping.mass
        numbers[3 : 3 + len(self.load_factors)] = self.load_factors
        numbers[3 + self._samples.factors.shape[0] :][: len(self.amounts)] = self.amounts
        wp.capture_launch(self._graph)
        if self._states_copied is not None:
            wp.record_event(self._states_copied)
            if self._ahead and on:
                # while what has been told decides which of them are solved
                wp.capture_launch(self._graph_ahead)
            self._room.prepare()
            wp.synchronize_event(self._states_copied)
        iterations, residual, goal = self._cg.results()
        ready = summary[3] != 0.0
        self._unsolved[ready] = False
        unbalanced, internal = np.sqrt(summary[:2].astype(np.float64))
        return States(ready, summary[2].astype(np.float64), unbalanced, internal, iterations, residual, goal)

    def _launch(self, kernel: Any, dim: Any, *inputs: Any) -> None:
        # small blocks: those whose lanes have all ended make room at once
        wp.launch(kernel, dim=dim, inputs=list(inputs), device=self._device, block_dim=128)

    def _capture(self) -> None:
        """Capture a pass in a graph: one launch from the host instead of hundreds."""
        # a pass over lists that are still empty loads every module
        self._record()
        with wp.ScopedCapture(device=self._device) as capture:
            self._record()
        self._graph = capture.graph
        if self._ahead:
            self._assemble(self._fresh)
            with wp.ScopedCapture(device=self._device) as capture:
                self._assemble(self._fresh)
            self._graph_ahead = capture.graph

    def _record(self) -> None:
        lists, numbers, summary = self._host_copies
        wp.copy(self._lists, lists)
        wp.copy(self._numbers, numbers)
        self._begin_steps()
        self._cg.iterate(*self._solve, self._linger_count)
        self._launch(self._kernels.update, (self.system.size, self.slots), *self._solve, self._samples)
        self._launch(
            self._kernels.find_ready, self.slots, self._marked, self._stepping, self._cg.solving, self._ready,
            self._summary[3],
        )  # fmt: skip
        self._launch(self._sums_kernels.gather_active, self.slots, *self._all, self._ready, *self._fresh)
        self._evaluate()
        wp.copy(summary, self._summary)

    def _begin_steps(self) -> None:
        s, nodes, begun = self._samples, (self.system.size, self.slots), self._start
        if len(self.shapes):
            self._launch(self._kernels.prescribe, nodes, *begun, s)
        if not self._ahead:
            self._assemble(begun)
        self._launch(self._kernels.begin, nodes, *begun, s)
        if len(self.shapes):
            for group in self._groups:
                of_elements = len(group.members), self.slots
                self._launch(group.kernels.tangents_times, of_elements, *begun, group.on_device, s)
            self._launch(self._kernels.constrained_load, nodes, *begun, s)
        self._cg.start(*begun)

    def _assemble(self, listed: tuple[wp.array, wp.array]) -> None:
        """Matrices of a list of slots, whose states have been evaluated."""
        s = self._samples
        if self._patches is not None:
            self._patches.assemble(*listed, s.k, s.m)
        else:
            self._launch(self._kernels.gather_matrix, (len(s.pairs), self.slots), *listed, s)

    def _evaluate(self) -> None:
        """Forces, tangents where they are kept, `J` and balance at the states of the fresh list."""
        s, lanes, fresh = self._samples, self.slots, self._fresh
        for group in self._groups:
            kernel = group.kernels.forces_and_tangents if self._patches is None else group.kernels.forces
            self._launch(kernel, (len(group.members), lanes), *fresh, group.on_device, s)
        self._launch(self._kernels.gather_forces, (self._chunks, lanes), *fresh, s)
        self._launch(self._sums_kernels.add_shares, (2, self._stages, lanes), *fresh, s.shares, self._sums)
        self._launch(self._sums_kernels.add_sums, (2, lanes), *fresh, self._sums, self._totals)
        shares = self._least_J.shape[0]
        self._launch(self._kernels.smallest, (shares, lanes), *fresh, self._J_share, s.element_J, self._least_J)
        self._launch(self._kernels.smallest, (1, lanes), *fresh, shares, self._least_J, self._min_J)
