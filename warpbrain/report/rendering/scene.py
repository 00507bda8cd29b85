"""What is to be rendered of a deformed body, as plain arrays that another process reads."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints

#: Names of the pictures, in the order in which they are rendered.
BEFORE, AFTER, MOTION, AXIAL, CORONAL, SAGITTAL = "before", "after", "motion", "axial", "coronal", "sagittal"
CUTS = {AXIAL: 2, CORONAL: 1, SAGITTAL: 0}
NAMES = (BEFORE, AFTER, MOTION, *CUTS)
#: Colours of Okabe and Ito of what was recorded and of what was computed.
RECORDED, COMPUTED = "#d55e00", "#0072b2"


@dataclass(frozen=True, eq=False)
class Camera:
    """Where a body is seen from, without perspective.

    Attributes
    ----------
    right, up : (3,) array
        Of the picture, in RAS; unit vectors at right angles.
    centre : (3,) array
        In the middle of the picture [mm].
    half_height : float
        Of the picture [mm].
    """

    right: Floats
    up: Floats
    centre: Floats
    half_height: float

    @property
    def towards(self) -> Floats:
        """From the body to the viewer (3,)."""
        return np.cross(self.right, self.up)


@dataclass(frozen=True, eq=False)
class Scene:
    """A body before and after, and what was recorded of it; lengths in mm, axes RAS.

    Attributes
    ----------
    points : (n, 3) array
        Nodes before.
    tetrahedra : (m, 4) int array
    removed : (m,) bool array
        Tetrahedra that are there before, and not after.
    colours : (m, 3) uint8 array
        Of the tissue.
    u : (n, 3) array
        Displacement.
    exaggeration : float
        How many times as far as it moves the body is drawn after.
    corner : (3,) array
        A corner is cut out of the body there, on the side of the viewer.
    places : (3,) array
        Coordinates x, y, z of the three cuts.
    where, recorded, computed : (k, 3) array
        Points, how far they moved, and how far the body moves there; of no points if displacements were not recorded.
    arrows : float
        How many times as long as they are the arrows of `recorded` and `computed` are drawn.
    top : float
        The displacement of the last colour.
    table : (256, 3) uint8 array
        Colours of displacements from zero to `top`.
    """

    points: Floats
    tetrahedra: Ints
    removed: Bools
    colours: Any
    u: Floats
    exaggeration: float
    corner: Floats
    places: Floats
    where: Floats
    recorded: Floats
    computed: Floats
    arrows: float
    top: float
    table: Any

    @property
    def side(self) -> Floats:
        """Signs of the corner that is cut out: where there is most to see, above.

        That is what was removed, else what was recorded, else the left and the front.
        """
        seen = self.points[self.tetrahedra[self.removed]].reshape(-1, 3)
        seen = self.where if not len(seen) else seen
        middle = 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))
        aside = seen.mean(axis=0) - middle if len(seen) else np.zeros(3)
        return np.array([1.0 if aside[0] > 0.0 else -1.0, -1.0 if aside[1] < 0.0 else 1.0, 1.0])


def write_scene(folder: Path, scene: Scene, cameras: Mapping[str, Camera], size: tuple[int, int]) -> None:
    """Write what `read_scene` reads; `size` of each picture is in pixels."""
    np.savez(folder / "scene.npz", **{field.name: getattr(scene, field.name) for field in fields(Scene)})
    said = {
        name: {"right": list(one.right), "up": list(one.up), "centre": list(one.centre), "half": one.half_height}
        for name, one in cameras.items()
    }
    (folder / "cameras.json").write_text(json.dumps({"size": size, "cameras": said}), encoding="utf-8")


def read_scene(folder: Path) -> tuple[Scene, dict[str, Camera], tuple[int, int]]:
    """What `write_scene` wrote."""
    with np.load(folder / "scene.npz") as arrays:
        found = {name: arrays[name][()] for name in arrays.files}
    said = json.loads((folder / "cameras.json").read_text(encoding="utf-8"))
    cameras = {
        name: Camera(np.array(one["right"]), np.array(one["up"]), np.array(one["centre"]), one["half"])
        for name, one in said["cameras"].items()
    }
    return Scene(**found), cameras, tuple(said["size"])
