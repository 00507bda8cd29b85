"""A diagnosis composes mechanisms as a run does: what it predicts to first order, and what it does not try."""

from dataclasses import replace

import numpy as np
import pytest
from slow_block import CAUSES, write_slow
from verification_rows import Row

from warpbrain.cases.case import Case
from warpbrain.errors import SolveError
from warpbrain.estimation.parameters import declared
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.cavity import Cavity
from warpbrain.physics.mechanisms.drainage import Drainage
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.inclusion import Inclusion
from warpbrain.physics.mechanisms.residual_stress import ResidualStress
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.dictionary import dictionary_of
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.states import Hypothesis, States

#: What the tissue is made of beside its law.
MADE_OF = (
    Fibres(direction=(1.0, 0.0, 2.0), stiffness=3000.0, dispersion=0.1),
    ResidualStress(tension=300.0, direction=(0.0, 1.0, 1.0)),
)


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Case:
    case = write_slow(tmp_path_factory.mktemp("block") / "case", CAUSES["viscoelasticity"])
    sets = {"corner": (case.mesh.centres > 0.03).all(axis=1)}
    return replace(case, mesh=replace(case.mesh, element_sets=sets))


def inclusion(c: float) -> Mechanism:
    return Inclusion(ratio=float(np.exp(c)), elements="corner")


def swelling(c: float) -> Mechanism:
    return Swelling(amount=0.1 * c, elements="corner")


def solved(states: States) -> tuple[Hypothesis, Linearisation]:
    plain = Hypothesis(declared(states.case, states.parameters), np.zeros(states.modes.shape[1]))
    state = states.solve(plain)
    return plain, Linearisation(state.system, state.u, state.reactions, state.sensors)


@pytest.mark.parametrize("make", [inclusion, swelling], ids=["inclusion", "swelling"])
def test_to_first_order_it_is_the_difference_of_states(make, block: Case, verify: Row) -> None:
    """Of stiffness and growth, in tissue with fibres and tension."""
    states = States(replace(block, mechanisms=MADE_OF), "cpu")
    plain, at = solved(states)
    [effect] = Effects(at).of([Proposal.of_one(make, 0.0, 1.0, "smooth")])
    h = 0.02
    sides = [states.solve(replace(plain, mechanisms=(make(c),)), at.u).sensors.computed for c in (-h, h)]
    expected = (sides[1] - sides[0]) / (2.0 * h)
    error = np.abs(effect.columns[:, 0] - expected).max() / np.abs(expected).max()
    claim = f"diagnosis: first-order effect of {make.__name__} in tissue with fibres and tension"
    verify(claim, "central difference of equilibria", error, 1e-3)


def test_forces_that_go_with_moduli_are_all_but_a_tension(block: Case) -> None:
    """After a course in which stress relaxes, too: what still remembers is in none."""
    _, at = solved(States(replace(block, mechanisms=(MADE_OF[0], CAUSES["viscoelasticity"])), "cpu"))
    total = at.element_forces.sum(axis=1).reshape(at.u.shape)
    expected = at.internal_forces()
    assert np.abs(total - expected).max() < 1e-12 * np.abs(expected).max()
    assert [term.forces.numpy().any() for term in at.system.terms] == [
        term.forgets_in is None for term in at.system.terms
    ]


def test_what_has_no_meaning_with_the_case_is_not_tried(block: Case) -> None:
    case = replace(block, mechanisms=(Cavity(elements="corner"),))
    every, found = (dictionary_of(one, ["drainage", "traction"], 3) for one in (block, case))
    assert "cavity and drainage cannot act together" in found.rejected["drainage"]
    assert 0 < len(found.proposals["traction"]) < len(every.proposals["traction"])


def test_two_hypotheses_that_exclude_each_other_have_no_state(block: Case) -> None:
    states = States(block, "cpu")
    plain = Hypothesis(declared(states.case, states.parameters), np.zeros(states.modes.shape[1]))
    both = (Cavity(elements="corner"), Drainage(permeability=1e-9))
    with pytest.raises(SolveError, match="cavity and drainage cannot act together"):
        states.solve(replace(plain, mechanisms=both))
