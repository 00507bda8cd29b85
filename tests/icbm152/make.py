"""Makes the maps of this folder, means over cubes of 4 mm of what nilearn ships: `python tests/icbm152/make.py`.

Their notice is `MNI-NOTICE.txt` beside them.
"""

import gzip
from pathlib import Path

import nibabel
import numpy as np
from nilearn.datasets import load_mni152_gm_template, load_mni152_template, load_mni152_wm_template

#: Voxels of 1 mm along an edge of those here.
EDGE = 4
MAPS = {"t1": load_mni152_template, "gm": load_mni152_gm_template, "wm": load_mni152_wm_template}


def main() -> None:
    """Write them."""
    for name, load in MAPS.items():
        image = load(resolution=1)
        wide = np.pad(image.get_fdata(), [(0, -n % EDGE) for n in image.shape])
        i, j, k = (n // EDGE for n in wide.shape)
        means = wide.reshape(i, EDGE, j, EDGE, k, EDGE).mean(axis=(1, 3, 5))
        affine = image.affine.copy()
        affine[:3, 3] += affine[:3, :3] @ np.full(3, (EDGE - 1) / 2)
        affine[:3, :3] *= EDGE
        small = nibabel.Nifti1Image(means, affine)
        # scaled by what its header says
        small.set_data_dtype(np.uint8)
        path = Path(__file__).parent / f"{name}.nii.gz"
        path.write_bytes(gzip.compress(small.to_bytes(), mtime=0))


if __name__ == "__main__":
    main()
