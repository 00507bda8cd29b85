"""The picture of a run: drawn for any body, the right way round, and moved as far as it says."""

import os
import warnings
from pathlib import Path

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapes import box

from warpbrain.cases.case import Case, Tissue
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.report import picture
from warpbrain.report.picture import Moved, begin_pictures, draw, round_factor
from warpbrain.report.rendering import AFTER, AXIAL, BEFORE, CORONAL, MOTION, NAMES, SAGITTAL, RenderingError

NO_POINTS = Moved(*np.zeros((3, 0, 3)))
#: Edge of the block [mm].
SIDE = 60.0


def block() -> TetMesh:
    """A block with a piece on the right, at the back and below that is taken out."""
    mesh = box((4, 4, 4), (0.06, 0.06, 0.06))
    centres = mesh.points[mesh.tetrahedra].mean(axis=1)
    gone = (centres[:, 0] > 0.03) & (centres[:, 2] < 0.015)
    return TetMesh(mesh.points, mesh.tetrahedra, np.where(centres[:, 0] > 0.03, 2, 1), {}, {"resection": gone})


def case_of(mesh: TetMesh, *mechanisms: Mechanism, names: tuple[str, ...] = ("grey", "white")) -> Case:
    tissues = {label: Tissue(name, None) for label, name in enumerate(names, 1)}
    return Case("a", "A title", "measured", Path("case.toml"), mesh, tissues, 1000.0, 0.45, mechanisms=mechanisms)


def rendered(case, u, moved=NO_POINTS):
    """Pictures; what cannot be rendered here is skipped, but not where tests must not be."""
    try:
        begun = begin_pictures(case, u, moved)
        _ = begun.images
    except RenderingError as error:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(error))
    return begun


@pytest.fixture(scope="module")
def pictures():
    """A block that moves by 1 mm, the farther the more right, front and top, with two recorded points."""
    case = case_of(block(), Resection())
    left, _ = case.remaining
    u = 1e-3 * left.points.sum(axis=1, keepdims=True) / 0.18 * [0.0, 0.0, 1.0]
    where = np.array([[0.01, 0.03, 0.05], [0.05, 0.03, 0.05]])
    moved = Moved(where, np.array([[0.002, 0.0, 0.0]] * 2), np.array([[0.0, 0.0, 0.002]] * 2))
    return rendered(case, u, moved)


def bright(image) -> np.ndarray:
    """Green of the colours of displacement, which grows along viridis; NaN where there is none of them."""
    colours = image.astype(float)
    coloured = np.ptp(colours, axis=2) > 40.0
    # lines in red are none of these colours
    coloured &= colours[..., 0] < colours[..., 1] + colours[..., 2]
    return np.where(coloured, colours[..., 1], np.nan)


@pytest.mark.parametrize(
    ("name", "side"),
    [
        (AXIAL, "left"),  # the patient's right (+x) is on the left of the picture
        (AXIAL, "above"),  # anterior (+y) is above
        (CORONAL, "left"),
        (CORONAL, "above"),  # superior (+z) is above
        (SAGITTAL, "left"),  # anterior is on the left
        (SAGITTAL, "above"),
    ],
)
def test_the_right_way_round(pictures, name, side):
    """What moves farther is where a radiologist looks for it."""
    values = bright(pictures.images[name])
    if side == "left":
        values = values.T
    means = np.nanmean(values[~np.isnan(values).all(axis=1)], axis=1)
    assert means[: len(means) // 4].mean() > means[-(len(means) // 4) :].mean() + 20.0


def test_what_was_taken_out_is_red_before_and_gone_after(pictures):
    def red(name):
        image = pictures.images[name].astype(int)
        return int(((image[..., 0] > 150) & (image[..., 1] < 100) & (image[..., 2] < 100)).sum())

    assert red(BEFORE) > 1000
    assert red(AFTER) < 0.2 * red(BEFORE)


def test_recorded_and_computed_arrows_have_their_colours(pictures):
    image = pictures.images[MOTION].astype(int)
    assert ((image[..., 0] > 150) & (image[..., 2] < 60)).sum() > 40
    assert ((image[..., 2] > 120) & (image[..., 0] < 60)).sum() > 40
    assert pictures.scene.arrows == 2.0


def test_a_body_is_drawn_where_its_motion_puts_it(verify):
    mesh = box((3, 3, 3), (0.06, 0.06, 0.06))
    whole = TetMesh(mesh.points, mesh.tetrahedra, np.ones(len(mesh.tetrahedra), dtype=np.int32), {}, {})
    found = rendered(case_of(whole), np.tile([0.0, 0.0, 0.001], (len(whole.points), 1)))
    factor, camera, image = found.scene.exaggeration, found.cameras[CORONAL], found.images[CORONAL]
    assert factor == 5.0
    # all of it has the last colour, a yellow
    rows = np.flatnonzero(((image[..., 1] > 200) & (image[..., 2] < 100)).sum(axis=1) > 50)
    high = image.shape[0]
    pixel = 2.0 * camera.half_height / high
    # rows from the top of the picture to heights of the body
    top, bottom = (camera.centre[2] + camera.half_height - pixel * row for row in (rows[0], rows[-1] + 1))
    error = max(abs(top - (SIDE + factor)), abs(bottom - factor))
    verify("Edges of a rendered cut", "rigid translation, as large as the picture says", error, 2.0 * pixel, "mm")


def test_pictures_of_any_body_become_a_file(tmp_path, monkeypatch):
    def white(_scene, _cameras, size):
        return {name: np.full((size[1], size[0], 3), 255, np.uint8) for name in NAMES}

    monkeypatch.setattr(picture, "render", white)
    mesh = block()
    plain = TetMesh(mesh.points, mesh.tetrahedra, mesh.tissue, {}, {})
    for u in (np.zeros(mesh.points.shape), np.tile([0.0, 0.0, 0.2], (len(mesh.points), 1))):
        path = tmp_path / "a.png"
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            # a dollar sign begins no formula
            rendered = begin_pictures(case_of(plain, names=("$x", "_y")), u, NO_POINTS)
            drawn = draw(path, rendered, "A $title", ["with $ two", "lines"])
        assert not isinstance(drawn, str)
        assert [file.name for file in tmp_path.iterdir()] == ["a.png"]
        assert plt.get_fignums() == []
        image = matplotlib.image.imread(path)
        assert image.shape[0] > 700 and image.shape[1] > 1000


def test_where_nothing_can_be_rendered_no_old_picture_stays(tmp_path, monkeypatch):
    def fails(*_):
        raise RenderingError("no graphics")

    monkeypatch.setattr(picture, "render", fails)
    path, mesh = tmp_path / "a.png", block()
    path.write_bytes(b"of another run")
    said = draw(path, begin_pictures(case_of(mesh), np.zeros(mesh.points.shape), NO_POINTS), "A title", [])
    assert said == "no graphics" and not path.exists()


@given(st.floats(1e-3, 1e3), st.floats(1e-9, 1e6))
def test_factors_are_round_and_make_nothing_smaller_or_too_large(wanted, length):
    factor = round_factor(wanted, length)
    assert factor >= 1.0
    assert float(f"{factor:.0e}") == pytest.approx(factor) and f"{factor:.0e}"[0] in "125"
    if factor > 1.0:
        assert 0.39 * wanted < factor * length <= wanted * 1.0001
