"""What keys of mechanisms name: surfaces, fields of directions and tissues, in case.toml and on the command line."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from folders import SIDE, block, write_folder
from shapes import room

from warpbrain.cases.assuming import assume
from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case
from warpbrain.cases.writing import write_case
from warpbrain.errors import InputError
from warpbrain.mesh import face_vectors, wall_nodes
from warpbrain.mesh.vtu import read_vtu
from warpbrain.physics.mechanisms.contact import Contact
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.regions import element_directions
from warpbrain.simulation.mesh_error import FinerCase
from warpbrain.simulation.of_case import model_of

COUNT = len(block().tetrahedra)
#: A direction for each element, and as a user's files have it.
FIELD = np.random.default_rng(5).normal(size=(COUNT, 3))


def with_mechanism(folder: Path, text: str, *changes: tuple[str, str]) -> Path:
    return write_folder(folder, ("[body]", f"[[mechanism]]\n{text}\n[body]"), *changes)


def add_arrays(folder: Path, **arrays: np.ndarray) -> None:
    """Put arrays of points or cells into the mesh file of a folder."""
    raw = read_vtu(folder / "mesh.vtu")
    for name, values in arrays.items():
        if len(values) == COUNT:
            raw.cell_data[name] = [values]
        else:
            raw.point_data[name] = values
    meshio.write(folder / "mesh.vtu", raw)


def write_field(path: Path, values: np.ndarray) -> None:
    if path.suffix == ".npy":
        np.save(path, values)
    elif path.suffix == ".csv":
        path.write_text("x,y,z\n" + "".join(f"{x!r},{y!r},{z!r}\n" for x, y, z in values.tolist()))
    else:
        mesh = block()
        meshio.write(path, meshio.Mesh(mesh.points, [("tetra", mesh.tetrahedra)], cell_data={"V1": [values]}))


def directions(case: Case) -> np.ndarray:
    (fibres,) = (m for m in case.mechanisms if isinstance(m, Fibres))
    return element_directions(case.mesh, np.arange(COUNT), fibres.direction, fibres.field)


UNIT = FIELD / np.linalg.norm(FIELD, axis=1, keepdims=True)


@pytest.mark.parametrize("name", ["v1.csv", "v1.npy", "v1.vtu"])
def test_directions_come_from_a_file(tmp_path, name):
    folder = with_mechanism(tmp_path, f'kind = "fibres"\nstiffness = 300.0\nfield = "{name}"')
    write_field(folder / name, FIELD)
    assert np.abs(directions(read_case(folder)) - UNIT).max() < 1e-12


def test_directions_are_in_the_axes_of_the_case(tmp_path):
    fibres = 'kind = "fibres"\nstiffness = 300.0\nfield = "v1.npy"'
    folder = with_mechanism(tmp_path, fibres, ('"RAS"', '"LPS"'))
    write_field(folder / "v1.npy", FIELD)
    assert np.abs(directions(read_case(folder)) - UNIT * [-1.0, -1.0, 1.0]).max() < 1e-12


def test_directions_come_from_an_array_of_the_mesh(tmp_path):
    folder = with_mechanism(tmp_path / "cells", 'kind = "fibres"\nstiffness = 300.0\nfield = "V1"')
    add_arrays(folder, V1=FIELD)
    assert np.abs(directions(read_case(folder)) - UNIT).max() < 1e-12
    # of points: the same axis everywhere, with a sense that is anybody's guess
    folder = with_mechanism(tmp_path / "points", 'kind = "fibres"\nstiffness = 300.0\nfield = "V1"')
    axis = np.array([1.0, 2.0, -0.5])
    sense = np.random.default_rng(6).choice([-1.0, 1.0], len(block().points))
    add_arrays(folder, V1=sense[:, None] * axis)
    assert np.abs(np.abs(directions(read_case(folder)) @ axis) / np.linalg.norm(axis) - 1.0).max() < 1e-12


def test_what_a_resection_leaves_keeps_its_directions(tmp_path):
    fibres = 'kind = "fibres"\nstiffness = 300.0\nfield = "v1.npy"\n[[mechanism]]\nkind = "resection"\n'
    folder = with_mechanism(tmp_path, fibres + 'elements = "corner"')
    write_field(folder / "v1.npy", FIELD)
    left = model_of(read_case(folder)).mesh
    corner = block().element_sets["corner"]
    assert np.abs(left.element_vectors["v1.npy"] - FIELD[~corner]).max() < 1e-12


def test_a_tissue_is_a_region(tmp_path):
    case = read_case(with_mechanism(tmp_path, 'kind = "swelling"\namount = 3.0\nelements = "stiff"'))
    (swelling,) = case.mechanisms
    grown = swelling.growth(case.mesh, 1.0)
    np.testing.assert_allclose(grown, np.where(case.mesh.tissue == 2, 0.03, 0.0))
    said = assume(read_case(write_folder(tmp_path / "b")), "fibres:direction=1/0/0,stiffness=300,elements=stiff")
    np.testing.assert_array_equal(said.mesh.element_sets["stiff"], said.mesh.tissue == 2)


def test_a_skull_is_read_in_the_unit_of_the_case(tmp_path, monkeypatch):
    folder = with_mechanism(tmp_path, 'kind = "contact"\nnodes = "top"\nsurface = "skull.stl"')
    surface = room(100.0)
    meshio.write(folder / "skull.stl", meshio.Mesh(surface.points, [("triangle", surface.faces)]), binary=True)
    (contact,) = read_case(folder).mechanisms
    assert isinstance(contact, Contact) and contact.surface is not None
    assert np.abs(contact.surface.points).max() == pytest.approx(0.1)
    assert "surface 'skull.stl'" in contact.detail()
    # on the command line from where one is
    monkeypatch.chdir(folder)
    plain = read_case(write_folder(tmp_path / "b"))
    (said,) = assume(plain, "contact:nodes=top,state=lifting,surface=skull.stl").mechanisms
    assert isinstance(said, Contact) and said.surface is not None and len(said.surface.faces) == 12


@pytest.mark.parametrize(
    ("mechanism", "expected"),
    [
        ('kind = "contact"\nnodes = "top"\nsurface = "no.stl"', r"\[mechanism 1\] surface: no such file: .*no\.stl"),
        ('kind = "contact"\nnodes = "top"\nsurface = "open.stl"', r"open\.stl: the surface is not closed"),
        (
            'kind = "contact"\nnodes = "top"\nsurface = "metres.stl"',
            r"surface: 'metres\.stl' is 0\.3 mm .*another unit",
        ),
        ('kind = "fibres"\nstiffness = 3.0', r"\[mechanism 1\] direction: give either one direction or a field"),
        ('kind = "fibres"\nstiffness = 3.0\nfield = "V9"', r"field: the mesh has no array of directions 'V9' \(it has"),
        ('kind = "fibres"\nstiffness = 3.0\nfield = "no.npy"', r"\[mechanism 1\] field: no such file"),
        ('kind = "fibres"\nstiffness = 3.0\nfield = "short.npy"', r"short\.npy: found 4 x 3 numbers, expected 48 x 3"),
        ('kind = "fibres"\nstiffness = 3.0\nfield = "text.npy"', r"text\.npy: not an array of NumPy"),
        ('kind = "fibres"\nstiffness = 3.0\nfield = "two.csv"', r"two\.csv: .*z"),
        ('kind = "fibres"\nstiffness = 3.0\nfield = "zero.npy"', r"field: 'zero\.npy' has no direction in 1 of 48 el"),
        ('kind = "residual-stress"\ntension = 3.0\ndirection = [0, 0, 0]', r"direction: found .* not all zero"),
        ('kind = "swelling"\namount = 3.0\nelements = "marrow"', r"elements: the mesh has no element set 'marrow'"),
    ],
)
def test_what_is_wrong_names_file_and_key(tmp_path, mechanism, expected):
    folder = with_mechanism(tmp_path, mechanism)
    surface = room(100.0)
    meshio.write(folder / "open.stl", meshio.Mesh(surface.points, [("triangle", surface.faces[:9])]), binary=True)
    small = meshio.Mesh(1e-3 * surface.points, [("triangle", surface.faces)])
    meshio.write(folder / "metres.stl", small, binary=True)
    np.save(folder / "short.npy", FIELD[:4])
    np.save(folder / "zero.npy", np.where(np.arange(COUNT)[:, None] == 7, 0.0, FIELD))
    (folder / "text.npy").write_text("x")
    (folder / "two.csv").write_text("x,y\n1,2\n")
    with pytest.raises(InputError, match=expected):
        read_case(folder)


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("contact:nodes=top,surface=no.stl", "surface: no.stl: no such file"),
        ("fibres:stiffness=3,field=no.csv", "field: no.csv: no such file"),
        ("fibres:stiffness=3,field=V9", "field: the mesh has no array of directions 'V9'"),
    ],
)
def test_what_is_wrong_on_the_command_line_names_file_and_key(tmp_path, said, expected):
    with pytest.raises(InputError) as error:
        assume(read_case(write_folder(tmp_path)), said)
    assert expected in str(error.value)


def test_a_head_that_is_turned(tmp_path):
    axis = ('"RAS"', '"LPS"\ngravity_axis = [0, 0, -1]')
    text = 'kind = "gravity"\ncsf_level = 10.0\ndirection = [0, 1, -1]'
    case = read_case(with_mechanism(tmp_path / "a", text, axis))
    (gravity,) = case.mechanisms
    assert isinstance(gravity, Gravity)
    assert (gravity.direction, gravity.imaged_direction) == ((0.0, -1.0, -1.0), (0.0, 0.0, -1.0))
    assert "45.0 degrees from where it was while imaged" in gravity.detail()
    # levels are counted from the lowest point in the pose of the surgery
    assert gravity.lowest == pytest.approx((case.mesh.points @ [0.0, 1.0, 1.0]).min() / np.sqrt(2.0))
    # without an axis of the case, and imaged in another pose
    free = read_case(write_folder(tmp_path / "b"))
    (said,) = assume(free, "gravity:level=10,direction=0/0/-1").mechanisms
    assert "degrees" not in said.detail() and said.direction == (0.0, 0.0, -1.0)
    (said,) = assume(free, "gravity:level=10,direction=0/0/-1,imaged_direction=0/-1/0").mechanisms
    assert "90.0 degrees" in said.detail()
    with pytest.raises(InputError, match=r"direction: found .*not all zero"):
        assume(free, "gravity:level=10,direction=0/0/0")


WALL = '[[mechanism]]\nkind = "pressure"\nnodes = "{name}"\nvalue = 30.0\n\n'


@pytest.mark.parametrize(
    "text",
    [
        '{resection}[[mechanism]]\nkind = "pressure"\nnodes = "{name}"\nvalue = 30.0\n',
        # in any order
        '[[mechanism]]\nkind = "pressure"\nnodes = "{name}"\nvalue = 30.0\n{resection}',
        '{resection}[[boundary]]\nname = "fluid"\nkind = "pressure"\nnodes = "{name}"\nvalue = 30.0\n',
        # what users chose themselves
        '{resection}[[boundary]]\nname = "fluid"\nkind = "pressure"\nnodes = "margin"\nvalue = 30.0\n',
        '{resection}[[mechanism]]\nkind = "pressure"\nnodes = "margin"\nvalue = 30.0\n',
    ],
)
def test_the_wall_of_a_resection_can_be_pressed(tmp_path, text):
    resection = '[[mechanism]]\nkind = "resection"\nelements = "corner"\n'
    folder = write_folder(tmp_path, ("[body]", text.format(resection=resection, name="corner") + "\n[body]"))
    margin = wall_nodes(block(), "corner")
    add_arrays(folder, margin=margin.astype(np.uint8))
    case = read_case(folder)
    model = model_of(case)
    (pressure,) = model.mechanisms
    assert isinstance(pressure, Pressure)
    faces = pressure.faces(model.mesh)
    expected = 3.0 * (0.5 * SIDE) ** 2
    assert np.linalg.norm(face_vectors(model.mesh.points, faces), axis=1).sum() == pytest.approx(expected)
    # and on a mesh of half the size
    finer = model_of(FinerCase(case).case)
    finer_faces = pressure.faces(finer.mesh)
    assert np.linalg.norm(face_vectors(finer.mesh.points, finer_faces), axis=1).sum() == pytest.approx(expected)


def test_the_wall_of_a_resection_can_be_pressed_from_the_command_line(tmp_path):
    case = read_case(write_folder(tmp_path / "case"))
    without = assume(case, "resection:elements=stiff")
    pressed = assume(without, "pressure:nodes=stiff,value=30")
    model = model_of(pressed)
    faces = pressed.mechanisms[-1].faces(model.mesh)
    assert np.linalg.norm(face_vectors(model.mesh.points, faces), axis=1).sum() == pytest.approx(SIDE**2)
    # it is written and read again
    write_case(tmp_path / "again", pressed)
    again = model_of(read_case(tmp_path / "again"))
    assert len(again.mechanisms[-1].faces(again.mesh)) == len(faces)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (WALL.format(name="corner"), "once that is taken out by a resection"),
        (WALL.format(name="nowhere"), "the mesh has no node set 'nowhere'"),
        ('[[boundary]]\nname = "a"\nkind = "pressure"\nnodes = "corner"\nvalue = 1.0\n', "take out 'corner'"),
        ('[[boundary]]\nname = "a"\nkind = "sliding"\nnodes = "middle"\n', "holds no face of the surface"),
    ],
)
def test_a_wall_of_what_is_still_there_is_none(tmp_path, text, expected):
    folder = write_folder(tmp_path, ("[body]", text + "\n[body]"))
    add_arrays(folder, middle=np.all(np.abs(block().points - 0.5 * SIDE) < 1e-9, axis=1).astype(np.uint8))
    with pytest.raises(InputError, match=expected):
        read_case(folder)
