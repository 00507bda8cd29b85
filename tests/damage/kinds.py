"""Ways in which files are damaged: by a disk, a transfer, an editor, a spreadsheet, another program, or on purpose."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
#: What stands in the place of a number.
_NUMBERS = (
    b"nan",
    b"inf",
    b"-1",
    b"0",
    b"1e308",
    b"-1e-320",
    b"99999999999999999999",
    b"0x10",
    b"1_0",
    b"1,5",
    b"",
    b"--",
)
#: Bytes that mean something to some format.
_BYTES = b'\x00\n\r\t ,;"#%=[]{}<>/-.0e9x\xff'


def cut_off(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: rng.integers(len(content) + 1)]


def piece_gone(content: bytes, rng: np.random.Generator) -> bytes:
    at, to = sorted(rng.integers(0, len(content) + 1, 2))
    return content[:at] + content[to:]


def piece_doubled(content: bytes, rng: np.random.Generator) -> bytes:
    at, to = sorted(rng.integers(0, len(content) + 1, 2))
    return content[:to] + content[at:]


def bytes_changed(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for place in rng.integers(0, len(content), rng.integers(1, 5)) if content else ():
        changed[place] = rng.choice(list(_BYTES))
    return bytes(changed)


def bit_flipped(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    if content:
        changed[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def number_changed(content: bytes, rng: np.random.Generator) -> bytes:
    found = list(_NUMBER.finditer(content))
    if not found:
        return content
    one = found[rng.integers(len(found))]
    return content[: one.start()] + _NUMBERS[rng.integers(len(_NUMBERS))] + content[one.end() :]


def number_scaled(content: bytes, rng: np.random.Generator) -> bytes:
    found = list(_NUMBER.finditer(content))
    if not found:
        return content
    one = found[rng.integers(len(found))]
    scaled = float(one.group()) * 10.0 ** rng.integers(-12, 13)
    return content[: one.start()] + repr(scaled).encode() + content[one.end() :]


def lines_mixed(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.splitlines(keepends=True)
    return (
        b"".join(lines[k] for k in rng.integers(0, len(lines), rng.integers(0, 2 * len(lines) + 1))) if lines else b""
    )


def separators_changed(content: bytes, rng: np.random.Generator) -> bytes:
    pairs = ((b",", b";"), (b",", b"\t"), (b".", b","), (b"\n", b"\r"), (b"\n", b"\r\n"), (b"=", b":"), (b'"', b"'"))
    old, new = pairs[rng.integers(len(pairs))]
    return content.replace(old, new)


def marked(content: bytes, rng: np.random.Generator) -> bytes:
    """Byte order marks, one or two, and encodings."""
    text = content.decode("latin-1")
    kinds = (b"\xef\xbb\xbf" + content, b"\xef\xbb\xbf" * 2 + content, text.encode("utf-16"), text.encode("utf-32"))
    return kinds[rng.integers(len(kinds))]


def nonsense(_content: bytes, rng: np.random.Generator) -> bytes:
    return rng.bytes(int(rng.integers(0, 300)))


def header_of_nonsense(content: bytes, rng: np.random.Generator) -> bytes:
    count = int(rng.integers(1, 81))
    return content[:8] + rng.bytes(count) + content[8 + count :]


def repeated(content: bytes, rng: np.random.Generator) -> bytes:
    """A file of which a short piece stands thousands of times."""
    at = int(rng.integers(0, len(content) + 1))
    piece = content[at : at + int(rng.integers(1, 8))]
    return content[:at] + piece * 5000 + content[at:]


KINDS: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    *(cut_off, piece_gone, piece_doubled, bytes_changed, bit_flipped, number_changed, number_scaled, lines_mixed),
    *(separators_changed, marked, nonsense, header_of_nonsense, repeated),
)
