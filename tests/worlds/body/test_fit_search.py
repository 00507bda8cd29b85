"""One fit on its way: the size of the mesh's unknown error, and the point that it is at."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sinking_block import OPTIONS, write_sinking

from warpbrain.errors import SolveError
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.fit_search import ENOUGH, FitSearch
from warpbrain.worlds.body.fitting import Fitter
from warpbrain.worlds.body.hypotheses import HypothesisSearch, screened
from warpbrain.worlds.body.nuisances import FIELD, UNKNOWN_MESH
from warpbrain.worlds.body.weighted_set import Refit


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> HypothesisSearch:
    """Everything weighed, nothing fitted."""
    case = write_sinking(Path(tmp_path_factory.mktemp("fit")) / "case")
    return screened(case, "cpu", mesh_error=False, mechanisms=OPTIONS.candidates)


@pytest.fixture(scope="module")
def base(sets: HypothesisSearch) -> Base:
    """With an unknown error of the mesh of half the noise: the case as declared does not move, and has none."""
    nuisances, noise = sets.base.nuisances, sets.base.noise
    shape = nuisances.families[UNKNOWN_MESH].shape
    columns = 0.5 * noise[:, None] * np.random.default_rng(2).normal(size=shape)
    return replace(sets.base, nuisances=replace(nuisances, families={**nuisances.families, UNKNOWN_MESH: columns}))


@pytest.fixture
def search(sets: HypothesisSearch, base: Base) -> FitSearch:
    """A fit of the set with the weight, at the most probable point of the linear model."""
    weighed = sets.get(("gravity",))
    assert weighed is not None
    columns = base.nuisances.with_family("mesh, unknown", weighed.columns, base.nuisances.families[UNKNOWN_MESH])
    fit = FitSearch(base, None, weighed.effects, columns, weighed.marginal)
    fit.start([weighed.coordinates], base.state)
    return fit


def test_a_result_says_the_point_in_its_own_columns(search):
    result = search.result()
    z = np.concatenate([result.nuisances, *result.coefficients])
    np.testing.assert_allclose(result.residual + result.columns @ z, result.linear, atol=1e-12)


def test_without_an_equilibrium_on_the_way_to_the_base_the_start_stays(search, monkeypatch):
    """As where tissue that is as soft as the base's does not hold what acts."""
    z = search.z.copy()

    def fails(*_arguments: object) -> None:
        raise SolveError("no equilibrium")

    monkeypatch.setattr(FitSearch, "_evaluate", fails)
    search.backtrack_to_base()
    np.testing.assert_array_equal(search.z, z)


def test_another_size_of_the_mesh_error_is_the_same_point(base, search):
    nuisances = base.nuisances
    fit = search.result()
    part = nuisances.part(UNKNOWN_MESH)
    unknown = 3.0 * fit.columns[:, part]
    search.z[part] = np.linspace(-1.0, 1.0, part.stop - part.start)
    linear = search.residual + search.columns @ search.z
    other = replace(fit, columns=nuisances.with_family("mesh, unknown", fit.columns, unknown))
    search.update_noise(other)
    np.testing.assert_array_equal(search.columns[:, part], unknown)
    np.testing.assert_allclose(search.residual + search.columns @ search.z, linear, atol=1e-12)


def test_a_fit_begins_at_that_of_a_subset(sets, base, search):
    search.minimise()
    fit = search.result()
    weighed = sets.get(("gravity",))
    again = FitSearch(base, None, weighed.effects, fit.columns, fit.marginal)
    z = again.begin_at(fit)
    np.testing.assert_allclose(z, np.concatenate([fit.nuisances, *fit.coefficients]))
    residual = again._evaluate(z, fit.state)[1]
    np.testing.assert_allclose(residual, fit.residual, atol=1e-3 * base.typical_noise)
    again.start([z], fit.state)
    assert again._objective(again.z, again.residual) <= again._objective(z, residual)


def test_linear_coordinates_are_at_their_best(base, search):
    """No step of these alone gains anything, after the start and after other columns of shapes."""
    for _ in range(2):
        linear = np.flatnonzero(search._linear)
        W = search._noise.whitened(search._U[:, linear])
        gradient = W.T @ search._noise.whitened(search.residual) - search.z[linear]
        np.testing.assert_allclose(gradient, 0.0, atol=1e-9 * (1.0 + np.abs(search.z[linear]).max()))
        size = (len(W), len(search._layout.shapes))
        search._shapes = base.noise[:, None] * np.random.default_rng(5).normal(size=size)
        search.update_shapes()


