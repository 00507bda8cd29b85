"""Mechanisms in a specimen: closed forms of homogeneous states, the hereditary integral, and what is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from testing_machine import CUBE, EXACT, case_of, recorded, simulate_test
from verification_rows import Row

from warpbrain.cases import specimen as specimens
from warpbrain.cases.specimen import Specimen
from warpbrain.errors import InputError
from warpbrain.physics.laws import NeoHookean, Ogden
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.asymmetry import Asymmetry
from warpbrain.physics.mechanisms.compressibility import Compressibility
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.inclusion import Inclusion
from warpbrain.physics.mechanisms.residual_stress import ResidualStress
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.history import corners_of, history_of
from warpbrain.simulation.model import Material
from warpbrain.simulation.run import why_not
from warpbrain.simulation.specimen import Rig, TestResult

MU, LAM = 1000.0, 9000.0
PLATE = Specimen("block", (5e-3, 4e-3, 3e-3), "lubricated")


def answered(
    mode: str,
    imposed: np.ndarray,
    *acting: Mechanism,
    specimen: Specimen = PLATE,
    time: np.ndarray | None = None,
    steps: int = 2,
) -> TestResult:
    case = replace(case_of(specimen), mechanisms=acting)
    return simulate_test(case, replace(recorded(mode, imposed), time=time), "cpu", options=EXACT, steps=steps)


# -- lubricated: the energy of a homogeneous state, least over all that is free ----------------------------------


def neo_hookean(F: np.ndarray) -> float:
    J = np.linalg.det(F)
    return 0.5 * MU * (np.sum(F**2) - 3.0) - MU * np.log(J) + 0.5 * LAM * np.log(J) ** 2


def least(energy, stretch: float) -> float:
    """Energy over the columns that the platens leave free: two of the base, and the upper one's way sideways."""

    def of(x: np.ndarray) -> float:
        F = np.array([[x[0], x[1], x[2]], [0.0, x[3], x[4]], [0.0, 0.0, stretch]])
        return energy(F) if x[0] > 0.0 and x[3] > 0.0 else np.inf

    start = [stretch**-0.5, 0.0, 0.0, stretch**-0.5, 0.0]
    found = minimize(of, start, method="BFGS", options={"gtol": 1e-7})
    found = minimize(of, found.x, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-11, "maxiter": 5000})
    return float(found.fun)


def stress(energy, stretch: float, h: float = 1e-3) -> float:
    """Slope of the least energy, to fourth order."""
    e = [least(energy, stretch + k * h) for k in (-2, -1, 1, 2)]
    return (e[0] - 8.0 * e[1] + 8.0 * e[2] - e[3]) / (12.0 * h)


def along(direction: tuple[float, float, float]) -> np.ndarray:
    return np.array(direction) / np.linalg.norm(direction)


OBLIQUE = (0.6, 0.3, 1.0)


def with_fibres(F: np.ndarray) -> float:
    E = max(0.0, float(np.sum((F @ along(OBLIQUE)) ** 2)) - 1.0)
    return neo_hookean(F) + 400.0 / 4.0 * (np.exp(2.0 * E**2) - 1.0)


def with_tension(F: np.ndarray) -> float:
    return neo_hookean(F) + 0.5 * 150.0 * float(np.sum((F @ along(OBLIQUE)) ** 2))


def swollen(F: np.ndarray) -> float:
    return 1.08 * neo_hookean(F / np.cbrt(1.08))


@pytest.mark.slow(1)
@pytest.mark.parametrize(
    ("acting", "energy"),
    [
        (Fibres(direction=OBLIQUE, stiffness=400.0, exponent=2.0), with_fibres),
        (ResidualStress(direction=OBLIQUE, tension=150.0), with_tension),
        (Swelling(amount=0.08), swollen),
    ],
    ids=["fibres", "residual stress", "swelling"],
)
def test_lubricated_states_are_those_of_least_energy(acting: Mechanism, energy, verify: Row) -> None:
    """Oblique directions shear the specimen sideways; 1e-5 is what the minimiser here reaches."""
    found = answered("stretch", np.array([0.85, 1.15]), acting)
    np.testing.assert_allclose(found.imposed, [0.85, 0.925, 1.0, 1.075, 1.15])
    expected = [stress(energy, l) for l in found.imposed]
    if isinstance(acting, Fibres):
        # nothing acts yet; and differences across the point where fibres tauten mean nothing
        expected[2] = 0.0
    error = np.abs(found.response - expected).max() / np.abs(expected).max()
    claim = "stress of lubricated specimens with fibres, residual stress, swelling"
    verify(claim, "least energy by another minimiser", error, 1e-5)


