"""Every connected free surface of a case is a place with a name that a `case.toml` can use."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hollow import hollow
from voids import case_of, voids

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case
from warpbrain.cases.shipped import find_case
from warpbrain.cases.writing import write_case
from warpbrain.mesh.surface import in_rows
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.worlds.body.surfaces import (
    connected_parts,
    free_surfaces,
    held_nodes,
    unused_edges,
    with_free_surfaces,
    with_sets_that_act,
)


@pytest.fixture
def resected() -> Case:
    """A cube with a void, held below, without a corner; no node set names a wall."""
    _, mesh = hollow()
    return replace(case_of(mesh), mechanisms=(Resection(),))


def words(case: Case) -> list[str]:
    return [surface.words for surface in free_surfaces(case)]


def test_surfaces_without_a_set_get_one(resected: Case) -> None:
    found = {surface.name: surface.words for surface in free_surfaces(resected)}
    # the wall by the element set that was taken out, as a case may name it already
    assert found == {
        "resection": "wall of the cavity",
        "outer-surface": "outer surface",
        "wall-of-the-void": "wall of the void",
    }


def test_an_edge_that_nothing_uses_is_one_and_a_surface_is_none() -> None:
    beam = find_case("beam-52g")
    [weight] = [one for one in beam.boundaries if one.kind == "force"]
    without = replace(beam, boundaries=tuple(one for one in beam.boundaries if one is not weight))
    assert unused_edges(beam) == ()
    assert unused_edges(without) == (weight.nodes,)
    held = Fixed(name="held", nodes=weight.nodes)
    sets = {
        **without.mesh.node_sets,
        "end": without.mesh.points[:, 0] > 0.1 - 1e-9,
        "none": without.mesh.points[:, 0] < -1.0,
    }
    more = replace(without, mesh=without.mesh.with_node_sets(sets))
    assert unused_edges(more) == (weight.nodes,)
    assert unused_edges(replace(more, boundaries=(*more.boundaries, held))) == ()


def test_connected_parts_are_all_of_the_free_surface(resected: Case) -> None:
    mesh, _ = resected.remaining
    faces = np.concatenate([part.faces for part in connected_parts(resected)])
    free = mesh.boundary[~held_nodes(resected)[mesh.boundary].all(axis=1)]
    assert len(faces) == len(free) and in_rows(free, faces).all()


@pytest.mark.parametrize(
    ("axis", "expected"),
    [
        (0, ["left ventricle", "right ventricle"]),
        (1, ["back ventricle", "front ventricle"]),
        (2, ["lower ventricle", "upper ventricle"]),
    ],
)
def test_voids_are_told_apart_by_where_they_are(axis: int, expected: list[str]) -> None:
    assert words(case_of(voids(axis), "grey matter")) == ["outer surface", *expected]


def test_three_and_four_in_a_row() -> None:
    assert words(case_of(voids(0, 3)))[1:] == [f"{where} wall of the void" for where in ("left", "middle", "right")]
    found = [one.replace("wall of the void", "void") for one in words(case_of(voids(0, 4)))[1:]]
    assert found == ["left void", "middle void 1", "middle void 2", "right void"]


def test_a_void_is_called_after_the_set_that_it_is_a_part_of() -> None:
    case = case_of(voids(0, sets=("third_chamber",)))
    assert words(case) == ["third chamber", "outer surface", "left third chamber", "right third chamber"]


def test_a_set_that_touches_what_is_held_is_free_where_it_can_move() -> None:
    mesh = voids(0)
    left = mesh.points[:, 0] == 0.0
    case = case_of(mesh.with_node_sets({**mesh.node_sets, "side": left, "table": mesh.node_sets["fixed"]}))
    [side] = [surface for surface in free_surfaces(case) if surface.name == "side"]
    assert 0 < len(side.faces) == 2 * 3 * 3 - 2
    assert not any(surface.name == "table" for surface in free_surfaces(case))


def test_the_same_triangles_are_one_place_and_sets_that_are_used_are_none() -> None:
    mesh = voids(0)
    inside = np.zeros(len(mesh.points), dtype=bool)
    inside[connected_parts(case_of(mesh))[1].faces] = True
    once = case_of(mesh.with_node_sets({**mesh.node_sets, "hole": inside, "again": inside}))
    assert len(free_surfaces(once)) == len(free_surfaces(case_of(mesh)))
    assert {surface.name for surface in free_surfaces(once)} >= {"hole"}
    used = replace(once, boundaries=(*once.boundaries, Fixed(name="hole", nodes="hole")))
    assert len(free_surfaces(used)) == len(free_surfaces(once)) - 1


def test_declared_surfaces_are_found_again(resected: Case) -> None:
    declared = with_free_surfaces(resected)
    first, again = free_surfaces(resected), free_surfaces(declared)
    assert {(one.name, one.words) for one in first} == {(one.name, one.words) for one in again}
    assert with_sets_that_act(declared, resected.mesh).mesh.node_sets.keys() == resected.mesh.node_sets.keys()


def test_what_acts_on_a_surface_is_written_and_read_as_the_same(resected: Case, tmp_path: Path) -> None:
    declared = with_free_surfaces(resected)
    for surface in free_surfaces(resected):
        acting = replace(declared, mechanisms=(*declared.mechanisms, Pressure(nodes=surface.name, value=100.0)))
        written = with_sets_that_act(acting, resected.mesh)
        assert set(written.mesh.node_sets) == {"fixed", surface.name}
        back = read_case(write_case(tmp_path / surface.name, written))
        pressure = back.mechanisms[-1]
        assert isinstance(pressure, Pressure)
        carrying = pressure.faces(back.remaining[0])
        assert len(carrying) == len(acting.mechanisms[-1].faces(acting.remaining[0])) >= len(surface.faces)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", ["0529", "0685", "phantom"])
def test_of_a_shipped_case(name: str) -> None:
    case = find_case(name)
    expected = {"ventricle": "ventricle", "surface": "surface"}
    if name != "phantom":
        # of the phantom a force acts there; the others have lost tissue
        expected |= {"superior": "superior", "resection": "wall of the cavity"}
    assert {surface.name: surface.words for surface in free_surfaces(case)} == expected
