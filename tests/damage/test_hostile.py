"""Files that were made to do harm, or to take all memory and time: refused, with a reason, and at little cost."""

import io
import os
import pickle
import resource
import struct
import zipfile
import zlib
from pathlib import Path

import meshio
import numpy as np
import pytest
from folders import block, changed, write_folder, write_recorded
from recording_files import messages, read
from shapes import box

from warpbrain.cases.checking import check_case
from warpbrain.cases.parts.named import read_directions
from warpbrain.cases.reading import read_case
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.mesh import MeshError, read_mesh
from warpbrain.problems import Problems

#: What a file that is refused may take [MB] beyond what was taken before.
LITTLE = 300.0
BILLIONS = 4_000_000_000


@pytest.fixture(autouse=True)
def little_memory():
    """The most that this process ever had grows by little."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    yield
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before < LITTLE


def refusal(folder) -> str:
    with pytest.raises(InputError) as caught:
        read_case(folder)
    return str(caught.value)


# counters and sizes


def test_a_binary_stl_with_a_counter_of_billions(tmp_path):
    (tmp_path / "s.stl").write_bytes(b"\0" * 80 + struct.pack("<I", BILLIONS) + b"\0" * 500)
    recording, problems = read("surface", tmp_path / "s.stl")
    assert recording is None
    assert "its header says 4000000000 triangles, its bytes are 10" in messages(problems)


@pytest.mark.parametrize("ending", ["stl", "ply", "vtp", "obj"])
def test_a_sparse_file_of_gigabytes(tmp_path, ending):
    file = tmp_path / f"s.{ending}"
    with file.open("wb") as stream:
        stream.write(b"solid x\n")
        stream.truncate(4 << 30)
    recording, problems = read("surface", file)
    assert recording is None
    assert "found 4295 MB, expected a surface of at most 537 MB" in messages(problems)


HEADS = {
    "s.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 9\nproperty list uchar int vertex_indices\nend_header\n" + bytes(1000),
    "s.off": b"OFF\n4000000000 4000000000 0\n1 2 3\n",
    "s.vtk": b"# vtk DataFile Version 3.0\nx\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4000000000 double\n"
    + bytes(99),
}


@pytest.mark.parametrize("name", HEADS)
def test_surfaces_with_a_counter_of_billions(tmp_path, name):
    (tmp_path / name).write_bytes(HEADS[name])
    recording, problems = read("surface", tmp_path / name)
    assert recording is None
    assert "found no surface mesh" in messages(problems)


MESHES = {
    "m.msh": b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 4000000000 1 4000000000\n3 1 0 4000000000\n1 2 3\n",
    "old.msh": b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4000000000\n1 0 0 0\n",
    "m.vtk": b"# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 4000 4000 4000\n"
    b"ORIGIN 0 0 0\nSPACING 1 1 1\n",
}


@pytest.mark.parametrize("name", MESHES)
def test_meshes_with_a_counter_of_billions(tmp_path, name):
    (tmp_path / name).write_bytes(MESHES[name])
    with pytest.raises(MeshError, match=r"not a mesh that meshio can read \(needs more than 1.1 GB of memory"):
        read_mesh(tmp_path / name)


@pytest.mark.parametrize("ending", ["dat", "tec", "mdpa", "off", "ply"])
def test_formats_that_meshio_reads_for_ever(tmp_path, monkeypatch, ending):
    """Cut off in the middle; the limit is 8 s of computing for a small file, and shorter here."""
    from warpbrain.mesh import patience

    assert patience.SECONDS + patience.SECONDS_PER_MEGABYTE * 0.1 < 10.0
    monkeypatch.setattr(patience, "SECONDS", 0.3)
    mesh = box((2, 2, 2), (0.1, 0.1, 0.1))
    cells = ("triangle", mesh.tetrahedra[:, :3]) if ending in ("off", "ply") else ("tetra", mesh.tetrahedra)
    file = tmp_path / f"m.{ending}"
    meshio.write(file, meshio.Mesh(mesh.points, [cells]))
    content = file.read_bytes()
    for share in (0.02, 0.5, 0.9):
        file.write_bytes(content[: int(share * len(content))])
        with pytest.raises(MeshError, match=f"m.{ending}: "):
            read_mesh(file)


# arrays of NumPy


def with_field(folder: Path, content: bytes) -> Path:
    mechanism = '[[mechanism]]\nkind = "fibres"\nstiffness = 300.0\nfield = "f.npy"\n\n[body]'
    write_folder(folder, ("[body]", mechanism))
    (folder / "f.npy").write_bytes(content)
    return folder


def npy(array) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def test_a_header_of_random_bytes(tmp_path):
    """NumPy hands it to Python's tokenizer, which raises what it likes."""
    rng = np.random.default_rng(0)
    mesh, file = block(), tmp_path / "f.npy"
    whole = npy(np.ones((48, 3)))
    for _ in range(300):
        content = bytearray(whole)
        at = int(rng.integers(8, 100))
        content[at : at + 20] = rng.bytes(20)
        file.write_bytes(content)
        problems = Problems()
        assert (read_directions(file, mesh, Frame(), problems) is None) == bool(problems)
    assert "f.npy: not an array of NumPy" in refusal(with_field(tmp_path, whole[:12] + b"{'(" + whole[15:]))


