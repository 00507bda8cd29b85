"""The bodies: what a case declares, and the mesh that its truth is computed on."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from referee.body import Body
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.mesh import TetMesh, boundary_faces

MESHES = Path(__file__).parent / "meshes"
#: Bodies that cases are made of; the last is for the scored set alone.
NAMES = ("phantom", "0529", "0603")
#: A declared mesh of the phantom that is too coarse.
COARSE = "phantom-coarse"
#: Direction from the middle to the patch at the side that is declared as fixed too, and its radius [m].
_SIDE, _SIDE_RADIUS = np.array([1.0, 0.0, 0.5]), 0.032


@cache
def declared_case(name: str) -> Case:
    """The shipped case whose tissues are declared."""
    return find_case(name)


@cache
def declared_mesh(name: str) -> TetMesh:
    """The mesh that a case declares: a shipped one after its resection, with the set `side` on its surface."""
    if name == COARSE:
        return _read(name)
    mesh = find_case(name).mesh
    if "resection" in mesh.element_sets:
        whole = {tuple(face) for face in np.sort(boundary_faces(mesh.tetrahedra), axis=1).tolist()}
        mesh, nodes, _ = mesh.without(mesh.element_sets["resection"])
        faces = boundary_faces(mesh.tetrahedra)
        fresh = np.array([tuple(face) not in whole for face in np.sort(nodes[faces], axis=1).tolist()])
        cavity = np.zeros(len(mesh.points), dtype=bool)
        cavity[faces[fresh]] = True
        others = {key: members for key, members in mesh.node_sets.items() if key != "resection"}
        mesh = replace(mesh, node_sets={**others, "cavity": cavity}, element_sets={})
    sets = mesh.node_sets
    skull = sets["surface"] & ~sets["fixed"] & ~sets["ventricle"] & ~sets["superior"]
    if "cavity" in sets:
        skull &= ~sets["cavity"]
    middle = 0.5 * (mesh.points.min(axis=0) + mesh.points.max(axis=0))
    along = (mesh.points - middle) @ _SIDE
    centre = mesh.points[np.where(skull, along, -np.inf).argmax()]
    side = skull & (np.linalg.norm(mesh.points - centre, axis=1) < _SIDE_RADIUS)
    return replace(mesh, node_sets={**sets, "side": side})


@cache
def true_body(name: str) -> Body:
    """The body that truths are computed on."""
    return Body(_read(name))


def _read(name: str) -> TetMesh:
    with np.load(MESHES / f"{name}.npz") as data:
        points = 1e-9 * data["points"].astype(float)
        sets = {}
        for key in data.files:
            if key.startswith("set_"):
                sets[key[4:]] = np.zeros(len(points), dtype=bool)
                sets[key[4:]][data[key]] = True
        return TetMesh(points, data["tetrahedra"].astype(np.int32), data["tissue"].astype(np.int32), sets)
