"""What each shipped mesh must be (volume, size, individual, resection), and how all of a case are built: template maps
in, VTU files and a record of what they are out."""

import json
import os
import platform
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Singles
from warpbrain.atomic import write_text
from warpbrain.cases.building.cleaning import SMALLEST_PIECE, cut_body, finished, small_pieces
from warpbrain.cases.building.lattice import Field, bcc_lattice, cut
from warpbrain.cases.building.mmg import Cells, Size, fit_size, remesh, require_extra
from warpbrain.cases.building.node_sets import node_sets, with_example_sets
from warpbrain.cases.building.template import Anatomy, anterior_temporal_lobe, individual, template_anatomy
from warpbrain.errors import InputError
from warpbrain.mesh import Quality, TetMesh, interface_faces, measure, nodes_of, ordered, split_boundary, write_mesh
from warpbrain.mesh.tet_mesh import signed_volumes


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
NAMES = tuple(RECIPES)
GREY, WHITE, RESECTED = 1, 2, 10

# background lattice [mm]: finer than any mesh made from it
LATTICE = 6.0
# largest edge [mm] of the first pass, which only takes out the needles left by the cutting
FIRST_EDGE = 8.0


def build(name: str, out_dir: str | os.PathLike[str], progress: Callable[[str], None] = lambda line: None) -> Path:
    """Build every mesh of a case.

    `name`: ``"phantom"`` or one of the clinical cases, ``"0529"``; `NAMES` has them all.
    `out_dir`: the folder ``out_dir/name`` receives the meshes (VTU, millimetres) and ``meshes.json``, their record.
    `progress`: called with one line of text whenever something is done.

    Returns the folder written.
    """
    if name not in RECIPES:
        raise InputError(f"no case '{name}' can be built; choose from {', '.join(NAMES)}")
    require_extra()
    recipe = RECIPES[name]
    folder = Path(out_dir) / name
    folder.mkdir(parents=True, exist_ok=True)
    # a record of earlier meshes must not lie beside new ones if this is killed
    (folder / "meshes.json").unlink(missing_ok=True)
    progress("reading template maps, smoothing")
    anatomy = template_anatomy()
    record: dict[str, Any] = {"versions": versions(), "meshes": {}}
    tetrahedra: dict[str, int] = {}
    start: dict[bool, Cells] = {}
    for wanted in recipe.meshes:
        if wanted.multi not in start:
            progress(f"cutting the lattice along the surfaces ({'two tissues' if wanted.multi else 'one tissue'})")
            made = remesh(discretise(anatomy, recipe, wanted.multi), FIRST_EDGE)
            if made is None:
                raise InputError("MMG could not mesh the cut lattice")
            start[wanted.multi] = made
        size = wanted.size(tetrahedra)
        progress(f"{wanted.file}: looking for {size.at_least} to {size.at_most} {size.of}")
        cells = fit_size(start[wanted.multi], size, 13.0, finished)
        mesh = named_mesh(cells, recipe)
        tetrahedra[wanted.file] = len(mesh.tetrahedra)
        write_mesh(folder / f"{wanted.file}.vtu", mesh, unit="mm")
        quality = measure(mesh)
        record["meshes"][wanted.file] = describe(mesh, quality)
        if wanted.with_examples:
            examined = with_example_sets(mesh)
            write_mesh(folder / f"{wanted.with_examples}.vtu", examined, unit="mm")
            record["meshes"][wanted.with_examples] = describe(examined, quality)
        progress(
            f"{wanted.file}: {quality.nodes} nodes, {quality.tetrahedra} tetrahedra, smallest dihedral angle "
            f"{quality.min_dihedral:.1f}, first percentile {quality.first_percentile_dihedral:.1f} degrees"
        )
    write_text(folder / "meshes.json", json.dumps(record, indent=2) + "\n")
    return folder


def versions() -> dict[str, str]:
    """Versions of everything that has a say in the result."""
    packages = {package: version(package) for package in ("mmgpy", "nilearn", "nibabel", "numpy", "scipy")}
    return {**packages, "machine": f"{platform.system()} {platform.machine()}"}


def describe(mesh: TetMesh, quality: Quality) -> dict[str, Any]:
    """A mesh in numbers, for the record that ships beside it."""
    _outer, cavities = split_boundary(mesh.points, mesh.tetrahedra)
    return {
        **{key: _rounded(value) for key, value in asdict(quality).items()},
        "closed_surfaces": 1 + len(cavities),
        "node_sets": {key: int(members.sum()) for key, members in mesh.node_sets.items()},
        "element_sets": {key: int(members.sum()) for key, members in mesh.element_sets.items()},
        "tissue_volume": {
            str(label): _rounded(float(mesh.volumes[mesh.tissue == label].sum())) for label in mesh.labels
        },
        "element_set_volume": {
            key: _rounded(float(mesh.volumes[members].sum())) for key, members in mesh.element_sets.items()
        },
    }


def _rounded(value: Any) -> Any:
    return float(f"{value:.6g}") if isinstance(value, float) else value


def discretise(anatomy: Anatomy, recipe: CaseRecipe, multi: bool, spacing: float = LATTICE) -> Cells:
    """The lattice, with cubes of a spacing [mm, template], cut along every surface, `multi`: along the interface of
    grey and white matter, too. Labels are grey 1 and white 2, plus 10 in resected tissue."""

    def sampled(field: Singles) -> Field:
        return partial(anatomy.grid.sampled, field)

    inside = anatomy.grid.positions(np.argwhere(anatomy.brain > 0))
    points, tetrahedra = bcc_lattice(inside.min(axis=0) - spacing, inside.max(axis=0) + spacing, spacing)
    cells = Cells(points, tetrahedra, np.full(len(tetrahedra), GREY, dtype=np.int64))
    near = sampled(anatomy.brain)(points)[tetrahedra].max(axis=1) > -0.3
    cells = cells.part(near).compact()
    cells = cut_body(cells, sampled(anatomy.brain), sampled(anatomy.ventricle), SMALLEST_PIECE, [])
    if multi:
        cells, white = cut(cells, sampled(anatomy.white))
        white = white & ~small_pieces(cells, white)
        white |= small_pieces(cells, ~white)
        cells.labels[white] = WHITE
    if recipe.resection is not None:
        cells, taken = cut(cells, partial(anterior_temporal_lobe, side=recipe.resection))
        cells.labels[taken & ~small_pieces(cells, taken)] += RESECTED
    cells = cells.compact()
    if recipe.seed is None:
        return cells
    return replace(cells, points=individual(cells.points, recipe.seed, INDIVIDUAL_AMPLITUDE))


def named_mesh(cells: Cells, recipe: CaseRecipe) -> TetMesh:
    """Scale to the wanted volume, name the sets, and number so that neighbours are near in memory."""
    tetrahedra, resected = cells.tetrahedra, cells.labels >= RESECTED
    sets = node_sets(cells.points, tetrahedra)
    elements = {}
    if recipe.resection is not None:
        taken, left = (nodes_of(tetrahedra[part], len(cells.points)) for part in (resected, ~resected))
        sets["resection"] = nodes_of(interface_faces(tetrahedra, resected), len(cells.points))
        sets["fixed"] = sets["fixed"] & ~(taken & ~left)
        elements["resection"] = resected
    scale = (recipe.volume / signed_volumes(cells.points, tetrahedra).sum()) ** (1 / 3)
    labels = (cells.labels % RESECTED).astype(np.int32)
    return ordered(TetMesh(cells.points * scale, tetrahedra.astype(np.int32), labels, sets, elements))
