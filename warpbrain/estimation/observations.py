"""Recordings of a case beside a state: residuals, and how they change with it.

A residual is what was recorded less what was computed, each row at its time (`warpbrain.cases.moments`), less what was
computed at the time from which it is counted. Recordings whose role is ``"fit"`` are one thing, those to ``"check"``
with another: no function here looks at both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.cases.enough import too_few_for_noise
from warpbrain.cases.moments import Moments
from warpbrain.errors import InputError
from warpbrain.estimation.registration import moved_back, moved_back_columns
from warpbrain.estimation.within_element import change_over_element
from warpbrain.mesh import TetMesh
from warpbrain.mesh.feature_normals import feature_normals
from warpbrain.recordings.closest import closest_points
from warpbrain.recordings.comparison import faces_of_set
from warpbrain.recordings.copies import distinct_rows
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording, SurfaceRecording
from warpbrain.recordings.times import compared_rows, rows_at, times_of

#: Sets of points whose places in a mesh are kept, the latest ones.
_KEPT = 16


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one recording at a state, with d components a row.

    Attributes
    ----------
    values : (n, d) array
        Of points 3 components [m]; of a surface the signed distance [m]; of a force those recorded [N].
    rigid : (n, d, 6) array
        Derivatives of the values by a rigid motion of what was recorded (`registration`), with another sign.
    directions : (n, d, 3) array
        Along which lengths are; zero of forces.
    by_displacement, by_reactions : (n d, 3 N) SciPy CSR
        Derivatives of what was computed by displacement and reactions at its time; with another sign, by those at the
        time of the reference.
    after, before : (n,) int array
        Numbers of the states (`Moments`) that each row is compared with, and counted from; -1: from rest.
    """

    values: Floats
    rigid: Floats
    directions: Floats
    by_displacement: Any
    by_reactions: Any
    after: Ints
    before: Ints

    def derivative(self, du: Floats, dR: Floats) -> Floats:
        """From derivatives of displacement and reactions (p, s N, 3) in s states to those of the values (n, d, p)."""
        count, size, components = len(du), self.by_displacement.shape[1], self.values.shape[1]
        u, R = du.reshape(count, -1, size), dR.reshape(count, -1, size)
        total = np.zeros((self.values.size, count))
        for number in range(u.shape[1]):
            share = (self.after == number) * 1.0 - (self.before == number)
            if share.any():
                change = np.asarray(self.by_displacement @ u[:, number].T + self.by_reactions @ R[:, number].T)
                total -= np.repeat(share, components)[:, None] * change
        return total.reshape(*self.values.shape, count)


@dataclass(frozen=True, eq=False)
class Observation:
    """One recording.

    Attributes
    ----------
    name, kind, unit : str
    rows : (n,) int array
        Rows of the recording that count; the first of those that are copies of each other.
    sigma : (n,) array or None
        Standard deviation of one component of each row; None: to be estimated.
    weights : (n,) array
        Where sigma is estimated, the variance of a row is its square over this; else it is in `sigma` already.
    size : int
        Components of a row.
    positions : (k, 3) array
        What a wrong registration moves [m]; empty for forces.
    edges : (n,) array
        Mean length of the edges of the element in which each point is [m]; zero of all but points.
    over_element : (n, size, 3) array
        Of `change_over_element`; zero of all but points.
    times, references : (n,) array
        When each row was recorded, and the time from which it is counted [s]: infinity is the end, 0 is rest.
    at : callable
        From displacement and reactions (s N, 3) in s states, one after the other, the centre of a rigid motion (3,) and
        that motion (6,) to `Residuals`.
    """

    name: str
    kind: str
    unit: str
    rows: Ints
    sigma: Floats | None
    weights: Floats
    size: int
    positions: Floats
    edges: Floats
    over_element: Floats
    times: Floats
    references: Floats
    at: Callable[[Floats, Floats, Floats, Floats], Residuals]


