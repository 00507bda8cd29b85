"""Traits of forces that are known: from outside or within, how large, and where."""

import numpy as np
import pytest

from warpbrain.diagnosis.result import Diagnosis
from warpbrain.diagnosis.sentences import traits_in_words
from warpbrain.diagnosis.traits import Traits, traits_of
from warpbrain.inference import GaussianModel
from warpbrain.worlds.body.unknown import body_forces, force_patches

LENGTH = 0.012


def traits(found: Diagnosis, force: np.ndarray, number: int, within: bool) -> tuple[Traits, np.ndarray]:
    """Of a force at a site, which acts against one at another site where it is within; and where it is."""
    at = found.base.at
    sites, answers = force_patches(at, LENGTH)
    high = np.flatnonzero(sites[:, 2] > 0.03)
    own = high[number]
    effect = answers[:, own] @ force
    if within:
        near = high[np.argsort(np.linalg.norm(sites[high] - sites[own], axis=1))[1]]
        effect -= answers[:, near] @ force
    noise = found.base.typical_noise
    bare = GaussianModel(noise * np.eye(len(effect)), np.zeros((len(effect), 0)))
    effect = effect + noise * np.random.default_rng(3).normal(size=len(effect))
    return traits_of(at, bare, effect, noise, LENGTH, sites[own]), sites[own]


@pytest.mark.parametrize("number", [0, 7, 13])
def test_a_force_from_outside_is_found_with_its_size(number: int, small_diagnosis: Diagnosis) -> None:
    force = np.array([0.02, -0.03, 0.04])
    found, _ = traits(small_diagnosis, force, number, within=False)
    assert found.outside
    assert np.all(np.abs(found.force - force) < 3.5 * found.force_sd)
    assert "from outside" in traits_in_words(found, 0.06)


@pytest.mark.parametrize("number", [0, 7, 13])
def test_forces_within_have_no_net_force(number: int, small_diagnosis: Diagnosis) -> None:
    force = np.array([0.02, -0.03, 0.04])
    found, _ = traits(small_diagnosis, force, number, within=True)
    assert np.all(np.abs(found.force) < 3.5 * found.force_sd)
    assert found.outside == ("from outside" in traits_in_words(found, 0.06))


def test_forces_that_were_recorded_do_not_hide_displacements(small_diagnosis: Diagnosis) -> None:
    at = small_diagnosis.base.at
    [alone] = body_forces(at, [LENGTH])
    from dataclasses import replace

    rows = np.r_[np.arange(len(at.sensors)), 0]
    sensors = replace(at.sensors, directions=np.concatenate([at.sensors.directions, np.zeros((1, 3))]))
    sensors = replace(sensors, residual=at.sensors.residual[rows])
    beside = at.with_sensors(at.sensors)
    beside.sensors = sensors
    # a reaction [N] is a thousand times larger as a number than what moves
    beside._rows = np.concatenate([at.compliance, 1e4 * at.compliance[:1]]), np.arange(len(rows))
    [found] = body_forces(beside, [LENGTH])
    np.testing.assert_allclose(np.abs(found[:-1]), np.abs(alone), atol=1e-6)
