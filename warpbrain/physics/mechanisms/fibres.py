"""Fibres: tissue that stiffens along a direction when it is stretched (Gasser, Ogden and Holzapfel 2006).

    Psi = k1/(2 k2) (exp(k2 E^2) - 1),   E = max(0, d (I1 - 3) + (1 - 3 d) (I4 - 1)),   I4 = |F a|^2

with the direction `a`, dispersion `d` from 0 (all parallel) to 1/3 (none preferred). With `H = dE/dF = 2 d F +
2 (1 - 3 d) F a (x) a`, `P = k1 E exp(k2 E^2) H`. What `I1` adds beside `I4` is the scatter of the fibres.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from warpbrain.arrays import Floats
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Expectation, Mechanism, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation, Tests
from warpbrain.physics.regions import element_directions, elements_of, unit_vector
from warpbrain.physics.term import Body, ExtraEnergy, ExtraEnergyTerm
from warpbrain.physics.words import Values, along, vector_in


@wp.func
def _strain(F: Any, a: Any, d: Any):
    zero = a.dtype(0.0)
    three = a.dtype(3.0)
    stretched = F * a
    E = d * (wp.ddot(F, F) - three) + (a.dtype(1.0) - three * d) * (wp.dot(stretched, stretched) - a.dtype(1.0))
    return wp.max(E, zero)


@wp.func
def _direction(F: Any, data: wp.array2d[Any], e: int):
    return wp.vector(data[e, 3], data[e, 4], data[e, 5])


@wp.func
def _energy(F: Any, data: wp.array2d[Any], e: int):
    k1 = data[e, 0]
    k2 = data[e, 1]
    E = _strain(F, _direction(F, data, e), data[e, 2])
    return k1 / (type(k1)(2.0) * k2) * (wp.exp(k2 * E * E) - type(k1)(1.0))


@wp.func
def _stress(F: Any, data: wp.array2d[Any], e: int):
    k1 = data[e, 0]
    k2 = data[e, 1]
    d = data[e, 2]
    a = _direction(F, data, e)
    E = _strain(F, a, d)
    two = type(k1)(2.0)
    return k1 * E * wp.exp(k2 * E * E) * two * (d * F + (type(k1)(1.0) - type(k1)(3.0) * d) * wp.outer(F * a, a))


@wp.func
def _moduli(F: Any, g: Any, h: Any, data: wp.array2d[Any], e: int):
    k1 = data[e, 0]
    k2 = data[e, 1]
    d = data[e, 2]
    a = _direction(F, data, e)
    E = _strain(F, a, d)
    one = type(k1)(1.0)
    two = type(k1)(2.0)
    along = one - type(k1)(3.0) * d
    grown = wp.exp(k2 * E * E)
    first = k1 * E * grown
    # of max(0, E): none where fibres are slack
    second = type(k1)(0.0)
    if type(k1)(0.0) < E:
        second = k1 * grown * (one + two * k2 * E * E)
    stretched = F * a
    Hg = two * (d * (F * g) + along * wp.dot(a, g) * stretched)
    Hh = two * (d * (F * h) + along * wp.dot(a, h) * stretched)
    isotropic = first * two * (d * wp.dot(g, h) + along * wp.dot(a, g) * wp.dot(a, h))
    return second * wp.outer(Hg, Hh) + isotropic * wp.identity(n=3, dtype=F.dtype)


_CODE = ExtraEnergy("fibres", _energy, _stress, _moduli)


@dataclass(frozen=True, kw_only=True)
class Fibres(Mechanism):
    """Fibres in all tissue or in an element set."""

    direction: tuple[float, float, float] | None = parameter(
        "Direction of the fibres, if it is the same everywhere.", kind="vector", default=None
    )
    field: str = parameter(
        "Direction of the fibres in each element: an array of the mesh, or a .csv, .npy or mesh file of one for each.",
        kind="directions",
        default="",
        typical="principal direction of diffusion tensor imaging",
    )
    stiffness: float = parameter(
        "k1, of the fibres together.",
        unit="Pa",
        above=0.0,
        expectation=Expectation.log_normal(300.0, 3.0),
        typical="anisotropy of -3 to 16 % in shear, 0.6 to 1.1 in tension",
        source="diagnosis design, M10; Gasser, Ogden and Holzapfel 2006",
        told=("their stiffness is {}",),
    )
    exponent: float = parameter(
        "k2, how they stiffen.",
        default=1.0,
        above=0.0,
        expectation=Expectation.log_normal(1.0, 3.0),
        told=("the exponent with which they stiffen is {}",),
    )
    dispersion: float = parameter(
        "How they scatter: 0 all parallel, 1/3 no direction.",
        default=0.0,
        above=-1e-12,
        below=1.0 / 3.0 + 1e-12,
        expectation=Expectation.uniform(0.0, 1.0 / 3.0),
        told=("their scatter, from 0 all parallel to 1/3 no direction, is {}",),
    )
    elements: str = parameter("Element set that has them.", default="", kind="element set", absent="all tissue")
    kind: ClassVar[str] = "fibres"
    quadratic: ClassVar[bool] = True
    of_specimens: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("energy", "Psi_fibres")
    together: ClassVar[Mapping[str, str]] = {
        "asymmetry": "The fibres add to the new law.",
        "compressibility": "The Poisson ratio is that of the law without fibres.",
        "residual-stress": "The fibres are without stress in the imaged shape, before the tension acts.",
        "swelling": "The fibres grow with the tissue: swelling that nothing holds stretches none.",
    }
    sentence: ClassVar[str] = "Nerve fibres make the tissue stiffer along their direction."
    example: ClassVar[str] = "fibres:direction=1/0/0,stiffness=2000"
    absence: ClassVar[str] = "direction of fibres"
    confused_with: ClassVar[tuple[str, ...]] = ("asymmetry", "inclusion")
    needs: ClassVar[tuple[str, ...]] = ("loads along and across the fibres",)
    several: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.direction is not None:
            unit_vector("direction", self.direction)
        for name in ("stiffness", "exponent"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"fibres: {name} = {getattr(self, name)}: expected a positive number")

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        element_directions(mesh, elements_of(mesh, self.elements), self.direction, self.field)

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """Along each axis of the anatomy."""
        sd = 500.0 * situation.stiffness
        return Proposal.along_axes(
            lambda axis, k1: cls(direction=axis, stiffness=max(k1, 1e-9)), sd, "fibres", situation
        )

    @classmethod
    def check_tests(cls, tests: Tests) -> None:
        if tests.loads < 2:
            raise NotTestableError(f"needs {' and '.join(cls.needs)}")

    @classmethod
    def size_in_words(cls, values: Values, gravity_axis: tuple[float, float, float] | None = None) -> Sequence[str]:
        line = along(vector_in(values, "direction"))
        return [*super().size_in_words(values), *([f"they run {line}"] if line else [])]

    def stored_energy(self, F: Floats) -> Floats:
        """See `warpbrain.physics.mechanism.Storing`; one direction of fibres."""
        if self.direction is None:
            raise InputError("fibres: field: a homogeneous state has one direction of them")
        stretched = F @ (np.array(self.direction) / np.linalg.norm(self.direction))
        d, I1, I4 = self.dispersion, np.sum(F**2, axis=(1, 2)), np.sum(stretched**2, axis=1)
        E = np.maximum(d * (I1 - 3.0) + (1.0 - 3.0 * d) * (I4 - 1.0), 0.0)
        return np.asarray(self.stiffness / (2.0 * self.exponent) * np.expm1(self.exponent * E**2))

    def bind(self, body: Body) -> ExtraEnergyTerm:
        elements = elements_of(body.mesh, self.elements)
        directions = element_directions(body.mesh, elements, self.direction, self.field)
        row = np.tile([self.stiffness, self.exponent, self.dispersion], (len(elements), 1))
        return ExtraEnergyTerm(body, _CODE, elements, np.hstack([row, directions]), self.factor)
