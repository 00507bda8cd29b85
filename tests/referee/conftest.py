"""The referee lies beside the package, not in it: its folder is put on the path for these tests alone."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapes import cube

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from referee import draw, folder, geometry, setting, truth
from referee.body import Body
from referee.sensing import place_sensors
from warpbrain.cases.boundary import Displaced, Fixed
from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.recordings.recording import ForceRecording, PointsRecording, SurfaceRecording


def small_mesh() -> TetMesh:
    """A hollow cube of 13 cm with all the sets of a brain and two tissues."""
    mesh = cube(5)
    points = 0.13 * mesh.points
    middle = points[mesh.tetrahedra].mean(axis=1)
    left, _, _ = TetMesh(points, mesh.tetrahedra, np.ones(len(middle), dtype=np.int32)).without(
        (np.abs(middle - 0.065) < 0.012).all(axis=1)
    )
    points = left.points
    surface = np.zeros(len(points), dtype=bool)
    surface[boundary_faces(left.tetrahedra)] = True
    wall = surface & (np.abs(points - 0.065).max(axis=1) < 0.05)
    x, y, z = points.T
    sets = {
        "ventricle": wall,
        "surface": surface & ~wall,
        "fixed": z == 0.0,
        "superior": (z > 0.1299) & (np.abs(x - 0.065) < 0.03) & (np.abs(y - 0.065) < 0.03),
        "side": (x > 0.1299) & (z > 0.07) & (np.abs(y - 0.065) < 0.03),
    }
    tissue = np.where(points[left.tetrahedra].mean(axis=1)[:, 2] > 0.065, 1, 2).astype(np.int32)
    return TetMesh(points, left.tetrahedra, tissue, sets)


@pytest.fixture(scope="session")
def small_body() -> Body:
    """The body of all tests."""
    return Body(small_mesh())


@pytest.fixture
def small(monkeypatch, small_body):
    """Every geometry is the small body, and few points are recorded."""
    for module in (geometry, setting):
        monkeypatch.setattr(module, "true_body", lambda name: small_body)
    monkeypatch.setattr(folder, "declared_mesh", lambda name: small_mesh())
    # not much is away from what is held in so small a body
    monkeypatch.setattr(draw, "_AWAY", 0.015)
    monkeypatch.setattr(truth, "place_sensors", lambda s: place_sensors(replace(s, points=40, checks=10)))
    return small_body


@pytest.fixture(scope="session")
def small_case(small_body):
    """The small body, its cap moved; points within, the moved wall and the force of the cap are recorded."""
    random = np.random.default_rng(4)
    mesh = small_body.mesh
    free = np.flatnonzero(~(mesh.node_sets["fixed"] | mesh.node_sets["side"] | mesh.node_sets["superior"]))
    points = mesh.points[random.permutation(free)[:30]]
    known = {"file": "", "role": "fit"}
    moved = mesh.points[mesh.node_sets["ventricle"]] + 1e-3 * random.normal(size=3)
    force = np.array([[0.1, 0.2, -2.0]])
    return replace(
        geometry.declared_case("phantom"),
        name="small",
        mesh=mesh,
        gravity_axis=setting.DOWN,
        boundaries=(
            Fixed(name="skull base", nodes="fixed"),
            Fixed(name="side", nodes="side"),
            Displaced(name="cap", nodes="superior", times=(0.0,), values=((0.001, 0.002, -0.006),)),
        ),
        mechanisms=(),
        recordings=(
            PointsRecording(
                name="points", points=points, displacement=1e-3 * random.normal(size=points.shape), **known
            ),
            SurfaceRecording(name="wall", sigma=3e-4, points=moved, nodes="ventricle", **known),
            ForceRecording(name="force", sigma=0.05, boundary="cap", time=np.array([1.0]), force=force, **known),
        ),
        remarks=(),
    )
