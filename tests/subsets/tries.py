"""One try: a shipped case with some of its recordings is diagnosed, and how that ended is judged."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from warpbrain.cases.shipped import SHIPPED, find_case
from warpbrain.cases.writing import write_case
from warpbrain.recordings.recording import Recording

TISSUES = ("single", "multi")
#: Each is read once, for all of its subsets.
case_of = cache(find_case)


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


def every_subset() -> list[tuple[str, str, tuple[Recording, ...]]]:
    """Name of a shipped case, tissue, and some of its recordings; those that take longest first."""
    found = [
        (name, tissue, some)
        for name in SHIPPED
        for tissue in TISSUES
        for some in subsets(case_of(name, tissue).recordings)
    ]
    return sorted(found, key=lambda entry: -len(entry[2]))


def one_try(name: str, tissue: str, recordings: tuple[Recording, ...], options: Sequence[str] = ()) -> Ended:
    """Diagnose a shipped case with some of its recordings, as a user would: in a process of its own.

    Without PyVista, as on compute servers, pictures are stood in for.
    """
    case = replace(case_of(name, tissue), recordings=recordings)
    with tempfile.TemporaryDirectory() as place:
        write_case(Path(place) / "case", case)
        out = Path(place) / "out"
        program = "warpbrain" if find_spec("pyvista") else "not_drawn"
        command = [sys.executable, "-m", program, "diagnose", "--case", "case", "--out", str(out), "--quiet"]
        # paths that this process was given may be relative to where it began
        searched = os.pathsep.join(map(os.path.abspath, sys.path))
        began = time.perf_counter()
        ran = subprocess.run(
            [*command, "--device", "cpu", *options],
            cwd=place, env={**os.environ, "PYTHONPATH": searched}, capture_output=True, text=True, check=False,
        )  # fmt: skip
        known = name, tissue, tuple(recording.name for recording in recordings), time.perf_counter() - began
        errors = [line for line in ran.stderr.splitlines() if not line.startswith("Warp CUDA warning")]
        if ran.returncode == 0 and (out / "diagnosis.json").exists() and not errors:
            return Ended(*known, verdict=str(json.loads((out / "diagnosis.json").read_text())["verdict"]))
        if ran.returncode in (1, 2) and len(errors) == 1 and not out.exists():
            return Ended(*known, refused=errors[0])
        return Ended(*known, defect=f"status {ran.returncode}: {ran.stderr[-2000:]}")