@dataclass(frozen=True, eq=False)
class Observations:
    """Recordings of a case of one role.

    Attributes
    ----------
    recordings : tuple of Observation
    remarks : tuple of str
        Recordings that say nothing of tissue, and why.
    """

    recordings: tuple[Observation, ...]
    remarks: tuple[str, ...]

    @classmethod
    def to_fit(cls, case: Case, moments: Moments | None = None) -> Observations:
        """The recordings that a case is fitted to.

        Parameters
        ----------
        case : Case
        moments : Moments, optional
            States that there are; those of all times at which something was recorded unless given.

        Raises
        ------
        InputError
            If there are none, none of them says anything of tissue, a noise is not positive, or one that is to be
            estimated has too few residuals for that.
        """
        if not any(recording.role == "fit" for recording in case.recordings):
            checks = f"; its {len(case.recordings)} have role = 'check'" if case.recordings else ""
            raise InputError(f"{case.path}: no [[recording]] to estimate from{checks}")
        found = cls._of(case, "fit", moments)
        if not found.recordings:
            raise InputError(f"{case.path}: nothing to estimate from: {'; '.join(found.remarks)}")
        for recording in case.recordings:
            if recording.role == "fit" and (why := too_few_for_noise(case, recording)):
                raise InputError(why)
        return found

    @classmethod
    def to_check(cls, case: Case, moments: Moments | None = None) -> Observations:
        """The recordings that only score what was estimated without them; as `to_fit`."""
        return cls._of(case, "check", moments)

    @classmethod
    def _of(cls, case: Case, role: str, moments: Moments | None) -> Observations:
        moments = Moments.recorded(case) if moments is None else moments
        each, remarks = [], []
        for recording in case.recordings:
            if recording.role != role:
                continue
            if isinstance(recording, ForceRecording) and isinstance(case.boundary(recording.boundary), Forced):
                remarks.append(
                    f"recording '{recording.name}' says nothing of tissue: the force of '{recording.boundary}' is given"
                )
                continue
            if recording.reference is not None and recording.reference not in moments.times:
                remarks.append(
                    f"recording '{recording.name}' is counted from {recording.reference:g} s, and tissue that goes on "
                    "by itself is looked at in the end alone"
                )
                continue
            each.append((recording, _observation(case, recording, moments)))
        return cls(_with_changes(each), tuple(remarks))

    @property
    def centre(self) -> Floats:
        """Mean of all positions that were recorded [m], zero if there are none."""
        positions = np.concatenate([observation.positions for observation in self.recordings])
        return positions.mean(axis=0) if len(positions) else np.zeros(3)

    def at(
        self, u: Floats, reactions: Floats, centre: Floats | None = None, motion: Floats | None = None
    ) -> tuple[Residuals, ...]:
        """Residuals of each recording at a state.

        Parameters
        ----------
        u : (s N, 3) array
            Displacement [m] in s states, one after the other.
        reactions : (s N, 3) array
            Of the constrained components [N].
        centre : (3,) array, optional
            Of a rigid motion [m]; that of these recordings by default.
        motion : (6,) array, optional
            By which what was recorded was moved, see `registration`; by nothing by default.
        """
        about = self.centre if centre is None else centre
        by = np.zeros(6) if motion is None else motion
        return tuple(observation.at(u, reactions, about, by) for observation in self.recordings)


#: From a displacement and reactions (N, 3), a centre and a motion: what `Residuals` begins with, of some rows.
_At = Callable[[Floats, Floats, Floats, Floats], tuple[Floats, Floats, Floats, Any, Any]]


@dataclass(frozen=True, eq=False)
class _Part:
    """Rows of a recording that are compared with one state."""

    rows: Ints
    weights: Floats
    size: int
    positions: Floats
    edges: Floats
    at: _At


