"""`python -m warpbrain.bench ensemble`: what it prints is what it writes, and what it counts."""

import json
import runpy
import sys

import pytest
from bodies import model_of
from command import Ran
from shapes import cube

from warpbrain.bench.batches import STEPS, count_bytes
from warpbrain.ensemble.batch import parts_of_clusters
from warpbrain.ensemble.workers import bytes_per_slot
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System


def bench(monkeypatch, capsys, *arguments: str) -> Ran:
    monkeypatch.setattr(sys, "argv", ["python -m warpbrain.bench", "ensemble", *arguments])
    with pytest.raises(SystemExit) as end:
        runpy.run_module("warpbrain.bench", run_name="__main__")
    captured = capsys.readouterr()
    return Ran(int(end.value.code or 0), captured.out, captured.err)


@pytest.mark.slow(3)
def test_every_time_is_written(monkeypatch, capsys, tmp_path):
    file = tmp_path / "bench.json"
    ran = bench(monkeypatch, capsys, "--device", "cpu", "--batches", "1,2", "--json", str(file))
    assert (ran.status, ran.err) == (0, "")
    written = json.loads(file.read_text())
    for line, measured in zip(ran.out.splitlines()[3:5], written["batches"], strict=True):
        slots, best, faster, iterations, megabytes, bandwidth, _ = (float(word) for word in line.split())
        assert slots == measured["slots"] == measured["samples"] and measured["failed"] == 0
        assert best == pytest.approx(min(measured["milliseconds"]), abs=1e-4)
        # as printed, with one decimal or, of bandwidth, none
        assert faster == pytest.approx(written["single_milliseconds"] / best, abs=0.06)
        assert iterations == pytest.approx(measured["cg_iterations"], abs=0.06)
        assert megabytes == pytest.approx(measured["bytes_per_step"] / 1e6, abs=0.06)
        assert bandwidth == pytest.approx(megabytes / best, abs=0.6)
    assert f"{STEPS} steps of 1 ms from rest" in ran.out


def test_counts_of_bytes(device: str) -> None:
    small, single, large = (
        System(model_of(cube(cells), Material(NeoHookean(1000.0))), device, precision)
        for cells, precision in ((2, "double"), (2, "single"), (4, "double"))
    )
    # displacements are in double precision always
    assert count_bytes(single, 0) < count_bytes(small, 0) < 2 * count_bytes(single, 0)
    assert count_bytes(small, 3) - count_bytes(small, 0) == 2 * (count_bytes(single, 3) - count_bytes(single, 0))
    assert bytes_per_slot(single) < bytes_per_slot(small) < 2 * bytes_per_slot(single)
    iteration = count_bytes(small, 11) - count_bytes(small, 10)
    # an iteration stays on the chip, or reads at least the matrix
    assert iteration == 0 if parts_of_clusters(small) is not None else iteration > 72 * len(small.pairs)
    # eight times the elements
    assert 5 * count_bytes(small, 10) < count_bytes(large, 10) < 9 * count_bytes(small, 10)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--batches", "0"], "--batches 0: expected whole numbers of at least 1"),
        (["--batches", "1,x"], "--batches 1,x: expected whole numbers of at least 1"),
        (["--processes", ""], "--processes : expected whole numbers of at least 1"),
        (["--samples", "0"], "--samples 0: expected a whole number of at least 1"),
        (["--device", "tpu"], "device 'tpu': not found"),
        (["--json", "nowhere/bench.json"], "nowhere: cannot be written to"),
    ],
)
def test_bad_arguments(monkeypatch, capsys, arguments, message):
    ran = bench(monkeypatch, capsys, *arguments)
    assert ran.status == 2
    assert message in ran.err
