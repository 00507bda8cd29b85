"""What a mechanism is: a piece of physics that a case can assume, in one file with five faces.

1. what it is: `kind`, `sentence` and `detail`;
2. its parameters, the fields of the class made by `parameter`: unit, limits, what is expected of them and where that
   is from. Keys of `case.toml`, arguments of `--with` and the page in the docs are made from them;
3. what it does: a mechanism is also one or several of `Load` (forces that do not follow the deformation), `Following`
   (a term with forces that do), `Weakening` (softer or stiffer elements), `Emptying` (lighter ones), `Growing` (larger
   or smaller ones), `Substituting` (another law) and `Removing` (fewer elements);
4. how it enters the total potential (`enters`), so what it means together with others (`together`), and which of them
   it excludes (`excludes`): see `warpbrain.physics.potential`;
5. what it is taken for (`confused_with`), what must be observed to tell it apart (`needs`), an `example`, and how it
   may act where a case does not declare it (`proposals`).

Its derivatives by its parameters are nobody's work: `warpbrain.simulation.sensitivity` differences what it does.
For that a `Following` one's term names the arrays of what it remembers (`Term.memory`), keeps solvers and rigid shapes
as they are (`Term.lasting`) and takes the body's moduli in `Term.take_moduli`, if it has any of these.

Whoever lists mechanisms (reading, writing, simulation, diagnosis, docs) walks the registry,
`warpbrain.physics.mechanisms`.
"""

from __future__ import annotations

import abc
import dataclasses
import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np

from warpbrain.arrays import Bools, Floats, Int32s, Ints
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import Law
from warpbrain.physics.load import Changed as Changed
from warpbrain.physics.load import Ramped
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation, Tests
from warpbrain.physics.term import Following as Following
from warpbrain.physics.words import Smallest, Values, clauses, label, number

#: What the value of a parameter can be: a number, free text, the name of a node set with faces, of an element set, of
#: an array of directions, a closed surface, a position, a vector that is no length, or numbers. Users may say a tissue
#: for an element set, and files for directions and surfaces (`warpbrain.cases.parts.named`).
KINDS = ("number", "text", "node set", "element set", "directions", "surface", "position", "vector", "numbers")
#: Of these, what a state changes smoothly with.
NUMBERS = ("number", "position", "vector", "numbers")


@dataclass(frozen=True)
class ClosedSurface:
    """A closed surface of triangles."""

    file: str  # where it came from, for people
    points: Floats = field(repr=False, compare=False)  # (n, 3) [m]
    faces: Int32s = field(repr=False, compare=False)  # (k, 3), oriented in one way, inwards or outwards

    def __str__(self) -> str:
        return self.file

    @property
    def outward(self) -> Int32s:
        """The triangles, all turned if they enclose a negative volume."""
        a, b, c = (self.points[self.faces[:, i]] - self.points.mean(axis=0) for i in range(3))
        return self.faces if np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0 else self.faces[:, ::-1]


@dataclass(frozen=True)
class Expectation:
    """What is expected of a parameter beforehand, in its unit: normal or uniform in the number or in its logarithm."""

    words: str
    start: float  # median of a normal one, lower end of a uniform one
    width: float  # standard deviation, or distance of the ends; of a logarithm as a factor
    is_normal: bool
    is_logarithmic: bool = False

    def quantile(self, part: float) -> float:
        """The number below which a part of the distribution lies, 0 <= part <= 1."""
        if self.is_normal:
            from scipy.special import ndtri

            part = float(ndtri(part))
        return self.start * self.width**part if self.is_logarithmic else self.start + self.width * part

    @property
    def ends(self) -> tuple[float, float]:
        """The lowest and the highest number that is expected at all; infinite of a normal distribution."""
        return self.quantile(0.0), self.quantile(1.0)

    def __str__(self) -> str:
        return self.words

    @classmethod
    def normal(cls, mean: float, sd: float) -> Expectation:
        """`N(mean, sd^2)`."""
        return cls(f"normal, {mean:g} ± {sd:g}", mean, sd, True)

    @classmethod
    def log_normal(cls, median: float, factor: float) -> Expectation:
        """A number whose logarithm is normal: two thirds of it lie within a `factor` of the `median`."""
        return cls(f"log-normal, {median:g} within a factor {factor:g}", median, factor, True, True)

    @classmethod
    def uniform(cls, low: float, high: float) -> Expectation:
        """Any number from `low` to `high` alike."""
        return cls(f"uniform, {low:g} to {high:g}", low, high - low, False)

    @classmethod
    def log_uniform(cls, low: float, high: float) -> Expectation:
        """Any order of magnitude from `low` to `high` alike."""
        return cls(f"log-uniform, {low:g} to {high:g}", low, high / low, False, True)