def test_an_array_of_billions(tmp_path):
    head = npy(np.ones((48, 3))).replace(b"(48, 3), }", b"(4000000000, 3), }"[:18])
    assert "f.npy: not an array of NumPy" in refusal(with_field(tmp_path, head))


class Harm:
    """What would be run if a pickle were read."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __reduce__(self):
        return (os.mkdir, (str(self.file),))


def test_pickles_are_not_read(tmp_path):
    harm = tmp_path / "harm"
    for content in (npy(np.array([Harm(harm)], dtype=object)), pickle.dumps(Harm(harm))):
        assert "f.npy: not an array of NumPy" in refusal(with_field(tmp_path / "case", content))
        assert not harm.exists()


def test_a_zip_in_the_place_of_an_array(tmp_path):
    """An .npz under the name of an .npy, with a member that grows a thousand times."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", npy(np.zeros((1_000_000, 3))))
    assert "f.npy: expected one array of real numbers" in refusal(with_field(tmp_path, stream.getvalue()))


# XML


BOMB = '<!DOCTYPE x [<!ENTITY a0 "ha">' + "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12)) + "]>"
EXTERNAL = '<!DOCTYPE x [<!ENTITY a11 SYSTEM "file://{}">]>'


@pytest.mark.parametrize("kind", ["bomb", "external"])
@pytest.mark.parametrize("ending", ["vtu", "vtp", "xdmf"])
def test_entities_are_not_expanded(tmp_path, kind, ending):
    secret = tmp_path / "secret.txt"
    secret.write_text("1 2 3 4 5 6 7 8 9")
    head = BOMB if kind == "bomb" else EXTERNAL.format(secret)
    tag = {"vtu": "UnstructuredGrid", "vtp": "PolyData", "xdmf": "Domain"}[ending]
    root = "Xdmf" if ending == "xdmf" else "VTKFile"
    text = (
        f'<?xml version="1.0"?>{head}<{root} type="{tag}" version="3.0"><{tag}><Piece NumberOfPoints="3" '
        'NumberOfCells="1"><Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">&a11;</DataArray>'
        f"</Points></Piece></{tag}></{root}>"
    )
    file = tmp_path / f"s.{ending}"
    file.write_text(text)
    recording, problems = read("surface", file)
    assert recording is None
    assert "found no surface mesh" in messages(problems)
    assert "4 5 6" not in messages(problems)


def bomb_vtp(blocks: int) -> bytes:
    """Points that are a thousand times larger than the file."""
    size = 1 << 24
    packed = zlib.compress(bytes(size), 9)
    head = struct.pack(f"<{3 + blocks}I", blocks, size, 0, *[len(packed)] * blocks)
    text = (
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" byte_order="LittleEndian" header_type="UInt32" '
        'compressor="vtkZLibDataCompressor"><PolyData><Piece><Points><DataArray type="Float64" Name="Points" '
        'NumberOfComponents="3" format="appended" offset="0"/></Points></Piece></PolyData>'
    )
    return text.encode() + b'<AppendedData encoding="raw">_' + head + packed * blocks + b"\n</AppendedData></VTKFile>"


def test_compressed_blocks_that_grow_a_thousand_times(tmp_path):
    """A file of 1 MB with points of 1 GB."""
    (tmp_path / "s.vtp").write_bytes(bomb_vtp(64))
    recording, problems = read("surface", tmp_path / "s.vtp")
    assert recording is None
    assert "an array of 64 blocks of 16777216 bytes is larger than 537 MB" in messages(problems)


# paths


@pytest.mark.parametrize("path", ["../mesh.vtu", "/etc/passwd", "a/../../mesh.vtu", "..\\\\mesh.vtu", "~/mesh.vtu"])
def test_paths_stay_in_the_folder(tmp_path, path):
    write_folder(tmp_path / "case", ('"mesh.vtu"', f'"{path}"'))
    (tmp_path / "mesh.vtu").write_bytes((tmp_path / "case" / "mesh.vtu").read_bytes())
    message = refusal(tmp_path / "case")
    assert "leaves the case folder" in message or "no such file" in message


