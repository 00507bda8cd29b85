"""Scores of models on studies that they have not seen."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from warpbrain.errors import InputError
from warpbrain.gp.hierarchy import EFFECTS, OF_CURVES, OF_SIDES
from warpbrain.gp.leaving_out import (
    CoregionalisedCandidate,
    HierarchicalCandidate,
    Prediction,
    candidates,
    folds,
    leave_out,
    read_scores,
    write_scores,
)
from warpbrain.gp.literature.studies import read_studies
from warpbrain.gp.literature.study import Study
from warpbrain.report.page import lines

GREY = "hyperelastic/grey matter"
SOME = [s for s in read_studies("corrected") if s.group in (GREY, "MRE/grey matter", "linear/brain")][::2]


class Knows:
    """Predicts that a study is one of 1000 Pa, and notes what it was fitted to."""

    name = "knows"

    def __init__(self):
        self.seen = []

    def fitted(self, studies):
        self.seen.append([study.name for study in studies])
        return self

    def predict(self, study, stretches):
        assert study.name not in self.seen[-1]
        assert np.all(stretches != 1.0)
        error = np.full(len(stretches), study.shear_moduli[0] - 1000.0)
        return Prediction(norm.logpdf(error), norm.cdf(error), error)

    def level_pit(self, studies, stretches):
        return float(norm.cdf(np.mean([study.shear_moduli[0] for study in studies]) - 1000.0))


def flat(name, mu):
    return Study(name, GREY, "neo-hookean", {"mu": mu}, {"mu": mu}, (0.9, 1.1))


def test_scores_are_means_over_studies_or_papers():
    studies = [flat("A-One2001", 1000.0), flat("B-One2001", 1000.0), flat("C-Two2002", 1002.0)]
    by_study = leave_out(Knows(), studies, "study")
    assert by_study.values == pytest.approx((norm.logpdf(0), norm.logpdf(0), norm.logpdf(2.0)))
    assert by_study.log_density == pytest.approx(np.mean(by_study.values))
    assert by_study.rms_error == pytest.approx(np.sqrt(4 / 3))
    by_paper = leave_out(Knows(), studies, "paper")
    assert by_paper.values == pytest.approx((norm.logpdf(0), norm.logpdf(2.0)))
    assert by_paper.coverage_50 == pytest.approx(2 / 3) and by_paper.coverage_95 == pytest.approx(2 / 3)


def test_a_paper_is_left_out_with_all_its_studies():
    knows = Knows()
    leave_out(knows, [flat("A-One2001", 1.0), flat("B-One2001", 1.0), flat("C-Two2002", 1.0)], "paper")
    assert knows.seen[1:] == [["C-Two2002"], ["A-One2001", "B-One2001"]]


@pytest.mark.parametrize(
    "candidate",
    [
        CoregionalisedCandidate("one a group", separate=True),
        CoregionalisedCandidate("with a mean", mean_modulus=1500.0),
        pytest.param(HierarchicalCandidate("hierarchical"), marks=pytest.mark.slow(4)),
        pytest.param(HierarchicalCandidate("moduli only", without=OF_CURVES + OF_SIDES), marks=pytest.mark.slow(5)),
    ],
    ids=lambda candidate: candidate.name,
)
def test_candidates_predict_densities_that_integrate_to_one(candidate):
    """The density of a log energy at one stretch, over all moduli that the study might have had."""
    fitted = candidate.fitted(SOME)
    moduli = np.exp(np.linspace(-30.0, 45.0, 501))
    at = np.array([1.06])
    energies = np.log([flat("x", mu).energy(at)[0] + 1e-4 for mu in moduli])
    density = np.exp([fitted.predict(flat("x", mu), at).log_density[0] for mu in moduli])
    # the log energy has a floor, ln 1e-4, that a normal density of it does not know
    assert np.trapezoid(density, energies) == pytest.approx(1.0, abs=0.01)


def test_candidates_lack_what_they_should():
    assert {*OF_CURVES, *OF_SIDES} <= set(EFFECTS)
    separate = CoregionalisedCandidate("one a group", separate=True).fitted(SOME)
    assert not separate.model.parameters.w.any()
    flat_only = HierarchicalCandidate("moduli only", without=OF_CURVES + OF_SIDES).fitted(SOME)
    assert all(flat_only.model.hierarchy.spread[name] == pytest.approx(1e-6) for name in OF_CURVES + OF_SIDES)
    names = [candidate.name for candidate in candidates()]
    assert len(set(names)) == len(names) >= 10


def test_scores_come_back_from_their_file(tmp_path):
    studies = [flat("A-One2001", 1000.0), flat("B-One2001", 1000.0), flat("C-Two2002", 1002.0)]
    score, held, path = leave_out(Knows(), studies, "paper"), list(folds(studies, "paper")), tmp_path / "scores.csv"
    assert read_scores(path, held) == []
    write_scores(path, [score], held)
    assert read_scores(path, held) == [score]
    assert score.median == pytest.approx(np.median(score.values))
    assert "knows" in lines("gp.txt", "scores", [score])[1]
    with pytest.raises(InputError, match="not a comparison of these studies"):
        read_scores(path, ["other"])
    path.write_text(path.read_text() + "cut,1.0\n")
    with pytest.raises(InputError, match="line 3: cannot be read"):
        read_scores(path, held)


def test_scores_of_files_without_levels_are_read(tmp_path):
    studies = [flat("A-One2001", 1000.0), flat("C-Two2002", 1002.0)]
    score, held, path = leave_out(Knows(), studies, "paper"), list(folds(studies, "paper")), tmp_path / "scores.csv"
    write_scores(path, [replace(score, levels=())], held)
    text = path.read_text().splitlines()
    path.write_text("\n".join([text[0].partition(",level of")[0], text[1]]) + "\n")
    assert read_scores(path, held) == [replace(score, levels=())]


@pytest.mark.parametrize(
    "candidate",
    [CoregionalisedCandidate("one a group", separate=True), HierarchicalCandidate("hierarchical")],
    ids=lambda candidate: candidate.name,
)
def test_levels_are_those_of_the_curves_that_a_model_draws(candidate):
    """The probability of a softer level, by the draws of the model itself."""
    fitted = candidate.fitted(SOME)
    at = np.array([0.94, 1.06])
    drawn = np.array([fitted.model.draw([GREY], at, number)[0].mean() for number in range(2000)])
    for mu in (300.0, 3000.0):
        values = {"mu": (mu,), "alpha": (2.0,)}  # neo-Hookean in a form that need not be
        study = Study("a-Nobody2030", GREY, "ogden", values, values, (0.9, 1.1))
        level = np.log(study.energy(at) + 1e-4).mean()
        # Monte Carlo error of 2,000 draws: at most 0.008; 0.005 off
        assert fitted.level_pit([study], [at]) == pytest.approx(np.mean(drawn < level), abs=0.01)


def test_the_level_of_a_paper_is_that_of_all_its_studies():
    fitted = HierarchicalCandidate("hierarchical").fitted(SOME)
    at = np.array([0.94, 1.06])
    alone = fitted.level_pit([flat("A-One2001", 5000.0)], [at])
    twice = fitted.level_pit([flat("A-One2001", 5000.0), flat("B-One2001", 5000.0)], [at, at])
    mixed = fitted.level_pit([flat("A-One2001", 5000.0), flat("B-One2001", 50.0)], [at, at])
    assert mixed < alone < twice < 1.0
