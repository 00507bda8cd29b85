"""Sets of causes of a block that sinks under a weight of which its case says nothing."""

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sinking_block import OPTIONS, write_sinking

from warpbrain.diagnosis.checking import Confirming
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import calibration
from warpbrain.inference.decide import NAMED, decide
from warpbrain.worlds.body.evidence import evidence_of
from warpbrain.worlds.body.hypotheses import HypothesisSearch, screened


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> HypothesisSearch:
    """Everything weighed, the best fitted."""
    case = write_sinking(Path(tmp_path_factory.mktemp("sets")) / "case")
    found = screened(case, "cpu", mesh_error=False, mechanisms=OPTIONS.candidates)
    found.fit()
    return found


def test_the_weight_is_named(search):
    decision, _ = decide([one.hypothesis for one in search.weighted_sets], search.probabilities, calibration().losses)
    assert decision.verdict == NAMED and decision.causes == ("gravity",)


def test_probabilities_are_in_order_and_one_in_all(search):
    assert search.weighted_sets[0].names == {"gravity"}
    np.testing.assert_allclose(search.probabilities.sum(), 1.0)


def test_a_fit_leaves_noise(search):
    fitted = search.get(("gravity",))
    assert fitted.refit is not None and fitted.refit.converged
    left = fitted.refit.residual / search.base.noise
    assert 0.7 < np.sqrt(np.mean(left**2)) < 1.3


def test_evidence_of_a_fit_is_that_of_its_linear_model(search):
    fitted = search.get(("gravity",))
    _, again = evidence_of(search.base, fitted.columns, fitted.residual, fitted.marginal.sizes, fitted.marginal.scale)
    np.testing.assert_allclose(again.log_evidence, fitted.refit.log_evidence, atol=1e-6)


def test_nothing_is_far_less_probable(search):
    gain = search.get(("gravity",)).hypothesis.log_evidence - search.get(()).hypothesis.log_evidence
    assert gain > 50.0


def test_places_are_one_in_all_and_everywhere_is_as_probable_as_somewhere(search):
    for cause in search.causes.causes:
        np.testing.assert_allclose(np.exp(cause.log_weights).sum(), 1.0)
    swelling = search.causes.effects["swelling"]
    everywhere = [effect.proposed.centre is None for effect in swelling]
    shares = search.causes.named("swelling").shares
    np.testing.assert_allclose(shares[everywhere].sum(), 1.0 - belief("causes.in_one_place"))


def test_sets_say_what_they_are(search):
    for one in search.weighted_sets:
        assert len(one.acting) == len(one.effects) == len(one.coefficients)
        assert one.columns.shape[0] == len(one.residual) == len(search.base.residual)
        width = search.base.nuisances.columns.shape[1] + sum(effect.columns.shape[1] for effect in one.effects)
        # causes that are no mechanisms have columns between these
        assert one.columns.shape[1] == width or len(one.mechanisms) < len(one.names)


def largest_regret(search, changed, size):
    """By how much the verdict of a search costs more than the best one, if the evidence of a set changes by +- `size`.

    The larger of the two expected losses, in units of `calibration().losses`.
    """
    verdict, _ = decide([one.hypothesis for one in search.weighted_sets], search.probabilities, calibration().losses)
    regrets = []
    for change in (-size, size):
        hypotheses = [
            one.with_evidence(one.hypothesis.log_evidence + change * (one is changed)).hypothesis
            for one in search.weighted_sets
        ]
        best, losses = decide(hypotheses, calibration().probabilities(hypotheses), calibration().losses)
        regrets.append(losses[verdict] - losses[best])
    return max(regrets)


def not_fitted(search):
    """Sets of a search that are linear about the base or about a fit of fewer causes."""
    return [one for one in search.weighted_sets if one.refit is None and not one.failure]


def test_no_set_that_is_not_fitted_would_change_the_verdict(search):
    for one in not_fitted(search):
        assert largest_regret(search, one, one.linear_error) <= belief("fits.regret")


def test_fits_that_were_not_worth_their_time_would_not_have_changed_the_verdict(search):
    """Sets that would change it if fits changed their evidence by `fits.change`, the most that is believed."""
    further = copy.copy(search)
    further._sets, further._expanded = dict(search._sets), dict(search._expanded)
    verdict, _ = decide([one.hypothesis for one in search.weighted_sets], search.probabilities, calibration().losses)
    change = belief("fits.change")
    might_matter = [one for one in not_fitted(search) if largest_regret(search, one, change) > belief("fits.regret")]
    assert might_matter
    for one in might_matter:
        further._fit(one.names)
        fitted = further.get(one.names)
        assert fitted.refit is not None
        assert abs(fitted.hypothesis.log_evidence - one.hypothesis.log_evidence) <= one.linear_error
    hypotheses = [one.hypothesis for one in further.weighted_sets]
    best, losses = decide(hypotheses, further.probabilities, calibration().losses)
    assert losses[verdict] - losses[best] <= belief("fits.regret")


