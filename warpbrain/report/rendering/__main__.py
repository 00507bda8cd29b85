"""`python -m warpbrain.report.rendering FOLDER`: renders the scene that lies in a folder as `scene.png`."""

from __future__ import annotations

import sys
from pathlib import Path


def main(folder: Path) -> None:
    """Render; what the graphics library says of displays that are not there is nobody's business."""
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    import numpy as np

    from warpbrain.report.rendering.drawing import screenshot
    from warpbrain.report.rendering.scene import read_scene

    np.save(folder / "pictures.npy", screenshot(*read_scene(folder)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
