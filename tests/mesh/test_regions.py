"""Tissues and sets of mesh files as other programs write them: Gmsh, Abaqus, VTK; none is guessed between several."""

import meshio
import numpy as np
import pytest
from shapes import box

from warpbrain.mesh import MeshError
from warpbrain.mesh.abaqus import read_abaqus
from warpbrain.mesh.regions import read_regions

MESH = box((2, 2, 2), (1.0, 1.0, 1.0))
LEFT = MESH.points[MESH.tetrahedra].mean(axis=1)[:, 0] < 0.5
TISSUE = np.where(LEFT, 1, 2)
TOP = np.flatnonzero(MESH.points[:, 2] == 1.0)
#: Triangles among the nodes of the top.
LID = np.array([TOP[[0, 1, 3]], TOP[[1, 4, 3]]])


def write(path, **data):
    meshio.write(path, meshio.Mesh(MESH.points, [("triangle", LID), ("tetra", MESH.tetrahedra)], **data))
    return path


@pytest.mark.parametrize("version", ["gmsh22", "gmsh"])
def test_physical_groups_of_gmsh(tmp_path, version):
    groups = [np.array([5, 5]), TISSUE]
    mesh = meshio.Mesh(
        MESH.points,
        [("triangle", LID), ("tetra", MESH.tetrahedra[LEFT]), ("tetra", MESH.tetrahedra[~LEFT])],
        cell_data={
            name: [groups[0], np.ones(LEFT.sum(), int), np.full((~LEFT).sum(), 2)]
            for name in ("gmsh:physical", "gmsh:geometrical")
        },
        field_data={"grey": np.array([1, 3]), "white": np.array([2, 3]), "lid": np.array([5, 2])},
    )
    if version == "gmsh":
        # 4.1 keeps the dimension and number of the entity of each node
        of = np.zeros((len(MESH.points), 2), dtype=int)
        of[:] = 3, 1
        of[np.setdiff1d(MESH.tetrahedra[~LEFT], MESH.tetrahedra[LEFT])] = 3, 2
        of[np.unique(LID)] = 2, 5
        mesh.point_data["gmsh:dim_tags"] = of
    path = tmp_path / "a.msh"
    meshio.write(path, mesh, file_format=version, binary=False)
    read = read_regions(path, "m")
    assert read.names == {1: "grey", 2: "white"}
    lid = read.mesh.points[read.mesh.node_sets["lid"]]
    assert sorted(lid.tolist()) == sorted(MESH.points[np.unique(LID)].tolist())
    centres = read.mesh.points[read.mesh.tetrahedra].mean(axis=1)[:, 0]
    np.testing.assert_array_equal(read.mesh.tissue == 1, centres < 0.5)


ABAQUS = """*HEADING
** a comment
*NODE, NSET=All
{nodes}
*ELEMENT, TYPE=C3D4
{first}
*ELEMENT, TYPE=C3D4, ELSET=Rest
{second}
*ELEMENT, TYPE=C3D4, ELSET=rest
{third}
*ELSET, ELSET=soft
{soft}
*ELSET, ELSET=Stiff
REST
*NSET, NSET=held
{held},
*NSET, NSET=Row, GENERATE
1, 5, 2
*MATERIAL, NAME=gel
*ELASTIC
1000., 0.45
"""


def abaqus(path, text=ABAQUS):
    """Numbers of nodes and elements as others give them: from 1 and from 101, blocks of 2, 20 and the rest."""
    cells = [f"{101 + e}, {', '.join(str(n + 1) for n in cell)}" for e, cell in enumerate(MESH.tetrahedra)]
    path.write_text(
        text.format(
            nodes="\n".join(f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(MESH.points.tolist(), 1)),
            first="\n".join(cells[:2]),
            second="\n".join(cells[2:22]),
            third="\n".join(cells[22:]),
            soft="101, 102",
            held=", ".join(str(n + 1) for n in TOP),
        )
    )
    return path


def test_sets_of_abaqus(tmp_path):
    """Sets are by number and not by block, of one name whatever its case, and of sets."""
    read = read_regions(abaqus(tmp_path / "a.inp"), "m")
    sets = read_abaqus(tmp_path / "a.inp")
    for name in ("Rest", "Stiff"):
        assert [ids.tolist() for ids in sets.cell_sets[name]] == [[], list(range(20)), list(range(26))]
    assert sets.point_sets["Row"].tolist() == [0, 2, 4]
    np.testing.assert_array_equal(np.flatnonzero(read.mesh.node_sets["held"]), TOP)
    # two sets of the same elements: no partition, so they stay sets
    assert set(np.unique(read.mesh.tissue)) == {1}
    np.testing.assert_array_equal(np.flatnonzero(read.mesh.element_sets["soft"]), [0, 1])