def _observation(case: Case, recording: Recording, moments: Moments) -> Observation:
    makers: dict[type[Recording], tuple[str, Callable[[Case, Any, Ints], _Part]]] = {
        PointsRecording: ("m", _points),
        SurfaceRecording: ("m", _surface),
        ForceRecording: ("N", _force),
    }
    if type(recording) not in makers:
        raise InputError(f"recording '{recording.name}': a {recording.kind} is of a specimen, not of a deformed body")
    unit, make = makers[type(recording)]
    rows, times = compared_rows(recording), times_of(recording)
    if not set(times[rows].tolist()) <= set(moments.times):
        # of a body that goes on by itself there is an end alone
        rows = rows_at(recording)  # type: ignore[arg-type]
        times = np.full(len(times), np.inf)
    if len(rows) == 0:
        zero = isinstance(recording, PointsRecording) and recording.weights is not None
        reason = "the weight of every point is zero" if zero else "no row is of a time after 0 s"
        raise InputError(f"recording '{recording.name}': {reason}")
    states = np.array([moments.number(time) for time in times[rows].tolist()])
    start = -1 if recording.reference is None else moments.number(recording.reference)
    numbers = np.unique(states).tolist()
    parts = [make(case, recording, rows[states == number]) for number in numbers]
    rows = np.concatenate([part.rows for part in parts])
    weights = np.concatenate([part.weights for part in parts])
    after = np.repeat(numbers, [len(part.rows) for part in parts])
    before = np.full(len(rows), start)

    def at(u: Floats, reactions: Floats, centre: Floats, motion: Floats) -> Residuals:
        from scipy.sparse import vstack

        size = len(case.remaining[0].points)
        fields = np.stack([u.reshape(-1, size, 3), reactions.reshape(-1, size, 3)])
        blocks = []
        for number, part in zip(numbers, parts, strict=True):
            moved = fields[:, number] if start < 0 else fields[:, number] - fields[:, start]
            blocks.append(part.at(moved[0], moved[1], centre, motion))
        values, rigid, directions = (np.concatenate([block[k] for block in blocks]) for k in range(3))
        by_displacement, by_reactions = (
            blocks[0][k] if len(blocks) == 1 else vstack([block[k] for block in blocks]).tocsr() for k in (3, 4)
        )
        return Residuals(values, rigid, directions, by_displacement, by_reactions, after, before)

    return Observation(
        recording.name,
        recording.kind,
        unit,
        rows,
        _sigma(recording, rows, weights),
        weights,
        parts[0].size,
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.edges for part in parts]),
        np.zeros((len(rows), parts[0].size, 3)),
        times[rows],
        np.full(len(rows), recording.reference or 0.0),
        at,
    )


def _points(case: Case, recording: PointsRecording, rows: Ints) -> _Part:
    from scipy.sparse import csr_matrix

    mesh = case.remaining[0]
    rows, weights = distinct_rows(recording, rows)
    if not (np.isfinite(weights) & (weights >= 0.0)).all():
        raise InputError(f"recording '{recording.name}': a weight is negative or no number")
    rows, weights = rows[weights > 0.0], weights[weights > 0.0]
    matrix, by_displacement, edges = _located(mesh, recording.points[rows].astype(np.float64).tobytes())
    nothing = csr_matrix(by_displacement.shape)
    positions = recording.points[rows] + recording.displacement[rows]

    directions = np.tile(np.eye(3), (len(rows), 1, 1))

    def at(u: Floats, _reactions: Floats, centre: Floats, motion: Floats) -> tuple[Floats, Floats, Floats, Any, Any]:
        displacement = moved_back(positions, motion, centre) - recording.points[rows]
        rigid = -moved_back_columns(positions, motion, centre)
        return displacement - matrix @ u, rigid, directions, by_displacement, nothing

    return _Part(rows, weights, 3, positions, edges, at)


@lru_cache(maxsize=_KEPT)
def _located(mesh: TetMesh, points: bytes) -> tuple[Any, Any, Floats]:
    """From values at nodes to those at points, given as bytes of (n, 3) [m]: SciPy CSR (n, N) and (3 n, 3 N).

    With them the mean length of the edges of each point's element (n,) [m].

    Recordings that are taken to have been moved are of the same points of the body each time.
    """
    from scipy.sparse import eye, kron

    location = locate(mesh.points, mesh.tetrahedra, np.frombuffer(points).reshape(-1, 3))
    matrix = location.matrix(len(mesh.points))
    return matrix, kron(matrix, eye(3), format="csr"), location.edge


def _surface(case: Case, recording: SurfaceRecording, rows: Ints) -> _Part:
    from scipy.sparse import csr_matrix

    mesh = case.remaining[0]
    positions = recording.points[rows]
    faces = faces_of_set(mesh, recording.nodes, f"recording '{recording.name}'")
    size = float(np.ptp(mesh.points, axis=0).max())
    shape = (len(rows), 3 * len(mesh.points))

    def at(u: Floats, _reactions: Floats, centre: Floats, motion: Floats) -> tuple[Floats, Floats, Floats, Any, Any]:
        moved, points = mesh.points + u, moved_back(positions, motion, centre)
        closest = closest_points(points, moved, faces)
        nodes, weights = faces[closest.face], closest.weights
        # by a face's normal the side would depend on which of the faces at an edge is found, and that on rounding
        normals = feature_normals(moved, faces)[0][closest.face, closest.features]
        offset = points - closest.position
        side = np.where(np.einsum("ni,ni->n", offset, normals) < 0.0, -1.0, 1.0)
        apart = closest.distance > 1e-12 * size
        # off an edge of the surface the distance grows along the offset, which is no face's normal
        directions = np.where(
            apart[:, None], side[:, None] * offset / np.where(apart, closest.distance, 1.0)[:, None], normals
        )

        # the closest point moves along the surface too, which does not change its distance to first order
        shares = weights[:, :, None] * directions[:, None, :]
        columns = 3 * nodes[:, :, None] + np.arange(3)
        by_displacement = csr_matrix((shares.ravel(), (np.repeat(np.arange(len(rows)), 9), columns.ravel())), shape)
        rigid = -np.einsum("nj,njk->nk", directions, moved_back_columns(positions, motion, centre))[:, None, :]
        values = (side * closest.distance)[:, None]
        return values, rigid, directions[:, None, :], by_displacement, csr_matrix(shape)

    return _Part(rows, np.ones(len(rows)), 1, positions, np.zeros(len(rows)), at)


