"""The anatomy of a case: its mesh, or the mesh of its specimen, checked for being one sound body."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from warpbrain.cases.format.reading import Context
from warpbrain.cases.format.tables import MESH, SPECIMEN
from warpbrain.cases.specimen import Specimen
from warpbrain.frame import METRES
from warpbrain.mesh import MeshError, MeshInFile, pinched_nodes, read_mesh_file
from warpbrain.mesh.files import ends_inside_a_number
from warpbrain.mesh.quality import coincident_nodes
from warpbrain.mesh.surface import boundary_faces

#: Volumes [m3] that no brain, phantom or specimen has: 100 litres, and a tenth of a cubic millimetre.
LARGEST_VOLUME, SMALLEST_VOLUME = 0.1, 1e-10


def read_anatomy(context: Context) -> tuple[str, MeshInFile | None, Specimen | None]:
    """The mesh's file name, the mesh as that file has it, and the specimen, as far as they are right."""
    if "specimen" in context.tables:
        specimen = _read_specimen(context)
        if "mesh" in context.tables:
            context.problem("[mesh]", "means nothing with [specimen], whose shape is meshed")
        if specimen is None:
            return "", None, None
        mesh = specimen.mesh()
        return "", MeshInFile(mesh, np.arange(len(mesh.points)), len(mesh.points)), specimen
    table = context.table(MESH)
    path = table.path("file")
    in_file = None if path is None else _read_mesh(context, path, table.get("tissue"))
    return table.get("file") or "", in_file, None


def _read_specimen(context: Context) -> Specimen | None:
    table = context.table(SPECIMEN)
    size = table.get("size")
    if table.has("radius") and table.has("height"):
        size = (2.0 * table.get("radius"), 2.0 * table.get("radius"), table.get("height"))
    if size is None:
        return None
    if min(size) <= 0.0:
        table.problem("size", f"found {size}, expected 3 positive numbers [{context.frame.unit}]")
        return None
    if not table.has("grips"):
        return None
    if max(size) > 100.0 * min(size):
        table.problem("shape", f"{max(size):g} long and {min(size):g} thick: too slender to be meshed as it is")
        return None
    x, y, z = (context.frame.metres * float(length) for length in size)
    return Specimen(str(table.variant), (x, y, z), table.get("grips"))


def _read_mesh(context: Context, path: Path, tissue: str | None) -> MeshInFile | None:
    """The mesh, if it is one body of a size that a body can have."""
    problems, frame = context.problems, context.frame
    try:
        in_file = read_mesh_file(path, frame.unit, tissue)
    except MeshError as error:
        for message in error.messages:
            problems.add(path, "", message.removeprefix(f"{path}: "))
        return None
    if ends_inside_a_number(path):
        problems.remark(path, "the last line ends in a number without a line break: is the file cut off?")
    mesh = in_file.mesh
    if not np.all(frame.signs > 0):
        # both axes conventions are right-handed: turning two axes keeps the orientation of the elements
        turned = {name: frame.directions(vectors) for name, vectors in mesh.element_vectors.items()}
        mesh = replace(mesh, points=frame.directions(mesh.points), element_vectors=turned)
    if left := in_file.file_nodes - len(mesh.points):
        problems.remark(path, f"tetrahedra of second order: their corners are used, {left} nodes on edges are not")
    volume = mesh.volume
    if not SMALLEST_VOLUME < volume < LARGEST_VOLUME:
        other = next(name for name in METRES if name != frame.unit)
        converted = 1e6 * volume * (METRES[other] / frame.metres) ** 3
        volume_told = f"the volume is {1e6 * volume:.4g} cm3 if lengths are in {frame.unit}"
        cure = f'with [case] units = "{other}" it would be {converted:.4g} cm3'
        problems.add(path, "", f"{volume_told}, which no brain, phantom or specimen has", cure)
        return None
    pairs = coincident_nodes(mesh.points)
    if len(pairs):
        a, b = in_file.node_numbers[pairs[0]]
        message = f"{len(pairs)} pair(s) of nodes are at the same place (first {a} and {b}): the body is torn there"
        problems.add(path, f"node {a}", message, "merge them and number the tetrahedra anew")
    try:
        faces = boundary_faces(mesh.tetrahedra)
    except ValueError as error:
        problems.add(path, "", f"{error}: the surface is not closed", "tetrahedra may not overlap")
        return None
    if len(pinched := pinched_nodes(faces)):
        first = in_file.node_numbers[pinched[0]]
        problems.remark(path, f"the surface touches itself at {len(pinched)} node(s), first at node {first}")
    return replace(in_file, mesh=mesh)
