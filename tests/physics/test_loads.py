"""Loads: their totals, their directions, and what they refuse."""

import math

import numpy as np
import pytest
from shapes import box, cube, distorted

from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.physics.force import NodalForce
from warpbrain.physics.load import Load
from warpbrain.physics.mechanisms.gravity import CSF_DENSITY, STANDARD_GRAVITY, SURFACE_WIDTH, Gravity

MESH = box((4, 3, 20), (0.08, 0.06, 0.1))
DENSITY = 1211.5
DOWN = (0.0, 0.0, -1.0)


def total(load: Load, mesh: TetMesh = MESH) -> np.ndarray:
    return load.nodal_forces(mesh).sum(axis=0)


# -- gravity ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [DOWN, (0.0, 3.0, 0.0), (1.0, -2.0, 2.0)])
def test_whole_weight_without_fluid(direction: tuple[float, float, float]) -> None:
    mesh = distorted(MESH, 0.002)
    unit = np.array(direction) / np.linalg.norm(direction)
    expected = DENSITY * STANDARD_GRAVITY * mesh.volume * unit
    np.testing.assert_allclose(total(Gravity(direction=direction, density=DENSITY), mesh), expected, atol=1e-12)


def test_weight_acts_at_the_centre_of_mass() -> None:
    mesh = distorted(MESH, 0.002)
    f = Gravity(direction=DOWN, density=DENSITY).nodal_forces(mesh)
    centre = np.average(mesh.points[mesh.tetrahedra].mean(axis=1), axis=0, weights=mesh.volumes)
    moment = np.cross(mesh.points, f).sum(axis=0)
    np.testing.assert_allclose(moment, np.cross(centre, f.sum(axis=0)), atol=1e-12)


def test_weight_above_the_level() -> None:
    """What hangs above the fluid weighs what the fluid no longer carries; the step is smooth over 3 mm."""
    level = 0.04
    found = total(Gravity(direction=DOWN, density=DENSITY, csf_level=level))
    expected = CSF_DENSITY * STANDARD_GRAVITY * MESH.volume * 0.6
    # the smoothed step is odd about the level; nodal quadrature on layers of 5 mm sees it to a few percent
    assert -found[2] == pytest.approx(expected, rel=0.03)
    assert np.abs(found[:2]).max() == 0.0


def test_height_is_measured_against_gravity_from_the_lowest_point() -> None:
    moved = TetMesh(MESH.points + np.array([1.0, 2.0, 3.0]), MESH.tetrahedra)
    height = Gravity(direction=(0.0, 0.0, 2.0), density=DENSITY).height(moved, moved.points)
    np.testing.assert_allclose(height, 0.1 - MESH.points[:, 2], atol=1e-12)


def test_drowned_and_dry() -> None:
    drowned = Gravity(direction=DOWN, density=DENSITY, csf_level=0.2)
    assert np.abs(drowned.nodal_forces(MESH)).max() < 1e-12
    dry = Gravity(direction=DOWN, density=DENSITY, csf_level=-0.1)
    assert -total(dry)[2] == pytest.approx(CSF_DENSITY * STANDARD_GRAVITY * MESH.volume, rel=1e-12)


def test_force_is_smooth_in_the_level() -> None:
    """Nothing jumps when the level passes a layer of nodes: an estimator can differentiate through it."""
    h = 1e-5
    levels = np.arange(0.03, 0.04, h)
    F = np.array([-total(Gravity(direction=DOWN, density=DENSITY, csf_level=v))[2] for v in levels])
    slope = np.diff(F) / h
    assert np.all(slope <= 0.0)
    # the steepest change of slope is that of tanh over the width of the surface, for the heaviest layer
    layer = CSF_DENSITY * STANDARD_GRAVITY * MESH.volume / 20.0
    assert np.abs(np.diff(slope) / h).max() <= 1.05 * layer * 4.0 / SURFACE_WIDTH**2
    # and the slope on average is that of the fluid's weight
    assert slope.mean() == pytest.approx(-CSF_DENSITY * STANDARD_GRAVITY * MESH.volume / 0.1, rel=0.01)


