"""Equilibrium under forces that follow the wall, and with tissue that has grown."""

import numpy as np
import pytest
from hollow import hollow

from concealed.face_loads import pressure_forces
from concealed.settling import STILL, Settler
from concealed.tissue import Tissue
from concealed.tissue_effects import Swelling
from concealed.wall_effects import CavityPressure

TISSUE = Tissue(
    k_grey=0.0,
    k_white=0.0,
    alpha=(2.0, -8.0),
    share=0.5,
    poisson=0.47,
    field_sd=0.2,
    field_length=0.035,
    field_seed=1,
)
#: Above the cube: nothing has drained.
FULL = 0.3


def test_pressure_follows_the_wall():
    body = hollow()[0]
    effect = CavityPressure(strength=400.0)
    settler = Settler(body, TISSUE)
    u = settler.settle([effect], FULL)
    assert np.abs(u).max() > 1e-3
    # balance with the forces at the walls as they are now, and not as they were at rest
    system = settler._prepared([effect])
    system.u.assign(u)
    system.evaluate_forces()
    system.gather_forces()
    free = ~system.constrained.any(axis=1)
    internal = system.internal.numpy()[free]
    faces = body.quadratic.six_nodes(body.cavity)
    now, rest = (pressure_forces(body.quadratic.points + v, faces, 400.0)[free] for v in (u, 0.0 * u))
    assert np.linalg.norm(internal - now) < 1e-3 * np.linalg.norm(now)
    assert np.linalg.norm(internal - rest) > 1e-2 * np.linalg.norm(rest)


@pytest.mark.slow(6)
def test_where_it_starts_does_not_matter():
    body = hollow()[0]
    settler = Settler(body, TISSUE)
    settler.settle([CavityPressure(strength=-300.0)], 0.1)
    warm = settler.settle([CavityPressure(strength=350.0)], 0.08)
    cold = Settler(body, TISSUE).settle([CavityPressure(strength=350.0)], 0.08)
    np.testing.assert_allclose(warm, cold, rtol=0, atol=5.0 * STILL)


def test_swelling_enlarges_the_body_by_what_it_takes_up():
    body = hollow()[0]
    effect = Swelling(strength=0.1, centre=(0.07, 0.07, 0.10), radius=0.03)
    u = Settler(body, TISSUE).settle([effect], FULL)
    points = body.mesh.points + u[: len(body.mesh.points)]
    edges = points[body.mesh.tetrahedra[:, 1:]] - points[body.mesh.tetrahedra[:, :1]]
    gained = np.linalg.det(edges).sum() / 6.0 - body.mesh.volume
    taken_up = (body.mesh.volumes * effect.growth(body)).sum()
    # tissue is nearly incompressible: what the elastic part gives is 3.1 %
    assert gained == pytest.approx(taken_up, rel=0.05)
