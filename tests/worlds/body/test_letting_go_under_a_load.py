"""A weight that is not declared draws a block off its foot: about rest, where nothing pulls, no contact is seen."""

from dataclasses import replace

import numpy as np
import pytest
from gel import block_of_gel, with_beads

from warpbrain.arrays import Bools, Floats
from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case
from warpbrain.physics.mechanisms.contact import Contact
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.hypotheses import HypothesisSearch, screened

SIDE, NOISE, POINTS = 0.06, 1e-4, 60
BOTH = frozenset({"gravity", "contact"})


WEIGHT = Gravity(direction=(0.6, 0.0, 0.8), density=1000.0)


def hanging(case: Case, loose: Bools) -> Floats:
    """Displacement (N, 3) [m] of a block that hangs from its foot and slides along it at some of its nodes (N,)."""
    mesh, foot = case.mesh, case.mesh.node_sets["foot"]
    mesh = mesh.with_node_sets({**mesh.node_sets, "loose": loose, "still": foot & ~loose})
    acting = (WEIGHT, *((Contact(nodes="loose", state="sliding"),) if loose.any() else ()))
    model = model_of(replace(case, mesh=mesh, boundaries=(Fixed(name="foot", nodes="still"),), mechanisms=acting))
    return EquilibriumSolver(System(model, "cpu")).solve(model.external_forces()).u


def recorded(loose_below: float) -> Case:
    """The block, loose where `x` [m] is less than some; neither weight nor contact is declared."""
    case = block_of_gel((6, 6, 5), (SIDE, SIDE, SIDE), axis=2, mu=1000.0)
    u = hanging(case, case.mesh.node_sets["foot"] & (case.mesh.points[:, 0] < loose_below))
    rng = np.random.default_rng(0)
    at = SIDE * rng.uniform(0.05, 0.95, (POINTS, 3))
    return with_beads(case, u, at, NOISE, rng)


@pytest.fixture(scope="module")
def search() -> HypothesisSearch:
    return screened(recorded(0.031), "cpu", mesh_error=False, mechanisms=sorted(BOTH))


@pytest.mark.slow(4)
def test_it_is_weighed_under_the_reactions_to_the_load(search: HypothesisSearch) -> None:
    load, contact, both = search.get(("gravity",)), search.get(("contact",)), search.get(BOTH)
    assert load is not None and both is not None
    gain = both.hypothesis.log_evidence - load.hypothesis.log_evidence
    assert gain > 5.0
    # alone it does nothing
    assert contact is None or contact.hypothesis.log_evidence < search.nothing.hypothesis.log_evidence + 1.0


def test_it_is_what_an_equilibrium_with_it_changes(search: HypothesisSearch) -> None:
    base, mesh = search.base, search.base.at.system.model.mesh
    true = mesh.node_sets["foot"] & (mesh.points[:, 0] < 0.031)
    sliding = [
        e.proposed
        for e in search.candidates.effects["contact"]
        if e.is_release and not e.proposed.make(e.proposed.mean).lifts
    ]
    proposed = max(sliding, key=lambda p: (p.released.members & true).sum() - (p.released.members & ~true).sum())
    state = base.states.solve(replace(base.declared.hypothesis, mechanisms=(WEIGHT,)), base.declared.u)
    effects = Effects(state.linearised())
    [solved] = effects.solving_releases(base.states, state).of([proposed])
    [first_order] = effects.of([proposed])
    case, none = base.states.case, np.zeros(len(mesh.points), dtype=bool)
    change = hanging(case, proposed.released.members) - hanging(case, none)
    expected = state.sensors.by_displacement @ change.ravel()
    size = np.linalg.norm(expected)
    assert solved.is_solved and not first_order.is_solved
    assert np.linalg.norm(solved.mean - expected) < 1e-3 * size < np.linalg.norm(first_order.mean - expected)


@pytest.mark.slow(1)
def test_it_is_found(search: HypothesisSearch) -> None:
    search.fit()
    best = search.weighted_sets[0]
    assert best.names == BOTH and best.refit is not None
    released = best.effects[best.acting.index("contact")].proposed.released.members
    mesh = search.base.at.system.model.mesh
    loose = mesh.node_sets["foot"] & (mesh.points[:, 0] < 0.031)
    assert (released & loose).sum() > 0.5 * (released | loose).sum()
