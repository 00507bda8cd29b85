"""The picture of a run: drawn for any body, and the right way round."""

import warnings
from pathlib import Path

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import pytest
from numpy.typing import NDArray
from shapes import box

from warpbrain.mesh import TetMesh
from warpbrain.report.picture import write_picture
from warpbrain.simulation.result import Result


def body(tissue_axis: int = 0, **sets: NDArray[np.bool_]) -> TetMesh:
    """A block of 60 mm, tissue 2 on the positive side of an axis."""
    mesh = box((4, 4, 4), (0.06, 0.06, 0.06))
    centres = mesh.points[mesh.tetrahedra].mean(axis=1)
    names = {"node_sets": {k: v for k, v in sets.items() if len(v) == len(mesh.points)}}
    names["element_sets"] = {k: v for k, v in sets.items() if len(v) == len(centres)}
    return TetMesh(mesh.points, mesh.tetrahedra, np.where(centres[:, tissue_axis] > 0.03, 2, 1), **names)


def result_of(mesh: TetMesh, u: NDArray[np.float64]) -> Result:
    ones = np.ones(len(mesh.tetrahedra))
    return Result(mesh, u, ones, np.ones((len(ones), 3)), 0.0 * ones, 0.0 * ones, 0.0 * u)


def draw(path: Path, whole: TetMesh, left: TetMesh, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """The picture's pixels; nothing is said, and nothing stays behind."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        write_picture(path, result_of(left, u), whole, {1: "grey", 2: "white"}, "A title", "and more")
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    assert plt.get_fignums() == []
    image = matplotlib.image.imread(path)[..., :3]
    assert image.shape[0] > 700
    assert image.shape[1] > 1000
    return np.asarray(image, dtype=np.float64)


def places(image: NDArray[np.float64], colour: str) -> NDArray[np.int64]:
    """Rows and columns of the pixels of a colour."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.argwhere(np.abs(image - rgb).max(axis=-1) < 0.005)


FIRST, SECOND, RESECTED = "#b9aea6", "#efe8df", "#d9483b"


def test_a_body_without_any_set(tmp_path):
    mesh = body()
    draw(tmp_path / "a.png", mesh, mesh, 0.01 * mesh.points)


def test_a_body_that_does_not_move(tmp_path):
    mesh = body()
    draw(tmp_path / "a.png", mesh, mesh, np.zeros(mesh.points.shape))


def test_a_body_that_left_the_plane(tmp_path):
    mesh = body()
    draw(tmp_path / "a.png", mesh, mesh, np.tile([0.0, 0.0, 0.2], (len(mesh.points), 1)))


def test_an_empty_ventricle_and_resection(tmp_path):
    plain = body()
    mesh = body(
        ventricle=np.zeros(len(plain.points), dtype=bool), resection=np.zeros(len(plain.tetrahedra), dtype=bool)
    )
    image = draw(tmp_path / "a.png", mesh, mesh, 0.01 * mesh.points)
    assert len(places(image, RESECTED)) == 0


def test_resected_tissue_is_shown_before_and_gone_after(tmp_path):
    plain = body()
    centres = plain.points[plain.tetrahedra].mean(axis=1)
    mesh = body(resection=(centres > 0.04).all(axis=1))
    left, _, _ = mesh.without(mesh.element_sets["resection"])
    image = draw(tmp_path / "a.png", mesh, left, 0.01 * left.points)
    rows = places(image, RESECTED)[:, 0]
    # in all three cuts, and in the legend
    assert len(rows) > 500
    assert rows.max() < image.shape[0] / 2


@pytest.mark.parametrize(
    ("axis", "column", "side"),
    [
        (0, 0, "left"),  # axial: the patient's right (+x) is on the left of the picture
        (0, 1, "left"),  # coronal: the same
        (1, 0, "above"),  # axial: anterior (+y) is above
        (1, 2, "left"),  # sagittal: anterior is on the left
        (2, 1, "above"),  # coronal: superior (+z) is above
        (2, 2, "above"),  # sagittal: the same
    ],
)
def test_the_right_way_round(tmp_path, axis, column, side):
    """Tissue 2, on the positive side of the axis, is where a radiologist looks for it."""
    mesh = body(axis)
    image = draw(tmp_path / "a.png", mesh, mesh, 0.01 * mesh.points)
    height, width = image.shape[0] // 2, image.shape[1] // 3
    panel = image[:height, column * width : (column + 1) * width]
    first, second = (np.median(places(panel, colour), axis=0) for colour in (FIRST, SECOND))
    if side == "left":
        assert second[1] < first[1] - 20
    else:
        assert second[0] < first[0] - 20
