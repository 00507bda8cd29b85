"""What was observed, as plain data in SI units and RAS axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from warpbrain.errors import InputError

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
    reference: float or None
        Time [s] of the loaded state from which displacements and forces are counted; None: rest.
    """

    kind: ClassVar[str]
    name: str
    file: str
    role: str = "fit"
    sigma: float | None = None
    reference: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackedPoints:
    """What a file tells of tracked points: where each was and how far it went.

    Attributes
    ----------
    points, displacement : (n, 3) array
        [m], RAS.
    time : (n,) array or None
        [s]
    ids : tuple of n str, or None
    sigmas : (n,) array or None
        Noise of one component of each point [m]; takes precedence over that of the recording.
    weights : (n,) array or None
    """

    points: Floats
    displacement: Floats
    time: Floats | None = None
    ids: tuple[str, ...] | None = None
    sigmas: Floats | None = None
    weights: Floats | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class PointsRecording(TrackedPoints, Recording):
    """Tracked points of a case.

    Attributes
    ----------
    outside : {"error", "nearest"}
        What a point farther outside the mesh than a local edge is: a mistake, or observed at the nearest point of it.
    moved_file : str or None
        Where the second positions came from, if start and end are files of their own (Slicer markups).
    """

    kind: ClassVar[str] = "points"
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
    mode : {"axial", "shear", "torsion", "confined", "biaxial"}
        Confined: axial between lubricated walls that let it widen nowhere. Biaxial: stretched alike along x and y, its
        thickness along z free; its stress is along x.
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
    control : {"displacement", "force"}
        What the machine imposed; `sigma` is of what answered.
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
    control: str = "displacement"

    @property
    def force_controlled(self) -> bool:
        """Whether the machine imposed the force: `response` is what was imposed then, and `imposed` what answered."""
        return self.control == "force"

    @property
    def controlled(self) -> tuple[str, Floats]:
        """What the machine imposed: its quantity, and the values (n,)."""
        return (self.quantities[1], self.response) if self.force_controlled else (self.quantities[0], self.imposed)

    @property
    def answer(self) -> tuple[str, Floats]:
        """What the specimen answered with: its quantity, and the values (n,)."""
        return (self.quantities[0], self.imposed) if self.force_controlled else (self.quantities[1], self.response)

    @property
    def turn(self) -> Floats:
        """Rotation (3, 3) from directions of the tissue to those of the machine; raises as `turn_of`."""
        return turn_of(self.axis, self.sheared)


def count_of(recording: Recording) -> int:
    """How many rows, points or instants a recording has."""
    if isinstance(recording, PointsRecording | SurfaceRecording):
        return len(recording.points)
    assert isinstance(recording, ForceRecording | TestRecording)
    return len(recording.response) if isinstance(recording, TestRecording) else len(recording.time)


def turn_of(axis: tuple[float, float, float], sheared: tuple[float, float, float] | None) -> Floats:
    """Rotation `R` (3, 3) of a tissue in a machine: `R axis` is along z, and `R sheared` between x and z.

    Without `sheared` the machine's x is what of the tissue's is across the axis, or of its y where that is little.

    Raises
    ------
    InputError
        If one of them is zero, or they are one direction.
    """
    z = np.array(axis, dtype=np.float64)
    if not np.linalg.norm(z) > 0.0:
        raise InputError("expected 3 numbers that are not all zero")
    z = z / np.linalg.norm(z)
    x = np.eye(3)[int(abs(z[0]) > 0.9)] if sheared is None else np.array(sheared, dtype=np.float64)
    across = x - (x @ z) * z
    if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(x):
        raise InputError("expected a direction that is not along the axis")
    across = across / np.linalg.norm(across)
    return np.stack([across, np.cross(z, across), z])
