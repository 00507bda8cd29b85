"""Free surfaces of bodies whose walls are known by heart."""

from typing import Any

import numpy as np
import pytest
from hollow import hollow
from shapes import box

from warpbrain.mesh import TetMesh, face_vectors, faces_of, nodes_of, split_boundary
from warpbrain.mesh.free_surfaces import FreePart, free_faces, free_parts, rim_corners
from warpbrain.mesh.surface import in_rows


def area(mesh: TetMesh, part: FreePart) -> float:
    return float(np.linalg.norm(face_vectors(mesh.points, part.faces), axis=1).sum())


def on_voids(mesh: TetMesh) -> np.ndarray:
    return nodes_of(np.concatenate(split_boundary(mesh.points, mesh.tetrahedra)[1]), len(mesh.points))


def cut_open() -> tuple[TetMesh, np.ndarray]:
    """A cube of 14 cm with a void of 2 cm, without a corner of 4 x 4 x 6 cm; and nodes of the void."""
    _, whole = hollow()
    mesh, nodes, _ = whole.without(whole.element_sets["resection"])
    return mesh, on_voids(whole)[nodes]


def test_outside_void_and_wall_have_the_areas_that_they_have(verify: Any) -> None:
    mesh, inner = cut_open()
    parts = free_parts(mesh, mesh.node_sets["fixed"], inner)
    expected = {"outer": 5 * 0.14**2 - 0.0064, "inner": 6 * 0.02**2, "cut": 0.04 * 0.04 + 2 * 0.04 * 0.06}
    assert [part.origin for part in parts] == list(expected)
    found = np.array([area(mesh, part) for part in parts])
    verify(
        "area of outside, void and wall of a cut of a cube that is held below",
        "lengths of edges, by hand",
        float(np.abs(found / np.array(list(expected.values())) - 1.0).max()),
        1e-12,
    )


@pytest.mark.parametrize("smallest", [0.0, 1.0])
def test_every_free_triangle_is_in_one_part(smallest: float) -> None:
    mesh, inner = cut_open()
    held = mesh.node_sets["fixed"] | (np.random.default_rng(2).random(len(mesh.points)) < 0.7)
    parts = free_parts(mesh, held, inner, smallest)
    rows = np.sort(np.concatenate([part.faces for part in parts]), axis=1)
    assert len(np.unique(rows, axis=0)) == len(rows)
    free = mesh.boundary[~held[mesh.boundary].all(axis=1)]
    assert len(rows) == len(free) and in_rows(free, rows).all()
    assert len(parts) == 3 if smallest else len(parts) >= 3


def test_what_is_held_parts_the_outside() -> None:
    beam = box((9, 2, 2), (0.09, 0.02, 0.02))
    clamped = np.abs(beam.points[:, 0] - 0.045) < 0.006
    parts = free_parts(beam, clamped, np.zeros(len(beam.points), dtype=bool))
    assert sorted(round(1e3 * float(part.centre[0])) > 45 for part in parts) == [False, True]
    assert area(beam, parts[0]) == pytest.approx(area(beam, parts[1]))


def test_a_gap_in_what_is_held_belongs_to_the_rest() -> None:
    block = box((6, 6, 6), (0.06, 0.06, 0.06))
    gap = np.linalg.norm(block.points - [0.03, 0.03, 0.0], axis=1) < 0.005
    held = (block.points[:, 2] == 0.0) & ~gap
    none = np.zeros(len(held), dtype=bool)
    apart, together = (free_parts(block, held, none, smallest) for smallest in (0.0, 0.03))
    assert [len(part.faces) for part in apart] == [5 * 72, 6]
    assert [len(part.faces) for part in together] == [5 * 72 + 6]


def test_a_void_that_a_cut_opens_stays_a_void() -> None:
    _, whole = hollow()
    inner = on_voids(whole)
    # a shaft from the top down to the void
    away = np.abs(whole.centres[:, :2] - 0.07).max(axis=1)
    mesh, nodes, _ = whole.without((away < 0.01) & (whole.centres[:, 2] > 0.08))
    parts = free_parts(mesh, mesh.node_sets["fixed"], inner[nodes])
    assert [part.origin for part in parts] == ["outer", "inner", "cut"]
    assert area(mesh, parts[1]) == pytest.approx(5 * 0.02**2)
    assert area(mesh, parts[2]) == pytest.approx(4 * 0.02 * 0.06)


def test_a_set_stands_for_a_part_but_for_corners_and_what_is_held() -> None:
    mesh, inner = cut_open()
    held = mesh.node_sets["fixed"]
    for part in free_parts(mesh, held, inner):
        members = nodes_of(part.faces, len(mesh.points))
        own = free_faces(mesh, members, held)
        assert in_rows(part.faces, own).all()
        assert in_rows(own, np.concatenate([part.faces, rim_corners(mesh)])).all()
        beside = faces_of(mesh, members)
        assert held[beside[~in_rows(beside, own)]].all()
