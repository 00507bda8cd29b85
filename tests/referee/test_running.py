"""The tool is run as a user would, once for each case."""

import sys

import pytest
from said import label, sealed_labels

from referee import __main__ as command
from referee import run
from referee.errors import InputError


@pytest.fixture
def cases(tmp_path):
    for name in ("a", "b"):
        (tmp_path / "cases" / name).mkdir(parents=True)
        (tmp_path / "cases" / name / "case.toml").write_text("")
    (tmp_path / "cases" / "secret.txt").write_text("")
    return tmp_path / "cases"


def test_runs_are_listed_and_resumed(cases, tmp_path, monkeypatch):
    calls = []

    def runs(command, cwd, stdout, **_):
        from pathlib import Path
        from subprocess import CompletedProcess

        calls.append(command)
        # nothing but the case folder lies there
        assert [path.name for path in Path(cwd).iterdir()] == [Path(command[command.index("--case") + 1]).name]
        stdout.write("said")
        return CompletedProcess(command, 1 if command[5].endswith("b") else 0)

    monkeypatch.setattr(run, "_commit", lambda: "c0ffee")
    monkeypatch.setattr(run.subprocess, "run", runs)
    out = tmp_path / "out"
    assert run.run_all(cases, out, "cpu", 2, ["--ablation", "no-nuisances"]) == 1
    assert calls[0][:4] == [sys.executable, "-m", "warpbrain", "diagnose"]
    assert calls[0][-4:] == ["--device", "cpu", "--ablation", "no-nuisances"]
    rows = {row["case"]: row for row in run.read_runs(out)}
    assert rows["a"]["status"] == "0" and rows["b"]["status"] == "1"
    assert rows["a"]["commit"] == "c0ffee" and rows["a"]["arguments"].endswith("no-nuisances")
    assert (out / "a.log").read_text() == "said"
    run.run_all(cases, out, None, 1, [])
    assert len(calls) == 2


def test_a_case_that_takes_too_long_has_no_diagnosis(cases, tmp_path, monkeypatch):
    # not the tool but something that sleeps in its stead, and has written half of a folder
    tool = tmp_path / "python"
    tool.write_text('#!/bin/sh\nmkdir -p "${7}"\nexec sleep 60\n')
    tool.chmod(0o755)
    monkeypatch.setattr(run.sys, "executable", str(tool))
    out = tmp_path / "out"
    assert run.run_all(cases, out, None, 2, [], limit=0.5) == 1
    assert {row["status"] for row in run.read_runs(out)} == {"no diagnosis"}
    assert not (out / "a").exists() and "stopped after 0.5 s" in (out / "a.log").read_text()
    # it is not run again
    assert run.run_all(cases, out, None, 2, [], limit=0.5) == 1
    assert len(run.read_runs(out)) == 2


def test_a_folder_without_cases_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"no folder in it has a case\.toml"):
        run.run_all(tmp_path, tmp_path / "out", None, 1, [])


def test_a_mechanism_is_left_out_of_the_dictionary(cases, tmp_path, monkeypatch):
    calls = []

    def runs(words, **_):
        from subprocess import CompletedProcess

        calls.append(words)
        return CompletedProcess(words, 0)

    monkeypatch.setattr(run, "_commit", lambda: "c0ffee")
    monkeypatch.setattr(run.subprocess, "run", runs)
    words = ["run", "--cases", cases, "--out", tmp_path / "all", "--leave-out"]
    assert command.main([*map(str, words), "gravity"]) == 0
    dictionary = calls[0][calls[0].index("--candidates") + 1].split(",")
    assert "gravity" not in dictionary and {"pressure", "contact"} <= set(dictionary) and len(calls) == 2
    assert {row["left_out"] for row in run.read_runs(tmp_path / "all")} == {"gravity"}
    # of each case its own, which the labels tell
    assert command.main([*map(str, words), "each"]) == 2
    sealed_labels(tmp_path / "labels", label("a", "effect", ("pressure",), 9.0), label("b"))
    words[4] = tmp_path / "each"
    assert command.main([*map(str, words), "each", "--labels", str(tmp_path / "labels")]) == 0
    assert [(row["case"], row["left_out"]) for row in run.read_runs(tmp_path / "each")] == [("a", "pressure")]
    assert command.main([*map(str, words), "magic"]) == 2
