"""Resection: tissue that the surgeon took out is no longer there."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from warpbrain.arrays import Int32s
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation


@dataclass(frozen=True, kw_only=True)
class Resection(Mechanism):
    """Removes the elements of a set before anything is computed; the cavity stays empty and its wall free."""

    elements: str = parameter("Element set that was taken out.", default="resection", kind="element set")
    kind: ClassVar[str] = "resection"
    switches: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("body", "resection")
    sentence: ClassVar[str] = "Tissue was taken out, and what it held moves into the cavity."
    example: ClassVar[str] = "resection:elements=ball"

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """None: elements that are gone leave no state to compare with."""
        situation.require_new(cls.kind)
        raise NotTestableError("what was taken out is looked for as 'cavity', which empties the same elements")

    def detail(self) -> str:
        return f" It is the element set '{self.elements}'; the wall of the cavity is free."

    @classmethod
    def excluded(cls, other: type[Mechanism]) -> str:
        """Where nothing is left of what another one acts on; see `warpbrain.physics.composition.require_left`."""
        places = ("node set", "element set", "position")
        if not any(spec.kind in places for spec in other.parameters().values()):
            return ""
        return f"where nothing is left of what {other.kind} acts on"

    def check(self, mesh: TetMesh) -> None:
        """See `warpbrain.physics.mechanism.Mechanism`; of the set something must be left, too."""
        super().check(mesh)
        if not self.elements or mesh.element_sets[self.elements].all():
            raise ParameterError("elements", f"the element set '{self.elements}' is the whole body: nothing is left")

    def remaining(self, mesh: TetMesh) -> tuple[TetMesh, Int32s]:
        """See `Removing`; `ParameterError` if the mesh has no such set, or the set is empty or everything."""
        self.check(mesh)
        left, nodes, _ = mesh.without(mesh.element_sets[self.elements])
        return left, nodes
