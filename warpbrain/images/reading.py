"""Images as image programs write them: values on a grid, and where that grid lies in the world.

NIfTI (`.nii`, `.nii.gz`) and FreeSurfer's volumes (`.mgz`, `.mgh`) are read by nibabel, other formats (`.nrrd`,
`.nhdr`, `.mha`, `.mhd`) by SimpleITK. A DICOM series is converted to NIfTI first (`dcm2niix`).
"""

import importlib.util
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Int32s
from warpbrain.errors import InputError
from warpbrain.images.grid import Grid

#: Voxels beyond which a volume is refused: it would not fit the memory of an ordinary machine.
MOST_VOXELS = 10**9
#: Endings of files that SimpleITK reads; everything else is nibabel's.
BY_ITK = (".nrrd", ".nhdr", ".mha", ".mhd")
#: Millimetres of the units that a NIfTI header can name; most programs leave it unknown and mean millimetres.
_MILLIMETRES = {"mm": 1.0, "unknown": 1.0, "meter": 1e3, "micron": 1e-3}
#: sform and qform that put a corner of the image this far apart [mm] are said to disagree.
_DISAGREEMENT = 1.0


@dataclass(frozen=True, eq=False)
class Image:
    """Values and where they are."""

    path: Path  # the file they came from
    values: NDArray[Any]  # (i, j, k), as the file has them, scaled as it says
    grid: Grid
    notes: tuple[str, ...] = ()  # what the user should know about how the file was read


def require(package: str, what: str) -> None:
    """Stop with a plain sentence if a package that only images need is missing."""
    if importlib.util.find_spec(package) is None:
        raise InputError(f"{what} needs {package}, not installed here: pip install 'warpbrain[images]'")


def read_image(path: Path) -> Image:
    """Read one volume of real or whole numbers; any orientation, any voxel size.

    `InputError`, naming the file, what was found and what was expected.
    """
    if path.is_dir():
        raise InputError(
            f"{path}: found a folder, expected a volume: of a DICOM series make one with dcm2niix -z y -o OUT {path}"
        )
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    return _with_itk(path) if path.suffix.lower() in BY_ITK else _with_nibabel(path)


def labels_of(image: Image) -> Int32s:
    """The labels (i, j, k) of an image, zero is background.

    `InputError` if its values are not all whole numbers of zero or more.
    """
    path, values = image.path, image.values
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


def _with_itk(path: Path) -> Image:
    require("SimpleITK", f"{path}: a {path.suffix} volume")
    import SimpleITK as sitk

    try:
        header = sitk.ImageFileReader()
        header.SetFileName(str(path))
        header.ReadImageInformation()
        components = header.GetNumberOfComponents()
        shape = header.GetSize()
        if components != 1 or header.GetDimension() != 3:
            raise InputError(
                f"{path}: expected one volume of three dimensions, found shape {_times(shape)} with {components} "
                "value(s) a voxel; a segmentation of overlapping segments is exported from 3D Slicer as a labelmap"
            )
        _check_count(path, shape)
        image = sitk.ReadImage(str(path))
    except RuntimeError as error:
        detail = " ".join(str(error).split()).rpartition("ERROR: ")[2] or type(error).__name__
        raise InputError(f"{path}: not a volume that SimpleITK can read ({detail[:200]})") from None
    affine = np.eye(4)
    affine[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
    affine[:3, 3] = image.GetOrigin()
    # ITK's axes are LPS whatever the file's are
    affine[:2] *= -1.0
    values = sitk.GetArrayFromImage(image).transpose(2, 1, 0)
    return Image(path, np.ascontiguousarray(values), Grid(values.shape, checked_affine(path, affine)))


def _with_nibabel(path: Path) -> Image:
    require("nibabel", f"{path}: a volume")
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
    _check_count(path, shape)
    if image.get_data_dtype().kind not in "iufb":
        raise InputError(
            f"{path}: expected real or whole numbers, such as labels, found values of type {image.get_data_dtype()}"
        )
    affine, notes = _affine(path, image)
    try:
        values = np.asarray(image.dataobj)
    except Exception as error:  # gzip, zlib and nibabel all have their own ways to say that a file ends early
        raise InputError(f"{path}: the file is cut short or damaged ({_reason(error)})") from None
    i, j, k = values.shape[:3]
    return Image(path, values.reshape(i, j, k), Grid((i, j, k), affine), tuple(notes))


def _check_count(path: Path, shape: Iterable[int]) -> None:
    count = int(np.prod(list(shape), dtype=np.int64))
    if count == 0:
        raise InputError(f"{path}: found no voxels ({_times(shape)})")
    if count > MOST_VOXELS:
        raise InputError(f"{path}: {_times(shape)} voxels are more than {MOST_VOXELS:.0e}: crop or resample the volume")


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
        if all(codes):
            # at the corners of the image
            corners = np.array(np.meshgrid(*[(0, n - 1) for n in image.shape[:3]])).reshape(3, -1)
            difference = header.get_sform() - header.get_qform()
            apart = np.linalg.norm(difference[:3, :3] @ corners + difference[:3, 3:], axis=0).max()
            if apart > _DISAGREEMENT:
                notes.append(f"sform and qform of {path.name} disagree by up to {apart:.0f} mm: the sform is used")
        try:
            unit = header.get_xyzt_units()[0]
        except KeyError:
            code = int(header["xyzt_units"])
            raise InputError(
                f"{path}: unknown unit of length (xyzt_units {code}); expected mm, meter or micron"
            ) from None
        if unit not in ("mm", "unknown"):
            notes.append(f"{path.name} is in units of {unit}: converted to mm")
        affine[:3] *= _MILLIMETRES[unit]
    return checked_affine(path, affine), notes


def checked_affine(path: Path, affine: Floats) -> Floats:
    """The affine; `InputError` if it gives voxels no place."""
    finite = np.isfinite(affine).all()
    edges = np.linalg.norm(affine[:3, :3], axis=0) if finite else np.zeros(3)
    # of the volume that voxels of such edges would have at right angles
    if not finite or edges.min() == 0 or abs(np.linalg.det(affine[:3, :3])) < 1e-3 * edges.prod():
        raise InputError(f"{path}: its affine is singular or not finite, voxels have no place: {affine[:3].tolist()}")
    return affine


def _times(shape: Iterable[int]) -> str:
    return " x ".join(str(n) for n in shape)


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
