"""Which mechanisms cannot act together."""

import itertools
from collections.abc import Sequence

from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Mechanism, Removing


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