@dataclass(frozen=True)
class ParameterSpec:
    """What is known of a parameter."""

    doc: str  # one sentence
    default: Any = dataclasses.MISSING  # SI
    kind: str = "number"  # one of `KINDS`
    unit: str = ""  # in which users give it
    si: float = 1.0  # how many of its SI unit one of these is
    above: float = -math.inf  # limits in the user's unit, themselves not allowed
    below: float = math.inf
    choices: tuple[str, ...] = ()
    needed: bool = False  # whether a case must give it, whatever default the class has
    #: What it is taken to be where a case does not give it, in words, if that is not the default of the class
    absent: str = ""
    expectation: Expectation | None = None  # in the user's unit; None: never estimated
    typical: str = ""  # range in the literature, with unit
    source: str = ""
    #: By how much it must change to change much where it is zero and nothing is expected of it, in the user's unit
    size: float = 1.0
    method: bool = False  # it is a setting of the method, or weighed and known: never differentiated or estimated
    adds_up: bool = False  # of several numbers, whether their sum is a number of its own
    #: How it is told once it was estimated, with ``{}`` for the number; or three: if it is positive, if it is negative,
    #: with its size, and where its spread is larger than itself
    told: tuple[str, ...] = ()


def parameter(doc: str, *, default: Any = dataclasses.MISSING, **known: Any) -> Any:
    """A field of a mechanism that users give; see `ParameterSpec`."""
    spec = ParameterSpec(doc, default, **known)
    assert spec.kind in KINDS, spec.kind
    return dataclasses.field(default=default, metadata={"spec": spec})


