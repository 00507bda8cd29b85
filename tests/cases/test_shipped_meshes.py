"""Every promise made about the meshes that ship with the package, checked on the files themselves."""

import csv
import json
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from warpbrain.cases.building.node_sets import RADIUS, with_example_sets
from warpbrain.mesh import (
    Quality,
    TetMesh,
    boundary_faces,
    closed_surfaces,
    components,
    face_vectors,
    interface_faces,
    measure,
    node_areas,
    nodes_of,
    pinched_nodes,
    read_mesh,
    split_boundary,
)

DATA = files("warpbrain") / "cases" / "data"
# Tables 4 and 5 of the paper: volume [m3], side of the temporal lobe, nodes of the mesh of one tissue and of two
PUBLISHED = {
    "0529": (1.1654e-3, "left", 3619, 5060),
    "0614": (1.0617e-3, "left", 2692, 4112),
    "0660": (1.1344e-3, "left", 2795, 4308),
    "0685": (1.0899e-3, "left", 2425, 4093),
    "0535": (1.2388e-3, "right", 2662, 4225),
    "0555": (1.1706e-3, "right", 2221, 3932),
    "0603": (1.0601e-3, "right", 2742, 4348),
    "0684": (1.1865e-3, "right", 2250, 3930),
}


def within(nodes: int) -> tuple[int, int]:
    """Two per cent to either side."""
    return int(np.ceil(0.98 * nodes)), int(1.02 * nodes)


# file: (volume m3, least nodes, most nodes, two tissues)
MESHES = {
    "phantom/single-coarse": (1.6092e-3, 2677, 2757, False),
    "phantom/multi-coarse": (1.6092e-3, 4169, 4294, True),
    "phantom/single-loaded": (1.6092e-3, 2677, 2757, False),
    "phantom/multi-loaded": (1.6092e-3, 4169, 4294, True),
    "phantom/single-fine": (1.6092e-3, 3500, 5000, False),
    "phantom/multi-fine": (1.6092e-3, 8000, 11000, True),
    **{f"{case}/single": (volume, *within(single), False) for case, (volume, _, single, _) in PUBLISHED.items()},
    **{f"{case}/multi": (volume, *within(multi), True) for case, (volume, _, _, multi) in PUBLISHED.items()},
}
CLINICAL = [name for name in MESHES if name.startswith("0")]


def each(names: Iterable[str]) -> list[Any]:
    """Meshes as parameters. Those of stand-ins change together, when they are built anew: one stands for all but in
    slow tests."""
    other = [name for name in CLINICAL if not name.startswith("0529")]
    return [pytest.param(name, marks=[pytest.mark.slow(1)] if name in other else []) for name in names]


@pytest.fixture(scope="module")
def meshes() -> dict[str, TetMesh]:
    return {name: read_mesh(str(DATA / f"{name}.vtu"), unit="mm") for name in MESHES}


@pytest.fixture(scope="module", params=each(MESHES))
def name(request) -> str:
    """All tests of a mesh run before those of the next: what is computed of it, is computed once."""
    return request.param


@pytest.fixture(scope="module")
def mesh(meshes, name) -> TetMesh:
    return meshes[name]


@pytest.fixture(scope="module")
def quality(mesh) -> Quality:
    return measure(mesh)


@pytest.fixture(scope="module")
def outer(mesh) -> NDArray[np.int64]:
    return split_boundary(mesh.points, mesh.tetrahedra)[0]


def test_volume_and_size(mesh, name):
    volume, least, most, _ = MESHES[name]
    assert mesh.volume == pytest.approx(volume, rel=1e-6)
    assert least <= len(mesh.points) <= most


@pytest.mark.parametrize(("kind", "ratio"), [("single", 28.31 / 18.32), ("multi", 136.8 / 55.43)])
def test_fine_meshes_are_finer_by_the_published_ratio(meshes, kind, ratio):
    fine, coarse = (len(meshes[f"phantom/{kind}-{size}"].tetrahedra) for size in ("fine", "coarse"))
    assert ratio <= fine / coarse <= 1.03 * ratio


def test_quality(quality):
    assert quality.inverted == 0
    assert quality.components == 1
    assert quality.min_dihedral >= 15
    assert quality.first_percentile_dihedral >= 20


def test_tissues_have_no_speckles(quality, name):
    assert set(quality.tissue_components) == ({1, 2} if MESHES[name][3] else {1})
    # a piece of one tissue is at least a cubic centimetre and more than twenty tetrahedra
    assert quality.smallest_tissue_component_volume >= 1e-6
    assert quality.smallest_tissue_component_tetrahedra > 20


def test_white_matter_share_is_that_of_a_brain(mesh, name):
    if MESHES[name][3]:
        share = mesh.volumes[mesh.tissue == 2].sum() / mesh.volume
        assert 0.25 < share < 0.45


