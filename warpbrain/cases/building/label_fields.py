"""From labels to smooth fields whose zero levels are the surfaces of a segmentation.

Labels become regions that can be meshed: cropped, in one piece, without voids. The indicator of each region is smoothed
to what elements of the wanted size can show. Smoothing alone would shrink whatever is curved or thin, so levels and
weights are set such that every region keeps the volume that its labels have.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from warpbrain.arrays import Bools, Ints, Singles
from warpbrain.cases.building.tissue_names import Assignment
from warpbrain.errors import InputError
from warpbrain.images.grid import Grid
from warpbrain.images.reading import Image, labels_of, read_image

Codes = NDArray[np.uint8]

OUTSIDE = 0
#: Tissues are 1, 2, ... in the order of the assignment.
CAVITY = 255
#: Volumes of what is labelled in a scan [mm3]: from a small rodent's brain to a phantom larger than any head.
SMALLEST, LARGEST = 1e3, 1e7


def read_labels(path: Path) -> Image:
    """Read a label volume of any format of `read_image`; `InputError` says what is wrong with it."""
    image = read_image(path)
    labels = labels_of(image)
    if not labels.any():
        raise InputError(f"{path}: all {labels.size} voxels are 0: there is nothing to mesh")
    return replace(image, values=labels)


def label_volumes(image: Image) -> dict[int, float]:
    """Volume of each label but the background [mm3], in the order of the labels."""
    values, counts = np.unique(image.values, return_counts=True)
    pairs = zip(values.tolist(), counts.tolist(), strict=True)
    return {label: count * image.grid.voxel_volume for label, count in pairs if label != 0}


@dataclass(frozen=True, eq=False)
class Regions:
    """What every voxel is."""

    #: (i, j, k): `OUTSIDE`, a tissue from 1 on, or `CAVITY`; the voxels at the edge of the grid are outside.
    codes: Codes
    grid: Grid
    tissues: int  # how many there are
    #: Volume [mm3] that the user's labels give to each tissue and to `CAVITY`, before anything was mended.
    labelled: dict[int, float]
    notes: tuple[str, ...]  # what was mended


def make_regions(image: Image, assignment: Assignment) -> Regions:
    """Sort the voxels of a volume into tissues, cavities and outside.

    Pieces apart from the largest are left out, and unlabelled voids inside get the nearest label: both are noted.

    `InputError` if the volume is none that a brain can have.
    """
    code_of = {number: code for code, number in enumerate(assignment.tissues, 1)}
    codes_of = {label: code_of[number] for label, number in assignment.number.items()}
    codes_of |= dict.fromkeys(assignment.cavity, CAVITY)
    # the smallest box that holds everything labelled, and a voxel around it
    box = ndimage.find_objects(np.isin(image.values, list(codes_of)).astype(np.int8))[0]
    labels = image.values[box]
    codes: Codes = np.zeros(labels.shape, dtype=np.uint8)
    for label, code in codes_of.items():
        codes[labels == label] = code
    codes = np.pad(codes, 1)
    affine = image.grid.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ np.array([side.start - 1 for side in box])
    unit = image.grid.voxel_volume
    counts = np.bincount(codes.ravel(), minlength=256)
    labelled = {int(code): float(counts[code]) * unit for code in np.flatnonzero(counts) if code != OUTSIDE}
    if not SMALLEST <= (volume := sum(labelled.values())) <= LARGEST:
        raise InputError(
            f"{image.path}: what is labelled has a volume of {volume / 1000:.4g} cm3, expected {SMALLEST / 1000:.4g} "
            f"cm3 to {LARGEST / 1000:.4g} cm3: are its lengths in millimetres?"
        )
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
            ~inside, sampling=image.grid.voxel, return_distances=False, return_indices=True
        )
        codes[void] = codes[tuple(nearest[:, void])]
        notes.append(
            f"{ndimage.label(void)[1]} unlabelled voids inside ({np.count_nonzero(void) * unit / 1000:.3g} cm3) are "
            "filled with the nearest label"
        )
    return Regions(codes, Grid(codes.shape, affine), len(assignment.tissues), labelled, tuple(notes))


# standard deviation of the smoothing: share of the element size, and at least this many voxels along each axis of the
# image, without which slices would show as steps
SMOOTHING = 0.35
FEWEST_VOXELS = 0.7
# voxels finer than this share of the element size are averaged in blocks first, coarser ones than that are split
FINEST, COARSEST = 0.25, 0.4
# how far the level of the outer surface and of the cavities may move from one half to keep the volume, and by what
# factor a tissue may be favoured over its neighbours
LEVELS = (0.3, 0.7)
FAVOUR = 3.0
BALANCING = 12


@dataclass(frozen=True, eq=False)
class LabelFields:
    """Fields on a grid in the world; see the module."""

    #: (i, j, k), positive inside the body with its cavities, and inside the cavities.
    body: Singles
    cavity: Singles
    tissues: list[Singles]  # (i, j, k), presence of each tissue, favours included: the largest one rules
    grid: Grid
    in_place: dict[int, float]  # share of the voxels of each tissue, and of `CAVITY`, that the fields give to it


def make_fields(regions: Regions, size: float) -> LabelFields:
    """Fields for elements of a size [mm]."""
    voxel = regions.grid.voxel
    blocks = np.maximum(np.floor(FINEST * size / voxel), 1).astype(int)
    splits = np.maximum(np.ceil(voxel / (COARSEST * size)), 1).astype(int)
    # grid steps in voxels of the image
    step = blocks / splits
    sigma = np.maximum(SMOOTHING * size / voxel, FEWEST_VOXELS) / step
    margin = np.ceil(4 * sigma).astype(int) + 1
    affine = regions.grid.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ ((step - 1) / 2 - step * margin)
    affine[:3, :3] *= step

    def shares(code: int) -> Singles:
        return np.pad(_resampled(regions.codes == code, blocks, splits), [(m, m) for m in margin])

    codes = (*range(1, regions.tissues + 1), CAVITY)
    smoothed: list[Singles] = []
    volumes: list[float] = []
    for code in codes:
        share = shares(code)
        volumes.append(float(share.sum(dtype=np.float64)))
        smoothed.append(np.asarray(ndimage.gaussian_filter(share, sigma, truncate=4.0)))
    *tissues, fluid = smoothed
    solid = np.sum(tissues, axis=0, dtype=np.float32)
    body = _levelled(solid + fluid, np.ones(solid.shape, dtype=bool), sum(volumes))
    inside = body > 0
    # by majority among what is inside, so that the wall of a cavity that opens meets the outer surface squarely
    cavity = _levelled(fluid / np.maximum(solid + fluid, np.float32(1e-3)), inside, volumes[-1])
    tissue = inside & (cavity <= 0)
    weights = _balanced([field[tissue] for field in tissues], volumes[:-1])
    for field, weight in zip(tissues, weights, strict=True):
        field *= np.float32(weight)
    in_place = {}
    ruling = np.argmax(tissues, axis=0)
    for code, volume in zip(codes, volumes, strict=True):
        ruled = inside & (cavity > 0) if code == CAVITY else tissue & (ruling == code - 1)
        if volume > 0:
            in_place[code] = float(shares(code)[ruled].sum(dtype=np.float64)) / volume
    return LabelFields(body, cavity, tissues, Grid(body.shape, affine), in_place)


def _resampled(region: Bools, blocks: Ints, splits: Ints) -> Singles:
    """Share of a region in blocks of voxels, or in parts of voxels, along each axis."""
    for axis, parts in enumerate(splits.tolist()):
        region = np.repeat(region, parts, axis=axis)
    region = np.pad(region, [(0, -n % b) for n, b in zip(region.shape, blocks.tolist(), strict=True)])
    for axis, block in enumerate(blocks.tolist()):
        shape = (*region.shape[:axis], -1, block, *region.shape[axis + 1 :])
        region = region.reshape(shape).mean(axis=axis + 1, dtype=np.float32)
    return np.asarray(region, dtype=np.float32)


def _levelled(field: Singles, where: Bools, count: float) -> Singles:
    """The field less the level that `count` of the grid points `where` exceed, if it is near one half."""
    values = field[where]
    rank = len(values) - min(max(round(count), 1), len(values))
    ends = [max(rank - 1, 0), rank]
    # between the last point that is to lie inside and the first that is not
    level = float(np.clip(np.partition(values, ends)[ends].mean(), *LEVELS))
    return np.asarray(field - np.float32(level))


def _balanced(tissues: list[Singles], volumes: list[float]) -> list[float]:
    """Weights with which each tissue, present at points (n,), rules as many of them as its volume asks for, as far as
    `FAVOUR` allows."""
    weights = np.ones(len(tissues))
    wanted = np.array(volumes) / sum(volumes) * len(tissues[0])
    for _ in range(BALANCING):
        best, ruler = np.zeros_like(tissues[0]), np.zeros(len(tissues[0]), dtype=np.int16)
        for code, field in enumerate(tissues):
            better = field * np.float32(weights[code]) > best
            best[better] = field[better] * np.float32(weights[code])
            ruler[better] = code
        ruled = np.maximum(np.bincount(ruler, minlength=len(tissues)), 1)
        # the square root damps: thin sheets answer strongly
        weights *= np.sqrt(wanted / ruled)
        weights = np.clip(weights / np.exp(np.log(weights).mean()), 1 / FAVOUR, FAVOUR)
    return weights.tolist()