def test_what_says_another_law_is_that_law() -> None:
    imposed = np.array([0.8, 1.2])
    found = answered("stretch", imposed, Asymmetry(exponent=-8.0), Compressibility(poisson=0.3))
    law = Ogden((2.0 * MU / -8.0,), (-8.0,))
    expected = simulate_test(
        case_of(PLATE, Material(law, 0.3)), recorded("stretch", imposed), "cpu", options=EXACT, steps=2
    )
    np.testing.assert_allclose(found.response, expected.response, rtol=1e-10)
    assert found.response[0] != pytest.approx(answered("stretch", imposed).response[0], rel=0.1)


def test_a_swelling_specimen_presses_on_its_platens_before_anything_is_imposed() -> None:
    """Glued, it can go nowhere at its ends; lubricated, only sideways: less."""
    glued = replace(PLATE, grips="glued")
    forces = [
        float(answered("stretch", np.array([1.0]), Swelling(amount=0.05), specimen=s).predicted[0])
        for s in (PLATE, glued)
    ]
    assert forces[1] < forces[0] < 0.0


def test_a_ball_that_swells_needs_a_mesh() -> None:
    ball = Swelling(amount=0.2, centre=(0.0, 0.0, 1.5e-3), radius=1e-3)
    found = answered("stretch", np.array([1.0]), ball, specimen=replace(PLATE, grips="glued"))
    assert found.predicted[0] < 0.0
    with pytest.raises(InputError, match=re.escape("acts in a part of the specimen")):
        answered("stretch", np.array([1.0]), ball)


@pytest.mark.parametrize("acting", [Inclusion(ratio=2.0, centre=(0.0, 0.0, 1e-3), radius=1e-3)])
def test_what_means_nothing_in_a_specimen_is_refused(acting: Mechanism) -> None:
    with pytest.raises(InputError, match=re.escape("means nothing in a [specimen]")):
        answered("stretch", np.array([1.0]), acting)
    # and told before, by `cases check`
    assert "means nothing in a [specimen]" in why_not(replace(case_of(PLATE), mechanisms=(acting,)))
    assert why_not(replace(case_of(PLATE), mechanisms=(VISCOUS,))) == ""


# -- through time ---------------------------------------------------------------------------------------------------

MODULI, TIMES = (2.0, 0.5), (0.5, 6.0)
VISCOUS = Viscoelasticity(moduli=MODULI, times=TIMES)


def test_a_memory_needs_times() -> None:
    with pytest.raises(InputError, match="no column t"):
        answered("stretch", np.array([1.0, 1.1]), VISCOUS)


def test_relaxation_of_a_glued_specimen_begins_stiff_and_ends_soft(monkeypatch: pytest.MonkeyPatch) -> None:
    """At once the shear modulus is `mu (1 + sum beta)`, in the end `mu`; the bulk modulus stays the same."""
    monkeypatch.setattr(specimens, "CELLS", 4)
    time = np.array([0.0, 1e-6, 0.5, 2.0, 10.0, 60.0])
    imposed = np.where(time > 0.0, 1e-6, 0.0)
    found = answered("shear", imposed, VISCOUS, specimen=CUBE, time=time).predicted
    stiff, K = MU * (1.0 + sum(MODULI)), LAM + 2.0 / 3.0 * MU
    poisson = (3.0 * K - 2.0 * stiff) / (2.0 * (3.0 * K + stiff))
    for material, expected in ((Material(NeoHookean(stiff), poisson), found[1]), (Material(NeoHookean(MU)), found[-1])):
        elastic = simulate_test(case_of(CUBE, material), recorded("shear", imposed), "cpu", options=EXACT, steps=1)
        assert elastic.predicted[-1] == pytest.approx(expected, rel=2e-4)
    assert np.all(np.diff(found[1:]) < 0.0)