def test_a_link_out_of_the_folder_is_refused(tmp_path):
    write_folder(tmp_path / "case")
    (tmp_path / "case" / "mesh.vtu").rename(tmp_path / "mesh.vtu")
    (tmp_path / "case" / "mesh.vtu").symlink_to(tmp_path / "mesh.vtu")
    assert "'mesh.vtu' leaves the case folder" in refusal(tmp_path / "case")


def test_an_abaqus_file_includes_no_other(tmp_path):
    write_folder(tmp_path / "case", ('"mesh.vtu"', '"mesh.inp"'))
    (tmp_path / "case" / "mesh.inp").write_text("*INCLUDE, INPUT=/etc/passwd\n")
    assert "*INCLUDE: one file is read" in refusal(tmp_path / "case")


@pytest.mark.parametrize("name", ["../out.bin", "/etc/passwd"])
def test_an_xdmf_file_reads_no_other_folder(tmp_path, name):
    text = (
        '<Xdmf Version="3.0"><Domain><Grid><Geometry GeometryType="XYZ"><DataItem DataType="Float" Dimensions="4 3" '
        f'Format="Binary" Precision="8">{name}</DataItem></Geometry></Grid></Domain></Xdmf>'
    )
    write_folder(tmp_path / "case", ('"mesh.vtu"', '"mesh.xdmf"'))
    (tmp_path / "case" / "mesh.xdmf").write_text(text)
    (tmp_path / "out.bin").write_bytes(bytes(96))
    assert f"names '{name}', which leaves its folder" in refusal(tmp_path / "case")


# text


def test_a_list_of_nodes_that_ends_in_a_number_is_remarked_on(tmp_path):
    """`... 2` for `... 26` is a node too."""
    write_folder(tmp_path, ('nodes = "bottom"', 'nodes = "ids.csv"'))
    ids = "0\n1\n2\n3\n4\n5\n6\n7\n8\n"
    (tmp_path / "ids.csv").write_text(ids + "26\n")
    assert read_case(tmp_path).remarks == ()
    (tmp_path / "ids.csv").write_text(ids + "2")
    [remark] = read_case(tmp_path).remarks
    assert remark.endswith("ids.csv: the last row does not end with a line break: is the file cut off?")


def test_a_mesh_that_ends_in_a_number_is_remarked_on(tmp_path):
    write_folder(tmp_path, ('"mesh.vtu"', '"mesh.vtk"'), ('nodes = "bottom"', 'nodes = "ids.csv"'))
    text = (tmp_path / "case.toml").read_text()
    (tmp_path / "case.toml").write_text(text.split('[[boundary]]\nname = "press"')[0])
    (tmp_path / "ids.csv").write_text("0\n1\n2\n3\n")
    mesh = read_mesh(tmp_path / "mesh.vtu", "mm")
    raw = meshio.Mesh(1000.0 * mesh.points, [("tetra", mesh.tetrahedra)], cell_data={"tissue": [mesh.tissue]})
    meshio.write(tmp_path / "mesh.vtk", raw, binary=False)
    content = (tmp_path / "mesh.vtk").read_bytes().rstrip()
    (tmp_path / "mesh.vtk").write_bytes(content + b"\n")
    assert read_case(tmp_path).remarks == ()
    (tmp_path / "mesh.vtk").write_bytes(content)
    assert any("ends in a number without a line break" in remark for remark in read_case(tmp_path).remarks)


@pytest.mark.parametrize("marks", [1, 2, 3])
def test_byte_order_marks_hide_no_column(tmp_path, marks):
    """The second one made the first column an unknown one: here the times."""
    mark = b"\xef\xbb\xbf" * marks
    content = b"t,x,y,z,ux,uy,uz\n0,10,10,10,0,0,0\n1,10,10,10,0,0,0.1\n"
    folder = write_recorded(tmp_path, files={"recordings/beads.csv": mark + content})
    (folder / "case.toml").write_bytes(mark + (folder / "case.toml").read_bytes())
    case = read_case(folder)
    np.testing.assert_array_equal(case.recordings[0].time, [0.0, 1.0])
    assert not any("ignores column" in remark for remark in case.remarks)


def test_reading_stops_in_a_file_of_a_million_mistakes(tmp_path):
    (tmp_path / "t.csv").write_text("x,y,z,ux,uy,uz\n" + "a,b,c,d,e,f\n" * 200_000)
    _, problems = read("points", tmp_path / "t.csv")
    assert len(problems.found) == 21
    assert problems.found[-1].message.startswith("and more than 1980 more problems in this file, whose reading stopped")


def test_names_without_an_end_are_shortened(tmp_path):
    write_folder(tmp_path)
    text = (tmp_path / "case.toml").read_text()
    (tmp_path / "case.toml").write_text(changed(text, ("poisson", "p" * 100_000)))
    assert max(len(str(problem)) for problem in check_case(tmp_path).problems) < 1500
