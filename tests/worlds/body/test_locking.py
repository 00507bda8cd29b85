"""Less compressible tissue as a nuisance and as a candidate, and the error of the mesh between two tissues."""

from dataclasses import replace

import numpy as np
import pytest
from sinking_block import write_sinking

from warpbrain.estimation.options import Listener
from warpbrain.physics.mechanisms.compressibility import Compressibility
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.worlds.body.base import Base, BaseFinder
from warpbrain.worlds.body.nuisances import LAW, other_volume
from warpbrain.worlds.body.states import States


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Base:
    case = write_sinking(tmp_path_factory.mktemp("sinking") / "case")
    # as it says itself that it sinks: without a load there is no error
    weight = Gravity(direction=(0.0, 0.0, -1.0), density=1000.0, csf_level=0.03)
    states = States(replace(case, mechanisms=(weight,)), "cpu")
    return BaseFinder(states, 0.01, True, False, Listener()).find()


def test_how_the_error_depends_on_compressibility_is_left_to_the_share_of_mechanisms(base: Base) -> None:
    known, here = base.mesh_errors, base.state.hypothesis
    assert known is not None
    stiffer = replace(here, mechanisms=(Compressibility(poisson=0.46),))
    share = known.finer.error(stiffer, base.state).less(known.of(stiffer.theta, base.prior))
    assert share.size > 0.02 * known.error.size


def test_the_candidate_changes_what_the_nuisance_does(base: Base) -> None:
    [candidate] = base.effects.of([replace(other_volume(base.states), sd=np.array([1.2]))])
    own = base.nuisances.columns[:, base.nuisances.part(LAW)][:, :1]
    np.testing.assert_allclose(candidate.columns, 3.0 * own, rtol=1e-6, atol=1e-9)


def test_where_it_is_computed_anew_it_is_what_it_was_at_both(base: Base) -> None:
    known, theta = base.mesh_errors, base.state.hypothesis.theta
    assert known is not None
    softer = replace(base.state.hypothesis, theta=theta - 0.4)
    solved = known.finer.error(softer, base.state)
    renewed = known.with_error(solved, base.prior)
    for tissue, error in ((softer.theta, solved), (theta, known.error)):
        said = renewed.of(tissue, base.prior)
        np.testing.assert_allclose(said.u, error.u, atol=1e-12)
    # between them it is nearer than by the derivative from one end
    between = replace(softer, theta=theta - 0.2)
    there = known.finer.error(between, base.state)
    before, after = (each.of(between.theta, base.prior).less(there).size for each in (known, renewed))
    assert after < 0.8 * before
