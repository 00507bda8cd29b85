"""Loads: their totals, their directions, and what they refuse."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from shapes import box, cube, distorted

from warpbrain.errors import InputError
from warpbrain.mesh import QuadraticMesh, TetMesh
from warpbrain.mesh.refinement import finer_mesh
from warpbrain.physics.load import Along, Load, NodalForce
from warpbrain.physics.mechanisms.gravity import CSF_DENSITY, STANDARD_GRAVITY, Gravity

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


@pytest.mark.parametrize("level", [0.0, 0.0123, 0.04, 0.0425, 0.05, 0.0999])
def test_weight_above_the_level(level: float, verify) -> None:
    """What hangs above the fluid weighs what the fluid no longer carries: in a column, on a plane of nodes or not."""
    force = total(Gravity(direction=DOWN, density=DENSITY, csf_level=level))
    expected = CSF_DENSITY * STANDARD_GRAVITY * MESH.volume * (1.0 - level / 0.1)
    error = np.abs(force - [0.0, 0.0, -expected]).max() / (CSF_DENSITY * STANDARD_GRAVITY * MESH.volume)
    verify("weight of a column above the level of the fluid", "closed form", error, 1e-12)


@pytest.mark.parametrize("kind", [lambda mesh: mesh, QuadraticMesh], ids=["tet4", "tet10"])
def test_weight_above_a_level_acts_at_its_centre(kind, verify) -> None:
    """Moments of what is above a tilted level of an irregular mesh, whatever the elements."""
    mesh = distorted(MESH, 0.002)
    load = Gravity(direction=(0.3, -0.2, -1.0), density=DENSITY, csf_level=0.047)
    coarse = load.nodal_forces(kind(mesh))
    fine = finer_mesh(mesh)[0]
    expected = load.nodal_forces(fine)
    points = kind(mesh).points
    scale = np.abs(np.cross(fine.points, expected)).sum()
    error = np.abs(np.cross(points, coarse).sum(axis=0) - np.cross(fine.points, expected).sum(axis=0)).max() / scale
    verify("moment of the weight above a tilted level", "the same body in eight times as many elements", error, 1e-14)


def test_datum_is_the_lowest_point_against_gravity() -> None:
    moved = TetMesh(MESH.points + np.array([1.0, 2.0, 3.0]), MESH.tetrahedra)
    load = Gravity(direction=(0.0, 0.0, 2.0), density=DENSITY, csf_level=0.03)
    assert load.datum(moved) == pytest.approx(-3.1)
    np.testing.assert_allclose(load.nodal_forces(moved), load.nodal_forces(MESH), atol=1e-12)


@pytest.mark.parametrize("mesh", [MESH, distorted(MESH, 0.002)], ids=["flat below", "with one lowest point"])
def test_a_tilt_is_linear_in_its_two_components(mesh: TetMesh) -> None:
    """Or what is concluded depends on which two axes across gravity it is counted along: 40662 of `same-diagnose`."""
    situation: Any = SimpleNamespace(mesh=mesh, gravity_axis=DOWN, density=DENSITY, stiffness=1.0, assumed=())
    proposal = Gravity.proposals(situation)[8]

    def change(angle: float, step: float = 1e-6) -> np.ndarray:
        tilt = step * np.array([0.0, math.cos(angle), math.sin(angle)])
        ends = [proposal.make(proposal.mean + sign * tilt) for sign in (1.0, -1.0)]
        assert all(isinstance(end, Gravity) and end.csf_level is not None for end in ends)
        return np.asarray((ends[0].nodal_forces(mesh) - ends[1].nodal_forces(mesh)) / (2.0 * step))

    along = [change(0.0), change(0.5 * math.pi)]
    expected = math.cos(0.6) * along[0] + math.sin(0.6) * along[1]
    assert np.abs(change(0.6) - expected).max() < 1e-6 * np.abs(expected).max()


def test_drowned_and_dry() -> None:
    drowned = Gravity(direction=DOWN, density=DENSITY, csf_level=0.2)
    assert np.abs(drowned.nodal_forces(MESH)).max() < 1e-12
    dry = Gravity(direction=DOWN, density=DENSITY, csf_level=-0.1)
    assert -total(dry)[2] == pytest.approx(CSF_DENSITY * STANDARD_GRAVITY * MESH.volume, rel=1e-12)


def along(load: Gravity, **rates: np.ndarray | float) -> Along:
    """Differentiates along the path on which the fields of a load change at these rates."""

    def differentiated(look):
        h = 1e-3
        ends = [
            look(
                replace(load, **{key: getattr(load, key) + step * h * np.asarray(rate) for key, rate in rates.items()})
            )
            for step in (-2, -1, 1, 2)
        ]
        return np.asarray((ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / (12.0 * h))

    return differentiated


RATES = {
    "level": {"csf_level": 1.0},
    "direction": {"direction": np.array([0.2, 0.3, 0.1])},
    "imaged_direction": {"imaged_direction": np.array([0.2, -0.3, 0.1])},
    "all": {"csf_level": -0.3, "direction": np.array([0.1, 0.0, 0.4]), "imaged_direction": np.array([0.2, -0.3, 0.1])},
}


@pytest.mark.parametrize("name", RATES)
@pytest.mark.parametrize("lowest", [None, -0.01])
@pytest.mark.parametrize("kind", [lambda mesh: mesh, QuadraticMesh], ids=["tet4", "tet10"])
def test_derivatives_of_the_weight(name: str, lowest: float | None, kind, verify) -> None:
    """The load is a spline in the level, so differences of small steps are as good as their rounding."""
    mesh = kind(distorted(box((3, 3, 3), (0.08, 0.06, 0.1)), 0.002))
    load = Gravity(
        direction=(0.3, -0.2, -1.0), imaged_direction=(0.1, 0.1, -1.0), density=DENSITY, csf_level=0.0471, lowest=lowest
    )
    rate = load.unit_forces_rate(mesh, along(load, **RATES[name]))
    h = 1e-6
    ends = [
        replace(
            load, **{key: getattr(load, key) + step * h * np.asarray(value) for key, value in RATES[name].items()}
        ).unit_forces(mesh)
        for step in (-1.0, 1.0)
    ]
    difference = (ends[1] - ends[0]) / (2.0 * h)
    error = np.linalg.norm(rate - difference) / np.linalg.norm(difference)
    verify(f"derivative of the weight by {name}", "central difference of the load, step 1e-6", error, 1e-7)


def test_derivative_by_a_level_on_a_plane_of_nodes(verify) -> None:
    """On a lattice the section has no jump, though each element's has."""
    load = Gravity(direction=DOWN, density=DENSITY, csf_level=0.05)
    rate = load.unit_forces_rate(MESH, along(load, csf_level=1.0)).sum(axis=(0, 1))
    expected = CSF_DENSITY * STANDARD_GRAVITY * 0.08 * 0.06
    verify(
        "derivative by a level on a plane of nodes",
        "closed form",
        np.abs(rate - [0, 0, expected]).max() / expected,
        1e-12,
    )


def test_turned_head_adds_the_submerged_weight() -> None:
    f = total(
        Gravity(direction=DOWN, density=1.0, tissue_density=DENSITY, csf_level=1.0, imaged_direction=(0.0, -1.0, 0.0))
    )
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
