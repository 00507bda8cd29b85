"""Directions of the elements of a mesh from a file: a table, an array of NumPy, or the same mesh with one array."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.frame import Frame
from warpbrain.mesh import MeshError, TetMesh, read_mesh
from warpbrain.problems import Problems
from warpbrain.recordings.tables import read_table
from warpbrain.recordings.text import collected, is_readable

Floats = NDArray[np.float64]

#: Endings of meshes that directions are read from.
_MESHES = (".vtu", ".vtk", ".xdmf", ".msh")
#: Endings of files that hold directions.
ENDINGS = (".csv", ".npy", *_MESHES)


def read_directions(path: Path, mesh: TetMesh, frame: Frame, problems: Problems) -> Floats | None:
    """Vectors (m, 3), RAS, one for each element of a mesh in its order; None if something is wrong.

    A .csv has the columns x, y and z; an .npy is an array (m, 3); a mesh file has the same tetrahedra and one array of
    three columns.
    """
    readers = {".csv": _from_table, ".npy": _from_array}
    vectors = readers.get(path.suffix.lower(), _from_mesh)(path, mesh, problems)
    if vectors is None:
        return None
    if vectors.shape != (len(mesh.tetrahedra), 3):
        found = " x ".join(map(str, vectors.shape))
        problems.add(path, "", f"found {found} numbers, expected {len(mesh.tetrahedra)} x 3: a row for each element")
        return None
    return frame.directions(vectors)


def _from_table(path: Path, _mesh: TetMesh, problems: Problems) -> Floats | None:
    columns = ("x", "y", "z")
    with collected(path, problems) as found:
        table = read_table(path, found, columns)
        vectors = table.vectors(*columns) if table is not None and table.require(*columns) else None
    return None if found else vectors


def _from_array(path: Path, mesh: TetMesh, problems: Problems) -> Floats | None:
    if not is_readable(path, problems):
        return None
    try:
        # mapped, so that a header with more numbers than the file has is known before any memory is taken
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # headers are Python text: random ones raise what its tokenizer does
        problems.add(path, "", f"not an array of NumPy ({' '.join(str(error).split())[:100]})")
        return None
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "iuf":
        problems.add(path, "", "expected one array of real numbers")
        return None
    # checked before it is read
    return array if array.shape != (len(mesh.tetrahedra), 3) else array.astype(np.float64)


def _from_mesh(path: Path, mesh: TetMesh, problems: Problems) -> Floats | None:
    try:
        other = read_mesh(path)
    except MeshError as error:
        problems.add(path, "", str(error).removeprefix(f"{path}: "))
        return None
    if not np.array_equal(other.tetrahedra, mesh.tetrahedra):
        problems.add(path, "", "its tetrahedra are not those of the mesh, in their order")
        return None
    if len(other.element_vectors) != 1:
        names = ", ".join(sorted(other.element_vectors)) or "none"
        problems.add(path, "", f"expected one real array of three columns, found {names}")
        return None
    return next(iter(other.element_vectors.values()))
