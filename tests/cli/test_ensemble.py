"""`warpbrain ensemble` from the outside: files, resumption after a kill, and what it refuses."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from busy import slowness
from command import run, warpbrain
from folders import write_recorded

from warpbrain.mesh.vtu import read_vtu
from warpbrain.report.ensemble import ensemble_lines

GREY, WHITE = (f"hyperelastic/{anatomy}" for anatomy in ("grey matter", "white matter"))
SOFT = ("mu = 1000.0", f'mu = 1000.0\nprior = "{GREY}"')
STIFF = ("mu = 3000.0", f'mu = 3000.0\nprior = "{WHITE}"')
#: Of a force that every draw can carry.
FORCE = ("total = [0.01, 0.02, -0.05]", "total = [0.001, 0.002, -0.005]")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return write_recorded(tmp_path_factory.mktemp("block"), SOFT, STIFF, FORCE)


def ensemble(case, *arguments):
    return warpbrain("ensemble", "--device", "cpu", "--processes", "1", "--case", case, *arguments)


def table(out: Path) -> list[dict[str, str]]:
    with (out / "samples.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def done(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("done") / "out"
    return ensemble(folder, "--samples", 5, "--out", out), out


def test_a_row_is_the_single_run_of_its_draw(folder, done, tmp_path):
    ran, out = done
    assert (ran.status, ran.err) == (0, "")
    rows = table(out)
    assert [row["sample"] for row in rows] == list("01234")
    assert {row["status"] for row in rows} == {"done"}
    alone = run(folder, "--sample", "3", "--to-rest", "--out", tmp_path / "alone")
    assert alone.status == 0, alone.err
    said = json.loads((tmp_path / "alone" / "summary.json").read_text())
    row = rows[3]
    for label in "12":
        modulus = said["case"]["tissues"][label]["shear_modulus_Pa"]
        assert float(row[f"tissue_{label}_shear_modulus_Pa"]) == modulus
        assert row[f"tissue_{label}_law"] == "neo-hookean"
    sizes = said["result"]["displacement_mm"]["all nodes"]
    assert float(row["displacement_all_nodes_largest_mm"]) == pytest.approx(sizes["largest"], rel=1e-6)
    assert float(row["displacement_all_nodes_mean_mm"]) == pytest.approx(sizes["mean"], rel=1e-6)
    assert int(row["steps"]) == len(said["solution"]["history"])
    for compared in said["recordings"]["compared"]:
        unit = compared["unit"]
        for when in ("before", "after"):
            error = compared[when]["root_mean_square"]
            assert float(row[f"rmse_{compared['name']}_{when}_{unit}"]) == pytest.approx(error, rel=1e-6)


def test_the_fields_are_those_of_the_samples(done):
    _, out = done
    parts = [np.load(path) for path in sorted((out / "samples").iterdir())]
    u = 1000.0 * np.concatenate([part["u"] for part in parts])
    assert len(u) == 5
    fields = read_vtu(out / "fields.vtu").point_data
    near = {"rtol": 1e-12, "atol": 1e-15}
    np.testing.assert_allclose(fields["displacement_mean"], sum(u) / 5, **near)
    np.testing.assert_allclose(fields["displacement_sd"], np.sqrt(sum((u - sum(u) / 5) ** 2) / 5), **near)
    sizes = np.sqrt((u**2).sum(axis=2))
    # of five samples the median is the third, 5 % lies a fifth of the way from the first to the second
    ordered = np.sort(sizes, axis=0)
    np.testing.assert_allclose(fields["size_p50"], ordered[2], **near)
    np.testing.assert_allclose(fields["size_p05"], ordered[0] + 0.2 * (ordered[1] - ordered[0]), **near)
    np.testing.assert_allclose(fields["size_p95"], ordered[4] - 0.2 * (ordered[4] - ordered[3]), **near)


def test_summary_and_print_agree(done):
    ran, out = done
    said = json.loads((out / "summary.json").read_text())
    assert said["result"]["done"] == 5 and said["result"]["failed"] == {}
    assert "samples: 5 done, 0 failed of 5" in ran.out and "95 %   over 5 samples" in ran.out
    assert said["result"]["percentiles_over_samples"] == 5 and "note" not in ran.out
    mean = said["result"]["mean_displacement_mm"]["all nodes"]["mean"]
    assert f"{mean:.3f}" in next(line for line in ran.out.splitlines() if line.startswith("  all nodes"))
    errors = [float(row["rmse_beads_after_mm"]) for row in table(out)]
    assert said["result"]["rmse_at_recordings"]["beads"]["nearest_sample"] == int(np.argmin(errors))
    assert said["samples_computed_in_these_seconds"] == 5


def test_percentiles_say_of_how_many_samples_they_are(done):
    said = json.loads((done[1] / "summary.json").read_text())["result"]
    lines = ensemble_lines({**said, "done": 3, "samples": 5, "failed": {"1": "no rest", "4": "no rest"}})
    assert any("all that follows is of the 3 that have an answer" in line for line in lines)
    assert sum("over 3 samples" in line for line in lines) == 2


def test_what_the_load_is_too_much_for_is_said_before_it_starts(tmp_path):
    heavy = ("total = [0.01, 0.02, -0.05]", "total = [0.0, 0.0, -1.0]")
    ran = ensemble(write_recorded(tmp_path / "case", SOFT, STIFF, heavy), "--samples", 2, "--out", tmp_path / "out")
    before, note, after = ran.out.partition("  note      the load may be too much for ")
    assert note and after.startswith("2 of 2 samples (0, 1): in a linear estimate it presses tissue to nothing")
    assert re.search(r"to nothing; all bear \d\d? % of it\. They may fail", after)
    assert "workers" not in before and "workers" in after


def test_again_computes_nothing_and_says_the_same(folder, done):
    ran, out = done
    before = {path: path.stat().st_mtime_ns for path in (out / "samples").iterdir()}
    again = ensemble(folder, "--samples", 5, "--out", out)
    assert again.status == 0
    assert "resumed   5 of 5 samples are there, 0 are missing" in again.out
    assert {path: path.stat().st_mtime_ns for path in (out / "samples").iterdir()} == before
    assert again.out.partition("samples: 5 done")[2] == ran.out.partition("samples: 5 done")[2]


def test_another_ensemble_is_refused(folder, done):
    _, out = done
    other = ensemble(folder, "--samples", 5, "--seed", 1, "--out", out)
    assert other.status == 2
    assert "out: holds another ensemble (case: block, samples: 5, chosen: draws 0 to 4 of seed 0 by" in other.err


def test_a_motion_over_two_processes_has_the_bits_of_one(folder, tmp_path):
    numbers = ["--samples", 6, "--steps", 5]
    one = ensemble(folder, *numbers, "--out", tmp_path / "one", "--batch", 4)
    two = warpbrain(
        "ensemble", "--device", "cpu", "--processes", "2", "--case", folder, *numbers, "--out", tmp_path / "two"
    )
    assert (one.status, two.status) == (0, 0), one.err + two.err
    assert (tmp_path / "one" / "samples.csv").read_bytes() == (tmp_path / "two" / "samples.csv").read_bytes()
    fields = [read_vtu(tmp_path / name / "fields.vtu").point_data for name in ("one", "two")]
    for name, values in fields[0].items():
        np.testing.assert_array_equal(values, fields[1][name])


@pytest.mark.slow(5)
def test_the_sweep_has_its_deviations_and_keeps_failures(folder, tmp_path):
    # Ogden's fits to the farthest curves are not all stable
    ran = ensemble(folder, "--grid", "--steps", 1, "--model", "ogden", "--gp", "coregionalised", "--out", tmp_path)
    assert ran.status == 0, ran.err
    rows = table(tmp_path)
    assert len(rows) == 289
    assert [(float(r["tissue_1_deviations"]), float(r["tissue_2_deviations"])) for r in rows[:18]] == [
        *((-2.0, -2.0 + 0.25 * k) for k in range(17)), (-1.75, -2.0),
    ]  # fmt: skip
    failed = [row for row in rows if row["status"] == "failed"]
    assert f"{289 - len(failed)} done, {len(failed)} failed of 289" in ran.out
    for row in failed:
        assert row["reason"].startswith("tissue ") and row["displacement_all_nodes_mean_mm"] == ""


def test_no_answer_at_all(tmp_path):
    crushed = write_recorded(tmp_path / "case", SOFT, STIFF, ("total = [0.01, 0.02, -0.05]", "total = [0, 0, -50.0]"))
    ran = ensemble(crushed, "--samples", 2, "--steps", 20, "--out", tmp_path / "out")
    assert ran.status == 1
    assert "no sample of 2 has an answer; the reasons are in" in ran.err
    assert all("turned inside out" in row["reason"] for row in table(tmp_path / "out"))


#: Dies when its third part is whole and not in its place.
KILLED = """
import os, signal, sys
from pathlib import Path
from warpbrain.cli import main

