"""One effect is found again with its size; beside it, what is in no dictionary is left as the unknown."""

import pytest
from sinking_block import diagnose_sinking

from warpbrain.diagnosis.result import NAMED_AND_REST, Diagnosis
from warpbrain.physics.mechanisms.pressure import Pressure


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """Of a block that sinks and is pressed from a side, which touches what is held: no pressure is looked for there."""
    return diagnose_sinking(tmp_path_factory.mktemp("pressed") / "case", (Pressure(value=150.0, nodes="side"),))


def test_one_is_found_with_its_size(small_diagnosis: Diagnosis) -> None:
    assert [one.kind for one in small_diagnosis.named] == ["gravity"]
    level = next(value for value in small_diagnosis.named[0].values if value.name == "csf_level")
    assert abs(level.value - 30.0) < 3.0 * level.sd
    # tissue that is twice as soft does not hide it: 256 nats are a detectability of 23 at least
    assert small_diagnosis.named[0].detectability > 20.0


def test_what_no_mechanism_explains_gets_no_name_beside_one(pressed: Diagnosis) -> None:
    assert [one.kind for one in pressed.named] == ["gravity"]
    assert pressed.verdict == NAMED_AND_REST
    assert pressed.unknown is not None
