"""A `case.toml` is read as written, whatever its units and axes; what is wrong in it is named."""

import re

import meshio
import numpy as np
import pytest
from folders import CASE, SIDE, block, changed, write_folder, write_recorded
from wrong_cases import FORCE, GRAVITY, SECOND_LAW, WRONG

from warpbrain.cases.boundary import Fixed, Forced
from warpbrain.cases.reading import read_case
from warpbrain.cases.shipped import find_case
from warpbrain.cases.writing import write_case
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh, write_mesh
from warpbrain.physics.laws import MooneyRivlin, NeoHookean, Ogden
from warpbrain.recordings.base import Registration
from warpbrain.simulation.of_case import model_of
from warpbrain.worlds.body.stiffness_field import stiffness_modes


def refusal(folder, *changes, mesh: TetMesh | None = None) -> str:
    """The message with which a case is refused: one line that begins with the file."""
    write_folder(folder, *changes, mesh=mesh)
    return refused(folder)


def refused(folder) -> str:
    with pytest.raises(InputError) as caught:
        read_case(folder)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(folder))
    return message.removeprefix(f"{folder}/")


def test_everything_is_read(tmp_path):
    case = read_case(write_folder(tmp_path))
    assert (case.name, case.title, case.origin) == ("block", "A block of gel", "synthetic")
    assert (case.density, case.poisson) == (1000.0, 0.45)
    assert case.path == tmp_path / "case.toml"
    assert case.mesh.volume == pytest.approx(SIDE**3)
    assert {label: (t.name, t.law, t.formulation) for label, t in case.tissues.items()} == {
        1: ("soft", NeoHookean(1000.0), "coupled"),
        2: ("stiff", NeoHookean(3000.0), "coupled"),
    }
    fixed, force = case.boundaries
    assert fixed == Fixed(name="table", nodes="bottom")
    np.testing.assert_array_equal(case.mesh.node_sets["bottom"], case.mesh.points[:, 2] == 0.0)
    assert force == Forced(name="press", nodes="top", total=(0.01, 0.02, -0.05))
    assert case.assumptions == (
        "The table does not move.",
        "A force of 0.0548 N in all, shared evenly by the nodes of the press.",
    )
    # the file itself may be named, too
    assert read_case(tmp_path / "case.toml").name == "block"


def test_the_accuracy_of_a_registration_is_in_mm_and_degrees(tmp_path):
    assert read_case(write_folder(tmp_path / "none")).registration is None
    head = ('axes = "RAS"', 'axes = "RAS"\nregistration = { mm = 2.5, degrees = 180 }')
    assert read_case(write_folder(tmp_path / "declared", head)).registration == Registration(0.0025, np.pi)


def test_how_unlike_a_tissue_is_from_place_to_place(tmp_path):
    assert read_case(write_folder(tmp_path / "none")).heterogeneity is None
    cast = ("poisson = 0.45", "poisson = 0.45\nheterogeneity = 0.02")
    case = read_case(write_folder(tmp_path / "cast", cast))
    assert read_case(write_case(tmp_path / "again", case).parent).heterogeneity == case.heterogeneity == 0.02
    # the field that a diagnosis allows for, which few modes leave out little of
    spread = np.linalg.norm(stiffness_modes(case.mesh, 0.02), axis=1)
    assert 0.9 * 0.02 < np.sqrt(np.mean(spread**2)) <= 0.02
    with pytest.raises(InputError, match=r"\[body\] heterogeneity: found -1"):
        read_case(write_folder(tmp_path / "wrong", ("poisson = 0.45", "poisson = 0.45\nheterogeneity = -1")))


def test_what_may_be_left_out(tmp_path):
    write_folder(
        tmp_path,
        ('title = "A block of gel"\n', ""),
        ('units = "mm"\naxes = "RAS"\n', ""),
        ('name = "soft"\nmodel = "neo-hookean"\n', ""),
        ("[body]\ndensity = 1000.0\npoisson = 0.45\n", ""),
        ('name = "table"\n', ""),
    )
    case = read_case(tmp_path)
    assert case.title == "block"
    assert (case.density, case.poisson) == (1211.5, 0.45)
    assert case.mesh.volume == pytest.approx(SIDE**3)
    assert case.tissues[1].name == "tissue 1"
    assert case.boundaries[0].name == "bottom"


