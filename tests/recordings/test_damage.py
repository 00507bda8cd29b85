"""Damaged files of every kind: whatever is in them, it is read or it is a problem, and never an exception."""

import meshio
import numpy as np
import pytest
from damage.kinds import KINDS
from landmark_files import START, TAG, fcsv, markup
from recording_files import messages, read
from surface_files import POINTS, TRIANGLES, vtp

FILES = {
    "points.csv": b"x,y,z,ux,uy,uz,t,id,sigma,weight\n1,2,3,4,5,6,0,a,1,1\n1,2,3,4,5,6,1,a,1,1\n",
    "points.tag": TAG.encode(),
    "points.mrk.json": markup(*START).encode(),
    "points.fcsv": fcsv(*START).encode(),
    "force.csv": b"t,fx,fy,fz,torque\n0,1,2,3,4\n1,1,2,3,4\n",
    "test.csv": b't,stretch,stress,"note"\n0,1,2,"a"\n1,1,2,b\n',
    "surface.csv": b"x,y,z,nx,ny,nz,t\n1,2,3,0,0,1,0\n1,2,3,0,0,1,0\n",
    "surface.vtp": vtp("appended", "raw", "vtkZLibDataCompressor"),
}


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    return KINDS[rng.integers(len(KINDS))](content, rng)


def check(file, kind, **keys):
    recording, problems = read(kind, file, **keys)
    assert (recording is None) == bool(problems)
    assert all(len(problem.message) < 250 for problem in problems.found), messages(problems)


@pytest.mark.parametrize("name", FILES)
def test_damaged_files(tmp_path, name):
    rng = np.random.default_rng(len(name))
    kind, _, ending = name.partition(".")
    file = tmp_path / name
    keys = {}
    if ending in ("mrk.json", "fcsv"):
        keys["moved"] = tmp_path / f"moved.{ending}"
        keys["moved"].write_bytes(FILES[name])
    for _ in range(300):
        file.write_bytes(damaged(FILES[name], rng))
        check(file, kind, **keys)


@pytest.mark.parametrize("ending", ["stl", "ply", "obj", "off", "vtu", "vtk"])
def test_damaged_meshes(tmp_path, capsys, ending):
    rng = np.random.default_rng(0)
    file = tmp_path / f"surface.{ending}"
    meshio.write(file, meshio.Mesh(POINTS, [("triangle", TRIANGLES)]))
    content = file.read_bytes()
    capsys.readouterr()  # what the writer says
    for _ in range(60):
        file.write_bytes(damaged(content, rng))
        check(file, "surface")
    assert capsys.readouterr().err == ""
