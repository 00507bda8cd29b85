"""Errors of states: what is observed exactly leaves nothing, and where a head lies in a room changes nothing."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapes import cube, distorted

from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.mesh.free_surfaces import faces_of_set
from warpbrain.recordings.comparison import (
    Comparison,
    Error,
    compare_force,
    compare_points,
    compare_surface,
    legacy_error,
    root_mean_square,
)
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import ForceRecording, PointsRecording, SurfaceRecording
from warpbrain.recordings.times import rows_at


def body() -> TetMesh:
    mesh = distorted(cube(4), 0.01)
    rest = cube(4).points
    sets = {"top": rest[:, 2] == 1, "line": (rest[:, 2] == 1) & (rest[:, 0] == 0), "all": rest[:, 2] >= 0}
    return TetMesh(0.1 * mesh.points, mesh.tetrahedra, None, sets)


MESH = body()
RNG = np.random.default_rng(0)
U = 0.005 * RNG.normal(size=MESH.points.shape)


def points_of(displacement=None, **keys) -> PointsRecording:
    points = RNG.uniform(0.02, 0.08, (20, 3))
    if displacement is None:
        displacement = locate(MESH.points, MESH.tetrahedra, points).interpolate(U)
    return PointsRecording(**{"name": "p", "file": "p.csv", "points": points, "displacement": displacement} | keys)


def surface_of(u, faces=False) -> SurfaceRecording:
    chosen = faces_of_set(MESH, "top", "test")
    moved = MESH.points + u
    if faces:
        return SurfaceRecording(name="s", file="s.vtp", nodes="top", points=moved, faces=chosen)
    return SurfaceRecording(name="s", file="s.csv", nodes="top", points=moved[chosen].mean(axis=1))


def compare(recording, *state, time=None) -> Comparison:
    of = {"points": compare_points, "surface": compare_surface, "force": compare_force}[recording.kind]
    return of(recording, *state, rows_at(recording, time))


def test_formulas():
    residuals = np.array([[0.003, 0.004, 0], [0, 0, 0]])
    assert root_mean_square(residuals) == pytest.approx(0.005 / np.sqrt(2))
    assert root_mean_square([0.005, 0]) == pytest.approx(0.005 / np.sqrt(2))
    # 5 mm and 0 mm: the root of 2.5 mm
    assert legacy_error(residuals) == pytest.approx(np.sqrt(2.5))
    error = Error.of(residuals)
    assert (error.largest, error.percentile_95) == pytest.approx((0.005, 0.00475))
    assert Error.of([1.0], "N").legacy is None


def test_an_exact_observation_leaves_nothing():
    recording = points_of()
    compared = compare(recording, MESH, U)
    assert compared.after.largest < 1e-16
    assert compared.before.root_mean_square == pytest.approx(root_mean_square(recording.displacement))
    assert compared.before == compare(recording, MESH, 0 * U).after
    np.testing.assert_array_equal(compared.residuals_before, recording.displacement)
    assert compared.count == 20
    for faces in (False, True):
        compared = compare(surface_of(U, faces), MESH, U)
        if not faces:
            assert compared.after.largest < 1e-16
            assert compared.before.root_mean_square > 1e-3
        else:
            assert compared.reverse_after.largest < 1e-16
            assert compared.reverse_before.root_mean_square > 1e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("faces", [False, True])
def test_where_all_of_it_lies_changes_nothing(seed, faces):
    rng = np.random.default_rng(seed)
    R = Rotation.random(random_state=seed).as_matrix()
    shift = rng.normal(size=3)
    moved = TetMesh(MESH.points @ R.T + shift, MESH.tetrahedra, None, dict(MESH.node_sets))
    points = points_of(0.01 * rng.normal(size=(20, 3)))
    turned = replace(points, points=points.points @ R.T + shift, displacement=points.displacement @ R.T)
    surface = surface_of(1.3 * U, faces)
    turned_surface = replace(surface, points=surface.points @ R.T + shift)
    for a, b in (
        (compare(points, MESH, U), compare(turned, moved, U @ R.T)),
        (compare(surface, MESH, U), compare(turned_surface, moved, U @ R.T)),
    ):
        for one, other in ((a.before, b.before), (a.after, b.after), (a.reverse_after, b.reverse_after)):
            if one is not None:
                np.testing.assert_allclose(list(vars(one).values()), list(vars(other).values()), rtol=1e-10)
        np.testing.assert_allclose(a.residuals_after @ R.T, b.residuals_after, atol=1e-14)


def test_noise():
    assert compare(points_of(), MESH, U).noise is None
    assert compare(points_of(sigma=0.001), MESH, U).noise == pytest.approx(np.sqrt(3) * 0.001)
    sigmas = np.full(20, 0.002)
    assert compare(points_of(sigma=0.001, sigmas=sigmas), MESH, U).noise == pytest.approx(np.sqrt(3) * 0.002)
    rng = np.random.default_rng(5)
    points = rng.uniform(0.02, 0.08, (20000, 3))
    noisy = locate(MESH.points, MESH.tetrahedra, points).interpolate(U) + 0.001 * rng.normal(size=points.shape)
    compared = compare(points_of(noisy, points=points, sigma=0.001), MESH, U)
    # Monte Carlo error of 60,000 numbers: 0.3 %
    assert compared.after.root_mean_square == pytest.approx(compared.noise, rel=0.005)
    surface = replace(surface_of(U), sigma=0.001)
    assert compare(surface, MESH, U).noise == 0.001


def test_sets_without_faces():
    assert len(faces_of_set(MESH, "top", "test")) == 32
    for name, message in (("line", "no boundary triangle .* 'line'"), ("side", "no node set 'side', found all, line")):
        with pytest.raises(InputError, match=message):
            compare(replace(surface_of(U), nodes=name), MESH, U)


def force(**keys) -> ForceRecording:
    values = {"time": np.array([0.0, 1, 2]), "force": np.array([[0, np.nan, 0], [1, np.nan, 2], [2, np.nan, 3]])}
    return ForceRecording(**{"name": "f", "file": "f.csv", "boundary": "grip"} | values | keys)


def test_forces():
    compared = compare(force(sigma=0.1), [2, 7, 3.5])
    assert compared.unit == "N"
    assert compared.before.largest == pytest.approx(np.hypot(2, 3))
    assert compared.after.largest == pytest.approx(0.5)
    assert compared.noise == pytest.approx(np.sqrt(2) * 0.1)
    assert compare(force(), [1, 0, 2], time=1.4).after.largest == 0
    twisted = force(force=np.full((3, 3), np.nan), torque=np.array([0.0, 1, 2]), sigma=0.5)
    with pytest.raises(InputError, match="only the torque"):
        compare(twisted, [0, 0, 0])


TIMES = np.array([0.0, 0, 1, 1, 2, 3, 4])


@pytest.mark.parametrize(
    ("ids", "time", "rows"),
    [
        (None, None, [6]),
        ("abababa", None, [5, 6]),
        (None, 0.2, [0, 1]),
        (None, 0.5, [0, 1]),
        (None, 0.51, [2, 3]),
        (None, 4.5, [6]),
        (None, -0.5, [0, 1]),
        ("abababa", 1.1, [2, 3]),
        ("abababa", 2.4, [4]),
        ("abababa", 3.9, [6]),
    ],
)
def test_rows_at_a_time(ids, time, rows):
    recording = points_of(
        np.zeros((7, 3)), points=np.zeros((7, 3)), time=TIMES, ids=None if ids is None else tuple(ids)
    )
    assert rows_at(recording, time).tolist() == rows


def test_times_without_rows():
    timed = points_of(np.zeros((7, 3)), points=np.zeros((7, 3)), time=TIMES)
    with pytest.raises(InputError, match=r"nothing at 4\.6 s: its times are 0 s to 4 s"):
        rows_at(timed, 4.6)
    with pytest.raises(InputError, match="has no times"):
        rows_at(points_of(), 0.0)
    once = replace(timed, time=np.full(7, 3.0))
    assert len(rows_at(once, 3.0)) == 7
    with pytest.raises(InputError):
        rows_at(once, 3.1)
    assert rows_at(points_of()).tolist() == list(range(20))
