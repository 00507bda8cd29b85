"""Displacement fields and their inverse, against closed forms and SimpleITK."""

import numpy as np
import pytest
from image_grids import SIZE, turned_grid
from shapes import box

from warpbrain.images.displacement import DisplacementField, displacement_field, inverse, resampled
from warpbrain.images.grid import MILLIMETRES, Grid, voxels_inside
from warpbrain.images.writing import write_displacement, write_transform, write_volume


def swirl(points):
    """A smooth displacement [mm] of up to 3 mm about the middle of the block, with a rotation and a push."""
    away = points - 15.0
    size = np.exp(-(away**2).sum(axis=-1, keepdims=True) / 11.0**2)
    turn = np.stack([-away[..., 1], away[..., 0], 0.0 * away[..., 2]], axis=-1)
    return size * (0.25 * turn + np.array([0.5, -1.0, 2.0]))


def swirl_field() -> DisplacementField:
    grid = Grid((60, 60, 60), np.diag([1.0, 1.0, 1.0, 1.0]))
    grid.affine[:3, 3] = -14.5
    at = grid.positions(np.indices(grid.shape).reshape(3, -1).T)
    return DisplacementField(grid, swirl(at).reshape(*grid.shape, 3).astype(np.float32))


def closed_form_inverse(points):
    """Where points come from, by Newton's method on the closed form."""
    found = points.copy()
    for _ in range(100):
        found = points - swirl(found)
    return found


def test_inverse_is_that_of_the_closed_form(verify):
    field = swirl_field()
    back = inverse(field, np.ones(field.grid.shape, dtype=bool))
    assert back.unsolved == 0
    rng = np.random.default_rng(0)
    points = rng.uniform(2.0, 28.0, (500, 3))
    error = np.linalg.norm(points + back.field.at(points) - closed_form_inverse(points), axis=1)
    verify(
        "inverse of a displacement of 3 mm on voxels of 1 mm, largest error",
        "fixed point of the closed form",
        error.max(),
        0.03,
        "mm",
    )
    verify(
        "forward after inverse between voxels, 99th percentile",
        "identity",
        back.error_99,
        0.05,
        "mm",
    )


def test_a_fold_is_counted_and_not_hidden():
    field = swirl_field()
    folded = DisplacementField(field.grid, 12.0 * field.vectors)
    back = inverse(folded, np.ones(field.grid.shape, dtype=bool))
    assert back.unsolved > 100
    assert back.error_largest > 1.0


def test_displacement_in_the_mesh_is_that_of_its_nodes():
    mesh, grid = box((6, 6, 6), (SIZE,) * 3), turned_grid((44, 44, 50), (1.0, 1.0, 1.0))
    u = swirl(MILLIMETRES * mesh.points) / MILLIMETRES
    field = displacement_field(voxels_inside(mesh, grid), u)
    points = np.random.default_rng(2).uniform(6.0, 24.0, (300, 3))
    assert np.linalg.norm(field.at(points) - swirl(points), axis=1).max() < 0.4
    # nothing moves far away, and there is nothing beyond
    assert np.abs(field.vectors[0, 0, 0]).max() < 0.05
    np.testing.assert_array_equal(field.at([[500.0, 0, 0]]), 0.0)


@pytest.fixture
def sitk():
    return pytest.importorskip("SimpleITK")


@pytest.fixture
def image():
    """An image on another grid than the field's, and its field."""
    grid = turned_grid((40, 38, 42), (1.2, 1.0, 0.8))
    at = grid.positions(np.indices(grid.shape).reshape(3, -1).T)
    values = (100.0 + 50.0 * np.sin(at / 3.0).sum(axis=1)).reshape(grid.shape).astype(np.float32)
    return values, grid