def test_turned_head_adds_the_submerged_weight() -> None:
    f = total(Gravity(direction=DOWN, density=DENSITY, csf_level=1.0, imaged_direction=(0.0, -1.0, 0.0)))
    weight = (DENSITY - CSF_DENSITY) * STANDARD_GRAVITY * MESH.volume
    np.testing.assert_allclose(f, [0.0, weight, -weight], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"direction": (0.0, 0.0, 0.0)}, r"found \[0.0, 0.0, 0.0\], expected 3 numbers that are not all zero"),
        ({"direction": (math.nan, 0.0, 1.0)}, r"found \[nan"),
        ({"direction": (0.0, 1.0)}, r"found \[0.0, 1.0\]"),
        ({"direction": DOWN, "imaged_direction": (0.0, 0.0, 0.0)}, "not all zero"),
        ({"direction": DOWN, "csf_level": math.inf}, "csf_level = inf: expected a finite height"),
    ],
)
def test_gravity_refuses(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Gravity(density=DENSITY, **options)


# -- a force shared by nodes --------------------------------------------------------------------------------------


def capped() -> TetMesh:
    mesh = cube(3)
    return TetMesh(
        mesh.points,
        mesh.tetrahedra,
        node_sets={"top": mesh.points[:, 2] > 0.99, "nobody": np.zeros(len(mesh.points), dtype=bool)},
    )


def test_nodal_force_is_shared_evenly() -> None:
    mesh = capped()
    f = NodalForce(nodes="top", total=(1.0, -2.0, -10.0)).nodal_forces(mesh)
    top = mesh.node_sets["top"]
    np.testing.assert_allclose(f.sum(axis=0), [1.0, -2.0, -10.0], rtol=1e-14)
    np.testing.assert_allclose(f[top], np.tile([1.0 / 16.0, -2.0 / 16.0, -10.0 / 16.0], (16, 1)), rtol=1e-15)
    assert np.all(f[~top] == 0.0)


def test_nodal_force_refuses() -> None:
    with pytest.raises(InputError, match=r"no node set 'left' \(it has nobody, top\)"):
        NodalForce(nodes="left", total=(0.0, 0.0, 1.0)).nodal_forces(capped())
    with pytest.raises(InputError, match="node set 'nobody' is empty"):
        NodalForce(nodes="nobody", total=(0.0, 0.0, 1.0)).nodal_forces(capped())
    with pytest.raises(InputError, match="expected three finite numbers"):
        NodalForce(nodes="top", total=(0.0, math.nan, 1.0))
    with pytest.raises(InputError, match="expected three finite numbers"):
        NodalForce(nodes="top", total=(0.0, 1.0))  # type: ignore[arg-type]


# -- ramps --------------------------------------------------------------------------------------------------------


def test_ramp() -> None:
    load = NodalForce(nodes="top", total=(0.0, 0.0, 1.0), ramp=[(0.1, 0.0), (0.3, 2.0)])
    assert [load.factor(t) for t in (0.0, 0.1, 0.2, 0.3, 9.0)] == pytest.approx([0.0, 0.0, 1.0, 2.0, 2.0])
    assert NodalForce(nodes="top", total=(0.0, 0.0, 1.0)).factor(0.0) == 1.0


@pytest.mark.parametrize(
    ("ramp", "message"),
    [
        ([(0.1, 0.0), (0.1, 1.0)], "times must increase"),
        ([(0.2, 0.0), (0.1, 1.0)], "times must increase"),
        ([(0.0, math.nan)], "must be finite"),
        ([(math.inf, 1.0)], "must be finite"),
    ],
)
def test_bad_ramp_is_refused(ramp: list, message: str) -> None:
    with pytest.raises(InputError, match=message):
        NodalForce(nodes="top", total=(0.0, 0.0, 1.0), ramp=ramp)