@pytest.mark.parametrize(
    ("keys", "law"),
    [
        ("mu = 7", NeoHookean(7.0)),
        ('model = "mooney-rivlin"\nC1 = 300.0\nC2 = 200', MooneyRivlin(300.0, 200.0)),
        ('model = "ogden"\nmu = [100.0, -50]\nalpha = [2, -4.7]', Ogden((100.0, -50.0), (2.0, -4.7))),
    ],
)
@pytest.mark.parametrize("formulation", ["coupled", "uncoupled"])
def test_laws(tmp_path, keys, law, formulation):
    tissue = read_case(write_folder(tmp_path, (SECOND_LAW, f'{keys}\nformulation = "{formulation}"'))).tissues[2]
    assert tissue.law == law
    assert tissue.formulation == formulation


def test_a_byte_order_mark_is_not_part_of_the_text(tmp_path):
    write_folder(tmp_path)
    (tmp_path / "case.toml").write_bytes(b"\xef\xbb\xbf" + CASE.replace("\n", "\r\n").encode())
    assert read_case(tmp_path).title == "A block of gel"


def test_units_and_axes_change_nothing_else(tmp_path):
    """The same body in mm and RAS, and in m and LPS: one model."""
    displaced = 'kind = "displacement"\nvalue = [0.1, 0.2, -0.3]'
    more = '[[boundary]]\nname = "pull"\nnodes = "top"\nkind = "force"\ntotal = [1.0, 2.0, 3.0]\n' + GRAVITY
    one = write_folder(
        tmp_path / "mm",
        (FORCE, f"{displaced}\n{more}csf_level = 12.0"),
        ('axes = "RAS"', 'axes = "RAS"\ngravity_axis = [3, -4, 1]'),
    )
    turned = [-1.0, -1.0, 1.0]
    other = write_folder(
        tmp_path / "m",
        (FORCE, f"{displaced}\n{more}csf_level = 12.0"),
        ('"mm"', '"m"'),
        ('"RAS"', '"LPS"\ngravity_axis = [-3, 4, 1]'),
        ("[0.1, 0.2, -0.3]", "[-0.0001, -0.0002, -0.0003]"),
        ("[1.0, 2.0, 3.0]", "[-1, -2, 3]"),
    )
    mesh = block()
    as_lps = TetMesh(mesh.points * turned, mesh.tetrahedra, mesh.tissue, mesh.node_sets, mesh.element_sets)
    write_mesh(other / "mesh.vtu", as_lps, unit="m")
    a, b = (model_of(read_case(folder)) for folder in (one, other))
    np.testing.assert_allclose(b.mesh.points, a.mesh.points, rtol=0, atol=1e-16)
    np.testing.assert_array_equal(b.mesh.tetrahedra, a.mesh.tetrahedra)
    np.testing.assert_array_equal(b.constrained, a.constrained)
    np.testing.assert_allclose(b.prescribed, a.prescribed, rtol=0, atol=1e-16)
    assert np.unique(a.prescribed, axis=0).tolist() == [[0.0, 0.0, 0.0], [0.0001, 0.0002, -0.0003]]
    np.testing.assert_allclose(b.external_forces(), a.external_forces(), rtol=1e-12, atol=1e-15)
    assert b.mass == pytest.approx(a.mass)


def test_a_ramp_is_read(tmp_path):
    case = read_case(write_folder(tmp_path, ("-0.05]", "-0.05]\nramp = [[0, 0], [0.05, 1.0]]")))
    assert case.boundaries[1].ramp == ((0.0, 0.0), (0.05, 1.0))
    assert model_of(case).loads[0].factor(0.025) == pytest.approx(0.5)


def test_a_surface_may_name_its_nodes_by_a_file(tmp_path):
    top = np.flatnonzero(block().node_sets["top"])
    folder = write_recorded(tmp_path, files={"lid-nodes.csv": "\n".join(map(str, top)) + "\n"})
    text = (folder / "case.toml").read_text()
    head, recordings = text.split("[[recording]]", 1)
    (folder / "case.toml").write_text(f"{head}[[recording]]" + recordings.replace('"top"', '"lid-nodes.csv"'))
    case = read_case(folder)
    np.testing.assert_array_equal(np.flatnonzero(case.mesh.node_sets[case.recordings[1].nodes]), top)


