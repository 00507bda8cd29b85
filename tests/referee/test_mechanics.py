"""The referee's own mechanics, against differences, closed forms and FElupe."""

import felupe
import numpy as np
import pytest
from shapes import box, cube

from referee.body import Body
from referee.creep import creep
from referee.effects.contact import Contact, Skull
from referee.equilibrium import BALANCED, balance, balance_in_steps, linearised
from referee.law import Demiray, Ogden, respond
from referee.problem import Problem
from referee.setting import draw_setting
from warpbrain.mesh import TetMesh

LAWS = [Ogden((0.6, 0.4), (3.0, -8.0)), Ogden((1.0,), (-20.0,)), Demiray(1.5)]


def problem_of(body, law, held, value, nu=0.45, mu=1000.0, **more):
    mu = np.full((len(body.cells), 1), mu)
    bulk = mu * 2.0 * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))
    growth = more.pop("growth", np.zeros_like(mu))
    return Problem(body=body, law=law, mu=mu, bulk=bulk, growth=growth, held=held, value=value, **more)


@pytest.mark.parametrize("law", LAWS)
def test_tangent_is_the_derivative_of_stress(law):
    random = np.random.default_rng(0)
    F = np.eye(3) + 0.1 * random.normal(size=(4, 1, 3, 3))
    # equal stretches have limits of their own
    F[0], F[1] = np.eye(3), np.diag([1.1, 1.1, 0.9])
    mu, bulk, growth = (np.full((4, 1), value) for value in (1.3, 9.0, 0.05))
    tangent = respond(law, F, mu, bulk, growth).tangent(1.4).transpose(0, 1, 4, 2, 5, 3).reshape(4, 1, 9, 9)
    step = 1e-6
    for k in range(9):
        move = np.zeros(9)
        move[k] = step
        ends = [respond(law, F + s * move.reshape(3, 3), mu, bulk, growth).stress(1.4) for s in (1, -1)]
        difference = (ends[0] - ends[1]).reshape(4, 1, 9) / (2.0 * step)
        np.testing.assert_allclose(tangent[..., k], difference, atol=2e-7 * np.abs(tangent).max())


@pytest.mark.parametrize("law", LAWS)
def test_slopes_are_those_of_the_energy(law):
    e = np.array([0.1, -0.05, -0.05])
    first, second = law.slopes(e)
    for k, move in enumerate(1e-5 * np.eye(3)):
        assert first[k] == pytest.approx((law.energy(e + move) - law.energy(e - move)) / 2e-5, rel=1e-7)
        np.testing.assert_allclose(second[k], (law.slopes(e + move)[0] - law.slopes(e - move)[0]) / 2e-5, rtol=1e-6)


def test_growth_alone_is_free_of_stress():
    mu, bulk, growth = np.array([[2.0]]), np.array([[30.0]]), np.array([[0.2]])
    F = np.exp(0.2 / 3.0) * np.eye(3)[None, None]
    assert np.abs(respond(LAWS[0], F, mu, bulk, growth).stress()).max() < 1e-13


def test_stress_forces_and_tangent_are_felupes():
    # one term of exponent 2 is the isochoric neo-Hookean law, which FElupe writes in other variables
    mesh = cube(2)
    body = Body(TetMesh(mesh.points, mesh.tetrahedra, np.ones(len(mesh.tetrahedra), dtype=np.int32)))
    u = 0.05 * np.random.default_rng(1).normal(size=body.points.shape)
    u *= np.sin(3.0 * body.points[:, [1, 2, 0]])
    none = np.zeros(u.shape, dtype=bool)
    problem = problem_of(body, Ogden((1.0,), (2.0,)), none, np.zeros_like(u), nu=-1.0, mu=3.0)
    response = problem.response(F := problem.gradient(u))
    whole = felupe.Mesh(body.points, body.cells, "tetra10")
    field = felupe.FieldContainer([felupe.Field(felupe.RegionQuadraticTetra(whole), dim=3)])
    field[0].values[:] = u
    solid = felupe.SolidBody(felupe.NeoHooke(mu=3.0, bulk=0.0), field)
    forces = solid.assemble.vector(field).toarray().reshape(-1, 3)
    np.testing.assert_allclose(problem.residual(u, F, response), forces, atol=1e-10)
    tangent = solid.assemble.matrix(field).toarray()
    np.testing.assert_allclose(problem.tangent(u, response).toarray(), tangent, atol=1e-8)


def bar():
    """A unit cube that slides on three of its faces."""
    mesh = cube(1)
    body = Body(TetMesh(mesh.points, mesh.tetrahedra, np.ones(len(mesh.tetrahedra), dtype=np.int32)))
    return body, body.points == 0.0


def test_growth_that_is_free_swells_by_itself():
    body, held = bar()
    growth = np.full((len(body.cells), 1), np.log(1.1))
    force = np.zeros_like(body.points)
    found = balance(problem_of(body, LAWS[0], held, np.zeros_like(force), growth=growth, loads=(lambda u: force,)))
    # a cube of 1 with a volume of 1.1
    np.testing.assert_allclose(found.u, body.points * (1.1 ** (1 / 3) - 1.0), atol=1e-5)


