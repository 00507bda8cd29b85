"""Sealing: a truth is written once, its SHA-256 is published, and nobody can change it afterwards unseen."""

from __future__ import annotations

import gzip
import hashlib
import json
import secrets
from pathlib import Path
from typing import Any

#: Bytes of salt: with them nobody can find a truth by hashing guesses.
SALT = 32


def sealed(truth: dict[str, Any]) -> bytes:
    """Canonical bytes of a truth with a fresh salt: JSON, keys sorted, no blanks, ASCII, no NaN."""
    if "salt" in truth:
        raise ValueError("this truth has been sealed before")
    return canonical({**truth, "salt": secrets.token_hex(SALT)})


def canonical(truth: dict[str, Any]) -> bytes:
    """The one way to write a truth."""
    return json.dumps(truth, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False).encode("ascii")


def fingerprint(data: bytes) -> str:
    """SHA-256 of sealed bytes, 64 hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def write_sealed(file: Path, data: bytes) -> None:
    """Store sealed bytes compressed: the same bytes give the same file, whenever written."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(gzip.compress(data, compresslevel=9, mtime=0))


def read_sealed(file: Path) -> bytes:
    """Sealed bytes as they were hashed."""
    return gzip.decompress(file.read_bytes())


def open_sealed(data: bytes) -> dict[str, Any]:
    """The truth in sealed bytes.

    Raises
    ------
    ValueError
        If the bytes are not canonical or hold no salt of the right length.
    """
    truth: dict[str, Any] = json.loads(data)
    if canonical(truth) != data or len(str(truth.get("salt", ""))) != 2 * SALT:
        raise ValueError("not a sealed truth")
    return truth
