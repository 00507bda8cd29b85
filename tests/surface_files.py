"""Surface files as VTK writes them."""

import base64
import lzma
import struct
import zlib

import numpy as np

POINTS = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 5]])


TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


QUAD = np.array([[0, 1, 2, 3]])


def encoded(array: np.ndarray, compressor: str | None, coded: bool) -> bytes:
    """An array as VTK writes it, in blocks of 40 bytes if compressed."""
    data = array.tobytes()
    code = base64.b64encode if coded else bytes
    if compressor is None:
        return code(struct.pack("<I", len(data)) + data)
    compress = {"vtkZLibDataCompressor": zlib.compress, "vtkLZMADataCompressor": lzma.compress}[compressor]
    blocks = [data[at : at + 40] for at in range(0, len(data), 40)]
    packed = [compress(block) for block in blocks]
    head = struct.pack(f"<{3 + len(packed)}I", len(packed), 40, len(data) % 40, *map(len, packed))
    return code(head) + code(b"".join(packed))


def vtp(
    form: str, encoding: str = "base64", compressor: str | None = None, cells: str = "Polys", axes: str = ""
) -> bytes:
    """The quad as a polygon or as a strip."""
    ids = QUAD[0] if cells == "Polys" else QUAD[0][[0, 1, 3, 2]]
    arrays = {
        "Points": (POINTS, "Float64"),
        "connectivity": (ids.astype(np.int32), "Int32"),
        "offsets": (np.array([4], dtype=np.int32), "Int32"),
    }
    tags, appended = {}, b""
    for name, (array, kind) in arrays.items():
        head = f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="3" format="{form}"'
        if form == "ascii":
            tags[name] = f"{head}>{' '.join(map(str, array.ravel()))}</DataArray>"
        elif form == "binary":
            tags[name] = f"{head}>\n{encoded(array, compressor, True).decode()}\n</DataArray>"
        else:
            tags[name] = f'{head} offset="{len(appended)}"/>'
            appended += encoded(array, compressor, encoding == "base64")
    space = '<FieldData><Array type="String" Name="SPACE" format="ascii">76 80 83 0</Array></FieldData>' if axes else ""
    packed = f' compressor="{compressor}"' if compressor else ""
    text = (
        f'<?xml version="1.0"?>\n<VTKFile type="PolyData" byte_order="LittleEndian" header_type="UInt32"{packed}>'
        f"<PolyData>{space}<Piece><Points>{tags['Points']}</Points>"
        f"<{cells}>{tags['connectivity']}{tags['offsets']}</{cells}></Piece></PolyData>"
    ).encode()
    if appended:
        text += f'<AppendedData encoding="{encoding}">_'.encode() + appended + b"\n</AppendedData>"
    return text + b"</VTKFile>"
