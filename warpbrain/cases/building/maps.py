"""The anatomy everything is made from: the ICBM152 2009a template maps inside the installed nilearn wheel."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.errors import BuildError

_FOLDER = "datasets/data"
_FILE = "mni_icbm152_{}_tal_nlin_sym_09a_converted.nii.gz"
# voxels of air added on every side, so that no filter and no surface meets the edge of the image
PADDING = 14


@dataclass(frozen=True)
class TemplateMaps:
    """Template maps on their 1 mm grid, padded with air.

    Attributes
    ----------
    brain : (i, j, k) bool array
        Everything inside the skull-stripped T1 template: tissue, ventricles and outer cerebrospinal fluid.
    grey, white : (i, j, k) float32 arrays
        Probability of grey and white matter, 0 to 1.
    origin : (3,) array
        Position of voxel (0, 0, 0) [mm, MNI, RAS]; voxels are 1 mm and the axes are aligned.
    """

    brain: NDArray[np.bool_]
    grey: NDArray[np.float32]
    white: NDArray[np.float32]
    origin: NDArray[np.float64]

    def axes(self) -> tuple[NDArray[np.float64], ...]:
        """Voxel coordinates x, y, z [mm], shaped to broadcast: (i, 1, 1), (1, j, 1), (1, 1, k)."""
        return np.meshgrid(
            *(np.arange(n) + o for n, o in zip(self.brain.shape, self.origin, strict=True)), indexing="ij", sparse=True
        )


def load_maps() -> TemplateMaps:
    """Read the maps from the installed nilearn wheel, without importing nilearn."""
    import nibabel

    # nilearn itself would bring scikit-learn and pandas with it; its files are all that is needed
    spec = importlib.util.find_spec("nilearn")
    if spec is None or not spec.submodule_search_locations:
        raise BuildError("nilearn is not installed: pip install 'warpbrain[build]'")
    folder = Path(spec.submodule_search_locations[0]) / _FOLDER
    images: dict[str, Any] = {}
    for kind in ("t1", "gm", "wm"):
        path = folder / _FILE.format(kind)
        if not path.is_file():
            raise BuildError(f"the installed nilearn has no {_FOLDER}/{path.name}; version 0.14.1 has it")
        images[kind] = nibabel.load(path)
    affine = images["t1"].affine
    if not np.array_equal(affine[:3, :3], np.eye(3)):
        raise BuildError(f"expected template maps with 1 mm voxels along RAS axes, found affine {affine.tolist()}")
    t1, grey, white = (np.pad(np.asarray(images[kind].dataobj), PADDING) for kind in ("t1", "gm", "wm"))
    return TemplateMaps(
        brain=t1 > 0,
        grey=(grey / np.float32(255)).astype(np.float32),
        white=(white / np.float32(255)).astype(np.float32),
        origin=affine[:3, 3] - PADDING,
    )
