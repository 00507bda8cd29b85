"""What was observed, as plain data in SI units and RAS axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False, kw_only=True)
class Recording:
    """What all recordings have.

    Attributes
    ----------
    name : str
    file : str
        File it came from, relative to the case folder.
    role : {"fit", "check"}
        A ``"check"`` recording is never fitted, only scored.
    sigma : float or None
        Noise of one component, one standard deviation, in the unit of what was recorded (m, N, Pa or N m); None: to be
        estimated.
    """

    kind: ClassVar[str]
    name: str
    file: str
    role: str = "fit"
    sigma: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class PointsRecording(Recording):
    """Tracked points: where each was and how far it went.

    Attributes
    ----------
    points, displacement : (n, 3) array
        [m]
    time : (n,) array or None
        [s]
    ids : tuple of n str, or None
    sigmas : (n,) array or None
        Noise of one component of each point [m]; takes precedence over `sigma`.
    weights : (n,) array or None
    outside : {"error", "nearest"}
        What a point farther outside the mesh than a local edge is: a mistake, or observed at the nearest point of it.
    moved_file : str or None
        Where the second positions came from, if start and end are files of their own (Slicer markups).
    """

    kind: ClassVar[str] = "points"
    points: Floats
    displacement: Floats
    time: Floats | None = None
    ids: tuple[str, ...] | None = None
    sigmas: Floats | None = None
    weights: Floats | None = None
    outside: str = "error"
    moved_file: str | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceRecording(Recording):
    """Points on a moved surface, unpaired: compared with the moved faces of a node set.

    Attributes
    ----------
    points : (n, 3) array
        [m]
    nodes : str
        Name of the node set whose faces are the surface.
    normals : (n, 3) array or None
        Unit normals.
    faces : (k, 3) int array or None
        Triangles, if a surface mesh was recorded.
    time : (n,) array or None
        [s]
    """

    kind: ClassVar[str] = "surface"
    points: Floats
    nodes: str
    normals: Floats | None = None
    faces: Ints | None = None
    time: Floats | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceRecording(Recording):
    """The resultant with which a boundary acts on the tissue.

    Attributes
    ----------
    boundary : str
        Name of the boundary.
    time : (n,) array
        [s], increasing.
    force : (n, 3) array
        [N]; a component that was not recorded is NaN throughout.
    torque : (n,) array or None
        [N m]
    """

    kind: ClassVar[str] = "force"
    boundary: str
    time: Floats
    force: Floats
    torque: Floats | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class TestRecording(Recording):
    """A laboratory test on a specimen: what was imposed and what it answered.

    Attributes
    ----------
    mode : {"axial", "shear", "torsion"}
    quantities : (str, str)
        ``("displacement", "force")`` [m, N], ``("stretch", "stress")`` [1, Pa nominal] or ``("angle", "torque")``
        [rad, N m].
    imposed, response : (n,) array
    time : (n,) array or None
        [s], increasing.
    specimen : str
        Which one was tested, where tests of a case are of several of one shape; empty: the one.
    axis, sheared : (float, float, float)
        Directions of the tissue along the machine's axis z, and along its x, in which it shears; of any length but
        zero. Of `sheared` what is across the axis counts.
    """

    # not a test of pytest's
    __test__ = False
    kind: ClassVar[str] = "test"
    mode: str
    quantities: tuple[str, str]
    imposed: Floats
    response: Floats
    time: Floats | None = None
    specimen: str = ""
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    sheared: tuple[float, float, float] | None = None

    @property
    def turn(self) -> Floats:
        """Rotation (3, 3) from directions of the tissue to those of the machine: `R axis = z`.

        Without `sheared` the machine's x is the tissue's, or its y where that is along the axis, less what of it is
        along the axis.
        """
        z = np.array(self.axis) / np.linalg.norm(self.axis)
        x = np.eye(3)[int(abs(z[0]) > 1.0 - 1e-9)] if self.sheared is None else np.array(self.sheared)
        x = x - (x @ z) * z
        x = x / np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z])
