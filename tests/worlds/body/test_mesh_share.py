"""The part of the mesh's error that belongs to mechanisms."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

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
from warpbrain.worlds.body.mesh_error import FinerStates, expected
from warpbrain.worlds.body.states import Hypothesis, SolvedState, States
from warpbrain.worlds.body.weighted_set import MeshShare, mesh_share_of

#: What viscosity asks of a situation.
_SEVERAL_TIMES: Any = SimpleNamespace(require_new=lambda _kind: None, instants=3)


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
        case, poisson=poisson, boundaries=held, mechanisms=(Gravity(density=100.0, direction=(0.3, 0.0, -1.0)),)
    )
    of_mesh, of_finer = States(case, "cpu"), States(FinerCase(case).case, "cpu")

    def solved(states: States, *acting: Mechanism) -> SolvedState:
        field = np.zeros(states.modes.shape[1])
        return states.solve(Hypothesis(declared(case, states.parameters), field, acting))

    def recorded(*acting: Mechanism) -> np.ndarray:
        """What the finer mesh changes of what is recorded."""
        return solved(of_finer, *acting).sensors.computed - solved(of_mesh, *acting).sensors.computed

    state = solved(of_mesh, CAUSES["viscoelasticity"])
    error = FinerStates(of_mesh).error(state.hypothesis, solved(of_mesh))
    corrected = of_mesh.corrected(state, expected(error)).sensors.computed - state.sensors.computed
    true = recorded(CAUSES["viscoelasticity"])
    verify(
        f"error of the mesh of a block while its stress relaxes (Poisson's ratio {poisson:g})",
        "elements of half the size, followed in time",
        float(np.linalg.norm(corrected / Discretisation().mean - true) / np.linalg.norm(true)),
        belief("mesh.share"),
    )
    # it has no share of its own: that of the state in the end is less where the body has moved less
    [proposal] = [p for p in Viscoelasticity.proposals(_SEVERAL_TIMES) if np.allclose(np.exp(p.mean[1:]), 100.0)]
    effect = Effect(proposal, np.zeros(len(state.sensors)), np.zeros((len(state.sensors), 2)))
    known = SimpleNamespace(of=lambda _theta, _prior: error)
    share = mesh_share_of([effect], [np.array([1.0, 0.0])], state, known, FinerStates(of_mesh), None)
    assert share is not None
    np.testing.assert_array_equal(share.answer, 0.0)
