"""A case folder in which every kind of file that can be named stands once."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
from folders import block, write_recorded
from landmark_files import START, TAG, fcsv, markup
from surface_files import vtp

MORE = """
[[boundary]]
name = "row"
nodes = "ids.csv"
kind = "force"
total = [0, 0, 0.001]

[[mechanism]]
kind = "fibres"
stiffness = 300.0
field = "fibres.npy"

[[recording]]
name = "tags"
kind = "points"
file = "recordings/p.tag"
outside = "nearest"

[[recording]]
name = "markup"
kind = "points"
file = "recordings/p.mrk.json"
moved = "recordings/q.mrk.json"
outside = "nearest"

[[recording]]
name = "fiducials"
kind = "points"
file = "recordings/p.fcsv"
moved = "recordings/q.fcsv"
outside = "nearest"
"""
SURFACES = ("vtp", "stl", "ply", "obj", "off", "vtk")
SURFACE = (
    '\n[[recording]]\nname = "s-{0}"\nkind = "surface"\nfile = "recordings/s.{0}"\nnodes = "top"\nrole = "check"\n'
)
MESHES = ("mesh.vtu", "mesh.msh", "mesh.inp", "mesh.vtk", "mesh.mesh")


def write_whole(folder: Path) -> Path:
    """The block with all that a case can hold; it is read without a problem."""
    write_recorded(folder)
    mesh = block()
    raw = meshio.Mesh(
        1000.0 * mesh.points,
        [("tetra", mesh.tetrahedra)],
        point_data={name: members.astype(np.int32) for name, members in mesh.node_sets.items()},
        cell_data={"tissue": [mesh.tissue]},
    )
    for name in MESHES[1:]:
        plain = raw if name.endswith((".msh", ".vtk")) else meshio.Mesh(raw.points, raw.cells)
        meshio.write(folder / name, plain)
    top = np.flatnonzero(mesh.node_sets["top"])
    (folder / "ids.csv").write_text("node\n" + "\n".join(map(str, top)) + "\n")
    np.save(folder / "fibres.npy", np.tile([0.0, 0.0, 1.0], (len(mesh.tetrahedra), 1)))
    place = folder / "recordings"
    (place / "p.tag").write_text(TAG)
    for name in ("p", "q"):
        (place / f"{name}.mrk.json").write_text(markup(*START))
        (place / f"{name}.fcsv").write_text(fcsv(*START))
    lid = 1000.0 * mesh.points[top]
    faces = np.array([[0, 1, 3], [1, 4, 3], [3, 4, 6], [4, 7, 6]])
    for ending in SURFACES[1:]:
        meshio.write(place / f"s.{ending}", meshio.Mesh(lid, [("triangle", faces)]))
    (place / "s.vtp").write_bytes(vtp("appended", "raw", "vtkZLibDataCompressor"))
    with (folder / "case.toml").open("a", encoding="utf-8") as file:
        file.write(MORE + "".join(SURFACE.format(ending) for ending in SURFACES[1:]))
    return folder
