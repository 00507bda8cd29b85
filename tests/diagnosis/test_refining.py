"""A patch that lets go between the places of a scan: found, with its centre and radius."""

import numpy as np
import pytest
from loosened_block import loosened

from warpbrain.diagnosis.refining import refined
from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.diagnosis.stage import Stage, linear_point
from warpbrain.worlds.body.dictionary import BETWEEN, RADII
from warpbrain.worlds.body.parameters import values_of

CENTRE, RADIUS = np.array([0.036, 0.024, 0.0]), 0.027


@pytest.fixture(scope="module")
def stage(small_diagnosis) -> Stage:
    return loosened(small_diagnosis, CENTRE, RADIUS, "lifting")


def test_a_patch_is_found_between_places(stage):
    assert RADIUS not in RADII
    number = stage.screen.best_effect(stage.candidates, "contact")
    found = refined(stage, number)
    effect = found.effect
    assert effect.columns.shape[1] == 4 and found.unresolved.shape == (len(stage.residual), 3)
    begin = linear_point(stage.explanation, stage.residual, stage.explanation.nuisances, effect, 1.0)
    centre, radius = effect.proposed.place(effect.coefficients(begin[-4:]))
    # of a mesh with edges of 12 mm, which neither resolves: 1.2 mm and 3.4 mm, 13 %, off
    assert np.linalg.norm(centre - CENTRE) < 0.0025
    assert radius == pytest.approx(RADIUS, rel=0.2)
    scanned = stage.screen.places[number, 0] + stage.screen.none[0]
    white = stage.explanation.whitened(stage.residual)[:, None]
    assert StackEvidence(stage.explanation, stage.explanation.stack([effect])).log_places(white)[0, 0] > scanned - 1.0


def test_what_is_said_of_it_are_its_centre_and_radius(stage):
    effect = refined(stage, stage.screen.best_effect(stage.candidates, "contact")).effect
    values = {value.name: value for value in values_of(effect, np.zeros(4), np.eye(4))}
    assert values["radius"].unit == "mm"
    assert 0.0 < values["radius"].sd < values["radius"].value
    # along the surface only
    assert "centre_z" not in values or values["centre_z"].sd < 1e-6
    assert 0.0 < values["centre_x"].sd <= 3.0 * BETWEEN
