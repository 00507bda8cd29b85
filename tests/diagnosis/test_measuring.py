"""What a further measurement would tell, against what is known of it beforehand."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from warpbrain.diagnosis.measuring import imitations, next_measurements
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.inference import Cause, GaussianModel, Kind, Place
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.words import Measurement
from warpbrain.worlds.body.causes import BodyCauses


def _told(diagnosis: Diagnosis, first: str, second: str) -> tuple[Measurement, ...]:
    sets = [next(one for one in diagnosis.search.weighted_sets if name in one.mechanisms) for name in (first, second)]
    return next_measurements(diagnosis.search.base, *sets, (first, second))


def test_a_head_that_is_turned_shows_weight_anew(small_diagnosis: Diagnosis) -> None:
    told = {one.what: one.expected_nats for one in _told(small_diagnosis, "gravity", "swelling")}
    [turned] = [nats for what, nats in told.items() if "turned" in what]
    # a second look at the same points tells no less, and no measurement less than none
    assert turned > told["nothing more"] > 0.0
    assert min(told.values()) == told["nothing more"]
    # a surface without a node set of its own is called what people call it
    assert "25 more tracked points on 'outer surface'" in told


def test_what_turns_with_the_head_is_not_told_apart_by_turning_it(small_diagnosis: Diagnosis) -> None:
    assert not [one for one in _told(small_diagnosis, "swelling", "pressure") if "turned" in one.what]


@pytest.mark.parametrize("axis", range(3))
def test_weight_turns_back_with_the_head(axis: int) -> None:
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_rotvec(0.5 * np.eye(3)[axis])
    weight = Gravity(direction=(0.0, 0.6, -0.8), density=1000.0)
    back = weight.with_body_turned(rotation.as_matrix()).with_body_turned(rotation.inv().as_matrix())
    np.testing.assert_allclose(back.direction, weight.direction, atol=1e-15)


def test_what_another_cause_explains_is_a_projection_however_many_of_its_columns_say_the_same() -> None:
    random = np.random.default_rng(7)
    model = GaussianModel(np.eye(60), np.zeros((60, 0)))
    span, pattern = random.normal(size=(60, 6)), random.normal(size=(60, 1))
    # 40 columns of rank 6, some of them tiny
    columns = span @ random.normal(size=(6, 40)) * np.logspace(0.0, -14.0, 40)
    effects: Any = (SimpleNamespace(proposed=SimpleNamespace(over_time=None)),)
    causes = (
        Cause("weight", (Place(pattern),), 0.0),
        Cause("unknown", (Place(columns), Place(random.normal(size=(60, 1)) * 0.0)), 0.0, kind=Kind.UNKNOWN),
    )
    told = imitations(BodyCauses(causes, {"weight": effects}), model).rows["weight"]["unknown"]
    left = pattern[:, 0] - span @ np.linalg.lstsq(span, pattern[:, 0], rcond=None)[0]
    assert told == pytest.approx(1.0 - left @ left / (pattern[:, 0] @ pattern[:, 0]), rel=1e-9)
