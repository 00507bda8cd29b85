"""From labels to regions that can be meshed: cropped, in one piece, without voids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.label_image import LabelImage
from warpbrain.cases.building.plausible import check_volume
from warpbrain.cases.building.tissue_names import Assignment

Floats = NDArray[np.float64]
Codes = NDArray[np.uint8]

OUTSIDE = 0
#: Tissues are 1, 2, ... in the order of the assignment.
CAVITY = 255


@dataclass(frozen=True, eq=False)
class Regions:
    """What every voxel is.

    Attributes
    ----------
    codes : (i, j, k) uint8 array
        `OUTSIDE`, a tissue from 1 on, or `CAVITY`; the voxels at the edge of the grid are outside.
    affine : (4, 4) array
        From voxel numbers to positions [mm, RAS].
    tissues : int
        How many there are.
    labelled : dict of int to float
        Volume [mm3] that the user's labels give to each tissue and to `CAVITY`, before anything was mended.
    notes : tuple of str
        What was mended.
    """

    codes: Codes
    affine: Floats
    tissues: int
    labelled: dict[int, float]
    notes: tuple[str, ...]

    @property
    def voxel(self) -> Floats:
        """Edges (3,) of a voxel [mm]."""
        return np.asarray(np.linalg.norm(self.affine[:3, :3], axis=0))

    @property
    def voxel_volume(self) -> float:
        """Volume of a voxel [mm3]."""
        return float(abs(np.linalg.det(self.affine[:3, :3])))


def make_regions(image: LabelImage, assignment: Assignment) -> Regions:
    """Sort the voxels of a volume into tissues, cavities and outside.

    Pieces apart from the largest are left out, and unlabelled voids inside get the nearest label: both are noted.

    Raises
    ------
    InputError
        If the volume is none that a brain can have.
    """
    from scipy import ndimage

    codes, affine = _cropped(image, assignment)
    unit = image.voxel_volume
    counts = np.bincount(codes.ravel(), minlength=256)
    labelled = {int(code): float(counts[code]) * unit for code in np.flatnonzero(counts) if code != OUTSIDE}
    check_volume(f"{image.path}: what is labelled", sum(labelled.values()) * 1e-9)
    notes = []
    piece, count = ndimage.label(codes != OUTSIDE)
    if count > 1:
        sizes = np.bincount(piece.ravel())[1:]
        dropped = int(sizes.sum() - sizes.max())
        notes.append(
            f"the labels are {count} pieces that do not touch: the largest is meshed, {dropped * unit / 1000:.3g} cm3 "
            f"({100 * dropped / sizes.sum():.2g} %) are left out"
        )
        codes[piece != 1 + sizes.argmax()] = OUTSIDE
    inside = codes != OUTSIDE
    void = ndimage.binary_fill_holes(inside) & ~inside
    if void.any():
        nearest = ndimage.distance_transform_edt(
            ~inside, sampling=image.voxel, return_distances=False, return_indices=True
        )
        codes[void] = codes[tuple(nearest[:, void])]
        notes.append(
            f"{ndimage.label(void)[1]} unlabelled voids inside ({np.count_nonzero(void) * unit / 1000:.3g} cm3) are "
            "filled with the nearest label"
        )
    return Regions(codes, affine, len(assignment.tissues), labelled, tuple(notes))


def _cropped(image: LabelImage, assignment: Assignment) -> tuple[Codes, Floats]:
    """Codes of the smallest box that holds everything labelled and a voxel around it, and the affine of that box."""
    code = {number: 1 + at for at, number in enumerate(assignment.tissues)}
    codes_of = {label: code[number] for label, number in assignment.number.items()}
    codes_of |= dict.fromkeys(assignment.cavity, CAVITY)
    used = np.isin(image.labels, list(codes_of))
    box = []
    for axis in range(3):
        along = np.flatnonzero(used.any(axis=tuple(a for a in range(3) if a != axis)))
        box.append(slice(int(along[0]), int(along[-1]) + 1))
    labels = image.labels[tuple(box)]
    codes = np.zeros(labels.shape, dtype=np.uint8)
    for label, value in codes_of.items():
        codes[labels == label] = value
    affine = image.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ np.array([side.start - 1 for side in box])
    return np.pad(codes, 1), affine
