"""Coverage by method and the sign test, against counts and the binomial distribution."""

import numpy as np
import pytest
from scipy.stats import beta, binom

from warpbrain.gp.leaving_out import (
    INTERVALS,
    Score,
    calibration,
    compared,
    folds,
    methods_of,
)
from warpbrain.gp.literature.studies import read_studies
from warpbrain.report.page import lines


def score(values, levels=(), name="a"):
    return Score(name, float(np.mean(values)), 0.1, 1.0, 0.5, 0.95, tuple(values), tuple(levels))


def test_levels_are_counted_by_method():
    levels = [0.5, 0.1, 0.03, 0.01, 0.5, 0.76]
    first, second, whole = calibration(score([0.0] * 6, levels), ["linear"] * 4 + ["hyperelastic"] * 2)
    assert (first.method, second.method, whole.method) == ("linear", "hyperelastic", "all")
    assert first.within == (1, 2, 3) and second.within == (1, 2, 2) and whole.within == (2, 4, 5)
    assert first.histogram == (3, 0, 1, 0) and whole.histogram == (3, 0, 2, 1)
    for one in (first, second, whole):
        for hits, (low, high) in zip(one.within, one.ranges, strict=True):
            # Clopper and Pearson's interval by quantiles of the beta distribution
            assert low == pytest.approx(beta.ppf(0.025, hits, one.count - hits + 1) if hits else 0.0)
            missed = one.count - hits
            assert high == pytest.approx(beta.ppf(0.975, hits + 1, missed) if missed else 1.0)
    table = lines("gp.txt", "calibrations", [first, second, whole], "paper", INTERVALS)
    assert len(table) == 4 and all(f"{100 * part:g} % interval" in table[0] for part in INTERVALS)
    assert "3:  75 %" in table[1] and table[1].endswith("3 0 1 0")


def test_levels_of_a_calibrated_model_are_within_their_intervals():
    levels = np.random.default_rng(0).uniform(size=4000)
    [_, whole] = calibration(score(np.zeros(4000), levels), ["MRE"] * 4000)
    for part, (low, high) in zip(INTERVALS, whole.ranges, strict=True):
        assert low < part < high


def test_sign_test():
    ours, theirs = np.zeros(30), np.where(np.arange(30) < 19, -1.0, 2.0)
    found = compared(score(ours), score(theirs, name="b"))
    assert (found.other, found.wins, found.count) == ("b", 19, 30)
    # two-sided: as uneven or more, on either side
    assert found.p_value == pytest.approx(2.0 * binom.sf(18, 30, 0.5))
    assert found.difference == pytest.approx(-(theirs.mean()))
    row = lines("gp.txt", "comparisons", "a", [found])[1]
    assert "19 of 30" in row and "0.2" in row
    tied = compared(score([1.0, 2.0]), score([1.0, 1.0]))
    assert (tied.wins, tied.count) == (1, 1)


def test_each_paper_has_one_method():
    methods = methods_of(folds(read_studies("corrected"), "paper"))
    assert {name: methods.count(name) for name in set(methods)} == {"MRE": 6, "linear": 17, "hyperelastic": 7}
