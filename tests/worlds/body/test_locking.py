"""The error of the mesh grows as tissue is less compressible: as a nuisance and as a candidate."""

from dataclasses import replace

import numpy as np
import pytest
from sinking_block import write_sinking

from warpbrain.estimation.options import Listener
from warpbrain.physics.mechanisms.compressibility import Compressibility
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.worlds.body.base import Base, BaseFinder
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.mesh_error import expected_answer, volume_of
from warpbrain.worlds.body.nuisances import LAW, other_volume
from warpbrain.worlds.body.states import States


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Base:
    case = write_sinking(tmp_path_factory.mktemp("sinking") / "case")
    # as it says itself that it sinks: without a load there is no error
    weight = Gravity(direction=(0.0, 0.0, -1.0), density=1000.0, csf_level=0.03)
    states = States(replace(case, mechanisms=(weight,)), "cpu")
    return BaseFinder(states, 0.01, True, False, Listener()).find()


def test_it_is_known_of_tissue_that_is_less_compressible(base: Base) -> None:
    known, here = base.mesh_errors, base.state.hypothesis
    assert known is not None
    stiffer = replace(here, mechanisms=(Compressibility(poisson=0.46),))
    volume = volume_of(base.states.materials(stiffer))
    solved = known.finer.error(stiffer, base.state)
    said = known.with_tissue(here.theta, volume, base.prior)
    grown = np.linalg.norm(solved.u - known.error.u)
    assert grown > 0.02 * np.linalg.norm(known.error.u)
    # taken as linear in the logarithm of bulk moduli: 4.1 % off
    assert np.linalg.norm(said.u - solved.u) < 0.06 * grown


def test_the_candidate_changes_what_the_nuisance_does(base: Base) -> None:
    [candidate] = base.effects.of([replace(other_volume(base.states), sd=np.array([1.2]))])
    own = base.nuisances.columns[:, base.nuisances.part(LAW)][:, :1]
    np.testing.assert_allclose(candidate.columns, 3.0 * own, rtol=1e-6, atol=1e-9)
    # without the mesh's error it would change less
    [alone] = Effects(base.at).of([other_volume(base.states)])
    assert base.mesh_errors is not None
    locked = float(other_volume(base.states).sd[0]) * expected_answer(base.at.sensors, base.mesh_errors.by_volume)
    np.testing.assert_allclose(own[:, 0] - alone.columns[:, 0], locked, rtol=1e-6, atol=1e-9)
    assert np.linalg.norm(locked) > 0.02 * np.linalg.norm(own)


def test_where_it_is_computed_anew_it_is_what_it_was_at_both(base: Base) -> None:
    known, theta = base.mesh_errors, base.state.hypothesis.theta
    assert known is not None
    softer = replace(base.state.hypothesis, theta=theta - 0.4)
    solved = known.finer.error(softer, base.state)
    renewed = known.with_error(solved, base.prior)
    for tissue, error in ((softer.theta, solved), (theta, known.error)):
        said = renewed.with_tissue(tissue, known.volume, base.prior)
        np.testing.assert_allclose(said.u, error.u, atol=1e-12)
    # between them it is nearer than by the derivative from one end
    between = replace(softer, theta=theta - 0.2)
    there = known.finer.error(between, base.state)
    before, after = (each.of(between, base.prior).less(there).size for each in (known, renewed))
    assert after < 0.8 * before
