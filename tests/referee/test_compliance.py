"""The declared body that participants are given, against FElupe and against itself with a small load more."""

from dataclasses import replace

import felupe
import numpy as np
import pytest

from referee.challenge.export import neutral_case
from referee.compliance import neo_hookean
from referee.compliance.neo_hookean import NeoHookeanBody
from referee.compliance.response import DeclaredResponse
from warpbrain.cases.boundary import Displaced, Forced


@pytest.fixture(scope="module")
def case(small_case):
    return small_case


def test_forces_and_tangent_are_those_of_felupe(case, verify):
    body = NeoHookeanBody(case)
    mesh = felupe.Mesh(case.mesh.points, case.mesh.tetrahedra.astype(int), "tetra")
    u = 2e-3 * np.random.default_rng(1).normal(size=case.mesh.points.shape)
    forces, matrix = np.zeros(u.size), 0.0
    for mu, lam in sorted({*zip(body.mu.tolist(), body.lam.tolist(), strict=True)}):
        own = felupe.Mesh(mesh.points, mesh.cells[body.mu == mu], "tetra")
        field = felupe.FieldContainer([felupe.Field(felupe.RegionTetra(own), dim=3, values=u)])
        solid = felupe.SolidBody(felupe.NeoHookeCompressible(mu, lam), field)
        forces += solid.assemble.vector(field).toarray().ravel()
        matrix = matrix + solid.assemble.matrix(field)
    F = body.gradient(u.ravel())
    found = body.nodal(body.stress(F))
    away = np.abs(found - forces).max() / np.abs(forces).max()
    verify("internal forces of the challenge's neo-Hookean body", "FElupe, the same mesh", away, 1e-10)
    away = abs(body.tangent(F) - matrix).max() / abs(matrix).max()
    verify("tangent stiffness of the challenge's neo-Hookean body", "FElupe, the same mesh", away, 1e-10)


def test_rows_of_a_small_force_are_those_of_the_body_with_it(case, verify, monkeypatch):
    monkeypatch.setattr(neo_hookean, "_CLOSE", 1e-10)
    monkeypatch.setattr(neo_hookean, "_LINEAR", 1e-8)
    response = DeclaredResponse(NeoHookeanBody(case))
    total = np.array([0.0, 2e-3, 1e-3])
    more = replace(case, boundaries=(*case.boundaries, Forced(name="more", nodes="ventricle", total=tuple(total))))
    body = NeoHookeanBody(more)
    moved = response.rows_of.reading @ (body.declared - response.body.declared)
    rows = response.forces((body.load - response.body.load)[:, None])[:, 0]
    force = response.rows_of.kind == "force"
    away = np.abs(rows - moved)[~force].max() / np.abs(moved[~force]).max()
    # of second order in a force that moves points by a few micrometres
    verify("recordings of a small force, by the adjoint", "finite difference of two equilibria", away, 5e-3)
    cap = np.repeat(case.mesh.node_sets["superior"], 3)
    change = (body.nodal(body.stress(body.gradient(body.declared))) - response.inner)[cap].reshape(-1, 3).sum(axis=0)
    away = np.abs(rows[force] - change).max() / np.abs(change).max()
    verify("force of a boundary under a small force, by the adjoint", "two equilibria", away, 5e-3)


def test_rows_of_a_support_that_gives_way_are_those_of_the_body_with_it(case, verify, monkeypatch):
    monkeypatch.setattr(neo_hookean, "_CLOSE", 1e-10)
    monkeypatch.setattr(neo_hookean, "_LINEAR", 1e-8)
    response = DeclaredResponse(NeoHookeanBody(case))
    gives = (2e-5, -1e-5, 1e-5)
    base, _, cap = case.boundaries
    side = Displaced(name="side", nodes="side", times=(0.0,), values=(gives,))
    body = NeoHookeanBody(replace(case, boundaries=(base, side, cap)))
    moved = response.rows_of.reading @ (body.declared - response.body.declared)
    move = (case.mesh.node_sets["side"][:, None] * np.array(gives)).reshape(-1, 1)
    rows, points = response.motions(move)[:, 0], response.rows_of.kind != "force"
    away = np.abs(rows - moved)[points].max() / np.abs(moved[points]).max()
    verify("recordings of a support that moves, by the adjoint", "finite difference of two equilibria", away, 5e-3)


def test_a_case_in_the_neutral_format(case):
    found = neutral_case(case)
    rows = len(found.recorded)
    assert found.cause_response.shape == (rows, len(found.cause_name)) and np.isfinite(found.cause_response).all()
    assert {*found.cause_name} >= {"gravity", "pressure", "traction", "swelling", "inclusion", "asymmetry", "contact"}
    assert found.site_response.shape == (rows, len(found.site_place), 3)
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0
    # three directions of one traction are one candidate
    tractions = found.cause_candidate[found.cause_name == "traction"]
    assert (np.unique(tractions, return_counts=True)[1] == 3).all()
