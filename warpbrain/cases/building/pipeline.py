"""Build the meshes of a case: template maps in, VTU files and a record of what they are out."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Floats, Singles
from warpbrain.atomic import write_text
from warpbrain.cases.building.cleaning import SMALLEST_PIECE, cut_body, finished, first_pass, small_pieces
from warpbrain.cases.building.errors import BuildError, require_extra
from warpbrain.cases.building.lattice import bcc_lattice, compact, cut
from warpbrain.cases.building.mmg import Cells, fit_size
from warpbrain.cases.building.node_sets import margin, node_sets, with_example_sets
from warpbrain.cases.building.recipes import INDIVIDUAL_AMPLITUDE, RECIPES, CaseRecipe
from warpbrain.cases.building.template import Anatomy, IndividualWarp, anterior_temporal_lobe, template_anatomy
from warpbrain.mesh import Quality, TetMesh, measure, ordered, split_boundary, write_mesh
from warpbrain.mesh.tet_mesh import signed_volumes

NAMES = tuple(RECIPES)
GREY, WHITE, RESECTED = 1, 2, 10

# background lattice [mm]: finer than any mesh made from it
LATTICE = 6.0


def build(name: str, out_dir: str | os.PathLike[str], progress: Callable[[str], None] = lambda line: None) -> Path:
    """Build every mesh of a case.

    `name`: ``"phantom"`` or one of the clinical cases, ``"0529"``; `NAMES` has them all.
    `out_dir`: the folder ``out_dir/name`` receives the meshes (VTU, millimetres) and ``meshes.json``, their record.
    `progress`: called with one line of text whenever something is done.

    Returns the folder written.
    """
    if name not in RECIPES:
        raise BuildError(f"no case '{name}' can be built; choose from {', '.join(NAMES)}")
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
            start[wanted.multi] = first_pass(discretise(anatomy, recipe, wanted.multi))
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

    def sampled(field: Singles) -> Callable[[Floats], Floats]:
        return partial(anatomy.grid.sampled, field)

    inside, origin = np.argwhere(anatomy.brain > 0), anatomy.grid.affine[:3, 3]
    lower, upper = (origin + end for end in (inside.min(axis=0) - spacing, inside.max(axis=0) + spacing))
    points, tetrahedra = bcc_lattice(lower, upper, spacing)
    tetrahedra = tetrahedra[(sampled(anatomy.brain)(points)[tetrahedra] > -0.3).any(axis=1)]
    points, tetrahedra = compact(points, tetrahedra)
    labels = np.full(len(tetrahedra), GREY, dtype=np.int64)

    surfaces = sampled(anatomy.brain), sampled(anatomy.ventricle)
    points, tetrahedra, labels = cut_body(points, tetrahedra, labels, *surfaces, SMALLEST_PIECE, [])
    if multi:
        points, tetrahedra, labels, white = cut(points, tetrahedra, labels, sampled(anatomy.white))
        white = white & ~small_pieces(points, tetrahedra, white)
        white |= small_pieces(points, tetrahedra, ~white)
        labels[white] = WHITE
    if recipe.resection is not None:
        lobe = partial(anterior_temporal_lobe, side=recipe.resection)
        points, tetrahedra, labels, taken = cut(points, tetrahedra, labels, lobe)
        labels[taken & ~small_pieces(points, tetrahedra, taken)] += RESECTED
    points, tetrahedra = compact(points, tetrahedra)
    if recipe.seed is not None:
        points = IndividualWarp(recipe.seed, INDIVIDUAL_AMPLITUDE)(points)
    return Cells(points, tetrahedra, labels)


def named_mesh(cells: Cells, recipe: CaseRecipe) -> TetMesh:
    """Scale to the wanted volume, name the sets, and number so that neighbours are near in memory."""
    tetrahedra, resected = cells.tetrahedra, cells.labels >= RESECTED
    sets = node_sets(cells.points, tetrahedra)
    elements = {}
    if recipe.resection is not None:
        wall, gone = margin(tetrahedra, resected, len(cells.points))
        sets["resection"] = wall
        sets["fixed"] = sets["fixed"] & ~gone
        elements["resection"] = resected
    scale = (recipe.volume / signed_volumes(cells.points, tetrahedra).sum()) ** (1 / 3)
    labels = (cells.labels % RESECTED).astype(np.int32)
    return ordered(TetMesh(cells.points * scale, tetrahedra.astype(np.int32), labels, sets, elements))
