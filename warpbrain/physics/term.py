"""What a term is: something that acts on a body with forces that follow its deformation.

A mechanism (`warpbrain.physics.mechanism`) is what a user says; a term is what becomes of it on a device. It has a
family of stencils, each a few nodes on which it acts together (the three of a triangle under pressure, the four of a
tetrahedron), and writes the forces and tangent blocks of each into arrays that the system then sums in a fixed order.
The system knows no term by name.
"""

import abc
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats, Int32s
from warpbrain.kernels.extra_energy import extra_kernels
from warpbrain.kernels.following_pressure import triangles_struct
from warpbrain.kernels.module import Precision
from warpbrain.kernels.multicore import launch
from warpbrain.kernels.ten_nodes import TEN_NODES
from warpbrain.kernels.tetrahedron import FOUR_NODES
from warpbrain.mesh import QuadraticMesh, TetMesh

T = TypeVar("T")


class Body(Protocol):
    """What a term may know of the system that it becomes part of."""

    mesh: TetMesh  # the reference shape
    device: Any  # of Warp
    precision: Precision  # of every array
    tetrahedra: Int32s  # corners (m, 4) of each element, ascending
    nodes: wp.array  # the same on the device
    quadratic: QuadraticMesh | None  # the reference shape with its midside nodes, if elements have some
    node_mesh: TetMesh  # linear tetrahedra with a corner at every node: the mesh, or its elements cut into eight
    stencils: Int32s  # nodes of each element, ascending, (m, 4), or (m, 10) with midside nodes
    element_nodes: wp.array  # the same on the device: (m,) vec4i, or (m, 10) int
    inverse_edges: wp.array  # gradients of the shape functions of nodes 1 to 3 as rows, (m,) mat33 [1/m]
    constrained: Bools  # components (n, 3) of the displacement that are prescribed
    movable: Bools  # nodes (n,) of which some component is not prescribed
    #: As they are now: a factor on all moduli of each element (m,), the part of it that is left, its stretch without
    #: stress.
    stiffness_factors: Floats
    remaining_parts: Floats
    growth_stretches: Floats

    def once(self, kind: str, arrays: Sequence[NDArray[Any]], make: Callable[[], T]) -> T:
        """What was made of the same arrays for this mesh, device and precision before, or is made now."""

    @property
    def volumetric_moduli(self) -> Floats:
        """`lam` or `K` of each element (m,) [Pa]."""

    @property
    def shear_moduli(self) -> Floats:
        """At rest, of each element (m,) [Pa]."""


@dataclass(frozen=True)
class Coupling:
    """Unknowns `p` of a term's own, one for a node, which follow the displacement: `A p = c - b(u)`; SciPy sparse.

    Of the forces `-(db/du)^T p`, blocks can hold what they do at the same `p`. That `p` changes with `u` adds
    `(db/du)^T A^-1 (db/du)`, which is dense: linear solvers take `A` and `db/du` themselves.
    """

    compliance: Any  # `A` (n, n), positive definite; a node without unknown has no entry
    #: About `(db/du) K^-1 (db/du)^T`: how the solid gives way to `p`, in the same rows. Of a preconditioner, which no
    #: solution depends on.
    yielding: Any
    own: Any  # `db/du` (n, 3 n)
    #: `b(u) + A p` (n,) where the term advanced last, without what flowed in that step; zero once it has forgotten
    content: Floats


