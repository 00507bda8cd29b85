"""Recordings of a case beside its states, as rows: residuals, and how they change.

A residual is what was recorded less what was computed, each row at its time (`warpbrain.cases.moments`), less what was
computed at the time from which it is counted. Recordings whose role is ``"fit"`` are one thing, those to ``"check"``
another: no function here looks at both.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from warpbrain.arrays import Bools, Floats, Int32s, Ints
from warpbrain.cases.boundary import Forced
from warpbrain.cases.case import Case
from warpbrain.cases.checking import too_few_for_noise
from warpbrain.cases.moments import Moments
from warpbrain.errors import InputError
from warpbrain.estimation.registration import moved_back, moved_back_columns
from warpbrain.estimation.surplus import Surplus, rows_by_surplus
from warpbrain.estimation.within_element import change_over_element, turn_over_element
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.noise import noise_covariance, noise_factor
from warpbrain.mesh.free_surfaces import faces_of_set
from warpbrain.mesh.quality import extent
from warpbrain.mesh.surface import feature_normals
from warpbrain.recordings.closest import closest_points
from warpbrain.recordings.location import locate
from warpbrain.recordings.points import distinct_rows
from warpbrain.recordings.recording import ForceRecording, PointsRecording, Recording, SurfaceRecording
from warpbrain.recordings.times import compared_rows, rows_at, times_of


@dataclass(frozen=True, eq=False)
class Sensors:
    """The n numbers that were recorded, at a state."""

    residual: Floats  # what was recorded less what was computed [m] or [N]; of surfaces the signed distance
    computed: Floats  # of surfaces the displacement along their normals
    by_displacement: Any  # SciPy CSR (n, 3 N), of what was computed by the displacement at its time
    by_reactions: Any  # the same by the reactions
    rigid: Floats  # (n, 6), of what was recorded by a rigid motion of it (`registration`)
    sigma: Floats  # declared standard deviation of the noise; NaN where it is to be estimated
    positions: Floats  # (n, 3), where [m]; NaN of forces
    directions: Floats  # (n, 3), in which direction a displacement was recorded; zero of forces
    over_element: Floats  # (n, 3), see `warpbrain.estimation.within_element`, along each axis [m]; zero of forces
    groups: Ints  # number of the point, or of the row of a recording, increasing
    recordings: Ints  # number of the recording
    times: Floats  # when [s]; infinite of the end
    names: tuple[str, ...]  # of the recordings
    after: Ints  # number of the time of the state that each is compared with
    before: Ints  # the same, counted from; -1: from rest
    references: Floats  # when that state was [s]; 0: rest
    radius: float  # of the sphere of the body's volume [m]
    #: How many times what changes the last state alike at all times changes a row: less where a state is smaller.
    share: Floats | float = 1.0
    #: Of rows whose noise is to be estimated: its variance is the recording's over this.
    weights: Floats | float = 1.0

    def __len__(self) -> int:
        return len(self.residual)

    @property
    def is_displacement(self) -> Bools:
        """Which rows are lengths, not forces."""
        return np.asarray(self.directions.any(axis=1))

    @property
    def of_one_unit(self) -> Bools:
        """Which rows are lengths, or all where none is: in any sum forces, which have another unit, would dominate."""
        rows = self.is_displacement
        return rows if rows.any() else np.ones(len(self), dtype=bool)

    @property
    def of_surfaces(self) -> Bools:
        """Which rows are of points of a surface: each of these has one number, along the normal."""
        return np.asarray(self.is_displacement & (np.bincount(self.groups)[self.groups] == 1))

    @property
    def is_counted_from_rest(self) -> bool:
        return bool((self.before < 0).all())

    @cached_property
    def points(self) -> tuple[Ints, ...]:
        """Rows of each point, which may be a gross error; forces have none."""
        rows = np.flatnonzero(self.is_displacement)
        ends = np.flatnonzero(np.diff(self.groups[rows])) + 1
        return tuple(np.split(rows, ends)) if len(rows) else ()

    def noise(self, sigma: Floats, unresolved: float = 0.0) -> GaussianModel:
        """Of the noise alone, at a scale of 1.

        `sigma` (n,): of its independent part. `unresolved`: part of the change over an element that a mesh hides.
        """
        hidden = unresolved * self.over_element
        covariance = noise_covariance(self.positions, self.directions, self.times, sigma, self.radius, hidden)
        return GaussianModel(noise_factor(covariance, sigma), np.zeros((len(self), 0)))

    def of_rows(self, rows: Ints | Bools, time: float | None = None) -> Sensors:
        """Some of the rows (k,), or (n,) bool; with `time` [s] as if recorded then, and counted from rest."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        some = replace(self, **{k: v[rows] for k, v in values.items() if k != "names" and not np.isscalar(v)})
        if time is None:
            return some
        at, first = np.full(len(some), time), np.zeros(len(some), dtype=np.int64)
        return replace(some, times=at, after=first, before=first - 1, references=np.zeros(len(some)), share=1.0)

    def answer(self, du: Floats, dR: Floats) -> Floats:
        """Change (n,) of what is computed by changes of displacement and reactions (N, 3) at its time alone."""
        return np.asarray(self.by_displacement @ du.ravel() + self.by_reactions @ dR.ravel())

    def answer_within(self, surplus: Surplus) -> Floats:
        """Response (n,) [m] to the displacement within elements (E, 3) at its time alone; zero of forces."""
        return np.asarray(rows_by_surplus(self.by_displacement, surplus.edges) @ surplus.values.ravel())

    def answers_within_in_time(self, edges: Int32s, surplus: Floats) -> Floats:
        """The same (n, p) of the surplus (p, s, E, 3) [m] of s states, from which rows are counted, too."""
        return self._in_time(rows_by_surplus(self.by_displacement, edges), surplus)

    def with_change(self, change: Floats) -> Sensors:
        """The same rows with a change (n,) of what was computed [m] or [N], which is taken off the residuals."""
        return replace(self, residual=self.residual - change, computed=self.computed + change)

    def answers_in_time(self, du: Floats, dR: Floats) -> Floats:
        """The same (n, p) of changes (p, s N, 3) of s states, one after the other, from which rows are counted, too."""
        return self._in_time(self.by_displacement, du) + self._in_time(self.by_reactions, dR)

    def _in_time(self, matrix: Any, changes: Floats) -> Floats:
        """Responses (n, p) to changes (p, s ...) of s states, by the matrix (n, m) of each state alone."""
        by_state = changes.reshape(len(changes), -1, matrix.shape[1])
        total = np.zeros((len(self), len(changes)))
        for number in range(by_state.shape[1]):
            share = (self.after == number) * 1.0 - (self.before == number)
            if share.any():
                total += share[:, None] * (matrix @ by_state[:, number].T)
        return total


