"""The picture of a case: drawn for any body, whole, silently, and the right way round."""

import dataclasses
import os
import time
import warnings
from pathlib import Path

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import pytest
from numpy.typing import NDArray
from shapes import box, tetrahedron

from warpbrain.cases.case import Case, Tissue
from warpbrain.cases.shipped import find_case
from warpbrain.cases.specimen import Specimen
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import LAWS
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording, SurfaceRecording, TestRecording
from warpbrain.report import case_picture
from warpbrain.report.case_picture import _headline, _Scene, write_case_picture
from warpbrain.report.rendering import RenderingError, render
from warpbrain.report.views import scale_length

FIRST, SECOND, RESECTED = "#b9aea6", "#efe8df", "#d9483b"
BLACK, CROSS, LARGEST_SET = "#000000", "#c2185b", "#0072b2"


def body(tissue_axis: int = 0, side: float = 0.06, **sets: NDArray[np.bool_]) -> TetMesh:
    """A block, tissue 2 on the positive side of an axis."""
    mesh = box((4, 4, 4), (side, side, side))
    centres = mesh.points[mesh.tetrahedra].mean(axis=1)
    names = {"node_sets": {k: v for k, v in sets.items() if len(v) == len(mesh.points)}}
    names["element_sets"] = {k: v for k, v in sets.items() if len(v) == len(centres)}
    return TetMesh(mesh.points, mesh.tetrahedra, np.where(centres[:, tissue_axis] > side / 2, 2, 1), **names)


def case_of(mesh: TetMesh, *recordings: Recording, title: str = "A title", **more: object) -> Case:
    law = LAWS["neo-hookean"].of_shear_modulus(1000.0)
    tissues = {int(label): Tissue(f"tissue {label}", law) for label in np.unique(mesh.tissue)}
    case = Case("a", title, "measured", Path("case.toml"), mesh, tissues, 1000.0, 0.45, recordings=recordings)
    return dataclasses.replace(case, **more)


def tracked(points: NDArray[np.float64], displacement: object, name: str = "tracked") -> PointsRecording:
    points = np.atleast_2d(points)
    return PointsRecording(
        name=name, file="a.csv", points=points, displacement=np.broadcast_to(displacement, points.shape).copy()
    )


def draw(path: Path, case: Case, capfd: pytest.CaptureFixture[str]) -> NDArray[np.float64]:
    """The picture's pixels; nothing is said, and nothing stays behind."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", DeprecationWarning)
        assert write_case_picture(path, case) == ""
    assert capfd.readouterr() == ("", "")
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    assert plt.get_fignums() == []
    image = matplotlib.image.imread(path)[..., :3]
    assert image.shape[0] > 1000 and image.shape[1] > 1400
    return np.asarray(image, dtype=np.float64)


@pytest.fixture
def picture(tmp_path, capfd, monkeypatch):
    """Draws a case and gives its pixels, of the body from outside only what is drawn over it: rendering takes long."""
    monkeypatch.setattr(case_picture, "render", lambda scene, cameras, size: dict.fromkeys(cameras, _white(size)))
    return lambda case: draw(tmp_path / "a.png", case, capfd)


def _white(size):
    return np.full((size[1], size[0], 3), 255, dtype=np.uint8)


@pytest.fixture
def rendered(tmp_path, capfd, monkeypatch):
    """The same with the body from outside; skipped where nothing can be rendered, but not where tests must not be."""

    def rendered_or_skipped(*scene_cameras_and_size):
        try:
            return render(*scene_cameras_and_size)
        except RenderingError as error:
            if os.environ.get("CI"):
                raise
            pytest.skip(str(error))

    monkeypatch.setattr(case_picture, "render", rendered_or_skipped)
    return lambda case: draw(tmp_path / "a.png", case, capfd)


@pytest.fixture(scope="module")
def kept() -> dict[object, NDArray[np.float64]]:
    """Pictures that several tests look at, by what they are of."""
    return {}


def places(image: NDArray[np.float64], colour: str) -> NDArray[np.int64]:
    """Rows and columns of the pixels of a colour."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.argwhere(np.abs(image - rgb).max(axis=-1) < 0.005)