def test_resected_tissue_is_gone_from_the_model(tmp_path):
    case = read_case(write_folder(tmp_path, (FORCE, FORCE + '\n[[mechanism]]\nkind = "resection"\nelements="corner"')))
    model, nodes = model_of(case), case.remaining[1]
    corner = case.mesh.element_sets["corner"]
    assert 0 < corner.sum() < len(corner)
    assert len(model.mesh.tetrahedra) == (~corner).sum()
    np.testing.assert_array_equal(model.mesh.points, case.mesh.points[nodes])
    assert "set 'corner'" in case.assumptions[-1]


NUMBERS = ("nan", "inf", "-inf", '"10"', "true", "[1.0]", "1" + "0" * 400)


@pytest.mark.parametrize("value", NUMBERS)
@pytest.mark.parametrize("key", ["density = 1000.0", "poisson = 0.45", "mu = 1000.0"])
def test_numbers_must_be_finite_numbers(tmp_path, key, value):
    name = key.split(" = ")[0]
    message = refusal(tmp_path, (key, f"{name} = {value}"))
    assert f"] {name}: " in message and "expected a finite number" in message and "found " in message
    assert len(message) < 200


@pytest.mark.parametrize("value", [*NUMBERS, "[1.0, 2.0]", "[1.0, 2.0, nan]", "[1.0, 2.0, inf]", '[1.0, 2.0, "3"]'])
@pytest.mark.parametrize("key", ["value", "total"])
def test_vectors_must_be_three_finite_numbers(tmp_path, key, value):
    kind = {"value": "displacement", "total": "force"}[key]
    message = refusal(tmp_path, (FORCE, f'kind = "{kind}"\n{key} = {value}'))
    # a displacement may be the name of a file, too
    expected = "no such file" if (key, value) == ("value", '"10"') else "expected 3 finite numbers "
    assert message.startswith(f"case.toml: [boundary 2] {key}: {expected}")


def test_a_resection_must_leave_something(tmp_path):
    mesh = block()
    whole = TetMesh(mesh.points, mesh.tetrahedra, mesh.tissue, mesh.node_sets, {"corner": mesh.tissue > 0})
    folder = write_folder(
        tmp_path, (FORCE, FORCE + '\n[[mechanism]]\nkind = "resection"\nelements="corner"'), mesh=whole
    )
    with pytest.raises(InputError, match=r"case.toml: \[mechanism 1\] elements: .* 'corner' is the whole body"):
        read_case(folder)


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named(tmp_path, name):
    change, expected = WRONG[name]

    message = refusal(tmp_path, change)
    assert re.search(expected, message), message


def test_the_level_of_the_fluid_must_be_a_number(tmp_path):
    gravity = ("[body]", GRAVITY + "csf_level = nan\n[body]")
    message = refusal(tmp_path, gravity, ('"RAS"', '"RAS"\ngravity_axis = [0, 0, -1]'))
    assert message == "case.toml: [mechanism 1] csf_level: expected a finite number [mm], found nan"


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "case.toml: the file is empty"),
        (b"# nothing", "case.toml: [case]: missing"),
        (b"[case", "case.toml: not valid TOML: "),
        (CASE[:-8].encode(), "case.toml: not valid TOML: "),
        (CASE.replace("A block", "Ein Stück").encode("latin-1"), "case.toml: not UTF-8 text (byte "),
        (b"a = " + b"1" * 5000, "case.toml: not valid TOML: "),
        (b"a = " + b"[" * 5000, "case.toml: not valid TOML: "),
        (b"\x00\x01\x02", "case.toml: not valid TOML: "),
    ],
)
def test_text_that_is_not_a_case(tmp_path, content, expected):
    write_folder(tmp_path)
    (tmp_path / "case.toml").write_bytes(content)
    assert refused(tmp_path).startswith(expected)


def test_no_case_in_the_folder(tmp_path):
    assert refused(tmp_path) == "case.toml: no such file"
    (tmp_path / "case.toml").mkdir()
    assert refused(tmp_path).startswith("case.toml: cannot be read: ")


