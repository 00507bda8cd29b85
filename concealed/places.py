"""Where things are kept: what is published, what is sealed, and fine meshes outside the repository."""

from __future__ import annotations

import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CASES = ROOT / "warpbrain" / "cases" / "data"
#: Fine meshes, kept from one command to the next.
MESHES = Path(tempfile.gettempdir()) / "warpbrain-truth-meshes"


def truth_file(name: str) -> Path:
    """The sealed truth of a case."""
    return ROOT / "concealed" / "truth" / f"{name}.json.gz"


def published_hash(name: str) -> str:
    """SHA-256 that was published with a case."""
    return (CASES / name / "truth.sha256").read_text(encoding="utf-8").split()[0]
