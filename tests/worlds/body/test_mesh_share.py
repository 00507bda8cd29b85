"""The part of the mesh's error that belongs to mechanisms."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from slow_block import CAUSES, write_slow

from warpbrain.estimation.finer_mesh import Discretisation
from warpbrain.estimation.parameters import declared
from warpbrain.inference.beliefs import belief
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.mesh_error import FinerCase
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.mesh_error import FinerStates
from warpbrain.worlds.body.states import Hypothesis, SolvedState, States
from warpbrain.worlds.body.weighted_set import MeshShare, mesh_share_of


def test_a_share_does_not_change_with_mechanisms_beside():
    share = MeshShare(np.array([1.0, -2.0, 0.5]), np.array([0.3, -0.1]), 0.7)
    z = np.array([1.2, -0.4])
    beside = share.extended(5)
    for others in (np.zeros(3), np.array([3.0, -1.0, 2.0])):
        np.testing.assert_allclose(beside.at(np.append(z, others)), share.at(z), rtol=1e-14)
    np.testing.assert_allclose(share.at(z), share.answer * (0.7 + 0.3 * 1.2 + 0.1 * 0.4), rtol=1e-14)


def test_a_mechanism_that_is_left_out_keeps_its_part():
    share = MeshShare(np.array([1.0, -2.0, 0.5]), np.array([0.3, -0.1, 0.8]), 0.7)
    z = np.array([1.2, -0.4, 2.0])
    without = share.with_fixed(slice(1, 2), z[1:2])
    np.testing.assert_allclose(without.at(z[[0, 2]]), share.at(z), rtol=1e-14)


@pytest.mark.slow(3)
@pytest.mark.parametrize("poisson", [0.3, 0.47])
def test_a_body_that_moves_less_while_stress_relaxes_has_less_of_the_error(tmp_path, poisson, verify):
    """A block under its weight, on its mesh and on elements of half the size, followed in time on both."""
    case = write_slow(Path(tmp_path) / "case", CAUSES["viscoelasticity"])
    held = tuple(boundary for boundary in case.boundaries if boundary.kind == "fixed")
    case = replace(
        case, poisson=poisson, boundaries=held, mechanisms=(Gravity(density=1000.0, direction=(0.3, 0.0, -1.0)),)
    )
    of_mesh, of_finer = States(case, "cpu"), States(FinerCase(case).case, "cpu")

    def solved(states: States, *acting: Mechanism) -> SolvedState:
        field = np.zeros(states.modes.shape[1])
        return states.solve(Hypothesis(declared(case, states.parameters), field, acting))

    def recorded(*acting: Mechanism) -> np.ndarray:
        """What the finer mesh changes of what is recorded."""
        return solved(of_finer, *acting).sensors.computed - solved(of_mesh, *acting).sensors.computed

    any_case = SimpleNamespace(require_new=lambda _kind: None, instants=3)
    proposal = next(p for p in Viscoelasticity.proposals(any_case) if np.exp(p.mean[1]) > 99.0)
    z = (np.array([1.0, np.log(100.0)]) - proposal.mean) / proposal.sd
    state, finer = solved(of_mesh, proposal.make(proposal.mean + proposal.sd * z)), FinerStates(of_mesh)
    error = finer.error(state.hypothesis, solved(of_mesh))
    effect = Effect(proposal, np.zeros(len(state.sensors)), np.zeros((len(state.sensors), 2)))
    known = SimpleNamespace(of=lambda _theta, _prior: error)
    share = mesh_share_of([effect], [z], state, known, finer, None)
    true = recorded(CAUSES["viscoelasticity"]) - recorded()
    verify(
        f"error of the mesh of a block while its stress relaxes, less that in the end (Poisson's ratio {poisson:g})",
        "elements of half the size, followed in time",
        float(np.linalg.norm(share.at(z) / Discretisation().mean - true) / np.linalg.norm(true)),
        belief("mesh.share"),
    )
    # in proportion to the modulus, whatever the time in which it relaxes
    np.testing.assert_allclose(share.at(z * np.array([0.5, 1.0])), 0.5 * share.at(z))
    np.testing.assert_allclose(share.at(z + np.array([0.0, 1.0])), share.at(z))
