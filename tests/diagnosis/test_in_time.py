"""Where there are several times: fluid that flows away beside stress that relaxes, and when something set in."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drawn_for_commit import one_for_this_commit
from slow_block import CAUSES, PERMEABILITY, TIMES, write_slow

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.diagnosis.onset import OF_ITS_OWN, Onset, always_there, onset_of
from warpbrain.diagnosis.result import EXPLAINED, Diagnosis
from warpbrain.estimation.parameters import declared
from warpbrain.inference import Cause
from warpbrain.inference.causes import Place
from warpbrain.physics.mechanisms.drainage import Drainage
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.report.diagnosis.text import when_in_words
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.quasi_static import follow_slowly
from warpbrain.simulation.system import System
from warpbrain.worlds.body.base import Base
from warpbrain.worlds.body.causes import BodyCauses
from warpbrain.worlds.body.dictionary import Candidates, candidates_at, dictionary_of
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.states import TOLERANCE, Hypothesis, States, steps_to
from warpbrain.worlds.body.time_courses import AT_ONCE, EVENLY, time_courses
from warpbrain.worlds.options import DiagnosisOptions

# a diagnosis serves all tests of its cause, where tests are spread one by one
pytestmark = pytest.mark.xdist_group("in time")

_OPTIONS = DiagnosisOptions(candidates=("drainage", "viscoelasticity", "swelling"), mesh_error=False, draws=100)


@pytest.fixture(scope="module")
def draining(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return write_slow(tmp_path_factory.mktemp("draining") / "case", CAUSES["drainage"])


# some ten seconds of a processor each; what moves when is tested without, too, and in test_courses.py
@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=pytest.mark.slow(10)) for name in one_for_this_commit([*CAUSES])],
)
def diagnosed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Diagnosis]:
    if request.param == "drainage":
        case = request.getfixturevalue("draining")
    else:
        case = write_slow(tmp_path_factory.mktemp("slow") / "case", CAUSES[request.param])
    return request.param, Diagnosing(case, _OPTIONS, "cpu").run()


def test_fluid_and_relaxing_stress_are_told_apart(diagnosed: tuple[str, Diagnosis]) -> None:
    cause, found = diagnosed
    best = found.ranking[0]
    assert found.verdict.startswith("named")
    assert [one.kind for one in found.named] == [best.kind] == [CAUSES[cause].kind]
    assert best.probability > 0.9
    assert found.when == Onset(0.0, TIMES[0], None, OF_ITS_OWN)


def test_what_relaxes_is_found_with_its_times(diagnosed: tuple[str, Diagnosis]) -> None:
    cause, found = diagnosed
    expected = CAUSES[cause]
    if not isinstance(expected, Viscoelasticity):
        pytest.skip("nothing relaxes")
    assert found.explained is not None
    [acting] = found.explained.mechanisms
    assert isinstance(acting, Viscoelasticity)
    # they tell what has not relaxed at the recorded times, as well as they say
    best = found.weighted_sets[EXPLAINED]
    [effect], [(mean, covariance)] = best.effects, best.coefficients
    draws = np.random.default_rng(5).multivariate_normal(mean, covariance, 400)
    drawn = [effect.proposed.make(effect.coefficients(z)) for z in draws]
    for time in TIMES:
        deviation = np.std([_left(each, time) for each in drawn])
        assert abs(_left(acting, time) - _left(expected, time)) < min(2.5 * deviation, 0.15)
    values = {value.name: value for value in found.ranking[0].values}
    together = values["moduli"]
    assert abs(together.value - sum(expected.moduli)) < 2.0 * together.sd
    slowest = values[f"times_{len(acting.times)}"]
    assert abs(np.log(slowest.value / expected.times[-1])) < 2.0 * slowest.sd / slowest.value


def _left(acting: Viscoelasticity, time: float) -> float:
    return sum(m * float(np.exp(-time / t)) for m, t in zip(acting.moduli, acting.times, strict=True))


def test_the_permeability_is_found_with_its_spread(diagnosed: tuple[str, Diagnosis]) -> None:
    cause, found = diagnosed
    if cause != "drainage":
        pytest.skip("nothing flows")
    [value] = [value for value in found.ranking[0].values if value.name == "permeability"]
    assert 0.0 < value.sd < 0.1 * PERMEABILITY
    # 2.6 % off, with a spread of 4.1 %; a truth with a quarter of its steps in time is another one by 12 %
    assert abs(value.value - PERMEABILITY) < 0.08 * PERMEABILITY


def _followed(states: States, hypothesis: Hypothesis) -> Floats:
    """What sensors record (n,) where every step in time has an equilibrium of its own."""
    model = model_of(states.case_of(hypothesis))
    system, external = System(model, "cpu"), model.external_forces()
    moments = follow_slowly(system, steps_to(states.times), EquilibriumOptions(tolerance=TOLERANCE))
    by_time = {moment.time: moment.state for moment in moments}
    recorded = [by_time[time] for time in states.times]
    u = np.concatenate([state.u for state in recorded])
    reactions = np.concatenate([model.reactions(state.internal, external) for state in recorded])
    return states.observations.at(u, reactions, states.centre).computed


@pytest.mark.slow(5)
def test_one_course_is_that_of_every_permeability(draining: Case) -> None:
    states = States(draining, "cpu")
    theta = declared(states.case, states.parameters)
    hypothesis = Hypothesis(theta, np.zeros(states.modes.shape[1]))
    base = states.solve(hypothesis)
    effects = Effects(Linearisation(base.system, base.u, base.reactions, base.sensors))
    [first, *_] = dictionary_of(states.case, ("drainage",), len(TIMES)).proposals["drainage"]
    for permeability in (1e-10, 3e-10, 1e-9):
        [effect] = effects.of([replace(first, mean=np.log([permeability]))])
        drained = replace(hypothesis, mechanisms=(Drainage(permeability=permeability),))
        expected = _followed(states, drained) - base.sensors.computed
        # linear about the end, and those states have steps in time: at most 7.7 % off
        assert np.linalg.norm(effect.mean - expected) < 0.1 * np.linalg.norm(expected)
        # a fit has the same course without its steps
        of_fit = states.solve(drained).sensors.computed - base.sensors.computed
        np.testing.assert_allclose(of_fit, effect.mean, atol=1e-6 * np.abs(effect.mean).max())


def test_no_fluid_flows_in_a_body_at_rest(draining: Case) -> None:
    """Where no load is declared there is nothing that fluid could carry, and drainage moves nothing."""
    states = States(replace(draining, boundaries=draining.boundaries[:1]), "cpu")
    base = states.solve(Hypothesis(declared(states.case, states.parameters), np.zeros(states.modes.shape[1])))
    effects = Effects(Linearisation(base.system, base.u, base.reactions, base.sensors))
    for effect in effects.of(dictionary_of(states.case, ("drainage",), len(TIMES)).proposals["drainage"]):
        assert not effect.mean.any() and not effect.columns.any()


@pytest.fixture(scope="module")
def relaxing(diagnosed: tuple[str, Diagnosis]) -> tuple[Base, Candidates]:
    base = diagnosed[1].base
    dictionary = dictionary_of(base.states.case, ("drainage", "viscoelasticity"), len(TIMES))
    return base, candidates_at(dictionary, base.effects, {})


@pytest.mark.parametrize("c", [(0.1, np.log(30.0)), (0.1, np.log(10.0), np.log(100.0), 0.5)])
def test_what_relaxes_moves_less_as_its_times_say(relaxing: tuple[Base, Candidates], c: tuple[float, ...]) -> None:
    base, candidates = relaxing
    own = [effect.proposed for effect in candidates.effects["viscoelasticity"]]
    proposal = replace(next(one for one in own if len(one) == len(c)), mean=np.array(c))
    [effect] = base.effects.of([proposal])
    without, acting = (
        base.states.solve(replace(base.state.hypothesis, mechanisms=mechanisms))
        for mechanisms in ((), (proposal.make(np.array(c)),))
    )
    expected = acting.sensors.computed - without.sensors.computed
    # creep is a little slower than relaxation: at most 2.3 % off
    assert np.linalg.norm(effect.mean - expected) < 0.04 * np.linalg.norm(expected)


@pytest.mark.parametrize(("number", "shape"), [(0, AT_ONCE), (0, EVENLY), (1, AT_ONCE), (2, AT_ONCE)])
def test_it_is_said_when_an_unknown_force_set_in(number: int, shape: str, diagnosed: tuple[str, Diagnosis]) -> None:
    base = diagnosed[1].base
    [course] = [c for c in time_courses(TIMES) if (c.interval, c.shape) == (number, shape)]
    rng = np.random.default_rng(number)
    columns = base.typical_noise * next(iter(base.unknown.values())).columns
    force = course.factor(base.at.sensors.times) * (columns @ rng.normal(size=columns.shape[1]))
    residual = 20.0 * force + base.noise * rng.normal(size=len(force))
    found = onset_of(base, None, False, base.model, residual)
    assert found is not None and found.probability is not None
    edges = (0.0, *TIMES)
    assert found.first <= edges[number] < edges[number + 1] <= found.last
    assert found.probability >= 0.95
    assert sum(p for *_, p in found.intervals) == pytest.approx(1.0)
    assert found.course in (("", shape) if number < 2 else ("",))


@pytest.mark.slow
def test_what_relaxes_by_no_law_that_is_looked_for_has_no_name(tmp_path) -> None:
    """Where nothing that is looked for relaxes, a force that sets in fits what was recorded nearly as well."""
    case = write_slow(tmp_path / "case", CAUSES["viscoelasticity"])
    options = replace(_OPTIONS, candidates=("swelling", "traction", "gravity", "pressure"))
    found = Diagnosing(case, options, "cpu").run()
    assert found.verdict == "unknown" and found.unknown is not None and found.unknown.resistance
    assert "tissue whose resistance changes in time fits better" in found.sentence
    assert found.when is None


def test_with_one_time_nothing_is_said(small_diagnosis: Diagnosis) -> None:
    assert small_diagnosis.when is None
    assert (
        onset_of(small_diagnosis.base, None, False, small_diagnosis.base.model, small_diagnosis.base.residual) is None
    )


def test_when_in_words() -> None:
    said = {"seconds": [5.0, 20.0], "probability": 0.934, "course": AT_ONCE, "intervals": []}
    assert when_in_words(said) == "it set in between 5 and 20 s (probability 93 %), all at once"
    assert when_in_words({**said, "seconds": [0.0, 5.0], "course": ""}) == "it set in by 5 s (probability 93 %)"
    assert when_in_words({"seconds": [0.0, 5.0]}) == "0 to 5 s"


@pytest.mark.parametrize("times", [(0.81, 4.04, 20.22), (5.51, 27.55), (1.056, 5.28, 26.4), (0.722, 3.61, 18.05)])
def test_every_recorded_time_is_a_step(times: tuple[float, ...]) -> None:
    steps = steps_to(times)
    assert set(times) <= set(steps)
    assert steps == sorted(steps) and steps[-1] == times[-1]


def test_without_courses_the_other_places_share_all_of_the_prior():
    """Half of it is throughout the tissue, with and without a course; the other half in two places."""
    places = tuple(Place(np.full((2, 1), float(k))) for k in range(6))
    shares = np.array([0.25, 0.25, 0.125, 0.125, 0.125, 0.125])
    over_time = [None, (0,), None, (0,), None, (0,)]
    effects: Any = tuple(SimpleNamespace(proposed=SimpleNamespace(over_time=each)) for each in over_time)
    causes = BodyCauses((Cause("swelling", places, 0.0, shares=shares),), {"swelling": effects})
    always = always_there(causes, "swelling")
    assert always.places == places[::2]
    np.testing.assert_allclose(np.exp(always.log_weights[:, 0]), [0.5, 0.25, 0.25])
