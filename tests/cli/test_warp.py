"""`warpbrain warp` from the outside: files that other programs open, and what it refuses."""

import csv
import json
import re
import runpy
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from command import run, warpbrain
from folders import write_folder
from landmark_files import fcsv, markup

from warpbrain.report.files import LEFT, TRUST, UNSEEN, read_state
from warpbrain.report.warped import read_request, write_warped

nibabel = pytest.importorskip("nibabel")

POINTS = [("a", [5.0, 8.0, 12.0]), ("b", [20.0, 11.0, 27.0]), ("out", [35.0, 15.0, 15.0])]
ELECTRODES = "name\tx\ty\tz\tsize\nLA1\t9\t12\t25\t5\nREF\tn/a\tn/a\tn/a\tn/a\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A block that was pressed, and images and points of it."""
    place = tmp_path_factory.mktemp("block")
    write_folder(place / "case", ("total = [0.01, 0.02, -0.05]", "total = [0.2, 0.3, -0.2]"))
    affine = np.diag([-1.0, 1.0, 0.8, 1.0])
    affine[:3, 3] = [40.0, -10.0, -10.0]
    at = np.indices((51, 51, 64)).reshape(3, -1).T @ affine[:3, :3].T + affine[:3, 3]
    values = (200 + 100 * np.sin(at / 4.0).prod(axis=1)).reshape(51, 51, 64)
    nibabel.save(nibabel.Nifti1Image(values.astype(np.int16), affine), place / "T1.nii.gz")
    inside = ((at > 0) & (at < 30)).all(axis=1) * (1 + (at[:, 0] > 15))
    nibabel.save(nibabel.MGHImage(inside.reshape(values.shape).astype(np.int32), affine), place / "seg.mgz")
    (place / "F.mrk.json").write_text(markup(*POINTS, coordinateSystem="RAS"))
    lps = [(label, (-x, -y, z)) for label, (x, y, z) in POINTS]
    (place / "G.fcsv").write_text(fcsv(*lps))
    (place / "sub-1_electrodes.tsv").write_text(ELECTRODES)
    return place


def asked(folder):
    points = (folder / name for name in ("F.mrk.json", "G.fcsv", "sub-1_electrodes.tsv"))
    return "--image", folder / "T1.nii.gz", "--labels", folder / "seg.mgz", "--points", *points


@pytest.fixture(scope="module")
def warped(folder) -> Path:
    done = run(folder / "case", "--elements", "tet10", "--out", folder / "result", *asked(folder))
    assert done.status == 0, done.err
    assert "forward after inverse is off by" in done.out
    assert "F.mrk.json: 3 moved, 1 of them outside the mesh, by up to 5 mm" in done.out
    return folder / "result"


def moved_of(path: Path):
    with (path / "moved.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    before, after = (
        np.array([[float(row[f"{p}{axis}_mm"]) for axis in "xyz"] for row in rows]) for p in ("", "moved_")
    )
    return rows, before, after


@pytest.mark.slow(4)
def test_run_and_warp_write_the_same(folder, warped, tmp_path):
    done = warpbrain("warp", warped, "--out", tmp_path / "again", *asked(folder))
    assert done.status == 0, done.err
    names = {path.name for path in (tmp_path / "again").iterdir()}
    for name in ("displacement.nii.gz", "T1-after.nii.gz", "seg-after.nii.gz", "F-after.mrk.json", "G-after.fcsv"):
        assert name in names
    for name in names - {"load_in_slicer.py", "warpbrain.log"}:
        assert (tmp_path / "again" / name).read_bytes() == (warped / name).read_bytes(), name


def test_points_of_all_files_move_alike(warped):
    rows, before, after = moved_of(warped)
    assert [row["label"] for row in rows] == ["a", "b", "out", "a", "b", "out", "LA1"]
    np.testing.assert_allclose(before[:3], before[3:6], atol=1e-3)
    np.testing.assert_allclose(after[:3], after[3:6], atol=1e-3)
    assert np.linalg.norm(after - before, axis=1).min() > 0.01
    controls = json.loads((warped / "F-after.mrk.json").read_text())["markups"][0]["controlPoints"]
    np.testing.assert_allclose([control["position"] for control in controls], after[:3], atol=1e-3)
    last = (warped / "sub-1_desc-after_electrodes.tsv").read_text().splitlines()
    np.testing.assert_allclose([float(word) for word in last[1].split("\t")[1:4]], after[6], atol=1e-3)
    assert last[2] == ELECTRODES.splitlines()[2]


