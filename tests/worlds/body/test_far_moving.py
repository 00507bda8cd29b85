"""A soft cantilever that sags by half its length under its weight, of which its case says nothing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapes import box

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case, Tissue
from warpbrain.diagnosis.diagnose import diagnose
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import PointsRecording
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.worlds.options import DiagnosisOptions

#: Length and height of the beam, noise [m]; tracked points.
LENGTH, HEIGHT, NOISE, POINTS = 0.1, 0.03, 2e-4, 45


@pytest.mark.slow(30)
@pytest.mark.parametrize("mesh_error", [False, True])
def test_its_weight_is_found(mesh_error: bool) -> None:
    """With the mesh taken for exact, and with its error as it is found."""
    points = box((10, 3, 3), (LENGTH, HEIGHT, HEIGHT))
    mesh = TetMesh(points.points, points.tetrahedra, node_sets={"clamp": points.points[:, 0] < 1e-9})
    case = Case(
        name="cantilever",
        title="A soft cantilever",
        origin="synthetic",
        path=Path("case.toml"),
        mesh=mesh,
        tissues={label: Tissue("gel", NeoHookean(5000.0)) for label in mesh.labels},
        density=1000.0,
        poisson=0.45,
        boundaries=(Fixed(name="clamp", nodes="clamp"),),
        gravity_axis=(0.0, 0.0, -1.0),
    )
    weight = Gravity(direction=(0.0, 0.0, -1.0), density=1000.0)
    model = model_of(replace(case, mechanisms=(weight,)))
    u = EquilibriumSolver(System(model, "cpu")).solve(model.external_forces()).u
    assert -u[:, 2].min() > 0.5 * LENGTH
    rng = np.random.default_rng(0)
    x = np.array([LENGTH, HEIGHT, HEIGHT]) * rng.uniform(0.03, 0.97, (POINTS, 3))
    moved = locate(mesh.points, mesh.tetrahedra, x).interpolate(u) + NOISE * rng.normal(size=x.shape)
    beads = PointsRecording(name="beads", file="beads.csv", role="fit", points=x, displacement=moved, sigma=NOISE)
    found = diagnose(replace(case, recordings=(beads,)), DiagnosisOptions(mesh_error=mesh_error), "cpu")
    assert found.decision.causes == ("gravity",)
