"""Points are spread evenly and always the same; noise and misalignment are what they say."""

import numpy as np
import pytest

from concealed.observing import SIGMA, Blur, rms, spread
from concealed.publish import read_recording, recording_text
from concealed.published import MEDIANS, NAMES
from concealed.targets import draw_targets

BLUR = Blur(
    noise_scale=1.2,
    shared_sigma=0.2e-3,
    shared_length=0.02,
    shift=(0.001, 0.0, 0.0),
    rotation=(0.0, 0.0, 0.01),
    seed=5,
)


def test_spread_is_even_and_repeatable():
    points = np.random.default_rng(0).uniform(size=(400, 3))
    chosen = spread(points, 30)
    np.testing.assert_array_equal(chosen, spread(points, 30))
    assert len(set(chosen.tolist())) == 30

    def nearest(rows):
        apart = np.linalg.norm(points[rows][:, None] - points[rows][None], axis=2)
        return (apart + 9.0 * np.eye(len(rows))).min(axis=1).min()

    assert nearest(chosen) > 2.0 * nearest(np.arange(30))
    with pytest.raises(ValueError, match="400 points, 401 wanted"):
        spread(points, 401)


def test_misalignment_is_rigid():
    random = np.random.default_rng(1)
    points, u, middle = 0.1 * random.normal(size=(50, 3)), 1e-3 * random.normal(size=(50, 3)), np.zeros(3)
    moved = points + BLUR.misaligned(points, u, middle)
    before = np.linalg.norm((points + u)[:, None] - (points + u)[None], axis=2)
    np.testing.assert_allclose(np.linalg.norm(moved[:, None] - moved[None], axis=2), before, atol=1e-12)
    turned = BLUR.misaligned(np.array([[0.1, 0.0, 0.0]]), np.zeros((1, 3)), middle)[0]
    np.testing.assert_allclose(turned, [0.001 + 0.1 * (np.cos(0.01) - 1), 0.1 * np.sin(0.01), 0.0], atol=1e-12)


def test_noise_has_its_size_and_is_shared_by_neighbours():
    random = np.random.default_rng(2)
    points = 0.3 * random.uniform(size=(600, 3))
    # pairs a millimetre apart
    points[300:] = points[:300] + 0.001
    noise = BLUR.noise(points)
    np.testing.assert_array_equal(noise, BLUR.noise(points))
    # Monte Carlo error: 1.4 % of the root mean square, 2.7 % off with this seed
    assert rms(noise) == pytest.approx(np.sqrt(BLUR.mean_square), rel=0.04)
    common = (noise[:300] * noise[300:]).mean()
    # pairs share exp(-1.7 mm / 20 mm) = 92 % of it, and 900 products have a Monte Carlo error of 11 %: 7.7 % off
    assert common == pytest.approx((1.2 * 0.2e-3) ** 2, rel=0.15)
    assert BLUR.mean_square > 3.0 * (1.2 * SIGMA) ** 2


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_targets_have_the_published_medians(seed):
    targets = draw_targets(seed)
    assert tuple(targets) == NAMES
    motion = 1e3 * np.array(list(targets.values()))
    np.testing.assert_allclose(np.median(motion, axis=0), MEDIANS)
    assert (motion > 0.5 * np.array(MEDIANS)).all() and (motion < 2.0 * np.array(MEDIANS)).all()
    assert motion.std(axis=0).min() > 0.15


def test_a_recording_comes_back(tmp_path):
    random = np.random.default_rng(3)
    points, u = 0.1 * random.normal(size=(7, 3)), 1e-3 * random.normal(size=(7, 3))
    text = recording_text("0529", "cavity", points, u)
    assert text.startswith("# stand-in for clinical case 0529, not a patient")
    assert text.splitlines()[1] == "x,y,z,ux,uy,uz,id"
    (tmp_path / "x.csv").write_text(text, encoding="utf-8")
    back = read_recording(tmp_path / "x.csv")
    np.testing.assert_allclose(back[0], points, atol=6e-8)
    np.testing.assert_allclose(back[1], u, atol=6e-8)
