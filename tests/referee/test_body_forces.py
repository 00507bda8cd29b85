"""Forces outside the dictionary: what they are together, in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from referee.effects import Attraction, Stripes, Swirl, UniformForce
from referee.setting import draw_setting


@pytest.fixture
def problem(small):
    setting = draw_setting(np.random.default_rng(1), "phantom", False)
    return replace(setting, total=(0.0, 0.0, 0.0), moved=None).problem()


def force(problem, effect):
    return effect.act(problem).loads[-1](np.zeros_like(problem.body.points))


def test_a_uniform_force_weighs_the_volume(problem, verify):
    found = force(problem, UniformForce(size=500.0, direction=(1.0, 0.0, 0.0))).sum(axis=0)
    volume = problem.body.region[0].sum()
    verify(
        "sum of the nodal forces of a uniform body force on quadratic tetrahedra",
        "force density times volume",
        float(np.abs(found / (500.0 * volume) - [1.0, 0.0, 0.0]).max()),
        1e-12,
    )


def test_places_that_draw_each_other_have_neither_force_nor_moment(problem):
    here, there = (0.04, 0.04, 0.03), (0.1, 0.1, 0.1)
    found = force(problem, Attraction(size=0.3, centre=here, other=there, radius=0.03))
    assert np.abs(found.sum(axis=0)).max() < 1e-15
    # the work of both on a stretch of the whole; hills of few quadrature points are not quite about their centres
    apart = np.linalg.norm(np.subtract(there, here))
    assert -(found * problem.body.points).sum() == pytest.approx(0.3 * apart, rel=0.05)
    assert np.abs(np.cross(problem.body.points, found).sum(axis=0)).max() < 0.3 * 5e-3


def test_a_swirl_turns_about_its_axis(problem):
    middle = (0.065, 0.065, 0.065)
    found = force(problem, Swirl(size=500.0, centre=middle, axis=(0.0, 0.0, 1.0), length=0.03))
    moment = np.cross(problem.body.points - middle, found).sum(axis=0)
    assert moment[2] > 20.0 * np.abs(moment[:2]).max()


def test_stripes_press_and_draw(problem):
    stripes = Stripes(size=100.0, direction=(0.0, 1.0, 0.0), wavelength=0.04, phase=0.0)
    body = problem.body
    faces = body.faces(body.mesh.node_sets["surface"])
    along = 2.0 * np.pi * faces.places[..., 1] / 0.04
    pressed = -(100.0 * np.cos(along)[..., None] * faces.vectors(body.points)).sum(axis=(0, 1))
    np.testing.assert_allclose(force(problem, stripes).sum(axis=0), pressed, atol=1e-12)
    half = replace(stripes, phase=np.pi)
    np.testing.assert_allclose(force(problem, half), -force(problem, stripes), atol=1e-12)