#: From a displacement and reactions (N, 3), a centre (3,) and a rigid motion (6,): residuals (n d,), `rigid` (n d, 6),
#: and derivatives (n d, 3 N) of what was computed.
_At = Callable[[Floats, Floats, Floats, Floats], tuple[Floats, Floats, Any, Any]]


@dataclass(frozen=True, eq=False)
class Observation:
    """The n rows of one recording that count and are compared with one state."""

    name: str
    kind: str
    unit: str
    rows: Ints  # their numbers in the recording; the first of those that are copies of each other
    sigma: Floats | None  # standard deviation (n,) of one component; None: to be estimated
    weights: Floats  # where sigma is estimated, the variance of a row is its square over this; else it is in it already
    size: int  # components of a row
    positions: Floats  # (n, 3), what a wrong registration moves [m]; NaN of forces
    edges: Floats  # (n,), mean length of the edges of the element in which each is [m]; zero of all but points
    over_element: Floats  # (n, size, 3), see `Sensors`
    times: Floats  # (n,), when [s]
    reference: float  # the time from which they are counted [s]; 0: rest
    after: int  # numbers of the states that they are compared with, and counted from; -1: from rest (`Moments`)
    before: int
    at: _At


@dataclass(frozen=True, eq=False)
class Observations:
    """Recordings of a case of one role."""

    recordings: tuple[Observation, ...]  # those of one name follow each other
    remarks: tuple[str, ...]  # recordings that say nothing of tissue, and why
    nodes: int  # of the simulated mesh
    radius: float  # of the sphere of the body's volume [m]

    @classmethod
    def to_fit(cls, case: Case, moments: Moments | None = None) -> Observations:
        """The recordings that a case is fitted to; at states of all times of recordings unless `moments` are given.

        `InputError` if there are none, none of them says anything of tissue, a noise is not positive, or one that is to
        be estimated has too few residuals for that.
        """
        if not any(recording.role == "fit" for recording in case.recordings):
            checks = f"; its {len(case.recordings)} have role = 'check'" if case.recordings else ""
            raise InputError(f"{case.path}: no [[recording]] to estimate from{checks}")
        observations = cls._of(case, "fit", moments)
        if not observations.recordings:
            raise InputError(f"{case.path}: nothing to estimate from: {'; '.join(observations.remarks)}")
        for recording in case.recordings:
            if recording.role == "fit" and (why := too_few_for_noise(case, recording)):
                raise InputError(why)
        return observations

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
            elif recording.reference is not None and recording.reference not in moments.times:
                remarks.append(
                    f"recording '{recording.name}' is counted from {recording.reference:g} s, and tissue that goes on "
                    "by itself is looked at in the end alone"
                )
            else:
                each += [(recording, observation) for observation in _observations(case, recording, moments)]
        return cls(_with_changes(each), tuple(remarks), len(case.remaining[0].points), case.mesh.radius)

    @cached_property
    def centre(self) -> Floats:
        """Mean of all positions that were recorded [m], zero if there are none."""
        positions = np.concatenate([observation.positions for observation in self.recordings])
        positions = positions[np.isfinite(positions).all(axis=1)]
        return positions.mean(axis=0) if len(positions) else np.zeros(3)

    def at(self, u: Floats, reactions: Floats, centre: Floats | None = None, motion: Floats | None = None) -> Sensors:
        """All rows at displacement [m] and reactions [N] (s N, 3) of s states, one after the other.

        What was recorded was moved by a rigid motion (6,), see `registration`, about a centre (3,) [m]: by nothing, and
        about that of these recordings, unless given.
        """
        from scipy.sparse import vstack

        about = self.centre if centre is None else centre
        by = np.zeros(6) if motion is None else motion
        # the state from which is counted, -1, is zero
        rest = np.zeros((1, self.nodes, 3))
        U, R = (np.concatenate([field.reshape(-1, self.nodes, 3), rest]) for field in (u, reactions))
        parts = [
            seen.at(U[seen.after] - U[seen.before], R[seen.after] - R[seen.before], about, by)
            for seen in self.recordings
        ]
        residual, rigid = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
        # of one observation, which most estimates have, nothing is copied thousands of times
        by_u, by_R = (
            parts[0][k] if len(parts) == 1 else vstack([part[k] for part in parts], format="csr") for k in (2, 3)
        )
        rows = Sensors(residual, residual, by_u, by_R, rigid, directions=rigid[:, :3].copy(), **self._rows)
        return replace(rows, computed=rows.answers_in_time(u[None], reactions[None])[:, 0])

    @cached_property
    def _rows(self) -> dict[str, Any]:
        """What of the rows is the same at all states."""
        names = tuple(dict.fromkeys(observation.name for observation in self.recordings))

        def each(value_of: Callable[[Observation], Any]) -> Any:
            """A value of each observation, or of each of its rows, for every component of these."""
            values = [(seen, np.asarray(value_of(seen))) for seen in self.recordings]
            of_rows = [value if value.ndim else np.full(len(seen.rows), value) for seen, value in values]
            return np.repeat(np.concatenate(of_rows), sizes, axis=0)

        same = ("positions", "times", "after", "before", "weights")
        sizes = np.concatenate([np.full(len(seen.rows), seen.size) for seen in self.recordings])
        return {name: each(operator.attrgetter(name)) for name in same} | {
            "sigma": each(lambda seen: np.nan if seen.sigma is None else seen.sigma),
            "over_element": np.concatenate([seen.over_element.reshape(-1, 3) for seen in self.recordings]),
            "groups": np.repeat(np.arange(len(sizes)), sizes),
            "recordings": each(lambda seen: names.index(seen.name)),
            "names": names,
            "references": each(operator.attrgetter("reference")),
            "radius": self.radius,
        }