parts = 0

def watch(event, arguments):
    global parts
    if event == "os.rename" and Path(os.fspath(arguments[1])).match("part-*.npz"):
        parts += 1
        if parts == 3:
            os.kill(os.getpid(), signal.SIGKILL)

sys.addaudithook(watch)
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow(4)
def test_killed_it_goes_on_where_it_was(folder, tmp_path):
    """`kill -9` in the middle: what was computed is there and is not computed again, and the result is the same."""
    arguments = ["ensemble", "--case", str(folder), "--samples", "6", "--steps", "4"]
    arguments += ["--device", "cpu", "--processes", "1", "--batch", "1", "--out"]
    out = tmp_path / "killed"
    ran = subprocess.run([sys.executable, "-c", KILLED, *arguments, str(out)], stdout=subprocess.DEVNULL, check=False)
    assert ran.returncode == -signal.SIGKILL
    there = {path.name: path.stat().st_mtime_ns for path in out.glob("samples/part-*.npz")}
    assert len(there) == 2
    again = warpbrain(*arguments, out)
    assert again.status == 0, again.err
    assert f"resumed   {len(there)} of 6 samples are there, {6 - len(there)} are missing" in again.out
    after = {path.name: path.stat().st_mtime_ns for path in out.glob("samples/part-*.npz")}
    assert there.items() <= after.items() and len(after) == 6
    numbers = [number for path in out.glob("samples/part-*.npz") for number in np.load(path)["number"].tolist()]
    assert sorted(numbers) == list(range(6))
    assert warpbrain(*arguments, tmp_path / "whole").status == 0
    assert (tmp_path / "whole" / "samples.csv").read_bytes() == (out / "samples.csv").read_bytes()


