"""Label volumes that tests write: an ellipsoid of white matter in one of grey matter, around a ventricle."""

from pathlib import Path

import nibabel
import numpy as np
from numpy.typing import NDArray

#: Half axes [mm] of grey matter, white matter and ventricle, and their labels.
HALF_AXES = {2: (48.0, 58.0, 46.0), 3: (36.0, 45.0, 34.0), 4: (15.0, 24.0, 14.0)}
CENTRE = np.array([10.0, -20.0, 5.0])
NAMES = "2=grey,3=white,4=ventricle"


def volume_of(label: int) -> float:
    """Volume [m3] that a label has, in closed form."""
    outer = 4e-9 / 3 * np.pi * np.prod(HALF_AXES[label])
    return float(outer - (volume_of(label + 1) + sum(volume_of(k) for k in range(label + 2, 5)) if label < 4 else 0))


def grid_affine(voxel: tuple[float, ...], shape: tuple[int, ...], turn: NDArray[np.float64] | None = None) -> NDArray:
    """Affine of a grid of voxels [mm] whose middle is `CENTRE`, its axes turned by a rotation or reflection."""
    affine = np.eye(4)
    affine[:3, :3] = (np.eye(3) if turn is None else turn) @ np.diag(voxel)
    affine[:3, 3] = CENTRE - affine[:3, :3] @ ((np.array(shape) - 1) / 2)
    return affine


def ellipsoids(affine: NDArray, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Labels on a grid, by the positions of the voxel centres."""
    index = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1)
    world = index @ affine[:3, :3].T + affine[:3, 3] - CENTRE
    labels = np.zeros(shape, dtype=np.uint8)
    for label, axes in HALF_AXES.items():
        labels[((world / np.array(axes)) ** 2).sum(axis=-1) < 1] = label
    return labels


def write_labels(path: Path, labels: NDArray, affine: NDArray, unit: str = "mm") -> Path:
    image = nibabel.Nifti1Image(labels, affine)
    image.header.set_xyzt_units(unit)
    nibabel.save(image, path)
    return path


def write_ellipsoids(
    path: Path,
    voxel: tuple[float, ...] = (3.0, 3.0, 3.0),
    shape: tuple[int, ...] = (40, 42, 40),
    turn: NDArray[np.float64] | None = None,
) -> Path:
    affine = grid_affine(voxel, shape, turn)
    return write_labels(path, ellipsoids(affine, shape), affine)
