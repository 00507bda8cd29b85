"""Pressure, contact, traction and drainage are looked for on every surface that can move, each by its name."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hollow import hollow
from shapes import box
from voids import case_of, voids

from warpbrain.cases.boundary import Pressed
from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case
from warpbrain.cases.writing import write_case
from warpbrain.frame import Frame
from warpbrain.mesh.patches import patch_around
from warpbrain.mesh.surface import in_rows
from warpbrain.physics.mechanisms.contact import Contact
from warpbrain.physics.mechanisms.drainage import Drainage
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.worlds.body.dictionary import dictionary_of
from warpbrain.worlds.body.surfaces import free_surfaces


def resected() -> Case:
    """A cube with a void, held below, without a corner."""
    _, mesh = hollow()
    return replace(case_of(mesh), mechanisms=(Resection(),))


def chambers() -> Case:
    """A brain with two ventricles, left and right."""
    return case_of(voids(0), "grey matter")


def clamped() -> Case:
    """A beam that is held in its middle, so that it has two outer surfaces."""
    beam = box((9, 2, 2), (0.09, 0.02, 0.02))
    return case_of(beam.with_node_sets({"fixed": np.abs(beam.points[:, 0] - 0.045) < 0.006}))


CASES = {
    "resected": (resected, {"outer surface", "wall of the void", "wall of the cavity"}),
    "chambers": (chambers, {"outer surface", "left ventricle", "right ventricle"}),
    "clamped": (clamped, {"left outer surface", "right outer surface"}),
}


@pytest.mark.slow(1)
@pytest.mark.parametrize("name", CASES)
def test_each_of_four_mechanisms_acts_on_each_surface(name: str) -> None:
    make, words = CASES[name]
    case = make()
    found = dictionary_of(case, ("pressure", "contact", "traction", "drainage"), 3)
    mesh, by_words = found.situation.mesh, {one.words: one for one in free_surfaces(case)}
    assert set(by_words) == words
    for surface in by_words.values():
        for proposal in (p for p in found.proposals["pressure"] if p.region == surface.words):
            pressing = proposal.make(proposal.sd)
            assert isinstance(pressing, Pressure)
            assert in_rows(surface.faces, pressing.faces(mesh)).all()
        kept = [p.make(p.mean) for p in found.proposals["contact"] if p.region == surface.words]
        assert {one.state for one in kept if isinstance(one, Contact)} == {"sliding", "lifting"}
        assert all(set(np.unique(surface.faces)) <= set(one.held(mesh)[0].tolist()) for one in kept)
        drained = [p.make(p.mean) for p in found.proposals["drainage"] if p.region.endswith(f"the {surface.words}")]
        assert drained
        for one in drained:
            assert isinstance(one, Drainage)
            assert one.open_nodes(mesh)[surface.faces].all()
        pulled = [p for p in found.proposals["traction"] if p.region == surface.words]
        assert pulled
        for proposal in pulled:
            assert proposal.centre is not None and proposal.radius is not None
            own = mesh.boundary[patch_around(mesh.points, mesh.boundary, proposal.centre, 1e-6)]
            assert in_rows(own, surface.faces).all()
            assert proposal.make(proposal.sd).nodal_forces(mesh).any()  # type: ignore[attr-defined]
    assert {p.region for p in found.proposals["pressure"]} == words
    # nothing is without a name
    assert {p.region for p in found.proposals["traction"]} == words


def test_what_a_declared_load_acts_on_keeps_its_name_for_a_traction() -> None:
    case = replace(resected(), boundaries=(*resected().boundaries, Pressed(name="gel", nodes="resection", value=50.0)))
    wall = free_surfaces(resected())[0]
    sets = {**case.mesh.node_sets, "resection": np.zeros(len(case.mesh.points), dtype=bool)}
    sets["resection"][case.remaining[1]] = wall.members
    case = replace(case, mesh=case.mesh.with_node_sets(sets))
    found = dictionary_of(case, ("pressure", "traction"))
    assert "wall of the cavity" not in {p.region for p in found.proposals["pressure"]}
    assert "wall of the cavity" in {p.region for p in found.proposals["traction"]}


@pytest.mark.parametrize("axes", ["RAS", "LPS"])
def test_left_is_left_in_any_axes(axes: str, tmp_path: Path) -> None:
    case = replace(chambers(), frame=Frame("mm", axes))
    back = read_case(write_case(tmp_path / "case", case))
    centres = {one.words: back.mesh.points[one.faces].mean(axis=(0, 1))[0] for one in free_surfaces(back)}
    # right is the end of x in RAS
    assert centres["left ventricle"] < centres["outer surface"] < centres["right ventricle"]


def test_a_traction_that_moves_to_another_surface_has_that_name() -> None:
    found = dictionary_of(chambers(), ("traction",))
    [first, *_] = (p for p in found.proposals["traction"] if p.region == "outer surface")
    left = next(p for p in found.proposals["traction"] if p.region == "left ventricle")
    assert first.elsewhere is not None and left.centre is not None
    assert first.elsewhere(left.centre, 0.01).region == "left ventricle"
