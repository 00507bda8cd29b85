"""What a user's folder can have wrong with it: each is named, with the file, the place and the cure."""

import re

import meshio
import numpy as np
import pytest
from folders import block, write_folder, write_recorded

from warpbrain.cases.checking import check_case
from warpbrain.cases.reading import read_case
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh, write_mesh

FORCE = 'kind = "force"\ntotal = [0.01, 0.02, -0.05]'


def problems(folder) -> list[str]:
    """Everything that is wrong, without the folder's path; reading stops with the first."""
    found = [str(problem) for problem in check_case(folder).problems]
    if found:
        with pytest.raises(InputError, match=re.escape(found[0])):
            read_case(folder)
    else:
        read_case(folder)
    return [problem.replace(f"{folder}/", "") for problem in found]


def only(folder) -> str:
    [problem] = problems(folder)
    return problem


def with_mesh(folder, points, cells, **data):
    """The block's folder with another mesh, written as it is."""
    write_folder(folder)
    meshio.write(folder / "mesh.vtu", meshio.Mesh(points, [("tetra", cells)], **data))
    return folder


def test_a_good_folder_has_no_problem(tmp_path):
    checked = check_case(write_recorded(tmp_path))
    assert checked.problems == ()
    case = checked.case
    assert [(r.name, r.kind, r.role, r.sigma) for r in case.recordings] == [
        ("beads", "points", "fit", pytest.approx(1e-4)),
        ("lid", "surface", "check", None),
        ("cell", "force", "fit", None),
    ]
    np.testing.assert_allclose(case.recordings[0].points[1], [0.02, 0.015, 0.025])


def test_all_problems_are_told_at_once(tmp_path):
    folder = write_recorded(
        tmp_path,
        ("mu = 1000.0", "mu = true"),
        ("poisson = 0.45", "poisson = 0.6"),
        ('nodes = "bottom"', 'nodes = "floor"'),
        files={"recordings/beads.csv": "x,y,z,ux,uy,uz\n1,1,1,0,0,nan\n2,2,2,0,0\n", "recordings/lid.csv": ""},
    )
    found = problems(folder)
    for expected in (
        r"case.toml: \[tissue.1\] mu: expected a finite number",
        r"case.toml: \[body\] poisson: found 0.6",
        r"case.toml: \[boundary 1\] nodes: the mesh has no node set 'floor'",
        r"beads.csv: row 2, column uz: found 'nan', expected a finite number",
        r"beads.csv: row 3: found 5 fields, expected 7|beads.csv: row 3: found 5 fields, expected 6",
        r"lid.csv: .*(empty|0 bytes)",
    ):
        assert any(re.search(expected, problem) for problem in found), (expected, found)


@pytest.mark.parametrize(
    ("unit", "factor", "expected"),
    [
        ("mm", 1e-3, r'is 2.7e-08 cm3 if lengths are in mm.*with \[case\] units = "m" it would be 27 cm3'),
        ("m", 1e3, r'is 2.7e\+10 cm3 if lengths are in m, .*with \[case\] units = "mm" it would be 27 cm3'),
    ],
)
def test_a_mesh_in_another_unit(tmp_path, unit, factor, expected):
    write_folder(tmp_path, ('units = "mm"', f'units = "{unit}"'))
    mesh = block()
    write_mesh(tmp_path / "mesh.vtu", mesh, unit="m" if unit == "mm" else "mm")
    assert re.search(expected, only(tmp_path))


@pytest.mark.parametrize(("corner", "share"), [(30.0, "all"), (20.0, "67 %")])
def test_a_load_on_what_is_held_does_nothing(tmp_path, corner, share):
    mesh = block()
    bottom = mesh.node_sets["bottom"]
    sets = {"top": bottom, "bottom": bottom & (1000.0 * mesh.points[:, 0] <= corner)}
    mesh = TetMesh(mesh.points, mesh.tetrahedra, mesh.tissue, sets)
    said = check_case(write_folder(tmp_path, mesh=mesh)).remarks
    assert f"[[boundary]] 'press' does nothing on {share} of 'top', which a [[boundary]] fixes or displaces" in said


