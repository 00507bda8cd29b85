"""Makes the figures of docs/images.md: `python docs/make_images.py [FOLDER]`.

FOLDER is what `examples/there_and_back.py` has made; without one it is made first, which takes minutes and the template
that nilearn ships.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import nibabel
import numpy as np
from figure_records import record
from make_figures import FIGURES, few_colours
from matplotlib import pyplot
from numpy.typing import NDArray

EXAMPLE = Path(__file__).parents[1] / "examples" / "there_and_back.py"
#: Planes that are shown [mm, RAS]: the axis across and where, both through the cavity.
PLANES = ((2, 22.0), (0, 24.0))
#: Landmarks that lie as near to a plane as this are drawn in it [mm].
NEAR = 12.0
#: Axes to the right and up, and names of the ends, of a plane across each axis.
SHOWN = {0: ((1, 2), "APSI"), 2: ((0, 1), "RLAP")}


def main(folder: Path) -> None:
    """Make the figures from what the example has written."""
    result = folder / "result"
    if not (result / "moved.csv").is_file():
        subprocess.run([sys.executable, EXAMPLE, folder], check=True)
    few_colours(result / "deformation.png", FIGURES / "there-and-back.png")
    with tempfile.TemporaryDirectory() as place:
        drawn = Path(place) / "scan.png"
        draw_scan(folder, drawn)
        few_colours(drawn, FIGURES / "there-and-back-scan.png")
    record("python docs/make_images.py", ["there-and-back.png", "there-and-back-scan.png"])


def draw_scan(folder: Path, picture: Path) -> None:
    """The scan before and after, and by how much it moved, in two planes."""
    images: list[Any] = [
        nibabel.load(path)
        for path in (folder / "T1.nii.gz", *(folder / "result" / n for n in ("T1-after.nii.gz", "displacement.nii.gz")))
    ]
    before, after = (np.asarray(image.dataobj, dtype=np.float64) for image in images[:2])
    sizes = np.linalg.norm(np.asarray(images[2].dataobj)[:, :, :, 0], axis=-1)
    affine = images[0].affine
    points, moved = landmarks(folder / "result" / "moved.csv")
    figure, frames = pyplot.subplots(2, 3, figsize=(11.0, 8.0), layout="constrained")
    for row, (axis, at) in zip(frames, PLANES, strict=True):
        (right, up), ends = SHOWN[axis]
        index = round(float((at - affine[axis, 3]) / affine[axis, axis]))
        edges = [affine[a, 3] + affine[a, a] * (i - 0.5) for a in (right, up) for i in (0, before.shape[a])]
        near = np.abs(points[:, axis] - at) < NEAR
        for frame, values, title in zip(
            row, (before, after, sizes), ("T1.nii.gz", "T1-after.nii.gz", "displacement.nii.gz [mm]"), strict=True
        ):
            colours = {"cmap": "gray", "vmin": 0.0, "vmax": 1.0} if values is not sizes else {"cmap": "viridis"}
            shown = frame.imshow(values.take(index, axis).T, origin="lower", extent=edges, **colours)
            frame.set_title(f"{title}, {'xyz'[axis]} = {at:g} mm", fontsize=10)
            _mark(frame, ends)
            if values is sizes:
                figure.colorbar(shown, ax=frame, shrink=0.8)
                outline = before.take(index, axis).T > 0
                frame.contour(outline, [0.5], colors="white", linewidths=0.7, extent=edges)
            else:
                # where the outline was: what moved away from it can be seen
                frame.contour(before.take(index, axis).T > 0, [0.5], colors="#d9453a", linewidths=0.8, extent=edges)
                place = moved if values is after else points
                frame.plot(place[near, right], place[near, up], "o", color="#00b4d8", markersize=3.5)
            if values is after:
                steps = (moved - points)[near]
                start = points[near]
                frame.quiver(
                    *(start[:, right], start[:, up], steps[:, right], steps[:, up]),
                    angles="xy",
                    scale_units="xy",
                    scale=1.0,
                    color="#00b4d8",
                    width=0.004,
                )
    figure.savefig(picture, dpi=130)
    pyplot.close(figure)


def landmarks(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions (n, 3) before and after [mm, RAS]."""
    with path.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    before, after = (
        np.array([[float(row[f"{word}{axis}_mm"]) for axis in "xyz"] for row in rows]) for word in ("", "moved_")
    )
    return before, after


def _mark(frame: Any, ends: str) -> None:
    """Name the ends of a plane, which is seen as radiologists see it."""
    frame.set_axis_off()
    frame.invert_xaxis()
    places = ((0.02, 0.5), (0.98, 0.5), (0.5, 0.97), (0.5, 0.03))
    for (x, y), end in zip(places, (ends[0], ends[1], ends[2], ends[3]), strict=True):
        frame.text(x, y, end, transform=frame.transAxes, color="white", ha="center", va="center", fontsize=9)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as made:
            main(Path(made))
