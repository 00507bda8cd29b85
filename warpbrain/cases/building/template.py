"""The template brain: smooth fields whose zero levels are its surfaces, what a surgeon takes of it, and individuals.

Three fields on the grid of the ICBM152 2009a template maps inside the installed nilearn wheel, each positive inside
what it describes: the brain with its ventricles filled in, the lateral ventricles, and white matter. They are
probability maps smoothed to what a mesh of 7 to 10 mm can show: gyri stay as gentle relief, deep sulci close, the
longitudinal fissure stays open as a groove.
"""

import importlib.util
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from warpbrain.arrays import Bools, Floats, Singles
from warpbrain.errors import InputError
from warpbrain.images.grid import Grid

_FOLDER = "datasets/data"
_FILE = "mni_icbm152_{}_tal_nlin_sym_09a_converted.nii.gz"
# voxels of air added on every side, so that no filter and no surface meets the edge of the image
PADDING = 14


@dataclass(frozen=True)
class _Maps:
    """Template maps on their grid of 1 mm, padded with air: `brain` is everything inside the skull-stripped T1
    template, tissue, ventricles and outer fluid; `grey` and `white` are probabilities; `axes` are the coordinates x, y,
    z [mm, MNI, RAS] of voxels, shaped to broadcast."""

    brain: Bools
    grey: Singles
    white: Singles
    grid: Grid
    axes: tuple[Floats, ...]


def _load_maps() -> _Maps:
    """Read the maps from the installed nilearn wheel, without importing nilearn."""
    import nibabel

    # nilearn itself would bring scikit-learn and pandas with it; its files are all that is needed
    spec = importlib.util.find_spec("nilearn")
    if spec is None or not spec.submodule_search_locations:
        raise InputError("nilearn is not installed: pip install 'warpbrain[build]'")
    folder = Path(spec.submodule_search_locations[0]) / _FOLDER
    images: dict[str, Any] = {}
    for kind in ("t1", "gm", "wm"):
        path = folder / _FILE.format(kind)
        if not path.is_file():
            raise InputError(f"the installed nilearn has no {_FOLDER}/{path.name}; version 0.14.1 has it")
        images[kind] = nibabel.load(path)
    affine = images["t1"].affine
    if not np.array_equal(affine[:3, :3], np.eye(3)):
        raise InputError(f"expected template maps with 1 mm voxels along RAS axes, found affine {affine.tolist()}")
    t1, *maps = (np.pad(np.asarray(images[kind].dataobj), PADDING) for kind in ("t1", "gm", "wm"))
    grey, white = ((values / np.float32(255)).astype(np.float32) for values in maps)
    origin = affine[:3, 3] - PADDING
    affine = np.eye(4)
    affine[:3, 3] = origin
    along = (np.arange(n) + o for n, o in zip(t1.shape, origin, strict=True))
    return _Maps(t1 > 0, grey, white, Grid(t1.shape, affine), np.meshgrid(*along, indexing="ij", sparse=True))


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
    """Fields (i, j, k) on the template grid [mm, MNI, RAS], positive inside; the surface is the zero level."""

    brain: Singles
    ventricle: Singles
    white: Singles
    grid: Grid


@cache
def template_anatomy() -> Anatomy:
    """Fields of the template brain: the same for all cases, and half a minute of smoothing."""
    maps = _load_maps()
    fluid = _lateral_ventricles(maps)
    brain = _brain(maps, fluid)
    ventricle = _ventricle(fluid)
    white = _white(maps, (brain > 0) & (ventricle < 0))
    return Anatomy(brain, ventricle, white, maps.grid)


def _lateral_ventricles(maps: _Maps) -> Bools:
    """The lateral ventricles: the deep component of fluid whose middle lies above the thalami."""
    fluid = maps.brain & (maps.grey + maps.white < 0.5)
    deep = fluid & (ndimage.distance_transform_edt(maps.brain) > VENTRICLE_DEPTH)
    number, count = ndimage.label(deep)
    sizes = ndimage.sum_labels(deep, number, np.arange(1, count + 1))
    # a point of each body: 13 mm to the side of the middle plane, as high as the corpus callosum
    x, y, z = maps.axes
    body = (np.abs(np.abs(x) - 13) < 6) & (np.abs(y + 15) < 25) & (np.abs(z - 20) < 8)
    inside = ndimage.sum_labels(deep & body, number, np.arange(1, count + 1))
    return np.asarray(number == 1 + int(np.argmax(np.where(sizes > 1000, inside, 0))))


def _brain(maps: _Maps, ventricles: Bools) -> Singles:
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


