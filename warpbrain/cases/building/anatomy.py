"""Smooth fields whose zero levels are the surfaces of the brain.

Three fields on the template grid, each positive inside what it describes: the brain with its ventricles filled in, the
lateral ventricles, and white matter. They are probability maps smoothed to what a mesh of 7 to 10 mm can show: gyri
stay as gentle relief, deep sulci close, the longitudinal fissure stays open as a groove.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.building.maps import TemplateMaps, load_maps

Field = NDArray[np.float32]

# all lengths in mm = voxels of the template
PRE_SMOOTHING = 2.5
BRAIN_SMOOTHING = 2.5
WHITE_SMOOTHING = 4.0
VENTRICLE_SMOOTHING = 2.0
# ventricles: fluid this deep inside the brain mask; shallower fluid is sulci and cisterns
VENTRICLE_DEPTH = 10.0
# the septum between the bodies, thinner than any element and here and there absent in the average, becomes fluid:
# sheets of tissue thinner than twice this do
SEPTUM = 4.0
# level of the smoothed ventricle indicator: below one half, so that the thin frontal horns survive the smoothing
VENTRICLE_LEVEL = 0.33
# how much a voxel of outer fluid outweighs a voxel of tissue: opens the wide sulci, the Sylvian fissure and the
# cleft over the cerebellum, which averaging over subjects has blurred
FLUID_WEIGHT = 0.5
# the longitudinal fissure, blurred shut in the template, is cut as a groove: half width at the top, and depth. Both are
# more than nature's half millimetre and less than its 40 mm, so that elements of 10 mm can follow it
FISSURE_HALF_WIDTH = 5.5
FISSURE_DEPTH = 16.0
# the stem of the Sylvian fissure likewise, between temporal pole and frontal lobe: a plane, its half width, and where
# it opens, from back to front and from the middle to the side
SYLVIAN_POINT = np.array([45.0, 10.0, -13.0])
SYLVIAN_NORMAL = np.array([0.0, 0.45, 0.89])
SYLVIAN_HALF_WIDTH = 4.5
SYLVIAN_FROM_BACK = (2.0, 12.0)
SYLVIAN_FROM_MIDDLE = (18.0, 26.0)
# strands thinner and clefts narrower than twice these are smoothed away
THINNEST_TISSUE = 3.0
NARROWEST_CLEFT = 3.5
# islands of white or grey matter smaller than this [mm3] are given to what surrounds them
SMALLEST_ISLAND = 3000.0


@dataclass(frozen=True)
class Anatomy:
    """Fields on the template grid; see the module.

    Attributes
    ----------
    brain, ventricle, white : (i, j, k) float32 arrays
        Positive inside; the surface is the zero level.
    origin : (3,) array
        Position of voxel (0, 0, 0) [mm].
    """

    brain: Field
    ventricle: Field
    white: Field
    origin: NDArray[np.float64]

    def sample(self, field: Field, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (n,) of a field at points (n, 3) [mm], trilinear."""
        from scipy.ndimage import map_coordinates

        return np.asarray(map_coordinates(field, (points - self.origin).T, order=1, mode="nearest", output=np.float64))


@cache
def template_anatomy() -> Anatomy:
    """Fields of the template brain: the same for all cases, and half a minute of smoothing."""
    maps = load_maps()
    fluid = _lateral_ventricles(maps)
    brain = _brain(maps, fluid)
    ventricle = _ventricle(fluid)
    white = _white(maps, (brain > 0) & (ventricle < 0))
    return Anatomy(brain, ventricle, white, maps.origin)


def _lateral_ventricles(maps: TemplateMaps) -> NDArray[np.bool_]:
    """The lateral ventricles: the deep component of fluid whose middle lies above the thalami."""
    from scipy import ndimage

    fluid = maps.brain & (maps.grey + maps.white < 0.5)
    deep = fluid & (ndimage.distance_transform_edt(maps.brain) > VENTRICLE_DEPTH)
    number, count = ndimage.label(deep)
    sizes = ndimage.sum_labels(deep, number, np.arange(1, count + 1))
    # a point of each body: 13 mm to the side of the middle plane, as high as the corpus callosum
    x, y, z = maps.axes()
    body = (np.abs(np.abs(x) - 13) < 6) & (np.abs(y + 15) < 25) & (np.abs(z - 20) < 8)
    inside = ndimage.sum_labels(deep & body, number, np.arange(1, count + 1))
    return np.asarray(number == 1 + int(np.argmax(np.where(sizes > 1000, inside, 0))))