class Term(abc.ABC):
    """A family of stencils with forces, tangent blocks and, if there is one, an energy.

    Stencils are node ids (k, s) that ascend in each row. Forces (k, s) [N] are internal ones: minus what pushes the
    nodes. The tangent is symmetric: conjugate gradients need that, and of a term that is not, the symmetric part is
    taken, at the price of a slower Newton's method. Its blocks (k, s (s + 1) / 2) [N/m] are of the node pairs (a, b),
    a <= b, row by row. The ramp is a factor over time [s], 1 throughout if absent.
    """

    #: Whether `energy` is the potential of the forces. If not, the work along a step stands for its change.
    conservative: bool = True
    #: Shortest time [s] in which it forgets what was; None if it has no memory.
    forgets_in: float | None = None
    #: Which elements (k,) its stencils are, where it is part of the tissue's own energy: then it is an energy of the
    #: elastic deformation, on the grown volume. None: it is something beside the tissue.
    elements: NDArray[np.integer] | None = None
    #: Whether its energy goes with the moduli of these elements (fibres, viscosity), not only with how much is left of
    #: them (a tension).
    of_moduli: bool = True
    #: Whether it is there in full, however little of the load is.
    in_full: ClassVar[bool] = False
    #: Whether its forces have a derivative everywhere; those of what opens and closes have none where it does.
    is_smooth: bool = True
    #: Names of the arrays that hold what it remembers of earlier steps and augmentations.
    memory: ClassVar[tuple[str, ...]] = ()
    #: Names of what no number of a mechanism changes: rigid shapes around the body, solvers and what they work on.
    lasting: ClassVar[tuple[str, ...]] = ()

    def __init__(self, body: Body, stencils: NDArray[np.integer], ramp: Callable[[float], float] | None = None) -> None:
        # of a system that knows its terms: what refers to each other stays until the collector looks for it, and there
        # are tens of megabytes of each
        self._body = weakref.ref(body)
        self._ramp = ramp
        self.stencils = np.ascontiguousarray(stencils, dtype=np.int32)
        assert bool(np.all(np.diff(self.stencils, axis=1) > 0)), "nodes of a stencil ascend"
        #: Factor on what it does, from 0 to 1 in load steps, times its ramp; a captured graph follows it on the device.
        self.scale = wp.ones(1, dtype=body.precision.scalar, device=body.device)
        self.forces: wp.array = None
        self.blocks: wp.array = None

    def place(self, forces: wp.array, blocks: wp.array) -> None:
        """Take the arrays that forces and blocks are written to."""
        self.forces, self.blocks = forces, blocks

    def factor(self, time: float) -> float:
        """Factor of its ramp at a time [s]."""
        return 1.0 if self._ramp is None else self._ramp(time)

    def set_scale(self, scale: float) -> None:
        """Set the factor on what it does."""
        self.scale.fill_(1.0 if self.in_full else scale)

    @property
    def body(self) -> Body:
        """What it is part of, which has to live as long as it is used."""
        body = self._body()
        assert body is not None, "the body of the term is gone"
        return body

    def set_time_step(self, h: float) -> None:  # noqa: B027  (most terms have no memory)
        """Tell a term with a memory how long the coming steps are [s]; infinite in an equilibrium."""

    def advance(self, u: wp.array) -> None:  # noqa: B027
        """Tell a term with a memory that a step has ended at a displacement [m]."""

    def augment(self, u: wp.array) -> bool:
        """Come closer to a constraint that a penalty stands for; whether it was worth it, so that to solve again is."""
        return False

    def forget(self) -> None:
        """Tell a term with a memory that the body is at rest in its reference shape, and always was."""
        for name in self.memory:
            getattr(self, name).zero_()

    @property
    def coupling(self) -> Coupling | None:
        """Its own unknowns; None if there are none."""
        return None

    @property
    def coupled(self) -> bool:
        """Whether its own unknowns follow the displacement in the coming steps."""
        return self.coupling is not None

    def add_stiffness(  # noqa: B027
        self, x: wp.array, factor: float, y: wp.array, columns: wp.array, rows: wp.array
    ) -> None:
        """Add to `y` (n,) a factor times that part of its tangent times `x` (n,) which is not in the blocks.

        `columns` and `rows` (n,) are 1 for the components of `x` that count, and for those of `y` that are added to; 0
        for others.
        """

    def skew_stiffness(self, u: Floats) -> Any:
        """What of its tangent [N/m] is skew, which no block holds, SciPy sparse (3 n, 3 n); None if nothing is."""
        return None

    def nodal_pressures(self) -> dict[str, Floats]:
        """Pressures of its own at the nodes (n,) [Pa], by name, where the forces were last evaluated."""
        return {}

    def take_moduli(self) -> None:  # noqa: B027
        """Take the body's moduli, factors on them, parts that are left and growth, some of which have changed."""

    def remembered(self) -> tuple[wp.array, ...]:
        """A copy of what it remembers."""
        return tuple(wp.clone(getattr(self, name)) for name in self.memory)

    def recall(self, remembered: tuple[wp.array, ...]) -> None:
        """Remember that instead."""
        for name, values in zip(self.memory, remembered, strict=True):
            wp.copy(getattr(self, name), values)

    def fits(self, other: "Term") -> bool:
        """Whether `adopt` can take what another term is: stencils and arrays of the same shapes."""
        if type(self) is not type(other) or not np.array_equal(self.stencils, other.stencils):
            return False
        attributes = vars(self)
        return all(attributes[name].shape == array.shape for name, array in other._arrays().items())

    def adopt(self, other: "Term") -> None:
        """Become what another term on the same body is, in the same arrays: a captured graph reads these.

        Its ramp and plain values are taken too. What it remembers stays, and so does what is `lasting`.
        """
        for name, array in other._arrays().items():
            wp.copy(getattr(self, name), array)
        kept = (*self.memory, *self.lasting, "_body", "scale", "forces", "blocks")
        for name, value in vars(other).items():
            if name not in kept and not isinstance(value, wp.array):
                setattr(self, name, value)

    def _arrays(self) -> dict[str, wp.array]:
        """What it is made of on the device, by name."""
        kept = (*self.memory, "scale", "forces", "blocks")
        return {name: a for name, a in vars(self).items() if isinstance(a, wp.array) and name not in kept}

    @abc.abstractmethod
    def evaluate_forces(self, u: wp.array) -> None:
        """Write the forces at a displacement [m]."""

    @abc.abstractmethod
    def evaluate_tangents(self, u: wp.array) -> None:
        """Write forces and blocks."""

    @abc.abstractmethod
    def energy(self, u: wp.array) -> float:
        """Potential [J]; 0 if there is none."""

    def array(self, values: Any, dtype: Any) -> wp.array:
        """An array on the body's device."""
        return wp.array(values, dtype=dtype, device=self.body.device)

    def zeros(self, *shape: int, dtype: Any = None) -> wp.array:
        """Zeros on the body's device, scalars unless another type is given."""
        return wp.zeros(shape, dtype=dtype or self.body.precision.scalar, device=self.body.device)

    def launch(self, kernel: Any, dim: Any, *inputs: Any) -> None:
        """Launch a kernel on the body's device."""
        launch(kernel, dim, inputs, self.body.device)


