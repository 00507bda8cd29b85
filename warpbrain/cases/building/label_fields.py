"""Smooth fields whose zero levels are the surfaces of a segmentation.

The indicator of each region is smoothed to what elements of the wanted size can show. Smoothing alone would shrink
whatever is curved or thin, so levels and weights are set such that every region keeps the volume that its labels have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.label_regions import CAVITY, Regions

Floats = NDArray[np.float64]
Field = NDArray[np.float32]
Bools = NDArray[np.bool_]

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
    """Fields on a grid in the world; see the module.

    Attributes
    ----------
    body, cavity : (i, j, k) float32 arrays
        Positive inside the body with its cavities, and inside the cavities.
    tissues : list of (i, j, k) float32 arrays
        Presence of each tissue, favours included: the largest one rules.
    affine : (4, 4) array
        From grid numbers to positions [mm, RAS].
    in_place : dict of int to float
        Share of the voxels of each tissue, and of `CAVITY`, that the fields give to it.
    """

    body: Field
    cavity: Field
    tissues: list[Field]
    affine: Floats
    in_place: dict[int, float]

    def sample(self, field: Field, points: Floats) -> Floats:
        """Values (n,) of a field at points (n, 3) [mm, RAS], trilinear."""
        from scipy.ndimage import map_coordinates

        back = np.linalg.inv(self.affine)
        at = back[:3, :3] @ points.T + back[:3, 3:]
        return np.asarray(map_coordinates(field, at, order=1, mode="nearest", output=np.float64))

    def box(self) -> tuple[Floats, Floats]:
        """Corners (3,) and (3,) [mm, RAS] of a box along the world's axes around the body."""
        grid = np.argwhere(self.body > 0)
        world = grid @ self.affine[:3, :3].T + self.affine[:3, 3]
        return world.min(axis=0), world.max(axis=0)


def make_fields(regions: Regions, size: float) -> LabelFields:
    """Fields for elements of a size [mm]."""
    blocks = np.maximum(np.floor(FINEST * size / regions.voxel), 1).astype(int)
    splits = np.maximum(np.ceil(regions.voxel / (COARSEST * size)), 1).astype(int)
    # grid steps in voxels of the image
    step = blocks / splits
    sigma = np.maximum(SMOOTHING * size / regions.voxel, FEWEST_VOXELS) / step
    margin = np.ceil(4 * sigma).astype(int) + 1
    affine = regions.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ ((step - 1) / 2 - step * margin)
    affine[:3, :3] *= step

    def shares(code: int) -> Field:
        return np.pad(_resampled(regions.codes == code, blocks, splits), [(m, m) for m in margin])

    def smooth(share: Field) -> Field:
        from scipy.ndimage import gaussian_filter

        return np.asarray(gaussian_filter(share, sigma, truncate=4.0))

    codes = range(1, regions.tissues + 1)
    tissues, volumes = [], []
    for code in codes:
        share = shares(code)
        volumes.append(float(share.sum(dtype=np.float64)))
        tissues.append(smooth(share))
    hollow = shares(CAVITY)
    fluid = smooth(hollow)
    hollow_volume = float(hollow.sum(dtype=np.float64))
    solid = np.sum(tissues, axis=0, dtype=np.float32)
    body = _levelled(solid + fluid, np.ones(solid.shape, dtype=bool), sum(volumes) + hollow_volume)
    inside = body > 0
    # by majority among what is inside, so that the wall of a cavity that opens meets the outer surface squarely
    cavity = _levelled(fluid / np.maximum(solid + fluid, np.float32(1e-3)), inside, hollow_volume)
    tissue = inside & (cavity <= 0)
    weights = _balanced([field[tissue] for field in tissues], volumes)
    for field, weight in zip(tissues, weights, strict=True):
        field *= np.float32(weight)
    in_place = {}
    ruling = np.argmax(tissues, axis=0)
    for code in (*codes, CAVITY):
        share = hollow if code == CAVITY else shares(code)
        ruled = inside & (cavity > 0) if code == CAVITY else tissue & (ruling == code - 1)
        if (total := float(share.sum(dtype=np.float64))) > 0:
            in_place[code] = float(share[ruled].sum(dtype=np.float64)) / total
    return LabelFields(body, cavity, tissues, affine, in_place)


def _resampled(region: Bools, blocks: NDArray[np.int64], splits: NDArray[np.int64]) -> Field:
    """Share of a region in blocks of voxels, or in parts of voxels, along each axis."""
    for axis, parts in enumerate(splits.tolist()):
        region = np.repeat(region, parts, axis=axis)
    region = np.pad(region, [(0, -n % b) for n, b in zip(region.shape, blocks.tolist(), strict=True)])
    for axis, block in enumerate(blocks.tolist()):
        shape = (*region.shape[:axis], -1, block, *region.shape[axis + 1 :])
        region = region.reshape(shape).mean(axis=axis + 1, dtype=np.float32)
    return np.asarray(region, dtype=np.float32)


def _levelled(field: Field, where: Bools, count: float) -> Field:
    """The field less the level that `count` of the grid points `where` exceed, if it is near one half."""
    values = field[where]
    rank = len(values) - min(max(round(count), 1), len(values))
    ends = [max(rank - 1, 0), rank]
    # between the last point that is to lie inside and the first that is not
    level = float(np.clip(np.partition(values, ends)[ends].mean(), *LEVELS))
    return np.asarray(field - np.float32(level))


def _balanced(tissues: list[Field], volumes: list[float]) -> list[float]:
    """Weights with which each tissue rules as much of the points as it should, as far as `FAVOUR` allows.

    Parameters
    ----------
    tissues : list of (n,) float32 arrays
        Presence of each tissue at the points.
    volumes : list of float
        Wanted numbers of points, up to a common factor.
    """
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
