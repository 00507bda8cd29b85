"""What a state says about a recording: how far what was computed is from what was observed.

The one number of that is the root mean square of the 3-D distance over all recorded rows: every row counts once, with
no weight, and none is set aside. Of a tracked point it is the distance from where it was recorded, of a point of a
surface the distance to the computed surface. Forces and pressures are rows of their own units and stand apart.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats, Ints
from warpbrain.errors import InputError
from warpbrain.mesh.free_surfaces import faces_of_set
from warpbrain.mesh.tet_mesh import TetMesh
from warpbrain.recordings.closest import closest_points
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording, SurfaceRecording


def root_mean_square(residuals: ArrayLike) -> float:
    """`sqrt(mean |r|^2)` of residual vectors (n, d) or distances (n,), in their unit.

    Examples
    --------
    >>> root_mean_square([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]]) ** 2
    12.5
    """
    return float(np.sqrt(np.mean(lengths(residuals) ** 2)))


def lengths(residuals: ArrayLike) -> Floats:
    """`|r|` (n,) of residual vectors (n, d) or distances (n,); components that were not recorded are NaN."""
    values = np.asarray(residuals, dtype=np.float64)
    return np.sqrt(np.nansum(values**2, axis=1)) if values.ndim == 2 else np.abs(values)


def by_unit(each: Iterable[tuple[str, ArrayLike]]) -> Mapping[str, float]:
    """The root mean square over all rows of several recordings together, by their unit.

    `each`: unit, and residuals (n, d) or distances (n,) of each recording.

    Examples
    --------
    >>> by_unit([("m", [3.0]), ("m", [[0.0, 4.0, 0.0]]), ("N", [2.0])])["m"] ** 2
    12.5
    """
    rows: dict[str, list[Floats]] = {}
    for unit, residuals in each:
        rows.setdefault(unit, []).append(lengths(residuals))
    return {unit: root_mean_square(np.concatenate(some)) for unit, some in rows.items()}


def legacy_error(distances: ArrayLike) -> float:
    """`sqrt(sum_i |r_i| / n)` with lengths in mm: the number that the paper's own code calls its rmse.

    Its unit is the square root of a mm, not mm: it is the root of the mean distance, and no root mean square. It is
    here to stand beside published numbers, and for nothing else.

    `distances` (n,) or residual vectors (n, 3) [m]. Returns [sqrt(mm)].
    """
    return float(np.sqrt(np.mean(1000.0 * lengths(distances))))


@dataclass(frozen=True)
class Error:
    """Distances in four numbers."""

    #: In the unit of the comparison.
    root_mean_square: float
    legacy: float | None  # `legacy_error` [sqrt(mm)], of lengths only
    percentile_95: float
    largest: float

    @classmethod
    def of(cls, residuals: ArrayLike, unit: str = "m") -> "Error":
        """The error of residual vectors (n, 3) or distances (n,)."""
        distances = lengths(residuals)
        return cls(
            root_mean_square(distances),
            legacy_error(distances) if unit == "m" else None,
            float(np.percentile(distances, 95)),
            float(distances.max()),
        )


@dataclass(frozen=True, eq=False)
class Comparison:
    """A recording beside a state."""

    #: Of the recording.
    name: str
    kind: str
    role: str
    unit: str  # of errors and residuals: "m", "N", "N m" or "Pa"
    rows: Ints  # (n,), rows of the recording that were compared
    #: (n, 3), recorded less computed, for each row, with nothing moved (or no force), and with the state. Of a surface:
    #: from its closest point to the recorded one. A component that was not recorded is NaN.
    residuals_before: Floats
    residuals_after: Floats
    #: Of a surface: from each of its nodes to what was recorded; large where only a part of it was recorded.
    reverse_before: Error | None = None
    reverse_after: Error | None = None
    noise: float | None = None  # what the noise alone would leave of the root mean square; None if it is not known

    @property
    def count(self) -> int:
        """Rows that were compared."""
        return len(self.rows)

    @cached_property
    def before(self) -> Error:
        """With nothing moved; of a surface: from each recorded point to the surface."""
        return self._error(self.residuals_before)

    @cached_property
    def after(self) -> Error:
        """With the state."""
        return self._error(self.residuals_after)

    def _error(self, residuals: Floats) -> Error:
        # components count that were recorded throughout
        return Error.of(residuals[:, np.isfinite(self.residuals_before).all(axis=0)], self.unit)


def compare_points(recording: PointsRecording, mesh: TetMesh, u: ArrayLike, rows: Ints) -> Comparison:
    """Compare displacements of tracked points.

    `mesh`: at rest.
    `u` (N, 3): displacement of the nodes [m].
    `rows` (n,): those that are compared, see `rows_at`.
    """
    place = locate(mesh.points, mesh.tetrahedra, recording.points[rows])
    before = recording.displacement[rows]
    after = before - place.interpolate(u)
    squares = recording.sigma**2 if recording.sigma is not None else None
    if recording.sigmas is not None:
        squares = float(np.mean(recording.sigmas[rows] ** 2))
    noise = None if squares is None else float(np.sqrt(3.0 * squares))
    return _comparison(recording, rows, before, after, noise)


def compare_surface(recording: SurfaceRecording, mesh: TetMesh, u: ArrayLike, rows: Ints) -> Comparison:
    """Compare a recorded surface with the moved faces of its node set, both ways.

    Parameters are those of `compare_points`. The way back goes from the nodes of these faces to the recorded triangles,
    or to the nearest recorded points if no triangles were recorded.

    `InputError` if the mesh has no such node set, or no boundary triangle has all its nodes in it.
    """
    points = recording.points[rows]
    faces = faces_of_set(mesh, recording.nodes, f"recording '{recording.name}'")
    members = np.unique(faces)
    residuals, reverse = [], []
    for moved in (mesh.points, mesh.points + np.asarray(u, dtype=np.float64)):
        residuals.append(points - closest_points(points, moved, faces).position)
        if recording.faces is None:
            from scipy.spatial import cKDTree

            back = np.asarray(cKDTree(points).query(moved[members])[0])
        else:
            back = closest_points(moved[members], points, recording.faces).distance
        reverse.append(Error.of(back))
    # noise along a surface is not seen: one component of three is left
    compared = _comparison(recording, rows, residuals[0], residuals[1], recording.sigma)
    return replace(compared, reverse_before=reverse[0], reverse_after=reverse[1])


def compare_force(recording: ForceRecording, reaction: ArrayLike, rows: Ints) -> Comparison:
    """Compare the resultant of a boundary; components that were not recorded do not count.

    `reaction` (3,): force of the boundary on the tissue [N]. `rows`: as in `compare_points`. `InputError` if no
    component of the force was recorded.
    """
    before = recording.force[rows]
    recorded = np.isfinite(before).all(axis=0)
    if not recorded.any():
        raise InputError(f"recording '{recording.name}' has no component of the force, only the torque")
    after = before - np.asarray(reaction, dtype=np.float64).reshape(3)
    noise = None if recording.sigma is None else float(np.sqrt(recorded.sum())) * recording.sigma
    return _comparison(recording, rows, before, after, noise)


def _comparison(recording: Recording, rows: Ints, before: Floats, after: Floats, noise: float | None) -> Comparison:
    unit = recording.noise_unit
    return Comparison(recording.name, recording.kind, recording.role, unit, rows, before, after, noise=noise)


def joined(parts: Sequence[Comparison]) -> Comparison:
    """Comparisons of one recording with states of several times as one; of a surface the way back is of the last."""
    if len(parts) == 1:
        return parts[0]
    noises = [part.noise for part in parts]
    squares = [part.count * noise**2 for part, noise in zip(parts, noises, strict=True) if noise is not None]
    rows, before, after = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("rows", "residuals_before", "residuals_after")
    )
    noise = float(np.sqrt(sum(squares) / len(rows))) if len(squares) == len(parts) else None
    return replace(parts[-1], rows=rows, residuals_before=before, residuals_after=after, noise=noise)