class ParameterError(InputError):
    """A parameter that is wrong; `key` is its name."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


@dataclass(frozen=True)
class Reading:
    """How the size of a mechanism can be read, without what it does to tissue."""

    error: float  # standard deviation [SI]
    words: str  # what is read, and how well


@dataclass(frozen=True)
class Facts:
    """What a mechanism may know of the case that assumes it."""

    mesh: TetMesh  # the imaged anatomy, whole
    gravity_axis: tuple[float, float, float] | None = None
    density: float = 1211.5  # [kg/m3]
    removing: tuple[Mechanism, ...] = ()  # what else the case assumes that removes elements

    @cached_property
    def left(self) -> TetMesh:
        """What is left of the anatomy, on which all others act."""
        mesh = self.mesh
        for mechanism in self.removing:
            assert isinstance(mechanism, Removing)
            mesh, _ = mechanism.remaining(mesh)
        return mesh


@dataclass(frozen=True, kw_only=True)
class Mechanism(Ramped, abc.ABC):
    """A piece of physics that a case assumes."""

    #: Its name in `case.toml`, on the command line and in a diagnosis.
    kind: ClassVar[str]
    #: What it is, in one sentence that a surgeon understands.
    sentence: ClassVar[str]
    #: What `--with` says of it on the case `phantom-loaded`: its picture in the docs and its cost are of this.
    example: ClassVar[str]
    #: How it enters the total potential.
    enters: ClassVar[Enters]
    #: What it means together with other kinds, by kind, where the total potential leaves something open.
    together: ClassVar[Mapping[str, str]] = {}
    #: Kinds of mechanisms that have nearly the same effect.
    confused_with: ClassVar[tuple[str, ...]] = ()
    #: What must be observed to tell it from others, in words; empty: one deformed state is enough.
    needs: ClassVar[tuple[str, ...]] = ()
    #: Whether what acts on nodes (a `Load`, a term) acts rightly on the midside nodes of quadratic elements too.
    quadratic: ClassVar[bool] = False
    #: Whether it is there or not, and nothing in between: its effect is a difference, not a derivative at nothing.
    switches: ClassVar[bool] = False
    #: Whether what it does changes in time while loads do not.
    changes_by_itself: ClassVar[bool] = False
    #: What it adds or changes. In a body that creeps a load has its response by and by, another stiffness in proportion
    #: to what has moved, and another volume at once: what relaxes is isochoric.
    changes: ClassVar[Changed] = "stiffness"
    #: Whether a case can have several.
    several: ClassVar[bool] = False
    #: Whether it means something in a laboratory specimen between its grips.
    of_specimens: ClassVar[bool] = False
    #: How its size can be read directly, if it can.
    reading: ClassVar[Reading | None] = None
    #: What a model without it leaves out, as printed; empty: nothing that every brain has.
    absence: ClassVar[str] = ""
    #: Key of the belief of how much of it every tissue has, whatever a case says (`about_law`); empty if of none.
    always: ClassVar[str] = ""

    def __init_subclass__(cls, **known: Any) -> None:
        """Let the docstring of a kind say its parameters, which its fields know."""
        super().__init_subclass__(**known)
        lines = [inspect.cleandoc(cls.__doc__ or ""), "", "Parameters", "----------"]
        for name, kind in vars(cls).get("__annotations__", {}).items():
            value = vars(cls).get(name)
            if isinstance(value, dataclasses.Field) and "spec" in value.metadata:
                spec: ParameterSpec = value.metadata["spec"]
                unit = f" [{spec.unit}]" if spec.si == 1.0 else f" [SI; {spec.unit} in a case]"
                lines.append(f"{name} : {kind if isinstance(kind, str) else inspect.formatannotation(kind)}")
                lines.append(f"    {spec.doc}{unit if spec.unit else ''}")
        cls.__doc__ = "\n".join(lines)

    @classmethod
    def parameters(cls) -> dict[str, ParameterSpec]:
        """What is known of each parameter, by name."""
        return {f.name: f.metadata["spec"] for f in dataclasses.fields(cls) if "spec" in f.metadata}

    def with_body_turned(self, rotation: Floats) -> Mechanism:
        """As it acts on a body that is turned in the room by a rotation (3, 3); itself if it turns with the body."""
        return self

    def differs_in_numbers_only(self, other: Mechanism) -> bool:
        """Whether another one is the same but for numbers, settings of the method and the ramp."""
        if type(other) is not type(self):
            return False
        for name in (f.name for f in dataclasses.fields(self) if f.name != "ramp"):
            spec, mine, its = self.parameters().get(name), getattr(self, name), getattr(other, name)
            if spec is not None and spec.kind in NUMBERS:
                if not spec.method and ((mine is None) != (its is None) or np.shape(mine) != np.shape(its)):
                    return False
            elif not (spec is not None and spec.method) and mine != its:
                return False
        return True

    @classmethod
    def required(cls) -> tuple[str, ...]:
        """Names of the parameters that a case must give."""
        return tuple(
            name
            for name, spec in cls.parameters().items()
            if spec.needed or (spec.default is dataclasses.MISSING and not spec.absent)
        )

    @classmethod
    def described(cls, name: str) -> str:
        """What a parameter is, and what it is taken to be where a case does not give it."""
        spec = cls.parameters()[name]
        if name in cls.required():
            return spec.doc
        if spec.absent:
            text = spec.absent
        elif spec.default is None or spec.default == "":
            text = "none"
        elif isinstance(spec.default, str):
            text = f"'{spec.default}'"
        else:
            text = ", ".join(f"{value / spec.si:g}" for value in np.ravel(spec.default))
        return f"{spec.doc[:-1]}; {text} if absent."

    @classmethod
    def of_case(cls, values: Mapping[str, Any], facts: Facts) -> Self:
        """The mechanism of a case, from its parameters in SI units and RAS axes, and the ramp.

        `ParameterError` if one of them makes no sense in this case.
        """
        made = cls(**values)
        try:
            made.check(facts.left)
        except ParameterError as error:
            if not facts.removing:
                raise
            try:
                made.check(facts.mesh)
            except ParameterError:
                raise error from None
            both = f"{facts.removing[0].kind} and {made.kind} cannot act together"
            raise ParameterError(error.key, f"{both}: in the tissue that is left {error}") from None
        return made

    def in_case(self, facts: Facts) -> dict[str, Any]:
        """Parameters by name, in SI units and RAS axes, of which `of_case` makes what does the same in a case."""
        values = {name: getattr(self, name) for name in self.parameters()}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def everywhere(self) -> bool:
        """Whether it acts in the same way in all of a body, and not in some place of it."""
        places = ("node set", "element set", "position")
        return not any(getattr(self, name) for name, spec in self.parameters().items() if spec.kind in places)

    def check(self, mesh: TetMesh) -> None:
        """Raise `ParameterError` if a parameter makes no sense with a mesh: a set that is not there, or is empty."""
        for name, spec in self.parameters().items():
            if spec.kind not in ("node set", "element set") or not (value := getattr(self, name)):
                continue
            sets = mesh.node_sets if spec.kind == "node set" else mesh.element_sets
            if value not in sets:
                present = ", ".join(sorted(sets)) or "none"
                raise ParameterError(name, f"the mesh has no {spec.kind} '{value}' (it has {present})")
            if not sets[value].any():
                raise ParameterError(name, f"the {spec.kind} '{value}' is empty")

    def doubt(self, mesh: TetMesh) -> str:
        """Why a parameter is implausible in an imaged anatomy, although it is allowed; empty if none is."""
        return ""

    def held(self, mesh: TetMesh) -> tuple[Ints, Floats]:
        """Nodes (k,), repeated if need be, and directions (k, 3) in which it holds them."""
        return np.zeros(0, dtype=np.int64), np.zeros((0, 3))

    def acts_on(self, mesh: TetMesh) -> Bools:
        """Elements (m,) whose tissue carries what it does, so that it means nothing without them; none by default."""
        return np.zeros(len(mesh.tetrahedra), dtype=bool)

    def excludes(self, other: Mechanism, mesh: TetMesh) -> str:
        """Why it and another one have no meaning together on a mesh; empty if they have."""
        return ""

    @classmethod
    def excluded(cls, other: type[Mechanism]) -> str:
        """Where it excludes mechanisms of another kind, in words; empty if nowhere."""
        return ""

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """How it may act where a case does not declare it; `NotTestableError` if the data cannot show it."""
        raise NotTestableError(f"needs {' and '.join(cls.needs) or 'more than is known of this case'}")

    @classmethod
    def about_law(cls, poisson: float, sd: float) -> Proposal:
        """It about the law that a case has, where it does nothing; of mechanisms that are `always` there a little.

        `poisson` is the ratio of the case, `sd` the standard deviation of its coefficient.
        """
        raise NotImplementedError(cls.kind)

    @classmethod
    def check_tests(cls, tests: Tests) -> None:
        """Raise `NotTestableError` if tests on a specimen, whatever their number and noise, cannot show it."""

    @classmethod
    def size_in_words(cls, values: Values, gravity_axis: tuple[float, float, float] | None = None) -> Sequence[str]:
        """What was found of it, one clause for each thing that can be known, with direction and sign.

        Of finite parameters by name, each in the unit it has in `parameters`; components of vectors as ``value_x``,
        their length as ``value_size``, of its ramp the last factor as ``share``. `gravity_axis` is where 'down' was
        said to be.
        """
        return clauses(cls.parameters(), values)

    @classmethod
    def smallest_in_words(cls, smallest: Smallest) -> str:
        """From which size on it would have been seen."""
        size, unit = smallest.size, smallest.unit
        if unit == "Pa" and size >= 1000.0:
            size, unit = 1e-3 * size, "kPa"
        if unit:
            return f"from {number(size)} {unit}"
        return f"from a change of {number(size)} in {label(cls.parameters()[smallest.name.removesuffix('_size')].doc)}"

    @property
    def lifts(self) -> bool:
        """Whether what it lets go can leave the wall too, where it is pulled."""
        return False

    def turned(self, rotation: Floats) -> Self:
        """The same in a body that is turned: every direction `a` becomes `R a`, (3, 3).

        `ParameterError` if it acts in a part of the body, or has directions in each element: these would turn too.
        """
        if np.allclose(rotation, np.eye(3)):
            return self
        for name, spec in self.parameters().items():
            if spec.kind in ("directions", "element set", "position") and getattr(self, name):
                raise ParameterError(
                    name, f"{self.kind}: tests along other axes of the tissue are of what is alike in all of it"
                )
        vectors = {
            name: tuple((rotation @ np.array(value)).tolist())
            for name, spec in self.parameters().items()
            if spec.kind == "vector" and (value := getattr(self, name)) is not None
        }
        return dataclasses.replace(self, **vectors) if vectors else self

    def detail(self) -> str:
        """What the sentence leaves open, for people to read."""
        parts = []
        for name, spec in self.parameters().items():
            value = getattr(self, name)
            if value is None or value == "" or spec.kind == "numbers":
                continue
            if isinstance(value, str | ClosedSurface):
                parts.append(f"{name} '{value}'")
            else:
                # positions are millimetres to people, whatever the case's unit
                unit, si = ("mm", 1e-3) if spec.kind == "position" else (spec.unit, spec.si)
                numbers = ", ".join(f"{v / si:g}" for v in np.ravel(value))
                parts.append(f"{name} {numbers}{f' {unit}' if unit else ''}")
        return f" ({'; '.join(parts)})" if parts else ""


@runtime_checkable
class Weakening(Protocol):
    """A mechanism that makes the tissue's own elements softer or stiffer."""

    def stiffness_factor(self, mesh: TetMesh, scale: float) -> Floats:
        """Factor (m,) on all moduli of each element, where the mechanism acts with a scale from 0 to 1."""


