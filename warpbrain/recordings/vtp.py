"""Triangles of VTK's XML polygonal data (``.vtp``), which meshio does not read.

An array is written as text, as base64 in its place, or appended at the end of the file as base64 or raw bytes; binary
ones start with their length, or are cut into compressed blocks that start with the lengths of all of them.
"""

import base64
import re
from pathlib import Path
from xml.etree import ElementTree as XML

import numpy as np
from numpy.typing import NDArray

from warpbrain.arrays import Floats, Int32s, Ints
from warpbrain.mesh.files import LARGEST_FILE

_TYPES = {f"{kind}{8 * size}": f"{kind[0].lower()}{size}" for kind in ("Int", "UInt") for size in (1, 2, 4, 8)}
_TYPES |= {"Float32": "f4", "Float64": "f8", "String": "i1"}
_APPENDED = re.compile(rb"<AppendedData[^>]*?encoding=\"(\w+)\"[^>]*>\s*_")


def read_vtp(path: Path) -> tuple[Floats, Int32s, str | None]:
    """Points (n, 3), triangles (k, 3) and the axes that the file states (a field ``SPACE``, as Slicer writes it).

    Polygons are cut into fans of triangles, strips into their triangles; vertices and lines are left out.

    `ValueError`: with what is wrong, if it is no such file.
    """
    file = _File(path.read_bytes())
    points: list[Floats] = [np.empty((0, 3))]
    triangles: list[Int32s] = [np.empty((0, 3), dtype=np.int32)]
    first = 0
    for piece in file.root.findall("./PolyData/Piece"):
        array = piece.find("./Points/DataArray")
        if array is None:
            continue
        points.append(file.array(array).astype(np.float64).reshape(-1, 3))
        for kind in ("Polys", "Strips"):
            arrays = {each.get("Name"): each for each in piece.findall(f"./{kind}/DataArray")}
            if {"connectivity", "offsets"} <= set(arrays):
                ids, ends = (file.array(arrays[name]).astype(np.int64) for name in ("connectivity", "offsets"))
                triangles.append((first + _triangles(ids, ends, kind == "Strips")).astype(np.int32))
        first += len(points[-1])
    mark = file.root.find(".//FieldData/Array[@Name='SPACE']")
    axes = None if mark is None else file.array(mark).tobytes().decode("ascii").strip("\0")
    return np.concatenate(points), np.concatenate(triangles), axes


class _File:
    def __init__(self, data: bytes) -> None:
        appended = _APPENDED.search(data)
        self._appended, self._encoding = b"", ""
        if appended:
            end = data.rindex(b"</AppendedData>")
            self._encoding = appended.group(1).decode()
            self._appended = data[appended.end() : end]
            data = data[: appended.end()] + data[end:]
        try:
            self.root = XML.fromstring(data)
        except XML.ParseError as error:
            raise ValueError(f"no valid XML: {error}") from None
        if self.root.tag != "VTKFile" or self.root.get("type") != "PolyData":
            raise ValueError(f"found {self.root.get('type', self.root.tag)}, expected a VTKFile of type PolyData")
        self._order = ">" if self.root.get("byte_order") == "BigEndian" else "<"
        self._header = np.dtype(self._order + _TYPES[self.root.get("header_type", "UInt32")])
        compressor = self.root.get("compressor")
        if compressor not in (None, "vtkZLibDataCompressor", "vtkLZMADataCompressor"):
            raise ValueError(f"found compression by {compressor}, expected none, ZLib or LZMA")
        self._compressor = compressor

    def array(self, element: XML.Element) -> NDArray[np.generic]:
        """Values of an array, in one dimension and in the byte order of this machine."""
        dtype = np.dtype(self._order + _TYPES[element.get("type", "")])
        form = element.get("format", "ascii")
        if form == "ascii":
            return np.array((element.text or "").split(), dtype=np.float64).astype(dtype.newbyteorder("="))
        if form == "appended":
            data, encoding = self._appended[int(element.get("offset", "0")) :], self._encoding
        else:
            data, encoding = (element.text or "").strip().encode(), "base64"
        values = np.frombuffer(self._bytes(data, encoding == "base64"), dtype=dtype)
        return values.astype(dtype.newbyteorder("="))

    def _bytes(self, data: bytes, coded: bool) -> bytes:
        size = self._header.itemsize
        if self._compressor is None:
            length = int(np.frombuffer(_take(data, size, coded), self._header)[0])
            return _take(data, size + length, coded)[size:]
        import lzma
        import zlib

        decompress = zlib.decompress if self._compressor == "vtkZLibDataCompressor" else lzma.decompress
        count, whole = (int(n) for n in np.frombuffer(_take(data, 2 * size, coded), self._header))
        if count * whole > LARGEST_FILE:
            raise ValueError(f"an array of {count} blocks of {whole} bytes is larger than {LARGEST_FILE / 1e6:.0f} MB")
        head = size * (3 + count)
        lengths = np.frombuffer(_take(data, head, coded), self._header)[3:].astype(np.int64)
        # the header is coded by itself, padding and all
        blocks = _take(data[-(-head // 3) * 4 :] if coded else data[head:], int(lengths.sum()), coded)
        ends = np.cumsum(lengths)
        return b"".join(decompress(blocks[end - length : end]) for end, length in zip(ends, lengths, strict=True))


def _take(data: bytes, count: int, coded: bool) -> bytes:
    """The first `count` bytes of what `data` stands for."""
    content = base64.b64decode(data[: -(-count // 3) * 4])[:count] if coded else data[:count]
    if len(content) < count:
        raise ValueError("the file is cut off")
    return content


def _triangles(ids: Ints, ends: Ints, strips: bool) -> Ints:
    """Triangles (k, 3) of fans, or strips, of nodes that end where `ends` says."""
    lengths = np.diff(ends, prepend=0)
    extra = np.maximum(lengths - 2, 0)
    start = np.repeat(ends - lengths, extra)
    step = np.arange(len(start)) - np.repeat(np.cumsum(extra) - extra, extra)
    # every other triangle of a strip is listed the other way round
    odd = step % 2 * strips
    return np.stack([ids[start + step * strips], ids[start + step + 1 + odd], ids[start + step + 2 - odd]], axis=1)