def test_a_renewal_of_shapes_that_undoes_the_one_before_is_taken_by_half(base, search, monkeypatch):
    shapes = search._layout.shapes
    first = base.noise[:, None] * np.random.default_rng(4).normal(size=search._U[:, shapes].shape)
    search._U[:, shapes] = first
    others = [2.0 * first, first, 2.0 * first]
    monkeypatch.setattr("warpbrain.worlds.body.fit_search.shape_columns_about", lambda *_: others.pop(0))
    for taken, expected in ((1.0, 2.0 * first), (0.5, 1.5 * first), (0.25, 1.625 * first)):
        search._about = search._nearby, ()
        before = search.expected_gain()
        search.update_shapes()
        assert search.taken == taken
        # a difference that is taken by half gains a fourth of what all of it gains
        gained = max(search.expected_gain() - before, 0.0)
        np.testing.assert_allclose(search.left_of_shapes, gained * (1.0 / taken**2 - 1.0))
        np.testing.assert_allclose(search._U[:, shapes], expected)
    search.update_shapes()
    # what is left of it is taken in part again, without another linearisation
    np.testing.assert_allclose(search._U[:, shapes], 1.625 * first + 0.25 * 0.375 * first)


def test_what_a_fit_has_not_reached_is_no_evidence(sets, base, monkeypatch):
    """A search that never takes a step, though the linear model says that a better point exists."""
    weighed = sets.get(("gravity",))
    monkeypatch.setattr(FitSearch, "minimise", lambda *_: None)
    start = np.zeros(weighed.columns.shape[1])
    fit = Fitter(sets.base).fit(weighed.effects, weighed.columns, [start], weighed.marginal)
    assert not fit.converged
    assert fit.unreached > 1.0
    assert fit.log_evidence == fit.marginal.log_evidence - fit.unreached


@pytest.mark.parametrize("part", [0.6, 0.2, 0.05])
def test_without_an_equilibrium_at_its_start_a_fit_begins_at_smaller_sizes(sets, monkeypatch, part):
    """The body is made to have no equilibrium beyond a part of the most probable weight of the linear model."""
    weighed = sets.get(("gravity",))
    [effect], [at], solve = weighed.effects, weighed.slices, FitSearch._solve
    largest = part * np.linalg.norm(effect.offset(weighed.coordinates[at]))

    def solve_unless_larger(search, hypothesis, nonlinear, *others):
        if np.linalg.norm(effect.offset(nonlinear[-effect.columns.shape[1] :])) > largest:
            raise SolveError("no equilibrium")
        return solve(search, hypothesis, nonlinear, *others)

    fitter, start = Fitter(sets.base), [weighed.coordinates]
    whole = fitter.fit(weighed.effects, weighed.columns, start, weighed.marginal)
    monkeypatch.setattr(FitSearch, "_solve", solve_unless_larger)
    if part < 0.125:
        with pytest.raises(SolveError):
            fitter.fit(weighed.effects, weighed.columns, start, weighed.marginal)
        return
    fit = fitter.fit(weighed.effects, weighed.columns, start, weighed.marginal)
    reached = np.linalg.norm(effect.offset(fit.coefficients[0]))
    assert 0.8 * largest < reached <= largest
    assert fit.log_evidence < whole.log_evidence - 1.0


def test_a_search_that_expects_to_reach_too_little_ends(sets):
    """A fit that is not wanted is worse than what it would have to be, and not what a whole search comes to."""
    weighed = sets.get(("gravity",))
    start = [np.zeros(weighed.columns.shape[1])]
    whole = Fitter(sets.base).fit(weighed.effects, weighed.columns, start, weighed.marginal)
    wanted = whole.log_evidence + 1e3
    fit = Fitter(sets.base).fit(weighed.effects, weighed.columns, start, weighed.marginal, wanted=wanted)
    assert whole.converged
    assert not fit.converged
    assert fit.log_evidence < wanted


