"""Fields without a name: what each can and cannot do to a body."""

import numpy as np
import pytest
from recorded_reaction import with_reaction
from slow_block import CAUSES, TIMES, write_slow

from warpbrain.estimation.parameters import declared
from warpbrain.mesh import nodes_of
from warpbrain.mesh.refinement import refined
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.nuisances import other_volume
from warpbrain.worlds.body.states import Hypothesis, States
from warpbrain.worlds.body.unknown import (
    FieldLoad,
    body_forces,
    field_proposal,
    fields,
    pressures,
    resistances,
    unit_stresses,
)


@pytest.fixture(scope="module")
def at(small_diagnosis) -> Linearisation:
    return small_diagnosis.base.at


def test_an_eigenstress_has_no_net_force_and_no_moment(at, verify):
    corners = (at.system.model.mesh.points + at.u)[at.system.model.mesh.tetrahedra]
    forces = unit_stresses(corners)
    weights = np.random.default_rng(0).random(len(corners))
    total = np.einsum("m,cmai->ci", weights, forces)
    moment = np.einsum("m,cmai->ci", weights, np.cross(corners[None], forces))
    size = np.abs(forces).sum(axis=(1, 2, 3)).max()
    worst = max(np.abs(total).max(), np.abs(moment).max() / np.ptp(corners)) / size
    verify("field of eigenstress: net force and moment", "zero, whatever the field", worst, 1e-12)


def test_a_uniform_pressure_of_it_is_the_load_on_the_surface(at):
    """The nodal forces of a uniform stress are those of its traction on the boundary (divergence theorem)."""
    mesh = at.system.model.mesh
    forces = unit_stresses(mesh.points[mesh.tetrahedra])
    nodal = np.zeros(mesh.points.shape)
    np.add.at(nodal, mesh.tetrahedra, forces[:3].sum(axis=0))
    a, b, c = mesh.points[mesh.boundary].transpose(1, 0, 2)
    on_surface = np.zeros(mesh.points.shape)
    np.add.at(on_surface, mesh.boundary, np.repeat(np.cross(b - a, c - a)[:, None] / 6.0, 3, axis=1))
    np.testing.assert_allclose(nodal, on_surface, atol=1e-12 * np.abs(on_surface).max())


def test_a_uniform_pressure_of_it_moves_what_it_does_on_the_surface(at):
    """The answer of the sensors to it is that to its nodal forces, whatever the order of the corners of elements."""
    mesh = at.system.model.mesh
    forces = unit_stresses((mesh.points + at.u)[at.system.tetrahedra])[:3].sum(axis=0)
    nodal = np.zeros(mesh.points.shape)
    corners = (mesh.points + at.u)[mesh.tetrahedra]
    np.add.at(nodal, mesh.tetrahedra, unit_stresses(corners)[:3].sum(axis=0))
    answer = at.answers_of_components(forces[None], np.ones((len(forces), 1)))[:, 0, 0]
    np.testing.assert_allclose(answer, at.answers(-nodal[None])[:, 0], atol=1e-9 * np.abs(answer).max())


def test_a_pressure_of_a_great_length_is_a_uniform_one_on_what_is_free(at):
    """Its one mode moves the sensors as the nodal forces do of which those of a closed surface would have no sum."""
    model, mesh = at.system.model, at.system.model.mesh
    a, b, c = mesh.points[mesh.boundary].transpose(1, 0, 2)
    nodal = np.zeros(mesh.points.shape)
    np.add.at(nodal, mesh.boundary, np.repeat(np.cross(b - a, c - a)[:, None] / 6.0, 3, axis=1))
    assert np.linalg.norm(nodal.sum(axis=0)) < 1e-12 * np.abs(nodal).sum()
    answer = at.answers(np.where(model.constrained, 0.0, nodal)[None])[:, 0]
    modes = pressures(at, 1e3).columns
    assert modes.shape[1] == 1
    rows = at.sensors.is_displacement
    size = np.sqrt(np.mean(answer[rows] ** 2))
    same = modes[:, 0] * np.sign(modes[:, 0] @ answer)
    np.testing.assert_allclose(same[rows], answer[rows] / size, atol=1e-6 * np.abs(same).max())


@pytest.fixture(scope="module")
def every_field(at):
    lengths = [0.01, 0.024]
    return fields(at, lengths, body_forces(at, lengths))


