"""What each shipped mesh must be: volume, size, individual, resection."""

from __future__ import annotations

from dataclasses import dataclass

from warpbrain.cases.building.mmg import Size


@dataclass(frozen=True)
class MeshRecipe:
    """One mesh of a case: its file without ending, whether it has grey and white matter with a conforming interface,
    the wanted number of nodes (from, to) or of tetrahedra as a multiple of another mesh of the case, and the name of a
    second file of it with the sets that examples of mechanisms act on."""

    file: str
    multi: bool
    nodes: tuple[int, int] | None = None
    finer_than: tuple[str, float] | None = None
    with_examples: str = ""

    def size(self, tetrahedra: dict[str, int]) -> Size:
        """The wanted size, given the numbers of tetrahedra of the meshes already made."""
        if self.nodes is not None:
            return Size("nodes", *self.nodes)
        assert self.finer_than is not None
        exact = tetrahedra[self.finer_than[0]] * self.finer_than[1]
        return Size("tetrahedra", int(exact) + 1, int(exact * TOLERANCE))


@dataclass(frozen=True)
class CaseRecipe:
    """A case: the volume [m3] of the whole brain without its ventricles, to which meshes are scaled, these in the order
    of making, the seed of the individual deformation (None: the template itself), and the side of the resection of an
    anterior temporal lobe."""

    volume: float
    meshes: tuple[MeshRecipe, ...]
    seed: int | None = None
    resection: str | None = None


TOLERANCE = 1.03
# root mean square displacement of the individual deformation [mm, template]
INDIVIDUAL_AMPLITUDE = 3.0


def _at_least(nodes: int) -> tuple[int, int]:
    return nodes, int(nodes * TOLERANCE)


def _about(nodes: int) -> tuple[int, int]:
    return int(nodes * 0.98) + 1, int(nodes * 1.02)


# What the paper publishes of the clinical cases (Tables 4 and 5): volume [m3], side of the temporal lobe, nodes of the
# mesh of one tissue and of two.
_CLINICAL = {
    "0529": (1.1654e-3, "left", 3619, 5060),
    "0614": (1.0617e-3, "left", 2692, 4112),
    "0660": (1.1344e-3, "left", 2795, 4308),
    "0685": (1.0899e-3, "left", 2425, 4093),
    "0535": (1.2388e-3, "right", 2662, 4225),
    "0555": (1.1706e-3, "right", 2221, 3932),
    "0603": (1.0601e-3, "right", 2742, 4348),
    "0684": (1.1865e-3, "right", 2250, 3930),
}


def _stand_in(name: str, volume: float, side: str, single: int, multi: int) -> CaseRecipe:
    meshes = MeshRecipe("single", False, _about(single)), MeshRecipe("multi", True, _about(multi))
    # an individual of its own for every case, the same at every build
    return CaseRecipe(volume, meshes, seed=int(name), resection=side)


# Volumes: the published values for the phantom and for the clinical cases. The fine meshes have as many more
# tetrahedra than the coarse ones as the published fine assemblies took longer, scaled by node throughput.
RECIPES: dict[str, CaseRecipe] = {
    "phantom": CaseRecipe(
        volume=1.6092e-3,
        meshes=(
            MeshRecipe("single-coarse", multi=False, nodes=_at_least(2677), with_examples="single-loaded"),
            MeshRecipe("multi-coarse", multi=True, nodes=_at_least(4169), with_examples="multi-loaded"),
            MeshRecipe("single-fine", multi=False, finer_than=("single-coarse", 28.31 / 18.32)),
            MeshRecipe("multi-fine", multi=True, finer_than=("multi-coarse", 136.8 / 55.43)),
        ),
    ),
    **{name: _stand_in(name, *published) for name, published in _CLINICAL.items()},
}
