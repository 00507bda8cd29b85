"""A defect ends in one line with the path of a report, which has no data; a traceback is shown if it is asked for."""

import re

import numpy as np
import pytest
from command import run, warpbrain
from folders import write_folder

from warpbrain.errors import InputError
from warpbrain.terminal import command
from warpbrain.terminal.command import exit_status
from warpbrain.terminal.record import Record

LINE = re.compile(
    r"warpbrain: a defect of warpbrain, not of your files: (\w+) in ([\w/.]+), line \d+(?:, after '(.*)')?: "
    r"please send (\S+) to its developers; --debug shows the traceback\n"
)


@pytest.fixture
def broken(monkeypatch, tmp_path):
    """A command in which something of ours fails with a patient's numbers in its message."""

    def fail(*_values, **_named):
        secret = np.arange(1000.0)
        raise IndexError(f"{secret.tolist()} is out of range")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("warpbrain.report.files.write_vtu", fail)
    return write_folder(tmp_path / "case")


def test_one_line_and_a_report(broken, tmp_path):
    ran = run(broken, "--out", tmp_path / "out")
    assert ran.status == 70
    found = LINE.fullmatch(ran.err)
    assert found, ran.err
    assert found.group(1) == "IndexError"
    assert found.group(2) == "report/files.py"
    report = (tmp_path / found.group(4)).read_text()
    assert f"command    warpbrain run --device cpu --case {broken} --out {tmp_path / 'out'}" in report
    assert "write_result" in report and "IndexError: [0.0, 1.0, 2.0" in report
    assert re.search(r"^numpy +2\.", report, re.MULTILINE)
    # of the data no more than fits a line
    assert "100.0" not in report
    assert max(map(len, report.splitlines())) < 210


def test_nothing_is_left_but_the_report(broken, tmp_path):
    assert run(broken, "--out", tmp_path / "out").status == 70
    assert sorted(path.name.partition("-2")[0] for path in tmp_path.iterdir()) == ["case", "warpbrain-crash"]


def test_debug_shows_the_traceback(broken, tmp_path):
    ran = run(broken, "--out", tmp_path / "out", "--debug")
    assert ran.status == 70
    assert ran.err.startswith("Traceback (most recent call last):")
    assert LINE.search(ran.err)
    ran = warpbrain("--debug", "run", "--case", tmp_path / "nowhere")
    assert ran.status == 2
    assert "Traceback" in ran.err and ran.err.splitlines()[-1].startswith("warpbrain: error: ")


def test_a_folder_that_cannot_be_written_to(monkeypatch, tmp_path, capsys):
    """The report goes to the folder for temporary files, or nowhere."""
    away = tmp_path / "away"
    away.mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command.Path, "cwd", lambda: tmp_path / "none")
    monkeypatch.setattr(command.tempfile, "gettempdir", lambda: str(away))

    def fail():
        raise ZeroDivisionError("x")

    assert exit_status("warpbrain", fail) == 70
    assert len(list(away.iterdir())) == 1
    monkeypatch.setattr(command.tempfile, "gettempdir", lambda: str(tmp_path / "none"))
    assert exit_status("warpbrain", fail) == 70
    assert "its report could not be saved" in capsys.readouterr().err


def test_what_was_said_last_is_in_the_report(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    record = Record(("diagnose",), quiet=True)
    record.say("  weighing causes", "")

    def fail():
        raise KeyError("x")

    assert exit_status("warpbrain", fail, record) == 70
    assert "after 'weighing causes'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (MemoryError("Unable to allocate 9 TiB"), 1, "warpbrain: not enough memory: Unable to allocate 9 TiB\n"),
        (MemoryError(), 1, "warpbrain: not enough memory\n"),
        (InputError("x"), 2, "warpbrain: error: x\n"),
    ],
)
def test_what_is_no_defect(monkeypatch, tmp_path, capsys, error, status, line):
    monkeypatch.chdir(tmp_path)

    def fail():
        raise error

    assert exit_status("warpbrain", fail) == status
    assert capsys.readouterr().err == line
    assert list(tmp_path.iterdir()) == []