@pytest.mark.parametrize(
    ("level", "what"), [("0.04", "has its weight"), ("-4", "has its weight"), ("400", "floats"), ("15", "")]
)
def test_a_level_beside_the_body_is_doubted(tmp_path, level, what):
    folder = write_folder(tmp_path)
    with (folder / "case.toml").open("a", encoding="utf-8") as stream:
        stream.write(f'[[mechanism]]\nkind = "gravity"\ncsf_level = {level}\ndirection = [0, 0, -1]\n')
    said = f"gravity: csf_level = {level} mm: all of a body 30 mm high {what}: is the unit right?"
    assert (said in check_case(folder).remarks) == bool(what)


def test_a_density_that_is_not_given_is_said(tmp_path):
    case = read_case(write_folder(tmp_path, ("density = 1000.0\n", "")))
    assert case.density == 1211.5
    [remark] = case.remarks
    assert remark.endswith(
        "case.toml: [body] density: not given: the 1211.5 kg/m3 of the paper's Table 4 are taken; "
        "brain has 1040 (ICRU Report 44, 1989)"
    )


def test_a_density_in_another_unit(tmp_path):
    message = only(write_folder(tmp_path, ("density = 1000.0", "density = 1.04")))
    assert message == (
        "case.toml: [body] density: found 1.04 kg/m3, which no tissue or gel has (1.04 g/cm3 is 1040 kg/m3)"
    )


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("0\n1\n27\n", r"ids.csv: row 3: found node '27', but the mesh has nodes 0 to 26"),
        ("0\n-1\n", r"ids.csv: row 2: expected the number of a node, found '-1'"),
        ("node\n0.5\n", r"ids.csv: row 2: expected the number of a node, found '0.5'"),
        ("node\n# nobody\n", r"ids.csv: the file names no node: the set is empty"),
        (b"\xff\xfe0", r"ids.csv: row 1: found byte 0xff at position 0, expected UTF-8"),
    ],
)
def test_node_numbers_in_a_file(tmp_path, content, expected):
    folder = write_folder(tmp_path, ('nodes = "bottom"', 'nodes = "ids.csv"'))
    (folder / "ids.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    assert re.search(expected, only(folder))


def test_nodes_from_a_file(tmp_path):
    folder = write_folder(tmp_path, ('nodes = "bottom"', 'nodes = "ids.csv"'))
    members = np.flatnonzero(block().node_sets["bottom"])
    (folder / "ids.csv").write_text("node\n" + "\n".join(map(str, members)) + "\n")
    case = read_case(folder)
    assert case.boundaries[0].nodes == "ids"
    np.testing.assert_array_equal(case.mesh.node_sets["ids"], case.mesh.node_sets["bottom"])


def test_nodes_at_the_same_place(tmp_path):
    mesh = block()
    points, cells = 1000.0 * mesh.points, mesh.tetrahedra.copy()
    # the last tetrahedron comes loose at one of its nodes
    points = np.vstack([points, points[cells[-1, 0]]])
    cells[-1, 0] = len(points) - 1
    data = {name: np.append(members, False).astype(np.uint8) for name, members in mesh.node_sets.items()}
    with_mesh(tmp_path, points, cells, point_data=data, cell_data={"tissue": [mesh.tissue]})
    found = problems(tmp_path)
    assert re.search(r"mesh.vtu: node \d+: 1 pair\(s\) of nodes are at the same place .*torn.*\(merge", found[0])


def test_a_part_that_nothing_holds(tmp_path):
    mesh = block()
    points = np.vstack([1000.0 * mesh.points, 1000.0 * mesh.points[mesh.tetrahedra[0]] + 100.0])
    cells = np.vstack([mesh.tetrahedra, np.arange(4) + len(mesh.points)])
    data = {name: np.append(members, [False] * 4).astype(np.uint8) for name, members in mesh.node_sets.items()}
    with_mesh(tmp_path, points, cells, point_data=data, cell_data={"tissue": [np.append(mesh.tissue, 1)]})
    assert re.search(
        r"case.toml: \[mesh\]: the mesh is in 2 parts .* nothing holds the one of 1 tetrahedra .first: tetrahedron 48",
        only(tmp_path),
    )


def test_tetrahedra_that_overlap(tmp_path):
    mesh = block()
    cells = np.vstack([mesh.tetrahedra, mesh.tetrahedra[:1]])
    data = {name: members.astype(np.uint8) for name, members in mesh.node_sets.items()}
    with_mesh(tmp_path, 1000.0 * mesh.points, cells, point_data=data, cell_data={"tissue": [np.append(mesh.tissue, 1)]})
    assert re.search(
        r"mesh.vtu: face .* belongs to three or more tetrahedra: the surface is not closed", only(tmp_path)
    )


def test_a_skull_must_be_closed(tmp_path):
    contact = 'kind = "contact"\nsurface = "skull.stl"'
    folder = write_folder(tmp_path, (FORCE, contact))
    corners = np.array([[0, 0, 0], [90, 0, 0], [0, 90, 0], [0, 0, 90]]) - 20.0
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    # binary: meshio's text form has nine digits, and corners would differ
    meshio.write(folder / "skull.stl", meshio.Mesh(corners, [("triangle", faces[:3])]), binary=True)
    assert re.search(r"skull.stl: the surface is not closed: 3 edge\(s\) .*close the surface", only(folder))
    meshio.write(folder / "skull.stl", meshio.Mesh(corners, [("triangle", faces)]), binary=True)
    case = read_case(folder)
    assert case.boundaries[1].surface.faces.shape == (4, 3)


def test_second_order_tetrahedra_are_read_by_their_corners(tmp_path):
    mesh = block()
    folder = write_folder(tmp_path)
    edges = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    pairs = np.sort(mesh.tetrahedra[:, edges], axis=2)
    unique, number = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    middle = len(mesh.points) + number.reshape(-1, 6)
    points = np.vstack([mesh.points, mesh.points[unique].mean(axis=1)])
    raw = meshio.Mesh(
        1000.0 * points,
        [("tetra10", np.hstack([mesh.tetrahedra, middle]))],
        point_data={name: np.append(m, np.zeros(len(unique))).astype(np.uint8) for name, m in mesh.node_sets.items()},
        cell_data={"tissue": [mesh.tissue]},
    )
    meshio.write(folder / "mesh.vtu", raw)
    case = read_case(folder)
    np.testing.assert_allclose(case.mesh.points, mesh.points)
    np.testing.assert_array_equal(case.mesh.tetrahedra, mesh.tetrahedra)
    assert f"{len(unique)} nodes on edges are not" in case.remarks[0]


RECORDED = {
    "outside": (
        {"recordings/beads.csv": "x,y,z,ux,uy,uz\n10,10,10,0,0,0\n10,10,95,0,0,0\n5,5,5,0,0,0\n"},
        r"beads.csv: point 2: .*65 mm outside the mesh, .*check units and axes",
    ),
    "metres": (
        {"recordings/beads.csv": "x,y,z,ux,uy,uz\n" + "0.01,0.012,0.01,0,0,0\n" * 3},
        None,  # inside the block all the same, in its corner: nothing to find
    ),
    "lps": (
        {"recordings/beads.csv": "x,y,z,ux,uy,uz\n-10,-20,10,0,0,0\n-20,-10,20,0,0,0\n"},
        r"beads.csv: .*outside the mesh.*RAS.*LPS",
    ),
    "inf": ({"recordings/beads.csv": "x,y,z,ux,uy,uz\n1,1,inf,0,0,0\n"}, r"beads.csv: row 2, column z: found 'inf'"),
    "time": (
        {"recordings/cell.csv": "t,fz\n0,0\n2,1\n1,2\n"},
        r"cell.csv: row 4, column t: found 1 s after 2 s \(row 3\), expected a later time",
    ),
    "truncated": (
        {"recordings/beads.csv": "x,y,z,ux,uy,uz\n1,1,1,0,0,0\n2,2,2,0,"},
        r"beads.csv: row 3: found 5 fields, expected 6 .*cut off",
    ),
    "latin": ({"recordings/beads.csv": b"x,y,z,ux,uy,uz\n1,1,1,0,0,0 # \xe9\n"}, r"beads.csv: .*UTF-8"),
    "empty": ({"recordings/beads.csv": b""}, r"beads.csv: .*empty"),
    "header": ({"recordings/beads.csv": "x,y,z,ux,uy\n1,1,1,0,0\n"}, r"beads.csv: header: found no column 'uz'"),
}


@pytest.mark.parametrize("name", RECORDED)
def test_recordings(tmp_path, name):
    files, expected = RECORDED[name]
    folder = write_recorded(tmp_path, files=files)
    if expected is None:
        assert problems(folder) == []
    else:
        assert re.search(expected, problems(folder)[0])


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            'file = "recordings/beads.csv"',
            'file = "../beads.csv"',
        ),
        ('file = "recordings/beads.csv"', 'file = "recordings"'),
        ('file = "recordings/beads.csv"', 'file = "recordings/none.csv"'),
        ('boundary = "press"', 'boundary = "pres"'),
        ('nodes = "top"\nrole', 'nodes = "lid"\nrole'),
        ('name = "lid"', 'name = "beads"'),
        ('kind = "force"\nfile', 'kind = "forse"\nfile'),
        ("sigma = 0.1", "sigma = 0"),
    ],
)
def test_recording_tables(tmp_path, change, expected):
    folder = write_recorded(tmp_path)
    text = (folder / "case.toml").read_text()
    assert change in text
    (folder / "case.toml").write_text(text.replace(change, expected))
    assert re.search(
        {
            '"../beads.csv"': r"\[recording 1\] file: '../beads.csv' leaves the case folder",
            '"recordings"': r"\[recording 1\] file: no such file: .*is a folder",
            '"recordings/none.csv"': r"\[recording 1\] file: no such file",
            '"pres"': r"\[recording 3\] boundary: no \[\[boundary\]\] is called 'pres' \(there are: 'press', 'table'",
            '"lid"\nrole': r"\[recording 2\] nodes: the mesh has no node set 'lid'",
            '"beads"': r"\[recording 2\] name: a second recording 'beads'",
            '"forse"\nfile': r"\[recording 3\] kind: found 'forse', expected one of .* \(did you mean 'force'\?\)",
            "0": r"\[recording 1\] sigma: found 0, expected a positive number",
        }[expected.split(" = ", 1)[1]],
        problems(folder)[0],
    )


