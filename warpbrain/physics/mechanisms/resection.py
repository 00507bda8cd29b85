"""Resection: tissue that the surgeon took out is no longer there."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from warpbrain.arrays import Int32s
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Mechanism, parameter
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

    def remaining(self, mesh: TetMesh) -> tuple[TetMesh, Int32s]:
        """See `Removing`; `InputError` if the mesh has no such set, or the set is empty or everything."""
        members = mesh.element_sets.get(self.elements)
        if members is None:
            present = ", ".join(sorted(mesh.element_sets)) or "none"
            raise InputError(f"resection: the mesh has no element set '{self.elements}' (it has {present})")
        if not members.any() or members.all():
            count = int(members.sum())
            raise InputError(f"resection: element set '{self.elements}' holds {count} of {len(members)} tetrahedra")
        left, nodes, _ = mesh.without(members)
        return left, nodes
