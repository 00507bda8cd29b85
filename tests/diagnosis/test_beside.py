"""One effect, and two at once: refits of what the model itself made find it again."""

import pytest
from sinking_block import diagnose_sinking

from warpbrain.diagnosis.result import EXPLAINED, Diagnosis
from warpbrain.physics.mechanisms.pressure import Pressure

#: Pressure on a side of the block [Pa], and the level of the fluid around it [mm].
PRESSURE, LEVEL = 150.0, 30.0


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """Of a block that sinks, and is pressed from the side."""
    return diagnose_sinking(tmp_path_factory.mktemp("two") / "case", (Pressure(value=PRESSURE, nodes="side"),))


def near(found: Diagnosis, kind: str, name: str, truth: float) -> bool:
    value = next(value for one in found.named if one.kind == kind for value in one.values if value.name == name)
    return abs(value.value - truth) < 3.0 * value.sd


def test_one_is_found_with_its_size(small_diagnosis: Diagnosis) -> None:
    assert [one.kind for one in small_diagnosis.named] == ["gravity"]
    assert near(small_diagnosis, "gravity", "csf_level", LEVEL)


def test_two_are_found_with_their_sizes(two: Diagnosis) -> None:
    assert {one.kind for one in two.named} == {"gravity", "pressure"}
    assert near(two, "gravity", "csf_level", LEVEL)
    assert near(two, "pressure", "value", PRESSURE)


def test_both_are_in_the_case_that_explains(two: Diagnosis) -> None:
    assert two.explained is not None
    assert {mechanism.kind for mechanism in two.explained.mechanisms} == {"gravity", "pressure"}
    assert two.fits[EXPLAINED].residual.std() < 1.2 * two.base.typical_noise
    # recordings that nothing was fitted to: declared, refitted, explained
    assert two.fit.check is not None and two.fit.check[2] < 0.5 * two.fit.check[1]