@pytest.mark.parametrize("name", ["case.toml", "mesh.vtu", "recordings/beads.csv"])
@pytest.mark.parametrize("size", [0, 1 << 30])
def test_files_of_no_size_and_of_a_gigabyte(tmp_path, name, size):
    folder = write_recorded(tmp_path)
    with (folder / name).open("wb") as stream:
        stream.truncate(size)  # a hole: takes no room on the disk
    message = problems(folder)[0]
    assert name.rsplit("/", 1)[-1] in message
    assert re.search("empty|0 bytes" if size == 0 else r"1\d\d\d MB, expected", message), message


def test_a_number_of_thousands_of_digits_and_faults_without_end(tmp_path):
    folder = write_folder(tmp_path, ('nodes = "bottom"', 'nodes = "ids.csv"'))
    (folder / "ids.csv").write_text("9" * 5000 + "\n" + "x\n" * 1000)
    found = problems(folder)
    assert len(found) == 21 and all(len(problem) < 300 for problem in found)
    assert "981 more problems" in found[-1]


@pytest.mark.parametrize("scale", [1e-3, 1e3])
@pytest.mark.parametrize("name", ["beads", "lid"])
def test_a_recording_in_another_unit_than_the_mesh(tmp_path, name, scale):
    """Metres read as millimetres lie in a dot, which may well be inside the body; the other way they lie far away."""
    head = "x,y,z,ux,uy,uz" if name == "beads" else "x,y,z"
    rest = ",0,0,0" if name == "beads" else ""
    places = np.array([[5, 5, 29], [25, 5, 29], [5, 25, 29], [25, 25, 29], [15, 15, 29]]) * scale
    rows = "".join(f"{x},{y},{z}{rest}\n" for x, y, z in places)
    found = problems(write_recorded(tmp_path, files={f"recordings/{name}.csv": f"{head}\n{rows}"}))
    assert any(f"{name}.csv" in problem and "in m" in problem for problem in found), found


@pytest.mark.parametrize("value", ["1e155", "1e308", "-1e13"])
def test_numbers_that_nothing_has(tmp_path, value):
    files = {"recordings/beads.csv": f"x,y,z,ux,uy,uz\n1,1,1,0,0,{value}\n{value},1,1,0,0,0\n"}
    found = problems(write_recorded(tmp_path, files=files))
    assert any(f"row 2, column uz: found '{value}', expected a number of at most 1e+12" in problem for problem in found)
    assert any(f"row 3, column x: found '{value}'" in problem for problem in found)
