"""A sample of a batch is the single run of its materials, and knows nothing of the others."""

from dataclasses import replace

import numpy as np
import pytest
from many_samples import MODULI, computed, samples_of, shaken_block
from material_point import LAWS

from warpbrain.ensemble.course import Moving, Resting
from warpbrain.ensemble.sample import Sample
from warpbrain.errors import InputError, SolveError
from warpbrain.kernels.module import PRECISIONS
from warpbrain.physics.laws import MooneyRivlin, NeoHookean, Ogden
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.relaxation import RelaxationOptions, relax_to_rest
from warpbrain.simulation.result import result_of
from warpbrain.simulation.system import System

STEPS = 12
KINDS = {
    "neo-hookean": LAWS["neo-hookean"],
    "mooney-rivlin": LAWS["mooney-rivlin"],
    "ogden": LAWS["ogden -4.7"],
    "ogden of 3 terms": LAWS["ogden 3 terms"],
}
#: How near two ways through the same arithmetic come.
NEAR = {"double": 1e-9, "single": 2e-3}


def moved(model: Model, device: str, precision: str) -> System:
    """The single run that `warpbrain run --steps` makes."""
    system = System(model, device, precision)
    simulator = Simulator(system)
    for step in range(1, STEPS + 1):
        due = simulator.time + simulator.time_step
        simulator.prescribe(model.prescribed_at(due, step / STEPS))
        simulator.step()
        simulator.check()
    return system


@pytest.mark.parametrize(
    ("kind", "formulation", "digits"),
    # kernels of each take a second to compile
    [
        *((kind, "coupled", "double") for kind in KINDS),
        ("neo-hookean", "coupled", "single"),
        *(pytest.param(kind, "uncoupled", "double", marks=pytest.mark.slow(2)) for kind in KINDS),
        *(
            pytest.param(kind, "coupled", "single", marks=pytest.mark.slow(2))
            for kind in KINDS
            if kind != "neo-hookean"
        ),
    ],
)
def test_a_motion_is_that_of_the_simulator(kind: str, formulation: str, digits: str, device: str) -> None:
    precision = PRECISIONS[digits]
    model = shaken_block(KINDS[kind], formulation)
    samples = samples_of(model, MODULI[:3])
    system = System(model, device, precision.name)
    outcomes = computed(system, Moving(model, STEPS), samples, 2)
    for sample in samples:
        alone = result_of(moved(replace(model, materials=sample.materials), device, precision.name), STEPS * 1e-3)
        outcome = outcomes[sample.number]
        assert not outcome.failed and outcome.steps == STEPS
        size = np.abs(alone.u).max()
        np.testing.assert_allclose(outcome.u, alone.u, rtol=0, atol=NEAR[precision.name] * size)
        pull = np.abs(alone.reactions).max()
        np.testing.assert_allclose(outcome.reactions, alone.reactions, rtol=0, atol=NEAR[precision.name] * pull)
        assert outcome.min_J == pytest.approx(alone.J.min(), rel=NEAR[precision.name])


@pytest.mark.parametrize("moves", [True, False])
def test_rest_is_that_of_the_relaxation(moves: bool, device: str, precision) -> None:
    model = shaken_block(LAWS["neo-hookean"], moves=moves)
    samples = samples_of(model, MODULI[:3])
    system = System(model, device, precision.name)
    # a solve to 1e-3 can end an iteration earlier for one rounding, and then both are at rest as nearly as was asked,
    # and not as nearly as they do the same arithmetic: that shows where more is asked
    near = NEAR[precision.name]
    for options, apart in ((RelaxationOptions(), max(near, 1e-7)), (RelaxationOptions(tolerance=1e-11), near)):
        outcomes = computed(system, Resting(model, options, precision), samples, 2)
        for sample in samples:
            alone = relax_to_rest(System(replace(model, materials=sample.materials), device, precision.name), options)
            outcome = outcomes[sample.number]
            assert not outcome.failed
            assert outcome.residual <= alone.tolerance
            np.testing.assert_allclose(outcome.u, alone.u, rtol=0, atol=apart * np.abs(alone.u).max())
            if precision.name == "double" and options == RelaxationOptions():
                # for the same reason the last step may be one more, or one less
                assert abs(outcome.steps - len(alone.history)) <= 1