def reddish(image: NDArray[np.float64]) -> int:
    """How many pixels are of what was resected, in light or shade."""
    return int(((image[..., 0] > 1.8 * image[..., 1]) & (image[..., 0] > 1.8 * image[..., 2])).sum())


def panel(image: NDArray[np.float64], row: int, column: int) -> NDArray[np.float64]:
    """A panel of the 2 x 2, without the headline, the legend and letters at the edge."""
    top, bottom = ((0.1, 0.52), (0.56, 1.0))[row]
    left, right = ((0.0, 0.4), (0.43, 0.78))[column]
    height, width = image.shape[:2]
    return image[int(top * height) : int(bottom * height), int(left * width) : int(right * width)]


@pytest.mark.parametrize(
    ("name", "tissue"),
    [("0529", "multi"), pytest.param("0529", "single", marks=pytest.mark.slow(1)), ("phantom", "multi")],
)
def test_shipped_cases(picture, name, tissue):
    image = picture(find_case(name, tissue))
    # in three cuts, from outside and in the legend
    assert (len(places(image, RESECTED)) > 3000) == (name == "0529")


def test_a_body_without_any_set(picture):
    image = picture(case_of(body()))
    assert len(places(image, RESECTED)) == 0
    assert len(places(image, LARGEST_SET)) == 0


@pytest.mark.slow(3)
@pytest.mark.parametrize("size", [1.0, 1e-5])
def test_one_tetrahedron(rendered, size):
    image = rendered(case_of(tetrahedron(size)))
    for row, column in ((0, 0), (0, 1), (1, 0)):
        assert len(places(panel(image, row, column), FIRST)) > 5000
    assert (panel(image, 1, 1).max(axis=-1) < 0.9).sum() > 5000


def test_where_nothing_can_be_rendered(tmp_path, monkeypatch):
    def fails(scene, cameras, size):
        raise RenderingError("VTK crashed: apt-get install libegl1")

    monkeypatch.setattr(case_picture, "render", fails)
    assert write_case_picture(tmp_path / "a.png", case_of(body())) == "VTK crashed: apt-get install libegl1"
    assert len(places(panel(matplotlib.image.imread(tmp_path / "a.png")[..., :3], 0, 0), FIRST)) > 5000


# each side once: to take one axis for the other would be seen
@pytest.mark.slow(3)
@pytest.mark.parametrize(("right", "front"), [(True, False), (False, True)])
def test_a_body_is_seen_from_where_there_is_most_to_see(rendered, right, front):
    """What is taken out, whatever its name, lies at the outside, where another side would hide it."""
    plain = body()
    centres = plain.points[plain.tetrahedra].mean(axis=1)
    x, y = (0.045, 0.015)[not right], (0.045, 0.015)[not front]
    gone = (np.abs(centres - [x, y, 0.05]) < 0.01).all(axis=1)
    image = rendered(case_of(body(tumour=gone), mechanisms=(Resection(elements="tumour"),)))
    assert reddish(panel(image, 1, 1)) > 1000
    for row, column in ((0, 0), (0, 1), (1, 0)):
        assert len(places(panel(image, row, column), RESECTED)) > 200


def test_empty_sets(picture):
    plain = body()
    nobody, nothing = np.zeros(len(plain.points), dtype=bool), np.zeros(len(plain.tetrahedra), dtype=bool)
    image = picture(case_of(body(ventricle=nobody, fixed=nobody, resection=nothing)))
    assert len(places(image, RESECTED)) == 0
    # in the legend, and nowhere else
    assert 0 < len(places(image, LARGEST_SET)) < 60


