"""Changes of a case that change nothing: where it lies, how it is counted, in which units and files it is written."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from warpbrain.cases.boundary import Boundary, Displaced, Forced
from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case
from warpbrain.cases.writing import write_case
from warpbrain.frame import Frame
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.recordings.recording import PointsRecording

Floats = np.ndarray


@dataclass(frozen=True, eq=False)
class Changed:
    """A case after a change.

    Attributes
    ----------
    case : Case
    back : callable
        The displacement (n, 3) of its nodes as one of the nodes of the case before.
    """

    case: Case
    back: Callable[[Floats], Floats] = lambda u: u


def in_frame(case: Case, R: Floats, shift: Floats) -> Changed:
    """Turned or mirrored by an orthogonal matrix, then shifted [m]."""
    mesh = case.mesh
    tetrahedra = mesh.tetrahedra if np.linalg.det(R) > 0.0 else mesh.tetrahedra[:, [0, 2, 1, 3]]
    turned = TetMesh(mesh.points @ R.T + shift, tetrahedra, mesh.tissue, mesh.node_sets, {})

    def turn(vector: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = (R @ np.array(vector)).tolist()
        return x, y, z

    def boundary(one: Boundary) -> Boundary:
        if isinstance(one, Forced):
            return replace(one, total=turn(one.total))
        if isinstance(one, Displaced):
            return replace(one, values=tuple(turn(value) for value in one.values))
        return one

    def mechanism(one: Mechanism) -> Mechanism:
        assert isinstance(one, Gravity) and one.csf_level is None
        imaged = None if one.imaged_direction is None else turn(one.imaged_direction)
        return replace(one, direction=turn(one.direction), imaged_direction=imaged)

    changed = replace(
        case,
        mesh=turned,
        boundaries=tuple(map(boundary, case.boundaries)),
        mechanisms=tuple(map(mechanism, case.mechanisms)),
        recordings=tuple(
            replace(one, points=one.points @ R.T + shift, displacement=one.displacement @ R.T) for one in _points(case)
        ),
        gravity_axis=None if case.gravity_axis is None else turn(case.gravity_axis),
    )
    return Changed(changed, lambda u: u @ R)


def rotated(case: Case, rng: np.random.Generator) -> Changed:
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return in_frame(case, Q * np.linalg.det(Q), np.zeros(3))


def mirrored(case: Case, rng: np.random.Generator) -> Changed:
    return in_frame(case, np.diag(np.where(np.arange(3) == rng.integers(3), -1.0, 1.0)), np.zeros(3))


def translated(case: Case, rng: np.random.Generator) -> Changed:
    return in_frame(case, np.eye(3), rng.uniform(-0.3, 0.3, 3))


def renumbered(case: Case, rng: np.random.Generator) -> Changed:
    """Nodes and elements counted in another order, and each element's nodes begun elsewhere."""
    mesh = case.mesh
    order, elements = rng.permutation(len(mesh.points)), rng.permutation(len(mesh.tetrahedra))
    where = np.argsort(order)
    even = np.array([[0, 1, 2, 3], [1, 2, 0, 3], [1, 0, 3, 2], [3, 1, 0, 2]])
    turned = np.take_along_axis(where[mesh.tetrahedra][elements], even[rng.integers(4, size=len(elements))], axis=1)
    anew = TetMesh(
        mesh.points[order],
        turned.astype(np.int32),
        mesh.tissue[elements],
        {name: members[order] for name, members in mesh.node_sets.items()},
        {},
    )
    return Changed(replace(case, mesh=anew), lambda u: u[where])


def points_in_another_order(case: Case, rng: np.random.Generator) -> Changed:
    def mixed(one: PointsRecording) -> PointsRecording:
        order = rng.permutation(len(one.points))
        return replace(one, points=one.points[order], displacement=one.displacement[order])

    return Changed(replace(case, recordings=tuple(map(mixed, _points(case)))))


def split(case: Case, rng: np.random.Generator) -> Changed:
    """Each recording in two files."""
    parts = []
    for one in _points(case):
        first = rng.random(len(one.points)) < 0.5
        first[:2] = (True, False)
        for name, chosen in (("a", first), ("b", ~first)):
            part = replace(one, name=f"{one.name}-{name}", file=f"{name}.csv")
            parts.append(replace(part, points=one.points[chosen], displacement=one.displacement[chosen]))
    return Changed(replace(case, recordings=tuple(parts)))


def doubled(case: Case, rng: np.random.Generator) -> Changed:
    """Each row twice, with half its weight."""

    def twice(one: PointsRecording) -> PointsRecording:
        order = rng.permutation(np.tile(np.arange(len(one.points)), 2))
        weights = np.full(len(order), 0.5)
        return replace(one, points=one.points[order], displacement=one.displacement[order], weights=weights)

    return Changed(replace(case, recordings=tuple(map(twice, _points(case)))))


def _written(unit: str, axes: str) -> Callable[[Case, np.random.Generator], Changed]:
    def change(case: Case, _rng: np.random.Generator) -> Changed:
        with tempfile.TemporaryDirectory() as place:
            write_case(Path(place) / "case", replace(case, frame=Frame(unit, axes)))
            return Changed(read_case(Path(place) / "case"))

    return change


def _points(case: Case) -> tuple[PointsRecording, ...]:
    assert all(isinstance(one, PointsRecording) for one in case.recordings)
    return case.recordings  # type: ignore[return-value]


CHANGES: dict[str, Callable[[Case, np.random.Generator], Changed]] = {
    "rotated": rotated,
    "mirrored": mirrored,
    "translated": translated,
    "renumbered": renumbered,
    "points in another order": points_in_another_order,
    "split over files": split,
    "doubled at half weight": doubled,
    "written in mm and RAS": _written("mm", "RAS"),
    "written in m and LPS": _written("m", "LPS"),
}
