"""Where a surface lets go: the centre within its spread, and no place where any would do."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from warpbrain.diagnosis.dictionary import candidates_at, dictionary_of, patch_of
from warpbrain.diagnosis.effects import Effects
from warpbrain.diagnosis.letting_go import where_it_lets_go
from warpbrain.diagnosis.stage import Stage, compared

EDGE = 0.012


def _stage(diagnosis, centre: np.ndarray, radius: float, seed: int) -> Stage:
    """A block that is held at its bottom, which lets go on a patch that no scan has the place of."""
    base = diagnosis.base
    mesh = base.at.system.model.mesh
    held = mesh.node_sets["bottom"]
    at = copy.copy(base.at)
    at._surfaces, at._of_surfaces = {}, {}
    at.reactions = np.where(held[:, None], np.array([0.04, 0.02, -0.05]), 0.0)
    base = replace(base, at=at, effects=Effects(at))
    candidates = candidates_at(dictionary_of(diagnosis.case, ["contact"]), base.effects, {})
    patch = patch_of(mesh, "bottom", held, centre, radius)
    sliding = next(e for e in candidates.effects if e.proposed.make(e.proposed.mean).state == "sliding")
    truth = base.effects.of([sliding.proposed.of_patch(patch)])[0].mean
    residual = truth + base.explanation.factor @ np.random.default_rng(seed).normal(size=len(truth))
    return compared(base, (), candidates, base.explanation, residual, 1.0, 20, np.random.default_rng(3))


@pytest.mark.parametrize(("x", "y", "radius"), [(0.036, 0.024, 0.027), (0.006, 0.05, 0.03), (0.0, 0.0, 0.035)])
def test_the_centre_and_the_radius_are_within_their_spread(small_diagnosis, x, y, radius):
    centre = np.array([x, y, 0.0])
    found = where_it_lets_go(_stage(small_diagnosis, centre, radius, 2), "contact")
    # what the nodes of the mesh leave open cannot be told either
    assert np.all(np.abs(found.centre - centre) < 2.0 * np.hypot(found.centre_sd, EDGE / np.sqrt(12.0)))
    assert abs(found.radius - radius) < 2.0 * np.hypot(found.radius_sd, EDGE / np.sqrt(12.0))


def test_it_is_said_with_units_and_along_the_surface(small_diagnosis):
    found = where_it_lets_go(_stage(small_diagnosis, np.array([0.036, 0.024, 0.0]), 0.027, 2), "contact")
    values = {value.name: value for value in found.values}
    assert values["radius"].unit == "mm" and values["radius"].value == pytest.approx(1e3 * found.radius)
    assert set(values) == {"centre_x", "centre_y", "radius"}
    assert values["centre_x"].value == found.centre[0]


def test_of_what_lets_go_nearly_as_a_whole_no_centre_is_told(small_diagnosis):
    centre = np.array([0.03, 0.03, 0.0])
    part = where_it_lets_go(_stage(small_diagnosis, centre, 0.02, 4), "contact")
    whole = where_it_lets_go(_stage(small_diagnosis, centre, 0.036, 4), "contact")
    assert np.linalg.norm(whole.centre_sd) > 2.0 * np.linalg.norm(part.centre_sd)
    assert whole.radius > 0.03
