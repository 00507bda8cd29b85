"""What acts in one place between the places of a scan: found, with its centre and radius."""

from dataclasses import replace

import numpy as np
import pytest

from warpbrain.diagnosis.placing import placed
from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.diagnosis.stage import Stage, compared, linear_point
from warpbrain.worlds.body.dictionary import candidates_at, dictionary_of
from warpbrain.worlds.body.parameters import values_of


def stage_of(diagnosis, kind: str, move, radius: float, size) -> tuple[Stage, np.ndarray]:
    """A block in which something acts at a place that no scan has, and that place."""
    base = diagnosis.base
    candidates = candidates_at(dictionary_of(diagnosis.case, [kind]), base.effects, {})
    local = [effect for effect in candidates.effects if effect.proposed.elsewhere is not None]
    middle = np.mean([effect.proposed.centre for effect in local], axis=0)
    top = np.array([*middle[:2], 1.0]) if kind == "traction" else middle
    nearest = min(local, key=lambda effect: np.linalg.norm(effect.proposed.centre - top))
    centre = nearest.proposed.centre + np.asarray(move)
    [truth] = base.effects.of([nearest.proposed.elsewhere(centre, radius)])
    noise = base.explanation.factor @ np.random.default_rng(2).normal(size=len(base.residual))
    residual = truth.mean + truth.columns @ np.asarray(size) + noise
    stage = compared(base, (), candidates, base.explanation, residual, 1.0, 40, np.random.default_rng(3))
    return stage, centre


CASES = [
    ("swelling", (0.003, 0.004, -0.002), 0.015, [4.0]),
    ("traction", (0.004, -0.003, 0.0), 0.012, [1.0, 0.5, -2.0]),
]


@pytest.fixture(scope="module", params=CASES, ids=[case[0] for case in CASES])
def found(request, small_diagnosis):
    kind, *rest = request.param
    stage, centre = stage_of(small_diagnosis, kind, *rest)
    number = stage.screen.best_effect(stage.candidates, kind)
    return stage, centre, stage.candidates.effects[number], placed(stage, number)


@pytest.fixture(scope="module")
def refit(found):
    """As `found`, with the effect."""
    stage, centre, best, refined = found
    return stage, centre, best, refined.effect


def begun(stage, effect):
    begin = linear_point(stage.explanation, stage.residual, stage.explanation.nuisances, effect, 1.0)
    return begin[-effect.columns.shape[1] :]


def test_a_place_is_found_between_sites(refit):
    stage, centre, best, effect = refit
    where, _ = effect.proposed.place(effect.coefficients(begun(stage, effect)))
    off = np.linalg.norm(where - centre)
    # what noise leaves open: at most 1.6 mm off
    assert off < 0.003
    assert off <= np.linalg.norm(best.proposed.centre - centre) + 1e-4


def test_it_is_worth_more_than_the_best_site_and_pays_for_its_place(refit):
    stage, _, best, effect = refit
    white = stage.explanation.whitened(stage.residual)[:, None]
    site, between = StackEvidence(stage.explanation, stage.explanation.stack([best, effect])).log_places(white)[:, 0]
    assert between > site - 3.0


def test_its_columns_are_what_moving_it_changes(refit):
    stage, _, best, effect = refit
    proposal = effect.proposed
    z = (proposal.start - proposal.mean) / proposal.sd
    count = len(best.proposed)
    for k in range(count, len(proposal)):
        changes = []
        for sign in (-1.0, 1.0):
            place = proposal.place(effect.coefficients(z + 0.02 * sign * np.eye(len(z))[k]))
            beside = replace(best.proposed.elsewhere(*place), follows="smooth", start=proposal.start[:count])
            changes.append(stage.candidates.makes.of([beside])[0])
        first = [one.mean + one.columns @ z[:count] for one in changes]
        slope = (first[1] - first[0]) / 0.04
        assert np.linalg.norm(slope - effect.columns[:, k]) < 1e-3 * np.linalg.norm(slope)


def test_what_is_said_of_it_are_its_amount_its_centre_and_its_radius(refit):
    stage, _, _, effect = refit
    size = effect.columns.shape[1]
    values = {value.name: value for value in values_of(effect, begun(stage, effect), 0.01 * np.eye(size))}
    assert values["radius"].unit == "mm"
    assert values["radius"].sd > 0.0
    assert values["centre_x"].sd > 0.0
    assert ("amount" in values) != ("value_size" in values)
    # along the surface only
    if effect.proposed.on_surface:
        assert size == 3 + 2 + 1
        assert "centre_z" not in values or values["centre_z"].sd < 1e-6


def test_what_the_mesh_leaves_open_of_the_place_is_told(found):
    stage, _, _, refined = found
    placing = refined.effect.proposed.placing
    open_ = np.linalg.norm(refined.unresolved, axis=0)
    whole = np.linalg.norm(refined.effect.columns[:, -placing:], axis=0)
    assert refined.unresolved.shape == (len(stage.residual), placing)
    assert np.all(open_ > 0.0)
    assert np.all(open_ < 3.0 * whole)
