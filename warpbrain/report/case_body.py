"""The body of a case from outside with a corner cut out, before anything is computed: rendered by PyVista."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.cases.case import Case
from warpbrain.mesh import TetMesh
from warpbrain.recordings.recording import PointsRecording, SurfaceRecording
from warpbrain.report.files import MILLIMETRES
from warpbrain.report.picture import Moved, cameras_of, notes_on, scene_of, show
from warpbrain.report.rendering.offscreen import render
from warpbrain.report.rendering.scene import BEFORE, Camera

#: Pixels.
_SIZE = (960, 840)
#: A laboratory specimen has no left and no front.
_SPECIMEN_ENDS = ("+x", "+y", "+z", "-x", "-y", "-z")


@dataclass(frozen=True, eq=False)
class RenderedBody:
    """A picture of a body, and where it is seen from.

    Attributes
    ----------
    image : (height, width, 3) uint8 array
    camera : Camera
    mesh : TetMesh
    specimen : bool
        Of a laboratory, and no part of a patient.
    """

    image: Any
    camera: Camera
    mesh: TetMesh
    specimen: bool

    def show(self, panel: Any) -> None:
        """Draw it into a panel of a figure, whose units are then mm from its middle to the right and up."""
        ends = {"ends": _SPECIMEN_ENDS} if self.specimen else {}
        show(panel, self.image, notes_on(self.camera, self.image.shape, self.mesh, **ends))

    def picture(self, points: Floats) -> Floats:
        """Where in such a panel positions (n, 3) [m] are: (n, 2)."""
        axes = np.column_stack([self.camera.right, self.camera.up])
        return np.asarray((MILLIMETRES * points - self.camera.centre) @ axes)


def render_body(case: Case, resected: Bools) -> RenderedBody:
    """Render the anatomy of a case, seen from where there is most to see.

    Parameters
    ----------
    case : Case
    resected : (m,) bool array
        Elements that are taken out: they are there, in a colour of their own.

    Raises
    ------
    RenderingError
        If nothing can be rendered here.
    """
    whole = case.mesh
    left = whole.without(resected)[0] if resected.any() else whole
    names = {label: tissue.name for label, tissue in case.tissues.items()}
    at = [one.points for one in case.recordings if isinstance(one, (PointsRecording, SurfaceRecording))]
    where = np.concatenate([np.zeros((0, 3)), *at])
    still = np.zeros_like(where)
    scene = scene_of(whole, left, np.zeros_like(left.points), names, Moved(where, still, still))
    camera = cameras_of(scene)[BEFORE]
    image = render(scene, {BEFORE: camera}, _SIZE)[BEFORE]
    return RenderedBody(image, camera, whole, case.specimen is not None)