def test_more_sets_tissues_and_recordings_than_there_are_colours(picture):
    mesh = body()
    sets = {f"_{k} $x_{k}$ of a rather long name": mesh.points[:, 0] > 0.001 * k for k in range(12)}
    many = TetMesh(mesh.points, mesh.tetrahedra, np.arange(len(mesh.tetrahedra)) % 30, sets)
    recordings = [tracked(mesh.points[k], (0.001, 0, 0), name=f"_{k}$") for k in range(20)]
    picture(case_of(many, *recordings))


@pytest.mark.slow(1)
@pytest.mark.parametrize(
    "title",
    [
        "$",
        "costs $5 or $6",
        "two\nlines",
        "_hidden",
        "\u7d44\u7e54 \U0001f9e0",
        "",
        "long " * 200,
        "W" * 500,
        r"\frac{",
    ],
)
def test_any_title(picture, title):
    picture(case_of(tetrahedron(), title=title))


def test_any_name(picture):
    mesh = tetrahedron(0.01)
    named = TetMesh(mesh.points, mesh.tetrahedra, node_sets={"_$\n\u7d44": np.ones(4, dtype=bool)})
    case = case_of(named, tracked(mesh.points, (0.001, 0, 0), name="_$a\n\u7d44"))
    picture(dataclasses.replace(case, tissues={1: dataclasses.replace(case.tissues[1], name="_$\u7d44")}))


@pytest.mark.parametrize(
    ("axis", "row", "column", "side"),
    [
        (0, 0, 0, "left"),  # axial: the patient's right (+x) is on the left of the picture
        (0, 0, 1, "left"),  # coronal: the same
        (1, 0, 0, "above"),  # axial: anterior (+y) is above
        (1, 1, 0, "left"),  # sagittal: anterior is on the left
        (2, 0, 1, "above"),  # coronal: superior (+z) is above
        (2, 1, 0, "above"),  # sagittal: the same
    ],
)
def test_the_right_way_round(picture, kept, axis, row, column, side):
    """Tissue 2, on the positive side of the axis, is where a radiologist looks for it."""
    if axis not in kept:
        kept[axis] = picture(case_of(body(axis)))
    seen = panel(kept[axis], row, column)
    first, second = (np.median(places(seen, colour), axis=0) for colour in (FIRST, SECOND))
    assert second[1 if side == "left" else 0] < first[1 if side == "left" else 0] - 20


@pytest.mark.slow(1)
@pytest.mark.parametrize(
    ("displacement", "row", "column", "along"),
    [
        ((0.02, 0, 0), 0, 0, (0, -1)),  # axial: to the patient's right is to the left
        ((0, 0.02, 0), 0, 0, (-1, 0)),  # axial: forwards is up
        ((0.02, 0, 0), 0, 1, (0, -1)),
        ((0, 0, 0.02), 0, 1, (-1, 0)),
        ((0, 0.02, 0), 1, 0, (0, -1)),  # sagittal: forwards is to the left
        ((0, 0, 0.02), 1, 0, (-1, 0)),
        ((0.02, 0, 0), 1, 1, (0, -1)),  # seen from the front
        ((0, 0, 0.02), 1, 1, (-1, 0)),
    ],
)
def test_arrows_point_where_the_tissue_went(picture, kept, displacement, row, column, along):
    """An arrow begins in the middle: most of its pixels are on the side where it points."""
    mesh = body()
    middle = mesh.points.mean(axis=0)
    for u in {displacement, (0, 0, 0)} - set(kept):
        kept[u] = picture(case_of(mesh, tracked(middle, u)))
    seen, still = (panel(kept[u], row, column) for u in (displacement, (0, 0, 0)))
    arrow, point = (places(image, BLACK) for image in (seen, still))
    # letters and scale bar are grey; what is black in both is the panel's title
    arrow = np.array(sorted(set(map(tuple, arrow)) - set(map(tuple, point))))
    if not row == column == 1:
        tissue = np.median(places(still, FIRST).tolist() + places(still, SECOND).tolist(), axis=0)
        assert (arrow.mean(axis=0) - tissue) @ along > 20
    # the head is the wide end
    across = 1 - int(np.argmax(np.abs(along)))
    t = arrow @ along
    head, tail = arrow[t > np.quantile(t, 0.8)], arrow[t < np.quantile(t, 0.2)]
    assert np.ptp(head[:, across]) > np.ptp(tail[:, across])


