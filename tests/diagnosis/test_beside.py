"""One effect is found with its size; beside it another by its name, and what is in no dictionary as the unknown."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sinking_block import OPTIONS, write_sinking

from warpbrain.cases.case import Case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.inference.decide import NAMED, NAMED_AND_REST
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.traction import Traction

# two processes would each make what these tests share
pytestmark = pytest.mark.xdist_group("beside")


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A block that sinks and is pressed from a side, a node set that touches what is held.

    It is pulled at its top by a load that is declared: that tells how stiff it is, without which a smooth force of any
    size explains all that acts on softer tissue.
    """
    known = Traction(value=(400.0, 0.0, 300.0), centre=(0.03, 0.03, 0.06), radius=0.025)
    pushed = Pressure(value=150.0, nodes="side")
    case = write_sinking(Path(tmp_path_factory.mktemp("pressed")) / "case", (pushed, known))
    return replace(case, mechanisms=(known,))


def test_one_is_found_with_its_size(small_diagnosis: Diagnosis) -> None:
    assert [one.kind for one in small_diagnosis.named] == ["gravity"]
    level = next(value for value in small_diagnosis.named[0].values if value.name == "csf_level")
    assert abs(level.value - 30.0) < 3.0 * level.sd
    # tissue that is twice as soft does not hide it: 256 nats are a detectability of 23 at least
    assert small_diagnosis.named[0].detectability > 20.0


@pytest.fixture(scope="module")
def in_one_and_two_threads(pressed: Case) -> list[Diagnosis]:
    found = []
    for count in ("1", "2"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("OMP_NUM_THREADS", count)
            found.append(Diagnosing(pressed, replace(OPTIONS, mesh_error=True), "cpu").run())
    return found


@pytest.mark.slow(40)
def test_it_is_the_same_to_the_bit_in_one_thread_and_in_two(in_one_and_two_threads: list[Diagnosis]) -> None:
    one, two = in_one_and_two_threads
    assert one.decision == two.decision and one.rejected == two.rejected and one.p_value == two.p_value
    pairs = zip(one.search.weighted_sets, two.search.weighted_sets, strict=True)
    for first, second in pairs:
        assert first.names == second.names
        assert first.hypothesis.log_evidence == second.hypothesis.log_evidence
        np.testing.assert_array_equal(first.best_residual, second.best_residual)
    assert one.search.base.states.solves == two.search.base.states.solves and one.confusion.rows == two.confusion.rows


@pytest.mark.slow(1)
def test_a_pressure_on_a_set_that_touches_what_is_held_is_named_beside_it(
    in_one_and_two_threads: list[Diagnosis],
) -> None:
    _, found = in_one_and_two_threads
    assert found.verdict in (NAMED, NAMED_AND_REST)
    assert {one.kind for one in found.named} == {"gravity", "pressure"}
    [side] = [one for one in found.named if one.kind == "pressure"]
    assert side.region == "side"
    value = next(value for value in side.values if value.name == "value")
    assert abs(value.value - 150.0) < 4.0 * value.sd


@pytest.mark.slow(10)
def test_what_no_mechanism_explains_gets_no_name_beside_one(pressed: Case) -> None:
    options = replace(OPTIONS, candidates=("gravity", "swelling", "falx"))
    found = Diagnosing(pressed, options, "cpu").run()
    assert [one.kind for one in found.named] == ["gravity"]
    assert found.verdict == NAMED_AND_REST
    assert found.unknown is not None
