"""Which mechanisms cannot act together, and what each pair of them means if they can."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism, Removing
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.potential import potential


class CompositionError(InputError):
    """Two mechanisms that have no meaning together."""


def require_composable(acting: Sequence[Mechanism], mesh: TetMesh) -> None:
    """Raise `CompositionError` if two mechanisms exclude each other on a mesh, without what has been removed."""
    for mechanism, other in itertools.combinations(acting, 2):
        for first, second in ((mechanism, other), (other, mechanism)):
            if reason := first.excludes(second, mesh):
                raise CompositionError(f"{first.kind} and {second.kind} cannot act together: {reason}")


def require_left(acting: Sequence[Mechanism], mesh: TetMesh) -> TetMesh:
    """What mechanisms leave of a whole anatomy; `CompositionError` if they take away what others of them act on."""
    left = mesh
    for removing in acting:
        if not isinstance(removing, Removing):
            continue
        left, _ = removing.remaining(left)
        for other in acting:
            if other is removing:
                continue
            try:
                other.check(left)
            except InputError as error:
                raise CompositionError(
                    f"{removing.kind} and {other.kind} cannot act together: in the tissue that is left {error}"
                ) from None
    return left


@dataclass(frozen=True)
class Pair:
    """What two kinds of mechanisms, or one twice, are together."""

    kinds: tuple[str, str]
    potential: str  # the total potential with both, as a formula; empty if a case cannot have both
    remark: str  # what the formula leaves open; empty if nothing
    refused: str  # where, or why, a case cannot have both; empty if it always can


def pairs() -> list[Pair]:
    """All pairs of the registry, each kind with itself too, in the order of their names."""
    kinds = mechanisms().values()
    return [_pair(kind, other) for kind, other in itertools.combinations_with_replacement(kinds, 2)]


def _pair(first: type[Mechanism], second: type[Mechanism]) -> Pair:
    kinds = (first.kind, second.kind)
    if first is second and not first.several:
        at_a_time = " at a time" if issubclass(first, Load) else ""
        turns = "; several take turns by their ramps" if at_a_time else ""
        words = f"a case has one {first.kind}{at_a_time}, a second one would act twice{turns}"
        return Pair(kinds, "", "", f"{words}; that of `--with` takes its place")
    remark = first.together.get(second.kind, "") or second.together.get(first.kind, "")
    refused = first.excluded(second) or second.excluded(first)
    return Pair(kinds, potential([first.enters, second.enters]), remark, refused)
