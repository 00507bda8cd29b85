"""What `theta` means, and the parts a prior falls into."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import GREY, WHITE, beads, block, truth

from warpbrain.errors import InputError, SolveError
from warpbrain.estimation.parameters import Parameters, prior_modes, prior_of
from warpbrain.estimation.sweep import sweep
from warpbrain.gp.sampling import SWEEP, law_of_curve
from warpbrain.gp.trained import trained
from warpbrain.physics.laws import MooneyRivlin, NeoHookean, Ogden


def test_laws_and_parameters_are_the_same_thing() -> None:
    laws = (MooneyRivlin(100.0, 300.0), Ogden((-300.0,), (-6.0,)))
    case = block(dict(zip(("grey", "white"), laws, strict=True)), "pushed")
    parameters = Parameters.of(case)
    theta = parameters.theta_of(laws)
    np.testing.assert_allclose(theta, [np.log(800.0), 0.75, np.log(900.0), -6.0])
    assert parameters.names == (
        "grey: ln(mu0 / Pa)", "grey: C2 / (C1 + C2)", "white: ln(mu0 / Pa)", "white: alpha"
    )  # fmt: skip
    for found, law in zip(parameters.laws(theta), laws, strict=True):
        assert found.shear_modulus == pytest.approx(law.shear_modulus)
    assert parameters.applied(case, theta).tissues[2].law == parameters.laws(theta)[1]
    with pytest.raises(InputError, match="expected 4 numbers"):
        parameters.laws(theta[:2])
    with pytest.raises(InputError, match="white: Ogden"):
        parameters.require_possible([np.log(800.0), 0.75, np.log(900.0), 0.5])


def test_tissues_of_one_group_are_one_tissue() -> None:
    case = block({"grey": GREY, "white": WHITE}, "pushed")
    one = {label: replace(tissue, prior="hyperelastic/brain") for label, tissue in case.tissues.items()}
    parameters = Parameters.of(replace(case, tissues=one))
    assert parameters.tissues == ("grey and white",) and parameters.labels == ((1, 2),) and len(parameters) == 1
    assert {m.law for m in parameters.materials([7.0]).values()} == {NeoHookean(np.exp(7.0))}
    one[2] = replace(one[2], model="ogden")
    with pytest.raises(InputError, match=r"\[tissue.2\] prior: white and grey are one tissue"):
        Parameters.of(replace(case, tissues=one))


@pytest.mark.slow(10)
def test_exponents_of_either_sign_are_modes() -> None:
    case = block({"brain": WHITE}, "pushed").with_law("ogden")
    modes = prior_modes(prior_of(case), Parameters.of(case))
    assert sum(mode.share for mode in modes) == pytest.approx(1.0)
    negative, positive = sorted(modes, key=lambda mode: mode.gaussian.mean[1])
    assert negative.high[1] < -2.0 and positive.low[1] > 1.0
    assert negative.low[1] == -np.inf and positive.high[1] == np.inf


def test_a_sweep_is_of_the_curves_and_finds_the_nearest() -> None:
    model = trained("coregionalised", "as_published")
    law = law_of_curve(model, "hyperelastic/brain", SWEEP[11]).law()
    case = block({"brain": law}, "gravity", cells=2)
    seen = replace(case, recordings=(beads(truth(case)),))
    found = sweep(seen, model, device="cpu")
    assert sorted(point.k[0] for point in found.points) == list(SWEEP) and len(SWEEP) == 17
    assert found.best.k == (SWEEP[11],) and found.best.error < 1e-9
    assert found.parameters.laws(found.best.theta) == (law,)
    # what is known already is not computed again
    known = {point.k: replace(point, error=7.0) for point in found.points[1:]}
    again = []
    resumed = sweep(seen, model, known=known, device="cpu", on_point=again.append)
    assert again == [found.points[0]] and resumed.best == found.points[0]


def test_a_sweep_without_any_equilibrium() -> None:
    case = block({"brain": WHITE}, "pushed", cells=2)
    seen = replace(case, recordings=(beads(truth(case)),))
    heavy = replace(seen, boundaries=(seen.boundaries[0], replace(seen.boundaries[1], total=(0.0, 0.0, -1e4))))
    found = sweep(heavy, trained(), values=(0.0,), device="cpu")
    assert found.points[0].error is None and "no equilibrium" in found.points[0].reason
    with pytest.raises(SolveError, match="no equilibrium at any of 1 points"):
        _ = found.best
