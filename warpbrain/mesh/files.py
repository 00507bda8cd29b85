"""Meshes on disk: anything meshio reads comes in, a compressed VTU goes out.

Conventions of the files
    * tetrahedra of first order; of second-order ones the corners are taken;
    * tissue labels: an integer cell array, ``tissue`` unless the caller says otherwise;
    * node sets: named lists of nodes (Abaqus), and every point array of one column that is integer, boolean, or real
      with no values but 0 and 1; non-zero = member;
    * element sets: every such cell array whose name starts with ``set_``; the set's name is the rest;
    * element vectors: every real array of three columns, of cells, or of points where cells have none of that name; an
      element has the mean of its nodes' vectors, each turned to within a right angle of the first: what has an axis
      but no sense, as fibres do, must not cancel.
"""

import os
import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.atomic import is_full, whole_file
from warpbrain.errors import require_kind
from warpbrain.frame import METRES
from warpbrain.mesh.abaqus import read_abaqus
from warpbrain.mesh.patience import patience
from warpbrain.mesh.surface import nodes_of
from warpbrain.mesh.tet_mesh import MeshError, TetMesh
from warpbrain.mesh.vtu import read_vtu, write_vtu

ELEMENT_SET_PREFIX = "set_"
#: A larger file [bytes] is refused, not read: the largest meshes that are worth a simulation are a tenth of it.
LARGEST_FILE = 512 << 20
#: A file with the numbers of an XDMF file.
_COMPANION = re.compile(rb"<DataItem\b[^>]*\bFormat\s*=\s*[\"'](?:HDF|Binary)[\"'][^>]*>([^<]*)", re.IGNORECASE)
# cells of lower dimension are other people's boundary markers: they take nothing away from the volume
TETRAHEDRA = ("tetra", "tetra10")
_IGNORED = ("vertex", "line", "line3", "triangle", "triangle6", "quad", "quad8", "quad9", "polygon", "polyline")


@dataclass(frozen=True, eq=False)
class MeshInFile:
    """A mesh as a file has it."""

    mesh: TetMesh
    node_numbers: Ints  # (n,), for each node of the mesh its number in the file, from 0
    file_nodes: int  # how many nodes the file has: more than the mesh, if its tetrahedra are of second order


def read_mesh(path: str | os.PathLike[str], unit: str = "m", tissue: str | None = None) -> TetMesh:
    """Read a tetrahedral mesh from any file that meshio reads.

    Parameters
    ----------
    path : path
        The file. Of tetrahedra of second order the four corners are taken.
    unit : {"m", "mm"}
        Unit of the coordinates in the file; the mesh is in metres.
    tissue : str or None
        Name of the cell array of tissue labels. None: ``tissue`` if there is one, else one tissue, label 1.

    Returns
    -------
    TetMesh
        Axes are taken as they are: RAS is the caller's business.

    Raises
    ------
    MeshError
        Naming the file, what was found and what was expected.
    """
    return read_mesh_file(path, unit, tissue).mesh


def read_mesh_file(path: str | os.PathLike[str], unit: str = "m", tissue: str | None = None) -> MeshInFile:
    """As `read_mesh`, with the numbers that the nodes have in the file."""
    require_kind(path, (str, os.PathLike), "path", "the path of a mesh")
    return mesh_in_file(Path(path), read_raw(Path(path)), unit, tissue)