def test_a_cycle_of_a_homogeneous_specimen_is_the_hereditary_integral(verify: Row) -> None:
    """Confined by nothing, the lateral stretch follows the history too: solved again here at each quadrature point.

    The reference integrates the evolution of the branches with 2,000 steps and solves for the sides at each.
    """
    from scipy.optimize import brentq

    time = np.linspace(0.0, 4.0, 81)
    imposed = 1.0 + 0.15 * np.abs((time + 1.0) % 2.0 - 1.0)
    found = answered("stretch", imposed, VISCOUS, time=time, steps=8)

    def isochoric(l: float, s: float) -> np.ndarray:
        J, C = l * s * s, np.array([l * l, s * s])
        return MU * J ** (-2.0 / 3.0) * (1.0 - (C[0] + 2.0 * C[1]) / 3.0 / C)

    fine = np.linspace(0.0, 4.0, 2001)
    q, S, expected = np.zeros((2, 2)), np.zeros(2), []
    h = fine[1] - fine[0]
    decay = np.exp(-h / np.array(TIMES))[:, None]
    response = (np.array(MODULI) * np.exp(-0.5 * h / np.array(TIMES)))[:, None]
    for t in fine:
        l = 1.0 + 0.15 * abs((t + 1.0) % 2.0 - 1.0)

        def total(s: float, l: float = l, q: np.ndarray = q, S: np.ndarray = S) -> np.ndarray:
            J = l * s * s
            elastic = MU * (1.0 - 1.0 / np.array([l, s]) ** 2) + LAM * np.log(J) / np.array([l, s]) ** 2
            return elastic + (decay * q + response * (isochoric(l, s) - S)).sum(axis=0)

        side = brentq(lambda s, total=total: total(s)[1], 0.7, 1.3, xtol=1e-13)
        expected.append(l * total(side)[0])
        new = isochoric(l, side)
        q, S = decay * q + response * (new - S), new
    reference = np.interp(time, fine, expected)
    by = "2,000 steps of the branches, sides free"
    error = np.abs(found.predicted - reference).max() / np.abs(reference).max()
    verify("stress of a viscoelastic specimen in a cycle", by, error, 3e-3)
    # it takes work to go round
    loop = np.sum(0.5 * (found.predicted[1:] + found.predicted[:-1]) * np.diff(imposed))
    error = abs(loop / np.sum(0.5 * (reference[1:] + reference[:-1]) * np.diff(imposed)) - 1.0)
    verify("work that a viscoelastic specimen loses in two cycles", by, error, 5e-3)
    assert loop > 0.0


def test_what_has_a_ramp_follows_the_times() -> None:
    time = np.array([0.0, 10.0, 20.0])
    growing = Swelling(amount=0.06, ramp=((0.0, 0.0), (20.0, 1.0)))
    found = answered("stretch", np.array([1.0, 1.0, 1.0]), growing, time=time, steps=8)
    half, whole = (answered("stretch", np.array([1.0]), Swelling(amount=g)).predicted[0] for g in (0.03, 0.06))
    np.testing.assert_allclose(found.predicted, [0.0, half, whole], rtol=1e-6, atol=1e-6)


def test_a_rig_forgets_the_test_before() -> None:
    rig = Rig(replace(case_of(PLATE), mechanisms=(VISCOUS,)), "cpu", options=EXACT)
    test = replace(recorded("stretch", np.array([1.0, 1.2, 0.9])), time=np.array([0.0, 1.0, 2.0]))
    first, second = rig.run(test), rig.run(test)
    np.testing.assert_array_equal(first.response, second.response)


def test_corners_of_a_record() -> None:
    time = np.linspace(0.0, 10.0, 201)
    ramp = np.clip(time, 2.0, 4.0)
    noise = 1e-3 * np.random.default_rng(0).uniform(-1.0, 1.0, len(time))
    rows = corners_of(time, ramp + noise, 0.02)
    np.testing.assert_allclose(time[rows], [0.0, 2.0, 4.0, 10.0], atol=1e-9)
    history = history_of(time, ramp - 2.0, 2.0, 8, 0.5)
    assert len(history.corners) == 4
    np.testing.assert_allclose(np.interp(time, history.time, history.imposed), ramp - 2.0, atol=1e-12)
    # short steps where something relaxes after the ramp
    held = history.time[history.corners[2] : history.corners[3] + 1]
    assert held[1] - held[0] == pytest.approx(0.125) and np.all(np.diff(held)[1:] >= np.diff(held)[:-1] * 0.4)