def test_fields_are_of_one_metre(at, every_field):
    rows = at.sensors.is_displacement
    assert {name.split(",")[0] for name in every_field} == {"body force", "eigenstress", "pressure", "traction"}
    for field in every_field.values():
        np.testing.assert_allclose(np.mean(np.sum(field.columns[rows] ** 2, axis=1)), 1.0)


def test_columns_of_fields_are_those_of_the_loads_that_fits_have(at, every_field):
    for field in every_field.values():
        [effect] = Effects(at).of([field_proposal(field, 1e-3)])
        columns = 1e-3 * field.columns
        np.testing.assert_allclose(effect.columns, columns, atol=1e-9 * np.abs(columns).max())
        assert not effect.mean.any()


def test_what_holds_a_body_bears_what_fields_do_to_it(at):
    """The held nodes carry the resultant of the load, which is the same whether it is a column or a load of a fit."""
    recorded, lengths = with_reaction(at), [0.024]
    for name, field in fields(recorded, lengths, body_forces(recorded, lengths)).items():
        reactions = field.columns[-3:]
        for mode, reaction in zip(np.eye(field.columns.shape[1]), reactions.T, strict=True):
            forces = field.nodal_forces(at.system.model.mesh, mode)
            np.testing.assert_allclose(forces.sum(axis=0), -reaction, atol=1e-7 * np.abs(forces).sum(), err_msg=name)


def test_nothing_presses_on_faces_that_are_held(at, every_field):
    model = at.system.model
    finer, ends = refined(model.mesh)
    held = model.constrained.all(axis=1)
    for mesh, fixed in ((model.mesh, held), (finer, held[ends].all(axis=1))):
        loaded = nodes_of(mesh.boundary[~fixed[mesh.boundary].all(axis=1)], len(mesh.points))
        assert (fixed & ~loaded).any(), "inside what is held"
        for name in ("traction, 24 mm", "pressure, 24 mm"):
            forces = every_field[name].nodal_forces(mesh, np.ones(every_field[name].columns.shape[1]))
            assert not forces[~loaded].any() and forces[loaded].any(axis=1).all()


def test_a_field_is_the_same_force_on_a_finer_mesh(at, every_field):
    """Their nodal forces do the same work on any motion that is linear in the position, as integrals of one density."""
    mesh = at.system.model.mesh
    finer, _ = refined(mesh)
    random = np.random.default_rng(3)
    for name, field in every_field.items():
        load = FieldLoad(field=field, coefficients=random.normal(size=field.columns.shape[1]))
        moments = []
        for each in (mesh, finer):
            forces = load.nodal_forces(each)
            arms = (each.points - mesh.points[0]) / mesh.radius
            moments.append(np.column_stack([forces.sum(axis=0), forces.T @ arms]))
        error = np.linalg.norm(moments[1] - moments[0]) / np.linalg.norm(moments[0])
        assert error < 0.15, name


def test_tissue_that_is_softer_at_one_time_moves_as_equilibria_of_softer_tissue(tmp_path):
    """At each time the body is in equilibrium with the moduli of that time (central differences)."""
    states = States(write_slow(tmp_path / "case", CAUSES["viscoelasticity"]), "cpu")
    theta, field = declared(states.case, states.parameters), np.zeros(states.modes.shape[1])
    assert len(theta) == 1, "the logarithm of the modulus"
    step = 1e-4
    softer, stiffer = (states.solve(Hypothesis(theta + sign * step, field)).sensors.computed for sign in (-1.0, 1.0))
    at = states.solve(Hypothesis(theta, field)).linearised()
    columns = resistances(at, TIMES, other_volume(states), np.zeros((len(at.sensors), 0)))
    rows = at.sensors.is_displacement
    assert np.mean(np.sum(columns[rows] ** 2, axis=1)) == pytest.approx(1.0)
    # more and more, less and less, and in between alone
    for course in ((0.0, 0.5, 1.0), (1.0, 0.3, 0.1), (0.0, 1.0, 0.0)):
        expected = np.interp(at.sensors.times, TIMES, course) * (softer - stiffer) / (2.0 * step)
        left = expected - columns @ np.linalg.lstsq(columns, expected, rcond=None)[0]
        assert np.linalg.norm(left) < 0.03 * np.linalg.norm(expected), "what `unknown.cut` leaves out"
