"""A truth written as plain data comes back the same, and moves the walls the same."""

import numpy as np
import pytest
from hollow import hollow

from concealed.body import body_of
from concealed.draw import draw
from concealed.record import Truth, read_truth, write_truth
from concealed.sealing import open_sealed, sealed
from concealed.support_effects import MisjudgedLevel
from concealed.trial import Trial


@pytest.fixture(scope="module")
def whole():
    return hollow()[1]


def made(whole, seed: int) -> tuple[Truth, Trial]:
    body = body_of(whole, "left")
    drawn = draw(seed, 0, body)
    trial = Trial(drawn, body, (np.unique(body.ventricle), np.unique(body.cavity)))
    truth = Truth(name="0529", seed=seed, attempt=0, wanted=(1e-3, 2e-3), drawn=drawn, strength=20.0, level=0.1301)
    return truth, trial


@pytest.mark.parametrize("seed", range(12))
def test_a_draw_is_repeatable_and_plausible(whole, seed):
    body = body_of(whole, "left")
    drawn = draw(seed, 3, body)
    assert drawn == draw(seed, 3, body)
    assert drawn != draw(seed, 4, body)
    assert abs(drawn.main.strength) == 1.0
    assert all(abs(effect.strength) <= effect.limit for effect in drawn.others)
    tissue = drawn.tissue
    assert abs(tissue.k_grey) <= 2.0 and abs(tissue.k_white) <= 2.0
    assert 0.46 <= tissue.poisson <= 0.485
    assert 0.8 <= drawn.blur.noise_scale <= 1.25
    assert 0.3e-3 <= np.linalg.norm(drawn.blur.shift) <= 0.7e-3
    assert 0.3 <= np.degrees(np.linalg.norm(drawn.blur.rotation)) <= 0.7


def test_moduli_are_the_generative_model_s(whole):
    tissue = draw(0, 0, body_of(whole, "left")).tissue
    assert 532.1 <= tissue.moduli()[1] <= 2334.15
    assert 316.59 <= tissue.moduli()[2] <= 1212.35
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (4000, 3))
    # a standard deviation of 4,000 numbers has a Monte Carlo error of 1.1 %, and more where they are near: 0.4 % off
    assert tissue.field(points).std() == pytest.approx(tissue.field_sd, rel=0.02)


def test_a_truth_comes_back_from_its_seal(whole):
    # a truth names the versions of what its mesh was made with
    pytest.importorskip("nilearn")
    truth, trial = made(whole, 1)
    data = write_truth(truth, trial, whole)
    back = read_truth(open_sealed(sealed(data)))
    again = Trial(back.drawn, trial.body, trial.nodes)
    assert (back.strength, back.level, back.wanted) == (truth.strength, truth.level, truth.wanted)
    for one, other in zip(
        trial.observed(truth.strength, truth.level), again.observed(back.strength, back.level), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)


def test_the_declared_level_is_the_true_one_unless_it_was_misjudged(whole):
    levels = set()
    for seed in range(40):
        truth, _ = made(whole, seed)
        off = sum(effect.strength for effect in truth.drawn.others if isinstance(effect, MisjudgedLevel))
        assert truth.declared_level == pytest.approx(0.1301 + off, abs=6e-4)
        levels.add(off == 0.0)
    assert levels == {True, False}
