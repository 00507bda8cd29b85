"""Every mechanism of the registry is looked for, or says in a sentence why not."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from folders import write_recorded
from hollow import hollow
from scipy.stats import special_ortho_group
from slow_block import CAUSES, write_slow

from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case
from warpbrain.cases.shipped import find_case
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.traction import Traction
from warpbrain.physics.proposal import Follows, Proposal
from warpbrain.worlds.body.dictionary import dictionary_of, is_linear, situation_of
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.linearisation import Linearisation
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


def _at_one_point() -> Linearisation:
    """Of a body whose extent is 1.6 m, where one point is recorded."""
    sensors = SimpleNamespace(is_displacement=np.ones(3, dtype=bool), groups=np.zeros(3, dtype=int))
    return cast(Linearisation, SimpleNamespace(extent=np.sqrt(8.0 / 3.0), sensors=sensors))


@pytest.mark.parametrize("mechanism", [Fibres(stiffness=1.0, direction=(1.0, 0.0, 0.0)), Swelling(amount=0.1)])
@pytest.mark.parametrize("follows", ["proportional", "smooth"])
def test_only_loads_may_move_a_body_by_more_than_its_size(follows: Follows, mechanism: Mechanism) -> None:
    at = _at_one_point()

    def of(made: Mechanism, response: float) -> Effect:
        return Effect(Proposal.of_one(lambda _: made, 0.0, 1.0, follows), np.zeros(3), np.full((3, 1), response))

    assert is_linear(of(mechanism, 0.1), at)
    assert not is_linear(of(mechanism, 1e200), at)
    assert is_linear(of(Traction(centre=(0.0, 0.0, 0.0), value=(0.0, 0.0, 1.0), radius=0.1), 1e3), at)


def test_whether_an_effect_is_linear_is_the_same_in_any_axes() -> None:
    at, rotation = _at_one_point(), special_ortho_group.rvs(3, random_state=0)
    proposal = Proposal.of_one(lambda _: Swelling(amount=0.1), 0.0, 1.0, "smooth")
    for size, linear in ((1.62, True), (1.64, False)):
        for direction in (np.eye(3)[:, :1], rotation[:, :1]):
            assert is_linear(Effect(proposal, np.zeros(3), size * direction), at) == linear


def bare_beam() -> Case:
    """The silicone beam without its weight and what hangs at its tip."""
    beam = find_case("beam-52g")
    clamp = tuple(boundary for boundary in beam.boundaries if boundary.kind == "fixed")
    return replace(beam, boundaries=clamp, mechanisms=())


def test_what_is_stiffer_than_brain_has_its_weight_in_air() -> None:
    beam = bare_beam()
    [hanging] = dictionary_of(beam, ["gravity"]).proposals["gravity"]
    weight = cast(Gravity, hanging.make(hanging.mean)).nodal_forces(beam.mesh).sum(axis=0)
    np.testing.assert_allclose(weight, [0.0, 0.0, -beam.density * 9.81 * beam.mesh.volume], rtol=1e-9, atol=1e-9)
    assert hanging.odds == "causes.weight"
    softer = Gravity.proposals(replace(situation_of(beam), stiffness=1.0))
    assumed = Gravity.proposals(replace(situation_of(beam), assumed=frozenset({"gravity"})))
    for levels in (softer, assumed):
        assert len(levels) > 1 and {proposal.odds for proposal in levels} == {"causes.mechanism"}


def test_something_hangs_on_an_edge_that_a_case_declares() -> None:
    situation = situation_of(bare_beam())
    [edge] = situation.unused
    patches = [proposal for proposal in Traction.proposals(situation) if not proposal.declared]
    assert all(proposal.centre is not None for proposal in patches)
    [hung] = [proposal for proposal in Traction.proposals(situation) if proposal.declared]
    assert hung.make(np.array([0.5])) == Traction(nodes=edge, force=(0.0, 0.0, -0.5))
    anyhow = Traction.proposals(replace(situation, gravity_axis=None))[-1]
    assert anyhow.make(np.array([0.5, 0.1, 0.2])) == Traction(nodes=edge, force=(0.5, 0.1, 0.2))
    # as large as what a patch bears
    largest = max(patches, key=lambda proposal: float(proposal.radius or 0.0))
    of_patch = largest.make(np.array([0.0, 0.0, float(largest.sd[2])])).nodal_forces(situation.mesh).sum(axis=0)
    np.testing.assert_allclose(hung.sd, np.linalg.norm(of_patch), rtol=0.5)
