"""Arrays in a file with a checksum of all of them: what a disk or a transfer damaged is never read as numbers.

A ZIP archive has a CRC-32 of each member, and none of its directory, of names, or of what was swapped for another file.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Name of the checksum among the arrays.
_NAME = "sha256"


class ArraysError(Exception):
    """A file is not what was written; says why."""


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays as `.npz` with their checksum."""
    with path.open("wb") as stream:
        members: dict[str, Any] = {**arrays, _NAME: np.array(_digest(arrays))}
        np.savez(stream, **members)


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read what `write_arrays` wrote.

    Raises
    ------
    ArraysError
        If anything of it has changed, or it is no such file.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = dict(stored)
        checksum = str(arrays.pop(_NAME))
    # what NumPy and zipfile raise for bytes that are nonsense is their secret
    except Exception as error:
        raise ArraysError(f"cannot be read: {' '.join(str(error).split())[:200]}") from None
    if checksum != _digest(arrays):
        raise ArraysError("its checksum is another one")
    return arrays


def checksum_of(said: Any) -> str:
    """SHA-256 of plain values, whatever the order of their keys."""
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()


def _digest(arrays: Mapping[str, NDArray[Any]]) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape};".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
