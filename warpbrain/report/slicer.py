"""A scene for 3D Slicer: surfaces before and after, and a script for its Python console that loads all with colours."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpbrain.atomic import whole_file
from warpbrain.images.moving_points import PointFile
from warpbrain.images.reading import Image
from warpbrain.recordings.electrodes import is_electrodes
from warpbrain.report.files import MILLIMETRES, write_body
from warpbrain.report.page import rendered
from warpbrain.report.state_files import LEFT, SEEN, TRUST, UNSEEN, SavedState

#: Names of the transforms: what they do to an image.
FORTH, BACK = "transform-before-to-after.nii.gz", "transform-after-to-before.nii.gz"
#: Maps of where not to believe the displacement.
DEVIATION, TRUST_MAP = "displacement_sd.nii.gz", "trust.nii.gz"
SCRIPT = "load_in_slicer.py"
SURFACES = ("surface-before.vtu", "surface-after.vtu")
#: Red, green and blue of what `trust.nii.gz` says.
_COLOURS = {SEEN: (0.0, 0.62, 0.45), UNSEEN: (0.6, 0.6, 0.6), LEFT: (0.84, 0.37, 0.0)}


def write_slicer_scene(
    folder: Path,
    state: SavedState,
    image: Image | None,
    image_after: str | None,
    labels_after: str | None,
    points: Sequence[PointFile],
    files: Sequence[str],
) -> list[str]:
    """Write the surfaces and the script beside files that are there already; returns the names of those added.

    `image` and `points` are those before, `image_after` and `labels_after` names of files of what was warped, `files`
    the names of all that were written.
    """
    import meshio

    size = MILLIMETRES * np.linalg.norm(state.u, axis=1)
    faces = state.mesh.boundary
    nodes, numbers = np.unique(faces, return_inverse=True)
    for name, moved in zip(SURFACES, (0.0, 1.0), strict=True):
        corners, triangles = MILLIMETRES * (state.mesh.points + moved * state.u)[nodes], numbers.reshape(-1, 3)
        sizes = {"displacement_size": size[nodes]}
        write_body(folder / name, meshio.Mesh(corners, [("triangle", triangles)], point_data=sizes))
    volumes = [] if image is None else [image.path.resolve().as_posix()]
    volumes += [] if image_after is None else [image_after]
    markups = [file for file in points if not is_electrodes(file.path)]
    meanings = [[value, meaning, *_COLOURS[value]] for value, meaning in TRUST.items()]
    values = {
        "folder": folder.resolve().as_posix(),
        "volumes": [name for name in volumes if not name.lower().endswith((".mgz", ".mgh"))],
        "labels": [] if labels_after is None else [labels_after],
        "deviation": [name for name in files if name == DEVIATION],
        "trust": [[name, meanings] for name in files if name == TRUST_MAP],
        "surfaces": [[SURFACES[0], 0.3], [SURFACES[1], 1.0]],
        "markups": [[file.path.resolve().as_posix(), file.moved_name] for file in markups],
        "electrodes": [file.path.name for file in points if is_electrodes(file.path)],
        "transform": FORTH,
        "largest": max(float(size.max()), 1e-6),
    }
    path = (folder / SCRIPT).resolve().as_posix()
    script = rendered("load_in_slicer.txt", path=path, **{name: json.dumps(value) for name, value in values.items()})
    with whole_file(folder / SCRIPT) as scratch:
        scratch.write_text(script + "\n", encoding="utf-8")
    return [*SURFACES, SCRIPT]
