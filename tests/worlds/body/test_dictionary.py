"""Every mechanism of the registry is looked for, or says in a sentence why not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from folders import write_recorded
from hollow import hollow
from slow_block import CAUSES, write_slow

from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.worlds.body.dictionary import dictionary_of
from warpbrain.worlds.body.states import States


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return write_slow(tmp_path_factory.mktemp("block") / "case", CAUSES["viscoelasticity"])


@pytest.fixture
def resected(tmp_path: Path) -> Case:
    """A cube with a void, held below, without a corner; no node set names a wall."""
    _, mesh = hollow()
    block = read_case(write_recorded(tmp_path))
    fixed = replace(block.boundaries[0], nodes="fixed")
    beads = tuple(one for one in block.recordings if one.name == "beads")
    tissues = {1: block.tissues[1]}
    return replace(block, mesh=mesh, tissues=tissues, boundaries=(fixed,), recordings=beads, mechanisms=(Resection(),))


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
    made = [proposal.make(proposal.mean) for proposal in proposals]
    for nodes in {one.drained for one in made}:
        found = [one.permeability for one in made if one.drained == nodes]
        assert found == sorted(found)
        assert found[len(found) // 2] == pytest.approx(3e-13)
        # what was measured of brain, and what models of brain shift take
        assert found[1] < 1e-14 and found[-2] > 1e-11 and found[-1] > 5e-11
        assert max(np.diff(np.log(found))[1:-1]) < np.log(4.0)


def test_resection_names_what_stands_for_it(block: Case) -> None:
    assert "'cavity'" in dictionary_of(block, ["resection"], 1).rejected["resection"]


@pytest.mark.parametrize(("kind", "parameter"), [("pressure", "nodes"), ("contact", "nodes"), ("drainage", "drained")])
def test_every_free_surface_is_a_place(kind: str, parameter: str, resected: Case) -> None:
    dictionary = dictionary_of(resected, [kind], 2)
    free = dictionary.situation.free
    assert [one.words for one in free] == ["wall of the cavity", "outer surface", "wall of the void"]
    made = [proposal.make(proposal.mean) for proposal in dictionary.proposals[kind]]
    assert {getattr(one, parameter) for one in made} >= {surface.name for surface in free}
    for one in made:
        if getattr(one, parameter) in dictionary.situation.mesh.node_sets:
            one.check(dictionary.situation.mesh)


def test_every_free_surface_has_patches_of_traction(resected: Case) -> None:
    situation = dictionary_of(resected, ["traction"]).situation
    for surface in situation.free:
        middles = situation.mesh.points[surface.faces].mean(axis=1)
        apart = np.linalg.norm(situation.surface_sites[:, None] - middles, axis=2).min(axis=1)
        assert (apart < 1e-9).any(), surface.words


def test_states_have_a_set_for_every_place(block: Case) -> None:
    states = States(block, "cpu")
    free = dictionary_of(block, ["pressure"]).situation.free
    assert {surface.name for surface in free} - block.mesh.node_sets.keys()
    assert {surface.name for surface in free} <= states.case.mesh.node_sets.keys()