def test_simpleitk_agrees(folder, warped, verify):
    sitk = pytest.importorskip("SimpleITK")
    forth, back = (
        sitk.DisplacementFieldTransform(sitk.ReadImage(warped / f"transform-{name}.nii.gz", sitk.sitkVectorFloat64))
        for name in ("before-to-after", "after-to-before")
    )
    rows, before, after = moved_of(warped)
    signs = np.array([-1.0, -1.0, 1.0])
    moved = np.array([back.TransformPoint((signs * point).tolist()) for point in before]) * signs
    apart = [float(row["transform_apart_mm"]) for row in rows]
    np.testing.assert_allclose(apart, np.linalg.norm(moved - after, axis=1), atol=1e-3)
    verify(
        "landmarks in and beside a body of ten-node tetrahedra, largest error of moved.csv",
        "SimpleITK with the transform that is written",
        np.linalg.norm(moved - after, axis=1).max(),
        0.05,
        "mm",
    )
    image = sitk.ReadImage(folder / "T1.nii.gz", sitk.sitkFloat32)
    expected = sitk.GetArrayFromImage(sitk.Resample(image, image, forth, sitk.sitkLinear, 0.0))
    found = nibabel.load(warped / "T1-after.nii.gz")
    assert found.get_data_dtype() == np.int16
    np.testing.assert_allclose(found.affine, nibabel.load(folder / "T1.nii.gz").affine)
    difference = np.abs(np.asarray(found.dataobj).transpose(2, 1, 0) - expected)[2:-2, 2:-2, 2:-2]
    verify(
        "warped image of whole numbers, largest difference of grey values of 100 to 300",
        "SimpleITK's resampling by the transform that is written",
        difference.max(),
        # half of it is rounding to whole numbers, the rest of displacements to 1/8192 mm
        0.52,
    )


def test_every_model_says_its_axes(warped):
    from mesh_axes import space_of

    for path in warped.glob("*.vtu"):
        assert space_of(path) == "RAS", path


def test_the_scene_loads_what_is_there(folder, warped, monkeypatch):
    slicer = MagicMock()
    slicer.util.loadVolume.side_effect = lambda name: Path(name)
    monkeypatch.setitem(sys.modules, "slicer", slicer)
    made = {}
    slicer.mrmlScene.AddNewNodeByClass.side_effect = lambda kind, name: made.setdefault(name, MagicMock())
    vtk = SimpleNamespace(vtkAssignAttribute=SimpleNamespace(POINT_DATA=0), vtkVector3d=lambda x, y, z: [x, y, z])
    monkeypatch.setitem(sys.modules, "vtk", vtk)
    runpy.run_path(str(warped / "load_in_slicer.py"))
    calls = {
        name: [Path(call.args[0]) for call in getattr(slicer.util, name).call_args_list]
        for name in ("loadVolume", "loadLabelVolume", "loadModel", "loadMarkups", "loadTransform")
    }
    assert [len(paths) for paths in calls.values()] == [2, 1, 2, 4, 1]
    assert all(path.is_file() for paths in calls.values() for path in paths)
    # electrodes.tsv is no format of Slicer: its points are made, before and after
    _, before, after = moved_of(warped)
    for when, expected in (("before", before[-1]), ("after", after[-1])):
        ((position, label),) = (c.args for c in made[f"sub-1_electrodes.tsv {when}"].AddControlPoint.call_args_list)
        assert label == "LA1"
        np.testing.assert_allclose(position, expected)