#: Rows, weights, size, positions, edges and change over an element as of `Observation`, and `at`.
_Made = tuple[Ints, Floats, int, Floats, Floats, Floats, _At]


def _observations(case: Case, recording: Recording, moments: Moments) -> Iterator[Observation]:
    """Of each state that rows of a recording are compared with."""
    makers: dict[type[Recording], tuple[str, Callable[[Case, Any, Ints], _Made]]] = {
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
        rows = rows_at(recording)
        times = np.full(len(times), np.inf)
    if len(rows) == 0:
        zero = isinstance(recording, PointsRecording) and recording.weights is not None
        reason = "the weight of every point is zero" if zero else "no row is of a time after 0 s"
        raise InputError(f"recording '{recording.name}': {reason}")
    states = np.array([moments.number(time) for time in times[rows].tolist()])
    start = -1 if recording.reference is None else moments.number(recording.reference)
    for number in np.unique(states).tolist():
        members, weights, size, positions, edges, change, at = make(case, recording, rows[states == number])
        sigma, sigmas = recording.sigma, getattr(recording, "sigmas", None)
        # of each row, or None: it is to be estimated
        declared = None
        if sigmas is not None or sigma is not None:
            declared = np.full(len(members), sigma, dtype=np.float64) if sigmas is None else np.asarray(sigmas)[members]
            for value in declared.tolist():
                if not (math.isfinite(value) and value > 0.0):
                    raise InputError(f"recording '{recording.name}': sigma = {value:g}: expected a positive number")
            declared = declared / np.sqrt(weights)
        about = declared, weights, size, positions, edges, change, times[members], recording.reference or 0.0
        yield Observation(recording.name, recording.kind, unit, members, *about, number, start, at)


def _points(case: Case, recording: PointsRecording, rows: Ints) -> _Made:
    from scipy.sparse import csr_matrix, eye, kron

    rows, weights = distinct_rows(recording, rows)
    if not (np.isfinite(weights) & (weights >= 0.0)).all():
        raise InputError(f"recording '{recording.name}': a weight is negative or no number")
    rows, weights = rows[weights > 0.0], weights[weights > 0.0]
    points = recording.points[rows].astype(np.float64)
    mesh = case.remaining[0]
    location = locate(mesh.points, mesh.tetrahedra, points)
    matrix = location.matrix(len(mesh.points))
    by_displacement = kron(matrix, eye(3), format="csr")
    nothing = csr_matrix(by_displacement.shape)
    positions = points + recording.displacement[rows]

    def at(u: Floats, _reactions: Floats, centre: Floats, motion: Floats) -> tuple[Floats, Floats, Any, Any]:
        residual = moved_back(positions, motion, centre) - points - matrix @ u
        rigid = -moved_back_columns(positions, motion, centre)
        return residual.ravel(), rigid.reshape(-1, 6), by_displacement, nothing

    # of the points of all recordings together, see `_with_changes`
    return rows, weights, 3, positions, location.edge, np.zeros((len(rows), 3, 3)), at


def _surface(case: Case, recording: SurfaceRecording, rows: Ints) -> _Made:
    from scipy.sparse import csr_matrix

    mesh = case.remaining[0]
    positions = recording.points[rows]
    faces = faces_of_set(mesh, recording.nodes, f"recording '{recording.name}'")
    size = extent(mesh.points)
    shape = (len(rows), 3 * len(mesh.points))

    def at(u: Floats, _reactions: Floats, centre: Floats, motion: Floats) -> tuple[Floats, Floats, Any, Any]:
        moved, points = mesh.points + u, moved_back(positions, motion, centre)
        closest = closest_points(points, moved, faces)
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
        shares = closest.weights[:, :, None] * directions[:, None, :]
        columns = 3 * faces[closest.face][:, :, None] + np.arange(3)
        by_displacement = csr_matrix((shares.ravel(), (np.repeat(np.arange(len(rows)), 9), columns.ravel())), shape)
        rigid = -np.einsum("nj,njk->nk", directions, moved_back_columns(positions, motion, centre))
        return side * closest.distance, rigid, by_displacement, csr_matrix(shape)

    turn = turn_over_element(mesh.points, faces, closest_points(positions, mesh.points, faces))
    return rows, np.ones(len(rows)), 1, positions, np.zeros(len(rows)), turn[:, None], at


def _force(case: Case, recording: ForceRecording, rows: Ints) -> _Made:
    from scipy.sparse import csr_matrix, kron

    nodes = case.remaining[0].node_sets[case.boundary(recording.boundary).nodes]
    recorded = np.isfinite(recording.force[rows]).all(axis=0)
    size = int(recorded.sum())
    if size == 0:
        raise InputError(f"recording '{recording.name}' has no component of the force, only the torque")
    force = recording.force[rows][:, recorded]
    sums = np.zeros((size, len(nodes), 3))
    sums[np.arange(size)[:, None], np.flatnonzero(nodes), np.flatnonzero(recorded)[:, None]] = 1.0
    by_reactions = kron(np.ones((len(rows), 1)), csr_matrix(sums.reshape(size, -1)), format="csr")
    nothing = csr_matrix(by_reactions.shape)

    def at(_u: Floats, reactions: Floats, _centre: Floats, _motion: Floats) -> tuple[Floats, Floats, Any, Any]:
        residual = force - reactions[nodes].sum(axis=0)[recorded]
        return residual.ravel(), np.zeros((residual.size, 6)), nothing, by_reactions

    nowhere, nothing_changes = np.full((len(rows), 3), np.nan), np.zeros((len(rows), size, 3))
    return rows, np.ones(len(rows)), size, nowhere, np.zeros(len(rows)), nothing_changes, at


def _with_changes(each: Sequence[tuple[Recording, Observation]]) -> tuple[Observation, ...]:
    """The observations with what points changed over an element of the mesh.

    Points of one time are neighbours in whatever file they are, if they were declared to be recorded alike.
    """
    alike: dict[tuple[Any, ...], list[tuple[int, int]]] = {}
    for number, (recording, observation) in enumerate(each):
        if isinstance(recording, PointsRecording):
            alone = number if recording.sigma is None or recording.sigmas is not None else None
            for row, time in enumerate(observation.times.tolist()):
                alike.setdefault((time, recording.reference, recording.sigma, alone), []).append((number, row))
    changes = [observation.over_element.copy() for _, observation in each]
    for members in alike.values():
        rows = [(each[number][0], each[number][1].rows[row]) for number, row in members]
        points, moved = (np.array([getattr(r, name)[k] for r, k in rows]) for name in ("points", "displacement"))
        edges = np.array([each[number][1].edges[row] for number, row in members])
        for (number, row), change in zip(members, change_over_element(points, moved, edges), strict=True):
            changes[number][row] = change
    return tuple(replace(seen, over_element=change) for (_, seen), change in zip(each, changes, strict=True))
