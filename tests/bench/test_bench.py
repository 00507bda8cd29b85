"""The bench: the paper's numbers, the counts behind its last column, and its command line. No time is asserted."""

import json
import runpy
import sys
from datetime import date
from pathlib import Path

import pytest
from bodies import model_of
from command import Ran
from shapes import cube

from warpbrain.bench.measure import BODIES, count
from warpbrain.bench.table3 import MAIN_LOOP, TABLE3
from warpbrain.cases.shipped import SHIPPED
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.dynamics import PHASES
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

# Supplement, Table 3 [ms]: pre-processing, then mean and sd of internal forces, assembly, solve, integration, main loop
PAPER = {
    "st/coarse": (569, (27.44, 3.9), (18.32, 2.0), (63.36, 4.9), (4.95, 5.4), (118.78, 10.2)),
    "st/fine": (1026, (36.4, 3.6), (28.31, 2.5), (90.4, 5.3), (4.16, 1.2), (164.2, 8.9)),
    "mt/coarse": (2577, (70.93, 5.2), (55.43, 3.6), (174.03, 6.1), (5.91, 7.6), (310.9, 11.8)),
    "mt/fine": (9953, (126.99, 14.9), (136.8, 5.6), (437.54, 9.5), (5.27, 1.4), (710.87, 17.0)),
}


def bench(monkeypatch, capsys, *arguments: str) -> Ran:
    monkeypatch.setattr(sys, "argv", ["python -m warpbrain.bench", *arguments])
    with pytest.raises(SystemExit) as end:
        runpy.run_module("warpbrain.bench", run_name="__main__")
    captured = capsys.readouterr()
    return Ran(int(end.value.code or 0), captured.out, captured.err)


def test_the_papers_numbers():
    assert list(TABLE3) == list(PAPER)
    for name, (preprocessing, *phases) in PAPER.items():
        row = TABLE3[name]
        assert row.name == name
        assert row.preprocessing == preprocessing
        assert row.phases == dict(zip((*PHASES, MAIN_LOOP), phases, strict=True))
        assert row.case in SHIPPED
        assert row.tissue == {"st": "single", "mt": "multi"}[name[:2]]
        assert row.case == {"coarse": "phantom", "fine": "phantom-fine"}[name[3:]]


def system(cells: int, precision: str = "double") -> System:
    return System(model_of(cube(cells), Material(NeoHookean(1000.0))), "cpu", precision)


def test_counts_of_bytes_and_launches():
    small = system(2)
    moved, launches = count(small, 10)
    assert moved > 0
    assert launches > 0
    more, more_launches = count(small, 11)
    assert more > moved
    assert more_launches > launches
    # at least the matrix is read in an iteration of CG
    assert more - moved >= 72 * small.matrix.nnz
    larger, larger_launches = count(system(4), 10)
    # eight times the elements; a launch is a launch, whatever its size
    assert 5 * moved < larger < 9 * moved
    assert larger_launches == launches


def test_single_precision_moves_about_half():
    double, single = (count(system(3, precision), 10)[0] for precision in ("double", "single"))
    assert 0.5 < single / double < 0.6


@pytest.mark.slow(6)
def test_every_sample_is_written(monkeypatch, capsys, tmp_path):
    file = tmp_path / "bench.json"
    ran = bench(
        monkeypatch, capsys,
        "--rows", "st/coarse", "--steps", "3", "--warmup", "1", "--device", "cpu", "--json", str(file),
    )  # fmt: skip
    assert (ran.status, ran.err) == (0, "")
    assert [path.name for path in tmp_path.iterdir()] == ["bench.json"]
    header, under = ran.out.splitlines()[:2]
    assert "(cpu), double precision, CG to 1e-06, h = 1 ms" in header
    assert "warpbrain " in header
    assert "Warp " in header
    assert under.startswith("mean (sd) ms of 3 steps after 1")
    written = json.loads(file.read_text(encoding="utf-8"))
    assert {"warpbrain", "warp-lang", "python", "platform"} <= set(written["versions"])
    # a time says nothing without the machine, the day and what else ran
    assert written["host"]["processor"] and written["host"]["hardware_threads"] >= 1
    assert written["host"]["load"] >= -1.0 and date.fromisoformat(written["host"]["date"])
    [row] = written["rows"]
    assert row["row"] == "st/coarse"
    assert (row["precision"], row["tolerance"]) == ("double", 1e-6)
    assert row["nodes"] >= 2677
    assert row["blocks"] > row["nodes"]
    assert len(row["cg_iterations"]) == 3
    # the real load, solved: this is work
    assert min(row["cg_iterations"]) >= 3
    samples = row["milliseconds"]
    assert set(samples) >= {"pre-processing", *PHASES, MAIN_LOOP, "step without instruments"}
    assert len(samples["pre-processing"]) == len(samples["capture"]) == BODIES
    samples = {name: samples[name] for name in (*PHASES, MAIN_LOOP, "step without instruments")}
    for values in samples.values():
        assert len(values) == 3
        assert all(value > 0.0 for value in values)
    for i in range(3):
        assert samples[MAIN_LOOP][i] == pytest.approx(sum(samples[phase][i] for phase in PHASES))
    assert row["paper_milliseconds"][MAIN_LOOP] == [118.78, 10.2]
    # every line of the table stands beside the paper's
    for label in ("pre-processing", "and capture of the step", *PHASES, MAIN_LOOP, "step without instruments"):
        [line] = [line for line in ran.out.splitlines() if line.startswith(f"  {label} ")]
        assert float(line.split()[-1]) > 0.0
    assert f"{row['nodes']} nodes, {row['tetrahedra']} tetrahedra" in ran.out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--steps", "0"], "--steps 0: expected a whole number of at least 1"),
        (["--warmup", "-1"], "--warmup -1: expected a whole number of at least 1"),
        (["--tol", "0"], "--tol 0: expected a number between 0 and 1"),
        (["--tol", "nan"], "--tol nan: expected a number between 0 and 1"),
        (["--tol", "2"], "--tol 2: expected a number between 0 and 1"),
        (["--rows", "st/medium"], "--rows st/medium: expected some of st/coarse, st/fine, mt/coarse, mt/fine"),
        (["--rows", "st/coarse,"], "--rows : expected some of"),
        (["--rows", ""], "--rows : expected some of"),
        (["--device", "cuda:99"], "device 'cuda:99': not found on this machine (there are: cpu"),
    ],
)
def test_bad_arguments(monkeypatch, capsys, arguments, expected):
    ran = bench(monkeypatch, capsys, *arguments)
    assert ran.status == 2
    assert ran.err.startswith(f"python -m warpbrain.bench: error: {expected}")
    assert ran.err.count("\n") == 1
    assert ran.out == ""


@pytest.mark.parametrize("arguments", [["--steps", "x"], ["--precision", "half"], ["--nonsense"], ["--json"]])
def test_usage(monkeypatch, capsys, arguments):
    ran = bench(monkeypatch, capsys, *arguments)
    assert ran.status == 2
    assert ran.err.startswith("python -m warpbrain.bench: error: ")
    assert ran.err.count("\n") == 1


@pytest.mark.parametrize("name", ["none/bench.json", "."])
def test_a_file_that_cannot_be_written_is_known_before_measuring(monkeypatch, capsys, tmp_path: Path, name):
    ran = bench(monkeypatch, capsys, "--json", str(tmp_path / name))
    assert ran.status == 2
    assert ran.err.startswith(f"python -m warpbrain.bench: error: {tmp_path}")
    assert ran.out == ""
