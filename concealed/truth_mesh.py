"""The mesh that observations are made on: the anatomy of a stand-in, cut and meshed anew and finer than what ships."""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.cases.building.cleaning import finished
from warpbrain.cases.building.mmg import Size, fit_size, remesh
from warpbrain.cases.building.pipeline import RECIPES, discretise, named_mesh
from warpbrain.cases.building.template import template_anatomy
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh, read_mesh, write_mesh

#: How it is made: lattice and largest edge of the first pass and first guess of the last [mm, template], wanted nodes.
RECIPE: dict[str, Any] = {"lattice": 5.0, "first_edge": 5.5, "edge": 6.4, "nodes": [14500, 22000]}
#: How much sharper angles may be than in a mesh that ships [degrees].
EASIER = 7.0


def truth_mesh(name: str, folder: Path) -> TetMesh:
    """The fine mesh of a case, from a folder of meshes made before, or made now and kept there.

    Parameters
    ----------
    name : str
        A clinical case.
    folder : Path
        Outside the repository: these meshes are never shipped.

    Returns
    -------
    TetMesh
        Grey 1 and white 2 [m, RAS], with the tissue that is resected.
    """
    file = folder / f"{name}.vtu"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_mesh(file, make_truth_mesh(name), unit="mm")
    return read_mesh(file, unit="mm")


def make_truth_mesh(name: str) -> TetMesh:
    """Make the fine mesh of a case: the steps of the shipped ones, on a finer lattice."""
    recipe = RECIPES[name]
    cut = remesh(discretise(template_anatomy(), recipe, multi=True, spacing=RECIPE["lattice"]), RECIPE["first_edge"])
    if cut is None:
        raise InputError(f"case {name}: MMG could not mesh the finer lattice")
    good = partial(finished, easier=EASIER)
    return named_mesh(fit_size(cut, Size("nodes", *RECIPE["nodes"]), RECIPE["edge"], good), recipe)


def fingerprint(mesh: TetMesh) -> str:
    """SHA-256 of a mesh, however it is numbered: its points to a nanometre, tetrahedra and labels."""
    points = np.round(mesh.points * 1e9).astype("<i8")
    order = np.lexsort(points.T)
    tetrahedra = np.sort(np.argsort(order)[mesh.tetrahedra], axis=1)
    elements = np.lexsort(tetrahedra.T)
    digest = hashlib.sha256()
    for array in (points[order], tetrahedra[elements].astype("<i4"), mesh.tissue[elements].astype("<i4")):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