@pytest.mark.slow(9)
@pytest.mark.skipif(os.name != "posix", reason="looks for processes as POSIX has them")
def test_killed_it_leaves_no_process(tmp_path):
    arguments = ["ensemble", "--case", "0529", "--tissue", "single", "--samples", "32", "--steps", "20"]
    arguments += ["--device", "cpu", "--processes", "2", "--out", str(tmp_path / "out")]
    with subprocess.Popen([sys.executable, "-m", "warpbrain", *arguments], stdout=subprocess.DEVNULL) as ran:
        end = time.monotonic() + 120.0
        while not any((tmp_path / "out").glob("samples/part-*.npz")):
            assert ran.poll() is None and time.monotonic() < end
            time.sleep(0.05)
        children = Path(f"/proc/{ran.pid}/task/{ran.pid}/children").read_text().split()
        assert len(children) >= 2
        ran.send_signal(signal.SIGKILL)
    end = time.monotonic() + 10.0
    while any(Path(f"/proc/{child}/task").exists() and not _ended(child) for child in children):
        assert time.monotonic() < end
        time.sleep(0.1)


@pytest.mark.slow(8)
@pytest.mark.usefixtures("ctrl_c")
def test_interrupted_it_is_gone_within_two_seconds(tmp_path):
    arguments = ["ensemble", "--case", "0529", "--tissue", "single", "--samples", "32", "--steps", "500"]
    arguments += ["--device", "cpu", "--processes", "2", "--out", str(tmp_path / "out")]
    command = [sys.executable, "-u", "-m", "warpbrain", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as ran:
        assert ran.stdout is not None
        assert any("workers" in line for line in ran.stdout)
        time.sleep(3.0)
        patience = 2.0 * slowness()
        start = time.monotonic()
        ran.send_signal(signal.SIGINT)
        _, err = ran.communicate(timeout=30 + patience)
        assert time.monotonic() - start < patience
    assert ran.returncode == 130
    assert err.strip() == "warpbrain: interrupted; nothing half-written was left"
    assert not list((tmp_path / "out").rglob(".*"))


def _ended(process: str) -> bool:
    try:
        return "State:\tZ" in Path(f"/proc/{process}/status").read_text()
    except OSError:
        return True


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--samples", "0"], "--samples 0: expected a whole number of at least 1"),
        (["--steps", "0"], "--steps 0: expected a whole number of at least 1"),
        (["--seed", "-1"], "--seed -1: expected a whole number of at least 0"),
        (["--batch", "0"], "--batch 0: expected auto or a whole number of at least 1"),
        (["--batch", "many"], "--batch many: expected auto or a whole number of at least 1"),
        (["--batch", "9999999"], "--batch 9999999: a sample takes"),
        (["--grid", "--seed", "1"], "--seed 1: means nothing with --grid"),
        (["--poisson", "0.5"], "--poisson 0.5: expected a number in the open interval (-1, 0.5)"),
        (["--tolerance", "0"], "--tolerance 0: expected a number between 0 and 1"),
        (["--device", "tpu"], "device 'tpu': not found on this machine"),
        (["--gp", "nobody"], "nobody"),
        (["--model", "jelly"], "model 'jelly': expected one of"),
        (["--dask", "somewhere"], "--dask somewhere: expected the address of a scheduler"),
        (["--dask", "local:0"], "--dask local:0: expected a whole number of workers of at least 1"),
        (["--dask", "local", "--processes", "2"], "--processes 2: means nothing with --dask"),
    ],
)
def test_bad_arguments(folder, tmp_path, arguments, message):
    alone = [] if "--dask" in arguments else ["--processes", "1"]
    ran = warpbrain("ensemble", "--case", folder, *alone, "--out", tmp_path / "out", *arguments)
    assert ran.status == 2
    assert message in ran.err
    assert not list(tmp_path.glob("out/*.csv"))


