"""New case folders: whole, ready to run, and never in the place of anything else."""

import tomllib

import meshio
import numpy as np
import pytest
from segmentations import CENTRE, NAMES, ellipsoids, grid_affine, volume_of, write_ellipsoids, write_labels
from shapes import box

from warpbrain.cases.checking import NOTHING_ACTS, check_case
from warpbrain.cases.parts.tissues import OTHER_MU
from warpbrain.cases.reading import read_case
from warpbrain.cases.starting import MU, case_text, start_from_labels, start_from_mesh
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.mesh import TetMesh, write_mesh
from warpbrain.report.page import lines
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

PUSH = """
[[boundary]]
name = "push"
nodes = "ventricle"
kind = "force"
total = [0, 0.01, 0]
"""


def hollow_block() -> TetMesh:
    """A block of 60 x 60 x 60 mm with tissues 1 and 7 and a cavity in its middle."""
    mesh = box((6, 6, 6), (0.06, 0.06, 0.06))
    centre = mesh.points[mesh.tetrahedra].mean(axis=1)
    solid = (abs(centre - 0.03) > 0.01).any(axis=1)
    used, tetrahedra = np.unique(mesh.tetrahedra[solid], return_inverse=True)
    tissue = np.where(centre[solid, 0] < 0.03, 1, 7)
    points = mesh.points[used]
    return TetMesh(
        points, tetrahedra.reshape(-1, 4), tissue, {"top": points[:, 2] == 0.06}, {"left": centre[solid, 0] < 0.01}
    )


def write_block(path, unit="mm", axes="RAS", mesh=None):
    mesh = mesh or hollow_block()
    points = mesh.points * Frame(unit, axes).signs
    write_mesh(path, TetMesh(points, mesh.tetrahedra, mesh.tissue, mesh.node_sets, mesh.element_sets), unit)
    return path


# two processes would each make what these tests share
pytestmark = pytest.mark.xdist_group("starting")


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    for package in ("mmgpy", "nibabel"):
        pytest.importorskip(package)
    place = tmp_path_factory.mktemp("starting")
    lines: list[str] = []
    labels = write_ellipsoids(place / "seg.nii.gz")
    return start_from_labels(place / "patient 1", labels, [NAMES], size=14.0, progress=lines.append), lines


def test_folder_has_what_a_case_needs(started):
    case, lines = started
    assert sorted(path.name for path in case.folder.iterdir()) == ["case.toml", "mesh.vtu", "recordings"]
    assert sorted(path.name for path in case.folder.parent.iterdir()) == ["patient 1", "seg.nii.gz"]
    assert [line.split()[0] for line in lines] == ["reading", "smoothing", "cutting", "meshing"]


def test_new_case_reads_and_lies_where_the_labels_lie(started):
    case = read_case(started[0].folder)
    assert (case.name, case.origin) == ("patient 1", "measured")
    assert {label: tissue.name for label, tissue in case.tissues.items()} == {2: "grey matter", 3: "white matter"}
    assert {label: tissue.law.shear_modulus for label, tissue in case.tissues.items()} == {2: 1370.0, 3: 1000.0}
    points = case.mesh.points
    np.testing.assert_allclose((points.min(axis=0) + points.max(axis=0)) / 2, CENTRE * 1e-3, atol=1.5e-3)


def test_node_sets_of_a_new_case(started):
    mesh = started[0].mesh
    assert set(mesh.node_sets) == {"surface", "ventricle", "base"}
    away = mesh.points - CENTRE * 1e-3
    surface, ventricle, base = (mesh.node_sets[name] for name in ("surface", "ventricle", "base"))
    depth = np.linalg.norm(away / np.array([0.048, 0.058, 0.046]), axis=1)
    assert depth[surface].min() > 0.93
    assert np.linalg.norm(away[ventricle] / np.array([0.015, 0.024, 0.014]), axis=1).max() < 1.35
    assert not (surface & ventricle).any()
    assert (base <= surface).all() and 4 <= base.sum() < surface.sum() / 2
    assert away[base, 2].max() < -0.014 and away[surface & ~base, 2].min() > -0.046


def test_new_case_solves(started, tmp_path):
    folder = tmp_path / "pushed"
    folder.mkdir()
    for name in ("case.toml", "mesh.vtu"):
        (folder / name).write_bytes((started[0].folder / name).read_bytes())
    with (folder / "case.toml").open("a", encoding="utf-8") as file:
        file.write(PUSH)
    model = model_of(read_case(folder))
    state = solve_equilibrium(System(model, "cpu"))
    assert 0 < abs(state.u).max() < 0.005