class KernelTerm(Term):
    """A term of kernels with a thread for each stencil: for forces, for forces with blocks, and for energies."""

    lasting: ClassVar[tuple[str, ...]] = ("_inputs",)
    #: What the kernels take before displacements [m] and outputs.
    _inputs: tuple[Any, ...]

    def __init__(
        self, body: Body, stencils: NDArray[np.integer], kernels: Sequence[Any], ramp: Callable[[float], float]
    ) -> None:
        super().__init__(body, stencils, ramp)
        self._kernels = kernels
        self._energies = self.zeros(len(stencils))

    def _launch(self, kernel: Any, u: wp.array, *outputs: wp.array) -> None:
        self.launch(kernel, len(self.stencils), *self._inputs, u, *outputs)

    def evaluate_forces(self, u: wp.array) -> None:
        self._launch(self._kernels[0], u, self.forces)

    def evaluate_tangents(self, u: wp.array) -> None:
        self._launch(self._kernels[1], u, self.forces, self.blocks)

    def energy(self, u: wp.array) -> float:
        self._launch(self._kernels[2], u, self._energies)
        return float(np.sum(self._energies.numpy(), dtype=np.float64))


class TriangleTerm(KernelTerm):
    """Forces, tangent blocks and energies of triangles (k, 3) or (k, 6): ids that ascend, of six the corners first.

    `points` (n, 3) are reference positions of the body's nodes [m], from any origin, `data` (k,) or (k, c) numbers of
    each triangle. The three kernels are ``(triangles, u) -> forces``, ``-> blocks`` and ``-> energies``, with a thread
    for each triangle. The ramp is a factor over time [s].
    """

    def __init__(
        self,
        body: Body,
        triangles: NDArray[np.integer],
        points: Floats,
        data: Floats,
        kernels: tuple[Any, Any, Any],
        ramp: Callable[[float], float],
    ) -> None:
        super().__init__(body, triangles, kernels, ramp)
        self._nodes = self.array(self.stencils, int)
        self._points = self.array(points, body.precision.vec3)
        self._data = self.array(data.reshape(len(triangles), -1), body.precision.scalar)
        t = triangles_struct(body.precision)()
        t.nodes, t.points, t.data, t.scale = self._nodes, self._points, self._data, self.scale
        self._inputs = (t,)

    def evaluate_tangents(self, u: wp.array) -> None:
        self.evaluate_forces(u)
        self._launch(self._kernels[1], u, self.blocks)