def test_interface_conforms(mesh, name):
    faces = interface_faces(mesh.tetrahedra, mesh.tissue)
    if not MESHES[name][3]:
        assert len(faces) == 0
        return
    # where the mesh conforms, grey matter alone has as its surface its share of the boundary and the interface
    grey = boundary_faces(mesh.tetrahedra[mesh.tissue == 1])
    whole = {tuple(face) for face in np.sort(boundary_faces(mesh.tetrahedra), axis=1)}
    inner = [face for face in np.sort(grey, axis=1) if tuple(face) not in whole]
    assert {tuple(face) for face in inner} == {tuple(face) for face in np.sort(faces, axis=1)}
    assert len(inner) == len(faces)


def test_surfaces_are_closed_and_touch_nowhere(mesh):
    faces = boundary_faces(mesh.tetrahedra)
    assert len(pinched_nodes(faces)) == 0
    # one sphere outside, one inside: no tunnels
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    surfaces = closed_surfaces(faces)
    assert surfaces.max() + 1 == 2
    assert len(np.unique(faces)) - len(edges) + len(faces) == 4


def test_ventricles_are_open(mesh):
    outer, cavities = split_boundary(mesh.points, mesh.tetrahedra)
    assert closed_surfaces(outer).max() == 0
    assert len(cavities) == 1
    wall = nodes_of(cavities[0], len(mesh.points))
    np.testing.assert_array_equal(mesh.node_sets["ventricle"], wall)
    corner = mesh.points[cavities[0]]
    enclosed = -np.einsum("ij,ij->i", np.cross(corner[:, 0], corner[:, 1]), corner[:, 2]).sum() / 6
    # lateral ventricles of an adult: about 10 to 30 cm3, on both sides, inside
    assert 8e-6 < enclosed < 30e-6
    x = mesh.points[wall, 0]
    assert x.min() < -0.015 and x.max() > 0.015


