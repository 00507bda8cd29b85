"""Traits of forces that are known: from outside or within, how large, and where."""

from dataclasses import replace

import numpy as np
import pytest
from recorded_reaction import with_reaction

from warpbrain.diagnosis.locating import Traits, traits_of
from warpbrain.diagnosis.result import Diagnosis, traits_in_words
from warpbrain.inference import GaussianModel
from warpbrain.worlds.body.unknown import body_forces, force_patches

LENGTH = 0.012


#: Heights [m] of sites that are far from what is held, and near to it.
FAR, NEAR = (0.045, 0.07), (0.0, 0.018)


def traits(
    found: Diagnosis, force: np.ndarray, number: int, within: bool, heights: tuple[float, float] = (0.03, 0.07)
) -> tuple[Traits, np.ndarray]:
    """Of a force at a site, which acts against one at another site where it is within; and where it is."""
    at = found.base.at
    sites, answers = force_patches(at, LENGTH)
    size = np.linalg.norm(answers, axis=(0, 2))
    high = np.flatnonzero((sites[:, 2] >= heights[0]) & (sites[:, 2] < heights[1]) & (size > 1e-3 * size.max()))
    own = high[number % len(high)]
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


def claims(found: Diagnosis, size: float, within: bool, heights: tuple[float, float]) -> list[Traits]:
    """Of forces of a size [N] in several places and directions."""
    directions = np.random.default_rng(1).normal(size=(10, 3))
    forces = size * directions / np.linalg.norm(directions, axis=1)[:, None]
    return [traits(found, force, 3 * k, within, heights)[0] for k, force in enumerate(forces)]


def test_a_net_force_is_claimed_where_nothing_held_can_carry_it(small_diagnosis: Diagnosis) -> None:
    far, near = (claims(small_diagnosis, 0.3, False, heights) for heights in (FAR, NEAR))
    assert sum(one.outside for one in far) >= 8
    # beside the table a stress in the block does nearly the same
    assert sum(one.outside for one in near) <= 5 and sum(one.hidden for one in near) >= 3
    hidden = next(one for one in near if one.hidden)
    assert "whether it has a net force cannot be told" in traits_in_words(hidden, 0.06)
    assert "in all" not in traits_in_words(hidden, 0.06)


@pytest.mark.parametrize("size", [0.2, 0.6])
def test_forces_beside_what_is_held_that_balance_are_no_force_from_outside(
    size: float, small_diagnosis: Diagnosis
) -> None:
    found = [one for heights in (NEAR, FAR) for one in claims(small_diagnosis, size, True, heights)]
    # what is said is right with 95 %
    assert sum(one.outside for one in found) <= 1


def test_a_recorded_reaction_tells_what_is_hidden(small_diagnosis: Diagnosis) -> None:
    at = small_diagnosis.base.at
    base, found = at.sensors, small_diagnosis
    weighed = with_reaction(at)
    sites, answers = force_patches(weighed, LENGTH)
    size = np.linalg.norm(answers[: len(base)], axis=(0, 2))
    near = np.flatnonzero((sites[:, 2] < NEAR[1]) & (size > 1e-3 * size.max()))
    noise = np.r_[np.full(len(base), found.base.typical_noise), np.full(3, 1e-3)]
    model = GaussianModel(np.diag(noise), np.zeros((len(noise), 0)))
    random = np.random.default_rng(2)
    told = []
    for site in near[:6].tolist():
        force = 0.3 * random.normal(size=3)
        effect = answers[:, site] @ force + noise * random.normal(size=len(noise))
        told.append(traits_of(weighed, model, effect, found.base.typical_noise, LENGTH, sites[site]))
    assert sum(one.outside for one in told) >= 4


def test_forces_that_were_recorded_do_not_hide_displacements(small_diagnosis: Diagnosis) -> None:
    at = small_diagnosis.base.at
    [alone] = body_forces(at, [LENGTH])
    rows = np.r_[np.arange(len(at.sensors)), 0]
    sensors = replace(at.sensors, directions=np.concatenate([at.sensors.directions, np.zeros((1, 3))]))
    sensors = replace(sensors, residual=at.sensors.residual[rows])
    beside = at.with_sensors(at.sensors)
    beside.sensors = sensors
    # a reaction [N] is a thousand times larger as a number than what moves
    of_sensors = at._rows[0][at._rows[1]]
    beside._rows = np.concatenate([of_sensors, 1e4 * of_sensors[:1]]), np.arange(len(rows))
    [found] = body_forces(beside, [LENGTH])
    np.testing.assert_allclose(np.abs(found.columns[:-1]), np.abs(alone.columns), atol=1e-6)