def test_a_fit_that_has_missed_its_optimum_is_mended_by_one_with_a_cause_more(search):
    """As where points are taken for gross errors: another cause, which does nothing, must not get the gain."""
    mended = copy.copy(search)
    mended._sets, mended._expanded = dict(search._sets), dict(search._expanded)
    subset = search.get(("gravity",))
    if subset.names not in mended._expanded:
        mended._weigh_supersets(subset, subset.refit)
    pair = frozenset(("gravity", "swelling"))
    mended._fit(pair)
    missed = replace(subset.marginal, log_evidence=subset.marginal.log_evidence - 30.0)
    worse = replace(subset, marginal=missed, refit=replace(subset.refit, marginal=missed))
    mended._sets[subset.names] = worse.with_evidence(subset.hypothesis.log_evidence - 30.0)
    mended._refit_subsets(pair)
    again = mended.get(("gravity",))
    np.testing.assert_allclose(again.hypothesis.log_evidence, subset.hypothesis.log_evidence, atol=1.0)
    # what was weighed about the fit that missed it is forgotten
    assert subset.names not in mended._expanded
    left = [one for one in mended.weighted_sets if subset.names < one.names and one.inherited_gain is None]
    assert all(one.refit is not None for one in left)


@pytest.mark.parametrize("share", [1.0, 0.3, 0.01])
@pytest.mark.parametrize("gain", [-4.0, 0.0, 2.0, 40.0])
def test_a_gain_at_a_place_is_of_its_share(gain: float, share: float, search: HypothesisSearch) -> None:
    known = replace(search.get(("gravity",)), log_share=np.log(share))
    gained = known.with_gain(gain)
    # a sum over places, of whose parts that of the fitted one grows; a loss is lost by all
    total = share * np.exp(gain) + 1.0 - share if gain > 0.0 else np.exp(gain)
    of_place = share * np.exp(gain) / total
    further = gained.hypothesis.log_evidence - known.hypothesis.log_evidence
    np.testing.assert_allclose(further, np.log(total), atol=1e-9)
    np.testing.assert_allclose(np.exp(gained.log_share), of_place, rtol=1e-9)


@pytest.fixture(scope="module")
def pair(search: HypothesisSearch) -> HypothesisSearch:
    """With the weight and a swelling, which is none, fitted, too."""
    fitted = copy.copy(search)
    fitted._sets, fitted._expanded = dict(search._sets), dict(search._expanded)
    weight = search.get(("gravity",))
    if weight.names not in fitted._expanded:
        fitted._weigh_supersets(weight, weight.refit)
    fitted._fit(frozenset(("gravity", "swelling")))
    return fitted


def test_what_was_not_weighed_is_fitted_from_more(pair):
    without, both = copy.copy(pair), pair.get(("gravity", "swelling"))
    without._sets = {names: one for names, one in pair._sets.items() if "gravity" not in names or one is both}
    refitted = without.fitted_with(frozenset(("gravity",)), both)
    expected = pair.get(("gravity",))
    # begun elsewhere, to what a fit is not repeated for
    np.testing.assert_allclose(refitted.refit.log_evidence, expected.refit.log_evidence, atol=0.05)
    # less what the places of both causes cost
    cost = both.refit.log_evidence - both.hypothesis.log_evidence
    np.testing.assert_allclose(refitted.refit.log_evidence - refitted.hypothesis.log_evidence, cost, atol=1e-6)
    np.testing.assert_allclose(refitted.hypothesis.log_prior, expected.hypothesis.log_prior)


def test_causes_are_checked_beside_those_that_explain_more(pair):
    both = pair.get(("gravity", "swelling"))
    weight, swelling = Confirming(pair, 100, np.random.default_rng(0), 0.05).confirmations(both)
    assert (weight.name, swelling.name) == ("gravity", "swelling")
    # the weight beside nothing, the swelling beside the weight
    evidence = [pair.get(names).hypothesis.log_evidence for names in ((), ("gravity",), ("gravity", "swelling"))]
    np.testing.assert_allclose([weight.log_evidence, swelling.log_evidence], np.diff(evidence))
    # beside the weight, which acts, a swelling is worth nothing; the weight beside nothing is
    assert weight.why_not(0.05) == "" and swelling.log_evidence < 0.0
    assert swelling.gain[1] < 0.0 < weight.gain[1]


def test_what_acts_linearly_alone_is_not_fitted_again_from_a_set_with_a_mechanism(search):
    """A fit has no coefficients to begin at without the one mechanism, whichever of the two is fitted first."""
    other = copy.copy(search)
    other._sets = dict(search._sets)
    for names in (("registration",), ("gravity", "registration")):
        other._fit(frozenset(names))
        assert other.get(names).refit is not None


def test_a_mechanism_is_compared_with_what_is_no_physics_without_it(search):
    other = copy.copy(search)
    other._sets = dict(search._sets)
    other._fit(frozenset(("gravity", "registration")))
    beside = other.fitted_without_physics(other.get(("gravity", "registration")))
    assert beside.names == {"registration"} and beside.refit is not None
    assert other.fitted_without_physics(other.get(("gravity",))) is other.nothing
