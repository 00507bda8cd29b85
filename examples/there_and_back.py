"""From a scan with FreeSurfer's labels to a warped scan: three commands, on the ICBM152 template.

    pip install "warpbrain[build,images]"
    python examples/there_and_back.py there-and-back

With volumes of your own the commands are the same; `docs/images.md` says what the files mean. The scan here is the
template as nilearn ships it, labelled by its probabilities of grey and white matter. Tissue at the right frontal pole
was taken out (label 500), the head lies on its back and fluid has run out, so that the brain sags within the skull.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import nibabel
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

#: FreeSurfer's labels of left and right cortex, white matter and lateral ventricle, and of fluid outside.
CORTEX, WHITE, VENTRICLE, FLUID = (3, 42), (2, 41), (4, 43), 24
#: Of what was taken out: a label of our own.
TAKEN = 500
#: Lateral ventricles are fluid this deep in the head [mm], in the piece that is around here on either side [mm, MNI].
DEEP, BODY = 10.0, np.array([13.0, -15.0, 20.0])
#: Middle [mm, MNI] and radius [mm] of what was taken out.
CUT = (np.array([24.0, 50.0, 22.0]), 17.0)
LANDMARKS = 30
#: Down is to the back of the head and fluid stands 60 mm above its lowest point; the skull is where the surface was.
LOADS = ("gravity:direction=0/-1/0,level=60", "contact:nodes=surface,state=lifting")


def main() -> None:
    """Make the volumes and run the commands."""
    parser = argparse.ArgumentParser(description="From labels to a warped scan of the ICBM152 template.")
    parser.add_argument("folder", type=Path, nargs="?", default=Path("there-and-back"))
    parser.add_argument("--maps", type=Path, help="folder of other t1.nii.gz, gm.nii.gz and wm.nii.gz than nilearn's")
    parser.add_argument("--size", type=float, default=9.0, help="mean edge of an element [mm]")
    options = parser.parse_args()
    folder: Path = options.folder
    folder.mkdir(parents=True, exist_ok=True)
    write_volumes(folder, *(maps_of_nilearn() if options.maps is None else maps_in(options.maps)))

    case = folder / "icbm152"
    warpbrain(
        *("cases", "new", case, "--labels", folder / "aseg.nii.gz"),
        *("--preset", "freesurfer", "--tissue", f"{TAKEN}=resection", "--size", options.size),
    )
    warpbrain("cases", "check", case)
    warpbrain(
        *("run", "--case", case, *(word for load in LOADS for word in ("--with", load)), "--out", folder / "result"),
        *("--image", folder / "T1.nii.gz", "--labels", folder / "aseg.nii.gz"),
        *("--points", folder / "landmarks.mrk.json"),
    )


def maps_of_nilearn() -> tuple[Any, Any, Any]:
    """T1, and probabilities of grey and white matter, as images of 1 mm."""
    from nilearn.datasets import load_mni152_gm_template, load_mni152_template, load_mni152_wm_template

    return tuple(
        load(resolution=1) for load in (load_mni152_template, load_mni152_gm_template, load_mni152_wm_template)
    )


def maps_in(folder: Path) -> tuple[Any, ...]:
    """The same from files."""
    return tuple(nibabel.load(folder / f"{name}.nii.gz") for name in ("t1", "gm", "wm"))


def write_volumes(folder: Path, t1: Any, grey: Any, white: Any) -> None:
    """A T1 with a cavity, FreeSurfer's labels, and landmarks as 3D Slicer writes them."""
    values, affine = t1.get_fdata(dtype=np.float32), t1.affine
    at = np.moveaxis(np.indices(values.shape), 0, -1) @ affine[:3, :3].T + affine[:3, 3]
    labels = labels_of(values > 0, grey.get_fdata(), white.get_fdata(), at, np.abs(np.diag(affine)[:3]))
    taken = (np.linalg.norm(at - CUT[0], axis=-1) < CUT[1]) & (labels > 0) & ~np.isin(labels, VENTRICLE)
    # fluid fills it: as dark as the ventricles
    values[taken] = np.median(values[np.isin(labels, VENTRICLE)])
    labels[taken] = TAKEN
    for name, array in (("T1", values), ("aseg", labels)):
        nibabel.save(nibabel.Nifti1Image(array, affine), folder / f"{name}.nii.gz")
    tissue = at[np.isin(labels, (*CORTEX, *WHITE))]
    rng = np.random.default_rng(0)
    chosen = tissue[rng.choice(len(tissue), LANDMARKS, replace=False)]
    # anywhere in their voxels
    chosen = chosen + rng.uniform(-0.5, 0.5, chosen.shape) @ affine[:3, :3].T
    points = [{"label": f"L-{i + 1}", "position": position} for i, position in enumerate(chosen.tolist())]
    markup = {"type": "Fiducial", "coordinateSystem": "RAS", "coordinateUnits": "mm", "controlPoints": points}
    (folder / "landmarks.mrk.json").write_text(json.dumps({"markups": [markup]}, indent=2), encoding="utf-8")


def labels_of(
    head: NDArray[np.bool_],
    grey: NDArray[np.float64],
    white: NDArray[np.float64],
    at: NDArray[np.float64],
    voxel: NDArray[np.float64],
) -> NDArray[np.int32]:
    """What is most probable at each voxel (i, j, k), by side; `at` is where they are, `voxel` their edges [mm]."""
    right = (at[..., 0] > 0).astype(np.int64)
    tissue = head & (grey + white > 0.5)
    labels = np.where(head, FLUID, 0).astype(np.int32)
    labels[tissue] = np.where(white > grey, np.array(WHITE)[right], np.array(CORTEX)[right])[tissue]
    depth = ndimage.distance_transform_edt(ndimage.binary_fill_holes(head), sampling=voxel)
    pieces, _ = ndimage.label(head & ~tissue & (depth > DEEP))
    near = np.linalg.norm(np.abs(at) * [1, 0, 0] + at * [0, 1, 1] - BODY, axis=-1) < DEEP
    inside = (pieces > 0) & (pieces == np.bincount(pieces[near & (pieces > 0)]).argmax())
    labels[inside] = np.array(VENTRICLE)[right][inside]
    return labels


def warpbrain(*arguments: object) -> None:
    """Run a command of the tool; leave with its status if it fails."""
    words = [str(argument) for argument in arguments]
    print("$ warpbrain", *words, flush=True)
    done = subprocess.run([sys.executable, "-m", "warpbrain", *words], check=False)
    if done.returncode:
        sys.exit(done.returncode)


if __name__ == "__main__":
    main()
