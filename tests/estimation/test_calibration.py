"""Intervals of `estimate` hold the truth as often as they say: truths drawn from its prior, recordings from its noise.

Without other elements the model of the estimate is the one that recordings are drawn from: ranks of the truth are
uniform if the computation is right. With other elements the truth is of quadratic tetrahedra of half the size, whose
error no prior was drawn from. That holds on even elements that are not too coarse; where it does not hold,
docs/estimation.md says by how much.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from drawn_for_commit import some_for_this_commit
from scipy.stats import binom, kstest
from simulated_draws import Setting, ranks

#: One process has the ranks of all settings, where tests are spread one by one.
pytestmark = [pytest.mark.slow(110), pytest.mark.xdist_group("calibration")]

PROBABILITIES = (0.5, 0.9, 0.95)
DRAWS = 60
#: Of the first setting; those from 0 were looked at before the number of draws was settled.
SEED = 100
#: Each needs its error on quadratic elements of half the size, which takes several times as long.
DRAWS_OF_OTHER_ELEMENTS = 10
SETTINGS = (
    Setting("block", 1, None, 0.03),
    Setting("block", 1, 0.2, 0.1),
    Setting("round", 1, 0.5, 0.5),
    Setting("round", 2, 0.8, 0.1),
    Setting("block", 2, 0.4, 0.1, registration=True),
)
#: Of which two run with each commit.
DRAWN = some_for_this_commit(SETTINGS, 2)
OTHER_ELEMENTS = (Setting("block", 1, None, 0.1, other_elements=True),)


def covered(found: np.ndarray, probability: float) -> np.ndarray:
    """Truths in the central interval of a probability, for each parameter."""
    return np.count_nonzero(np.abs(2.0 * found - 1.0) <= probability, axis=0)


def excess(count: int, draws: int, probability: float, band: float) -> float:
    """How far a count is outside of its binomial band; 0 inside."""
    low, high = binom.interval(band, draws, probability)
    return float(max(low - count, count - high, 0.0))


@pytest.fixture(scope="module")
def drawn() -> dict[Setting, np.ndarray]:
    """Ranks of every setting, as many settings at once as there are cores."""
    every = (*SETTINGS, *OTHER_ELEMENTS)
    with ProcessPoolExecutor(min(len(every), os.cpu_count() or 1), get_context("spawn")) as pool:
        jobs = {
            setting: pool.submit(ranks, setting, DRAWS_OF_OTHER_ELEMENTS if setting.other_elements else DRAWS, seed)
            for seed, setting in enumerate(every, SEED)
            if setting in DRAWN or setting.other_elements
        }
        return {setting: job.result() for setting, job in jobs.items()}


@pytest.mark.parametrize("setting", DRAWN, ids=lambda setting: setting.name)
def test_intervals_cover_as_often_as_they_say(setting, drawn, verify) -> None:
    for probability in PROBABILITIES:
        worst = max(excess(count, DRAWS, probability, 0.999) for count in covered(drawn[setting], probability))
        verify(
            f"`estimate`: {100 * probability:g} % intervals hold the truth ({setting.name})",
            f"binomial band of 99.9 % of {DRAWS} truths drawn from the prior",
            worst,
            0.0,
            "truths",
        )


@pytest.mark.parametrize("setting", OTHER_ELEMENTS, ids=lambda setting: setting.name)
def test_intervals_with_the_error_of_the_mesh_are_not_too_narrow(setting, drawn, verify) -> None:
    """One error of the mesh, near what is believed of it, stands for all that are believed possible: more may cover."""
    for probability in PROBABILITIES:
        low = binom.ppf(5e-4, DRAWS_OF_OTHER_ELEMENTS, probability)
        verify(
            f"`estimate`: {100 * probability:g} % intervals hold the truth of a finer mesh ({setting.name})",
            f"lower end of the binomial band of 99.9 % of {DRAWS_OF_OTHER_ELEMENTS} truths drawn from the prior",
            max(low - count for count in covered(drawn[setting], probability)),
            0.0,
            "truths",
        )


@pytest.mark.parametrize("setting", DRAWN, ids=lambda setting: setting.name)
def test_ranks_are_uniform(setting, drawn) -> None:
    for column in drawn[setting].T:
        assert kstest(column, "uniform").pvalue > 1e-3


def test_intervals_of_all_settings_together_cover(drawn, verify) -> None:
    together = np.concatenate([drawn[setting].T.ravel() for setting in DRAWN])
    for probability in PROBABILITIES:
        outside = excess(int(covered(together, probability)), len(together), probability, 0.99)
        verify(
            f"`estimate`: {100 * probability:g} % intervals hold the truth, all settings on one mesh together",
            f"binomial band of 99 % of {len(together)} parameters, {DRAWS} draws of each setting from the prior",
            outside,
            0.0,
            "truths",
        )
    assert kstest(together, "uniform").pvalue > 1e-3
