"""Where a surface lets go: the centre within its spread, and no place where any would do."""

import numpy as np
import pytest
from loosened_block import loosened

from warpbrain.diagnosis.letting_go import where_it_lets_go

EDGE = 0.012


@pytest.mark.parametrize(("x", "y", "radius"), [(0.036, 0.024, 0.027), (0.006, 0.05, 0.03), (0.0, 0.0, 0.035)])
def test_the_centre_and_the_radius_are_within_their_spread(small_diagnosis, x, y, radius):
    centre = np.array([x, y, 0.0])
    found = where_it_lets_go(loosened(small_diagnosis, centre, radius, "sliding"), "contact")
    # what the nodes of the mesh leave open cannot be told either
    assert np.all(np.abs(found.centre - centre) < 2.0 * np.hypot(found.centre_sd, EDGE / np.sqrt(12.0)))
    assert abs(found.radius - radius) < 2.0 * np.hypot(found.radius_sd, EDGE / np.sqrt(12.0))


def test_it_is_said_with_units_and_along_the_surface(small_diagnosis):
    found = where_it_lets_go(loosened(small_diagnosis, np.array([0.036, 0.024, 0.0]), 0.027, "sliding"), "contact")
    values = {value.name: value for value in found.values}
    assert values["radius"].unit == "mm" and values["radius"].value == pytest.approx(1e3 * found.radius)
    assert set(values) == {"centre_x", "centre_y", "radius"}
    assert values["centre_x"].value == found.centre[0]


def test_of_what_lets_go_nearly_as_a_whole_no_centre_is_told(small_diagnosis):
    centre = np.array([0.03, 0.03, 0.0])
    part = where_it_lets_go(loosened(small_diagnosis, centre, 0.02, "sliding", 4), "contact")
    whole = where_it_lets_go(loosened(small_diagnosis, centre, 0.036, "sliding", 4), "contact")
    assert np.linalg.norm(whole.centre_sd) > 2.0 * np.linalg.norm(part.centre_sd)
    assert whole.radius > 0.03
