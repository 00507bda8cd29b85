"""One try: a shipped case with some of its recordings is diagnosed, and how that ended is judged."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from warpbrain.cases.shipped import find_case
from warpbrain.cases.writing import write_case
from warpbrain.recordings.recording import Recording

TISSUES = ("single", "multi")


@dataclass(frozen=True)
class Ended:
    """How a diagnosis ended.

    Attributes
    ----------
    case, tissue : str
    recordings : tuple of str
        Names of those that were left.
    seconds : float
    verdict : str
        What it says of what is missing; empty if it gave none.
    refused : str
        The sentence in the place of a verdict.
    defect : str
        What must not be: neither a verdict nor one line that says why there is none.
    """

    case: str
    tissue: str
    recordings: tuple[str, ...]
    seconds: float
    verdict: str = ""
    refused: str = ""
    defect: str = ""

    def __str__(self) -> str:
        names = ", ".join(self.recordings) or "no recordings"
        said = self.defect or self.verdict or self.refused
        return f"{self.case} --tissue {self.tissue}, {names}: {said} ({self.seconds:.0f} s)"


def subsets(recordings: Sequence[Recording]) -> Iterator[tuple[Recording, ...]]:
    """All of them, from all to none."""
    for count in range(len(recordings), -1, -1):
        yield from itertools.combinations(recordings, count)


def one_try(name: str, tissue: str, recordings: tuple[Recording, ...], options: Sequence[str] = ()) -> Ended:
    """Diagnose a shipped case with some of its recordings, as a user would: in a process of its own."""
    case = replace(find_case(name, tissue), recordings=recordings)
    with tempfile.TemporaryDirectory() as place:
        write_case(Path(place) / "case", case)
        out = Path(place) / "out"
        command = [sys.executable, "-m", "warpbrain", "diagnose", "--case", "case", "--out", str(out), "--quiet"]
        began = time.perf_counter()
        ran = subprocess.run([*command, *options], cwd=place, capture_output=True, text=True, check=False)
        known = name, tissue, tuple(recording.name for recording in recordings), time.perf_counter() - began
        errors = [line for line in ran.stderr.splitlines() if not line.startswith("Warp CUDA warning")]
        if ran.returncode == 0 and (out / "diagnosis.json").exists() and not errors:
            return Ended(*known, verdict=str(json.loads((out / "diagnosis.json").read_text())["verdict"]))
        if ran.returncode in (1, 2) and len(errors) == 1 and not out.exists():
            return Ended(*known, refused=errors[0])
        return Ended(*known, defect=f"status {ran.returncode}: {ran.stderr[-2000:]}")
