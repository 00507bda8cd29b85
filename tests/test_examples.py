"""Every script in `examples/` runs, and does what it says."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
#: The ICBM152 template in voxels of 4 mm.
MAPS = Path(__file__).parent / "icbm152"
RAS_TO_LPS = np.array([-1.0, -1.0, 1.0])


@pytest.mark.slow(60)
def test_there_and_back(tmp_path, verify):
    for package in ("mmgpy", "nibabel"):
        pytest.importorskip(package)
    sitk = pytest.importorskip("SimpleITK")
    command = [sys.executable, EXAMPLES / "there_and_back.py", tmp_path, "--maps", MAPS, "--size", "14"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("$ warpbrain") <= 4
    result = tmp_path / "result"
    for name in (
        "T1-after.nii.gz",
        "aseg-after.nii.gz",
        "landmarks-after.mrk.json",
        "report.html",
        "load_in_slicer.py",
    ):
        assert (result / name).is_file(), name
    forth, back = (
        sitk.DisplacementFieldTransform(sitk.ReadImage(result / f"transform-{name}.nii.gz", sitk.sitkVectorFloat64))
        for name in ("before-to-after", "after-to-before")
    )

    before, after = landmarks(result / "moved.csv")
    assert len(before) == 30
    assert np.linalg.norm(after - before, axis=1).max() > 3.0
    verify(
        "30 landmarks in a template brain that sags by 8 mm, largest error of moved.csv",
        "SimpleITK with the transform that is written",
        np.linalg.norm(moved(back, before) - after, axis=1).max(),
        0.05,
        "mm",
    )
    # places after, anywhere in tissue, that are looked up before and moved again
    places = moved(back, points_in_tissue(sitk.ReadImage(tmp_path / "aseg.nii.gz"), 5000))
    verify(
        "the same brain, moved after it was moved back, 99th percentile of 5,000 places in tissue",
        "identity, by SimpleITK with both transforms that are written",
        np.percentile(np.linalg.norm(moved(back, moved(forth, places)) - places, axis=1), 99.0),
        0.05,
        "mm",
    )


def landmarks(path):
    """Positions (n, 3) before and after [mm, LPS]."""
    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    return tuple(
        RAS_TO_LPS * [[float(row[f"{word}{axis}_mm"]) for axis in "xyz"] for row in rows] for word in ("", "moved_")
    )


def moved(transform, points):
    return np.array([transform.TransformPoint(point) for point in points.tolist()])


def points_in_tissue(labels, count):
    """Places (count, 3) [mm, LPS] within the voxels of cortex and white matter."""
    import SimpleITK as sitk

    rng = np.random.default_rng(0)
    inside = np.argwhere(np.isin(sitk.GetArrayFromImage(labels), (2, 3, 41, 42)))[:, ::-1]
    indices = inside[rng.integers(len(inside), size=count)] + rng.uniform(-0.5, 0.5, (count, 3))
    return np.array([labels.TransformContinuousIndexToPhysicalPoint(index) for index in indices.tolist()])
