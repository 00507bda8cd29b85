"""Rigid errors of registration: finite turns, their derivatives, and that what was moved is moved back."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_motions import moved
from scipy.spatial.transform import Rotation
from simulated_draws import prior
from synthetic import WHITE, beads, block, lid, truth

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.estimation.estimate import Estimation
from warpbrain.estimation.forward import Forward
from warpbrain.estimation.likelihood import Likelihood, Noise
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.options import EstimationOptions
from warpbrain.estimation.parameters import Gaussian, PriorMode
from warpbrain.estimation.problem import Nuisances, Problem
from warpbrain.estimation.registration import moved_back, moved_back_columns, realigned, rigid_columns
from warpbrain.recordings.base import Registration
from warpbrain.worlds.body.nuisances import nuisances_at
from warpbrain.worlds.body.states import States

THETA = np.log([1000.0])


def motion(seed: int, shift: float, turn: float) -> np.ndarray:
    """A shift [m] and a turn [degrees] in any direction."""
    random = np.random.default_rng(seed)
    directions = random.normal(size=(2, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.concatenate([shift * directions[0], np.radians(turn) * directions[1]])


@pytest.mark.parametrize("turn", [0.0, 1e-4, 6.0, 170.0])
def test_motions_are_rigid_and_their_derivatives_those_of_differences(turn: float) -> None:
    by, centre = motion(1, 0.006, turn), np.array([0.01, -0.02, 0.03])
    points = np.random.default_rng(2).uniform(-0.08, 0.08, (20, 3))
    there = moved(points, by, centre)
    np.testing.assert_allclose(moved_back(there, by, centre), points, atol=1e-15)
    columns = moved_back_columns(there, by, centre)
    for k in range(6):
        step = 1e-6 * np.eye(6)[k]
        expected = (moved_back(there, by + step, centre) - moved_back(there, by - step, centre)) / 2e-6
        np.testing.assert_allclose(columns[:, :, k], expected, atol=1e-9)
    if turn == 0.0:
        np.testing.assert_allclose(
            rigid_columns(points, centre)[:, :, 3:],
            -np.cross((points - centre)[:, None], np.eye(3)).swapaxes(1, 2),
            atol=1e-15,
        )


def recorded(by: np.ndarray, surface: bool) -> Case:
    """A pushed block whose recordings were moved rigidly about the mean of their positions."""
    case = block({"brain": WHITE}, "pushed")
    result = truth(case)
    points = beads(result, count=80)
    seen = (points, lid(result)) if surface else (points,)
    centre = np.concatenate([points.points + points.displacement, *(one.points for one in seen[1:])]).mean(axis=0)
    back = np.concatenate([-Rotation.from_rotvec(by[3:]).inv().apply(by[:3]), -by[3:]])
    return realigned(replace(case, recordings=seen), back, centre)


@pytest.mark.parametrize("surface", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_an_exact_rigid_motion_is_recovered(seed: int, surface: bool, verify) -> None:
    by = motion(seed, 0.006, 6.0)
    case = recorded(by, surface)
    forward = Forward(case, THETA, "cpu")
    observations = Observations.to_fit(case)
    mode = PriorMode(1.0, Gaussian(THETA, np.eye(1)), np.full(1, -np.inf), np.full(1, np.inf))
    nuisances = Nuisances(registration=Registration(1.0, 10.0))
    problem = Problem(forward, observations, mode, Likelihood(), nuisances)
    state = forward.solve(THETA)
    rows = problem.seen(state, np.zeros(6))
    exact = Noise.of(rows, np.full(len(rows), 1e-5), 0.0, None, 1.0)
    best = problem.at_best(problem.at(state, np.zeros(6), exact))
    # about the mean of what was recorded, which the shift moved: the shift is turned along
    away = best.nuisances - np.concatenate([Rotation.from_rotvec(by[3:]).apply(by[:3]), by[3:]])
    verify(
        "a rigid error of registration of 6 mm and 6 degrees, of " + ("points and a surface" if surface else "points"),
        "the motion by which recordings were moved (SciPy's rotations)",
        float(np.abs(away).max()),
        1e-6,
        "m, rad",
    )


@pytest.mark.slow(3)
@pytest.mark.parametrize("declared", [None, Registration(0.003, 0.02)])
def test_an_estimate_takes_the_registration_that_a_diagnosis_takes(declared, small_diagnosis, monkeypatch) -> None:
    def accuracy(case: Case) -> np.ndarray:
        # 1 mm and 1 degree of a brain, whose radius is 65 mm
        return np.repeat([0.0154 * case.mesh.radius, np.radians(1.0)] if declared is None else [0.003, 0.02], 3)

    base = small_diagnosis.base
    case = replace(small_diagnosis.case, registration=declared)
    expected = accuracy(case)

    # in a diagnosis: columns over the sensors, and the motion by which recordings were moved
    states = States(case, "cpu")
    nuisances = nuisances_at(base.at, states, base.state.hypothesis.theta, base.prior, base.effects, None)
    columns = nuisances.columns[:, nuisances.part("registration")]
    np.testing.assert_allclose(columns, base.at.sensors.rigid * expected)
    states.motion = expected
    np.testing.assert_allclose(states.motion_coordinates, 1.0)

    # in an estimate: standard deviations of what is estimated along
    fitted = []
    monkeypatch.setattr(Estimation, "fit", lambda self, nuisances: fitted.append(nuisances) or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        Estimation(seen := replace(recorded(np.zeros(6), False), registration=declared), prior(1)).run()
    np.testing.assert_allclose(np.sqrt(np.diag(fitted[0].prior.covariance)), accuracy(seen))


@pytest.mark.parametrize("values", [(0.0, 0.1), (0.001, -1.0), (np.nan, 0.1)])
def test_registration_is_positive(values: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="expected a positive number"):
        Registration(*values)


def test_an_accuracy_among_options_is_refused() -> None:
    with pytest.raises(InputError, match="how accurate it is, is said by the case"):
        EstimationOptions(registration=Registration(0.001, 0.01))  # type: ignore[arg-type]
