"""Every mechanism of the registry is looked for, or says in a sentence why not."""

import pytest
from slow_block import CAUSES, write_slow

from warpbrain.cases.case import Case
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.worlds.body.dictionary import dictionary_of


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return write_slow(tmp_path_factory.mktemp("block") / "case", CAUSES["viscoelasticity"])


@pytest.mark.parametrize("instants", [1, 3])
@pytest.mark.parametrize("kind", mechanisms())
def test_it_proposes_or_says_why_not(kind: str, instants: int, block: Case) -> None:
    found = dictionary_of(block, [kind], instants)
    if kind in found.proposals:
        assert found.proposals[kind]
    else:
        why = found.rejected[kind].removeprefix("not testable with these data: ")
        assert len(why.split()) > 3
        assert "more than is known of this case" not in why


@pytest.mark.parametrize("kind", ["drainage", "viscoelasticity"])
def test_what_changes_in_time_needs_times(kind: str, block: Case) -> None:
    assert "two times or more" in dictionary_of(block, [kind], 1).rejected[kind]
    assert kind in dictionary_of(block, [kind], 2).proposals


def test_permeabilities_are_as_probable_as_expected(block: Case) -> None:
    proposals = dictionary_of(block, ["drainage"], 2).proposals["drainage"]
    found = [proposal.make(proposal.mean).permeability for proposal in proposals]
    assert found == sorted(found)
    assert found[len(found) // 2] == pytest.approx(1e-10)
    assert found[0] < 1e-11 and found[-1] > 1e-9


def test_resection_names_what_stands_for_it(block: Case) -> None:
    assert "'cavity'" in dictionary_of(block, ["resection"], 1).rejected["resection"]
