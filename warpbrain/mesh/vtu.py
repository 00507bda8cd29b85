"""VTU files that say their axes, read and written with meshio.

3D Slicer takes a model whose file does not say its axes for LPS, and left becomes right. What it looks for in a `.vtu`
or `.vtp` is a field of text, `SPACE`, that holds RAS or LPS: `GetCoordinateSystemFromFieldData` of its
`Libs/MRML/Core/vtkMRMLModelStorageNode.cxx`. meshio neither writes nor reads fields of text: they are put in after it
has written, and taken out before it reads.
"""

import re
import tempfile
from pathlib import Path
from typing import Any

_GRID = b"<UnstructuredGrid>"
#: A field of text, and what is left if there is no other.
_TEXT = re.compile(rb"<(Array|DataArray)\b[^>]*\btype=\"String\"[^>]*?(?:/>|>.*?</\1>)", re.DOTALL)
_FIELDS = re.compile(rb"<FieldData\b[^>]*>.*?</FieldData>", re.DOTALL)
#: How far into a file a field of text is looked for [bytes]: it stands before the first piece.
_HEAD = 2**16


def write_vtu(path: Path, mesh: Any, axes: str = "RAS") -> None:
    """Write a `meshio.Mesh` as compressed VTU that says its axes.

    `path`: written in place: see `warpbrain.atomic.whole_file`. `axes` ("RAS" or "LPS"): of its points.
    """
    import meshio

    meshio.write(path, mesh, file_format="vtu", binary=True, compression="zlib")
    codes = " ".join(str(code) for code in (*axes.encode("ascii"), 0))
    field = f'<Array type="String" Name="SPACE" NumberOfTuples="1" format="ascii">\n{codes}\n</Array>'
    data = path.read_bytes()
    path.write_bytes(data.replace(_GRID, _GRID + f"\n<FieldData>\n{field}\n</FieldData>".encode("ascii"), 1))


def read_vtu(path: Path) -> Any:
    """Read a VTU file with meshio, without the fields of text that it has no type for."""
    import meshio

    data = path.read_bytes()
    head, rest = data[:_HEAD], data[_HEAD:]
    plain = _FIELDS.sub(lambda fields: _TEXT.sub(b"", fields.group()), head, count=1)
    if plain == head:
        return meshio.read(path, file_format="vtu")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        copy.write_bytes(plain + rest)
        return meshio.read(copy, file_format="vtu")


def axes_of_vtu(path: Path) -> str | None:
    """The axes that a VTU file says: the text of its field `SPACE`, None without one."""
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
    fields = _FIELDS.search(head)
    for field in _TEXT.finditer(fields.group()) if fields else ():
        if b'Name="SPACE"' in field.group() and b'format="ascii"' in field.group():
            codes = re.sub(rb"<[^>]*>", b"", field.group()).split()
            return bytes(int(code) for code in codes).strip(b"\0").decode("ascii", "replace")
    return None