def _force(case: Case, recording: ForceRecording, rows: Ints) -> _Part:
    from scipy.sparse import csr_matrix

    nodes = case.remaining[0].node_sets[case.boundary(recording.boundary).nodes]
    recorded = np.isfinite(recording.force[rows]).all(axis=0)
    size = int(recorded.sum())
    if size == 0:
        raise InputError(f"recording '{recording.name}' has no component of the force, only the torque")
    force = recording.force[rows][:, recorded]

    members, components = np.flatnonzero(nodes), np.flatnonzero(recorded)
    which = np.tile(np.repeat(np.arange(size), len(members)), len(rows)) + size * np.repeat(
        np.arange(len(rows)), size * len(members)
    )
    columns = np.tile((3 * members + components[:, None]).ravel(), len(rows))
    by_reactions = csr_matrix((np.ones(len(columns)), (which, columns)), (size * len(rows), 3 * len(nodes)))
    nothing = csr_matrix(by_reactions.shape)

    def at(_u: Floats, reactions: Floats, _centre: Floats, _motion: Floats) -> tuple[Floats, Floats, Floats, Any, Any]:
        values = force - reactions[nodes].sum(axis=0)[recorded]
        return values, np.zeros((len(rows), size, 6)), np.zeros((len(rows), size, 3)), nothing, by_reactions

    return _Part(rows, np.ones(len(rows)), size, np.empty((0, 3)), np.zeros(len(rows)), at)


def _with_changes(each: Sequence[tuple[Recording, Observation]]) -> tuple[Observation, ...]:
    """The observations with what points changed over an element of the mesh.

    Points of one time are neighbours in whatever file they are, if they were declared to be recorded alike.
    """
    alike: dict[tuple[Any, ...], list[int]] = {}
    for number, (recording, observation) in enumerate(each):
        if isinstance(recording, PointsRecording):
            own = number if recording.sigma is None or recording.sigmas is not None else None
            for time in np.unique(observation.times).tolist():
                alike.setdefault((time, recording.reference, recording.sigma, own), []).append(number)
    changes = [observation.over_element.copy() for _, observation in each]
    for (time, *_), numbers in alike.items():
        rows = [np.flatnonzero(each[k][1].times == time) for k in numbers]
        points, moved = (
            np.concatenate(
                [getattr(each[k][0], name)[each[k][1].rows[those]] for k, those in zip(numbers, rows, strict=True)]
            )
            for name in ("points", "displacement")
        )
        edges = np.concatenate([each[k][1].edges[those] for k, those in zip(numbers, rows, strict=True)])
        found = change_over_element(points, moved, edges)
        parts = np.split(found, np.cumsum([len(own) for own in rows])[:-1])
        for k, those, part in zip(numbers, rows, parts, strict=True):
            changes[k][those] = part
    return tuple(
        replace(observation, over_element=change) for (_, observation), change in zip(each, changes, strict=True)
    )


def _sigma(recording: Recording, rows: Ints, weights: Floats) -> Floats | None:
    """Standard deviation of each row, None if it is to be estimated."""
    sigmas = getattr(recording, "sigmas", None)
    if sigmas is None and recording.sigma is None:
        return None
    found = np.full(len(rows), recording.sigma, dtype=np.float64) if sigmas is None else np.asarray(sigmas)[rows]
    for value in found.tolist():
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"recording '{recording.name}': sigma = {value:g}: expected a positive number")
    return found / np.sqrt(weights)
