"""Every script in `examples/` runs, and does what it says."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.slow
def test_there_and_back(tmp_path, verify):
    for package in ("mmgpy", "nibabel"):
        pytest.importorskip(package)
    sitk = pytest.importorskip("SimpleITK")
    command = [sys.executable, EXAMPLES / "there_and_back.py", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    result = tmp_path / "result"
    assert (result / "T1-after.nii.gz").is_file()
    field = sitk.ReadImage(result / "transform-after-to-before.nii.gz", sitk.sitkVectorFloat64)
    moves = sitk.DisplacementFieldTransform(field)
    with (result / "moved.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    signs = np.array([-1.0, -1.0, 1.0])
    before, after = (
        signs * [[float(row[f"{word}{axis}_mm"]) for axis in "xyz"] for row in rows] for word in ("", "moved_")
    )
    assert len(rows) == 30
    assert np.linalg.norm(after - before, axis=1).max() > 3.0
    moved = np.array([moves.TransformPoint(point.tolist()) for point in before])
    verify(
        "30 landmarks in a brain that sags by 8 mm, largest error of moved.csv",
        "SimpleITK with the transform that is written",
        np.linalg.norm(moved - after, axis=1).max(),
        0.05,
        "mm",
    )
