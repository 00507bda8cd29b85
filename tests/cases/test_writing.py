"""A case that is written reads back as the same case, whatever its units and axes."""

import re
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from folders import write_recorded
from same_case import assert_same

from warpbrain.cases.boundary import Displaced
from warpbrain.cases.reading import read_case
from warpbrain.cases.shipped import SHIPPED, find_case
from warpbrain.cases.writing import write_case
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.mesh.vtu import read_vtu

EVERYTHING = [
    ('axes = "RAS"', 'axes = "LPS"\ngravity_axis = [0.5, 1.0, 0.25]\nregistration = { mm = 2.5, degrees = 0.7 }'),
    ("mu = 1000.0", 'mu = "prior"\nprior = "hyperelastic/grey matter"'),
    ("mu = 3000.0", 'model = "ogden"\nmu = [100.0, -50.0]\nalpha = [2.0, -4.7]\nformulation = "uncoupled"'),
    (
        'kind = "force"\ntotal = [0.01, 0.02, -0.05]',
        'kind = "force"\ntotal = [0.01, 0.02, -0.05]\nmass = 0.004\nramp = [[0.0, 0.0], [0.05, 1.0]]\n'
        '[[boundary]]\nname = "pull/1"\nnodes = "corner"\nkind = "displacement"\nvalue = "pull.csv"\n'
        '[[boundary]]\nname = "pull 2"\nnodes = "corner"\nkind = "displacement"\nvalue = [0.1, 0.2, 0.3]\n'
        '[[boundary]]\nname = "air"\nnodes = "top"\nkind = "pressure"\nvalue = -20.0\nramp = [[0.0, 1.0]]\n'
        '[[boundary]]\nname = "wall"\nnodes = "top"\nkind = "sliding"\n'
        '[[boundary]]\nname = "skull"\nnodes = "top"\nkind = "contact"\nsurface = "skull.stl"\nfriction = 0.1\n'
        '[[mechanism]]\nkind = "gravity"\ncsf_level = 12.0\ndirection = [0.1, 1.0, 0.0]\n'
        '[[mechanism]]\nkind = "contact"\nnodes = "top"\nsurface = "skull.stl"\n'
        '[[mechanism]]\nkind = "fibres"\nfield = "fibres.csv"\nstiffness = 300.0\n'
        '[[mechanism]]\nkind = "residual-stress"\ntension = 50.0\ndirection = [1, 0, 0]\nelements = "soft"\n'
        '[[mechanism]]\nkind = "resection"\nelements = "corner"',
    ),
]


def everything(folder: Path) -> Path:
    """A folder with every kind of boundary, mechanism and recording, in LPS."""
    write_recorded(folder, *EVERYTHING[:3])
    text = (folder / "case.toml").read_text()
    old, new = EVERYTHING[3]
    assert old in text
    # two displacements of the same nodes would contradict each other
    new = new.replace('name = "pull 2"\nnodes = "corner"', 'name = "pull 2"\nnodes = "tip"')
    (folder / "case.toml").write_text(text.replace(old, new))
    (folder / "pull.csv").write_text("t,ux,uy,uz\n0,0,0,0\n1.5,0.1,0.2,-0.3\n")
    corners = np.array([[0, 0, 0], [90, 0, 0], [0, 90, 0], [0, 0, 90]]) - 20.0
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    meshio.write(folder / "skull.stl", meshio.Mesh(corners, [("triangle", faces)]), binary=True)
    raw = read_vtu(folder / "mesh.vtu")
    rows = "".join(f"{number},1,-2\n" for number in range(len(raw.cells[0].data)))
    (folder / "fibres.csv").write_text("x,y,z\n" + rows)
    raw.points[:, :2] *= -1.0
    loose = np.flatnonzero(raw.points[:, 2] > 0.0)
    nodes = np.arange(len(raw.points))
    raw.point_data |= {"corner": (nodes == loose[0]).astype(np.uint8), "tip": (nodes == loose[5]).astype(np.uint8)}
    meshio.write(folder / "mesh.vtu", raw)
    for name in ("beads", "lid"):
        path = folder / f"recordings/{name}.csv"
        flipped = re.sub(r"(?m)^((?:\w,)?)(\d+),(\d+),", r"\1-\2,-\3,", path.read_text())
        path.write_text(flipped)
    return folder


def test_everything_comes_back(tmp_path):
    case = read_case(everything(tmp_path / "a"))
    assert len(case.boundaries) == 7 and len(case.mechanisms) == 5 and len(case.recordings) == 3
    again = read_case(write_case(tmp_path / "b", case).parent)
    assert_same(case, again)
    # and once more, in other units and axes
    other = read_case(write_case(tmp_path / "c", replace(again, frame=Frame("m", "RAS"))))
    assert_same(replace(case, frame=Frame("m", "RAS")), other)


#: Shipped cases that differ by what their files hold; those beside them differ by its numbers.
OF_A_KIND = ("0529", "phantom", "resect-01", "beam-52g")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in OF_A_KIND else [pytest.mark.slow(1)]) for name in SHIPPED]
)
def test_shipped_cases_come_back(tmp_path, name):
    case = find_case(name, "single")
    assert_same(case, read_case(write_case(tmp_path, case)))


def test_nothing_is_overwritten(tmp_path):
    folder = write_recorded(tmp_path)
    before = (folder / "case.toml").read_bytes()
    with pytest.raises(InputError, match=r"case\.toml: there is a case already"):
        write_case(folder, read_case(folder))
    assert (folder / "case.toml").read_bytes() == before


def test_names_that_make_one_file_name_do_not_share_a_file(tmp_path):
    folder = write_recorded(tmp_path / "a")
    case = read_case(folder)
    beads = case.recordings[0]
    pulls = [
        Displaced(name=name, nodes=nodes, times=(0.0, 1.0), values=((0.0, 0.0, 0.0), (size, 0.0, 0.0)))
        for name, nodes, size in (("b b", "bottom", 1e-3), ("b-b", "top", 2e-3), ("B b", "top", 2e-3))
    ]
    recordings = tuple(replace(beads, name=name, points=beads.points * k) for name, k in (("x y", 1.0), ("X-y", 0.5)))
    case = replace(case, boundaries=tuple(pulls), recordings=recordings)
    assert_same(case, read_case(write_case(tmp_path / "b", case)))
