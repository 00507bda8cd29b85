"""Words that a shell completes: asked as argcomplete's own scripts ask, by the environment and descriptor 8."""

import os
import shutil
import subprocess
import sys

import pytest

from warpbrain.cases.shipped import SHIPPED
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.terminal.arguments import mechanism_kinds


def completed(line: str) -> set[str]:
    """What the command offers for the end of a line."""
    reader, writer = os.pipe()
    asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_IFS": "\n"}
    code = f"import os, sys; os.dup2({writer}, 8); from warpbrain.cli import main; main([])"
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, env={**os.environ, **asked}, pass_fds=[writer], capture_output=True, timeout=60, check=False
    )
    os.close(writer)
    with os.fdopen(reader) as stream:
        words = stream.read()
    assert done.returncode == 0, done.stderr
    return {word.strip() for word in words.splitlines()}


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("warpbrain d", {"diagnose", "doctor"}),
        ("warpbrain run --case 06", {name for name in SHIPPED if name.startswith("06")}),
        ("warpbrain run --prec", {"--precision"}),
        ("warpbrain run --precision d", {"double"}),
        ("warpbrain run --with gra", {"gravity"}),
        ("warpbrain cases show phantom-", {"phantom-fine", "phantom-loaded"}),
    ],
)
def test_words(line, expected, tmp_path, monkeypatch):
    pytest.importorskip("argcomplete")
    monkeypatch.chdir(tmp_path)
    assert completed(line) == expected


def test_the_code_for_a_shell_is_a_program_of_it():
    pytest.importorskip("argcomplete")
    said = subprocess.run(
        [sys.executable, "-m", "warpbrain", "completion", "bash"], capture_output=True, timeout=60, check=True
    ).stdout
    shell = shutil.which("bash")
    assert shell is not None
    subprocess.run([shell, "-n"], input=said, check=True)


def test_kinds_are_those_that_are_registered():
    assert mechanism_kinds() == sorted(mechanisms())
