"""`python -m warpbrain.report.rendering FOLDER`: renders the scene that lies in a folder as `scene.png`."""

from __future__ import annotations

import sys
from pathlib import Path


def main(folder: Path) -> None:
    """Render; what the graphics library says of displays that are not there is nobody's business."""
    import numpy as np
    import pyvista

    from warpbrain.report.rendering.drawing import screenshot
    from warpbrain.report.rendering.scene import read_scene

    with pyvista.vtk_verbosity("off"):
        pictures = screenshot(*read_scene(folder))
    np.save(folder / "pictures.npy", pictures)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