def test_simpleitk_resamples_as_the_file_name_says(tmp_path, sitk, image, verify):
    values, grid = image
    field = swirl_field()
    back = inverse(field, np.ones(field.grid.shape, dtype=bool)).field
    write_transform(tmp_path / "transform-before-to-after.nii.gz", back)
    write_transform(tmp_path / "transform-after-to-before.nii.gz", field)
    write_volume(tmp_path / "before.nii.gz", values, grid)
    write_volume(tmp_path / "labels.nii.gz", (values // 40).astype(np.uint8), grid)

    def transform(name):
        return sitk.DisplacementFieldTransform(sitk.ReadImage(tmp_path / name, sitk.sitkVectorFloat64))

    forth, reverse = (transform(f"transform-{name}.nii.gz") for name in ("before-to-after", "after-to-before"))
    reference = sitk.ReadImage(tmp_path / "transform-after-to-before.nii.gz")
    warped = sitk.Resample(sitk.ReadImage(tmp_path / "before.nii.gz"), reference, forth, sitk.sitkLinear, 0.0)
    expected = sitk.GetArrayFromImage(warped).transpose(2, 1, 0)
    found = resampled(values, grid, back, nearest=False)
    # inside the image and away from its border, which programs treat differently
    inside = resampled(np.ones(grid.shape, dtype=np.float32), grid, back, nearest=False) > 0.999
    at = grid.indices(field.grid.positions(np.argwhere(inside)) + back.vectors[inside])
    deep = ((at > 1) & (at < np.array(grid.shape) - 2)).all(axis=1)
    verify(
        "warped image, largest difference of grey values of 100 +- 150",
        "SimpleITK's linear resampling by the transform that is written",
        np.abs(found[inside] - expected[inside])[deep].max(),
        0.05,
    )
    labels = sitk.Resample(sitk.ReadImage(tmp_path / "labels.nii.gz"), reference, forth, sitk.sitkNearestNeighbor, 0)
    same = resampled((values // 40).astype(np.uint8), grid, back, nearest=True) == sitk.GetArrayFromImage(
        labels
    ).transpose(2, 1, 0)
    assert same[inside].mean() > 0.999
    # what was at a point before is at that point moved along after
    points = np.random.default_rng(1).uniform(5.0, 25.0, (50, 3))
    signs = np.array([-1.0, -1.0, 1.0])
    moved = np.array([reverse.TransformPoint((signs * point).tolist()) for point in points]) * signs
    verify(
        "points moved by the transform that is written, largest error",
        "closed form",
        np.linalg.norm(moved - points - swirl(points), axis=1).max(),
        0.05,
        "mm",
    )


def test_displacement_file_is_in_ras_and_itk_knows(tmp_path, sitk):
    import nibabel

    field = swirl_field()
    write_displacement(tmp_path / "displacement.nii.gz", field)
    file = nibabel.load(tmp_path / "displacement.nii.gz")
    assert file.shape == (60, 60, 60, 1, 3)
    assert file.header.get_intent()[0] == "displacement vector"
    np.testing.assert_allclose(file.get_fdata()[:, :, :, 0], field.vectors, atol=1e-4)
    np.testing.assert_allclose(file.affine, field.grid.affine)
    in_lps = sitk.GetArrayFromImage(sitk.ReadImage(tmp_path / "displacement.nii.gz")).transpose(2, 1, 0, 3)
    np.testing.assert_allclose(in_lps * [-1, -1, 1], field.vectors, atol=1e-4)


def test_resampling_by_a_translation_is_exact():
    grid = Grid((12, 13, 14), np.eye(4))
    values = np.arange(grid.count, dtype=np.int16).reshape(grid.shape)
    # what is at x after was at x + (2, 0, -1) before
    back = DisplacementField(grid, np.tile(np.float32([2, 0, -1]), (*grid.shape, 1)))
    found = resampled(values, grid, back, nearest=False)
    np.testing.assert_array_equal(found[:10, :, 1:], values[2:, :, :-1])
    assert found.dtype == np.int16
    assert not found[10:].any()
    np.testing.assert_array_equal(resampled(values, grid, back, nearest=True), found)


def test_what_is_no_number_does_not_spread():
    """A voxel that is none stays alone where nothing moves; half a voxel away most of a neighbour decides."""
    grid = Grid((6, 6, 6), np.eye(4))
    values = np.random.default_rng(0).normal(size=grid.shape)
    values[3, 3, 3], values[1, 1, 1] = np.nan, np.inf
    still = DisplacementField(grid, np.zeros((*grid.shape, 3), dtype=np.float32))
    found = resampled(values, grid, still, nearest=False)
    known = np.isfinite(values)
    np.testing.assert_array_equal(np.isfinite(found), known)
    np.testing.assert_allclose(found[known], values[known], atol=1e-12)
    aside = DisplacementField(grid, np.tile(np.float32([0.25, 0, 0]), (*grid.shape, 1)))
    found = resampled(values, grid, aside, nearest=False)
    assert np.isnan(found[3, 3, 3]) and np.count_nonzero(np.isnan(found)) == 2
    # of the other neighbour there is three quarters: its value alone
    assert found[2, 3, 3] == pytest.approx(values[2, 3, 3])


@pytest.mark.parametrize("nearest", [True, False])
def test_large_whole_numbers_stay_as_they_are(nearest):
    grid = Grid((3, 3, 3), np.eye(4))
    values = np.full(grid.shape, 2**31 - 1, dtype=np.int32)
    values[0] = 2**24 + 1
    still = DisplacementField(grid, np.zeros((*grid.shape, 3), dtype=np.float32))
    np.testing.assert_array_equal(resampled(values, grid, still, nearest=nearest), values)


@pytest.mark.parametrize(
    ("values", "written"),
    [
        (np.array([-5, 7], dtype=np.int64), np.int32),
        (np.array([0, 2**40], dtype=np.int64), np.float64),
        (np.array([0, 2**31], dtype=np.uint64), np.float64),
        (np.array([True, False]), np.uint8),
        (np.array([1.0, 0.5], dtype=np.float16), np.float32),
        (np.array([-3, 4], dtype=">i2"), np.int16),
    ],
)
def test_no_value_is_changed_by_the_type_it_is_written_in(tmp_path, values, written):
    nibabel = pytest.importorskip("nibabel")
    write_volume(tmp_path / "values.nii.gz", values.reshape(2, 1, 1), Grid((2, 1, 1), np.eye(4)))
    file = nibabel.load(tmp_path / "values.nii.gz")
    assert file.get_data_dtype() == written
    np.testing.assert_array_equal(np.asarray(file.dataobj).ravel(), values)