def test_summary_says_what_was_made(started):
    case, _ = started
    text = "\n".join(lines("case.txt", "started", case))
    assert f"{case.quality.nodes} nodes, {case.quality.tetrahedra} tetrahedra" in text
    assert "tissue 2   grey matter: " in text and "cavities  " in text
    assert f"surface {case.mesh.node_sets['surface'].sum()}" in text
    assert "a first guess, check it" in text
    for command in ("cases check", "cases show", "run --case"):
        assert f"warpbrain {command} {case.folder}" in text
    # what labels and mesh give is compared, and said where it is far off
    assert case.labelled[2] == pytest.approx(volume_of(2), rel=0.01)
    # discretisation: a cavity as small as two edges of 14 mm, 24 % off
    assert case.cavity == pytest.approx(volume_of(4), rel=0.3)
    assert any(note.startswith("ventricle: ") for note in case.notes) == (
        abs(case.cavity / case.labelled_cavity - 1) > 0.1
    )


def test_text_of_a_case_holds_awkward_names():
    values = tomllib.loads(case_text('a "b" \\ \x7f\n', "x\n[case]", {1: "grey matter", 30: "β (left)"}, False))
    assert values["case"]["name"] == 'a "b" \\ \x7f\n'
    assert values["tissue"]["1"]["mu"] == MU["grey matter"] and "prior" in values["tissue"]["1"]
    assert values["tissue"]["30"]["mu"] == OTHER_MU and "prior" not in values["tissue"]["30"]


def test_examples_in_a_case_are_valid():
    text = case_text("a", "b", {1: "grey matter"}, True)
    examples = [line.removeprefix("# ") for line in text.splitlines()]
    words = ("[", "name", "nodes", "kind", "total", "csf", "elem", "file", "sigma", "role", "gravity_axis", "mu")
    values = tomllib.loads("\n".join(line for line in examples if line.startswith(words) and "axes" not in line))
    assert [entry["kind"] for entry in values["mechanism"]] == ["gravity", "resection"]
    assert [entry["nodes"] for entry in values["boundary"]] == ["base", "ventricle"]
    assert values["recording"][0]["kind"] == "points"


# from a mesh


@pytest.mark.parametrize(("unit", "axes"), [("mm", "RAS"), ("m", "LPS")])
def test_a_mesh_keeps_its_labels_and_sets(tmp_path, unit, axes):
    source = write_block(tmp_path / "block.vtu", unit, axes)
    case = start_from_mesh(tmp_path / "new", source, Frame(unit, axes), ["7=white"])
    read = read_case(tmp_path / "new")
    assert read.mesh.volume == pytest.approx(hollow_block().volume)
    assert {label: tissue.name for label, tissue in read.tissues.items()} == {1: "tissue 1", 7: "white matter"}
    sets = read.mesh.node_sets
    assert set(sets) == {"surface", "ventricle", "base", "top"}
    z = read.mesh.points[:, 2]
    np.testing.assert_array_equal(sets["top"], z > 0.0599)
    np.testing.assert_array_equal(sets["base"], z < 1e-6)
    assert sets["ventricle"].sum() == 26 and not (sets["ventricle"] & sets["surface"]).any()
    left = read.mesh.element_sets["left"]
    assert read.mesh.points[read.mesh.tetrahedra[left]].mean(axis=1)[:, 0].max() < 0.01
    assert case.cavity == pytest.approx(8e-6)
    assert "cavities  8 cm3" in "\n".join(lines("case.txt", "started", case))


def test_sets_that_a_mesh_has_stay(tmp_path):
    block = hollow_block()
    base = block.points[:, 0] == 0.0
    mesh = TetMesh(block.points, block.tetrahedra, block.tissue, {"base": base})
    case = start_from_mesh(tmp_path / "new", write_block(tmp_path / "b.vtu", mesh=mesh), Frame())
    assert case.mesh.node_sets["base"].sum() == base.sum()
    np.testing.assert_array_equal(case.mesh.points[case.mesh.node_sets["base"], 0], 0.0)


