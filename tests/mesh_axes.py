"""The axes that a VTU file says, by 3D Slicer's rule."""

import xml.etree.ElementTree as XML
from pathlib import Path


def space_of(path: Path) -> str:
    """The value of the text array `SPACE` in the field data of the grid, decoded as VTK does."""
    field = XML.parse(path).getroot().find("./UnstructuredGrid/FieldData")
    arrays = [array for array in field if array.get("Name") == "SPACE" and array.get("type") == "String"]
    assert len(arrays) == 1
    assert arrays[0].tag == "Array"
    assert arrays[0].get("NumberOfTuples") == "1"
    codes = [int(code) for code in arrays[0].text.split()]
    assert codes[-1] == 0
    return bytes(codes[:-1]).decode()
