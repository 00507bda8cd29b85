"""A scene for 3D Slicer: surfaces before and after, and a script for its Python console that loads all with colours."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.atomic import whole_file
from warpbrain.images.reading import Image
from warpbrain.mesh.vtu import write_vtu
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.state_files import SavedState

#: Names of the transforms: what they do to an image.
FORTH, BACK = "transform-before-to-after.nii.gz", "transform-after-to-before.nii.gz"
SCRIPT = "load_in_slicer.py"
SURFACES = ("surface-before.vtu", "surface-after.vtu")

_TEXT = '''\
"""Loads a result of warpbrain into 3D Slicer. In its Python console:

    exec(open("{path}", encoding="utf-8").read())
"""

import os

import slicer
import vtk

# the folder of the files, if they were moved since they were written
FOLDER = globals().get("WARPBRAIN_FOLDER", {folder})
VOLUMES = {volumes}
LABELS = {labels}
SURFACES = {surfaces}
POINTS = {points}
TRANSFORM = {transform}
# the largest displacement [mm]
LARGEST = {largest}


def place(name):
    return name if os.path.isabs(name) else os.path.join(FOLDER, name)


volumes = [slicer.util.loadVolume(place(name)) for name in VOLUMES]
for name in LABELS:
    slicer.util.loadLabelVolume(place(name))
for name, opacity in SURFACES:
    model = slicer.util.loadModel(place(name))
    display = model.GetDisplayNode()
    display.SetActiveScalar("displacement_size", vtk.vtkAssignAttribute.POINT_DATA)
    display.SetAndObserveColorNodeID("vtkMRMLColorTableNodeFileViridis.txt")
    display.SetScalarVisibility(True)
    display.SetScalarRangeFlag(slicer.vtkMRMLDisplayNode.UseManualScalarRange)
    display.SetScalarRange(0.0, LARGEST)
    display.SetOpacity(opacity)
    display.SetVisibility2D(True)
for name, colour in POINTS:
    slicer.util.loadMarkups(place(name)).GetDisplayNode().SetSelectedColor(*colour)
# moves volumes, models and points alike from before to after, once they are put under it
slicer.util.loadTransform(place(TRANSFORM))
if len(volumes) > 1:
    slicer.util.setSliceViewerLayers(background=volumes[0], foreground=volumes[1], foregroundOpacity=0.5)
slicer.util.resetThreeDViews()
'''


def write_slicer_scene(
    folder: Path,
    state: SavedState,
    image: Image | None,
    image_after: str | None,
    labels_after: str | None,
    files: Sequence[str],
) -> list[str]:
    """Write the surfaces and the script beside files that are there already.

    Parameters
    ----------
    folder : Path
    state : SavedState
    image : Image or None
        Before.
    image_after, labels_after : str or None
        Names of the files of the warped image and labels.
    files : sequence of str
        Names of all files.

    Returns
    -------
    list of str
        Names of the files that were added.
    """
    size = MILLIMETRES * np.linalg.norm(state.u, axis=1)
    faces = state.mesh.boundary
    nodes, numbers = np.unique(faces, return_inverse=True)
    for name, moved in zip(SURFACES, (0.0, 1.0), strict=True):
        points = MILLIMETRES * (state.mesh.points + moved * state.u)[nodes]
        _write_surface(folder / name, points, numbers.reshape(-1, 3), size[nodes])
    points_after = [name for name in files if name.lower().endswith(("-after.mrk.json", "-after.json", "-after.fcsv"))]
    volumes = [] if image is None else [image.path.resolve().as_posix()]
    volumes += [] if image_after is None else [image_after]
    script = _TEXT.format(
        path=(folder / SCRIPT).resolve().as_posix(),
        folder=json.dumps(folder.resolve().as_posix()),
        volumes=json.dumps([name for name in volumes if not name.lower().endswith((".mgz", ".mgh"))]),
        labels=json.dumps([name for name in (labels_after, "trust.nii.gz") if name in files]),
        surfaces=json.dumps([[SURFACES[0], 0.3], [SURFACES[1], 1.0]]),
        points=json.dumps([[name, [1.0, 0.5, 0.0]] for name in points_after]),
        transform=json.dumps(FORTH),
        largest=json.dumps(max(float(size.max()), 1e-6)),
    )
    with whole_file(folder / SCRIPT) as scratch:
        scratch.write_text(script, encoding="utf-8")
    return [*SURFACES, SCRIPT]


def _write_surface(path: Path, points: Any, faces: Any, size: Any) -> None:
    import meshio

    mesh = meshio.Mesh(points, [("triangle", faces)], point_data={"displacement_size": size})
    with whole_file(path) as scratch:
        write_vtu(scratch, mesh)