def test_labels_of_a_mesh_may_have_another_name(tmp_path):
    block = hollow_block()
    raw = meshio.Mesh(block.points * 1000, [("tetra", block.tetrahedra)], cell_data={"region": [block.tissue]})
    meshio.write(tmp_path / "b.vtu", raw)
    assert start_from_mesh(tmp_path / "a", tmp_path / "b.vtu", Frame(), array="region").tissues.keys() == {1, 7}
    alone = start_from_mesh(tmp_path / "c", tmp_path / "b.vtu", Frame())
    assert alone.tissues.keys() == {1, 7}
    assert alone.notes == ("tissues are the values of the cell array 'region': 1, 7",)
    with pytest.raises(InputError, match="no cell array 'zone'"):
        start_from_mesh(tmp_path / "d", tmp_path / "b.vtu", Frame(), array="zone")


@pytest.mark.parametrize(
    ("written", "told", "hint"),
    [
        ("mm", "m", r"a volume of 2.08e\+11 cm3 in m, expected .*; in mm it would be 208 cm3: --units mm"),
        ("m", "mm", "a volume of 2.08e-07 cm3 in mm, expected .*; in m it would be 208 cm3: --units m"),
    ],
)
def test_units_of_a_mesh_that_cannot_be(tmp_path, written, told, hint):
    source = write_block(tmp_path / "b.vtu", written)
    with pytest.raises(InputError, match=hint):
        start_from_mesh(tmp_path / "new", source, Frame(told))
    assert list(tmp_path.iterdir()) == [source]


def test_a_mesh_that_is_all_resected_is_refused(tmp_path):
    mesh = hollow_block()
    gone = TetMesh(mesh.points, mesh.tetrahedra, mesh.tissue, {}, {"resection": np.ones(len(mesh.tetrahedra), bool)})
    with pytest.raises(InputError, match=r"b\.vtu: all tissue is a resection, .*: say by --tissue what stays"):
        start_from_mesh(tmp_path / "mine", write_block(tmp_path / "b.vtu", mesh=gone), Frame())
    assert not (tmp_path / "mine").exists()


def two_pieces() -> TetMesh:
    block = hollow_block()
    count = len(block.points)
    return TetMesh(
        np.concatenate([block.points, block.points + 0.1]), np.concatenate([block.tetrahedra, block.tetrahedra + count])
    )


def test_meshes_that_are_no_body(tmp_path):
    file = tmp_path / "b.vtu"
    with pytest.raises(InputError, match=r"b\.vtu: no such file"):
        start_from_mesh(tmp_path / "new", file, Frame())
    file.write_bytes(b"")
    with pytest.raises(InputError, match=r"b\.vtu: not a mesh that meshio can read"):
        start_from_mesh(tmp_path / "new", file, Frame())
    write_block(file, mesh=two_pieces())
    with pytest.raises(InputError, match=r"b\.vtu: expected one body, found 2 pieces"):
        start_from_mesh(tmp_path / "new", file, Frame())
    block = hollow_block()
    write_block(file, mesh=TetMesh(block.points, block.tetrahedra, -block.tissue))
    with pytest.raises(InputError, match=r"b\.vtu: expected tissue labels of 0 or more, found -7"):
        start_from_mesh(tmp_path / "new", file, Frame())
    write_block(file)
    with pytest.raises(InputError, match="the mesh has no tissue 2; it has 1, 7"):
        start_from_mesh(tmp_path / "new", file, Frame(), ["2=grey"])
    with pytest.raises(InputError, match="7=ventricle: the cells of a mesh are all tissue"):
        start_from_mesh(tmp_path / "new", file, Frame(), ["7=ventricle"])
    assert list(tmp_path.iterdir()) == [file]


# the folder


def test_a_folder_that_is_not_empty_stays_as_it_is(tmp_path):
    source = write_block(tmp_path / "b.vtu")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "case.toml").write_text("mine")
    for begin in (
        lambda: start_from_mesh(tmp_path / "full", source, Frame()),
        lambda: start_from_labels(tmp_path / "full", tmp_path / "none.nii"),
    ):
        with pytest.raises(InputError, match="full: has a case already: choose another folder, or --overwrite it"):
            begin()
    assert [path.read_text() for path in (tmp_path / "full").iterdir()] == ["mine"]
    (tmp_path / "empty").mkdir()
    start_from_mesh(tmp_path / "empty", source, Frame())
    read_case(tmp_path / "empty")


