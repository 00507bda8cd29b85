"""The stability conditions of the supplement's Table 2."""

import pytest
from material_point import LAWS

from warpbrain.errors import InputError
from warpbrain.physics.laws import Law, MooneyRivlin, NeoHookean, Ogden
from warpbrain.physics.laws.stability import UnstableLawError, require_stable


@pytest.mark.parametrize("law", [*LAWS.values(), NeoHookean(1e-3), MooneyRivlin(1.0, 1e3)], ids=str)
def test_stable_laws_pass(law: Law) -> None:
    require_stable(law)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        # w = C1 (l^2 + 2/l) + C2 (2 l + l^-2): with C2 < 0 the slope turns as l -> 0
        (MooneyRivlin(300.0, -100.0), "compression"),
        # with C1 < 0 it turns in tension
        (MooneyRivlin(-100.0, 300.0), "tension"),
        (Ogden((1000.0, -30.0), (2.0, 8.0)), "tension"),
    ],
)
def test_unstable_laws_are_refused(law: Law, message: str) -> None:
    with pytest.raises(UnstableLawError, match=rf"unstable in {message}: dPsi/dl at l = [\d.]+"):
        require_stable(law)


def test_refusal_is_an_input_error() -> None:
    with pytest.raises(InputError, match=r"MooneyRivlin\(C1=300.0, C2=-100.0\)"):
        require_stable(MooneyRivlin(300.0, -100.0))


def test_a_bounded_slope_is_refused() -> None:
    """`C2` alone: the stress `2 C2 (1 - l^-3)` has a ceiling."""
    with pytest.raises(UnstableLawError, match="the slope does not grow without bound as l -> infinity"):
        require_stable(MooneyRivlin(0.0, 500.0))


def test_a_law_that_softens_is_refused() -> None:
    """Ogden with 0 < alpha < 1: the energy is convex at rest, then bends over in tension."""
    with pytest.raises(UnstableLawError, match="d2Psi/dl2 is not positive"):
        require_stable(Ogden((2000.0 / 0.5,), (0.5,)))
