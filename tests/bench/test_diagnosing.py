"""`python -m warpbrain.bench diagnose`: every stage of every run is printed and written."""

import json
import runpy
import sys

import pytest
from sinking_block import write_sinking


def bench(monkeypatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["python -m warpbrain.bench", "diagnose", *arguments])
    with pytest.raises(SystemExit) as end:
        runpy.run_module("warpbrain.bench", run_name="__main__")
    return int(end.value.code or 0)


@pytest.mark.slow(8)
def test_every_stage_is_written(monkeypatch, capsys, tmp_path):
    write_sinking(tmp_path / "case")
    asked = ("--case", str(tmp_path / "case"), "--device", "cpu", "--runs", "1", "--out", str(tmp_path / "new"))
    assert bench(monkeypatch, *asked) == 0
    [file] = (tmp_path / "new").iterdir()
    assert file.name.startswith("diagnose_cpu_20")
    written = json.loads(file.read_text(encoding="utf-8"))
    [run] = written["seconds"]
    stages = ["base", "candidates", "screening", "significance", "fits", "checks", "where", "what would be seen"]
    stages.append("next measurement")
    assert list(run) == [*stages, "total"] and sum(run[stage] for stage in stages) <= run["total"]
    printed = capsys.readouterr().out
    assert all(f"  {stage} " in printed for stage in run)


def test_runs_are_counted_from_one(monkeypatch, capsys):
    assert bench(monkeypatch, "--runs", "0") == 2
    assert "--runs 0: expected a whole number of at least 1" in capsys.readouterr().err