@pytest.mark.parametrize("course", ["motion", "rest"])
@pytest.mark.parametrize(
    ("kind", "digits"),
    [
        ("mooney-rivlin", "double"),
        ("neo-hookean", "single"),
        pytest.param("mooney-rivlin", "single", marks=pytest.mark.slow(2)),
    ],
)
def test_the_bits_of_a_sample_do_not_depend_on_the_others(kind: str, digits: str, course: str, device: str) -> None:
    precision = PRECISIONS[digits]
    model = shaken_block(KINDS[kind])
    samples = samples_of(model)
    system = System(model, device, precision.name)

    def run(chosen: list[Sample], slots: int):
        way = Moving(model, STEPS) if course == "motion" else Resting(model, RelaxationOptions(), precision)
        return computed(system, way, chosen, slots)

    together = run(samples, 7)
    assert not any(outcome.failed for outcome in together.values())
    for others in (run(samples, 3), run(samples[::-1], 2), run(samples[4:5], 1), run(samples, 64)):
        for number, outcome in others.items():
            assert outcome.u.tobytes() == together[number].u.tobytes()
            assert outcome.reactions.tobytes() == together[number].reactions.tobytes()
            assert outcome.cg_iterations == together[number].cg_iterations
            assert outcome.steps == together[number].steps


def test_a_failure_is_that_of_the_single_run_and_leaves_the_others_alone(device: str) -> None:
    model = shaken_block(LAWS["neo-hookean"], moves=False)
    samples = samples_of(model, (900.0, 4.0, 2000.0))
    soft = samples[1] = Sample(1, {1: Material(NeoHookean(4.0)), 2: Material(NeoHookean(4.0))})
    system = System(model, device)
    course = Moving(model, 60, time_step=0.01)
    alone = computed(system, Moving(model, 60, time_step=0.01), [samples[0], samples[2]], 2)
    outcomes = computed(system, course, samples, 3)
    assert [o.failed for _, o in sorted(outcomes.items())] == [False, True, False]
    assert outcomes[2].u.tobytes() == alone[2].u.tobytes()
    # the slot of the one that failed, which comes first, is taken by the next
    after = computed(system, Moving(model, 60, time_step=0.01), samples, 1)
    assert [after[number].u.tobytes() for number in (0, 2)] == [alone[number].u.tobytes() for number in (0, 2)]
    simulator = Simulator(System(replace(model, materials=soft.materials), device), time_step=0.01)

    def follow() -> None:
        for _ in range(60):
            simulator.step()
            simulator.check()

    with pytest.raises(SolveError) as failure:
        follow()
    assert outcomes[1].reason == str(failure.value)
    assert outcomes[1].u.shape == (0, 3)


def test_what_does_not_come_to_rest_says_so(device: str) -> None:
    model = shaken_block(LAWS["neo-hookean"], moves=False)
    samples = samples_of(model, (1000.0,))
    options = RelaxationOptions(max_steps=3)
    outcome = computed(System(model, device), Resting(model, options, PRECISIONS["double"]), samples, 1)[0]
    with pytest.raises(SolveError) as failure:
        relax_to_rest(System(replace(model, materials=samples[0].materials), device), options)
    assert outcome.reason == str(failure.value)


def test_a_sample_without_materials_is_a_failure(device: str) -> None:
    model = shaken_block(LAWS["neo-hookean"])
    samples = [*samples_of(model, (1000.0,)), Sample(1, None, "draw 1: unstable")]
    outcomes = computed(System(model, device), Moving(model, 2), samples, 2)
    assert not outcomes[0].failed
    assert outcomes[1].reason == "draw 1: unstable"


def test_all_samples_have_the_laws_of_the_first(device: str) -> None:
    model = shaken_block(LAWS["neo-hookean"])
    samples = samples_of(model, (1000.0, 1000.0))
    samples[1] = Sample(1, {1: Material(MooneyRivlin(200.0, 300.0)), 2: samples[0].materials[2]})
    with pytest.raises(InputError, match="sample 1: tissue 1: mooney-rivlin"):
        computed(System(model, device), Moving(model, 2), samples, 2)


def test_terms_of_no_weight_change_no_bit(device: str) -> None:
    """A sample whose law has fewer terms than another's is padded in one batch and not in the next."""
    model = shaken_block(Ogden((-400.0,), (-5.0,)))
    short = samples_of(model, (1000.0,))
    long = Sample(1, {1: Material(LAWS["ogden 3 terms"]), 2: short[0].materials[2]})
    system = System(model, device)
    alone = computed(system, Moving(model, 5), short, 1)[0]
    beside = computed(system, Moving(model, 5), [*short, long], 2)[0]
    assert alone.u.tobytes() == beside.u.tobytes()