def test_sets_of_abaqus_that_part_the_body_are_its_tissues(tmp_path):
    read = read_regions(abaqus(tmp_path / "a.inp", ABAQUS.replace("*ELSET, ELSET=Stiff\nREST\n", "")), "m")
    named = {name: number for number, name in read.names.items()}
    assert set(named) == {"Rest", "soft"}
    np.testing.assert_array_equal(read.mesh.tissue == named["soft"], np.arange(48) < 2)
    assert read.mesh.element_sets == {}


SECTIONS = """*SOLID SECTION, ELSET=REST, MATERIAL=gel
,
*Solid Section, elset=Soft, material=gel
,
"""


def test_sets_of_abaqus_that_have_a_material_are_the_tissues(tmp_path):
    """Whatever other sets there are, such as one of a load, that overlap them."""
    read = read_regions(abaqus(tmp_path / "a.inp", ABAQUS + SECTIONS), "m")
    named = {name: number for number, name in read.names.items()}
    assert set(named) == {"Rest", "soft"}
    np.testing.assert_array_equal(read.mesh.tissue == named["soft"], np.arange(48) < 2)
    assert set(read.mesh.element_sets) == {"Stiff"}


def test_sets_of_abaqus_that_elements_are_defined_in_are_the_tissues(tmp_path):
    text = ABAQUS.replace("*ELEMENT, TYPE=C3D4\n{first}", "*ELEMENT, TYPE=C3D4, ELSET=First\n{first}")
    read = read_regions(abaqus(tmp_path / "a.inp", text), "m")
    assert set(read.names.values()) == {"First", "Rest"}
    assert set(read.mesh.element_sets) == {"soft", "Stiff"}


def test_sets_of_elements_that_are_no_tissues_are_said(tmp_path):
    read = read_regions(abaqus(tmp_path / "a.inp"), "m")
    assert read.names == {}
    assert any("soft (2 tetrahedra)" in note and "are no tissues" in note for note in read.notes)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("{soft}", "900"), "set 'soft' has 900, which the file does not define"),
        (("REST\n", "nobody\n"), r"\*ELSET, lines \d+ to \d+: expected numbers or names of sets"),
        (("*MATERIAL, NAME=gel", "*INCLUDE, INPUT=/etc/passwd"), r"a\.inp: \*INCLUDE: one file is read"),
    ],
)
def test_sets_of_abaqus_that_are_wrong(tmp_path, change, expected):
    with pytest.raises(MeshError, match=expected):
        read_regions(abaqus(tmp_path / "a.inp", ABAQUS.replace(*change)), "m")


def test_an_array_of_vtk(tmp_path):
    """One array that can be the tissues is; what counts elements, or is of one value, is none."""
    count = np.arange(48)
    data = {
        "region": [np.zeros(2), TISSUE.astype(float)],
        "GlobalElementId": [count[:2], count],
        "quality": [np.full(2, 0.5), np.linspace(0.1, 0.9, 48)],
        "one": [np.ones(2, int), np.ones(48, int)],
    }
    read = read_regions(write(tmp_path / "a.vtu", cell_data=data), "m")
    np.testing.assert_array_equal(read.mesh.tissue, TISSUE)
    assert read.notes == ("tissues are the values of the cell array 'region': 1, 2",)


def test_several_arrays_are_listed(tmp_path):
    path = write(tmp_path / "a.vtu", cell_data={"b": [np.zeros(2, int), TISSUE], "a": [np.zeros(2, int), 3 * TISSUE]})
    with pytest.raises(
        MeshError, match=r"found 2 cell arrays that could be the tissues: a \(2 values\), b \(2 values\)"
    ):
        read_regions(path, "m")
    np.testing.assert_array_equal(read_regions(path, "m", "a").mesh.tissue, 3 * TISSUE)


def test_node_sets_of_faces_and_of_values(tmp_path):
    marks = np.zeros(27, dtype=int)
    marks[TOP], marks[0] = 4, 9
    path = write(
        tmp_path / "a.vtu",
        cell_data={"region": [np.array([7, 8]), TISSUE]},
        point_data={"marks": marks, "ids": np.arange(27), "flag": (marks > 0).astype(int)},
    )
    sets = read_regions(path, "m").mesh.node_sets
    assert set(sets) == {"marks-4", "marks-9", "flag", "region-7", "region-8"}
    np.testing.assert_array_equal(np.flatnonzero(sets["marks-4"]), TOP)
    np.testing.assert_array_equal(np.flatnonzero(sets["region-7"]), np.sort(LID[0]))


def test_a_point_array_of_one_value_everywhere_is_no_node_set(tmp_path):
    mesh = meshio.Mesh(MESH.points, [("tetra", MESH.tetrahedra)], cell_data={"medit:ref": [TISSUE]})
    meshio.write(tmp_path / "a.mesh", mesh)
    read = read_regions(tmp_path / "a.mesh", "m")
    assert set(np.unique(read.mesh.tissue)) == {1, 2} and read.mesh.node_sets == {}