def test_surfaces_have_no_staircase(mesh, outer):
    """Neighbouring faces of the outer surface meet at small angles; voxel faces would pile up at 0 and 90 degrees."""
    normal = face_vectors(mesh.points, outer)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    edges = np.sort(outer[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    left, right = (order // 3)[::2], (order // 3)[1::2]
    bend = np.degrees(np.arccos(np.clip((normal[left] * normal[right]).sum(axis=1), -1, 1)))
    assert np.median(bend) < 20
    # the longitudinal fissure has sharp turns by nature: it is a groove one or two elements wide
    beside = np.abs(mesh.points[edges[order[::2]]].mean(axis=1)[:, 0]) > 0.012
    assert (bend[beside] > 75).mean() < 0.02


def test_set_surface(mesh, outer):
    np.testing.assert_array_equal(mesh.node_sets["surface"], nodes_of(outer, len(mesh.points)))


def test_superior_cap(mesh):
    cap, surface = mesh.node_sets["superior"], mesh.node_sets["surface"]
    assert cap.sum() >= 20
    assert not (cap & ~surface).any()
    assert mesh.points[cap, 2].min() > mesh.points[:, 2].max() - 0.016
    # both hemispheres
    assert (mesh.points[cap, 0] < -0.01).any() and (mesh.points[cap, 0] > 0.01).any()


def test_skull_base_holds_the_brain(mesh, outer):
    fixed, surface = mesh.node_sets["fixed"], mesh.node_sets["surface"]
    assert not (fixed & mesh.node_sets["superior"]).any()
    assert not (fixed & ~surface).any()
    area = node_areas(mesh.points, outer)
    assert 0.08 < area[fixed].sum() / area.sum() < 0.35
    held = mesh.points[fixed]
    whole = np.ptp(mesh.points, axis=0)
    # spread over the base: front to back and side to side, and all of it low
    assert (np.ptp(held, axis=0)[:2] > 0.7 * whole[:2]).all()
    assert held[:, 2].max() < mesh.points[:, 2].min() + 0.55 * whole[2]
    # every fossa: frontal, temporal on either side, posterior
    low, size = mesh.points.min(axis=0), whole
    relative = (held - low) / size
    assert (relative[:, 1] > 0.8).sum() >= 5
    assert (relative[:, 1] < 0.35).sum() >= 10
    for side in (relative[:, 0] < 0.3, relative[:, 0] > 0.7):
        assert (side & (np.abs(relative[:, 1] - 0.6) < 0.15)).sum() >= 3


@pytest.mark.parametrize("clinical", each(CLINICAL))
def test_resection(meshes, clinical):
    mesh = meshes[clinical]
    resected, margin = mesh.element_sets["resection"], mesh.node_sets["resection"]
    volume = mesh.volumes[resected].sum()
    # one outline in template millimetres: it shrinks and grows with the brain
    assert 11e-6 < volume < 30e-6
    # on the published side, anterior, temporal: in front of the middle, in the lower half
    middle = mesh.points[mesh.tetrahedra[resected]].mean(axis=(0, 1))
    outwards = -1 if PUBLISHED[clinical.split("/")[0]][1] == "left" else 1
    assert outwards * middle[0] > 0.02
    relative = (middle - mesh.points.min(axis=0)) / np.ptp(mesh.points, axis=0)
    assert 0.55 < relative[1] < 0.85 and relative[2] < 0.5
    wall = interface_faces(mesh.tetrahedra, resected)
    np.testing.assert_array_equal(margin, nodes_of(wall, len(mesh.points)))
    assert 20 <= margin.sum() <= 50
    assert 10e-4 < np.linalg.norm(face_vectors(mesh.points, wall), axis=1).sum() < 20e-4
    # one smooth sheet, one piece taken
    assert closed_surfaces(wall).max() == 0
    assert components(mesh.tetrahedra[resected]).max() == 0


def test_every_stand_in_is_an_individual(meshes):
    """No two have one shape: extents of brain and ventricles, at one volume, differ by more than meshing does."""
    shapes = []
    for case, (volume, *_) in PUBLISHED.items():
        mesh = meshes[f"{case}/multi"]
        ventricles = mesh.points[mesh.node_sets["ventricle"]]
        shapes.append(np.concatenate([np.ptp(mesh.points, axis=0), np.ptp(ventricles, axis=0)]) / volume ** (1 / 3))
    apart = [np.abs(a / b - 1).max() for i, a in enumerate(shapes) for b in shapes[:i]]
    assert min(apart) > 0.01


@pytest.mark.parametrize("clinical", each(CLINICAL))
def test_what_a_resection_leaves(meshes, clinical):
    mesh = meshes[clinical]
    left, node_ids, _ = mesh.without(mesh.element_sets["resection"])
    quality = measure(left)
    assert quality.components == 1
    assert quality.smallest_tissue_component_volume >= 1e-6
    # every held node and every margin node is still there
    for key in ("fixed", "resection", "superior", "ventricle"):
        assert left.node_sets[key].sum() == mesh.node_sets[key].sum()
    np.testing.assert_array_equal(left.points, mesh.points[node_ids])
    # the cavity is part of the outer surface, the ventricles are still closed
    outer, cavities = split_boundary(left.points, left.tetrahedra)
    assert len(cavities) == 1
    assert nodes_of(outer, len(left.points))[left.node_sets["resection"]].all()


def test_record_tells_the_truth(mesh, quality, name):
    case, file = name.split("/")
    record = json.loads((DATA / case / "meshes.json").read_text())["meshes"][file]
    assert record["nodes"] == quality.nodes
    assert record["tetrahedra"] == quality.tetrahedra
    assert record["min_dihedral"] == pytest.approx(quality.min_dihedral, rel=1e-4)
    assert record["node_sets"] == {key: members.sum() for key, members in mesh.node_sets.items()}


def test_the_page_says_what_the_record_says(name):
    case, file = name.split("/")
    entry = json.loads((DATA / case / "meshes.json").read_text(encoding="utf-8"))["meshes"][file]
    with (Path(__file__).parents[2] / "docs" / "anatomy.csv").open(encoding="utf-8", newline="") as table:
        [cells] = [row for row in csv.reader(table) if row[0] == name]
    sets = entry["node_sets"]
    gone = entry["element_set_volume"].get("resection")
    white = entry["tissue_volume"].get("2")
    assert cells == [
        name,
        str(entry["nodes"]),
        str(entry["tetrahedra"]),
        f"{1e6 * entry['volume']:.1f}",
        f"{entry['min_dihedral']:.1f}°",
        f"{entry['first_percentile_dihedral']:.1f}°",
        f"{100 * white / entry['volume']:.0f} %" if white else "-",
        " / ".join(str(sets.get(key, "-")) for key in ("ventricle", "superior", "fixed", "resection")),
        f"{1e6 * gone:.1f}" if gone else "-",
    ]


def test_files_are_small_and_the_notice_is_there():
    size = sum(len((DATA / f"{name}.vtu").read_bytes()) for name in MESHES)
    assert size < 7e6
    notice = (DATA / "MNI-NOTICE.txt").read_text(encoding="utf-8")
    assert "McConnell Brain Imaging Centre" in notice and "Permission to use, copy, modify, and distribute" in notice


@pytest.mark.parametrize("kind", ["single", "multi"])
def test_the_loaded_phantom_is_the_coarse_one_with_sets_for_examples(meshes, kind):
    loaded, wanted = meshes[f"phantom/{kind}-loaded"], with_example_sets(meshes[f"phantom/{kind}-coarse"])
    np.testing.assert_array_equal(loaded.points, wanted.points)
    np.testing.assert_array_equal(loaded.tetrahedra, wanted.tetrahedra)
    np.testing.assert_array_equal(loaded.tissue, wanted.tissue)
    for sets, others in ((loaded.node_sets, wanted.node_sets), (loaded.element_sets, wanted.element_sets)):
        assert set(sets) == set(others)
        for name, members in sets.items():
            np.testing.assert_array_equal(members, others[name])
    ball = loaded.volumes[loaded.element_sets["ball"]].sum()
    # discretisation: it is made of whole elements, 0.5 % and 8.0 % off
    assert ball == pytest.approx(4.0 / 3.0 * np.pi * RADIUS**3, rel=0.1)