def test_arrows_that_are_far_from_a_cut_are_only_in_the_whole(picture):
    mesh = body()
    corner = tracked(np.array([0.055, 0.055, 0.055]), (-0.02, 0, 0))
    image, without = picture(case_of(mesh, corner)), picture(case_of(mesh))
    for row, column in ((0, 0), (0, 1), (1, 0)):
        # below the panel's title, which counts arrows
        assert len(places(panel(image, row, column)[60:], BLACK)) == 0
    assert len(places(panel(image, 1, 1), BLACK)) > len(places(panel(without, 1, 1), BLACK)) + 30


def test_recordings_of_every_kind(picture):
    mesh = body(surface=np.ones(125, dtype=bool))
    one = np.ones(3)
    image = picture(
        case_of(
            mesh,
            tracked(mesh.points, 0.001 * mesh.points),
            SurfaceRecording(name="scan", file="b.csv", points=mesh.points + 0.001, nodes="surface"),
            ForceRecording(name="force", file="c.csv", boundary="probe", time=one, force=np.ones((3, 3))),
            tracked(np.empty((0, 3)), np.zeros(3), name="nobody"),
        )
    )
    assert all(len(places(panel(image, row, column), CROSS)) > 50 for row in (0, 1) for column in (0, 1))


@pytest.mark.parametrize(
    ("shape", "size"), [("cylinder", (0.008, 0.008, 0.004)), ("block", (0.005,) * 3), ("block", (0.06, 0.06, 0.003))]
)
def test_specimens(picture, shape, size):
    specimen = Specimen(shape, size, "glued")
    said = TestRecording(
        name="compression", file="a.csv", mode="axial", quantities=("stretch", "stress"), imposed=np.ones(4),
        response=np.ones(4),
    )  # fmt: skip
    case = case_of(specimen.mesh(), said, specimen=specimen)
    assert "compression (test, 4)" in _headline(case)
    image = picture(case)
    assert len(places(panel(image, 0, 0), LARGEST_SET)) > 0 or shape == "block"


@pytest.mark.slow(2)
def test_a_large_mesh_in_reasonable_time(picture):
    mesh = box((26, 26, 26), (0.15, 0.16, 0.13))
    assert len(mesh.tetrahedra) > 100_000
    begun = time.perf_counter()
    picture(case_of(TetMesh(mesh.points, mesh.tetrahedra, node_sets={"all": np.ones(len(mesh.points), dtype=bool)})))
    assert time.perf_counter() - begun < 60.0  # 5 s alone on a machine


def test_the_headline():
    case = find_case("0529")
    assert _headline(dataclasses.replace(case, recordings=())).splitlines() == [
        case.title,
        "stand-in, not the patient's images; "
        f"{len(case.mesh.points)} nodes, {len(case.mesh.tetrahedra)} tetrahedra, {1e6 * case.mesh.volume:.4g} cm3",
        "recorded: nothing",
    ]


@pytest.mark.parametrize(
    ("length", "factor"), [(0.05, 1.0), (0.0024, 1.0), (0.0023, 2.0), (0.001, 5.0), (1e-4, 50.0), (0.0, 1.0)]
)
def test_arrows_are_enlarged_only_where_they_could_not_be_seen(length, factor):
    mesh = body()
    assert _Scene(case_of(mesh, tracked(mesh.points, (length, 0, 0)))).enlarged == factor


@pytest.mark.parametrize(("side", "bar"), [(0.16, 20.0), (0.06, 10.0), (0.006, 1.0), (6.0, 1000.0), (0.0029, 0.2)])
def test_the_scale_bar_fits(side, bar):
    assert scale_length(body(side=side * (1 + 1e-9))) == pytest.approx(bar)


@pytest.mark.usefixtures("picture")
def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        write_case_picture(tmp_path / "nowhere" / "a.png", case_of(tetrahedron()))
