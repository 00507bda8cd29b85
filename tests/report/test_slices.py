"""Cuts of bodies whose sections are known in closed form."""

import numpy as np
import pytest
from numpy.typing import NDArray
from shapes import box, disc, distorted, swept, tetrahedron

from warpbrain.mesh import TetMesh, boundary_faces
from warpbrain.report.slices import cut, level_line, outline

Floats = NDArray[np.float64]
OTHERS = {0: (1, 2), 1: (0, 2), 2: (0, 1)}


def area(polygon: Floats) -> float:
    x, y = polygon.T
    return 0.5 * abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))


def section_area(mesh: TetMesh, axis: int, position: float) -> float:
    section = cut(mesh.points, mesh.tetrahedra, np.zeros(len(mesh.points)), axis, position)
    assert len(section.polygons) == len(section.elements) == len(section.values)
    assert {len(polygon) for polygon in section.polygons} <= {3, 4}
    return sum(area(polygon) for polygon in section.polygons)


def edge_lengths(segments: Floats) -> float:
    return float(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum())


def assert_closed(segments: Floats) -> None:
    """Every end is met by another one."""
    _, counts = np.unique(np.round(segments.reshape(-1, 2), 9), axis=0, return_counts=True)
    assert (counts % 2 == 0).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("position", [0.01, 0.37, 0.5, 0.99])
def test_box(axis, position):
    lengths = (1.0, 2.0, 3.0)
    mesh = box((3, 4, 2), lengths)
    i, j = OTHERS[axis]
    place = position * lengths[axis]
    assert section_area(mesh, axis, place) == pytest.approx(lengths[i] * lengths[j], rel=1e-12)
    segments = outline(mesh.points, boundary_faces(mesh.tetrahedra), axis, place)
    assert_closed(segments)
    assert edge_lengths(segments) == pytest.approx(2.0 * (lengths[i] + lengths[j]), rel=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_plane_through_nodes_counts_everything_once(axis):
    mesh = box((4, 4, 4))
    for position in (0.25, 0.5, 0.75, 1.0):
        assert section_area(mesh, axis, position) == pytest.approx(1.0, rel=1e-12)
        assert_closed(outline(mesh.points, boundary_faces(mesh.tetrahedra), axis, position))
    for position in (0.0, -0.1, 1.1):
        assert section_area(mesh, axis, position) == 0.0


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("position", [0.1, 0.5, 0.9])
def test_tetrahedron(axis, position):
    assert section_area(tetrahedron(), axis, position) == pytest.approx(0.5 * (1.0 - position) ** 2, rel=1e-12)


def test_inside_does_not_matter():
    mesh = box((4, 4, 4))
    inner = ((mesh.points > 0.01) & (mesh.points < 0.99)).all(axis=1)
    moved = distorted(mesh, 0.05).points
    points = np.where(inner[:, None], moved, mesh.points)
    irregular = TetMesh(points, mesh.tetrahedra)
    assert section_area(irregular, 2, 0.5) == pytest.approx(1.0, rel=1e-12)


def test_cube_across_its_diagonal_is_a_regular_hexagon():
    mesh = box((3, 3, 3))
    diagonal = np.ones(3) / np.sqrt(3.0)
    first = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    frame = np.array([first, np.cross(diagonal, first), diagonal])
    turned = TetMesh(mesh.points @ frame.T, mesh.tetrahedra)
    middle = 0.5 * np.sqrt(3.0)
    assert section_area(turned, 2, middle) == pytest.approx(0.75 * np.sqrt(3.0), rel=1e-12)
    segments = outline(turned.points, boundary_faces(turned.tetrahedra), 2, middle)
    assert_closed(segments)
    assert edge_lengths(segments) == pytest.approx(3.0 * np.sqrt(2.0), rel=1e-12)


def test_cone_of_many_sides():
    rings = 4
    mesh = swept(disc(rings), 3, lambda xy, s: np.column_stack([xy * (1.0 - 0.5 * s)[:, None], s]))
    sides = 6 * rings
    for s in (0.2, 0.5, 0.8):
        radius = 1.0 - 0.5 * s
        expected = 0.5 * sides * radius**2 * np.sin(2.0 * np.pi / sides)
        # its sides are bent: the triangles of a layer's quadrilaterals are chords of them
        assert section_area(mesh, 2, s) == pytest.approx(expected, rel=0.01)
        assert_closed(outline(mesh.points, boundary_faces(mesh.tetrahedra), 2, s))


def test_values_are_interpolated():
    mesh = distorted(box((3, 3, 3)), 0.03)
    gradient = np.array([2.0, -3.0, 5.0])
    section = cut(mesh.points, mesh.tetrahedra, mesh.points @ gradient + 7.0, 1, 0.4)
    centres = np.array([polygon.mean(axis=0) for polygon in section.polygons])
    np.testing.assert_allclose(section.values, centres @ gradient[[0, 2]] + 0.4 * gradient[1] + 7.0, rtol=1e-12)


def test_polygons_know_their_elements():
    mesh = box((2, 2, 2))
    section = cut(mesh.points, mesh.tetrahedra, np.zeros(27), 0, 0.3)
    for element, polygon in zip(section.elements, section.polygons, strict=True):
        corners = mesh.points[mesh.tetrahedra[element]]
        assert corners[:, 0].min() < 0.3 <= corners[:, 0].max()
        assert (polygon >= corners[:, 1:].min(axis=0) - 1e-12).all()
        assert (polygon <= corners[:, 1:].max(axis=0) + 1e-12).all()


@pytest.mark.parametrize("position", [0.25, 0.31])
def test_polygons_turn_the_same_way(position):
    """A view adds up the normals of those that share a point; with nodes on the plane, corners are in one place."""
    section = cut(*flat(distorted(box((4, 4, 4)), 0.03), position), np.zeros(125), 2, position)
    a, b, c = section.points[section.triangles].transpose(1, 2, 0)
    twice = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]
    assert (twice >= -1e-15).all()
    assert 0.5 * twice.sum() == pytest.approx(sum(area(polygon) for polygon in section.polygons), rel=1e-12)


def flat(mesh: TetMesh, height: float) -> tuple[Floats, NDArray[np.integer]]:
    """Points of a body with those that were within 0.1 of a height moved to it, and its tetrahedra."""
    points = mesh.points.copy()
    points[np.abs(points[:, 2] - height) < 0.1, 2] = height
    return points, mesh.tetrahedra


def test_nothing_to_cut():
    mesh = box((1, 1, 1))
    section = cut(mesh.points, mesh.tetrahedra, np.zeros(8), 0, 5.0)
    assert section.polygons == []
    assert len(section.elements) == len(section.values) == 0
    assert outline(mesh.points, boundary_faces(mesh.tetrahedra), 0, 5.0).shape == (0, 2, 2)


def test_level_line_is_the_circle_of_a_distance():
    mesh = box((12, 12, 12))
    away = np.linalg.norm(mesh.points - 0.5, axis=1)
    section = cut(mesh.points, mesh.tetrahedra, away, 2, 0.53)
    segments = level_line(section, 0.3)
    # the sphere of radius 0.3 is cut 0.03 off its middle; interpolation in elements of 1/12 rounds it off
    radii = np.linalg.norm(segments.reshape(-1, 2) - 0.5, axis=1)
    np.testing.assert_allclose(radii, np.sqrt(0.3**2 - 0.03**2), atol=0.01)
    assert edge_lengths(segments) == pytest.approx(2.0 * np.pi * 0.2985, rel=0.02)
    assert_closed(segments)
    assert level_line(section, 2.0).shape == (0, 2, 2)
