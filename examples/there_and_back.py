"""From a scan with FreeSurfer's labels to a warped scan: three commands, on a small volume that this script makes.

    pip install "warpbrain[build,images]"
    python examples/there_and_back.py there-and-back

With volumes of your own the commands are the same; `docs/images.md` says what the files mean. The volume here is an
ellipsoid of grey and white matter around a ventricle, in voxels of 2 mm. A part at the top was taken out (label 500),
the head lies on its back and fluid has run out, so that the brain sags.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import nibabel
import numpy as np

SHAPE, VOXEL = (64, 76, 62), 2.0
#: Half axes [mm] of FreeSurfer's cortex (3), white matter (2) and lateral ventricle (4).
HALF_AXES = {3: (48.0, 58.0, 46.0), 2: (36.0, 45.0, 34.0), 4: (15.0, 24.0, 14.0)}
#: Middle and radius [mm] of what was taken out.
CUT = (np.array([12.0, 20.0, 42.0]), 15.0)
GREY_VALUES = {0: 20.0, 2: 110.0, 3: 75.0, 4: 25.0, 500: 15.0}
LANDMARKS = 30


def main(folder: Path) -> None:
    """Make the volumes and run the commands."""
    folder.mkdir(parents=True, exist_ok=True)
    write_volumes(folder)
    case = folder / "case"
    warpbrain(
        *("cases", "new", case, "--labels", folder / "aseg.nii.gz"),
        *("--preset", "freesurfer", "--tissue", "500=resection", "--size", 9),
    )
    lie_on_the_back(case / "case.toml")
    warpbrain("cases", "check", case)
    warpbrain(
        *("run", "--case", case, "--out", folder / "result", "--image", folder / "T1.nii.gz"),
        *("--labels", folder / "aseg.nii.gz", "--points", folder / "landmarks.mrk.json"),
    )


def write_volumes(folder: Path) -> None:
    """A T1 with a pattern that shows how it is moved, labels, and landmarks as 3D Slicer writes them."""
    affine = np.diag([VOXEL, VOXEL, VOXEL, 1.0])
    affine[:3, 3] = -VOXEL * (np.array(SHAPE) - 1) / 2
    at = np.indices(SHAPE).reshape(3, -1).T @ affine[:3, :3].T + affine[:3, 3]
    labels = np.zeros(len(at), dtype=np.int32)
    for label, axes in HALF_AXES.items():
        labels[((at / np.array(axes)) ** 2).sum(axis=1) < 1.0] = label
    labels[(np.linalg.norm(at - CUT[0], axis=1) < CUT[1]) & (labels > 0)] = 500
    values = np.array([GREY_VALUES[label] for label in labels.tolist()])
    values += np.where(np.isin(labels, (2, 3)), 15.0 * np.sign(np.sin(at * np.pi / 10.0).prod(axis=1)), 0.0)
    for name, array in (("T1", values.astype(np.int16)), ("aseg", labels)):
        nibabel.save(nibabel.Nifti1Image(array.reshape(SHAPE), affine), folder / f"{name}.nii.gz")
    tissue = np.flatnonzero(np.isin(labels, (2, 3)))
    chosen = at[np.random.default_rng(0).choice(tissue, LANDMARKS, replace=False)]
    points = [{"label": f"L-{i + 1}", "position": position} for i, position in enumerate(chosen.tolist())]
    markup = {"type": "Fiducial", "coordinateSystem": "RAS", "coordinateUnits": "mm", "controlPoints": points}
    (folder / "landmarks.mrk.json").write_text(json.dumps({"markups": [markup]}, indent=2), encoding="utf-8")


def lie_on_the_back(case: Path) -> None:
    """Say in `case.toml` where down is, and that fluid stands only to a part of the brain's height."""
    text = case.read_text(encoding="utf-8")
    text = text.replace("# gravity_axis =", "gravity_axis =")
    text += '\n[[mechanism]]\nkind = "gravity"\ncsf_level = 60.0\n'
    case.write_text(text, encoding="utf-8")


def warpbrain(*arguments: object) -> None:
    """Run a command of the tool; leave with its status if it fails."""
    words = [str(argument) for argument in arguments]
    print("$ warpbrain", *words, flush=True)
    done = subprocess.run([sys.executable, "-m", "warpbrain", *words], check=False)
    if done.returncode:
        sys.exit(done.returncode)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "there-and-back"))