def test_the_scene_loads_maps_of_where_not_to_believe_it(folder, warped, tmp_path, monkeypatch):
    state = read_state(warped)
    trust = np.where(state.mesh.points[:, 2] > 0.015, LEFT, UNSEEN)
    known = replace(state, deviation=np.full(len(trust), 1e-4), trust=trust)
    asked = read_request(folder / "T1.nii.gz", None, [])
    lines, files = write_warped(tmp_path, known, asked)
    assert {"displacement_sd.nii.gz", "trust.nii.gz"} <= set(files)
    assert any("standard deviation of the displacement: up to 0.1 mm" in line for line in lines)
    volume = np.asarray(nibabel.load(tmp_path / "trust.nii.gz").dataobj)
    assert set(np.unique(volume)) == {0, UNSEEN, LEFT}
    slicer = MagicMock()
    monkeypatch.setitem(sys.modules, "slicer", slicer)
    monkeypatch.setitem(sys.modules, "vtk", MagicMock())
    runpy.run_path(str(tmp_path / "load_in_slicer.py"))
    volumes = [Path(call.args[0]).name for call in slicer.util.loadVolume.call_args_list]
    assert volumes == ["displacement_sd.nii.gz", "T1.nii.gz", "T1-after.nii.gz"]
    table = slicer.mrmlScene.AddNewNodeByClass.return_value
    assert [call.args[0] for call in table.SetColor.call_args_list] == [0, *TRUST]
    assert table.SetColor.call_args_list[-1].args[1] == TRUST[LEFT]


def test_labels_may_have_the_name_of_a_transform(folder, warped, tmp_path):
    labels = nibabel.load(folder / "seg.mgz")
    nibabel.save(nibabel.Nifti1Image(np.asarray(labels.dataobj), labels.affine), tmp_path / "transform-seg.nii.gz")
    out = tmp_path / "out"
    done = warpbrain("warp", warped, "--out", out, "--labels", tmp_path / "transform-seg.nii.gz")
    assert done.status == 0, done.err
    assert 'LABELS = ["transform-seg-after.nii.gz"]' in (out / "load_in_slicer.py").read_text(encoding="utf-8")
    images = [nibabel.load(path) for path in (out / "transform-seg-after.nii.gz", warped / "seg-after.nii.gz")]
    np.testing.assert_array_equal(*(np.asarray(image.dataobj) for image in images))


def test_an_nrrd_image_gives_the_same(folder, warped, tmp_path):
    sitk = pytest.importorskip("SimpleITK")
    sitk.WriteImage(sitk.ReadImage(folder / "T1.nii.gz"), tmp_path / "T1.nrrd")
    done = warpbrain("warp", warped, "--out", tmp_path, "--image", tmp_path / "T1.nrrd")
    assert done.status == 0, done.err
    images = [nibabel.load(place / "T1-after.nii.gz") for place in (tmp_path, warped)]
    np.testing.assert_allclose(images[0].affine, images[1].affine, atol=1e-5)
    np.testing.assert_array_equal(*(np.asarray(image.dataobj) for image in images))


@pytest.fixture(scope="module")
def points_alone(folder, warped, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("points") / "out"
    with pytest.MonkeyPatch.context() as patch:
        # an eighth of the voxels, each of which is inverted: the mesh moves the points
        patch.setattr("warpbrain.report.warped._EDGE", 2.0)
        done = warpbrain("warp", warped / "result.vtu", "--out", out, "--points", folder / "F.mrk.json")
    assert done.status == 0, done.err
    return out


def test_points_need_no_image(warped, points_alone):
    _, _, after = moved_of(points_alone)
    _, _, expected = moved_of(warped)
    np.testing.assert_allclose(after[:2], expected[:2], atol=1e-4)


def _far(image):
    image.affine[:3, 3] += 500.0
    return nibabel.Nifti1Image(np.asarray(image.dataobj), image.affine)


def _skew(image):
    image.affine[0, 1] = 0.3
    return nibabel.Nifti1Image(np.asarray(image.dataobj), image.affine)


def _metres(image):
    image.header.set_xyzt_units("meter")
    return image


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_far, "bad.nii.gz: affine: 0 % of the body"),
        (_skew, "bad.nii.gz: affine: its axes are not at right angles"),
        (_metres, "bad.nii.gz: a voxel of 1000 mm is larger than the body of"),
    ],
)
def test_images_that_cannot_be_of_the_body(folder, warped, tmp_path, change, message):
    nibabel.save(change(nibabel.load(folder / "T1.nii.gz")), tmp_path / "bad.nii.gz")
    done = warpbrain("warp", warped, "--image", tmp_path / "bad.nii.gz", "--out", tmp_path / "out")
    assert done.status == 2
    assert message in done.err
    assert not (tmp_path / "out").exists()


def _moved(values):
    """In the place of the body nothing, and something beside it."""
    shifted = np.zeros_like(values)
    shifted[:2, :2, :2] = 3
    return shifted


