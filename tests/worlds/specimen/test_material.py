"""Homogeneous states against closed forms, quadrature of the hereditary integral, and the rig."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from testing_machine import EXACT, case_of, recorded, simulate_test

from warpbrain.cases.specimen import Specimen
from warpbrain.physics.laws import MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.mechanisms.asymmetry import Asymmetry
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.worlds.specimen.material import HomogeneousMaterial, relaxing

PLATE = Specimen("block", (5e-3, 4e-3, 3e-3), "lubricated")
STRETCH = np.array([0.8, 0.9, 1.0, 1.1, 1.25])


def uniaxial_ogden(mu: float, alpha: float, l: np.ndarray) -> np.ndarray:
    return 2.0 * mu / alpha * (l ** (alpha - 1.0) - l ** (-0.5 * alpha - 1.0))


@pytest.mark.parametrize("alpha", [2.0, -15.0])
def test_nearly_incompressible_uniaxial_stress_is_the_closed_form(alpha):
    law = Ogden((2.0 * 1000.0 / alpha,), (alpha,))
    found = HomogeneousMaterial(law, 0.49999, "uncoupled").stress("axial", STRETCH, None)
    np.testing.assert_allclose(found, uniaxial_ogden(1000.0, alpha, STRETCH), rtol=5e-4, atol=0.05)


def test_simple_shear_is_the_closed_form():
    shear = np.linspace(-0.3, 0.3, 7)
    law = Ogden((2.0 * 1000.0 / -12.0,), (-12.0,))
    found = HomogeneousMaterial(law, 0.45, "coupled").stress("shear", shear, None)
    l = 0.5 * shear + np.sqrt(1.0 + 0.25 * shear**2)
    np.testing.assert_allclose(found, 2.0 * 1000.0 / -12.0 * (l**-12.0 - l**12.0) / (l + 1.0 / l), atol=1e-3)


def test_torsion_of_a_neo_hookean_cylinder_is_linear():
    rim = np.array([0.0, 0.2, 0.4])
    found = HomogeneousMaterial(NeoHookean(1000.0), 0.45, "coupled").stress("torsion", rim, None)
    # T = mu (rim / R) pi R^4 / 2 over 2/3 pi R^3
    np.testing.assert_allclose(found, 0.75 * 1000.0 * rim, atol=1e-3)


@pytest.mark.parametrize("law", [NeoHookean(1000.0), MooneyRivlin(300.0, 200.0), Ogden((-100.0,), (-20.0,))])
@pytest.mark.parametrize("formulation", ["coupled", "uncoupled"])
def test_states_are_those_of_the_rig(law, formulation):
    case = case_of(PLATE)
    tissue = replace(case.tissues[1], law=law, formulation=formulation, model=law.name)
    case = replace(case, tissues={1: tissue})
    result = simulate_test(case, recorded("stretch", STRETCH), "cpu", options=EXACT, steps=4)
    found = HomogeneousMaterial.of_case(case, ()).stress("axial", result.imposed, None)
    np.testing.assert_allclose(found, result.response, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("mode", ["confined", "biaxial"])
@pytest.mark.parametrize("law", [NeoHookean(1000.0), Ogden((-100.0,), (-20.0,))])
@pytest.mark.parametrize("direction", [None, (1.0, 0.0, 1.0)])
def test_states_of_homogeneous_modes_are_those_of_the_rig(mode, law, direction):
    case = case_of(PLATE)
    tissue = replace(case.tissues[1], law=law, model=law.name)
    fibres = () if direction is None else (Fibres(direction=direction, stiffness=400.0, exponent=2.0),)
    # between walls oblique fibres are held; a sheet is sheared by them
    if direction is not None and mode == "biaxial":
        fibres = (replace(fibres[0], direction=(1.0, 0.0, 0.0)),)
    case = replace(case, tissues={1: tissue}, mechanisms=fibres)
    result = simulate_test(case, recorded(mode, STRETCH), "cpu", options=EXACT, steps=4)
    found = HomogeneousMaterial.of_case(case, ()).stress(mode, result.imposed, None)
    np.testing.assert_allclose(found, result.response, rtol=1e-5, atol=0.01)


@pytest.mark.parametrize("mode", ["confined", "biaxial"])
def test_a_viscous_history_of_a_homogeneous_mode_is_that_of_the_rig(mode):
    time = np.linspace(0.0, 20.0, 161)
    stretch = 1.0 + 0.12 * np.sin(2.0 * np.pi * time / 20.0)
    case = replace(case_of(PLATE), mechanisms=(Viscoelasticity(moduli=(1.5, 0.5), times=(3.0, 30.0)),))
    result = simulate_test(case, replace(recorded(mode, stretch), time=time), "cpu", steps=8)
    found = HomogeneousMaterial.of_case(case, ()).stress(mode, stretch, time)
    # the rig's midpoint rule errs by its steps
    np.testing.assert_allclose(found, result.predicted, atol=0.01 * np.abs(found).max())


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
def test_states_with_fibres_are_those_of_the_rig(direction):
    fibres = Fibres(direction=direction, stiffness=400.0, exponent=2.0)
    case = replace(case_of(PLATE), mechanisms=(fibres,))
    result = simulate_test(case, recorded("stretch", STRETCH), "cpu", options=EXACT, steps=4)
    found = HomogeneousMaterial.of_case(case, ()).stress("axial", result.imposed, None)
    np.testing.assert_allclose(found, result.response, rtol=1e-5, atol=0.01)  # they begin to pull at rest: a kink


def test_memory_is_the_hereditary_integral():
    time = np.array([0.0, 0.5, 1.5, 4.0, 9.0])
    values = np.array([1.0, 3.0, 2.0, 2.0, -1.0])
    tau = 2.0
    slopes = np.diff(values) / np.diff(time)

    def held(t: float) -> float:
        total = values[0] * np.exp(-t / tau)
        for a, b, slope in zip(time[:-1], time[1:], slopes, strict=True):
            if a < t:
                total += slope * quad(lambda s: np.exp(-(t - s) / tau), a, min(b, t))[0]
        return total

    np.testing.assert_allclose(relaxing(values, time, tau), [held(t) for t in time], atol=1e-9)


def test_a_viscous_history_is_that_of_the_rig():
    time = np.linspace(0.0, 20.0, 161)
    stretch = 1.0 + 0.12 * np.sin(2.0 * np.pi * time / 20.0)
    case = replace(case_of(PLATE), mechanisms=(Viscoelasticity(moduli=(1.5, 0.5), times=(3.0, 30.0)),))
    result = simulate_test(case, replace(recorded("stretch", stretch), time=time), "cpu", steps=8)
    found = HomogeneousMaterial.of_case(case, ()).stress("axial", stretch, time)
    # the rig's midpoint rule errs by its steps
    np.testing.assert_allclose(found, result.predicted, atol=0.01 * np.abs(found).max())


def test_mechanisms_of_a_case_add_up():
    case = replace(case_of(PLATE), mechanisms=(Viscoelasticity(moduli=(1.0,), times=(3.0,)),))
    found = HomogeneousMaterial.of_case(case, (Asymmetry(exponent=-10.0), Viscoelasticity(moduli=(2.0,), times=(9.0,))))
    assert found.moduli == (1.0, 2.0) and found.times == (3.0, 9.0)
    assert found.law == Ogden((-200.0,), (-10.0,))
