"""Volumes, displacement fields and transforms as NIfTI files (`.nii.gz`), whole or not at all."""

import gzip
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Singles
from warpbrain.atomic import whole_file
from warpbrain.frame import AXES
from warpbrain.images.displacement import DisplacementField
from warpbrain.images.grid import Grid

#: NIfTI's codes of vectors that are displacements, in the axes of the header (RAS), and of vectors that are none of its
#: business: ITK turns the former into its own axes (LPS) and takes the latter as they are.
_DISPLACEMENT, _VECTOR = 1006, 1007
#: Of the compression: more effort takes minutes and saves little.
_EFFORT = 2
#: To which displacements are rounded [mm], a power of two: digits that mean nothing do not compress.
_ROUNDED = 2.0**-13


def write_displacement(path: Path, field: DisplacementField) -> None:
    """Write displacements as NIfTI has them: [mm], RAS, at where things were before, five dimensions."""
    write_volume(path, _rounded(field.vectors), field.grid, _DISPLACEMENT)


def write_transform(path: Path, field: DisplacementField) -> None:
    """Write a field as an ITK displacement-field transform: [mm], LPS.

    ITK, ANTs and 3D Slicer resample an image onto this grid by taking at `x` what the image has at `x + field(x)`; a
    point at `x` that is given to the same transform goes to `x + field(x)`, the other way.
    """
    signs = np.array(AXES["LPS"], dtype=np.float32)
    write_volume(path, _rounded(signs * field.vectors), field.grid, _VECTOR)


def _rounded(vectors: Singles) -> Singles:
    """In five dimensions, of which the fourth is time."""
    return (np.rint(vectors / np.float32(_ROUNDED)) * np.float32(_ROUNDED))[:, :, :, None, :]


def write_volume(path: Path, values: NDArray[Any], grid: Grid, intent: int = 0) -> None:
    """Write one value a voxel, or vectors with NIfTI's code of what they are; whole numbers that 32 bits do not hold
    become real ones."""
    import nibabel

    # of all types that hold the values one that every reader of NIfTI has
    kind = {"bool": "uint8", "float16": "float32"}.get(values.dtype.name, values.dtype.name)
    if kind in ("int64", "uint64"):
        limits = np.iinfo(np.int32)
        fits = not values.size or (values.min() >= limits.min and values.max() <= limits.max)
        kind = "int32" if fits else "float64"
    image: Any = nibabel.Nifti1Image(values.astype(kind), grid.affine)
    image.header.set_xyzt_units("mm")
    image.header["intent_code"] = intent
    for place in (image.set_sform, image.set_qform):
        place(grid.affine, code=1)
    # with no time in it the same result is the same file
    with (
        whole_file(path) as scratch,
        scratch.open("wb") as stream,
        gzip.GzipFile("", "wb", _EFFORT, stream, mtime=0) as packed,
    ):
        packed.write(image.to_bytes())