def _brain(maps: TemplateMaps, ventricles: NDArray[np.bool_]) -> Field:
    from scipy import ndimage

    tissue = maps.grey + maps.white
    fluid = np.where(ventricles, 0, np.clip(1 - tissue, 0, 1)) * maps.brain
    solid = np.where(ventricles, 1, tissue) - FLUID_WEIGHT * fluid
    field = ndimage.gaussian_filter(solid.astype(np.float32), PRE_SMOOTHING) - np.float32(0.5)
    body = _largest(field > 0)
    body = _grown(_largest(_grown(body, -THINNEST_TISSUE)), THINNEST_TISSUE)
    body = _grown(_grown(body, NARROWEST_CLEFT), -NARROWEST_CLEFT)
    # fluid pockets that the smoothing has closed off become tissue
    body = ndimage.binary_fill_holes(_largest(body & ~_clefts(maps)))
    smooth = ndimage.gaussian_filter(body.astype(np.float32), BRAIN_SMOOTHING)
    return np.asarray(smooth - np.float32(0.5))


def _clefts(maps: TemplateMaps) -> NDArray[np.bool_]:
    """Longitudinal fissure and Sylvian stems."""
    from scipy import ndimage

    x, y, z = maps.axes()
    hull = ndimage.gaussian_filter(maps.brain.astype(np.float32), 4.0) > 0.5
    depth = ndimage.distance_transform_edt(hull)
    # above the tentorium only, fading in over 15 mm: brain stem and cerebellum have no such fissure
    half_width = FISSURE_HALF_WIDTH * np.sqrt(np.clip(1 - depth / FISSURE_DEPTH, 0, 1)) * np.clip((z + 15) / 15, 0, 1)
    fissure = np.abs(x) < half_width
    height = (y - SYLVIAN_POINT[1]) * SYLVIAN_NORMAL[1] + (z - SYLVIAN_POINT[2]) * SYLVIAN_NORMAL[2]
    opening = _ramp(y, SYLVIAN_FROM_BACK) * _ramp(np.abs(x), SYLVIAN_FROM_MIDDLE)
    sylvian = (np.abs(height) < SYLVIAN_HALF_WIDTH * opening) & (z < 0)
    return np.asarray(fissure | sylvian)


def _ramp(values: NDArray[np.float64], ends: tuple[float, float]) -> NDArray[np.float64]:
    return np.asarray(np.clip((values - ends[0]) / (ends[1] - ends[0]), 0, 1))


def _grown(region: NDArray[np.bool_], by: float) -> NDArray[np.bool_]:
    """A region and all within a distance of it; less all within that distance of its outside if negative."""
    from scipy import ndimage

    if by < 0:
        return np.asarray(ndimage.distance_transform_edt(region) > -by)
    return np.asarray(ndimage.distance_transform_edt(~region) <= by)


def _ventricle(fluid: NDArray[np.bool_]) -> Field:
    from scipy import ndimage

    closed = _grown(_grown(fluid, SEPTUM), -SEPTUM)
    field = ndimage.gaussian_filter(closed.astype(np.float32), VENTRICLE_SMOOTHING) - np.float32(VENTRICLE_LEVEL)
    crumbs = (field > 0) & ~_largest(field > 0, keep=2, smallest=1000)
    return np.asarray(np.where(crumbs, -np.abs(field), field), dtype=np.float32)


def _white(maps: TemplateMaps, inside: NDArray[np.bool_]) -> Field:
    """White matter by majority among tissue only, so that the interface meets fluid squarely, without slivers."""
    from scipy import ndimage

    white = ndimage.gaussian_filter(maps.white, WHITE_SMOOTHING)
    tissue = ndimage.gaussian_filter(maps.white + maps.grey, WHITE_SMOOTHING)
    share = (white / np.maximum(tissue, 1e-3)).astype(np.float32)
    # a cortex of at least about 5 mm over the hemispheres: less cannot be meshed at this size
    depth = ndimage.distance_transform_edt(ndimage.binary_fill_holes(inside))
    share *= np.clip((depth - 2.0) / 6.0, 0, 1)
    field = (share - 0.5).astype(np.float32)
    for sign in (1, -1):
        region = (sign * field > 0) & inside
        island = region & ~_largest(region, keep=1000, smallest=SMALLEST_ISLAND)
        field = np.where(ndimage.binary_dilation(island, iterations=2), -sign * np.abs(field), field)
    return np.asarray(ndimage.gaussian_filter(field, 1.0))


def _largest(region: NDArray[np.bool_], keep: int = 1, smallest: float = 0.0) -> NDArray[np.bool_]:
    """The `keep` largest components of a region that have at least `smallest` voxels."""
    from scipy import ndimage

    number, count = ndimage.label(region)
    sizes = np.bincount(number.ravel(), minlength=count + 1)
    sizes[0] = 0
    chosen = np.argsort(-sizes, kind="stable")[:keep]
    return np.asarray(np.isin(number, chosen[sizes[chosen] >= max(smallest, 1)]))
