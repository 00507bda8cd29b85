"""`warpbrain cases`: the list, one case, and what checking says."""

import json

import pytest
from command import run, warpbrain
from folders import write_folder, write_recorded

from warpbrain.cases.shipped import BEAM, RESECT, SHIPPED, STAND_INS


def test_the_list_names_every_case_and_says_what_a_stand_in_is():
    done = warpbrain("cases")
    assert done.status == 0 and done.err == ""
    head, *lines = done.out.splitlines()
    assert head.split() == ["case", "tissue", "origin", "nodes", "elements", "cm3", "recordings"]
    listed = [line.split() for line in lines]
    rows = {(row[0], row[1]): row for row in listed if row and row[0] in SHIPPED}
    assert set(rows) == {(name, tissue) for name, variants in SHIPPED.items() for tissue in variants}
    for (name, _), row in rows.items():
        measured = name in (*RESECT, *BEAM)
        assert row[2] == ("stand-in" if name in STAND_INS else "measured" if measured else "synthetic")
        assert int(row[3]) > 1000 and int(row[4]) > 4000
        assert float(row[5]) == 90.0 if name in BEAM else 1000.0 < float(row[5]) < 1700.0
    assert "not the patient's images" in done.out and "not these patients' anatomy" in done.out


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize("name", ["0529", pytest.param("phantom", marks=pytest.mark.slow(2))])
def test_show(tmp_path, name):
    done = warpbrain("cases", "show", name, "--tissue", "single", "--out", tmp_path / "a.png")
    assert done.status == 0, done.err
    assert ("not the patient's images" in done.out) == (name == "0529")
    assert "skull base" in done.out and "cm3" in done.out
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.usefixtures("drawn")
def test_show_refuses_a_place_it_cannot_write_to(tmp_path):
    done = warpbrain("cases", "show", "phantom", "--out", tmp_path / "none" / "a.png")
    assert done.status == 2
    assert done.out == ""
    assert "no such folder" in done.err
    (tmp_path / "case.toml").write_text("kept")
    done = warpbrain("cases", "show", "phantom", "--out", tmp_path / "case.toml")
    assert done.status == 2 and "case.toml: is there already: --overwrite replaces it" in done.err
    assert (tmp_path / "case.toml").read_text() == "kept"


def test_check_of_a_good_folder(tmp_path):
    done = warpbrain("cases", "check", write_recorded(tmp_path))
    assert done.status == 0 and done.err == ""
    assert "nothing is wrong with it" in done.out
    assert "27 cm3" in done.out and "quality" in done.out
    assert "beads: 3 tracked points, moved by" in done.out


def test_check_prints_every_problem_with_its_cure(tmp_path):
    folder = write_recorded(tmp_path, ("mu = 1000.0", "m = 1000.0"), ("poisson", "poison"))
    done = warpbrain("cases", "check", folder)
    assert done.status == 2
    assert "  problem   case.toml: [tissue.1] m: unknown key" in done.out
    assert "            -> did you mean 'poisson'?" in done.out
    assert done.err == f"warpbrain: error: {folder}: 3 problems, listed above\n"


def test_check_of_both_files_of_a_folder(tmp_path):
    folder = write_folder(tmp_path)
    (folder / "case-single.toml").write_text("[case]\n")
    done = warpbrain("cases", "check", folder)
    assert done.status == 2
    assert "case-single.toml: [mesh]: missing" in done.out
    assert "case.toml\n" in done.out and "nothing is wrong" in done.out


@pytest.mark.parametrize("action", ["check", "show"])
def test_no_such_case(action):
    done = warpbrain("cases", action, "0528")
    assert done.status == 2
    assert "did you mean '0529'?" in done.err


def test_schema():
    done = warpbrain("cases", "schema")
    assert done.status == 0
    assert json.loads(done.out)["title"] == "case.toml of warpbrain"


@pytest.mark.parametrize("legacy", [False, True])
def test_run_prints_the_error_at_each_recording(tmp_path, legacy):
    folder = write_recorded(tmp_path / "case")
    done = run(folder, "--out", tmp_path / "out", *(["--legacy-rmse"] if legacy else []))
    assert done.status == 0, done.err
    table = done.out.split("RMSE at recordings")[1].split("time [ms]")[0]
    assert [line.split()[0] for line in table.splitlines()[1:5]] == ["beads", "lid", "mesh", "cell"]
    assert ("sqrt(mm)" in table) == legacy
    assert "check" in table
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())["recordings"]
    beads, lid, cell = summary["compared"]
    assert beads["unit"] == "mm" and beads["before"]["root_mean_square"] == pytest.approx((1.4 / 3) ** 0.5)
    assert beads["noise_root_mean_square"] == pytest.approx(0.1 * 3**0.5)
    # the paper's formula: the root of the mean distance
    assert beads["before"]["legacy_sqrt_mm"] == pytest.approx(((0.05**0.5 + 0.26**0.5 + 1.09**0.5) / 3) ** 0.5)
    assert lid["role"] == "check" and "mesh_to_recording_after" in lid
    assert cell["unit"] == "N" and cell["after"]["root_mean_square"] == pytest.approx(0.001)
    rows = (tmp_path / "out" / "comparison.csv").read_text().splitlines()
    assert len(rows) == 1 + 3 + 3 + 1
    assert rows[1].startswith("beads,points,mm,0,a,10,10,10,0.1,0,-0.2,")


def test_run_refuses_what_cannot_be_simulated(tmp_path):
    prior = write_folder(tmp_path / "prior", ("mu = 1000.0", 'mu = "prior"\nprior = "MRE/abnormal"'))
    done = run(prior, "--out", tmp_path / "out")
    assert done.status == 2 and "[tissue.1] prior: the generative model" in done.err
    done = run(prior, "--mu", "1=900", "--out", tmp_path / "out")
    assert done.status == 0, done.err


def test_a_history_is_followed(tmp_path):
    """A boundary that is moved there and back is where its file says, at every time."""
    force = 'kind = "force"\ntotal = [0.01, 0.02, -0.05]'
    folder = write_folder(tmp_path, (force, 'kind = "displacement"\nvalue = "pull.csv"'))
    (folder / "pull.csv").write_text("t,ux,uy,uz\n0,0,0,0\n0.002,0,0,-0.4\n0.004,0,0,0.2\n")
    for steps, size in (("1", 0.2), ("2", 0.4), ("3", 0.1), ("4", 0.2), ("6", 0.2)):
        done = run(folder, "--steps", steps, "--out", tmp_path / "out", "--overwrite")
        assert done.status == 0, done.err
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert summary["result"]["displacement_mm"]["top"]["largest"] == pytest.approx(size), steps


@pytest.mark.parametrize("boundary", ['kind = "sliding"', 'kind = "pressure"\nvalue = 10.0'])
def test_sliding_and_pressure_are_simulated(tmp_path, boundary):
    force = 'kind = "force"\ntotal = [0.01, 0.02, -0.05]'
    folder = write_folder(tmp_path, (force, boundary))
    done = run(folder, "--out", tmp_path / "out")
    assert done.status == 0, done.err