def test_several_right_sides_are_solved_as_each_alone():
    mesh = cube(3)
    body = Body(TetMesh(mesh.points, mesh.tetrahedra, np.ones(len(mesh.tetrahedra), dtype=np.int32)))
    held = np.repeat((body.points[:, 2] == 0.0)[:, None], 3, axis=1)
    problem = problem_of(body, LAWS[0], held, np.zeros(held.shape), nu=0.47)
    u = np.zeros(held.shape)
    linear = linearised(problem, u, problem.response(problem.gradient(u)))
    right = np.random.default_rng(0).normal(size=(u.size, 3))
    right[:, 2] = 0.0
    together = linear.solve(right, 1e-5)
    free = np.flatnonzero(~held)
    matrix = linear.whole.toarray().astype(float)[np.ix_(free, free)]
    exact = np.linalg.solve(matrix, right[free])
    np.testing.assert_allclose(together[free], exact, atol=1e-3 * np.abs(exact).max())
    assert not together[held.ravel()].any() and not together[:, 2].any()
    np.testing.assert_allclose(linear.solve(right[:, 0], 1e-5), together[:, 0], atol=1e-3 * np.abs(exact).max())


@pytest.mark.parametrize("lifts", [False, True])
def test_what_lets_go_is_stopped_along_the_wall_s_normal_alone(small_body, lifts):
    held = small_body.nodes("side")[:, None].repeat(3, axis=1)
    problem = problem_of(small_body, LAWS[0], held, np.zeros(held.shape))
    found = Contact(centre=(0.13, 0.065, 0.1), size=0.02, lifts=lifts).act(problem)
    loose = held[:, 0] & ~found.held[:, 0]
    # corners of quadratic triangles too, whose part of an area is rounding
    assert loose[: len(small_body.mesh.points)].any() and loose[len(small_body.mesh.points) :].any()
    outward = np.zeros(held.shape)
    outward[:, 0] = 1e-3
    wall = found.springs(outward)[0][loose]
    assert (wall[:, 0, 0] > 0.0).all()
    # beside an edge of the body the normal begins to turn
    assert (wall[:, 0, 0] > 0.7 * np.trace(wall, axis1=1, axis2=2)).all()
    assert np.median(wall[:, 0, 0] / np.trace(wall, axis1=1, axis2=2)) == pytest.approx(1.0)
    assert found.springs(-outward)[0][loose].any() == (not lifts)


def test_what_lets_go_slides_around_a_curved_wall():
    radius, angle = 0.1, 0.1
    mesh = box((3, 40, 4), (0.02, 1.0, 0.02))
    x, turn, z = mesh.points.T
    around = np.stack([(radius - 0.02 + x) * np.cos(turn), (radius - 0.02 + x) * np.sin(turn), z], axis=1)
    body = Body(TetMesh(around, mesh.tetrahedra, np.ones(len(mesh.tetrahedra), dtype=np.int32)))
    middle = (np.abs(z - 0.01) < 0.006) & (np.abs(turn - 0.5) < 0.2) & (x > 0.0199)
    turned = around[middle] @ np.array(
        [[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    normals, gap = Skull(body).gap(turned)
    radial = turned * [1.0, 1.0, 0.0]
    np.testing.assert_allclose(normals, radial / np.linalg.norm(radial, axis=1)[:, None], atol=1e-3)
    # faces of 2.5 mm are 8 um inside the circle in their middle; a plane would be left by 0.5 mm
    assert np.abs(gap).max() < 1e-5 < 0.01 * radius * (1.0 - np.cos(angle)) * 100.0


def test_creep_goes_from_the_stiff_answer_to_the_soft_one():
    body, held = bar()
    top = body.faces(body.mesh.points[:, 2] == 1.0)
    force = top.spread((-100.0 * top.areas)[..., None] * np.array([0.0, 0.0, 1.0]))
    problem = problem_of(body, LAWS[0], held, np.zeros_like(force), loads=(lambda u: force,))
    end = balance(problem).u[:, 2].min()
    times = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 64.0]
    found = [b.u[:, 2].min() for b in creep(problem, [(1.0, 1.0)], times)]
    # a solid of equal branches creeps in twice the time it relaxes in: u = end (1 - exp(-t/2) / 2), nearly linear here:
    # 0.016 off
    assert found[0] > found[3] > found[-1]
    assert found[-1] == pytest.approx(end, rel=1e-3)
    assert found[3] / end == pytest.approx(1.0 - 0.5 * np.exp(-1.0), abs=0.025)


def test_a_load_that_is_put_on_in_steps_ends_where_it_does_at_once(small):
    problem = draw_setting(np.random.default_rng(4), "phantom", timed=False).problem()
    at_once, in_steps = balance(problem), balance_in_steps(problem, 3)
    # forces balance to 1e-5
    np.testing.assert_allclose(in_steps.u, at_once.u, atol=1e-4 * np.abs(at_once.u).max())
    assert in_steps.left < BALANCED
