"""Recordings as files that tests write, and reading them back."""

from pathlib import Path
from typing import Any

from warpbrain.frame import Frame
from warpbrain.problems import Problems
from warpbrain.recordings.recording import RECORDINGS, Recording

#: What each reader is told beside file and frame.
KEYS: dict[str, dict[str, Any]] = {
    "points": {"outside": "error"},
    "surface": {"nodes": "cavity"},
    "force": {"boundary": "grip"},
    "test": {"mode": "axial"},
}


def read(kind: str, path: Path, frame: Frame | None = None, **keys: Any) -> tuple[Recording | None, Problems]:
    problems = Problems()
    common = {"name": "r", "file": path.name, "role": "fit", "sigma": None} | KEYS[kind] | keys
    return RECORDINGS[kind].read(path, frame or Frame(), problems, **common), problems


def read_content(kind: str, path: Path, content: str, frame: Frame | None = None, **keys: Any) -> tuple[Any, Problems]:
    path.write_text(content, encoding="utf-8")
    return read(kind, path, frame, **keys)


def messages(problems: Problems) -> str:
    return "\n".join(str(problem) for problem in problems.found)
