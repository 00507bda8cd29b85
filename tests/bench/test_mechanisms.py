"""`python -m warpbrain.bench mechanisms`: what it prints is what it writes, and what the docs read."""

import json
import runpy
import sys

import pytest
from command import Ran
from mechanism_pages import read_costs, table

from warpbrain.bench.mechanisms import PLAIN, ratio
from warpbrain.physics.mechanisms import mechanisms


def bench(monkeypatch, capsys, *arguments: str) -> Ran:
    monkeypatch.setattr(sys, "argv", ["python -m warpbrain.bench", "mechanisms", *arguments])
    with pytest.raises(SystemExit) as end:
        runpy.run_module("warpbrain.bench", run_name="__main__")
    captured = capsys.readouterr()
    return Ran(int(end.value.code or 0), captured.out, captured.err)


@pytest.mark.slow(3)
def test_every_sample_is_written(monkeypatch, capsys, tmp_path):
    ran = bench(
        monkeypatch, capsys,
        "--device", "cpu", "--kinds", "swelling,viscoelasticity", "--steps", "3", "--equilibria", "1",
        "--out", str(tmp_path / "new"),
    )  # fmt: skip
    assert (ran.status, ran.err) == (0, "")
    [file] = (tmp_path / "new").iterdir()
    assert file.name.startswith("mechanisms_cpu_20") and file.suffix == ".json"
    written = json.loads(file.read_text(encoding="utf-8"))
    assert {"warpbrain", "warp-lang", "python", "platform"} <= set(written["versions"])
    assert [row["kind"] for row in written["rows"]] == [PLAIN, "swelling", "viscoelasticity"]
    for row, line in zip(written["rows"], ran.out.splitlines()[3:6], strict=True):
        assert row["example"] == ("" if row["kind"] == PLAIN else mechanisms()[row["kind"]].example)
        for side in ("plain", "with"):
            assert len(row["step"][side]) == len(row["cg_iterations"][side]) == 3
            assert len(row["newton"][side]) == len(row["newton_iterations"][side]) == 1
            assert min(row["step"][side] + row["newton"][side]) > 0.0
            assert min(row["cg_iterations"][side]) >= 3 and row["newton_iterations"][side][0] >= 2
        words = line.split()
        assert words[0] == row["kind"]
        assert float(words[1]) == pytest.approx(ratio(row["step"]), abs=0.006)
        assert float(words[4]) == pytest.approx(ratio(row["newton"]), abs=0.006)
    # the plain model beside itself does the same work
    plain = written["rows"][0]
    assert plain["cg_iterations"]["plain"] == plain["cg_iterations"]["with"]
    assert plain["newton_iterations"]["plain"] == plain["newton_iterations"]["with"]
    page = "\n".join(table(read_costs([file]), ["swelling"]))
    assert "swelling" in page and written["device"] in page and written["date"] in page


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--steps", "0"], "--steps 0: expected a whole number of at least 1"),
        (["--equilibria", "-1"], "--equilibria -1: expected a whole number of at least 1"),
        (["--kinds", "swelling,nothing"], "--kinds nothing: expected some of asymmetry"),
        (["--kinds", ""], "--kinds : expected some of asymmetry"),
        (["--device", "tpu"], "device 'tpu': not found"),
        (["--out", __file__], "cannot be made a folder for output"),
    ],
)
def test_bad_arguments(monkeypatch, capsys, arguments, message):
    ran = bench(monkeypatch, capsys, *arguments)
    assert ran.status == 2
    assert message in ran.err
    assert ran.out == ""
