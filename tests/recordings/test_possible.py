"""Recordings that no body can have are refused before anything is computed."""

import numpy as np
import pytest
from command import run, warpbrain
from folders import SIDE, write_recorded

from warpbrain.cases.checking import check_case

BEADS = "id,x,y,z,ux,uy,uz\na,10,10,10,0.1,0,-0.2\nb,20,15,25,0,{},-0.5\nc,5,5,28,0.3,0,-1\n"


@pytest.mark.parametrize(("move", "said"), [(9000.0, "moves 9 m"), (1e12, "moves 1e+09 m"), (60.0, "moves 60 mm")])
@pytest.mark.parametrize("command", ["run", "estimate", "diagnose"])
def test_a_point_that_moves_farther_than_the_body_is_long(tmp_path, move, said, command):
    """Of `diagnose` they ended in an IndexError of a figure."""
    folder = write_recorded(tmp_path / "case", files={"recordings/beads.csv": BEADS.format(move)})
    ran = warpbrain(command, "--case", folder, "--out", tmp_path / "out")
    assert ran.status == 2
    assert f"beads.csv: point 2: {said} in a body of 52 mm" in ran.err and ran.err.count("\n") == 1
    assert ran.out == ""
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("undrawn")
def test_as_far_as_the_body_is_long_is_remarked_on_only(tmp_path):
    far = 1000.0 * SIDE * np.sqrt(3.0) - 1.0
    folder = write_recorded(tmp_path / "case", files={"recordings/beads.csv": BEADS.format(far)})
    checked = check_case(folder)
    assert checked.problems == ()
    assert any("a point moves 51 mm: is the unit right?" in remark for remark in checked.remarks)
    assert run(folder, "--out", tmp_path / "out").status == 0


@pytest.mark.parametrize(("sigma", "said"), [(9000.0, "9 m"), (1e-6, "1e-06 mm")])
def test_a_noise_larger_than_the_body_or_finer_than_anything_measures(tmp_path, sigma, said):
    folder = write_recorded(tmp_path / "case", ("", ""))
    text = (folder / "case.toml").read_text()
    (folder / "case.toml").write_text(text.replace("sigma = 0.1", f"sigma = {sigma}"))
    [problem] = check_case(folder).problems
    assert f"beads.csv: sigma: a noise of {said} in a body of 52 mm" in str(problem)
