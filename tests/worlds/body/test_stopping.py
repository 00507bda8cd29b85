"""Which set is fitted next."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from warpbrain.inference import GaussianModel
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import calibration
from warpbrain.inference.causes import Hypothesis, Kind
from warpbrain.worlds.body.evidence import SetMarginal, Sizes
from warpbrain.worlds.body.stopping import next_to_fit
from warpbrain.worlds.body.weighted_set import WeightedSet

KINDS = {"registration": Kind.NOT_PHYSICS, "unknown": Kind.UNKNOWN}


def weighted(log_evidence, *names, fitted=False, failure="", moves=100.0):
    """A set of which one row is recorded; `moves`: what its causes move of it, in standard deviations of the noise."""
    kinds = tuple(KINDS.get(name, Kind.PHYSICS) for name in names)
    hypothesis = Hypothesis(names, kinds, log_evidence, -3.0 * len(names), None)
    columns, residual = np.array([[moves]]), np.array([moves])
    model = GaussianModel(np.ones((1, 1)), columns)
    marginal = SetMarginal(log_evidence, 1.0, np.ones(1), model, 1, Sizes(0, 0, 0))
    return WeightedSet(
        hypothesis,
        hypothesis.of_kind(Kind.PHYSICS),
        (),
        residual,
        columns,
        marginal,
        object() if fitted else None,
        failure,
        further=np.arange(1),
    )


def in_a_place(candidate):
    return replace(candidate, effects=(SimpleNamespace(is_placed=True),))


def following(*sets, expanded=(), rivals=True):
    probabilities = calibration().probabilities([candidate.hypothesis for candidate in sets])
    ordered = [sets[k] for k in np.argsort(-probabilities)]
    chosen = next_to_fit(ordered, {frozenset(names) for names in expanded}, rivals)
    return chosen and sorted(chosen.names)


def test_the_set_that_a_name_rests_on_is_fitted_though_the_name_alone_was():
    # a fit of the mechanism alone says nothing of its set with a registration that is off
    sets = [
        weighted(0.0, fitted=True),
        weighted(10.0, "pressure", fitted=True),
        weighted(40.0, "registration", fitted=True),
    ]
    both = "pressure", "registration"
    assert following(*sets, weighted(60.0, *both), expanded=[("pressure",), ("registration",)]) == sorted(both)
    settled = weighted(60.0, *both, failure="no equilibrium")
    assert following(*sets, settled, expanded=[("pressure",), ("registration",)]) is None


def test_what_an_unknown_rests_on_is_fitted_and_then_that_without_it():
    # a rigid motion is no linear change: in the linear model it is a smaller one and an unknown force
    nothing, both = weighted(0.0, fitted=True), ("registration", "unknown")
    assert following(nothing, weighted(-5.0, "registration"), weighted(60.0, *both)) == sorted(both)
    assert following(nothing, weighted(-5.0, "registration"), weighted(60.0, *both, fitted=True)) == ["registration"]
    fitted = weighted(-5.0, "registration", fitted=True)
    assert following(nothing, fitted, weighted(60.0, *both, fitted=True)) is None


def test_before_a_mechanism_is_named_what_has_no_name_is_fitted():
    nothing, named = weighted(0.0, fitted=True), weighted(60.0, "pressure", fitted=True)
    rivals = weighted(40.0, "unknown"), weighted(45.0, "registration", "unknown")
    assert following(nothing, named, *rivals, expanded=[("pressure",)]) == ["registration", "unknown"]
    assert following(nothing, named, rivals[0], expanded=[("pressure",)]) == ["unknown"]
    hopeless = weighted(60.0 - belief("fits.moved") - 1.0, "unknown")
    assert following(nothing, named, hopeless, expanded=[("pressure",)]) is None
    assert following(nothing, named, weighted(40.0, "unknown", fitted=True), expanded=[("pressure",)]) is None


def test_before_something_has_no_name_the_likeliest_mechanism_is_fitted():
    # stress that relaxes with two times is far from linear, and gains dozens of nats by a fit
    nothing, unknown = weighted(0.0, fitted=True), weighted(60.0, "unknown", fitted=True)
    likely, less = weighted(20.0, "viscoelasticity"), weighted(10.0, "swelling")
    assert following(nothing, unknown, likely, less) == ["viscoelasticity"]
    fitted = weighted(20.0, "viscoelasticity", fitted=True)
    # what acts beside it may be what the unknown stands for
    assert following(nothing, unknown, fitted, less) == ["viscoelasticity"]
    assert following(nothing, unknown, fitted, less, expanded=[("viscoelasticity",)]) is None


def test_before_a_group_with_something_without_a_name_mechanisms_that_may_be_as_probable_are_fitted():
    nothing, unknown = weighted(0.0, fitted=True), weighted(60.0, "unknown", fitted=True)
    known = {"expanded": [("pressure",), ("unknown",)]}
    member = weighted(60.0, "pressure", fitted=True)
    assert following(nothing, unknown, member, weighted(20.0, "traction"), **known) == ["traction"]
    assert following(nothing, unknown, member, weighted(20.0, "traction", fitted=True), **known) is None
    assert following(nothing, unknown, member, weighted(10.0, "traction"), **known) is None


def test_a_named_mechanism_is_fitted_then_expanded_then_left():
    nothing = weighted(0.0, fitted=True)
    assert following(nothing, weighted(30.0, "pressure")) == ["pressure"]
    assert following(nothing, weighted(30.0, "pressure", fitted=True)) == ["pressure"]
    assert following(nothing, weighted(30.0, "pressure", fitted=True), expanded=[("pressure",)]) is None


def test_before_a_rest_has_no_name_the_likeliest_mechanisms_are_fitted_and_the_first_expanded():
    nothing, rest = weighted(0.0, fitted=True), weighted(60.0, "swelling", "unknown", fitted=True)
    known = {"expanded": [("swelling", "unknown"), ("swelling",)]}
    assert following(nothing, rest, weighted(30.0, "traction"), **known) == ["traction"]
    fitted = weighted(30.0, "traction", fitted=True)
    assert following(nothing, rest, fitted, **known) == ["traction"]
    known["expanded"].append(("traction",))
    assert following(nothing, rest, fitted, **known) is None
    # tissue that relaxes under a load is far from linear
    both = "gravity", "viscoelasticity"
    assert following(nothing, rest, fitted, weighted(40.0, *both), **known) == sorted(both)
    assert following(nothing, rest, fitted, weighted(40.0, *both, fitted=True), **known) is None


def test_after_many_fits_only_what_the_verdict_rests_on_is_fitted():
    nothing, both = weighted(0.0, fitted=True), ("registration", "unknown")
    assert following(nothing, weighted(60.0, *both), rivals=False) == sorted(both)
    rival = weighted(24.0, "traction")
    named = weighted(30.0, "pressure", fitted=True)
    assert following(nothing, named, rival, expanded=[("pressure",)]) == ["traction"]
    assert following(nothing, named, rival, expanded=[("pressure",)], rivals=False) is None


def test_nothing_is_fitted_where_no_fit_can_change_the_verdict():
    assert following(weighted(0.0, fitted=True), weighted(-8.0, "pressure")) is None


def test_a_linear_model_is_wrong_by_a_part_of_what_causes_move():
    errors = [weighted(0.0, "traction", moves=moves).linear_error for moves in (1e-3, 0.1, 2.0, 10.0, 1000.0)]
    assert errors == sorted(errors)
    assert errors[0] < 1e-3 and errors[-1] == belief("fits.change")
    # a standard deviation of what is left, and half of its square
    error = belief("fits.not_linear") * np.hypot(4.0 * 4.0 * 4.0 / 17.0, 4.0 / np.sqrt(17.0))
    np.testing.assert_allclose(weighted(0.0, "traction", moves=4.0).linear_error, error + 0.5 * error**2)
    beside_a_fit = replace(weighted(0.0, "traction", moves=1000.0), further=np.zeros(0, dtype=np.int64))
    assert beside_a_fit.linear_error == 0.0


def test_a_cause_that_hardly_moves_anything_is_not_fitted():
    nothing, named = weighted(0.0, fitted=True), weighted(30.0, "pressure", fitted=True)
    rival, hardly = (weighted(32.0, "pressure", "contact", moves=moves) for moves in (100.0, 0.1))
    assert following(nothing, named, rival, expanded=[("pressure",)]) == ["contact", "pressure"]
    assert following(nothing, named, hardly, expanded=[("pressure",)]) is None


def test_what_a_verdict_rests_on_is_looked_at_in_other_places():
    nothing, fitted = weighted(0.0, fitted=True), in_a_place(weighted(30.0, "traction", fitted=True))
    assert following(nothing, fitted, expanded=[("traction",)]) == ["traction"]
    assert following(nothing, replace(fitted, moved=True), expanded=[("traction",)]) is None


def test_a_rival_that_may_be_better_elsewhere_is_looked_at_in_other_places():
    # by how much a fit gains where it is moved is not known before: its probability is next to nothing
    nothing, named = weighted(0.0, fitted=True), weighted(60.0, "pressure", fitted=True)
    rival = in_a_place(weighted(40.0, "traction", fitted=True))
    assert following(nothing, named, rival, expanded=[("pressure",)]) == ["traction"]
    assert following(nothing, named, replace(rival, moved=True), expanded=[("pressure",)]) is None
    assert following(nothing, named, rival.with_evidence(20.0), expanded=[("pressure",)]) is None


def test_before_something_has_no_name_the_likeliest_mechanism_is_looked_at_in_other_places():
    nothing, unknown = weighted(0.0, fitted=True), weighted(90.0, "unknown", fitted=True)
    likely = in_a_place(weighted(20.0, "traction", fitted=True))
    assert following(nothing, unknown, likely, expanded=[("traction",)]) == ["traction"]
    assert following(nothing, unknown, replace(likely, moved=True), expanded=[("traction",)]) is None
