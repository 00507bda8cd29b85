"""One effect is found with its size; beside it another by its name, and what is in no dictionary as the unknown."""

from dataclasses import replace
from pathlib import Path

import pytest
from sinking_block import OPTIONS, write_sinking

from warpbrain.cases.case import Case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.diagnosis.result import NAMED, NAMED_AND_REST, Diagnosis
from warpbrain.physics.mechanisms.pressure import Pressure


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A block that sinks and is pressed from a side, a node set that touches what is held."""
    return write_sinking(Path(tmp_path_factory.mktemp("pressed")) / "case", (Pressure(value=150.0, nodes="side"),))


def test_one_is_found_with_its_size(small_diagnosis: Diagnosis) -> None:
    assert [one.kind for one in small_diagnosis.named] == ["gravity"]
    level = next(value for value in small_diagnosis.named[0].values if value.name == "csf_level")
    assert abs(level.value - 30.0) < 3.0 * level.sd
    # tissue that is twice as soft does not hide it: 256 nats are a detectability of 23 at least
    assert small_diagnosis.named[0].detectability > 20.0


def test_a_pressure_on_a_set_that_touches_what_is_held_is_named_beside_it(pressed: Case) -> None:
    found = Diagnosing(pressed, OPTIONS, "cpu").run()
    assert found.verdict in (NAMED, NAMED_AND_REST)
    assert {one.kind for one in found.named} == {"gravity", "pressure"}
    [side] = [one for one in found.named if one.kind == "pressure"]
    assert side.region == "side"
    value = next(value for value in side.values if value.name == "value")
    assert abs(value.value - 150.0) < 4.0 * value.sd


def test_what_no_mechanism_explains_gets_no_name_beside_one(pressed: Case) -> None:
    options = replace(OPTIONS, candidates=("gravity", "swelling", "falx"))
    found = Diagnosing(pressed, options, "cpu").run()
    assert [one.kind for one in found.named] == ["gravity"]
    assert found.verdict == NAMED_AND_REST
    assert found.unknown is not None