@pytest.mark.parametrize(
    ("values", "shift", "message"),
    [
        (np.zeros_like, 0.0, "seg.nii.gz: all its voxels are 0: there are no labels to warp"),
        (_moved, 0.0, "mm RAS: no label is of it"),
        (np.asarray, 500.0, "seg.nii.gz: affine: 0 % of the body"),
    ],
)
def test_labels_that_are_elsewhere_are_refused(folder, warped, tmp_path, values, shift, message):
    """Beside an image that is in place they gave zeros, silently."""
    labels = nibabel.load(folder / "seg.mgz")
    affine = labels.affine.copy()
    affine[:3, 3] += shift
    nibabel.save(nibabel.Nifti1Image(values(np.asarray(labels.dataobj)), affine), tmp_path / "seg.nii.gz")
    given = ("--image", folder / "T1.nii.gz", "--labels", tmp_path / "seg.nii.gz")
    done = warpbrain("warp", warped, "--out", tmp_path / "out", *given)
    assert done.status == 2
    assert message in done.err and done.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_what_is_outside_an_image_is_said(folder, warped, tmp_path):
    image = nibabel.load(folder / "T1.nii.gz")
    # the upper half alone, with a little more
    half = image.slicer[:, :, image.shape[2] // 2 - 3 :]
    nibabel.save(half, tmp_path / "T1.nii.gz")
    done = warpbrain("warp", warped, "--out", tmp_path / "out", "--image", tmp_path / "T1.nii.gz")
    assert done.status == 0, done.err
    assert re.search(r"^note      T1\.nii\.gz: \d+ % of the body are outside of it$", done.out, re.MULTILINE)


@pytest.mark.slow(6)
def test_what_was_warped_before_is_not_overwritten(folder, warped, points_alone):
    given = ("--out", points_alone, "--points", folder / "F.mrk.json")
    done = warpbrain("warp", warped, *given)
    assert done.status == 2
    assert "transform-after-to-before.nii.gz, F-after.mrk.json already: --overwrite replaces them" in done.err
    assert warpbrain("warp", warped, *given, "--overwrite").status == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "expected --image, --labels or --points"),
        (("--image", "nothing.nii.gz"), "nothing.nii.gz: no such file"),
        (("--points", "{}/T1.nii.gz"), "T1.nii.gz: found ending '.gz', expected .mrk.json"),
        (("--image", "{}"), "found a folder, expected a volume: of a DICOM series make one with dcm2niix"),
        (("--image", "{}/T1.nii.gz", "--labels", "{}/T1.nii.gz"), "T1-after.nii.gz: 2 of the files"),
    ],
)
def test_what_is_refused(folder, warped, tmp_path, arguments, message):
    given = [word.format(folder) for word in arguments]
    done = warpbrain("warp", warped, "--out", tmp_path / "out", *given)
    assert done.status == 2
    assert message in done.err
    assert not (tmp_path / "out").exists()


def test_a_result_that_is_none(folder, tmp_path):
    done = warpbrain("warp", tmp_path, "--image", folder / "T1.nii.gz")
    assert done.status == 2
    assert "found none of result.vtu, state.vtu, fields.vtu" in done.err
    (tmp_path / "result.vtu").write_text("nonsense")
    done = warpbrain("warp", tmp_path, "--image", folder / "T1.nii.gz")
    assert done.status == 2
    assert "result.vtu: no body of tetrahedra that can be read" in done.err


def test_a_run_stops_before_it_begins_on_an_image_of_something_else(folder, tmp_path):
    nibabel.save(_far(nibabel.load(folder / "T1.nii.gz")), tmp_path / "T1.nii")
    done = run(folder / "case", "--out", tmp_path / "out", "--image", tmp_path / "T1.nii")
    assert done.status == 2
    assert "T1.nii: affine: 0 % of the body" in done.err
    assert not (tmp_path / "out").exists()


def test_a_run_stops_before_it_begins_on_a_bad_image(folder, tmp_path):
    (tmp_path / "T1.nii").write_bytes(b"nothing")
    done = run(folder / "case", "--out", tmp_path / "out", "--image", tmp_path / "T1.nii")
    assert done.status == 2
    assert "T1.nii: not a NIfTI file" in done.err
    assert not (tmp_path / "out").exists()
