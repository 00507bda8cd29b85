"""Rods whose answer is known, made by closed forms and an initial value problem, not by the tool's own states."""

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp
from testing_machine import recorded

from warpbrain.cases.specimen import Specimen
from warpbrain.recordings.recording import TestRecording

ROD = Specimen("cylinder", (8e-3, 8e-3, 5e-3), "lubricated")
MU = 700.0


def neo_hookean(l: np.ndarray) -> np.ndarray:
    return MU * (l - l**-2.0)


def ogden(l: np.ndarray, alpha: float) -> np.ndarray:
    return 2.0 * MU / alpha * (l ** (alpha - 1.0) - l ** (-0.5 * alpha - 1.0))


def viscous(time: np.ndarray, stretch: np.ndarray, beta: float, tau: float) -> np.ndarray:
    """Incompressible: `P = mu (l - l^-2) + l q_z - q_t / l^2`, both `q` from `q' + q/tau = beta S'`."""
    second = lambda l: MU * (1.0 - (l**2 + 2.0 / l) / 3.0 * np.array([l**-2.0, l]))  # noqa: E731

    def rate(t: float, q: np.ndarray) -> np.ndarray:
        l, h = np.interp(t, time, stretch), 1e-4
        there = (second(np.interp(t + h, time, stretch)) - second(np.interp(t - h, time, stretch))) / (2.0 * h)
        return beta * there - q / tau if l > 0.0 else q

    found = solve_ivp(rate, (time[0], time[-1]), np.zeros(2), t_eval=time, rtol=1e-6, max_step=np.ptp(time) / 200.0)
    qz, qt = found.y
    return neo_hookean(stretch) + stretch * qz - qt / stretch**2


def cycle(duration: float, amplitude: float = 0.12) -> tuple[np.ndarray, np.ndarray]:
    time = np.linspace(0.0, duration, 161)
    return time, 1.0 + amplitude * np.interp(time / duration, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])


def noisy(stress: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A reading's noise, and one that a stretch of the curve has in common."""
    peak = np.abs(stress).max()
    x = np.linspace(0.0, 1.0, len(stress))
    common = np.exp(-0.5 * ((x[:, None] - x) / 0.15) ** 2) + 1e-9 * np.eye(len(x))
    return (
        stress
        + 0.01 * peak * rng.normal(size=len(x))
        + 0.02 * peak * np.linalg.cholesky(common) @ rng.normal(size=len(x))
    )


def rod_test(name: str, stretch: np.ndarray, stress: np.ndarray, time: np.ndarray | None = None) -> TestRecording:
    return replace(recorded("stretch", stretch), response=stress, name=name, time=time)


rod_test.__test__ = False
