"""A segmentation as an image program wrote it: whole-number labels on a grid, and where that grid lies in the world."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError

Floats = NDArray[np.float64]
Integers = NDArray[np.int32]

#: Voxels beyond which a volume is refused: it would not fit the memory of an ordinary machine.
MOST_VOXELS = 10**9
#: Millimetres of the units that a NIfTI header can name; most programs leave it unknown and mean millimetres.
_MILLIMETRES = {"mm": 1.0, "unknown": 1.0, "meter": 1e3, "micron": 1e-3}
#: sform and qform that put a corner of the image this far apart [mm] are said to disagree.
_DISAGREEMENT = 1.0


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
        NIfTI (`.nii`, `.nii.gz`), or FreeSurfer's `.mgz`; any orientation, any voxel size.

    Raises
    ------
    InputError
        Naming the file, what was found and what was expected.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    image = _load(path)
    affine, notes = _affine(path, image)
    labels = _labels(path, image)
    if not labels.any():
        raise InputError(f"{path}: all {labels.size} voxels are 0: there is nothing to mesh")
    return LabelImage(path, labels, affine, tuple(notes))


def _load(path: Path) -> Any:
    import nibabel

    try:
        image: Any = nibabel.load(path)
    except Exception as error:  # its readers raise whatever their parsers do
        raise InputError(f"{path}: not a NIfTI file that can be read ({_reason(error)})") from None
    if not isinstance(image, nibabel.Nifti1Pair | nibabel.MGHImage):
        raise InputError(f"{path}: expected a NIfTI file (.nii, .nii.gz), found {type(image).__name__}")
    shape = image.shape
    if len(shape) < 3 or any(n != 1 for n in shape[3:]):
        raise InputError(f"{path}: expected one volume of three dimensions, found shape {_times(shape)}")
    if int(np.prod(shape, dtype=np.int64)) > MOST_VOXELS:
        raise InputError(f"{path}: {_times(shape)} voxels are more than {MOST_VOXELS:.0e}: crop or resample the volume")
    if image.get_data_dtype().kind not in "iufb":
        raise InputError(f"{path}: expected whole numbers as labels, found values of type {image.get_data_dtype()}")
    return image


def _labels(path: Path, image: Any) -> Integers:
    try:
        values = np.asarray(image.dataobj)
    except Exception as error:  # gzip, zlib and nibabel all have their own ways to say that a file ends early
        raise InputError(f"{path}: the file is cut short or damaged ({_reason(error)})") from None
    values = values.reshape(values.shape[:3])
    with np.errstate(invalid="ignore"):
        labels = values.astype(np.int32)
    wrong = labels != values
    if wrong.any():
        raise InputError(
            f"{path}: expected whole numbers as labels, found {np.count_nonzero(wrong)} voxels of {wrong.size} "
            f"that are none, such as {values[wrong][0]:g}: a probability map, or resampled with interpolation?"
        )
    if labels.min() < 0:
        raise InputError(f"{path}: expected labels of 0 or more, found {labels.min()}")
    return labels


def _affine(path: Path, image: Any) -> tuple[Floats, list[str]]:
    """From voxels to RAS millimetres, and what there is to say about it."""
    affine = np.array(image.affine, dtype=np.float64)
    notes: list[str] = []
    header = image.header
    if "sform_code" in header:
        codes = [int(header["sform_code"]), int(header["qform_code"])]
        if codes == [0, 0]:
            raise InputError(
                f"{path}: does not say where its voxels are (sform and qform code 0): save it again from 3D Slicer or "
                "with the affine of the image it was made from"
            )
        if all(codes) and (apart := _apart(header, image.shape)) > _DISAGREEMENT:
            notes.append(f"sform and qform of {path.name} disagree by up to {apart:.0f} mm: the sform is used")
        affine[:3] *= _unit(path, header, notes)
    finite = np.isfinite(affine).all()
    edges = np.linalg.norm(affine[:3, :3], axis=0) if finite else np.zeros(3)
    # of the volume that voxels of such edges would have at right angles
    if not finite or edges.min() == 0 or abs(np.linalg.det(affine[:3, :3])) < 1e-3 * edges.prod():
        raise InputError(f"{path}: its affine is singular or not finite, voxels have no place: {affine[:3].tolist()}")
    return affine, notes


def _apart(header: Any, shape: Iterable[int]) -> float:
    """Largest distance between where sform and qform put the corners of the image, in its units."""
    corners = np.array(np.meshgrid(*[(0, n - 1) for n in list(shape)[:3]])).reshape(3, -1)
    difference = header.get_sform() - header.get_qform()
    return float(np.linalg.norm(difference[:3, :3] @ corners + difference[:3, 3:], axis=0).max())


def _unit(path: Path, header: Any, notes: list[str]) -> float:
    try:
        unit = header.get_xyzt_units()[0]
    except KeyError:
        found = int(header["xyzt_units"])
        raise InputError(f"{path}: unknown unit of length (xyzt_units {found}); expected mm, meter or micron") from None
    if unit not in ("mm", "unknown"):
        notes.append(f"{path.name} is in units of {unit}: converted to mm")
    return _MILLIMETRES[unit]


def _times(shape: Iterable[int]) -> str:
    return " x ".join(str(n) for n in shape)


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