@runtime_checkable
class Following(Protocol):
    """What makes a term of itself: a mechanism whose forces follow the deformation."""

    def bind(self, body: Body) -> Term:
        """The term on a body."""


@dataclass(frozen=True)
class ExtraEnergy:
    """Device functions of an added energy; see `warpbrain.kernels.extra_energy`."""

    key: str  # part of the name of the compiled module
    energy: Any
    stress: Any
    moduli: Any
    #: Whether it goes with the moduli of an element (fibres); else with the part of it that is left (a tension)
    of_moduli: bool = True


class ExtraEnergyTerm(KernelTerm):
    """An added energy on some elements (k,) of a body, with numbers (k, c) of each; the ramp is over time [s].

    It is part of the tissue: an energy of the elastic deformation `F_e = F F_g^-1` on the grown volume, times a factor
    of each element: that on its moduli, or the part of it that is left.
    """

    def __init__(
        self, body: Body, code: ExtraEnergy, elements: NDArray[np.integer], data: Floats, ramp: Callable[[float], float]
    ) -> None:
        stencil = FOUR_NODES if body.quadratic is None else TEN_NODES
        made, *kernels = extra_kernels(code.key, code.energy, code.stress, code.moduli, body.precision, stencil)
        super().__init__(body, body.stencils[elements], kernels, ramp)
        self.elements, self.of_moduli = elements, code.of_moduli
        self._numbers = np.asarray(data)
        self._elements, self._volume = self.array(elements, int), self.zeros(len(elements))
        self._parameters = self.zeros(len(elements), self._numbers.shape[1] + 1)
        self._J = self.zeros(len(elements))
        self.take_moduli()
        group = made()
        group.nodes, group.inverse_edges = body.element_nodes, body.inverse_edges
        group.elements, group.volume = self._elements, self._volume
        group.parameters, group.scale = self._parameters, self.scale
        self._inputs = (group,)

    def take_moduli(self) -> None:
        assert self.elements is not None
        body = self.body
        factor = body.stiffness_factors if self.of_moduli else body.remaining_parts
        self._volume.assign((factor * body.mesh.volumes)[self.elements])
        self._parameters.assign(np.column_stack([self._numbers, body.growth_stretches[self.elements]]))

    def energy(self, u: wp.array) -> float:
        self._launch(self._kernels[2], u, self._energies, self._J)
        return float(np.sum(self._energies.numpy(), dtype=np.float64))