def test_nothing_is_left_when_writing_is_interrupted(tmp_path, monkeypatch):
    source = write_block(tmp_path / "b.vtu")

    def stop(*values):
        raise KeyboardInterrupt

    monkeypatch.setattr("warpbrain.cases.starting.case_text", stop)
    with pytest.raises(KeyboardInterrupt):
        start_from_mesh(tmp_path / "new", source, Frame())
    assert list(tmp_path.iterdir()) == [source]


@pytest.mark.parametrize("size", [0.0, -1.0, np.nan, np.inf])
def test_sizes_that_are_none(tmp_path, size):
    with pytest.raises(InputError, match=r"--size: found .*, expected a positive length"):
        start_from_labels(tmp_path / "new", tmp_path / "none.nii", size=size)


def test_missing_extra_is_named(tmp_path, monkeypatch):
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"building meshes needs mmgpy, nibabel, .*warpbrain\[build\]"):
        start_from_labels(tmp_path / "new", tmp_path / "none.nii")
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def of_freesurfer(tmp_path_factory):
    """Labels with FreeSurfer's numbers, a part that was taken out, and what lies outside."""
    for package in ("mmgpy", "nibabel"):
        pytest.importorskip(package)
    place = tmp_path_factory.mktemp("preset")
    shape = (40, 42, 40)
    affine = grid_affine((3.0, 3.0, 3.0), shape)
    labels = np.array([0, 0, 1017, 41, 4], dtype=np.int32)[ellipsoids(affine, shape)]
    away = np.indices(shape).reshape(3, -1).T @ affine[:3, :3].T + affine[:3, 3] - CENTRE
    labels[((np.linalg.norm(away - [0.0, 38.0, 30.0], axis=1) < 18.0).reshape(shape)) & (labels > 0)] = 500
    labels[:3, :3, :3] = 24
    write_labels(place / "aseg.nii.gz", labels, affine)
    return start_from_labels(place / "mine", place / "aseg.nii.gz", ["500=resection"], size=14.0, program="freesurfer")


@pytest.mark.slow(8)
def test_a_preset_names_what_there_is(of_freesurfer):
    assert of_freesurfer.tissues == {41: "white matter", 500: "resection", 1017: "grey matter"}
    assert of_freesurfer.notes[0] == "outside the mesh: 0.729 cm3, labels 24 (0.729 cm3)"


@pytest.mark.slow(1)
def test_tissue_of_a_resection_label_is_taken_out(of_freesurfer):
    case = read_case(of_freesurfer.folder)
    removed = case.mesh.tissue == 500
    assert removed.any()
    np.testing.assert_array_equal(case.mesh.element_sets["resection"], removed)
    assert case.remaining[0].volume == pytest.approx(case.mesh.volumes[~removed].sum())


@pytest.mark.slow(1)
def test_a_new_case_has_the_density_of_brain(of_freesurfer):
    assert read_case(of_freesurfer.folder).density == 1040.0


def test_a_label_that_can_mean_two_things_is_asked_about(tmp_path):
    pytest.importorskip("mmgpy")
    labels = np.zeros((40, 40, 40), dtype=np.int16)
    labels[2:-2, 2:-2, 2:-2] = 4
    write_labels(tmp_path / "seg.nii.gz", labels, np.diag([3.0, 3.0, 3.0, 1.0]))
    with pytest.raises(InputError, match=r"seg.nii.gz: label 4: enhancing tumour until 2022.*--tissue 4=NAME"):
        start_from_labels(tmp_path / "mine", tmp_path / "seg.nii.gz", program="brats")
    assert not (tmp_path / "mine").exists()


def test_a_preset_of_another_program_is_refused(tmp_path):
    pytest.importorskip("mmgpy")
    labels = np.zeros((40, 40, 40), dtype=np.int16)
    labels[2:-2, 2:-2, 2:-2] = 100
    write_labels(tmp_path / "seg.nii.gz", labels, np.diag([3.0, 3.0, 3.0, 1.0]))
    with pytest.raises(InputError, match=r"seg.nii.gz: has none of the labels of --preset synthseg; it has 100"):
        start_from_labels(tmp_path / "mine", tmp_path / "seg.nii.gz", program="synthseg")
    assert not (tmp_path / "mine").exists()


@pytest.mark.slow(1)
def test_a_case_in_which_nothing_acts_says_so(started, of_freesurfer):
    for case, _ in (started, (of_freesurfer, None)):
        # a resection alone moves nothing
        assert read_case(case.folder).nothing_acts
        assert NOTHING_ACTS in check_case(case.folder).remarks