@pytest.mark.slow(15)
def test_a_fit_takes_the_most_probable_size(sets):
    """Of those that its cause may have, though it begins with another one: that of the linear model about the base."""
    weighed = sets.get(("unknown",))
    assert weighed is not None
    [effect], [part] = weighed.effects, weighed.slices

    def fit(size: float, sizes: tuple[float, ...]) -> Refit:
        begun = replace(effect.scaled(size / effect.size), sizes=sizes)
        columns = weighed.columns.copy()
        columns[:, part] = begun.columns
        return Fitter(sets.base).fit((begun,), columns, [weighed.coordinates], weighed.marginal)

    alone = {size: fit(size, (size,)).log_evidence for size in effect.sizes}
    best = max(alone, key=lambda size: alone[size])
    assert alone[best] > alone[effect.size] + 5.0
    for start in (effect.size, 0.4 * effect.size):
        free = fit(start, effect.sizes)
        assert free.effects[0].size == pytest.approx(best)
        # as nearly as both have come to the best point
        assert free.log_evidence == pytest.approx(alone[best], abs=2.0 * ENOUGH)


def test_a_fit_of_nothing_that_acts_may_begin_at_one_of_more(sets):
    """From the optimum of a set with one mechanism the set without it comes to the same fit as by itself."""
    weighed, nothing = sets.get(("gravity",)), sets.get(())
    assert weighed is not None and nothing is not None and not nothing.effects
    fitter = Fitter(sets.base)

    def fit(begun: Refit | None) -> Refit:
        return fitter.fit((), nothing.columns, [nothing.coordinates], nothing.marginal, subset=begun)

    larger = fitter.fit(weighed.effects, weighed.columns, [weighed.coordinates], weighed.marginal)
    assert fit(larger.without(0, sets.base)).log_evidence == pytest.approx(fit(None).log_evidence, abs=0.1)


def sized(fit: Refit, number: int) -> Refit:
    """A result whose stiffness field has another size."""
    return replace(fit, marginal=replace(fit.marginal, sizes=fit.marginal.sizes._replace(field=number)))


@pytest.mark.parametrize("number", range(6))
def test_another_size_of_the_stiffness_field_is_the_same_field(base, search, number):
    """In other coordinates: the same state, residual and linear model."""
    search.minimise()
    field, before, fit = search._layout.field, search.z.copy(), search.result()
    state, residual, columns = search.state, search.residual.copy(), search.columns.copy()
    moved, here = search._moved(), search._layout.field_size
    search._take_field_size(sized(fit, number).marginal.sizes)
    relative = base.nuisances.field_sizes.relative[number]
    assert search._layout.field_size == relative and search.state is state
    np.testing.assert_allclose(search.residual, residual, atol=0.05 * base.noise.max())
    np.testing.assert_allclose(search.columns[:, field] * here, columns[:, field] * relative)
    np.testing.assert_allclose(search.z[field] * relative, before[field] * here)
    np.testing.assert_allclose(search.z[field] * relative, state.hypothesis.field)
    assert np.isfinite(moved) == np.isfinite(search._moved())
    # an equilibrium at these coordinates is that of the state
    again, _ = search._evaluate(search.z, state)
    np.testing.assert_allclose(again.u, state.u, atol=1e-7 * np.abs(state.u).max())


@pytest.mark.parametrize("number", [0, 5])
def test_a_fit_begins_at_the_field_of_a_subset_of_another_size(sets, base, search, number):
    search.minimise()
    fit, relative = search.result(), base.nuisances.field_sizes.relative
    weighed, factor = sets.get(("gravity",)), relative[number] / relative[fit.marginal.sizes.field]
    marginal = sized(fit, number).marginal
    again = FitSearch(base, None, weighed.effects, base.nuisances.with_field(fit.columns, factor), marginal)
    z = again.begin_at(fit)
    np.testing.assert_allclose(relative[number] * z[again._layout.field], fit.state.hypothesis.field, atol=1e-12)


def test_the_field_of_a_result_is_that_of_its_state(base, search):
    search.minimise()
    fit = search.result()
    relative = base.nuisances.field_sizes.relative[fit.marginal.sizes.field]
    field = fit.nuisances[base.nuisances.part(FIELD)]
    np.testing.assert_allclose(relative * field, fit.state.hypothesis.field, atol=1e-12)