def read_raw(path: Path) -> Any:
    """What meshio reads of a file: a `meshio.Mesh` with cells of any kind.

    `MeshError`, naming the file, what was found and what was expected.
    """
    import meshio

    if not path.is_file():
        raise MeshError(f"{path}: no such file")
    if (size := path.stat().st_size) == 0:
        raise MeshError(f"{path}: not a mesh that meshio can read (the file is empty)")
    if size > LARGEST_FILE:
        raise MeshError(f"{path}: found {size / 1e6:.0f} MB, expected a mesh of at most {LARGEST_FILE / 1e6:.0f} MB")
    _check_companions(path)
    try:
        with patience(path):
            reader = {".vtu": read_vtu, ".inp": read_abaqus}.get(path.suffix.lower(), meshio.read)
            return reader(path)
    except MeshError as error:
        raise error.within(str(path)) from error
    except Exception as error:  # its readers raise whatever their parsers do
        if isinstance(error, OSError) and is_full(error):
            # some formats are read from a copy
            raise OSError(error.errno, error.strerror, tempfile.gettempdir()) from error
        detail = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshError(f"{path}: not a mesh that meshio can read ({detail})") from error


def _check_companions(path: Path) -> None:
    """`MeshError` if an XDMF file names data in another folder than its own."""
    if path.suffix.lower() not in (".xdmf", ".xmf"):
        return
    for item in _COMPANION.finditer(path.read_bytes()):
        name = item.group(1).decode("utf-8", "replace").strip().partition(":")[0]
        if not (path.parent / name).resolve().is_relative_to(path.parent.resolve()):
            raise MeshError(f"{path}: names '{name[:200]}', which leaves its folder")


def ends_inside_a_number(path: Path) -> bool:
    """Whether a text ends in a digit and not in a line break: cut off there, its last number is another one."""
    with path.open("rb") as file:
        file.seek(0, os.SEEK_END)
        file.seek(max(0, file.tell() - 256))
        end = file.read()
    # of a binary file the last byte may be that of a digit by chance
    return end[-1:].isdigit() and end.isascii() and b"\0" not in end


def mesh_in_file(path: Path, raw: Any, unit: str, tissue: str | None = None) -> MeshInFile:
    """The mesh of what `read_raw` gave, with the conventions of this module; errors name `path`."""
    try:
        return _from_meshio(raw, _scale(unit), tissue)
    except MeshError as error:
        raise error.within(str(path)) from error
    except (ValueError, IndexError, TypeError) as error:  # arrays that do not fit together
        raise MeshError(f"{path}: arrays that do not fit together ({' '.join(str(error).split())})") from error


def _from_meshio(raw: Any, scale: float, tissue: str | None) -> MeshInFile:
    kinds = [block.type for block in raw.cells]
    foreign = sorted({kind for kind in kinds if kind not in TETRAHEDRA and kind not in _IGNORED})
    if foreign:
        raise MeshError(f"found volume cells of type {', '.join(foreign)}; expected tetrahedra only")
    blocks = [number for number, kind in enumerate(kinds) if kind in TETRAHEDRA]
    if not blocks:
        raise MeshError(f"found no tetrahedra (cells: {', '.join(sorted(set(kinds))) or 'none'})")
    cells = {name: np.concatenate([data[b] for b in blocks]) for name, data in raw.cell_data.items()}
    if tissue is not None and tissue not in cells:
        raise MeshError(f"no cell array '{tissue}' for tissue labels; found {', '.join(sorted(cells)) or 'none'}")
    points = np.asarray(raw.points, dtype=np.float64)
    # the corners come first in every numbering of second-order tetrahedra that meshio knows
    tetrahedra = np.concatenate([raw.cells[b].data[:, :4] for b in blocks])
    vectors = _vectors(raw.point_data, cells, tetrahedra)
    # sets that a file holds as lists of nodes, as Abaqus' NSET
    listed = {name: np.asarray(ids, dtype=np.int64) for name, ids in (raw.point_sets or {}).items()}
    node_sets = _members(raw.point_data, "") | {name: nodes_of(ids, len(points)) for name, ids in listed.items()}
    numbers = np.arange(len(points))
    if middles := [raw.cells[b].data[:, 4:] for b in blocks if kinds[b] == "tetra10"]:
        # nodes on edges go; one that no tetrahedron has stays, to be found and named
        middle = np.setdiff1d(np.concatenate(middles), tetrahedra)
        numbers = np.setdiff1d(numbers, middle)
        renumbered = np.full(len(points), -1)
        renumbered[numbers] = np.arange(len(numbers))
        points, tetrahedra = points[numbers], renumbered[tetrahedra]
        node_sets = {name: members[numbers] for name, members in node_sets.items()}
    label = "tissue" if tissue is None else tissue
    mesh = TetMesh(
        points * scale,
        tetrahedra,
        cells.get(label),  # type: ignore[arg-type]  # TetMesh fills in and converts labels itself
        node_sets,
        _members({name: data for name, data in cells.items() if name != label}, ELEMENT_SET_PREFIX),
        vectors,
    )
    return MeshInFile(mesh, numbers, len(raw.points))