def damaged(change):
    """The block's mesh as meshio holds it, changed."""
    mesh = block()
    raw = meshio.Mesh(
        1000.0 * mesh.points,
        [("tetra", mesh.tetrahedra.copy())],
        point_data={name: members.astype(np.uint8) for name, members in mesh.node_sets.items()},
        cell_data={"tissue": [mesh.tissue.astype(float)]},
    )
    change(raw)
    return raw


def invert(raw):
    raw.cells[0].data[5, [0, 1]] = raw.cells[0].data[5, [1, 0]]


def flatten(raw):
    raw.points[:, 2] = 0.0


def add_unused(raw):
    raw.points = np.vstack([raw.points, [[1.0, 2.0, 3.0]]])
    raw.point_data = {name: np.append(data, 0) for name, data in raw.point_data.items()}


def repeat(raw):
    raw.cells[0].data[5, 1] = raw.cells[0].data[5, 0]


def spoil_point(raw):
    raw.points[7, 1] = np.nan


def spoil_label(raw):
    raw.cell_data["tissue"][0][3] = np.nan


def make_hexahedra(raw):
    raw.cells = [meshio.CellBlock("hexahedron", np.arange(8)[None])]
    raw.cell_data = {}


def make_triangles(raw):
    raw.cells = [meshio.CellBlock("triangle", raw.cells[0].data[:, :3])]


@pytest.mark.parametrize("ending", ["vtu", "msh"])
@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (invert, "1 tetrahedra are inverted (negative volume): tetrahedron 5"),
        (flatten, "48 tetrahedra have zero volume"),
        (add_unused, "1 node(s) belong to no tetrahedron: node 27"),
        (repeat, "1 tetrahedra name a node twice: tetrahedron 5"),
        (spoil_point, "1 node(s) with a coordinate that is not finite: node 7"),
        (spoil_label, "tissue labels must be whole numbers that fit 32 bits, found nan"),
        (make_hexahedra, "found volume cells of type hexahedron; expected tetrahedra only"),
        (make_triangles, "found no tetrahedra (cells: triangle)"),
    ],
)
def test_a_mesh_that_is_wrong(tmp_path, ending, change, expected):
    write_folder(tmp_path, ("mesh.vtu", f"mesh.{ending}"))
    options = {"file_format": "gmsh"} if ending == "msh" else {}
    meshio.write(tmp_path / f"mesh.{ending}", damaged(change), **options)
    assert refused(tmp_path).startswith(f"mesh.{ending}: {expected}")


@pytest.mark.parametrize(
    ("name", "content"), [("mesh.vtu", b""), ("mesh.msh", b""), ("mesh.vtu", None), ("mesh", b"x")]
)
def test_a_file_that_is_no_mesh(tmp_path, capfd, name, content):
    write_folder(tmp_path, ("mesh.vtu", name))
    if content is None:
        content = (tmp_path / "mesh.vtu").read_bytes()[:800]
    (tmp_path / name).write_bytes(content)
    assert refused(tmp_path).startswith(f"{name}: not a mesh that meshio can read")
    # nobody else has anything to say about it
    assert capfd.readouterr() == ("", "")


def test_single_tissue_of_a_folder_is_a_file_of_its_own(tmp_path):
    write_folder(tmp_path)
    with pytest.raises(InputError, match=r"case-single\.toml: no such file"):
        find_case(str(tmp_path), "single")
    (tmp_path / "case-single.toml").write_text(changed(CASE, ('"block"', '"one"')))
    assert find_case(str(tmp_path), "single").name == "one"
    assert find_case(str(tmp_path), "multi").name == "block"


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("0528", "did you mean '0529'?"),
        ("phantom_fine", "did you mean 'phantom-fine'?"),
        ("brain", "there are: 0529, 0614, "),
        ("", "there are: "),
        ("a" * 5000, "there are: "),
        ("a\0b", "there are: "),
    ],
)
def test_a_case_that_is_not_there(name, hint):
    with pytest.raises(InputError) as caught:
        find_case(name)
    assert str(caught.value).startswith(f"case '{name}': no such case and no such folder ({hint}")


def test_the_phantom_has_the_papers_name_too():
    for tissue in ("single", "multi"):
        assert find_case("synthetic", tissue).path == find_case("phantom", tissue).path
        assert find_case("synthetic-fine", tissue).path == find_case("phantom-fine", tissue).path
