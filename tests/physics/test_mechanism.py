"""Numbers of mechanisms: which there are, other ones in the same mechanism, and what else two may differ in."""

import numpy as np
import pytest
from mechanism_numbers import continuous, numbers_of, scales_of, with_numbers

from warpbrain.errors import InputError
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.cavity import Cavity
from warpbrain.physics.mechanisms.compressibility import Compressibility
from warpbrain.physics.mechanisms.contact import Contact
from warpbrain.physics.mechanisms.drainage import Drainage
from warpbrain.physics.mechanisms.falx import Falx
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.inclusion import Inclusion
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.physics.mechanisms.residual_stress import ResidualStress
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.traction import Traction
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity

BALL = Swelling(amount=0.1, centre=(0.01, 0.02, 0.03), radius=0.005)
DOWN = [f"direction {axis}" for axis in "xyz"]
BRANCHES = Viscoelasticity(moduli=(1.0, 2.0), times=(3.0, 40.0))


@pytest.mark.parametrize(
    ("mechanism", "names"),
    [
        (BALL, ["amount", "centre x", "centre y", "centre z", "radius"]),
        (Swelling(amount=0.1), ["amount"]),
        (BRANCHES, ["moduli 1", "moduli 2", "times 1", "times 2"]),
        (Cavity(pressure=1.0), ["pressure"]),
        (Contact(nodes="a"), ["friction"]),
        (Gravity(direction=(0, 0, -1), density=1000.0), [*DOWN, "tissue_density"]),
        (
            Gravity(direction=(0, 0, -1), density=1000.0, csf_level=0.1),
            [*DOWN, "tissue_density", "csf_level"],
        ),
        (Resection(), []),
    ],
)
def test_which_there_are(mechanism: Mechanism, names: list[str]) -> None:
    assert [place.name for place in continuous(mechanism)] == [f"{mechanism.kind} {name}" for name in names]


@pytest.mark.parametrize("kind", [Drainage, Fibres, Inclusion, ResidualStress, Swelling])
def test_what_names_no_elements_is_of_all_tissue(kind: type[Mechanism]) -> None:
    assert kind.described("elements").endswith("all tissue if absent.")


def test_other_numbers_and_back() -> None:
    several = (BALL, Resection(), BRANCHES, Pressure(nodes="a", value=5.0))
    numbers = numbers_of(several)
    assert with_numbers(several, numbers) == several
    changed = with_numbers(several, 2.0 * numbers)
    assert changed[0] == Swelling(amount=0.2, centre=(0.02, 0.04, 0.06), radius=0.01)
    assert changed[2] == Viscoelasticity(moduli=(2.0, 4.0), times=(6.0, 80.0))
    assert changed[3] == Pressure(nodes="a", value=10.0)
    with pytest.raises(InputError, match="found 3 numbers, expected 10"):
        with_numbers(several, numbers[:3])


@pytest.mark.parametrize(
    ("mechanism", "scales"),
    [
        (BALL, [0.1, 0.01, 0.01, 0.01, 0.005]),
        (Swelling(amount=0.0), [0.03 * 0.9944578832]),
        (Compressibility(poisson=0.499), [0.001]),
        (Falx(nodes="a"), [31.5e6, 0.001]),
        (Contact(nodes="a", friction=0.2), [0.2]),
        (Traction(centre=(0, 0, 0), value=(3.0, 0.0, -4.0)), [0.01] * 3 + [5.0] * 3 + [0.01]),
    ],
)
def test_by_how_much_each_must_change(mechanism: Mechanism, scales: list[float]) -> None:
    assert scales_of([mechanism]) == pytest.approx(np.array(scales))


def test_a_number_at_the_end_of_its_range_has_a_scale() -> None:
    [scale] = scales_of([Contact(nodes="a", friction=0.0)])
    assert 0.05 < scale < 0.5


def test_what_another_mechanism_is() -> None:
    other = Swelling(amount=0.3, centre=(0.0, 0.0, 0.0), radius=0.1, ramp=[(0.0, 0.0), (1.0, 1.0)])
    assert BALL.differs_in_numbers_only(other)
    assert not BALL.differs_in_numbers_only(Swelling(amount=0.1))
    assert not BALL.differs_in_numbers_only(Inclusion(ratio=2.0, centre=(0.0, 0.0, 0.0), radius=0.1))
    assert not Contact(nodes="a").differs_in_numbers_only(Contact(nodes="a", state="lifting"))
    assert Contact(nodes="a").differs_in_numbers_only(Contact(nodes="a", penalty=10.0, friction=0.1))
    assert not BRANCHES.differs_in_numbers_only(Viscoelasticity(moduli=(1.0,), times=(3.0,)))