def _vectors(
    of_points: Mapping[str, Any], of_cells: Mapping[str, Any], tetrahedra: NDArray[np.integer]
) -> dict[str, Floats]:
    def real(arrays: Mapping[str, Any]) -> dict[str, Floats]:
        shaped = {name: array for name, data in arrays.items() if (array := np.asarray(data)).shape[1:] == (3,)}
        return {name: array.astype(np.float64) for name, array in shaped.items() if array.dtype.kind == "f"}

    vectors = {}
    for name, data in real(of_points).items():
        at_nodes = data[tetrahedra]
        with np.errstate(invalid="ignore"):
            against = np.einsum("eaj,ej->ea", at_nodes, at_nodes[:, 0]) < 0.0
        vectors[name] = np.where(against[:, :, None], -at_nodes, at_nodes).mean(axis=1)
    return vectors | real(of_cells)


def _members(arrays: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, Bools]:
    sets = {}
    for name, data in arrays.items():
        flag = np.asarray(data)
        if flag.ndim == 2 and flag.shape[1] == 1:
            flag = flag[:, 0]
        if not name.startswith(prefix) or flag.ndim != 1 or flag.dtype.kind not in "biuf":
            continue
        if flag.dtype.kind == "f":
            # a set that was saved as real numbers, and not a field such as a temperature
            finite = np.isfinite(flag)
            if not np.all(np.isin(flag[finite], (0.0, 1.0))) or not finite.any():
                continue
            if not finite.all():
                raise MeshError(f"array '{name}' holds {np.count_nonzero(~finite)} values that are not finite")
        sets[name.removeprefix(prefix)] = flag != 0
    return sets


def write_mesh(path: str | os.PathLike[str], mesh: TetMesh, unit: str = "m", axes: str = "RAS") -> None:
    """Write a mesh as compressed binary VTU, whole or not at all.

    Parameters
    ----------
    path : path
        Where to; must end in ``.vtu``. An existing file is replaced only once the new one is complete.
    mesh : TetMesh
        What to write.
    unit : {"m", "mm"}
        Unit of the coordinates in the file.
    axes : {"RAS", "LPS"}
        What the file says its axes are; coordinates are written as they are.
    """
    import meshio

    require_kind(mesh, TetMesh, "mesh", "a TetMesh, as warpbrain.read_mesh gives")
    target = Path(path)
    if target.suffix.lower() != ".vtu":
        raise MeshError(f"{target}: meshes are written as .vtu, found '{target.suffix}'")
    scale = _scale(unit)
    raw = meshio.Mesh(
        mesh.points / scale,
        [("tetra", mesh.tetrahedra)],
        point_data={name: members.astype(np.uint8) for name, members in mesh.node_sets.items()},
        cell_data={
            "tissue": [mesh.tissue],
            **{ELEMENT_SET_PREFIX + name: [members.astype(np.uint8)] for name, members in mesh.element_sets.items()},
            **{name: [vectors] for name, vectors in mesh.element_vectors.items()},
        },
    )
    with whole_file(target) as scratch:
        write_vtu(scratch, raw, axes)


def _scale(unit: str) -> float:
    if unit not in METRES:
        raise MeshError(f"unit must be one of {', '.join(METRES)}, found '{unit}'")
    return METRES[unit]
