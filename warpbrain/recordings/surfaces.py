"""Surface meshes that were recorded: triangles from any file that meshio reads, and from ``.vtp``."""

import re
from pathlib import Path

import numpy as np

from warpbrain.arrays import Floats, Int32s
from warpbrain.frame import AXES
from warpbrain.mesh.files import LARGEST_FILE, ends_inside_a_number
from warpbrain.mesh.patience import patience
from warpbrain.mesh.vtu import axes_of_vtu, read_vtu
from warpbrain.problems import Problems, Unreadable
from warpbrain.recordings.tables import LARGEST
from warpbrain.recordings.text import require_readable, shown

# cells that have no area: markers, outlines and the points of point clouds
_WITHOUT_AREA = ("vertex", "line", "line3", "polyline")
_WITH_AREA = ("triangle", "triangle6", "triangle7", "quad", "quad8", "quad9", "polygon")
# corners of the cells of second order come first
_CORNERS = {"triangle6": 3, "triangle7": 3, "quad8": 4, "quad9": 4}
# as 3D Slicer and Mimics write it into headers and comments
_SPACE = re.compile(rb"SPACE=(RAS|LPS)")
# what there must be of a header: without it meshio's readers go round for ever at the end of the file
_WHOLE_HEADER = {".ply": re.compile(rb"^end_header\s*$", re.MULTILINE), ".off": re.compile(rb"\n[ \t]*[^#\s]")}

# bytes before the triangles of a binary STL, the last four of them their number, and bytes of each
_STL_HEADER, _STL_TRIANGLE = 84, 50


def read_surface_mesh(path: Path, problems: Problems) -> tuple[Floats, Int32s | None, str | None]:
    """Read a surface mesh or a cloud of points; `Unreadable` if there are problems.

    Returns points (n, 3) as the file has them, triangles (k, 3) or None for a cloud, and the axes that it states.
    Polygons are cut into triangles; triangles without area are left out, and so are points that no triangle uses where
    there are triangles.
    """
    require_readable(path, problems)
    if (size := path.stat().st_size) > LARGEST_FILE:
        message = f"found {size / 1e6:.0f} MB, expected a surface of at most {LARGEST_FILE / 1e6:.0f} MB"
        problems.refuse(path, "", message)
    try:
        if path.suffix.lower() == ".vtp":
            from warpbrain.recordings.vtp import read_vtp

            with patience(path):
                points, faces, axes = read_vtp(path)
        else:
            points, faces, axes = _from_meshio(path, problems)
    except Unreadable:
        raise
    except Exception as error:  # whatever the parsers raise
        detail = " ".join(str(error).split())[:100] or type(error).__name__
        cure = "is the file whole? .vtp, .stl, .ply, .obj and .vtu can be read"
        problems.refuse(path, "", f"found no surface mesh ({detail})", cure)
    if ends_inside_a_number(path):
        problems.remark(path, "the last line ends in a number without a line break: is the file cut off?")
    count = len(points)
    if count == 0:
        problems.refuse(path, "", "found no points")
    bad = np.flatnonzero(~(np.abs(points) <= LARGEST).all(axis=1))
    if len(bad):
        message = f"found a coordinate that is not finite ({len(bad)} such points in all)"
        problems.refuse(path, f"point {bad[0]}", message)
    if axes not in (None, *AXES):
        problems.refuse(path, "SPACE", f"found {shown(axes)}, expected RAS or LPS")
    if not len(faces):
        return points, None, axes
    wrong = np.flatnonzero(((faces < 0) | (faces >= count)).any(axis=1))
    if len(wrong):
        what = "a face" if len(wrong) == 1 else f"{len(wrong)} faces"
        message = f"found {what} with points that are not there (there are {count})"
        problems.refuse(path, f"face {wrong[0]}", message)
    corner = points[faces]
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    sound = np.linalg.norm(normal, axis=1) > 1e-12 * sides**2
    if not sound.any():
        problems.refuse(path, "", "found faces without area only")
    if not sound.all():
        problems.remark(path, f"{np.count_nonzero(~sound)} of {len(faces)} faces have no area and are left out")
    used, numbers = np.unique(faces[sound], return_inverse=True)
    if len(used) < count:
        problems.remark(path, f"{count - len(used)} of {count} points belong to no face and are left out")
    return points[used], numbers.reshape(-1, 3).astype(np.int32), axes


def _from_meshio(path: Path, problems: Problems) -> tuple[Floats, Int32s, str | None]:
    """Points (n, 3), triangles (k, 3) and the axes that the file states, as `read_vtp`."""
    import meshio

    if path.suffix.lower() not in meshio.extension_to_filetypes:
        expected = ".csv, .vtp, .stl, .ply, .obj, .vtu, ..."
        problems.refuse(path, "", f"found ending {shown(path.suffix)}, expected {expected}")
    with path.open("rb") as file:
        head = file.read(2**16)
    whole = _WHOLE_HEADER.get(path.suffix.lower())
    if whole is not None and not whole.search(head):
        raise ValueError("its header is cut off")
    if path.suffix.lower() == ".stl":
        count = int.from_bytes(head[_STL_HEADER - 4 : _STL_HEADER], "little")
        there = (path.stat().st_size - _STL_HEADER) / _STL_TRIANGLE
        if not head.lstrip().startswith(b"solid") and len(head) >= _STL_HEADER and there != count:
            raise ValueError(f"its header says {count} triangles, its bytes are {there:.10g}")
    with np.errstate(all="ignore"), patience(path):
        raw = read_vtu(path) if path.suffix.lower() == ".vtu" else meshio.read(path)
    foreign = {block.type for block in raw.cells} - {*_WITHOUT_AREA, *_WITH_AREA}
    if foreign:
        problems.refuse(path, "", f"found cells of type {', '.join(sorted(foreign))}, expected triangles of a surface")
    fans = [np.empty((0, 3), dtype=np.int32)]
    for block in raw.cells:
        if block.type in _WITH_AREA:
            corners = np.asarray(block.data)[:, : _CORNERS.get(block.type)]
            fans += [corners[:, [0, i, i + 1]] for i in range(1, corners.shape[1] - 1)]
    points = np.asarray(raw.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        problems.refuse(path, "", f"found points of shape {points.shape}, expected (n, 3)")
    axes = axes_of_vtu(path) if path.suffix.lower() == ".vtu" else None
    if axes is None and (mark := _SPACE.search(head[:2048])):
        axes = mark.group(1).decode()
    return points, np.concatenate(fans), axes
