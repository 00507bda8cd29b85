"""The linear estimate of what tissue bears: linear, and found by bisection as one by one."""

from dataclasses import replace

import pytest
from folders import write_folder

from warpbrain.cases.reading import read_case
from warpbrain.ensemble.run import Overload, least_stretch, overloaded
from warpbrain.ensemble.sample import Sample
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material
from warpbrain.simulation.of_case import model_of


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return model_of(read_case(write_folder(tmp_path_factory.mktemp("block")) / "case.toml"))


def of(*moduli):
    return {label: Material(NeoHookean(mu), 0.45, "coupled") for label, mu in zip((1, 2), moduli, strict=True)}


def test_it_is_linear_in_load_and_compliance(model):
    stretch = 1.0 - least_stretch(replace(model, materials=of(1000.0, 3000.0)), "cpu")
    assert stretch > 0.0
    softer = 1.0 - least_stretch(replace(model, materials=of(250.0, 750.0)), "cpu")
    # solved to 1 %
    assert softer == pytest.approx(4.0 * stretch, rel=0.03)


def test_bisection_finds_what_one_by_one_finds(model):
    moduli = [(40.0, 70.0), (900.0, 1800.0), (5.0, 9.0), (20.0, 30.0), (100.0, 300.0), (60.0, 90.0), (3000.0, 9000.0)]
    samples = [Sample(k, of(*both)) for k, both in enumerate(moduli)] + [Sample(7, None, "no stable law")]
    each = [
        sample.number
        for sample in samples
        if sample.materials is not None and least_stretch(replace(model, materials=sample.materials), "cpu") <= 0.0
    ]
    assert 0 < len(each) < 7
    load = overloaded(model, samples, "cpu")
    assert list(load.numbers) == each
    # under that part of the load, as with tissue as much stiffer, the softest is just pressed to nothing
    softest = of(*(mu / load.share for mu in moduli[2]))
    assert 0.0 < load.share < 1.0
    assert least_stretch(replace(model, materials=softest), "cpu") == pytest.approx(0.0, abs=0.03)
    assert overloaded(model, samples[-2:], "cpu") == Overload((), 1.0)
