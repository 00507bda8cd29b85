"""Which density a turned head has: that of brain, whatever the case's table says of inertia."""

import numpy as np
from shapes import box

from warpbrain.physics.mechanism import Facts
from warpbrain.physics.mechanisms.gravity import CSF_DENSITY, STANDARD_GRAVITY, Gravity

#: Dry nowhere: of the load only what turning the head changes is left.
SUBMERGED = {"direction": (0.0, 0.0, -1.0), "imaged_direction": (0.0, -1.0, 0.0), "csf_level": 1.0}
MESH = box((2, 2, 2), (0.1, 0.1, 0.1))


def turned(density: float, **values: float) -> Gravity:
    return Gravity.of_case(SUBMERGED | values, Facts(MESH, (0.0, 0.0, -1.0), density))


def test_a_turned_head_moves_as_brain_does_in_fluid(verify) -> None:
    """Archimedes: what sinks is the difference of the densities, 33 kg/m3, a sixth of what the paper's table gives."""
    weight = (1040.0 - CSF_DENSITY) * STANDARD_GRAVITY * 1e-3
    for density in (1040.0, 1211.5):
        total = turned(density).unit_forces(MESH).reshape(-1, 4, 3).sum(axis=(0, 1))
        error = np.abs(total - [0.0, weight, -weight]).max() / weight
        verify(
            f"load of a turned head, case of {density:g} kg/m3",
            "Archimedes, brain of 1040 kg/m3 (ICRU 44)",
            error,
            1e-12,
        )


def test_a_case_can_say_another_density() -> None:
    gel = turned(1211.5, tissue_density=1010.0)
    np.testing.assert_allclose(gel.unit_forces(MESH) * 11.0, turned(1211.5).unit_forces(MESH), rtol=1e-12, atol=1e-15)
    assert "of tissue of 1010 kg/m3" in gel.detail() and "of tissue of 1040 kg/m3" in turned(1000.0).detail()


def test_without_fluid_the_case_s_density_is_what_weighs() -> None:
    dry = Gravity(direction=(0.0, 0.0, -1.0), density=1211.5)
    total = dry.unit_forces(MESH).reshape(-1, 4, 3).sum(axis=(0, 1))
    np.testing.assert_allclose(total, [0.0, 0.0, -1211.5 * STANDARD_GRAVITY * 1e-3], rtol=1e-12, atol=1e-12)


def test_derivative_by_the_density() -> None:
    """The load is linear in it, so a difference over any step is exact."""
    load, denser = turned(1211.5), turned(1211.5, tissue_density=1041.0)
    rate = load.unit_forces_rate(MESH, lambda look: np.asarray(look(denser) - look(load)))
    difference = denser.unit_forces(MESH) - load.unit_forces(MESH)
    np.testing.assert_allclose(rate, difference, rtol=1e-6, atol=1e-12)