@runtime_checkable
class Emptying(Protocol):
    """A mechanism that takes tissue away little by little, and with it all that it does: weight, mass and tension."""

    def factor(self, time: float = math.inf) -> float:
        """Its scale at a time [s]; by default long after its ramp."""

    def remaining_part(self, mesh: TetMesh, scale: float) -> Floats:
        """Part (m,) of each element that is left, where the mechanism acts with a scale from 0 to 1."""


@runtime_checkable
class Growing(Protocol):
    """A mechanism that makes the tissue's own elements larger or smaller."""

    def growth(self, mesh: TetMesh, scale: float) -> Floats:
        """Relative change of volume (m,) of each element without stress, at a scale from 0 to 1."""


@runtime_checkable
class Substituting(Protocol):
    """A mechanism that says that tissues have another law, or another compressibility, than the case says."""

    def substitute(self, label: int, law: Law, poisson: float, formulation: str) -> tuple[Law, float, str]:
        """Law, Poisson ratio and formulation of a tissue."""


@runtime_checkable
class Storing(Protocol):
    """A mechanism that stores energy where the deformation is homogeneous, beside the law's."""

    def stored_energy(self, F: Floats) -> Floats:
        """Energy (n,) [Pa] per volume at rest, at deformation gradients (n, 3, 3)."""


@runtime_checkable
class Relaxing(Protocol):
    """A mechanism with branches of a Prony series on the isochoric neo-Hookean stress of the tissue's shear modulus."""

    def branches(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Moduli, relative to the shear modulus, and times of relaxation [s]."""


@runtime_checkable
class Removing(Protocol):
    """A mechanism that takes elements away before anything is computed."""

    def remaining(self, mesh: TetMesh) -> tuple[TetMesh, Int32s]:
        """The mesh that is left, and for each of its nodes the id in the whole mesh."""
