"""What cannot have been recorded of a body: known before anything is computed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpbrain.mesh import TetMesh
from warpbrain.mesh.quality import extent
from warpbrain.problems import Problems
from warpbrain.recordings.recording import PointsRecording, SurfaceRecording
from warpbrain.recordings.text import collected

_CURE = "are the units right, and are ux, uy, uz how far it went and not where?"


def check_possible(
    recording: PointsRecording | SurfaceRecording, mesh: TetMesh, path: Path, problems: Problems
) -> None:
    """Note as a problem points that move farther than the body is long, and noise that is larger than it.

    Parameters
    ----------
    recording : PointsRecording or SurfaceRecording
    mesh : TetMesh
        The body.
    path : Path
        Of the recording, for messages.
    problems : Problems
    """
    size = extent(mesh.points)
    with collected(path, problems) as found:
        if isinstance(recording, PointsRecording):
            moved = np.linalg.norm(recording.displacement, axis=1)
            for row in np.flatnonzero(moved > size):
                if found.enough:
                    break
                found.add(
                    path,
                    f"point {row + 1}",
                    f"moves {_metres(float(moved[row]))} in a body of {_metres(size)}",
                    _CURE,
                )
            sigmas = np.array([] if recording.sigmas is None else recording.sigmas)
        else:
            sigmas = np.array([])
        if recording.sigma is not None:
            sigmas = np.append(sigmas, recording.sigma)
        if (sigmas > size).any():
            found.add(
                path,
                "sigma",
                f"a noise of {_metres(float(sigmas.max()))} in a body of {_metres(size)}",
                "in units of the case, one standard deviation of one component",
            )


def _metres(length: float) -> str:
    return f"{length:.3g} m" if length >= 1.0 else f"{1000.0 * length:.3g} mm"
