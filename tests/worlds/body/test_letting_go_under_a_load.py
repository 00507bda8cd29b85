"""A weight that is not declared draws a block off its foot: about rest, where nothing pulls, no contact is seen."""

from dataclasses import replace

import numpy as np
import pytest
from gel import block_of_gel, with_beads

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case
from warpbrain.physics.mechanisms.contact import Contact
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.worlds.body.hypotheses import HypothesisSearch, screened

SIDE, NOISE, POINTS = 0.06, 1e-4, 60
BOTH = frozenset({"gravity", "contact"})


def recorded(loose_below: float) -> Case:
    """A block that hangs from its foot and slides along it where `x` [m] is less than some; neither is declared."""
    case = block_of_gel((6, 6, 5), (SIDE, SIDE, SIDE), axis=2, mu=1000.0)
    foot = case.mesh.node_sets["foot"]
    loose = foot & (case.mesh.points[:, 0] < loose_below)
    mesh = case.mesh.with_node_sets({**case.mesh.node_sets, "loose": loose, "still": foot & ~loose})
    acting = (Gravity(direction=(0.6, 0.0, 0.8), density=1000.0), Contact(nodes="loose", state="sliding"))
    true = replace(case, mesh=mesh, boundaries=(Fixed(name="foot", nodes="still"),), mechanisms=acting)
    model = model_of(true)
    u = EquilibriumSolver(System(model, "cpu")).solve(model.external_forces()).u
    rng = np.random.default_rng(0)
    at = SIDE * rng.uniform(0.05, 0.95, (POINTS, 3))
    return with_beads(case, u, at, NOISE, rng)


@pytest.fixture(scope="module")
def search() -> HypothesisSearch:
    return screened(recorded(0.031), "cpu", mesh_error=False, mechanisms=sorted(BOTH))


def test_it_is_weighed_under_the_reactions_to_the_load(search: HypothesisSearch) -> None:
    load, contact, both = search.get(("gravity",)), search.get(("contact",)), search.get(BOTH)
    assert load is not None and both is not None
    gain = both.hypothesis.log_evidence - load.hypothesis.log_evidence
    assert gain > 5.0
    # alone it does nothing
    assert contact is None or contact.hypothesis.log_evidence < search.nothing.hypothesis.log_evidence + 1.0


@pytest.mark.slow(1)
def test_it_is_found(search: HypothesisSearch) -> None:
    search.fit()
    best = search.weighted_sets[0]
    assert best.names == BOTH and best.refit is not None
    released = best.effects[best.acting.index("contact")].proposed.released.members
    mesh = search.base.at.system.model.mesh
    loose = mesh.node_sets["foot"] & (mesh.points[:, 0] < 0.031)
    assert (released & loose).sum() > 0.5 * (released | loose).sum()