def _clefts(maps: _Maps) -> Bools:
    """Longitudinal fissure and Sylvian stems."""
    x, y, z = maps.axes
    hull = ndimage.gaussian_filter(maps.brain.astype(np.float32), 4.0) > 0.5
    depth = ndimage.distance_transform_edt(hull)
    # above the tentorium only, fading in over 15 mm: brain stem and cerebellum have no such fissure
    half_width = FISSURE_HALF_WIDTH * np.sqrt(np.clip(1 - depth / FISSURE_DEPTH, 0, 1)) * np.clip((z + 15) / 15, 0, 1)
    fissure = np.abs(x) < half_width
    height = (y - SYLVIAN_POINT[1]) * SYLVIAN_NORMAL[1] + (z - SYLVIAN_POINT[2]) * SYLVIAN_NORMAL[2]
    opening = _ramp(y, SYLVIAN_FROM_BACK) * _ramp(np.abs(x), SYLVIAN_FROM_MIDDLE)
    sylvian = (np.abs(height) < SYLVIAN_HALF_WIDTH * opening) & (z < 0)
    return np.asarray(fissure | sylvian)


def _ramp(values: Floats, ends: tuple[float, float]) -> Floats:
    return np.asarray(np.clip((values - ends[0]) / (ends[1] - ends[0]), 0, 1))


def _grown(region: Bools, by: float) -> Bools:
    """A region and all within a distance of it; less all within that distance of its outside if negative."""
    if by < 0:
        return np.asarray(ndimage.distance_transform_edt(region) > -by)
    return np.asarray(ndimage.distance_transform_edt(~region) <= by)


def _ventricle(fluid: Bools) -> Singles:
    closed = _grown(_grown(fluid, SEPTUM), -SEPTUM)
    field = ndimage.gaussian_filter(closed.astype(np.float32), VENTRICLE_SMOOTHING) - np.float32(VENTRICLE_LEVEL)
    crumbs = (field > 0) & ~_largest(field > 0, keep=2, smallest=1000)
    return np.asarray(np.where(crumbs, -np.abs(field), field), dtype=np.float32)


def _white(maps: _Maps, inside: Bools) -> Singles:
    """White matter by majority among tissue only, so that the interface meets fluid squarely, without slivers."""
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


def _largest(region: Bools, keep: int = 1, smallest: float = 0.0) -> Bools:
    """The `keep` largest components of a region that have at least `smallest` voxels."""
    number, count = ndimage.label(region)
    sizes = np.bincount(number.ravel(), minlength=count + 1)
    sizes[0] = 0
    chosen = np.argsort(-sizes, kind="stable")[:keep]
    return np.asarray(np.isin(number, chosen[sizes[chosen] >= max(smallest, 1)]))


# template millimetres. Posterior margin: a plane across the lobe, leaning with its axis
MARGIN_POINT = np.array([45.0, -4.5, -28.0])
LOBE_AXIS = np.array([0.0, 0.90, -0.44])
# medial margin: lateral of the uncus and the brain stem
MEDIAL = 21.0
# the upper margin is the plane of the Sylvian fissure
# corners between the margins are rounded over about this length [mm]
ROUNDING = 3.0


def anterior_temporal_lobe(points: Floats, side: str) -> Floats:
    """About the distance (n,) [mm] of points (n, 3) [mm, template, RAS] to the margin of an anterior temporal lobe
    resection on the ``"left"`` (negative x) or ``"right"``, positive in the tissue that the surgeon takes."""
    mirrored = points * np.array([-1.0 if side == "left" else 1.0, 1.0, 1.0])
    behind = (mirrored - MARGIN_POINT) @ LOBE_AXIS
    medial = mirrored[:, 0] - MEDIAL
    below = -(mirrored - SYLVIAN_POINT) @ SYLVIAN_NORMAL
    margins = np.stack([behind, medial, below])
    # a smooth minimum: the wall of the cavity has no crease
    return np.asarray(-ROUNDING * np.logaddexp.reduce(-margins / ROUNDING, axis=0))


# three octaves at most one wavelength in this length [mm]: shape, not surface relief
SHORTEST_WAVELENGTH = 90.0
WAVES = 24
# many small steps along a steady velocity field: what the exact flow would be, a diffeomorphism, to rounding
STEPS = 32


def individual(points: Floats, seed: int, amplitude: float) -> Floats:
    """Where points (n, 3) [mm] of the template are in an individual brain: (n, 3) [mm].

    The deformation is smooth and invertible: the flow for unit time of a velocity field that is a sum of long sine
    waves. `seed`: same seed, same deformation. `amplitude`: root mean square displacement in space [mm].
    """
    random = np.random.default_rng(seed)
    direction = random.normal(size=(WAVES, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    # wavelengths from the shortest to four times that
    wavelength = SHORTEST_WAVELENGTH * 4 ** random.random(WAVES)
    wave = direction * (2 * np.pi / wavelength)[:, None]
    phase = 2 * np.pi * random.random(WAVES)
    polarisation = random.normal(size=(WAVES, 3))
    # mean square of a unit sine is one half
    polarisation *= amplitude / np.sqrt((polarisation**2).sum() / 2)
    moved = np.array(points, dtype=np.float64)
    for _ in range(STEPS):
        half = moved + np.sin(moved @ wave.T + phase) @ polarisation / (2 * STEPS)
        moved += np.sin(half @ wave.T + phase) @ polarisation / STEPS
    return moved
