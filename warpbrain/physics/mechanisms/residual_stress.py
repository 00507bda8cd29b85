"""Residual stress: tissue that is under tension before anything is done to it.

    Psi = 1/2 S0 : (C - I),   P = F S0,   S0 = sigma a (x) a

White matter is under tension along its tracts (Xu et al. 2009). Where `S0` changes from place to place it deforms the
body that holds it; a constant one on a body that is free does too. The imaged shape is taken as the one before this
tension acted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import warp as wp

from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Changed, Expectation, Mechanism, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import Proposal, Situation
from warpbrain.physics.regions import element_directions, elements_of, unit_vector
from warpbrain.physics.term import Body, ExtraEnergy, ExtraEnergyTerm
from warpbrain.physics.words import HARDLY, Values, along, measured, unsure, vector_in


@wp.func
def _direction(data: wp.array2d[Any], e: int):
    return wp.vector(data[e, 1], data[e, 2], data[e, 3])


@wp.func
def _energy(F: Any, data: wp.array2d[Any], e: int):
    stretched = F * _direction(data, e)
    return type(stretched[0])(0.5) * data[e, 0] * (wp.dot(stretched, stretched) - type(stretched[0])(1.0))


@wp.func
def _stress(F: Any, data: wp.array2d[Any], e: int):
    a = _direction(data, e)
    return data[e, 0] * wp.outer(F * a, a)


@wp.func
def _moduli(F: Any, g: Any, h: Any, data: wp.array2d[Any], e: int):
    a = _direction(data, e)
    return data[e, 0] * wp.dot(a, g) * wp.dot(a, h) * wp.identity(n=3, dtype=F.dtype)


_CODE = ExtraEnergy("residual_stress", _energy, _stress, _moduli, of_moduli=False)


@dataclass(frozen=True, kw_only=True)
class ResidualStress(Mechanism):
    """A tension along a direction in all tissue or in an element set."""

    tension: float = parameter(  # `sigma`
        "Stress before anything is done; negative is compression.",
        unit="Pa",
        expectation=Expectation.normal(0.0, 300.0),
        typical="100 to 1000 Pa along white-matter tracts of mice",
        source="Xu et al. 2009 (diagnosis design, M13)",
    )
    direction: tuple[float, float, float] | None = parameter(
        "Direction of the tension, if it is the same everywhere.", kind="vector", default=None
    )
    field: str = parameter(
        "Direction of the tension in each element: an array of the mesh, or a .csv, .npy or mesh file of one for each.",
        kind="directions",
        default="",
        typical="principal direction of diffusion tensor imaging",
    )
    elements: str = parameter("Element set that is under it.", default="", kind="element set", absent="all tissue")
    kind: ClassVar[str] = "residual-stress"
    quadratic: ClassVar[bool] = True
    of_specimens: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("tension", "T")
    changes: ClassVar[Changed] = "loads"
    together: ClassVar[Mapping[str, str]] = {
        "inclusion": "A tension is a stress that is said in Pa, no modulus: it stays.",
        "swelling": "The tension is that of the swollen tissue, along the grown direction.",
        "cavity": "The tension goes with the tissue.",
    }
    sentence: ClassVar[str] = "Tissue is under tension before anything is done to it."
    example: ClassVar[str] = "residual-stress:tension=500,direction=0/0/1,elements=ball"
    confused_with: ClassVar[tuple[str, ...]] = ("swelling",)
    several: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.direction is not None:
            unit_vector("direction", self.direction)

    def check(self, mesh: TetMesh) -> None:
        super().check(mesh)
        element_directions(mesh, elements_of(mesh, self.elements), self.direction, self.field)

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """Along each axis of the anatomy, in all tissue."""
        sd = 300.0 * situation.stiffness
        return Proposal.along_axes(lambda axis, sigma: cls(tension=sigma, direction=axis), sd, "tension", situation)

    @classmethod
    def size_in_words(cls, values: Values, gravity_axis: tuple[float, float, float] | None = None) -> Sequence[str]:
        if "tension" not in values:
            return []
        tension, where = values["tension"], along(vector_in(values, "direction"))
        word = "tension" if tension.value >= 0.0 or unsure(tension) else "compression"
        size = abs(tension.value) if word == "compression" else tension.value
        clause = f"it is under a {word} of {measured(size, tension.sd, 'Pa')} {where}".rstrip()
        return [f"{clause}, {HARDLY}" if unsure(tension) else clause]

    def bind(self, body: Body) -> ExtraEnergyTerm:
        elements = elements_of(body.mesh, self.elements)
        directions = element_directions(body.mesh, elements, self.direction, self.field)
        row = np.full((len(elements), 1), self.tension)
        return ExtraEnergyTerm(body, _CODE, elements, np.hstack([row, directions]), self.factor)
