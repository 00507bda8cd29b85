"""A segmentation as an image program wrote it: whole-number labels on a grid, and where that grid lies in the world."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError
from warpbrain.images.labels import labels_of
from warpbrain.images.reading import read_image

Floats = NDArray[np.float64]
Integers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class LabelImage:
    """Labels and where they are.

    Attributes
    ----------
    path : Path
        The file they came from.
    labels : (i, j, k) int32 array
        Zero is background.
    affine : (4, 4) array
        From voxel numbers to positions [mm, RAS]; voxel numbers mean voxel centres.
    notes : tuple of str
        What the user should know about how the file was read.
    """

    path: Path
    labels: Integers
    affine: Floats
    notes: tuple[str, ...] = ()

    @property
    def voxel(self) -> Floats:
        """Edges (3,) of a voxel [mm]."""
        return np.asarray(np.linalg.norm(self.affine[:3, :3], axis=0))

    @property
    def voxel_volume(self) -> float:
        """Volume of a voxel [mm3]."""
        return float(abs(np.linalg.det(self.affine[:3, :3])))

    def volumes(self) -> dict[int, float]:
        """Volume of each label but the background [mm3], in the order of the labels."""
        values, counts = np.unique(self.labels, return_counts=True)
        pairs = zip(values.tolist(), counts.tolist(), strict=True)
        return {label: count * self.voxel_volume for label, count in pairs if label != 0}


def read_labels(path: Path) -> LabelImage:
    """Read a label volume.

    Parameters
    ----------
    path : Path
        What `read_image` reads: NIfTI, FreeSurfer's `.mgz`, `.nrrd`; any orientation, any voxel size.

    Raises
    ------
    InputError
        Naming the file, what was found and what was expected.
    """
    image = read_image(path)
    labels = labels_of(image)
    if not labels.any():
        raise InputError(f"{path}: all {labels.size} voxels are 0: there is nothing to mesh")
    return LabelImage(path, labels, image.grid.affine, image.notes)