def test_a_case_without_groups(tmp_path):
    ran = ensemble(write_recorded(tmp_path / "case"), "--samples", 2, "--out", tmp_path / "out")
    assert ran.status == 2
    assert "[tissue.1] prior: missing, but a draw is of a group" in ran.err
    assert not (tmp_path / "out").exists()


def test_the_table_as_parquet(folder, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    ran = ensemble(folder, "--samples", 2, "--steps", 1, "--out", tmp_path)
    assert ran.status == 0, ran.err
    rows = parquet.read_table(tmp_path / "samples.parquet").to_pylist()
    for row, line in zip(rows, table(tmp_path), strict=True):
        assert {name: "" if value is None else str(value) for name, value in row.items()} == line


def test_overwriting_computes_all_anew(folder, tmp_path):
    out = tmp_path / "out"
    assert ensemble(folder, "--samples", 2, "--out", out).status == 0
    again = ensemble(folder, "--samples", 2, "--out", out)
    assert again.status == 0 and "resumed   2 of 2 samples are there" in again.out
    other = ensemble(folder, "--samples", 2, "--seed", 1, "--out", out)
    assert other.status == 2 and other.err.endswith("choose another folder, or --overwrite it\n")
    anew = ensemble(folder, "--samples", 2, "--seed", 1, "--out", out, "--overwrite")
    assert anew.status == 0 and "resumed" not in anew.out
    assert "warpbrain.log" in {path.name for path in out.iterdir()}
